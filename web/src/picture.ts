// The picture, at the photo's own resolution: the server sends the edit at working size, the fine detail is the photo's.

const VERTEX = `#version 300 es
uniform vec4 box; // left, top, width, height of the photo on the canvas, shares of the canvas
out vec2 at;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  at = corner;
  vec2 place = box.xy + corner * box.zw;
  gl_Position = vec4(place.x * 2.0 - 1.0, 1.0 - place.y * 2.0, 0.0, 1.0);
}`;

// All textures are decoded to linear light. Where the edit leaves the photo as it is, the photo itself is seen.
const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D native, plain, edited;
uniform float split;   // left of it the photo is shown
uniform bool whole;    // the edited picture has its own detail
uniform float gain;    // exposure of what is seen
uniform bool clipped;  // what has no detail left is marked
uniform bool replaced; // something stands where the photo's detail was
in vec2 at;
out vec4 colour;
void main() {
  vec3 photo = texture(native, at).rgb;
  vec3 seen = photo;
  if (at.x > split) {
    vec3 after = texture(edited, at).rgb;
    vec3 before = texture(plain, at).rgb;
    vec3 factor = clamp((after + 0.004) / (before + 0.004), 0.0, 4.0);
    vec3 moved = abs(after - before);
    if (replaced && max(max(moved.r, moved.g), moved.b) > 0.02) factor = vec3(0.0);
    seen = whole ? after : after + factor * (photo - before);
  }
  float most = max(max(seen.r, seen.g), seen.b) * gain;
  seen = clamp(seen * gain, 0.0, 1.0);
  if (clipped && most > 0.985) seen = vec3(1.0, 0.05, 0.05);
  if (clipped && most < 0.0006) seen = vec3(0.05, 0.1, 1.0);
  vec3 low = seen * 12.92;
  vec3 high = 1.055 * pow(seen, vec3(1.0 / 2.4)) - 0.055;
  colour = vec4(mix(high, low, lessThan(seen, vec3(0.0031308))), 1.0);
}`;

export interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

export interface Shown {
  /** Share of the width left of which the photo is shown; 0 for none of it. */
  split: number;
  whole: boolean;
  replaced: boolean;
  /** Stops. */
  exposure: number;
  clipped: boolean;
}

const SLOW = 45; // milliseconds between two frames of a drag
const PAUSE = 300; // after which it rests

type Layer = "native" | "plain" | "edited";
/** left, top, width, height in working pixels. */
export type Crop = [number, number, number, number];

export class Picture {
  private gl: WebGL2RenderingContext | null;
  private flat: CanvasRenderingContext2D | null = null;
  private program: WebGLProgram | null = null;
  private textures = new Map<Layer, WebGLTexture>();
  private images = new Map<Layer, HTMLImageElement>();
  private addresses = new Map<Layer, string>();
  private box: Box = { left: 0, top: 0, width: 0, height: 0 };
  private shown: Shown = { split: 0, whole: false, replaced: false, exposure: 0, clipped: false };
  private frame = 0;
  /** What was painted over the edited picture, and how often something was. */
  private patch: { crop: Crop; pixels: ImageData; over: HTMLImageElement } | null = null;
  private painted = 0;
  /** Whether only what was painted has changed since the last frame. */
  private onlyPatch = false;
  private dirty: Crop = [0, 0, 0, 0];
  /** When something was painted last, how often in a row that took long, and what ends that. */
  private hurry = { last: 0, slow: 0, timer: 0 };
  onload: (layer: Layer, image: HTMLImageElement) => void = () => undefined;

  constructor(private canvas: HTMLCanvasElement) {
    this.gl = canvas.getContext("webgl2", { alpha: true, preserveDrawingBuffer: true });
    if (this.gl) this.build(this.gl);
    else this.flat = canvas.getContext("2d"); // the picture at working size
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      if (!this.gl) return;
      this.textures.clear();
      this.build(this.gl);
      for (const [layer, image] of this.images) this.use(layer, image);
    });
  }

  private build(gl: WebGL2RenderingContext): void {
    const program = gl.createProgram()!;
    for (const [kind, text] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "");
    this.program = program;
  }

  /** Load a layer from an address; an empty one takes it away. `kept`: what is painted over the edited one stays. */
  load(layer: Layer, address: string, kept = false): void {
    const edited = layer === "edited";
    const stale = edited && !kept && this.patch !== null;
    if (this.addresses.get(layer) === address && !stale) return;
    this.addresses.set(layer, address);
    if (!address) {
      if (edited && kept) return;
      if (edited) this.patch = null;
      this.images.delete(layer);
      this.textures.delete(layer);
      return this.draw();
    }
    const image = new Image();
    const painted = this.painted;
    image.onload = () => {
      // Pictures may arrive out of order.
      if (this.addresses.get(layer) !== address) return;
      // What was painted meanwhile is newer.
      if (edited && !kept && painted === this.painted) this.patch = null;
      this.use(layer, image);
    };
    image.src = address;
  }

  /** Whether `paint` can do anything. */
  get paints(): boolean {
    return !!this.gl && this.images.has("plain");
  }

  /**
   * Change a part of the edited picture, or of the photo where there is none; false where that is path traced. `change`
   * gets what it made of these pixels the last time, or those of the picture, which are `fresh`; it may return which of
   * them it has changed.
   */
  paint(crop: Crop, change: (pixels: ImageData, fresh: boolean) => Crop | void): boolean {
    const plain = this.images.get("plain");
    const over = this.images.get("edited") ?? plain;
    if (!this.paints || !over || over.naturalWidth !== plain!.naturalWidth) return false;
    const known = this.patch;
    const same = known && known.over === over && known.crop.every((side, k) => side === crop[k]);
    const pixels = same ? known.pixels : pixelsOf(over, crop);
    const changed = change(pixels, !same) ?? crop;
    this.patch = { crop, pixels, over };
    this.dirty = same ? changed : crop;
    this.painted += 1;
    this.pace();
    if (!this.textures.has("edited")) this.fill("edited", plain!);
    this.lay(this.dirty);
    // Together with anything else that has changed, all is drawn.
    const alone = !this.frame;
    this.draw();
    this.onlyPatch = alone;
    return true;
  }

  /** Where frames of a drag take long, as without a graphics card, they have half the pixels until it rests. */
  private pace(): void {
    const { hurry } = this;
    const since = performance.now() - hurry.last;
    hurry.last += since;
    hurry.slow = since > PAUSE ? 0 : since > SLOW ? hurry.slow + 1 : hurry.slow;
    clearTimeout(hurry.timer);
    if (!this.hurried) return;
    hurry.timer = window.setTimeout(() => {
      hurry.slow = 0;
      this.draw();
    }, PAUSE);
  }

  private get hurried(): boolean {
    return this.hurry.slow >= 3;
  }

  /** Put what was painted, or a part of it, on the edited picture. */
  private lay(part = this.patch!.crop): void {
    const gl = this.gl!;
    const { crop, pixels, over } = this.patch!;
    const [left, top, width, height] = part;
    gl.bindTexture(gl.TEXTURE_2D, this.textures.get("edited")!);
    gl.pixelStorei(gl.UNPACK_ROW_LENGTH, crop[2]);
    const first = 4 * ((top - crop[1]) * crop[2] + left - crop[0]);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, left, top, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels.data, first);
    gl.pixelStorei(gl.UNPACK_ROW_LENGTH, 0);
    // Smaller copies are for when it is seen smaller; to make them takes longer than all else.
    if (this.box.width * devicePixelRatio < over.naturalWidth) gl.generateMipmap(gl.TEXTURE_2D);
  }

  has(layer: Layer): boolean {
    return this.images.has(layer);
  }

  private use(layer: Layer, image: HTMLImageElement): void {
    this.images.set(layer, image);
    this.fill(layer, image);
    if (layer === "edited" && this.patch && this.gl) this.lay();
    this.onload(layer, image);
    this.draw();
  }

  private fill(layer: Layer, image: HTMLImageElement): void {
    const gl = this.gl;
    if (!gl) return;
    const texture = this.textures.get(layer) ?? gl.createTexture()!;
    this.textures.set(layer, texture);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  place(box: Box): void {
    this.box = box;
    this.draw();
  }

  show(shown: Shown): void {
    if (JSON.stringify(shown) === JSON.stringify(this.shown)) return;
    this.shown = shown;
    this.draw();
  }

  draw(): void {
    this.onlyPatch = false;
    // Many changes of one frame are one drawing.
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      this.render();
    });
  }

  private render(): void {
    const { canvas, gl, box } = this;
    const scale = devicePixelRatio / (this.hurried ? 2 : 1);
    const width = Math.max(1, Math.round(canvas.clientWidth * scale));
    const height = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (canvas.width !== width || canvas.height !== height) {
      Object.assign(canvas, { width, height });
      this.onlyPatch = false;
    }
    if (!gl) return this.paintFlat(scale);
    gl.viewport(0, 0, width, height);
    this.limit(scale);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const plain = this.textures.get("plain") ?? this.textures.get("native");
    const native = this.textures.get("native") ?? plain;
    if (!native || !plain || !this.program) return;
    const edited = this.textures.get("edited");
    gl.useProgram(this.program);
    const place = (name: string) => gl.getUniformLocation(this.program!, name);
    gl.uniform4f(
      place("box"),
      (box.left * scale) / width,
      (box.top * scale) / height,
      (box.width * scale) / width,
      (box.height * scale) / height,
    );
    gl.uniform1f(place("split"), edited ? this.shown.split : 2);
    gl.uniform1i(place("whole"), Number(this.shown.whole));
    gl.uniform1i(place("replaced"), Number(this.shown.replaced));
    gl.uniform1f(place("gain"), 2 ** this.shown.exposure);
    gl.uniform1i(place("clipped"), Number(this.shown.clipped));
    [native, plain, edited ?? plain].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      // From near, the photo's own pixels are seen as such.
      const near = unit === 0 && box.width > 4 * (this.images.get("native")?.naturalWidth ?? 1e9);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, near ? gl.NEAREST : gl.LINEAR);
    });
    (["native", "plain", "edited"] as const).forEach((name, unit) => gl.uniform1i(place(name), unit));
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.disable(gl.SCISSOR_TEST);
  }

  /** Draw in the next frame only where something was painted, and what its interpolation reaches. */
  private limit(scale: number): void {
    const { gl, box, canvas, patch } = this;
    if (!this.onlyPatch || !patch) return;
    const unit = (box.width / patch.over.naturalWidth) * scale;
    const [left, top, width, height] = this.dirty.map((side) => side * unit) as Crop;
    const reach = 2 * unit + 2;
    gl!.enable(gl!.SCISSOR_TEST);
    gl!.scissor(
      Math.floor(box.left * scale + left - reach),
      Math.floor(canvas.height - box.top * scale - top - height - reach),
      Math.ceil(width + 2 * reach),
      Math.ceil(height + 2 * reach),
    );
  }

  private paintFlat(scale: number): void {
    const { flat, box } = this;
    const image = this.images.get("edited") ?? this.images.get("plain") ?? this.images.get("native");
    if (!flat || !image) return;
    flat.clearRect(0, 0, this.canvas.width, this.canvas.height);
    flat.drawImage(image, box.left * scale, box.top * scale, box.width * scale, box.height * scale);
    const photo = this.images.get("native");
    if (!photo || this.shown.split <= 0) return;
    flat.save();
    flat.beginPath();
    flat.rect(box.left * scale, box.top * scale, box.width * scale * this.shown.split, box.height * scale);
    flat.clip();
    flat.drawImage(photo, box.left * scale, box.top * scale, box.width * scale, box.height * scale);
    flat.restore();
  }
}

function pixelsOf(image: HTMLImageElement, [left, top, width, height]: Crop): ImageData {
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.drawImage(image, -left, -top);
  return context.getImageData(0, 0, width, height);
}
