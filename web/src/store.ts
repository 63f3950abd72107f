// The one state of the page, and everything that changes it.
import { useEffect, useState } from "preact/hooks";
import { PAGE, Refusal, address, get, post, upload } from "./api";
import { t } from "./strings";
import type { About, Job, News, Project, Result, State } from "./types";

export type Tool = "click" | "box" | "brush" | "lamp" | "place";
export type Mode = "new" | "add" | "remove";
export type Panel = "material" | "light" | "object" | "look";
export type Sheet = "" | "open" | "take" | "help";

export interface View {
  about: About | null;
  state: State | null;
  jobs: Job[];
  glass: News["glass"];
  fine: boolean;
  online: boolean;
  tool: Tool;
  mode: Mode;
  brush: number;
  panel: Panel;
  sheet: Sheet;
  comparing: boolean;
  split: number;
  before: boolean;
  working: string;
  message: string;
  note: string;
  projects: Project[];
  /** The photo that was dropped, until the server has it. */
  dropped: string;
  sent: number | null;
  results: Result[];
  lamp: { kelvin: number; power: number; before: number };
  /** Whether the mesh is shown in place of the picture. */
  mesh: boolean;
  /** Exposure of what is seen, stops; it changes no picture. */
  exposure: number;
  clipped: boolean;
  /** Who gets the colour that is clicked next. */
  dropper: ((colour: string) => void) | null;
  /** Show the photo's own pixels, or the whole picture again. */
  zoomOwn: () => void;
  size: number;
  predictor: string;
  fov: string;
}

export const view: View = {
  about: null,
  state: null,
  jobs: [],
  glass: null,
  fine: true,
  online: true,
  tool: "click",
  mode: "new",
  brush: 12,
  panel: "material",
  sheet: "",
  comparing: false,
  split: 0.5,
  before: false,
  working: "",
  message: "",
  note: "",
  projects: [],
  dropped: "",
  sent: null,
  results: [],
  lamp: { kelvin: 2700, power: 1, before: 0.75 },
  mesh: false,
  exposure: 0,
  clipped: false,
  dropper: null,
  zoomOwn: () => undefined,
  size: 512,
  predictor: "auto",
  fov: "auto",
};

const listeners = new Set<() => void>();
const KEPT = ["tool", "mode", "brush", "panel", "comparing", "split", "lamp", "size"] as const;

export function set(changes: Partial<View>): void {
  Object.assign(view, changes);
  const kept = Object.fromEntries(KEPT.map((name) => [name, view[name]]));
  sessionStorage.setItem("view", JSON.stringify(kept));
  for (const listener of listeners) listener();
}

export function useView(): View {
  const [, redraw] = useState(0);
  useEffect(() => {
    const listener = () => redraw((count) => count + 1);
    listeners.add(listener);
    return () => void listeners.delete(listener);
  }, []);
  return view;
}

let messageTimer = 0;
export function say(message: string): void {
  clearTimeout(messageTimer);
  set({ message });
  if (message) messageTimer = window.setTimeout(() => set({ message: "" }), 9000);
}
let noteTimer = 0;
function remark(note: string): void {
  clearTimeout(noteTimer);
  set({ note });
  noteTimer = window.setTimeout(() => set({ note: "" }), 5000);
}

export function tell(error: unknown): void {
  say(error instanceof Refusal ? error.message : t.lost);
}

// Changes go one after another; of those with one key that wait only the newest is sent.
interface Waiting {
  key: string;
  words: string;
  quiet: boolean;
  /** Whether it still makes sense when it is its turn. */
  when: () => boolean;
  run: () => Promise<State>;
  done: () => void;
}
let queue: Waiting[] = [];
let running = false;
/** How many changes were sent: a state that was asked for before the last one may be of before it. */
let changes = 0;
let rest = 0;

const SPARSE = 250; // milliseconds between two changes that the page has drawn itself
let later = 0;

/** Send a change; one that is `quiet`, which the page has drawn, waits for those that follow it at once. */
export function change(
  place: string,
  body: { quiet?: boolean; [name: string]: unknown } = {},
  key = "",
  words = "",
  when = () => true,
): Promise<void> {
  return new Promise((done) => {
    const entry = { key, words, quiet: !!body.quiet, when, run: () => post<State>(place, body), done };
    const same = key ? queue.find((one) => one.key === key) : undefined;
    if (same) {
      same.done();
      queue = queue.map((one) => (one === same ? entry : one));
    } else queue.push(entry);
    if (!body.quiet) void drain();
    else if (!running) wait();
  });
}

