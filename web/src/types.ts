// What the server says, as `darkroom/state.py` and `darkroom/channel.py` make it.

export type OptionValue = string | string[] | string[][];

export interface Step {
  text: string;
  kind: string;
  on: boolean;
  options: Record<string, OptionValue>;
}

export interface Stage {
  picture?: string;
  before?: string | null;
  width: number;
  height: number;
  badge: string;
  bad: boolean;
  waiting: boolean;
  coarse: boolean;
  /** The picture is one of before: the page draws the change itself. */
  kept?: boolean;
  serial?: number;
  region: string;
  clicked: boolean;
}

export interface Project {
  name: string;
  title: string;
  ready?: boolean;
}

export interface Fitted {
  roughness: number;
  metallic: number;
  colour: string;
}

export interface State {
  revision: number;
  /** Whether the re-rendering is path traced yet. */
  traced: boolean;
  project: Project | null;
  expected: Project | null;
  ready: boolean;
  /** Width and height of the photo as it was taken. */
  original: [number, number] | null;
  stage: Stage;
  steps: Step[];
  current: number | null;
  light: number | null;
  fitted: Fitted | null;
  undo: boolean;
  redo: boolean;
  object: Record<string, string>;
  commands: string;
  /** Kind of change that the page can draw itself -> the key of what it takes. */
  drawn: Record<string, string>;
  notes?: string[];
}

export interface Result {
  file: string;
  name: string;
  bytes: number;
}

export interface Job {
  number: number;
  kind: string;
  state: string;
  text: string;
  part: number | null;
  seconds: number;
  found: string[];
  project: string | null;
  result: Result | null;
}

export interface News {
  revision: number;
  ready: boolean;
  /** Whether live pictures have all their rays by now. */
  fine: boolean;
  jobs: Job[];
  glass: { waiting: boolean; words: string; bad: boolean } | null;
}

export interface Range {
  default: number | string | boolean | null;
  help: string;
  low?: number;
  high?: number;
}

export interface About {
  version: string;
  options: Record<string, Record<string, Range>>;
  examples: [string, string, string][];
  sizes: number[];
  predictors: [string, string][];
  lights: string[];
  objects: string[];
  takes: [string, string][];
  megabytes: number;
  photos: string[];
  meshes: string[];
  lamp_share: number;
}
