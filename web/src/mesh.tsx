// The mesh of the edited scene over the stage: drag turns it, the wheel brings it nearer.
import { useEffect, useRef, useState } from "preact/hooks";
import { address, bytes } from "./api";
import { Choice } from "./controls";
import { Icon } from "./icons";
import { set, tell, useView } from "./store";
import { t } from "./strings";
import { Turning, type Skin } from "./turning";

const STEP = 0.08; // radians, or a share of its distance
const SKINS: [Skin, string][] = [
  ["picture", t.skinPicture],
  ["colours", t.skinColours],
  ["shape", t.skinShape],
];

export function Mesh() {
  const { state } = useView();
  const canvas = useRef<HTMLCanvasElement>(null);
  const drawn = useRef<Turning | null>(null);
  const fingers = useRef(new Map<number, PointerEvent>());
  const [skin, setSkin] = useState<Skin>("picture");
  const [ready, setReady] = useState(0);
  const edits = JSON.stringify(state?.steps);
  useEffect(() => {
    let wanted = true;
    void bytes("mesh").then((data) => {
      if (!wanted) return;
      drawn.current = new Turning(canvas.current!, data);
      setReady((count) => count + 1);
    }, tell);
    return () => void (wanted = false);
  }, [edits]);
  useEffect(() => {
    if (!ready || skin === "shape") return drawn.current?.lay(null);
    const image = new Image();
    image.onload = () => drawn.current?.lay(image);
    image.src = skin === "colours" ? address("map/0", { of: String(ready) }) : address("photo", { edited: "1", of: String(ready) });
    return () => void (image.onload = null);
  }, [ready, skin]);
  useEffect(() => {
    const shown = canvas.current!;
    const watcher = new ResizeObserver(() => drawn.current?.draw());
    watcher.observe(shown);
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      drawn.current?.nearer(Math.exp(-event.deltaY / 400));
    };
    shown.addEventListener("wheel", wheel, { passive: false });
    shown.focus();
    return () => watcher.disconnect();
  }, []);
  const move = (event: PointerEvent) => {
    const old = fingers.current.get(event.pointerId);
    if (!old) return;
    const other = [...fingers.current.values()].find((finger) => finger.pointerId !== event.pointerId);
    fingers.current.set(event.pointerId, event);
    const size = canvas.current!.clientWidth;
    const [x, y] = [(event.clientX - old.clientX) / size, (event.clientY - old.clientY) / size];
    if (other) {
      const far = (one: PointerEvent) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      drawn.current?.nearer(far(event) / Math.max(far(old), 1));
    } else if (event.buttons === 2 || event.shiftKey) drawn.current?.move(x, -y);
    else drawn.current?.turn(2 * x, 2 * y);
  };
  const key = (event: KeyboardEvent) => {
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [-STEP, 0],
      ArrowRight: [STEP, 0],
      ArrowUp: [0, -STEP],
      ArrowDown: [0, STEP],
    };
    const by = turns[event.key];
    if (by && event.shiftKey) drawn.current?.move(by[0], -by[1]);
    else if (by) drawn.current?.turn(...by);
    else if (event.key === "+" || event.key === "=") drawn.current?.nearer(1.2);
    else if (event.key === "-") drawn.current?.nearer(1 / 1.2);
    else if (event.key === "0") drawn.current?.reset();
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const release = (event: PointerEvent) => void fingers.current.delete(event.pointerId);
  return (
    <div class="mesh" id="mesh" data-ready={ready ? "yes" : ""}>
      <canvas
        ref={canvas}
        tabIndex={0}
        role="application"
        aria-label={t.meshHint}
        onPointerDown={(event) => {
          fingers.current.set(event.pointerId, event);
          canvas.current!.setPointerCapture(event.pointerId);
        }}
        onPointerMove={move}
        onPointerUp={release}
        onPointerCancel={release}
        onContextMenu={(event) => event.preventDefault()}
        onKeyDown={key}
      />
      <div class="mesh-bar">
        <Choice label={t.skin} value={skin} options={SKINS} changed={(value) => setSkin(value as Skin)} />
        <button class="quiet" onClick={() => drawn.current?.reset()}>
          {t.fromFront}
        </button>
        <button class="icon-only" aria-label={t.close} title={`${t.close} (Esc)`} onClick={() => set({ mesh: false })}>
          <Icon name="close" />
        </button>
      </div>
      <p class="soft">{ready ? t.meshWords : t.working}</p>
    </div>
  );
}
