// What the page draws itself between two pictures of the server: a material, an object that is moved, lamps.
// The formulas are those of `studio/drawn.py`, which sends what they take.
import { bytes } from "./api";
import type { Crop, Picture } from "./picture";
import { pending } from "./store";
import type { State } from "./types";

export type Kind = "material" | "thing" | "lamps";
type Options = Record<string, unknown>;
type Numbers = Float32Array;

// --- Numbers: halves as they are sent, sRGB levels ---

const HALF = new Float32Array(65536);
for (let bits = 0; bits < 65536; bits++) {
  const [exponent, part] = [(bits >> 10) & 31, bits & 1023];
  const size = exponent ? 2 ** (exponent - 15) * (1 + part / 1024) : 2 ** -14 * (part / 1024);
  HALF[bits] = bits & 0x8000 ? -size : size;
}
const linear = (level: number) => (level <= 0.04045 ? level / 12.92 : ((level + 0.055) / 1.055) ** 2.4);
const encoded = (value: number) => (value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055);
/** Linear light of a level of 8 bits; the level of 16384 steps of linear light; linear light of 4096 levels. */
const LINEAR = Float32Array.from({ length: 256 }, (_, level) => linear(level / 255));
const STEPS = 16383;
const LEVEL = Uint8ClampedArray.from({ length: STEPS + 1 }, (_, step) => Math.round(encoded(step / STEPS) * 255));
const FINE = Float32Array.from({ length: 4096 }, (_, level) => linear(level / 4095));
const level = (value: number) => LEVEL[value <= 0 ? 0 : value >= 1 ? STEPS : (value * STEPS + 0.5) | 0]!;

/** A block of the server: its header, and its arrays by name. */
interface Block {
  header: Record<string, any>;
  arrays: Record<string, Numbers | Uint32Array | Uint8Array | Int8Array>;
}

function parsed(data: ArrayBuffer): Block {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const arrays: Block["arrays"] = {};
  let start = 4 + length;
  for (const [name, type, shape] of header.arrays as [string, string, number[]][]) {
    const count = shape.reduce((all, side) => all * side, 1);
    if (type === "float16") arrays[name] = Float32Array.from(new Uint16Array(data, start, count), (bits) => HALF[bits]!);
    else if (type === "uint32") arrays[name] = new Uint32Array(data, start, count);
    else arrays[name] = type === "int8" ? new Int8Array(data, start, count) : new Uint8Array(data, start, count);
    const size = count * { float16: 2, uint32: 4 }[type]! || count;
    start += size + (-size & 3);
  }
  return { header, arrays };
}

// --- A material ---

interface Hsv {
  h: Numbers;
  s: Numbers;
  v: Numbers;
}

/** Hue in sixths of the circle, saturation and value of linear colours, by their sRGB levels. */
function hsv(colours: ArrayLike<number>): Hsv {
  const count = colours.length / 3;
  const made = { h: new Float32Array(count), s: new Float32Array(count), v: new Float32Array(count) };
  for (let i = 0; i < count; i++) {
    const [r, g, b] = [0, 1, 2].map((c) => encoded(Math.min(Math.max(colours[3 * i + c]!, 0), 1))) as [number, number, number];
    const most = Math.max(r, g, b);
    const span = most - Math.min(r, g, b);
    made.v[i] = most;
    made.s[i] = most > 0 ? span / most : 0;
    if (span > 0) made.h[i] = most === r ? (g - b) / span : most === g ? 2 + (b - r) / span : 4 + (r - g) / span;
  }
  return made;
}

const given = (value: unknown) => value !== undefined && value !== null;
/** A property set to a number, or shifted by a signed text. */
function setter(value: unknown): (old: number) => number {
  if (!given(value)) return (old) => old;
  const number = Number(value);
  const shifts = typeof value === "string" && /^[+-]/.test(value);
  return shifts ? (old) => Math.min(Math.max(old + number, 0), 1) : () => number;
}

class Material {
  private hsv: Hsv;
  private plain: { text: string; rgb: number[]; hsv: Hsv } | null = null;
  readonly box: [number, number, number, number];

