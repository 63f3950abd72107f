// What is being worked on, over the lower edge of the picture, with its Stop; maps as they are found.
import { useLayoutEffect, useRef } from "preact/hooks";
import { address } from "./api";
import { stop, useView } from "./store";
import { t } from "./strings";
import type { Job } from "./types";

export function Progress() {
  const { jobs, sent, working, state, glass } = useView();
  const running = jobs.filter((job) => job.state === "queued" || job.state === "running");
  const invert = running.find((job) => job.kind === "invert" && job.project === state?.expected?.name);
  const getting = state?.project && !state.ready;
  const lines = running.length || sent !== null || working || getting || glass?.waiting;
  return (
    <div class="progress" id="progress" role="status" hidden={!lines}>
      {invert && <Found job={invert} />}
      {sent !== null && <Line text={t.sending} part={sent} />}
      {working && <Line text={working} part={null} />}
      {getting && <Line text={t.preparing} part={null} />}
      {glass?.waiting && <Line text={glass.words} part={null} />}
      {running.map((job) => (
        <Line key={job.number} text={job.text} part={job.part} seconds={job.seconds} stop={() => void stop(job)} />
      ))}
    </div>
  );
}

interface LineProps {
  text: string;
  part: number | null;
  seconds?: number;
  stop?: () => void;
}

function Line({ text, part, seconds, stop }: LineProps) {
  const bar = useRef<HTMLElement>(null);
  useLayoutEffect(() => {
    bar.current!.style.width = part === null ? "" : `${Math.round(part * 100)}%`;
  }, [part]);
  return (
    <div class="line">
      <span class="words">{text}</span>
      {seconds !== undefined && <span class="soft">{t.seconds(seconds)}</span>}
      {stop && (
        <button class="stop" onClick={stop}>
          {t.stop}
        </button>
      )}
      <div class={`track ${part === null ? "unknown" : ""}`}>
        <i ref={bar} />
      </div>
    </div>
  );
}

function Found({ job }: { job: Job }) {
  const maps = job.found.filter((name) => name !== "photo");
  if (!maps.length) return null;
  return (
    <div class="found">
      {maps.map((name) => (
        <figure key={name}>
          <img src={address(`picture/${job.project}/${name}`, { n: String(job.found.length) })} alt="" />
          <figcaption>{name.replace("_", " ")}</figcaption>
        </figure>
      ))}
    </div>
  );
}
