// What is drawn over the picture: outlines, strokes, handles of objects and lamps.
import { useLayoutEffect, useRef } from "preact/hooks";
import type { Box } from "./picture";
import { change, optionsOf, useView, view, type Mode } from "./store";
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
  moved: (place: Point) => void;
  toPlace: (event: PointerEvent) => Point;
}

/** A handle that is dragged in the picture; what it moves follows. */
function Handle({ at, unit, kind, label, moved, toPlace }: HandleProps) {
  const { width, height } = view.state!.stage;
  const drag = (event: PointerEvent) => {
    const handle = event.currentTarget as SVGGElement;
    if (handle.hasPointerCapture(event.pointerId)) moved(toPlace(event));
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
      }}
      onPointerMove={drag}
      onKeyDown={(event) => {
        const step = steps[event.key];
        if (!step) return;
        event.stopPropagation();
        event.preventDefault();
        const far = event.ctrlKey ? 1 : 4;
        const clamp = (value: number, top: number) => Math.min(Math.max(value, 0), top);
        moved([clamp(at[0] + step[0] * far, width), clamp(at[1] + step[1] * far, height)]);
      }}
    >
      <circle class="reach" cx={at[0]} cy={at[1]} r={18 * unit} />
      <circle class="knob" cx={at[0]} cy={at[1]} r={8 * unit} />
      {kind === "lamp" && <circle class="glow" cx={at[0]} cy={at[1]} r={14 * unit} />}
      {kind === "thing" && (
        <path
          class="arrows"
          d={`M${at[0] - 15 * unit} ${at[1]}h${30 * unit}M${at[0]} ${at[1] - 15 * unit}v${30 * unit}`}
        />
      )}
    </g>
  );
}

function Lamps({ unit, toPlace }: { unit: number; toPlace: (event: PointerEvent) => Point }) {
  const { state } = useView();
  const lamps = lampsOf(optionsOf(state, "relight"));
  return (
    <>
      {lamps.map((lamp, index) => (
        <Handle
          key={index}
          kind="lamp"
          label={t.lampNumber(index + 1)}
          at={[lamp[0]!, lamp[1]!]}
          unit={unit}
          toPlace={toPlace}
          moved={([x, y]) => setLamp(index, [x, y, ...lamp.slice(2)])}
        />
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
  return change("lamps", { lamps: after }, "lamps");
}

function Thing({ unit, toPlace }: { unit: number; toPlace: (event: PointerEvent) => Point }) {
  const { state } = useView();
  const step = state?.current == null ? undefined : state.steps[state.current];
  if (!step || !["insert", "drop"].includes(step.kind) || !step.on) return null;
  const at = placeOf(step.options.at);
  if (!at) return null;
  const moved = (place: Point) => void change("place", { at: place }, "place");
  return <Handle kind="thing" label={t.placeHint} at={at} unit={unit} toPlace={toPlace} moved={moved} />;
}

function placeOf(value: unknown): Point | null {
  const numbers = String(value).split(",").map(Number);
  return numbers.length === 2 && numbers.every(Number.isFinite) ? [numbers[0]!, numbers[1]!] : null;
}