  constructor(private block: Block) {
    this.box = block.header.box;
    this.hsv = hsv(block.arrays.colour as Numbers);
  }

  /** Shade it into the levels of its box. */
  draw(options: Options, out: Uint8ClampedArray): void {
    const { header, arrays } = this.block;
    const { diffuse, specular, base, photo, colour, albedo, roughness, metallic, weight } = arrays as Record<string, Numbers>;
    const { gain, lit, added, matt: former, fitted_metallic: fitted } = arrays as Record<string, Numbers>;
    const { gloss, paint_shade: paintShade, metal_shade: metalShade } = arrays as Record<string, Numbers>;
    const limits = header.shade_limits as number[];
    const at = arrays.at as Uint32Array;
    const count = header.count as number;
    const levels = header.levels as number[];
    const [floor, black, r0] = [header.floor as number, header.black as number, header.r0 as number];
    const clipped = (header.clipped as number | null) ?? Infinity;
    const overall = header.overall as number[] | null;
    const [turn, sat, val] = ["hue", "saturation", "value"].map((name) => Number(options[name] ?? 0)) as [number, number, number];
    const shifts = turn !== 0 || sat !== 0 || val !== 0;
    const plain = given(options.albedo) ? this.plainOf(String(options.albedo)) : null;
    const painted = plain !== null || (header.textured as boolean);
    const [rough, metal] = [setter(options.roughness), setter(options.metallic)];
    const now = [0, 0, 0];
    const made = [0, 0, 0];
    let [known, low, part] = [NaN, 0, 0];
    for (let i = 0; i < count; i++) {
      const w = weight![i]!;
      // --- Its colour, turned, and mixed with the old one where the border fades ---
      if (shifts) this.shifted(now, plain?.hsv ?? this.hsv, plain ? 0 : i, turn / 60, sat, val);
      else for (let c = 0; c < 3; c++) now[c] = plain ? plain.rgb[c]! : colour![3 * i + c]!;
      let r = rough(roughness![i]!);
      let m = metal(metallic![i]!);
      // --- A new colour keeps fine shading and white gloss: `edits.material.material.edit` ---
      if (painted) {
        const brightest = Math.max(now[0]!, now[1]!, now[2]!, 1e-6);
        const limit = Math.max(1, (plain ? brightest : 1) * (limits[0]! + m * (limits[1]! - limits[0]!)));
        const shade = Math.min((paintShade![i]! + m * (metalShade![i]! - paintShade![i]!)) / limit, 1 / brightest);
        const white = (1 - m) * gloss![i]!;
        for (let c = 0; c < 3; c++) now[c] = now[c]! * shade + white * (1 - now[c]! * shade);
      }
      if (w < 1) {
        for (let c = 0; c < 3; c++) now[c] = albedo![3 * i + c]! + (now[c]! - albedo![3 * i + c]!) * w;
        r = roughness![i]! + (r - roughness![i]!) * w;
        m = metallic![i]! + (m - metallic![i]!) * w;
      }
      // --- The two levels of the tables around its roughness ---
      if (r !== known) {
        known = r;
        const held = Math.min(Math.max(r, levels[0]!), levels[levels.length - 1]!);
        low = 0;
        while (low < levels.length - 2 && levels[low + 1]! < held) low++;
        part = (held - levels[low]!) / (levels[low + 1]! - levels[low]!);
      }
      const first = 6 * (low * count + i);
      const second = first + 6 * count;
      const left = Math.min(Math.max(1 - m, 1e-3) / Math.max(1 - fitted![i]!, 1e-3), 1);
      // --- The edit's radiance, and how much of the fit's diffuse light the photo lacks: `missing_shade` ---
      let same = true;
      let [seen, diffused, weights] = [0, 0, 0];
      for (let c = 0; c < 3; c++) {
        const a = now[c]!;
        const light = diffuse![9 * i + c]! + r * (diffuse![9 * i + 3 + c]! + r * diffuse![9 * i + 6 + c]!);
        const s0 = specular![first + c]! + part * (specular![second + c]! - specular![first + c]!);
        const s1 = specular![first + 3 + c]! + part * (specular![second + 3 + c]! - specular![first + 3 + c]!);
        const edited = a * (1 - m) * light + (r0 * (1 - m) + m * a) * s0 + s1;
        const b = base![3 * i + c]!;
        const p = photo![3 * i + c]!;
        const old = former![3 * i + c]!;
        const change = Math.abs(a * (1 - m) - old);
        same &&= Math.abs(edited - b) <= 1e-4 + 2e-3 * b;
        seen += change * Math.max(p >= clipped ? Math.max(p, b) : p, 0);
        diffused += Math.min(old * Math.abs(edited - b), change * Math.max(b, 0));
        weights += change;
        made[c] = edited;
      }
      const least = black * weights + 1e-9;
      const shaded = 1 + left * (Math.min((seen + least) / (diffused + least), 1) - 1);
      // --- In the photo, whose own texture goes on: `edits.composite.into_photo` ---
      const place = 4 * at[i]!;
      for (let c = 0; c < 3; c++) {
        const edited = made[c]!;
        const b = base![3 * i + c]!;
        const p = photo![3 * i + c]!;
        let value: number;
        if (overall) {
          const held = p >= clipped ? Math.max(p, b) : p;
          const [before, after] = [Math.max(b, 0), Math.max(edited, 0)];
          const dimmed = overall[c]! * held;
          const moved = ((held + floor) * (after + floor)) / (before + floor) - floor;
          value = Math.min(Math.max(moved, Math.min(dimmed, after)), Math.max(dimmed, after));
        } else {
          const factor = Math.min((edited + floor) / (b + floor), 1) * left;
          const reference = shaded * b;
          const held = p >= clipped ? Math.max(p, reference) : p;
          value = Math.max(shaded * edited + factor * (held - reference), 0);
        }
        if (gain) value = value * gain[3 * i + c]! + now[c]! * (1 - m) * lit![3 * i + c]! + added![3 * i + c]!;
        out[place + c] = level(value);
      }
      if (same && !gain && !overall) for (let c = 0; c < 3; c++) out[place + c] = level(photo![3 * i + c]!);
    }
  }

