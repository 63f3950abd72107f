// What lies under the pointer: asked when it rests, one question at a time, and kept while it stays on the same thing.
import { post } from "./api";

type Point = [number, number];
const REST = 110; // milliseconds
const LONG = 400; // milliseconds after which the page says that it is looking

class Pointing {
  outline = "";
  looking = false;
  changed: () => void = () => undefined;
  private asked: Point | null = null;
  private shape: Path2D | null = null;
  private at: Point | null = null;
  private timer = 0;
  private busy = false;
  private context = document.createElement("canvas").getContext("2d")!;

  over(at: Point): void {
    this.at = at;
    if (this.shape && this.holds(at)) return;
    this.show("", null);
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.ask(), REST);
  }

  out(): void {
    this.at = null;
    clearTimeout(this.timer);
    this.show("", null);
  }

  /** The place whose object is outlined, where a point lies in it: a click there takes just that. */
  place(at: Point): Point | null {
    return this.shape && this.holds(at) ? this.asked : null;
  }

  private holds(at: Point): boolean {
    return this.context.isPointInPath(this.shape!, at[0], at[1], "evenodd");
  }

  private show(outline: string, asked: Point | null): void {
    this.asked = asked;
    this.shape = outline ? new Path2D(outline) : null;
    if (outline === this.outline) return;
    this.outline = outline;
    this.changed();
  }

  private look(looking: boolean): void {
    if (looking === this.looking) return;
    this.looking = looking;
    this.changed();
  }

  private async ask(): Promise<void> {
    if (this.busy || !this.at) return;
    const asked = this.at;
    this.busy = true;
    const late = window.setTimeout(() => this.look(true), LONG);
    // Where nothing is found, as in the sky, nothing is outlined.
    const { region } = await post<{ region: string }>("point", { at: asked }).catch(() => ({ region: "" }));
    this.busy = false;
    clearTimeout(late);
    this.look(false);
    if (!this.at) return;
    const shape = region ? new Path2D(region) : null;
    if (shape && this.context.isPointInPath(shape, this.at[0], this.at[1], "evenodd")) this.show(region, asked);
    else if (Math.hypot(this.at[0] - asked[0], this.at[1] - asked[1]) > 3) void this.ask();
  }
}

export const pointing = new Pointing();
