// The list of edits, always in sight: switch, choose, order, remove.
import { Icon } from "./icons";
import { useEffect, useRef, useState } from "preact/hooks";
import { change, useView } from "./store";
import { t } from "./strings";
import type { Step } from "./types";

export function Strip() {
  const { state } = useView();
  const steps = state?.steps ?? [];
  return (
    <footer class="strip" aria-label={t.edits} id="steps">
      {!steps.length && <span class="none">{t.noEdits}</span>}
      <ol>
        {steps.map((step, index) => (
          <Chip key={index} step={step} index={index} count={steps.length} current={state?.current === index} />
        ))}
      </ol>
    </footer>
  );
}

function Chip({ step, index, count, current }: { step: Step; index: number; count: number; current: boolean }) {
  const act = (action: string) => change("act", { action, index });
  // Until the server has answered the switch leads: other news must not set it back.
  const [held, setHeld] = useState<boolean | null>(null);
  const toggle = () => {
    setHeld(!step.on);
    void act("toggle").then(() => setHeld(null));
  };
  // A long list is cut off at the side: what is worked on stays in sight.
  const chip = useRef<HTMLLIElement>(null);
  useEffect(() => {
    if (current) chip.current!.scrollIntoView({ block: "nearest", inline: "nearest" });
  }, [current]);
  const [kind, ...rest] = step.text.split(": ");
  return (
    <li ref={chip} class={`chip ${current ? "current" : ""} ${step.on ? "" : "off"}`}>
      <input type="checkbox" checked={held ?? step.on} aria-label={t.toggle(step.text)} onChange={toggle} />
      <button class="text" aria-current={current ? "true" : undefined} title={step.text} onClick={() => void act("choose")}>
        <b>{kind}</b> <span>{rest.join(": ")}</span>
      </button>
      {current && (
        <span class="order">
          <button class="icon-only" disabled={index === 0} aria-label={`${t.earlier}: ${step.text}`} title={t.earlier} onClick={() => void act("up")}>
            ‹
          </button>
          <button class="icon-only" disabled={index === count - 1} aria-label={`${t.later}: ${step.text}`} title={t.later} onClick={() => void act("down")}>
            ›
          </button>
        </span>
      )}
      <button class="icon-only" aria-label={`${t.removeEdit}: ${step.text}`} title={t.removeEdit} onClick={() => void act("remove")}>
        <Icon name="close" />
      </button>
    </li>
  );
}