  private plainOf(text: string) {
    if (this.plain?.text === text) return this.plain;
    const rgb = [1, 3, 5].map((place) => LINEAR[parseInt(text.slice(place, place + 2), 16)]!);
    return (this.plain = { text, rgb, hsv: hsv(rgb) });
  }

  /** `edits.material.shifted_hsv` of one pixel. */
  private shifted(out: number[], of: Hsv, i: number, turn: number, sat: number, val: number): void {
    const h = (((of.h[i]! + turn) % 6) + 6) % 6;
    let [s, v] = [of.s[i]!, of.v[i]!];
    s = sat > 0 ? s * (1 + sat * (1 - s)) : s * (1 + sat);
    v = val > 0 ? v + val * (1 - v) : v * (1 + val);
    for (let c = 0; c < 3; c++) {
      const k = ((c === 0 ? 5 : c === 1 ? 3 : 1) + h) % 6;
      const shown = v - v * s * Math.max(0, Math.min(k, 4 - k, 1));
      out[c] = FINE[shown <= 0 ? 0 : shown >= 1 ? 4095 : (shown * 4095 + 0.5) | 0]!;
    }
  }
}

// --- An object that is moved ---

class Thing {
  readonly under: Promise<ImageData>;
  constructor(private block: Block) {
    this.under = pixels(block);
  }

