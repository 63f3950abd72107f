import { useEffect, useState } from "preact/hooks";
import { address, get } from "../api";
import { Group, Slider, Switch } from "../controls";
import { Histogram } from "../histogram";
import { Icon } from "../icons";
import { set, useView } from "../store";
import { t } from "../strings";

interface Report {
  maps: string[];
  report: string;
}

export function Look() {
  const { state, exposure, clipped, mesh } = useView();
  const [facts, setFacts] = useState<Report | null>(null);
  const [large, setLarge] = useState<number | null>(null);
  const project = state?.project?.name;
  // The re-rendering of a new photo comes later, and is shown, too.
  const edits = JSON.stringify([state?.steps, state?.traced]);
  useEffect(() => {
    if (!project) return;
    let wanted = true;
    const shown = (report: Report | null) => wanted && setFacts(report);
    void get<Report>("report").then(shown, () => shown(null));
    return () => void (wanted = false);
  }, [project, edits]);
  if (!project || !facts) return <div class="blank">{t.working}</div>;
  // Another list of edits has other maps.
  const map = (place: number) => address(`map/${place}`, { of: String(hash(project + edits)) });
  return (
    <>
      <Group title={t.brightness}>
        <Histogram />
        <Slider id="exposure" label={t.exposure} low={-4} high={4} step={0.1} value={exposure} changed={(value) => set({ exposure: value ?? 0 })} />
        <Switch label={t.clipped} on={clipped} changed={(on) => set({ clipped: on })} />
        <p class="soft">{t.exposureHint}</p>
      </Group>
      <Group title={t.mesh}>
        <button class="wide with-icon" id="show-mesh" aria-pressed={mesh} disabled={!state.ready} onClick={() => set({ mesh: !mesh })}>
          <Icon name="object" />
          {mesh ? t.hideMesh : t.showMesh}
        </button>
      </Group>
      <Group title={t.maps}>
        <div class="maps">
          {facts.maps.map((title, place) => {
            const [name, words] = title.split(": ");
            return (
              <button key={title} title={words ?? name} onClick={() => setLarge(place)}>
                <img src={map(place)} alt="" loading="lazy" />
                <span>{name}</span>
              </button>
            );
          })}
        </div>
      </Group>
      <Group title={t.report}>
        {facts.report.split("\n").map((line, place) => (
          <Line key={place} text={line} />
        ))}
      </Group>
      {large !== null && (
        <div class="lightbox" role="dialog" aria-label={facts.maps[large]} onClick={() => setLarge(null)}>
          <figure>
            <img src={map(large)} alt={facts.maps[large]} />
            <figcaption>{facts.maps[large]}</figcaption>
          </figure>
          <button
            class="icon-only"
            aria-label={t.close}
            ref={(button) => button?.focus()}
            onKeyDown={(event) => {
              const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
              if (by) setLarge((large + by + facts.maps.length) % facts.maps.length);
              if (event.key === "Escape") {
                event.stopPropagation();
                setLarge(null);
              }
            }}
          >
            ✕
          </button>
        </div>
      )}
    </>
  );
}

/** One line of the report, which knows bold, code and items. */
function Line({ text }: { text: string }) {
  if (!text.trim()) return null;
  const parts = text.replace(/^- /, "").split(/(\*\*[^*]+\*\*|`[^`]+`)/);
  const decoded = (part: string) => part.replace(/&lt;/g, "<").replace(/&#91;/g, "[").replace(/&amp;/g, "&");
  return (
    <p class={text.startsWith("- ") ? "item soft" : "soft"}>
      {parts.map((part) => {
        if (part.startsWith("**")) return <b>{decoded(part.slice(2, -2))}</b>;
        if (part.startsWith("`")) return <code>{decoded(part.slice(1, -1))}</code>;
        return decoded(part);
      })}
    </p>
  );
}

function hash(text: string): number {
  let value = 7;
  for (const letter of text) value = (value * 31 + letter.charCodeAt(0)) | 0;
  return value;
}
