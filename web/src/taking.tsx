// The sheet to take things away.
import { useState } from "preact/hooks";
import { FileButton } from "./controls";
import { Dialog } from "./dialog";
import { Icon } from "./icons";
import { download, loadRecipe, set, take, useView, working } from "./store";
import { t } from "./strings";

export function TakeSheet() {
  const { about, state, results } = useView();
  const [copied, setCopied] = useState(false);
  const busy = working("take") ?? working("final");
  const copy = async () => {
    await navigator.clipboard?.writeText(state?.commands ?? "").catch(() => undefined);
    setCopied(true);
  };
  return (
    <Dialog title={t.takeTitle} close={() => set({ sheet: "" })}>
      <ul class="takes">
        {about?.takes.map(([kind, title]) => (
          <li key={kind}>
            <button disabled={!!busy} onClick={() => void take(kind)} id={`take-${kind}`}>
              <Icon name="download" />
              <span>{title}</span>
            </button>
          </li>
        ))}
      </ul>
      {busy && (
        <p class="soft" role="status">
          {busy.text} {t.seconds(busy.seconds)}
        </p>
      )}
      {results.length > 0 && (
        <section>
          <h3>{t.again}</h3>
          <ul class="results">
            {results.slice(0, 5).map((result) => (
              <li key={result.file}>
                <button class="link" onClick={() => download(result)}>
                  {result.name}
                </button>
                <span class="soft">{(result.bytes / 1e6).toFixed(1)} MB</span>
              </li>
            ))}
          </ul>
        </section>
      )}
      <section>
        <FileButton label={t.load} accept=".yaml,.yml,.zip" chosen={(file) => void loadRecipe(file)} />
      </section>
      <section>
        <h3>{t.commands}</h3>
        <pre tabIndex={0} id="commands">
          {state?.commands}
        </pre>
        <button class="quiet" onClick={() => void copy()}>
          {copied ? t.copied : t.copy}
        </button>
      </section>
    </Dialog>
  );
}
