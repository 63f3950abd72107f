// What is drawn over the picture: outlines, strokes, handles of objects and lamps.
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { drawn } from "./drawn";
import { thing } from "./panels/object";
import type { Box } from "./picture";
import { change, optionsOf, pending, useView, view, type Mode } from "./store";
import { t } from "./strings";

type Point = [number, number];

interface Props {
  box: Box;
  hover: string;
  gesture: { mode: Mode; path: Point[] } | null;
  ring: Point | null;
  cursor: Point | null;
  toPlace: (event: PointerEvent) => Point;
}

export function Marks({ box, hover, gesture, ring, cursor, toPlace }: Props) {
  const { state, tool, brush, before, panel } = useView();
  const svg = useRef<SVGSVGElement>(null);
  const { width, height, region } = state!.stage;
  useLayoutEffect(() => {
    const { left, top } = box;
    Object.assign(svg.current!.style, {
      left: `${left}px`,
      top: `${top}px`,
      width: `${box.width}px`,
      height: `${box.height}px`,
    });
  }, [box]);
  const unit = width / Math.max(box.width, 1); // working pixels of one pixel of the screen
  const path = gesture?.path ?? [];
  const [first, last] = [path[0], path[path.length - 1]];
  return (
    <svg ref={svg} class={`marks ${before ? "hidden" : ""} ${panel === "material" ? "" : "faint"}`} viewBox={`0 0 ${width} ${height}`} preserveAspectRatio="none">
      {hover && <path class="hover" d={hover} fill-rule="evenodd" />}
      {region && (
        <>
          <path key={region.length} class="flash" d={region} fill-rule="evenodd" />
          <path class="ground" d={region} />
          <path class="ants" d={region} />
        </>
      )}
      {tool === "box" && first && last && (
        <rect
          class="trace"
          x={Math.min(first[0], last[0])}
          y={Math.min(first[1], last[1])}
          width={Math.abs(last[0] - first[0])}
          height={Math.abs(last[1] - first[1])}
        />
      )}
      {tool === "brush" && gesture && (
        <polyline
          class={`stroke ${gesture.mode}`}
          points={path.map((point) => point.join(",")).join(" ")}
          stroke-width={2 * brush}
        />
      )}
      {ring && <circle class="ring" cx={ring[0]} cy={ring[1]} r={brush} />}
      {cursor && (
        <g class="cross">
          <circle cx={cursor[0]} cy={cursor[1]} r={9 * unit} />
          <circle cx={cursor[0]} cy={cursor[1]} r={1.5 * unit} />
        </g>
      )}
      <Lamps unit={unit} toPlace={toPlace} />
      <Thing unit={unit} toPlace={toPlace} />
    </svg>
  );
}

interface HandleProps {
  at: Point;
  unit: number;
  kind: string;
  label: string;
  /** Where it was dragged, or moved by keys; resolves when the server has answered. */
  moved: (place: Point, from: Point) => Promise<void> | void;
  toPlace: (event: PointerEvent) => Point;
  /** Where it may be shown for a place of the pointer: on a ring, on a line. */
  bound?: (place: Point) => Point;
  removed?: () => void;
  colour?: string;
}

