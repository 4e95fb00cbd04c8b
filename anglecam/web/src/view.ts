// The page of `anglecam view`: puts its parts together.

import { ask, type ClipInfo, type FolderInfo, type Job, type Series } from "./api";
import { Curve } from "./curve";
import { byId, make } from "./dom";
import { Jobs } from "./jobs";
import { startPicking } from "./picker";
import { Player } from "./player";
import { showReadout } from "./readout";
import { loadRig, save, startForm } from "./rigform";
import { startStages } from "./stages";
import { goTo, isChanged, rowOf, set, state, watch, type Tool } from "./state";
import "./view.css";

const STEP = 10;
const ZOOM = 1.5;

const player = new Player();
const curve = new Curve(byId("curve"), () => (innerWidth < 700 ? 180 : 220), (row) => goTo(row + (state.series?.first_frame ?? 0)));
const jobs = new Jobs(jobEnded, say);
const slider = byId<HTMLInputElement>("slider");

/** Say something in the line for messages. */
function say(text: string, isProblem = false): void {
  const line = byId("message");
  line.textContent = text;
  line.classList.toggle("problem", isProblem);
}

async function loadFolder(): Promise<FolderInfo> {
  const folder = await ask<FolderInfo>("/api/folder");
  document.title = `${folder.name} – anglecam`;
  const list = byId<HTMLSelectElement>("clip");
  list.replaceChildren(...folder.clips.map((clip, k) => make("option", { value: String(k), selected: k === state.clip }, clip.measured ? `${clip.name} ✓` : clip.name)));
  byId("close").hidden = !folder.is_session;
  byId("report").hidden = !folder.has_report;
  return folder;
}

async function loadClip(clip: number): Promise<void> {
  set({ clip, info: null, series: null });
  try {
    const info = await ask<ClipInfo>(`/api/clips/${clip}`);
    slider.max = String(info.times.length - 1);
    byId("about").textContent = `${info.width} × ${info.height} px, ${info.codec}, ${info.times.length} frames`;
    set({ info, frame: 0 });
    await loadSeries();
  } catch (fault) {
    say((fault as Error).message, true);
  }
}

async function loadSeries(): Promise<void> {
  const clip = state.clip;
  const series = await ask<Series | null>(`/api/clips/${clip}/series`);
  if (clip === state.clip) set({ series });
}

function showCurve(): void {
  const { series } = state;
  byId("curve").hidden = byId("curve-title").hidden = series === null;
  byId("outdated").hidden = !series?.outdated.length;
  if (series === null) return curve.show(null);
  byId("outdated").textContent = `${series.outdated.join(" and ")} changed after this was measured; measure again.`;
  const sigma = { half: series.sigma_deg ?? [], label: "σ", colour: "--band" };
  const bounds = [
    { half: series.bound_10px_deg ?? [], label: "10 px", colour: "--band10" },
    { half: series.bound_6px_deg ?? [], label: "6 px", colour: "--band6" },
  ];
  const command = series.command;
  curve.show({
    time: series.time_s,
    value: series.angle_deg,
    label: "angle, °",
    bands: player.bounds ? [...bounds, sigma] : [sigma],
    beside: command ? { value: held(command, series.time_s), label: "command" } : undefined,
  });
  moveCursor();
}

/** Return the command at given times: each value holds until the next. */
function held(command: { time_s: number[]; angle_deg: number[] }, times: number[]): (number | null)[] {
  let k = -1;
  return times.map((time) => {
    while (k + 1 < command.time_s.length && command.time_s[k + 1]! <= time) k += 1;
    return command.angle_deg[Math.max(k, 0)] ?? null;
  });
}

function moveCursor(): void {
  curve.moveTo(rowOf(state.frame) ?? -1);
  slider.value = String(state.frame);
  showReadout(player.bounds);
  slider.setAttribute("aria-valuetext", `${byId("frame-number").textContent}, ${byId("frame-angle").textContent}`);
}

function jobEnded(job: Job): void {
  const { status, result, problem } = job;
  byId("notes").replaceChildren(...(result.notes ?? []).map((note) => make("li", {}, note)));
  if (status === "cancelled") say("cancelled");
  else if (problem !== null) say(problem, true);
  else if (result.verdict) say(`verdict: ${result.verdict.replaceAll("_", " ")}${result.effects?.length ? ` (${result.effects.join(", ")})` : ""}`);
  else say(`measured on the ${result.by}; pivot: ${result.pivot}`);
  void Promise.all([loadFolder(), loadSeries()]).catch((fault: Error) => say(fault.message, true));
}

function startTools(): void {
  for (const tool of ["mark", "box", "pivot", "near", "lamp"] as Tool[]) {
    const button = byId(`pick-${tool}`);
    button.addEventListener("click", () => set({ tool: state.tool === tool ? "none" : tool }));
    watch((changed) => {
      if (changed.has("tool")) button.setAttribute("aria-pressed", String(state.tool === tool));
    });
  }
  watch((changed) => {
    if (changed.has("tool") && state.tool !== "none") say(state.tool === "box" ? "Drag a box around the mark." : "Click the place in the picture; drag to adjust.");
    if (changed.has("tool") && state.tool === "none") say("");
  });
  const bounds = byId<HTMLInputElement>("bounds");
  bounds.addEventListener("change", () => {
    player.bounds = bounds.checked;
    player.draw();
    showCurve();
  });
  byId("zoom-in").addEventListener("click", () => player.zoom(ZOOM));
  byId("zoom-out").addEventListener("click", () => player.zoom(1 / ZOOM));
  byId("previous").addEventListener("click", () => goTo(state.frame - 1));
  byId("next").addEventListener("click", () => goTo(state.frame + 1));
}

async function measure(): Promise<void> {
  if (await save(say)) await jobs.start({ kind: "measure", clip: state.clip });
}

async function close(): Promise<void> {
  if (await save(say)) await jobs.start({ kind: "close" });
}

const KEYS: Record<string, (far: boolean) => void> = {
  ArrowLeft: (far) => goTo(state.frame - (far ? STEP : 1)),
  ArrowRight: (far) => goTo(state.frame + (far ? STEP : 1)),
  Home: () => goTo(0),
  End: () => goTo(Infinity),
  "+": () => player.zoom(ZOOM),
  "-": () => player.zoom(1 / ZOOM),
  Escape: () => set({ tool: "none" }),
};

function startKeys(): void {
  document.addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    const types = target.matches("select, input:not([type=range]):not([type=checkbox])");
    const action = KEYS[event.key];
    if (action === undefined || types || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    action(event.shiftKey);
  });
  slider.addEventListener("input", () => goTo(slider.valueAsNumber));
}

async function start(): Promise<void> {
  watch((changed) => {
    if (changed.has("series")) showCurve();
    if (changed.has("frame") || changed.has("info") || changed.has("series")) moveCursor();
  });
  startForm(say);
  startStages();
  startPicking(player);
  startTools();
  startKeys();
  const clips = byId<HTMLSelectElement>("clip");
  clips.addEventListener("change", () => void loadClip(Number(clips.value)));
  byId("measure").addEventListener("click", () => void measure());
  byId("close").addEventListener("click", () => void close());
  addEventListener("beforeunload", (event) => {
    if (isChanged()) event.preventDefault();
  });
  const folder = await loadFolder();
  await loadRig(say);
  await loadClip(0);
  if (folder.job !== null) await jobs.follow(folder.job);
}

start().catch((fault: Error) => say(fault.message, true));