  /** The object at another place: nearer, and larger, as the ground there is. */
  draw(options: Options, out: ImageData): Crop {
    const { header, arrays } = this.block;
    const { gain, added } = arrays as Record<string, Numbers>;
    const [left, top, width, height] = header.box as number[] as [number, number, number, number];
    const from = header.at as [number, number];
    const to = (options.at as unknown[]).map(Number) as [number, number];
    const size = (Number(options.scale ?? 1) / header.scale) * (this.depth(from) / this.depth(to) || 1);
    const x0 = Math.max(Math.floor(to[0] + (left - from[0]) * size), 0);
    const y0 = Math.max(Math.floor(to[1] + (top - from[1]) * size), 0);
    const x1 = Math.min(Math.ceil(to[0] + (left + width - from[0]) * size), out.width);
    const y1 = Math.min(Math.ceil(to[1] + (top + height - from[1]) * size), out.height);
    for (let y = y0; y < y1; y++) {
      const row = (y + 0.5 - to[1]) / size + from[1] - top - 0.5;
      for (let x = x0; x < x1; x++) {
        const column = (x + 0.5 - to[0]) / size + from[0] - left - 0.5;
        const [i, j] = [Math.floor(row), Math.floor(column)];
        const [down, right] = [row - i, column - j];
        const place = 4 * (y * out.width + x);
        // Between four pixels of the sketch; beyond it the picture is left alone.
        let [kept, red, green, blue] = [1, 0, 0, 0];
        for (let corner = 0; corner < 4; corner++) {
          const [v, u] = [i + (corner >> 1), j + (corner & 1)];
          if (v < 0 || u < 0 || v >= height || u >= width) continue;
          const share = (corner >> 1 ? down : 1 - down) * (corner & 1 ? right : 1 - right);
          const source = v * width + u;
          kept += share * (gain![source]! - 1);
          red += share * added![3 * source]!;
          green += share * added![3 * source + 1]!;
          blue += share * added![3 * source + 2]!;
        }
        if (kept > 0.998 && red + green + blue === 0) continue;
        const light = out.data;
        light[place] = level(LINEAR[light[place]!]! * kept + red);
        light[place + 1] = level(LINEAR[light[place + 1]!]! * kept + green);
        light[place + 2] = level(LINEAR[light[place + 2]!]! * kept + blue);
      }
    }
    return [x0, y0, Math.max(x1 - x0, 0), Math.max(y1 - y0, 0)];
  }

  private depth([x, y]: [number, number]): number {
    const { header, arrays } = this.block;
    const [rows, columns] = header.arrays.find(([name]: [string]) => name === "depth")[2] as [number, number];
    const row = Math.min(Math.floor((y / header.size[1]) * rows), rows - 1);
    const column = Math.min(Math.floor((x / header.size[0]) * columns), columns - 1);
    return (arrays.depth as Numbers)[row * columns + column]!;
  }
}

// --- Lamps ---

const COARSE = 400_000; // pixels from which light is reckoned for every second one both ways

class Lamps {
  readonly under: Promise<ImageData>;
  constructor(private block: Block) {
    this.under = pixels(block);
  }

  /** All lamps on the surfaces, without shadows: `studio.live.sketch.light_lamps`. */
  draw(lamps: number[][], out: ImageData): void {
    const { header, arrays } = this.block;
    const [width, height] = header.size as [number, number];
    const focal = header.focal as number;
    const depth = arrays.depth as Numbers;
    const normal = arrays.normal as Int8Array;
    const matt = arrays.matt as Uint8Array;
    const least = header.radius ** 2;
    const ray = (x: number, y: number) => [(x + 0.5 - width / 2) / focal, -(y + 0.5 - height / 2) / focal];
    const shining = lamps.map(([x = 0, y = 0, away = 1, kelvin = 2700, power = 1]) => {
      const [across, up] = ray(Math.floor(x), Math.floor(y));
      const colour = this.colour(kelvin);
      return { at: [across! * away, up! * away, -away], colour, flux: colour.map((c) => (c * power * header.flux) / (4 * Math.PI) / Math.PI) };
    });
    const step = width * height > COARSE ? 2 : 1;
    const light = [0, 0, 0];
    for (let y = 0; y < height; y += step) {
      for (let x = 0; x < width; x += step) {
        const i = y * width + x;
        const z = depth[i]!;
        if (z <= 0) continue;
        const px = ((x + 0.5 - width / 2) / focal) * z;
        const py = (-(y + 0.5 - height / 2) / focal) * z;
        light[0] = light[1] = light[2] = 0;
        for (const lamp of shining) {
          const [wx, wy, wz] = [lamp.at[0]! - px, lamp.at[1]! - py, lamp.at[2]! + z];
          const facing = (wx * normal[3 * i]! + wy * normal[3 * i + 1]! + wz * normal[3 * i + 2]!) / 127;
          if (facing <= 0) continue;
          const squared = Math.max(wx * wx + wy * wy + wz * wz, least);
          const share = facing / (Math.sqrt(squared) * squared);
          for (let c = 0; c < 3; c++) light[c]! += share * lamp.flux[c]!;
        }
        for (let dy = 0; dy < step && y + dy < height; dy++)
          for (let dx = 0; dx < step && x + dx < width; dx++) {
            const place = (y + dy) * width + x + dx;
            for (let c = 0; c < 3; c++)
              out.data[4 * place + c] = level(LINEAR[out.data[4 * place + c]!]! + LINEAR[matt[3 * place + c]!]! * light[c]!);
          }
      }
    }
    for (const [k, lamp] of shining.entries()) this.glow(out, lamps[k]!, lamp.colour);
  }