/** A handle that is dragged in the picture; it follows the pointer at once, and what it moves as the server answers. */
function Handle({ at, unit, kind, label, moved, toPlace, bound = (place) => place, removed, colour }: HandleProps) {
  const { width, height } = view.state!.stage;
  const [held, setHeld] = useState<Point | null>(null);
  // What a drag does is reckoned from where it began, whatever the server has made of it meanwhile.
  const grip = useRef<{ from: Point; by: Point; start: Point; moved: HandleProps["moved"] } | null>(null);
  const asked = useRef(0);
  const knob = useRef<SVGCircleElement>(null);
  const shown = held ?? at;
  useLayoutEffect(() => void (knob.current!.style.fill = colour ?? ""), [colour]);
  const send = (place: Point, from: Point, by = moved) => {
    const mine = ++asked.current;
    setHeld(bound(place));
    // It lies where it was put until what was put there is known.
    void Promise.resolve(by(place, from)).then(() => mine === asked.current && !grip.current && setHeld(null));
  };
  const drag = (event: PointerEvent) => {
    const start = grip.current;
    if (!start) return;
    const [x, y] = toPlace(event);
    // A press is no drag: who only points at it moves nothing.
    if (!held && Math.hypot(x - start.start[0], y - start.start[1]) < 3 * unit) return;
    send([x + start.by[0], y + start.by[1]], start.from, start.moved);
  };
  const release = (event: PointerEvent) => {
    drag(event);
    grip.current = null;
    const mine = asked.current;
    // The answer to the last place may have come while the pointer was still down.
    requestAnimationFrame(() => mine === asked.current && !pending() && setHeld(null));
  };
  const steps: Record<string, Point> = {
    ArrowLeft: [-1, 0],
    ArrowRight: [1, 0],
    ArrowUp: [0, -1],
    ArrowDown: [0, 1],
  };
  return (
    <g
      class={`handle ${kind}`}
      tabindex={0}
      role="button"
      aria-label={label}
      onPointerDown={(event) => {
        event.stopPropagation();
        (event.currentTarget as SVGGElement).setPointerCapture(event.pointerId);
        const start = toPlace(event);
        grip.current = { from: at, by: [shown[0] - start[0], shown[1] - start[1]], start, moved };
      }}
      onPointerMove={drag}
      onPointerUp={release}
      onPointerCancel={() => {
        grip.current = null;
        setHeld(null);
      }}
      onKeyDown={(event) => {
        if (removed && (event.key === "Delete" || event.key === "Backspace")) {
          event.preventDefault();
          return removed();
        }
        const step = steps[event.key];
        if (!step) return;
        event.stopPropagation();
        event.preventDefault();
        const far = event.ctrlKey ? 1 : 4;
        const clamp = (value: number, top: number) => Math.min(Math.max(value, 0), top);
        send([clamp(shown[0] + step[0] * far, width - 0.01), clamp(shown[1] + step[1] * far, height - 0.01)], at);
      }}
    >
      <title>{label}</title>
      <circle class="reach" cx={shown[0]} cy={shown[1]} r={16 * unit} />
      <circle ref={knob} class="knob" cx={shown[0]} cy={shown[1]} r={(kind === "thing" || kind === "lamp" ? 8 : 6) * unit} />
      {kind === "thing" && (
        <path class="arrows" d={`M${shown[0] - 15 * unit} ${shown[1]}h${30 * unit}M${shown[0]} ${shown[1] - 15 * unit}v${30 * unit}`} />
      )}
    </g>
  );
}

interface LampProps {
  lamp: number[];
  index: number;
  unit: number;
  toPlace: (event: PointerEvent) => Point;
}

const LEAST_RING = 18; // pixels of the screen
const RING = 18; // more, for a lamp of strength 1

/** A lamp in the picture: it is moved; the ring around it is its strength, the knob below how far away it hangs. */
function LampMarks({ lamp, index, unit, toPlace }: LampProps) {
  const { panel } = useView();
  const [x = 0, y = 0, depth = 1, kelvin = 2700, power = 1] = lamp;
  const ring = (LEAST_RING + RING * Math.sqrt(power)) * unit;
  const colour = kelvinColour(kelvin);
  const glow = useRef<SVGCircleElement>(null);
  useLayoutEffect(() => void (glow.current!.style.stroke = colour), [colour]);
  const strength = (place: Point) => {
    const far = Math.hypot(place[0] - x, place[1] - y) / unit;
    return Math.min(Math.max((Math.max(far - LEAST_RING, 0) / RING) ** 2, 0.05), 5);
  };
  return (
    <>
      <circle ref={glow} class="glow" cx={x} cy={y} r={ring} />
      {panel === "light" && (
        <>
          <Handle
            kind="strength"
            label={t.lampStrength(index + 1)}
            at={[x + ring, y]}
            unit={unit}
            toPlace={toPlace}
            bound={(place) => [Math.max(place[0], x + LEAST_RING * unit), y]}
            moved={(place) => setLamp(index, [x, y, depth, kelvin, strength([Math.max(place[0], x), y])])}
          />
          <Handle
            kind="depth"
            label={t.lampDistance(index + 1)}
            at={[x, y + ring]}
            unit={unit}
            toPlace={toPlace}
            bound={(place) => [x, place[1]]}
            moved={(place, from) => setLamp(index, [x, y, depth * Math.exp((from[1] - place[1]) / (150 * unit)), kelvin, power])}
          />
        </>
      )}
      <Handle
        kind="lamp"
        label={t.lampNumber(index + 1)}
        at={[x, y]}
        unit={unit}
        colour={colour}
        toPlace={toPlace}
        moved={([right, down]) => setLamp(index, [right, down, depth, kelvin, power])}
        removed={() => void setLamp(index, null)}
      />
    </>
  );
}

