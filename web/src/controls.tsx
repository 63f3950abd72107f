// Sliders, colours, files: the parts that panels are made of.
import type { ComponentChildren } from "preact";
import { Icon } from "./icons";
import { set, useView } from "./store";
import { t } from "./strings";
import { useLayoutEffect, useRef, useState } from "preact/hooks";

interface SliderProps {
  id?: string;
  label: string;
  value: number;
  low: number;
  high: number;
  step: number;
  unit?: string;
  /** null: back to the start. Resolves when the server has answered. */
  changed: (value: number | null) => Promise<void> | void;
}

export function Slider({ id, label, value, low, high, step, unit, changed }: SliderProps) {
  // Until the server has answered the control leads: it must not jump back meanwhile.
  const [held, setHeld] = useState<number | null>(null);
  const asked = useRef(0);
  const [typed, setTyped] = useState<string | null>(null);
  const range = useRef<HTMLInputElement>(null);
  const shown = held ?? value;
  const share = ((Math.min(Math.max(shown, low), high) - low) / (high - low)) * 100;
  useLayoutEffect(() => range.current!.style.setProperty("--share", `${share}%`), [share]);
  const send = (number: number | null) => {
    const mine = ++asked.current;
    setHeld(number);
    void Promise.resolve(changed(number)).then(() => mine === asked.current && setHeld(null));
  };
  const digits = step < 0.01 ? 3 : step < 1 ? 2 : 0;
  const shownText = `${shown.toFixed(digits)}${unit ?? ""}`;
  // What the box holds, and not what was last drawn: keys may come faster than drawings.
  const commit = (text: string) => {
    setTyped(null);
    if (text === shownText) return;
    const number = Number(text.replace(",", ".").replace(unit ?? "", ""));
    // An empty box is no error: the option goes back to where it began.
    if (text.trim() === "") send(null);
    else if (Number.isFinite(number)) send(Math.min(Math.max(number, low), high));
  };
  return (
    <div class="slider" id={id}>
      <label>
        <span>{label}</span>
        <input
          ref={range}
          type="range"
          min={low}
          max={high}
          step={step}
          value={shown}
          onInput={(event) => send(Number(event.currentTarget.value))}
          onDblClick={() => send(null)}
        />
      </label>
      <input
        class="number"
        inputMode="decimal"
        aria-label={`${label}, number`}
        value={typed ?? shownText}
        onFocus={(event) => {
          // The text stays as it is: a change would undo what is selected in it.
          setTyped(shownText);
          const box = event.currentTarget;
          // Chromium focuses what it selects: a box that was left meanwhile stays left.
          requestAnimationFrame(() => document.activeElement === box && box.select());
        }}
        onInput={(event) => setTyped(event.currentTarget.value)}
        onBlur={(event) => commit(event.currentTarget.value)}
        onKeyDown={(event) => {
          if (event.key === "Enter") event.currentTarget.blur();
          if (event.key === "Escape") {
            event.currentTarget.value = shownText;
            setTyped(null);
            event.stopPropagation();
          }
        }}
      />
    </div>
  );
}

export function Group({ title, children, more }: { title: string; children: ComponentChildren; more?: ComponentChildren }) {
  return (
    <section class="group">
      <header>
        <h3>{title}</h3>
        {more}
      </header>
      {children}
    </section>
  );
}

/** A part that is closed until it is wanted. */
export function Fold({ title, children, open }: { title: string; children: ComponentChildren; open?: boolean }) {
  return (
    <details class="group" open={open}>
      <summary>{title}</summary>
      {children}
    </details>
  );
}

export function FileButton({
  label,
  accept,
  chosen,
  kind = "quiet",
}: {
  label: string;
  accept: string;
  chosen: (file: File) => void;
  kind?: string;
}) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <button class={kind} onClick={() => input.current!.click()}>
        {label}
      </button>
      <input
        ref={input}
        type="file"
        hidden
        accept={accept}
        onChange={(event) => {
          const file = event.currentTarget.files?.[0];
          event.currentTarget.value = ""; // the same file may be chosen again
          if (file) chosen(file);
        }}
      />
    </>
  );
}

export function Colour({ label, value, changed }: { label: string; value: string; changed: (value: string) => void }) {
  const { dropper } = useView();
  const mine = useRef<((value: string) => void) | null>(null);
  const on = dropper !== null && dropper === mine.current;
  const pick = () => {
    mine.current = (colour) => changed(colour);
    set({ dropper: on ? null : mine.current, mesh: false });
    document.getElementById("stage")?.focus();
  };
  return (
    <div class="colour">
      <label>
        <span>{label}</span>
        <input type="color" value={value} onInput={(event) => changed(event.currentTarget.value)} />
        <code>{value}</code>
      </label>
      <button class="icon-only" aria-pressed={on} aria-label={`${t.dropper}: ${label}`} title={t.dropper} onClick={pick}>
        <Icon name="dropper" />
      </button>
    </div>
  );
}

export function Switch({ label, on, changed, hidden, id }: { label: string; on: boolean; changed: (on: boolean) => void; hidden?: boolean; id?: string }) {
  return (
    <label class="switch-line">
      {!hidden && <span>{label}</span>}
      <span class="switch">
        <input id={id} type="checkbox" role="switch" aria-label={label} checked={on} onChange={(event) => changed(event.currentTarget.checked)} />
        <i />
      </span>
    </label>
  );
}

export function Choice({
  label,
  value,
  options,
  changed,
}: {
  label: string;
  value: string;
  options: readonly (readonly [string, string])[];
  changed: (value: string) => void;
}) {
  return (
    <div class="choice" role="radiogroup" aria-label={label}>
      {options.map(([name, title]) => (
        <button
          key={name}
          role="radio"
          aria-checked={name === value}
          tabIndex={name === value || !options.some(([one]) => one === value) ? 0 : -1}
          onClick={() => changed(name)}
          onKeyDown={(event) => {
            const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
            if (!by) return;
            event.preventDefault();
            const place = options.findIndex(([one]) => one === name);
            const next = options[(place + by + options.length) % options.length]!;
            changed(next[0]);
            const siblings = event.currentTarget.parentElement!.children;
            (siblings[options.indexOf(next)] as HTMLElement).focus();
          }}
        >
          {title}
        </button>
      ))}
    </div>
  );
}
