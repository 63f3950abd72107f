// The page: bar above, tools over the picture's edge, panel beside, edits below.
import { useEffect, useRef, useState } from "preact/hooks";
import { Bar } from "./bar";
import { HelpSheet } from "./help";
import { Icon } from "./icons";
import { shortcuts } from "./keys";
import { OpenSheet } from "./opening";
import { Light } from "./panels/light";
import { Mesh } from "./mesh";
import { Look } from "./panels/look";
import { Material } from "./panels/material";
import { Things } from "./panels/object";
import { Progress } from "./progress";
import { Stage } from "./stage";
import { openFile, set, useView, view, type Panel } from "./store";
import { Strip } from "./strip";
import { t } from "./strings";
import { TakeSheet } from "./taking";
import { Tools } from "./tools";

const PANELS: Panel[] = ["material", "light", "object", "look"];
const HOMES: Record<string, Panel> = {
  edit: "material",
  glass: "material",
  relight: "light",
  insert: "object",
  drop: "object",
};

export function App() {
  const { state, panel, sheet, message, note, online, mesh } = useView();
  const dropping = useDrops();
  useEffect(shortcuts, []);
  useEffect(() => {
    document.title = state?.project ? `${state.project.title} · ${t.title}` : t.title;
  }, [state?.project?.title]);
  // An edit that is chosen, or made, shows its panel; after a reload the panel stays as it was.
  const step = state?.current == null ? undefined : state.steps[state.current];
  const chosen = step ? `${step.kind} ${state!.current}` : "";
  const before = useRef<string | null>(null);
  useEffect(() => {
    if (!state) return;
    const home = step && HOMES[step.kind];
    if (before.current !== null && home) set({ panel: home });
    before.current = chosen;
  }, [chosen, !state]);
  const usable = !!state?.project;
  return (
    <div class={`app ${usable ? "" : "without"}`}>
      <Bar />
      <main>
        <Stage />
        {usable && !mesh && <Tools />}
        {usable && mesh && state.ready && <Mesh />}
        <Progress />
        {message && (
          <div class="message" role="alert" id="message">
            <span>{message}</span>
            <button class="icon-only" aria-label={t.close} onClick={() => set({ message: "" })}>
              <Icon name="close" />
            </button>
          </div>
        )}
        <div class="note" role="status">
          {!online ? t.offline : note}
        </div>
      </main>
      {usable && (
        <aside aria-label={t.panels}>
          <nav role="tablist" aria-label={t.panels}>
            {PANELS.map((name, place) => (
              <button
                key={name}
                role="tab"
                id={`tab-${name}`}
                aria-selected={panel === name}
                tabIndex={panel === name ? 0 : -1}
                onClick={() => set({ panel: name })}
                onKeyDown={(event) => {
                  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
                  if (!by) return;
                  const next = PANELS[(place + by + PANELS.length) % PANELS.length]!;
                  set({ panel: next });
                  document.getElementById(`tab-${next}`)?.focus();
                }}
              >
                <Icon name={name} />
                <span>{t[name]}</span>
              </button>
            ))}
          </nav>
          <div class="panel" role="tabpanel" aria-labelledby={`tab-${panel}`} id="panel">
            {panel === "material" && <Material />}
            {panel === "light" && <Light />}
            {panel === "object" && <Things />}
            {panel === "look" && <Look />}
          </div>
        </aside>
      )}
      {usable && <Strip />}
      {sheet === "open" && <OpenSheet />}
      {sheet === "take" && <TakeSheet />}
      {sheet === "help" && <HelpSheet />}
      {dropping && <div class="dropping">{t.drop}</div>}
    </div>
  );
}

/** Photos that are dropped or pasted anywhere are opened; whether one hangs over the page. */
function useDrops(): boolean {
  const [over, setOver] = useState(false);
  useEffect(() => {
    let depth = 0;
    const has = (event: DragEvent) => !!event.dataTransfer?.types.includes("Files");
    const enter = (event: DragEvent) => {
      if (has(event)) setOver(++depth > 0);
    };
    const leave = (event: DragEvent) => {
      if (has(event)) setOver(--depth > 0);
    };
    const hover = (event: DragEvent) => {
      if (has(event)) event.preventDefault();
    };
    const drop = (event: DragEvent) => {
      if (!has(event)) return;
      event.preventDefault();
      depth = 0;
      setOver(false);
      const file = event.dataTransfer?.files[0];
      if (file) void openFile(file);
    };
    const paste = (event: ClipboardEvent) => {
      const file = event.clipboardData?.files[0];
      if (file && view.about) void openFile(file);
    };
    const pairs = { dragenter: enter, dragleave: leave, dragover: hover, drop, paste } as unknown as Record<string, EventListener>;
    for (const [name, listener] of Object.entries(pairs)) window.addEventListener(name, listener);
    return () => {
      for (const [name, listener] of Object.entries(pairs)) window.removeEventListener(name, listener);
    };
  }, []);
  return over;
}
