// The stage: the picture, what is outlined on it, and what the pointer and the keys do there.
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { drawn } from "./drawn";
import { Marks } from "./marks";
import { Picture, type Box } from "./picture";
import { fitted, zoomed, type Size } from "./sight";
import { pointing } from "./pointing";
import { address } from "./api";
import { change, drop, set, useView, view, type Mode } from "./store";
import { t } from "./strings";

type Point = [number, number];

interface Gesture {
  mode: Mode;
  path: Point[];
}

const sized = (image: HTMLImageElement): Size => ({ width: image.naturalWidth, height: image.naturalHeight });

export function Stage() {
  const { state, tool, brush, comparing, split, before, dropped, jobs, working, exposure, clipped, panel, dropper } = useView();
  const frame = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const picture = useRef<Picture | null>(null);
  const [photo, setPhoto] = useState<Size>({ width: 0, height: 0 });
  const [room, setRoom] = useState<Size>({ width: 0, height: 0 });
  const [box, setBox] = useState<Box>({ left: 0, top: 0, width: 0, height: 0 });
  const [gesture, setGesture] = useState<Gesture | null>(null);
  const [cursor, setCursor] = useState<Point | null>(null);
  const [ring, setRing] = useState<Point | null>(null);
  const [, redraw] = useState(0);
  const fingers = useRef(new Map<number, PointerEvent>());
  const grip = useRef<PointerEvent | null>(null);

  const stage = state?.stage;
  const project = state?.project?.name ?? "";
  const expected = state?.expected?.name ?? "";
  const width = stage?.width ?? 0;
  const height = stage?.height ?? 0;
  const usable = width > 0 && !dropped;
  const steps = state?.steps ?? [];
  const on = steps.filter((step) => step.on);
  const final = stage?.badge.startsWith("Path traced") ?? false;

  // --- The picture's layers ---
  useEffect(() => {
    drawn.picture = picture.current = new Picture(canvas.current!);
    picture.current.onload = (layer, image) => {
      if (layer === "native") setPhoto(sized(image));
      if (layer === "plain") setPhoto((known) => (known.width ? known : sized(image)));
      if (layer === "plain") drawn.follow(view.state, view.panel);
    };
  }, []);
  useEffect(() => {
    const shown = picture.current!;
    if (dropped) {
      for (const layer of ["plain", "edited"] as const) shown.load(layer, "");
      shown.load("native", dropped);
    } else if (project) {
      shown.load("native", address("photo", { project }));
      shown.load("plain", address("photo", { project, working: "1" }));
    } else if (expected) {
      const found = jobs.find((job) => job.project === expected)?.found ?? [];
      if (found.includes("photo")) shown.load("native", address(`picture/${expected}/photo`));
      shown.load("plain", "");
      shown.load("edited", "");
    } else for (const layer of ["native", "plain", "edited"] as const) shown.load(layer, "");
    if (!dropped && !project && !expected) setPhoto({ width: 0, height: 0 });
  }, [dropped, project, expected, jobs]);
  useEffect(() => {
    if (!project || dropped) return;
    // Without edits the picture is the photo itself.
    picture.current!.load("edited", on.length && !stage?.bad ? (stage?.picture ?? "") : "", stage?.kept);
  }, [stage, project, dropped, on.length]);
  useEffect(() => {
    const replaced = on.some((step) => !["edit", "relight"].includes(step.kind));
    // Exposure and clipping are looked at, not changed: other panels show the picture as it is.
    const looked = panel === "look" ? { exposure, clipped } : { exposure: 0, clipped: false };
    picture.current!.show({ split: before ? 2 : comparing ? split : 0, whole: final, replaced, ...looked });
  }, [before, comparing, split, final, steps, panel, exposure, clipped]);

  useEffect(() => drawn.follow(state, panel), [state, panel]);

  // --- Where it lies ---
  useLayoutEffect(() => {
    const watcher = new ResizeObserver(([entry]) => {
      const { width, height } = entry!.contentRect;
      setRoom({ width, height });
    });
    watcher.observe(frame.current!);
    return () => watcher.disconnect();
  }, []);
  // The same photo with more pixels stays where it is.
  const proportions = photo.height ? Math.round((200 * photo.width) / photo.height) : 0;
  useLayoutEffect(() => setBox(fitted(photo, room)), [project || expected || dropped, proportions, room.width, room.height]);
  useLayoutEffect(() => picture.current?.place(box), [box]);

  const look = (factor: number, x: number, y: number, dx = 0, dy = 0) =>
    setBox((now) => (now.width ? zoomed(now, photo, room, factor, x, y, dx, dy) : now));
  // --- The photo's own pixels ---
  const own = state?.original && project && !dropped ? state.original[0] : photo.width;
  const native = own / devicePixelRatio; // width at which one pixel of the photo is one of the screen
  const percent = (box.width / Math.max(native, 1)) * 100;
  useEffect(() => {
    // Pictures that are larger than what came first are asked for when somebody looks closely.
    const close = box.width * devicePixelRatio > photo.width * 1.2 && own > photo.width;
    if (close && project && !dropped) picture.current!.load("native", address("photo", { project, full: "1" }));
  }, [box.width, own, photo.width, project, dropped]);
  const toOwn = () => {
    const close = Math.abs(percent - 100) < 1;
    if (close || !box.width) return setBox(fitted(photo, room));
    if (native >= fitted(photo, room).width) return look(native / box.width, room.width / 2, room.height / 2);
    // A photo that is smaller than the window lies in its middle.
    const height = (native * photo.height) / photo.width;
    setBox({ left: (room.width - native) / 2, top: (room.height - height) / 2, width: native, height });
  };
  view.zoomOwn = toOwn;
  const zoom = room.width ? box.width / Math.max(fitted(photo, room).width, 1) : 1;

  useEffect(() => {
    const element = frame.current!;
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const bounds = element.getBoundingClientRect();
      const step = Math.exp((-event.deltaY * (event.deltaMode ? 33 : 1)) / 400);
      look(step, event.clientX - bounds.left, event.clientY - bounds.top);
    };
    element.addEventListener("wheel", wheel, { passive: false });
    return () => element.removeEventListener("wheel", wheel);
  }, [photo, room]);

  // --- The pointer ---
  const at = (event: PointerEvent): Point => {
    const bounds = frame.current!.getBoundingClientRect();
    const clamp = (value: number, top: number) => Math.min(Math.max(value, 0), top - 0.01);
    const x = ((event.clientX - bounds.left - box.left) / box.width) * width;
    const y = ((event.clientY - bounds.top - box.top) / box.height) * height;
    return [clamp(x, width), clamp(y, height)];
  };
  const inside = (event: PointerEvent) => {
    const bounds = frame.current!.getBoundingClientRect();
    const x = event.clientX - bounds.left - box.left;
    const y = event.clientY - bounds.top - box.top;
    return x >= 0 && y >= 0 && x <= box.width && y <= box.height;
  };
  const modeOf = (event: { shiftKey: boolean; altKey: boolean }): Mode =>
    event.shiftKey ? "add" : event.altKey ? "remove" : view.mode;

  const down = (event: PointerEvent) => {
    fingers.current.set(event.pointerId, event);
    if (event.button === 1 || event.ctrlKey || event.metaKey) {
      grip.current = event;
      frame.current!.setPointerCapture(event.pointerId);
      event.preventDefault();
      return;
    }
    if (!event.isPrimary) return setGesture(null); // two fingers zoom
    if (event.button || !usable || !inside(event)) return;
    setCursor(null);
    frame.current!.setPointerCapture(event.pointerId);
    setGesture({ mode: modeOf(event), path: [at(event)] });
  };
  const move = (event: PointerEvent) => {
    const old = fingers.current.get(event.pointerId);
    const other = [...fingers.current.values()].find((finger) => finger.pointerId !== event.pointerId);
    if (old) fingers.current.set(event.pointerId, event);
    const bounds = frame.current!.getBoundingClientRect();
    if (old && other) {
      // Each of two fingers moves the middle by half.
      const far = (one: PointerEvent) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      const x = (old.clientX + other.clientX) / 2 - bounds.left;
      const y = (old.clientY + other.clientY) / 2 - bounds.top;
      const factor = far(event) / Math.max(far(old), 1);
      return look(factor, x, y, (event.clientX - old.clientX) / 2, (event.clientY - old.clientY) / 2);
    }
    if (grip.current) {
      const { clientX, clientY } = grip.current;
      grip.current = event;
      return look(1, 0, 0, event.clientX - clientX, event.clientY - clientY);
    }
    if (!event.isPrimary || !usable) return;
    setRing(tool === "brush" && inside(event) ? at(event) : null);
    if (gesture) return setGesture({ ...gesture, path: [...gesture.path, at(event)] });
    // A click that takes away takes a part, not the thing that is outlined.
    const outlines = tool === "click" && !dropper && modeOf(event) !== "remove";
    if (outlines && event.pointerType === "mouse" && inside(event)) pointing.over(at(event));
    else pointing.out();
  };
  const up = (event: PointerEvent) => {
    fingers.current.delete(event.pointerId);
    grip.current = null;
    if (!gesture || !event.isPrimary) return;
    finish(gesture.mode, [...gesture.path, at(event)], event.pointerType === "mouse");
    setGesture(null);
  };
  const finish = (mode: Mode, path: Point[], mouse: boolean) => {
    const first = path[0]!;
    const last = path[path.length - 1]!;
    // A swipe is no click: whoever meant to scroll, or to zoom, selects nothing.
    const far = (Math.hypot(last[0] - first[0], last[1] - first[1]) * box.width) / width;
    if (view.dropper) void drop(first);
    else if (tool === "box") {
      if (far > 4) void change("pick", { tool, mode, at: [...first, ...last] }, "", t.selecting);
    } else if (tool === "brush") {
      const points = path.slice(0, 20000);
      const painted = mode === "new" ? "add" : mode;
      void change("pick", { tool, mode: painted, points, radius: brush }, "", t.selecting);
    } else if (!mouse && far > 12) {
      return;
    } else if (tool === "lamp") {
      // At once, and not with the answer: by then another tool may have been taken.
      set({ panel: "light", tool: "click" });
      void change("lamp", { at: first, ...view.lamp });
    } else if (tool === "place") {
      set({ panel: "object", tool: "click" });
      void change("place", { at: last });
    } else {
      // Where something was edited the very place counts: an edited thing may lie within what is outlined.
      const place = (on.length ? null : pointing.place(first)) ?? first;
      void change("pick", { tool: "click", mode, at: place }, "", t.selecting).then(() => {
        // The outline under the pointer stays until the sharper one takes its place, a second later.
        pointing.out();
        follow();
      });
    }
  };

  // --- The keyboard ---
  const key = (event: KeyboardEvent) => {
    const middle: Point = [room.width / 2, room.height / 2];
    const place = cursor
      ? ([box.left + (cursor[0] / width) * box.width, box.top + (cursor[1] / height) * box.height] as Point)
      : middle;
    const factor = event.ctrlKey || event.metaKey ? 0 : { "+": 1.5, "=": 1.5, "-": 1 / 1.5, "0": 0.001 }[event.key];
    if (factor) return look(factor, ...place);
    if (!usable) return;
    const step = event.ctrlKey ? 1 : Math.max(width, height) / 40;
    const moves: Record<string, Point> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    const moved = moves[event.key];
    if (moved) {
      const [x, y] = cursor ?? [width / 2, height / 2];
      const clamp = (value: number, top: number) => Math.min(Math.max(value, 0), top - 1);
      setCursor([clamp(x + moved[0] * step, width), clamp(y + moved[1] * step, height)]);
      event.preventDefault();
    } else if ((event.key === "Enter" || event.key === " ") && cursor) {
      finish(modeOf(event), [cursor], true);
      event.preventDefault();
    }
  };

  useEffect(() => {
    pointing.changed = () => redraw((count) => count + 1);
  }, []);
  const listed = JSON.stringify([steps, state?.current]);
  useEffect(() => pointing.out(), [project, tool, dropped, dropper, listed]);

  const empty = !photo.width;
  const hint = working && working !== t.working ? working : "";
  return (
    <div
      ref={frame}
      id="stage"
      class={`stage ${usable ? (dropper ? "dropper" : tool) : "idle"} ${hint || pointing.looking ? "busy" : ""}`}
      tabIndex={0}
      role="application"
      aria-label={t.stage}
      data-kind={stage?.bad ? "bad" : final ? "final" : "live"}
      data-selected={stage?.region ? "yes" : ""}
      onPointerDown={down}
      onPointerMove={move}
      onPointerUp={up}
      onPointerCancel={(event) => {
        fingers.current.delete(event.pointerId);
        grip.current = null;
        setGesture(null);
      }}
      onPointerLeave={() => {
        pointing.out();
        setRing(null);
      }}
      onKeyDown={key}
      onDragStart={(event) => event.preventDefault()}
    >
      <canvas ref={canvas} aria-hidden="true" />
      {usable && !empty && (
        <Marks
          box={box}
          hover={gesture ? "" : pointing.outline}
          gesture={gesture}
          ring={ring}
          cursor={cursor}
          toPlace={at}
        />
      )}
      {comparing && usable && !empty && <Divider box={box} frame={frame} />}
      {usable && stage?.badge && !before && !dropper && <span class="badge">{stage.badge}</span>}
      {dropper && <span class="badge hint">{t.dropperHint}</span>}
      {pointing.looking && !dropper && !before && <span class="badge hint looking">{t.looking}</span>}
      {before && <span class="badge">{t.beforeLabel}</span>}
      {usable && !empty && (
        <div class="zoom" onPointerDown={(event) => event.stopPropagation()}>
          {Math.abs(zoom - 1) > 0.01 && (
            <button title={`${t.fit} (0)`} onClick={() => setBox(fitted(photo, room))}>
              {t.fitShort}
            </button>
          )}
          <button id="own-pixels" title={`${t.ownPixels} (Z)`} aria-label={t.ownPixels} aria-pressed={Math.abs(percent - 100) < 1} onClick={toOwn}>
            1:1
          </button>
          <span>{t.zoom(Math.round(percent))}</span>
        </div>
      )}
    </div>
  );
}