/** About the colour of a black body, as CSS has it. */
function kelvinColour(kelvin: number): string {
  const t = kelvin / 100;
  const red = t <= 66 ? 255 : 329.7 * (t - 60) ** -0.1332;
  const green = t <= 66 ? 99.47 * Math.log(t) - 161.12 : 288.12 * (t - 60) ** -0.0755;
  const blue = t >= 66 ? 255 : t <= 19 ? 0 : 138.52 * Math.log(t - 10) - 305.04;
  return `rgb(${[red, green, blue].map((value) => Math.round(Math.min(Math.max(value, 0), 255))).join(" ")})`;
}

function Lamps({ unit, toPlace }: { unit: number; toPlace: (event: PointerEvent) => Point }) {
  const { state } = useView();
  const lamps = lampsOf(optionsOf(state, "relight"));
  return (
    <>
      {lamps.map((lamp, index) => (
        <LampMarks key={index} lamp={lamp} index={index} unit={unit} toPlace={toPlace} />
      ))}
    </>
  );
}

export function lampsOf(options: Record<string, unknown>): number[][] {
  const lamps = options.lamps;
  return Array.isArray(lamps) ? lamps.filter(Array.isArray).map((lamp: string[]) => lamp.map(Number)) : [];
}

/** Change one lamp, or take it away (null). */
export function setLamp(index: number, lamp: number[] | null): Promise<void> {
  const lamps = lampsOf(optionsOf(view.state, "relight"));
  const after = lamps.flatMap((one, place) => (place !== index ? [one] : lamp ? [lamp] : []));
  return change("lamps", { index, lamp, quiet: lamp !== null && drawn.lamps(after) }, lamp ? `lamp ${index}` : "");
}

const FLAT = 0.4; // of the ring on the ground around an object, as it is seen

function Thing({ unit, toPlace }: { unit: number; toPlace: (event: PointerEvent) => Point }) {
  const { state } = useView();
  const step = state?.current == null ? undefined : state.steps[state.current];
  if (!step || !["insert", "drop"].includes(step.kind) || !step.on) return null;
  const at = placeOf(step.options.at);
  if (!at) return null;
  const scale = Number(step.options.scale ?? 1) || 1;
  const turn = Number(step.options.turn ?? 0) || 0;
  const ring = Math.max((scale * state!.stage.width) / 10, 30 * unit);
  const angleOf = (place: Point) => Math.atan2((place[1] - at[1]) / FLAT, place[0] - at[0]);
  const onRing = (angle: number): Point => [at[0] + ring * Math.cos(angle), at[1] + ring * FLAT * Math.sin(angle)];
  const far = (place: Point) => Math.max(Math.hypot(place[0] - at[0], place[1] - at[1]), 4 * unit);
  // In front is 0; it turns to the right, as its front does seen from above.
  const turned = (place: Point) => {
    const degrees = Math.round(90 - (angleOf(place) * 180) / Math.PI);
    return thing({ turn: ((degrees + 540) % 360) - 180 }, "turn");
  };
  const scaled = (place: Point, from: Point) => {
    const value = (scale * far(place)) / far(from);
    return thing({ scale: Math.round(Math.min(Math.max(value, 0.1), 5) * 100) / 100 }, "scale");
  };
  return (
    <>
      <ellipse class="ground-ring" cx={at[0]} cy={at[1]} rx={ring} ry={ring * FLAT} />
      {step.kind === "insert" && (
        <Handle
          kind="turn"
          label={t.turnHandle}
          at={onRing(Math.PI / 2 - (turn * Math.PI) / 180)}
          unit={unit}
          toPlace={toPlace}
          bound={(place) => onRing(angleOf(place))}
          moved={turned}
        />
      )}
      <Handle kind="scale" label={t.scaleHandle} at={[at[0] + ring * 0.8, at[1] - ring * 0.8]} unit={unit} toPlace={toPlace} moved={scaled} />
      <Handle
        kind="thing"
        label={t.moveHandle}
        at={at}
        unit={unit}
        toPlace={toPlace}
        moved={(place) => change("place", { at: place, quiet: drawn.thing({ at: place }) }, "place")}
      />
    </>
  );
}

function placeOf(value: unknown): Point | null {
  const numbers = String(value).split(",").map(Number);
  return numbers.length === 2 && numbers.every(Number.isFinite) ? [numbers[0]!, numbers[1]!] : null;
}
