// Keys that work anywhere on the page but where text is typed.
import { t } from "./strings";
import { change, set, view, type Panel, type Tool } from "./store";

const TOOLS: Tool[] = ["click", "box", "brush", "lamp", "place"];

/** With Shift; by place on the keyboard, as what Shift makes of a digit differs. */
const PANELS: Record<string, Panel> = { Digit1: "material", Digit2: "light", Digit3: "object", Digit4: "look" };

export function undo(again: boolean): void {
  // Asked when it is its turn: keys come faster than answers.
  void change("undo", { again }, "", "", () => !!(again ? view.state?.redo : view.state?.undo));
}

export function resize(larger: boolean): void {
  if (view.state?.stage.clicked) void change("resize", { larger }, "", t.selecting);
}

export function keepMaterial(): void {
  if (view.state?.stage.clicked) void change("material", {}, "", t.selecting);
}

function typing(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.matches("textarea, input:not([type=range], [type=checkbox], [type=color])");
}

export function shortcuts(): () => void {
  const down = (event: KeyboardEvent) => {
    if (event.defaultPrevented) return;
    if (event.key === "Escape") return escape();
    if (typing(event.target)) return;
    if (event.ctrlKey || event.metaKey) {
      const key = event.key.toLowerCase();
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      return undo(key === "y" || event.shiftKey);
    }
    if (view.sheet || event.altKey) {
      if (event.key === "?") set({ sheet: "" });
      return;
    }
    const { state } = view;
    const key = event.key.toLowerCase();
    if (event.key === "?") set({ sheet: "help" });
    if (!state?.project) return;
    const tool = TOOLS[Number(event.key) - 1];
    const panel = PANELS[event.code];
    if (event.shiftKey && panel) set({ panel });
    else if (tool) set({ tool, dropper: null });
    else if (key === "[" || key === "]") resize(key === "]");
    else if (key === "s") keepMaterial();
    else if (key === "b") set({ before: true });
    else if (key === "c") set({ comparing: !view.comparing });
    else if (key === "f") void change("final");
    else if (key === "z") view.zoomOwn();
    else if (key === "m") set({ mesh: !view.mesh });
    else if (event.key === "Delete" && state.current !== null)
      void change("act", { action: "remove", index: state.current });
  };
  const over = () => view.before && set({ before: false });
  window.addEventListener("keydown", down);
  window.addEventListener("keyup", over);
  window.addEventListener("blur", over);
  return () => {
    window.removeEventListener("keydown", down);
    window.removeEventListener("keyup", over);
    window.removeEventListener("blur", over);
  };
}

function escape(): void {
  if (view.message) set({ message: "" });
  else if (view.dropper) set({ dropper: null });
  else if (view.mesh) set({ mesh: false });
  else if (view.sheet && (view.state?.project || view.state?.expected)) set({ sheet: "" });
  else if (view.sheet === "help") set({ sheet: view.state?.project ? "" : "open" });
  else if (view.tool !== "click") set({ tool: "click" });
  else if (view.state?.stage.region || view.state?.current !== null) void change("deselect");
}