  /** The lamp itself, where nothing stands before it. */
  private glow(out: ImageData, [x = 0, y = 0, away = 1]: number[], colour: number[]): void {
    const { header, arrays } = this.block;
    const [row, column] = [Math.floor(y), Math.floor(x)];
    const before = (arrays.depth as Numbers)[row * out.width + column]!;
    if (before > 0 && before < away) return;
    const radius = Math.max(1, Math.round((header.focal * header.radius) / away));
    const most = Math.max(...colour);
    for (let v = Math.max(row - radius, 0); v <= Math.min(row + radius, out.height - 1); v++)
      for (let u = Math.max(column - radius, 0); u <= Math.min(column + radius, out.width - 1); u++)
        if (Math.hypot(u - column, v - row) <= radius)
          for (let c = 0; c < 3; c++) out.data[4 * (v * out.width + u) + c] = level((colour[c]! / most) * 1.5);
  }

  private colour(kelvin: number): number[] {
    const known = this.block.header.kelvins as [number, number, number, number][];
    const place = Math.min(Math.max(known.findIndex(([k]) => k >= kelvin), 1), known.length - 1);
    const [low, high] = [known[place - 1]!, known[place]!];
    const part = Math.min(Math.max((kelvin - low[0]) / (high[0] - low[0]), 0), 1);
    return [1, 2, 3].map((c) => low[c]! + part * (high[c]! - low[c]!));
  }
}

/** The picture that came with a block, as levels. */
async function pixels({ arrays }: Block): Promise<ImageData> {
  const image = await createImageBitmap(new Blob([arrays.under as Uint8Array<ArrayBuffer>], { type: "image/jpeg" }));
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext("2d")!;
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, image.width, image.height);
}

// --- What is kept, and when it is asked for ---

interface Known {
  key: string;
  used: number;
  tool: Material | Thing | Lamps;
  under: ImageData | null;
}
const HOME: Record<string, Kind> = { material: "material", object: "thing", light: "lamps" };
const REST = 120; // milliseconds without a change before anything is asked for
const HELD = 600; // milliseconds for which a drag goes on with what it began with
const MATERIAL = ["hue", "saturation", "value", "albedo", "roughness", "metallic"];

class Drawn {
  picture: Picture | null = null;
  private known = new Map<Kind, Known>();
  private timer = 0;
  private asking = false;
  private state: State | null = null;
  private panel = "";
  /** Options of the material that the server has not answered for. */
  private moved: Options = {};
  /** Where the object was drawn last. */
  private covered: Crop = [0, 0, 0, 0];

  /** Get what the open panel's changes need, when nothing has moved for a moment. */
  follow(state: State | null, panel: string): void {
    this.state = state;
    this.panel = panel;
    if (!pending()) this.moved = {};
    clearTimeout(this.timer);
    const kind = HOME[panel];
    if (!this.wanted()) return this.tell(kind && this.ready(kind) ? kind : "");
    this.tell("");
    this.timer = window.setTimeout(() => void this.ask(), REST);
  }

  /** For whoever waits for it. */
  private tell(kind: string): void {
    document.getElementById("stage")!.dataset.drawn = kind;
  }

