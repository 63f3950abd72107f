// The bar: photos, the title, undo, compare, the final picture, taking away.
import { Icon } from "./icons";
import { undo } from "./keys";
import { chooseTheme, shownTheme } from "./theme";
import { change, set, useView, working } from "./store";
import { t } from "./strings";

export function Bar() {
  const { state, comparing, sheet } = useView();
  const usable = !!state?.project;
  const edited = !!state?.steps.some((step) => step.on);
  const title = state?.project?.title ?? state?.expected?.title ?? t.title;
  const dark = shownTheme() === "dark";
  const release = () => set({ before: false });
  return (
    <header class="bar">
      <button class="photos" aria-label={t.photos} title={t.photos} aria-expanded={sheet === "open"} onClick={() => set({ sheet: sheet === "open" ? "" : "open" })}>
        <Icon name="photos" />
        <span>{t.photos}</span>
      </button>
      <h1 title={title}>{title}</h1>
      {usable && (
        <>
          <div class="group-of" role="group">
            <button class="icon-only" id="undo" aria-label={t.undo} title={`${t.undo} (Ctrl Z)`} disabled={!state.undo} onClick={() => undo(false)}>
              <Icon name="undo" />
            </button>
            <button class="icon-only" id="redo" aria-label={t.redo} title={`${t.redo} (Ctrl Shift Z)`} disabled={!state.redo} onClick={() => undo(true)}>
              <Icon name="redo" />
            </button>
          </div>
          <div class="group-of" role="group">
            <button
              class="icon-only"
              id="before"
              aria-label={t.before}
              title={`${t.before} (B)`}
              disabled={!edited}
              onPointerDown={() => set({ before: true })}
              onPointerUp={release}
              onPointerLeave={release}
              onKeyDown={(event) => (event.key === " " || event.key === "Enter") && set({ before: true })}
              onKeyUp={release}
              onContextMenu={(event) => event.preventDefault()}
            >
              <Icon name="eye" />
            </button>
            <button
              class="icon-only"
              id="compare"
              aria-label={t.compare}
              title={`${t.compare} (C)`}
              aria-pressed={comparing}
              disabled={!edited}
              onClick={() => set({ comparing: !comparing })}
            >
              <Icon name="compare" />
            </button>
          </div>
          <button
            class="primary"
            id="final"
            title={`${t.finalHint} (F)`}
            disabled={!edited || !!working("final")}
            onClick={() => void change("final")}
          >
            <Icon name="spark" />
            <span>{t.final}</span>
          </button>
          <button class="quiet" id="take" title={t.takeTitle} onClick={() => set({ sheet: "take" })}>
            <Icon name="download" />
            <span>{t.download}</span>
          </button>
        </>
      )}
      <button class="icon-only theme" id="theme" aria-label={t.otherTheme(dark)} title={t.otherTheme(dark)} onClick={() => {
        chooseTheme(dark ? "light" : "dark");
        set({});
      }}>
        <Icon name={dark ? "light" : "moon"} />
      </button>
      <button class="icon-only help" aria-label={t.help} title={`${t.help} (?)`} onClick={() => set({ sheet: "help" })}>
        <Icon name="help" />
      </button>
    </header>
  );
}
