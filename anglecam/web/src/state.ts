// What the page shows. Modules change it with `set` and redraw when what they depend on has changed.

import type { ClipInfo, Found, LearntMark, RigInfo, Sections, Series } from "./api";

export type Tool = "none" | "mark" | "box" | "pivot" | "near" | "lamp";
export type Stage = "film" | "found" | "fraction" | "threshold" | "edges" | "fill";

export interface State {
  clip: number;
  info: ClipInfo | null;
  frame: number;
  series: Series | null;
  rig: RigInfo | null;
  /** Changed sections that are not saved. */
  changes: Sections;
  tool: Tool;
  stage: Stage;
  learnt: LearntMark | null;
  found: Found | null;
}

export const state: State = {
  clip: 0,
  info: null,
  frame: 0,
  series: null,
  rig: null,
  changes: {},
  tool: "none",
  stage: "film",
  learnt: null,
  found: null,
};

type Watcher = (changed: ReadonlySet<keyof State>) => void;
const watchers: Watcher[] = [];

/** Call a function after every change. */
export function watch(watcher: Watcher): void {
  watchers.push(watcher);
}

/** Change some of the state. */
export function set(change: Partial<State>): void {
  const changed = new Set<keyof State>();
  for (const key of Object.keys(change) as (keyof State)[]) {
    if (state[key] !== change[key]) changed.add(key);
  }
  Object.assign(state, change);
  if (changed.size > 0) watchers.forEach((watcher) => watcher(changed));
}

/** Return a section of the rig with the changes that are not saved. */
export function section<K extends keyof Sections>(key: K): Sections[K] {
  return key in state.changes ? state.changes[key] : (state.rig?.sections[key] as Sections[K]);
}

/** Change sections of the rig; a section that becomes what the file says is no change. */
export function change(sections: Sections): void {
  const changes: Record<string, unknown> = { ...state.changes, ...sections };
  for (const key of Object.keys(changes)) {
    const saved = state.rig?.sections[key] ?? null;
    if (JSON.stringify(changes[key] ?? null) === JSON.stringify(saved)) delete changes[key];
  }
  set({ changes: changes as Sections });
}

/** Whether something is not saved. */
export function isChanged(): boolean {
  return Object.keys(state.changes).length > 0;
}

/** Go to a frame of the clip. */
export function goTo(frame: number): void {
  const last = (state.info?.times.length ?? 1) - 1;
  set({ frame: Math.min(Math.max(Math.round(frame), 0), last) });
}

/** Return the row of the series that a frame has; undefined where it has none. */
export function rowOf(frame: number): number | undefined {
  if (state.series === null) return undefined;
  const row = frame - state.series.first_frame;
  return row >= 0 && row < state.series.time_s.length ? row : undefined;
}