  private wanted(): Kind | null {
    const kind = HOME[this.panel];
    const key = kind && this.state?.drawn[kind];
    return key && this.known.get(kind)?.key !== key && this.picture?.paints ? kind : null;
  }

  private async ask(): Promise<void> {
    const kind = this.wanted();
    if (!kind || this.asking) return;
    // In the middle of a drag what it began with does.
    if (pending() || performance.now() - (this.known.get(kind)?.used ?? 0) < HELD) return this.follow(this.state, this.panel);
    this.asking = true;
    try {
      const key = this.state!.drawn[kind]!;
      const data = await bytes(`drawn/${kind}`);
      // What cannot be drawn here comes as nothing, and is not asked for again.
      if (!data.byteLength) return void this.known.set(kind, { key, used: 0, tool: null as never, under: null });
      const block = parsed(data);
      const tool = kind === "material" ? new Material(block) : kind === "thing" ? new Thing(block) : new Lamps(block);
      const under = tool instanceof Material ? null : await tool.under;
      this.known.set(kind, { key: block.header.key, used: 0, tool, under });
    } catch {
      this.known.delete(kind); // the server's pictures do
    } finally {
      this.asking = false;
    }
    this.tell(this.ready(kind) ? kind : "");
    if (this.wanted() !== kind) this.follow(this.state, this.panel);
  }

  private ready(kind: Kind): Known | null {
    const known = this.known.get(kind);
    if (!known?.tool || !this.state || !this.picture?.paints) return null;
    const fits = known.key === this.state.drawn[kind] || performance.now() - known.used < HELD;
    return fits ? known : null;
  }

  private use(kind: Kind): Known | null {
    const known = this.ready(kind);
    if (known) known.used = performance.now();
    return known;
  }

  /** Show the selection with these options of its material; false where the server has to. */
  material(options: Options): boolean {
    const known = this.use("material");
    Object.assign(this.moved, options);
    const before: Options = this.state?.current == null ? {} : this.state.steps[this.state.current]!.options;
    const after = { ...before, ...this.moved };
    // What is cleared that was not there changes nothing.
    const others = Object.keys(this.moved).filter((name) => !MATERIAL.includes(name) && given(after[name] ?? before[name]));
    if (others.length || !known || (given(after.albedo) && !/^#[0-9a-f]{6}$/i.test(String(after.albedo)))) return false;
    const tool = known.tool as Material;
    return this.picture!.paint(tool.box, (crop) => tool.draw(after, crop.data));
  }

  /** Show the current object at a place, or of a size. */
  thing(options: Options): boolean {
    const known = this.use("thing");
    if (!known) return false;
    const step = this.state!.steps[this.state!.current!]!;
    const tool = known.tool as Thing;
    const under = known.under!;
    return this.picture!.paint([0, 0, under.width, under.height], (out, fresh) => {
      // Taken away where it was, and drawn where it is.
      const before = fresh ? ([0, 0, under.width, under.height] as Crop) : this.covered;
      copy(under, out, before);
      this.covered = tool.draw({ ...step.options, ...options }, out);
      return union(before, this.covered);
    });
  }

  lamps(lamps: number[][]): boolean {
    const known = this.use("lamps");
    if (!known) return false;
    const under = known.under!;
    return this.picture!.paint([0, 0, under.width, under.height], (out) => {
      out.data.set(under.data);
      (known.tool as Lamps).draw(lamps, out);
    });
  }
}

function copy(from: ImageData, to: ImageData, [left, top, width, height]: Crop): void {
  for (let y = top; y < top + height; y++) {
    const first = 4 * (y * from.width + left);
    to.data.set(from.data.subarray(first, first + 4 * width), first);
  }
}

function union(one: Crop, two: Crop): Crop {
  if (!one[2] || !two[2]) return one[2] ? one : two;
  const [left, top] = [Math.min(one[0], two[0]), Math.min(one[1], two[1])];
  const right = Math.max(one[0] + one[2], two[0] + two[2]);
  return [left, top, right - left, Math.max(one[1] + one[3], two[1] + two[3]) - top];
}

export const drawn = new Drawn();
