// The form of rig.yaml: what is declared, as numbers that can be typed, and saving it.

import { ask, type Point, type RigInfo } from "./api";
import { byId } from "./dom";
import { moveHandle } from "./picker";
import { change, isChanged, rowOf, section, set, state, watch } from "./state";

/** Fill the form from the state whenever that changes, and the state from the form. */
export function startForm(say: (text: string, isProblem?: boolean) => void): void {
  watch((changed) => {
    if (["rig", "changes", "frame", "series"].some((key) => changed.has(key as never))) fill();
  });
  pair("mark-x", "mark-y", (at) => moveHandle("mark", at));
  pair("pivot-x", "pivot-y", (at) => moveHandle("pivot", at));
  pair("lamp-x", "lamp-y", (at) => moveHandle("lamp", at));
  click("mark-auto", () => change({ mark: null }));
  click("pivot-auto", () => change({ pivot: null }));
  click("lamp-none", () => change({ sync: withoutLamp() }));
  click("from-here", () => changeFrames("from", state.frame));
  click("to-here", () => changeFrames("to", state.frame));
  click("all-frames", () => change({ frames: section("frames")?.rate_hz ? { rate_hz: section("frames")!.rate_hz! } : null }));
  click("neutral-here", () => change({ neutral: lineHere() }));
  click("neutral-auto", () => change({ neutral: null }));
  click("undo", () => set({ changes: {} }));
  click("save", () => void save(say));
  input("from").addEventListener("change", () => changeFrames("from", numberIn("from")));
  input("to").addEventListener("change", () => changeFrames("to", numberIn("to")));
  input("neutral").addEventListener("change", () => change({ neutral: numberIn("neutral") }));
  input("mark-colour").addEventListener("change", () => change({ mark: { rgb: rgbOf(input("mark-colour").value) } }));
  const facing = byId<HTMLSelectElement>("facing");
  facing.addEventListener("change", () => change({ facing: facing.value === "right" && !state.rig?.sections.facing ? null : facing.value }));
}

/** Read the rig file; a problem with it is said and leaves the page usable. */
export async function loadRig(say: (text: string, isProblem?: boolean) => void): Promise<void> {
  try {
    set({ rig: await ask<RigInfo>("/api/rig"), changes: {} });
  } catch (fault) {
    say((fault as Error).message, true);
  }
}

/** Save the changes; returns whether the file now holds them. */
export async function save(say: (text: string, isProblem?: boolean) => void): Promise<boolean> {
  const { rig, changes } = state;
  if (rig === null) return false;
  if (!isChanged()) return true;
  try {
    const saved = await ask<RigInfo>("/api/rig", "PUT", { sections: changes, version: rig.version });
    set({ rig: saved, changes: {} });
    say("rig.yaml is saved.");
    return true;
  } catch (fault) {
    say((fault as Error).message, true);
    return false;
  }
}

function fill(): void {
  const mark = section("mark"), pivot = section("pivot"), lamp = section("sync")?.lamp, frames = section("frames");
  const named = mark && mark !== "auto" ? mark : {};
  fillPair("mark-x", "mark-y", named.at);
  fillPair("pivot-x", "pivot-y", pivot?.at ?? pivot?.near);
  fillPair("lamp-x", "lamp-y", lamp ?? undefined);
  input("mark-colour").value = named.rgb ? hexOf(named.rgb) : "#808080";
  byId("mark-is").textContent = describeMark();
  byId("pivot-is").textContent = pivot?.at ? `exactly here, ± ${pivot.sigma_px ?? 1} px` : pivot?.near ? "roughly here, within some 10 px" : "found by itself";
  byId("lamp-is").textContent = lamp ? "lights at the first change of the command" : "none";
  input("from").value = text(frames?.from);
  input("to").value = text(frames?.to);
  const neutral = section("neutral");
  input("neutral").value = typeof neutral === "number" ? String(neutral) : "";
  byId("neutral-is").textContent = typeof neutral === "number" ? "°, direction of the line" : "auto: the rest before the first command change, or the median";
  byId<HTMLSelectElement>("facing").value = section("facing") ?? "right";
  const line = lineHere();
  byId<HTMLButtonElement>("neutral-here").disabled = line === null;
  byId("neutral-here").title = line === null ? "measure first: this frame has no angle yet" : `${line}°`;
  byId<HTMLButtonElement>("save").disabled = !isChanged();
  byId<HTMLButtonElement>("undo").disabled = !isChanged();
  byId("comments").hidden = !(state.rig?.has_comments && isChanged());
  byId("measure").textContent = isChanged() ? "Save and measure" : "Measure";
}

function describeMark(): string {
  const mark = section("mark");
  if (!mark || mark === "auto") return "found by itself";
  if (mark.rgb) return `of colour ${mark.rgb.join(", ")}`;
  const where = mark.box ? "in a box" : "at a point";
  const frame = mark.frame ?? 0;
  return frame === state.frame ? `${where} in this frame` : `${where} in frame ${frame}`;
}

/** Return the direction of the measured line in this frame, degrees; null where it is not known as it would be now. */
function lineHere(): number | null {
  const row = rowOf(state.frame);
  const line = row === undefined ? null : state.series?.line_deg?.[row];
  return line === null || line === undefined || "facing" in state.changes ? null : Math.round(line * 1e4) / 1e4;
}

function changeFrames(end: "from" | "to", frame: number | null): void {
  const frames = { ...section("frames"), [end]: frame };
  if (frame === null) delete frames[end];
  change({ frames: Object.keys(frames).length > 0 ? frames : null });
}

function withoutLamp(): null | Record<string, never> {
  const { lamp: _, ...rest } = section("sync") ?? {};
  return Object.keys(rest).length > 0 ? rest : null;
}

function pair(x: string, y: string, moved: (at: Point) => void): void {
  const changed = (): void => {
    const [a, b] = [numberIn(x), numberIn(y)];
    if (a !== null && b !== null) moved([a, b]);
  };
  input(x).addEventListener("change", changed);
  input(y).addEventListener("change", changed);
}

function fillPair(x: string, y: string, at: Point | undefined): void {
  input(x).closest<HTMLElement>(".pair")!.hidden = at === undefined;
  [x, y].forEach((id, axis) => (input(id).value = at ? String(at[axis]) : ""));
}

function input(id: string): HTMLInputElement {
  return byId<HTMLInputElement>(id);
}

function numberIn(id: string): number | null {
  return input(id).value === "" ? null : input(id).valueAsNumber;
}

function click(id: string, action: () => void): void {
  byId(id).addEventListener("click", action);
}

function text(value: number | null | undefined): string {
  return value === null || value === undefined ? "" : String(value);
}

function hexOf(rgb: number[]): string {
  return `#${rgb.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

function rgbOf(hex: string): [number, number, number] {
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16)) as [number, number, number];
}
