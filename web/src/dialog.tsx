import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Icon } from "./icons";
import { t } from "./strings";

interface Props {
  title: string;
  kind?: string;
  close?: () => void;
  children: ComponentChildren;
}

/** A sheet over the page; focus goes into it, and back to where it was. */
export function Dialog({ title, kind = "", close, children }: Props) {
  const sheet = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const before = document.activeElement as HTMLElement | null;
    sheet.current!.focus();
    return () => before?.focus?.();
  }, []);
  const keep = (event: KeyboardEvent) => {
    if (event.key !== "Tab") return;
    const selector = "button:not(:disabled), input:not([hidden]), select, textarea, summary, a";
    const parts = [...sheet.current!.querySelectorAll<HTMLElement>(selector)].filter((part) => part.checkVisibility());
    const [first, last] = [parts[0], parts[parts.length - 1]];
    const here = document.activeElement;
    // Round and round within the sheet.
    const leaves = event.shiftKey ? here === first || here === sheet.current : here === last;
    if (!leaves) return;
    event.preventDefault();
    (event.shiftKey ? last : first)?.focus();
  };
  return (
    <div class={`veil ${kind}`} onClick={(event) => event.target === event.currentTarget && close?.()}>
      <div ref={sheet} class="sheet" role="dialog" aria-modal="true" aria-label={title} tabIndex={-1} onKeyDown={keep}>
        <header>
          <h2>{title}</h2>
          {close && (
            <button class="icon-only" aria-label={t.close} onClick={close}>
              <Icon name="close" />
            </button>
          )}
        </header>
        {children}
      </div>
    </div>
  );
}
