// The tools of the pointer, over the picture's edge.
import { Icon } from "./icons";
import { keepMaterial, resize } from "./keys";
import { change, set, useView, type Mode, type Tool } from "./store";
import { t } from "./strings";

const TOOLS: [Tool, string][] = [
  ["click", t.click],
  ["box", t.box],
  ["brush", t.brush],
  ["lamp", t.lamp],
  ["place", t.place],
];
const MODES: Mode[] = ["new", "add", "remove"];
const SIGNS: Record<Mode, string> = { new: "◻", add: "+", remove: "−" };

export function Tools() {
  const { tool, mode, brush, state } = useView();
  const selecting = tool === "click" || tool === "box" || tool === "brush";
  return (
    <div class="tools" role="toolbar" aria-label={t.tools} aria-orientation="vertical">
      {TOOLS.map(([name, title], place) => (
        <button
          key={name}
          class="icon-only"
          aria-label={title}
          title={`${title} (${place + 1})`}
          aria-pressed={tool === name}
          onClick={() => set({ tool: name, ...(name === "place" ? { panel: "object" } : {}), ...(name === "lamp" ? { panel: "light" } : {}) })}
        >
          <Icon name={name} />
        </button>
      ))}
      {selecting && <hr />}
      {selecting &&
        MODES.map((name) => (
          <button
            key={name}
            class="icon-only sign"
            aria-label={t[name]}
            title={t[name]}
            aria-pressed={mode === name}
            onClick={() => set({ mode: name })}
          >
            {SIGNS[name]}
          </button>
        ))}
      {tool === "brush" && (
        <input
          class="brush-size"
          type="range"
          min={2}
          max={60}
          value={brush}
          aria-label={t.brushSize}
          title={t.brushSize}
          onInput={(event) => set({ brush: Number(event.currentTarget.value) })}
        />
      )}
      {state?.stage.clicked && (
        <>
          <button class="icon-only" id="smaller" aria-label={t.smaller} title={t.smaller} onClick={() => resize(false)}>
            <Icon name="smaller" />
          </button>
          <button class="icon-only" id="larger" aria-label={t.larger} title={t.larger} onClick={() => resize(true)}>
            <Icon name="larger" />
          </button>
          <button class="icon-only" id="same-material" aria-label={t.sameMaterial} title={t.sameMaterial} onClick={keepMaterial}>
            <Icon name="sameMaterial" />
          </button>
        </>
      )}
      {state?.stage.region && (
        <button class="icon-only" id="deselect" aria-label={t.deselect} title={t.deselect} onClick={() => void change("deselect")}>
          <Icon name="deselect" />
        </button>
      )}
    </div>
  );
}