/** After a click on something that was edited before, its edit is the current one. */
function follow(): void {
  if (view.panel === "look") set({ panel: "material" });
}

function Divider({ box, frame }: { box: Box; frame: { current: HTMLDivElement | null } }) {
  const { split } = useView();
  const drag = (event: PointerEvent) => {
    const bounds = frame.current!.getBoundingClientRect();
    const share = (event.clientX - bounds.left - box.left) / box.width;
    set({ split: Math.min(Math.max(share, 0), 1) });
  };
  const line = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    Object.assign(line.current!.style, {
      left: `${box.left + split * box.width}px`,
      top: `${box.top}px`,
      height: `${box.height}px`,
    });
  }, [box, split]);
  return (
    <div
      ref={line}
      class="divider"
      role="slider"
      tabIndex={0}
      aria-label={t.divider}
      aria-valuenow={Math.round(split * 100)}
      aria-valuemin={0}
      aria-valuemax={100}
      onPointerDown={(event) => {
        event.stopPropagation();
        line.current!.setPointerCapture(event.pointerId);
      }}
      onPointerMove={(event) => line.current!.hasPointerCapture(event.pointerId) && drag(event)}
      onKeyDown={(event) => {
        const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
        if (!step) return;
        event.stopPropagation();
        set({ split: Math.min(Math.max(split + step, 0), 1) });
      }}
    >
      <span class="left">{t.beforeLabel}</span>
      <span class="right">{t.afterLabel}</span>
      <i aria-hidden="true">⇔</i>
    </div>
  );
}