function wait(): void {
  later ||= window.setTimeout(() => void drain(), SPARSE);
}

/** Whether a change is on its way, or about to be. */
export function pending(): boolean {
  return running || queue.length > 0;
}

async function drain(): Promise<void> {
  clearTimeout(later);
  later = 0;
  if (running) return;
  running = true;
  for (let entry = queue.shift(); entry; entry = queue.shift()) {
    const { words } = entry;
    if (!entry.when()) {
      entry.done();
      continue;
    }
    // Words for what takes long only: a slider answers before anybody could read, and what the page has drawn is seen.
    const timer = window.setTimeout(() => set({ working: words || t.working }), words ? 150 : entry.quiet ? 5000 : 700);
    changes += 1;
    try {
      accept(await entry.run());
    } catch (error) {
      tell(error);
      await load(); // controls go back to what is true
    }
    clearTimeout(timer);
    if (view.working) set({ working: "" });
    entry.done();
    if (queue.every((one) => one.quiet)) break;
  }
  running = false;
  if (queue.length) wait();
}

export function accept(state: State): void {
  const last = view.state;
  const newer = !last?.stage.serial || !state.stage.serial || state.stage.serial >= last.stage.serial;
  const stage = { ...state.stage };
  // The server leaves a picture out while it has none: the page keeps the one it shows.
  const same = last?.project?.name === state.project?.name;
  if (stage.picture === undefined && same) Object.assign(stage, { picture: last?.stage.picture, kept: true });
  if (!newer) Object.assign(stage, { ...last!.stage, region: state.stage.region });
  if (state.notes?.length) remark(state.notes.join(" "));
  set({ state: { ...state, stage }, ...(state.project && view.dropped ? { dropped: "" } : {}) });
  // Deleted or closed, perhaps on another page: there is something to choose, not an empty window.
  const gone = last?.project && !state.project && !state.expected && !view.dropped && view.sent === null;
  if (gone) set({ sheet: "open" });
  clearTimeout(rest);
  if (stage.coarse) rest = window.setTimeout(() => void refresh(), 300);
}

async function load(): Promise<void> {
  const sent = changes;
  try {
    const state = await get<State>("state");
    if (sent === changes && !queue.length) accept(state);
  } catch (error) {
    tell(error);
  }
}

/** Ask for the state. While a change is on its way its answer brings one. */
export async function refresh(): Promise<void> {
  if (!pending()) await load();
}

// The channel

