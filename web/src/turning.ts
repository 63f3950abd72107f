// The mesh of the scene, drawn to be turned: a small viewer of its own, which needs no library.

export type Skin = "picture" | "colours" | "shape";

const VERTEX = `#version 300 es
in vec3 position;
in vec4 colour;
uniform mat4 view, lens;
uniform vec2 frame; // tangents of half the photo's field of view
out vec3 at;
out vec2 place;
out vec4 own;
void main() {
  vec4 seen = view * vec4(position, 1.0);
  at = seen.xyz;
  own = colour;
  // Where the photo's camera saw it.
  place = vec2(position.x / -position.z / frame.x, position.y / position.z / frame.y) * 0.5 + 0.5;
  gl_Position = lens * seen;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at;
in vec2 place;
in vec4 own;
uniform sampler2D skin;
uniform bool laid;
out vec4 colour;
void main() {
  vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
  float light = 0.25 + 0.75 * abs(normal.z);
  vec3 clay = vec3(0.78, 0.77, 0.75) * light;
  if (own.a > 0.5) colour = vec4(laid ? own.rgb * (0.4 + 0.6 * light) : clay, 1.0);
  else colour = vec4(laid ? texture(skin, place).rgb : clay, 1.0);
}`;

interface Header {
  vertices: number;
  faces: number;
  fov: number;
  aspect: number;
  middle: number;
}

type Vector = [number, number, number];
const FAR = 1.45; // radians that it turns to a side: its back is not known

/** Draws a mesh as /api/mesh sends it. */
export class Turning {
  private gl: WebGL2RenderingContext;
  private program: WebGLProgram;
  private header: Header;
  private texture: WebGLTexture;
  private frame = 0;
  private laid = false;
  private yaw = 0;
  private pitch = 0;
  private away = 1;
  private moved: [number, number] = [0, 0];

  constructor(
    private canvas: HTMLCanvasElement,
    data: ArrayBuffer,
  ) {
    const gl = canvas.getContext("webgl2", { antialias: true });
    if (!gl) throw new Error("This browser draws no WebGL2.");
    this.gl = gl;
    const length = new DataView(data).getUint32(0, true);
    this.header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))) as Header;
    this.program = this.build();
    this.texture = gl.createTexture()!;
    this.fill(data, 4 + length);
  }

  private build(): WebGLProgram {
    const gl = this.gl;
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
    gl.bindAttribLocation(program, 0, "position");
    gl.bindAttribLocation(program, 1, "colour");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "");
    return program;
  }

  private fill(data: ArrayBuffer, start: number): void {
    const gl = this.gl;
    const { vertices, faces } = this.header;
    const block = (kind: number, from: number, bytes: number) => {
      gl.bindBuffer(kind, gl.createBuffer());
      gl.bufferData(kind, new Uint8Array(data, from, bytes), gl.STATIC_DRAW);
    };
    block(gl.ARRAY_BUFFER, start, vertices * 12);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.enableVertexAttribArray(0);
    block(gl.ARRAY_BUFFER, start + vertices * 12, vertices * 4);
    gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 0, 0);
    gl.enableVertexAttribArray(1);
    block(gl.ELEMENT_ARRAY_BUFFER, start + vertices * 16, faces * 12);
  }

  /** Lay a picture of the photo's frame on it, or none: bare shape. */
  lay(image: HTMLImageElement | null): void {
    const gl = this.gl;
    this.laid = !!image;
    if (image) {
      gl.bindTexture(gl.TEXTURE_2D, this.texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    }
    this.draw();
  }

  turn(right: number, up: number): void {
    const kept = (angle: number, most: number) => Math.min(Math.max(angle, -most), most);
    this.yaw = kept(this.yaw + right, FAR);
    this.pitch = kept(this.pitch + up, FAR);
    this.draw();
  }

  nearer(factor: number): void {
    this.away = Math.min(Math.max(this.away / factor, 0.1), 5);
    this.draw();
  }

  move(x: number, y: number): void {
    this.moved = [this.moved[0] + x, this.moved[1] + y];
    this.draw();
  }

  reset(): void {
    Object.assign(this, { yaw: 0, pitch: 0, away: 1, moved: [0, 0] });
    this.draw();
  }

  draw(): void {
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      this.paint();
    });
  }

  private paint(): void {
    const { gl, canvas, program, header } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, side * devicePixelRatio));
    Object.assign(canvas, { width, height });
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(program);
    // The whole frame of the photo is seen from where it was taken.
    const half = Math.tan((header.fov * Math.PI) / 360);
    const frame = [half, half / header.aspect];
    const aspect = canvas.width / canvas.height;
    const wide = aspect > header.aspect ? frame[1]! * aspect : half;
    const [near, far] = [header.middle / 100, header.middle * 50];
    // prettier-ignore
    const lens = [1 / wide, 0, 0, 0, 0, aspect / wide, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    const place = (name: string) => gl.getUniformLocation(program, name);
    gl.uniformMatrix4fv(place("lens"), false, lens);
    gl.uniformMatrix4fv(place("view"), false, this.view());
    gl.uniform2f(place("frame"), frame[0]!, frame[1]!);
    gl.uniform1i(place("laid"), Number(this.laid));
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.drawElements(gl.TRIANGLES, header.faces * 3, gl.UNSIGNED_INT, 0);
  }

  /** About the middle of the scene: first it is turned, then put before the eye. */
  private view(): number[] {
    const { middle } = this.header;
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const rows: Vector[] = [
      [cy, 0, sy],
      [sp * sy, cp, -sp * cy],
      [-cp * sy, sp, cp * cy],
    ];
    // Of the point (0, 0, -middle), which stays where it is.
    const shift = rows.map((row) => row[2] * middle);
    const [x, y, z] = [shift[0]! + this.moved[0] * middle, shift[1]! + this.moved[1] * middle, shift[2]! - middle * this.away];
    const columns = [0, 1, 2].flatMap((column) => [...rows.map((row) => row[column as 0 | 1 | 2]), 0]);
    return [...columns, x, y, z, 1];
  }
}
