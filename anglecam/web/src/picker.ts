// Pointing at the picture: click a mark, a pivot or a lamp, draw a box, drag a point, move and zoom the picture.

import type { Box, Point } from "./api";
import { byId } from "./dom";
import { drawMagnifier } from "./magnifier";
import { handles, type Handle } from "./overlay";
import type { Player } from "./player";
import { change, section, set, state, watch, type Tool } from "./state";

const NEAR = 14;
const WHEEL = 1.2;
const TENTHS = 10;

/** What a pointer that is down does. */
type Drag = { kind: "handle"; name: Handle["name"] } | { kind: "box"; from: Point } | { kind: "pan"; last: Point };

export function startPicking(player: Player): void {
  const canvas = player.canvas, glass = byId<HTMLCanvasElement>("magnifier");
  let drag: Drag | null = null;

  const at = (event: MouseEvent): Point => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const inPicture = (event: MouseEvent): Point => rounded(player.view.toPicture(at(event)));

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    const handle = nearest(player, at(event));
    if (state.tool === "box") drag = { kind: "box", from: inPicture(event) };
    else if (state.tool !== "none") drag = { kind: "handle", name: place(state.tool, inPicture(event)) };
    else if (handle !== null) drag = { kind: "handle", name: handle.name };
    else drag = { kind: "pan", last: at(event) };
    showGlass(event);
  });

  canvas.addEventListener("pointermove", (event) => {
    if (drag?.kind === "handle") moveHandle(drag.name, inPicture(event));
    else if (drag?.kind === "box") drawBox(drag.from, inPicture(event));
    else if (drag?.kind === "pan") {
      const now = at(event);
      player.pan([now[0] - drag.last[0], now[1] - drag.last[1]]);
      drag = { kind: "pan", last: now };
    }
    showGlass(event);
  });

  const end = (): void => {
    if (drag !== null && drag.kind !== "pan") set({ tool: "none" });
    drag = null;
    glass.hidden = true;
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => {
    if (drag === null) glass.hidden = true;
  });

  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.shiftKey) return; // without a key, the page scrolls
    event.preventDefault();
    player.zoom(event.deltaY < 0 ? WHEEL : 1 / WHEEL, at(event));
  }, { passive: false });

  function showGlass(event: MouseEvent): void {
    const active = state.tool !== "none" || (drag !== null && drag.kind !== "pan");
    const image = player.image;
    canvas.style.cursor = active ? "crosshair" : nearest(player, at(event)) === null ? "grab" : "move";
    glass.hidden = !active || image === null;
    if (active && image !== null) {
      const corner = at(event)[0] < player.box[0] / 2 ? "right" : "left";
      drawMagnifier(glass, image, inPicture(event), corner);
    }
  }

  watch((changed) => {
    if (changed.has("tool")) canvas.style.cursor = state.tool === "none" ? "grab" : "crosshair";
  });
}

function nearest(player: Player, at: Point): Handle | null {
  const away = (handle: Handle): number => {
    const [x, y] = player.view.toScreen(handle.at);
    return Math.hypot(x - at[0], y - at[1]);
  };
  const sorted = handles().sort((a, b) => away(a) - away(b));
  return sorted[0] !== undefined && away(sorted[0]) < NEAR ? sorted[0] : null;
}

/** Declare a point with a tool, and return the handle that it has now. */
function place(tool: Exclude<Tool, "none" | "box">, at: Point): Handle["name"] {
  const { marker } = section("pivot") ?? {};
  const kept = marker === undefined ? {} : { marker };
  if (tool === "mark") change({ mark: { at, frame: state.frame } });
  if (tool === "pivot") change({ pivot: { ...kept, at, sigma_px: section("pivot")?.sigma_px ?? 1 } });
  if (tool === "near") change({ pivot: { ...kept, near: at } });
  if (tool === "lamp") change({ sync: { ...section("sync"), lamp: at } });
  return tool === "near" ? "pivot" : tool;
}

/** Move a declared point; used by dragging and by the form. */
export function moveHandle(name: Handle["name"], at: Point): void {
  const mark = section("mark"), pivot = section("pivot");
  if (name === "lamp") change({ sync: { ...section("sync"), lamp: at } });
  if (name === "pivot" && pivot) change({ pivot: pivot.at ? { ...pivot, at } : { ...pivot, near: at } });
  if (!mark || mark === "auto") return;
  if (name === "mark") change({ mark: { ...mark, at } });
  if (mark.box && name === "box0") drawBox(at, [mark.box[2], mark.box[3]], mark.frame);
  if (mark.box && name === "box1") drawBox([mark.box[0], mark.box[1]], at, mark.frame);
}

function drawBox(from: Point, to: Point, frame = state.frame): void {
  const sides = [0, 1].map((axis) => [from[axis]!, to[axis]!].sort((a, b) => a - b));
  const box: Box = [sides[0]![0]!, sides[1]![0]!, sides[0]![1]!, sides[1]![1]!];
  if (box[0] < box[2] && box[1] < box[3]) change({ mark: { box, frame } });
}

function rounded([x, y]: Point): Point {
  return [Math.round(x * TENTHS) / TENTHS, Math.round(y * TENTHS) / TENTHS];
}