let socket: WebSocket | null = null;
function connect(): void {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/api/channel?page=${PAGE}`);
  socket.onopen = () => {
    if (!view.online) void arrive();
    set({ online: true });
  };
  socket.onmessage = (event) => hear(JSON.parse(event.data as string) as News);
  socket.onclose = () => {
    set({ online: false });
    setTimeout(connect, 1000);
  };
}

function hear(news: News): void {
  const state = view.state;
  const traced = view.glass?.waiting && !news.glass?.waiting;
  if (traced && news.glass?.bad) say(news.glass.words);
  for (const job of news.jobs) {
    const known = view.jobs.find((one) => one.number === job.number);
    if (known && known.state !== job.state) ended(job);
  }
  set({ jobs: news.jobs, glass: news.glass });
  if (!state || pending()) return;
  // Finer tables draw changes, too, also where there is no edit yet.
  const finer = news.fine && !view.fine;
  set({ fine: news.fine });
  const ready = news.ready && !state.ready && state.project;
  if (news.revision > state.revision || ready || traced || finer) void refresh();
}

function ended(job: Job): void {
  if (job.state === "failed") say(job.text);
  if (job.state === "stopped") remark(t.stopped);
  if (job.state === "done" && job.kind === "final") remark(t.traced(job.seconds));
  if (job.state === "done" && job.result) {
    set({ results: [job.result, ...view.results] });
    download(job.result);
  }
  if (job.kind === "invert") {
    set({ dropped: "" });
    void listProjects();
    if (job.state === "done" && !job.text.startsWith("Done")) remark(job.text);
  }
}

export function download(result: Result): void {
  const link = document.createElement("a");
  link.href = address(`file/${result.file}`);
  link.download = result.name;
  link.click();
}

// Actions

export async function arrive(): Promise<void> {
  try {
    const about = view.about ?? (await get<About>("about"));
    set({ about });
    accept(await get<State>("arrive"));
    // Somebody may have dropped a photo meanwhile.
    if (!view.state?.project && !view.state?.expected && !view.dropped && view.sent === null) set({ sheet: "open" });
    await listProjects();
  } catch (error) {
    tell(error);
  }
}

export async function begin(): Promise<void> {
  const kept = JSON.parse(sessionStorage.getItem("view") ?? "{}") as Partial<View>;
  Object.assign(view, { ...kept, lamp: { ...view.lamp, ...kept.lamp } });
  window.addEventListener("pagehide", () => void drain());
  await arrive();
  connect();
}

export async function listProjects(): Promise<void> {
  set({ projects: await get<Project[]>("projects").catch(() => view.projects) });
}

export async function openFile(file: File): Promise<void> {
  const limit = (view.about?.megabytes ?? 60) * 1e6;
  if (file.size > limit) return say(t.tooLarge(file.name, view.about?.megabytes ?? 60));
  const photo = !file.name.toLowerCase().endsWith(".zip");
  // Shown at once, before a byte was sent.
  set({ dropped: photo ? URL.createObjectURL(file) : "", sheet: "", sent: 0, message: "" });
  try {
    const id = await upload(file, (sent) => set({ sent }));
    set({ sent: null });
    await start({ file: id });
  } catch (error) {
    set({ dropped: "", sent: null, sheet: view.state?.project ? "" : "open" });
    tell(error);
  }
}

export async function start(what: { file?: string; example?: string }): Promise<void> {
  const { size, predictor, fov } = view;
  set({ sheet: "" });
  await change("start", { ...what, size, predictor, fov }, "", t.opening);
  if (!view.state?.expected && !view.state?.project) set({ dropped: "", sheet: "open" });
  await listProjects();
}

export async function useFile(file: File, option: "texture" | "envmap" | "mesh"): Promise<void> {
  try {
    set({ working: t.sending });
    const id = await upload(file, () => undefined);
    await change("use", { option, file: id }, "", t.sending);
  } catch (error) {
    tell(error);
  } finally {
    set({ working: "" });
  }
}

export async function loadRecipe(file: File): Promise<void> {
  try {
    const id = await upload(file, () => undefined);
    await change("load", { file: id }, "", t.working);
  } catch (error) {
    tell(error);
  }
}

export async function take(kind: string): Promise<void> {
  try {
    const { result } = await post<{ result?: Result }>("take", { kind });
    if (result) {
      set({ results: [result, ...view.results] });
      download(result);
    }
  } catch (error) {
    tell(error);
  }
}

export async function editProjects(place: string, body: object): Promise<void> {
  try {
    set({ projects: await post<Project[]>(place, body) });
    await refresh();
  } catch (error) {
    tell(error);
  }
}

/** Give the colour of a place, without the light on it, to whoever asked for one. */
export async function drop(at: [number, number]): Promise<void> {
  const use = view.dropper;
  set({ dropper: null });
  try {
    const { colour } = await post<{ colour: string }>("colour", { at });
    use?.(colour);
  } catch (error) {
    tell(error);
  }
}

export async function stop(job: Job): Promise<void> {
  await post("stop", { number: job.number }).catch(tell);
}

export function working(kind?: string): Job | undefined {
  return view.jobs.find((job) => ["queued", "running"].includes(job.state) && (!kind || job.kind === kind));
}

/** Options of the current edit of a kind, or none. */
export function optionsOf(state: State | null, kind: string): Record<string, unknown> {
  if (!state) return {};
  if (kind === "relight") return state.light === null ? {} : (state.steps[state.light]?.options ?? {});
  const step = state.current === null ? undefined : state.steps[state.current];
  const fits = step && (step.kind === kind || (kind === "insert" && step.kind === "drop"));
  if (fits) return step.options;
  return kind === "insert" ? state.object : {};
}
