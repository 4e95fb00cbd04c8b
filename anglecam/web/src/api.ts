// The server's answers. Angles are degrees, times seconds, places pixels with the centre of the top left pixel at (0, 0).

export type Point = [number, number];
export type Box = [number, number, number, number];
export type Cells = (number | null)[];

export interface FolderInfo {
  name: string;
  clips: { name: string; measured: boolean }[];
  is_session: boolean;
  has_report: boolean;
  job: number | null;
}

export interface ClipInfo {
  name: string;
  version: string;
  width: number;
  height: number;
  codec: string;
  times: number[];
}

export interface Series {
  time_s: number[];
  angle_deg: Cells;
  sigma_deg?: Cells;
  bound_6px_deg?: Cells;
  bound_10px_deg?: Cells;
  line_deg?: Cells;
  mouth_x_px?: Cells;
  mouth_y_px?: Cells;
  pivot_x_px?: Cells;
  pivot_y_px?: Cells;
  status: string[];
  first_frame: number;
  outdated: string[];
  command: { time_s: number[]; angle_deg: number[] } | null;
}

export interface MarkSection {
  rgb?: [number, number, number];
  at?: Point;
  box?: Box;
  frame?: number;
}

export interface PivotSection {
  near?: Point;
  at?: Point;
  sigma_px?: number;
  marker?: string;
}

/** The sections of rig.yaml that the page edits; null removes one. */
export interface Sections {
  mark?: MarkSection | "auto" | null;
  pivot?: PivotSection | null;
  facing?: string | null;
  neutral?: number | "auto" | null;
  frames?: { from?: number | null; to?: number | null; rate_hz?: number | null } | null;
  sync?: { lamp?: Point | null } | null;
}

export interface RigInfo {
  sections: Sections & Record<string, unknown>;
  version: string;
  has_comments: boolean;
}

export interface LearntMark {
  key: string;
  rgb: [number, number, number];
  cue: string;
  area_px2: number;
}

export interface Region {
  centre_px: Point;
  area_px2: number;
  outline_px: Point[];
  whole: boolean;
  mark: boolean;
}

export interface Found {
  status: string;
  regions: Region[];
}

export interface Job {
  id: number;
  request: { clip?: string; session?: string };
  status: "running" | "done" | "failed" | "cancelled";
  what: string;
  done: number;
  total: number;
  result: { by?: string; pivot?: string; notes?: string[]; verdict?: string; effects?: string[] };
  problem: string | null;
}

/** Ask the server; throws an Error whose message is the one line that the server answers. */
export async function ask<T>(path: string, method = "GET", body?: unknown): Promise<T> {
  const headers = body === undefined ? undefined : { "content-type": "application/json" };
  const text = body === undefined ? undefined : JSON.stringify(body);
  let answer: Response;
  try {
    answer = await fetch(path, { method, headers, body: text });
  } catch {
    throw new Error("the server does not answer; is anglecam view still running?");
  }
  if (answer.ok) return (await answer.json()) as T;
  const problem = await answer.text();
  try {
    throw new Error((JSON.parse(problem) as { problem: string }).problem);
  } catch (fault) {
    throw fault instanceof SyntaxError ? new Error(problem.trim()) : fault;
  }
}

/** Return the address of a frame: PNG has every pixel, JPEG comes sooner. */
export function frameAddress(clip: number, frame: number, kind: "jpg" | "png", version: string): string {
  return `/api/clips/${clip}/frames/${frame}.${kind}?v=${version}`;
}
