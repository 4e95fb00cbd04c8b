// What is drawn over a frame: the measured mark, pivot and bounds, what the search found, and what the rig declares.

import type { Box, Cells, Point, Region } from "./api";
import { styled } from "./dom";
import { rowOf, section, state } from "./state";
import type { Viewport } from "./viewport";

/** Radii of the worst-case bounds, px of the picture, and the colours of their circles. */
export const RADII: [number, string][] = [[6, "--bound6"], [10, "--bound10"]];

/** A point of the rig that can be dragged. */
export interface Handle {
  name: "mark" | "pivot" | "lamp" | "box0" | "box1";
  at: Point;
}

/** Return the declared points that lie in the shown frame. */
export function handles(): Handle[] {
  const mark = section("mark"), pivot = section("pivot"), lamp = section("sync")?.lamp;
  const found: Handle[] = [];
  if (mark && mark !== "auto" && (mark.frame ?? 0) === state.frame) {
    if (mark.at) found.push({ name: "mark", at: mark.at });
    if (mark.box) {
      found.push({ name: "box0", at: [mark.box[0], mark.box[1]] }, { name: "box1", at: [mark.box[2], mark.box[3]] });
    }
  }
  const centre = pivot?.at ?? pivot?.near;
  if (centre) found.push({ name: "pivot", at: centre });
  if (lamp) found.push({ name: "lamp", at: lamp });
  return found;
}

/** Return the measured mark and pivot of a frame. */
export function measured(frame: number): { mark: Point; pivot: Point } | null {
  const row = rowOf(frame), s = state.series;
  if (row === undefined || s === null) return null;
  const [mx, my, px, py] = [s.mouth_x_px, s.mouth_y_px, s.pivot_x_px, s.pivot_y_px].map((cells) => cell(cells, row));
  if (mx === null || my === null || px === null || py === null) return null;
  return { mark: [mx!, my!], pivot: [px!, py!] };
}

/** Return a cell of a column, null where there is none. */
export function cell(cells: Cells | undefined, row: number): number | null {
  return cells?.[row] ?? null;
}

/** Draw everything that belongs to the shown frame. */
export function drawOverlay(pen: CanvasRenderingContext2D, view: Viewport, bounds: boolean): void {
  const found = measured(state.frame);
  if (state.stage === "found" && state.found) state.found.regions.forEach((region) => drawRegion(pen, view, region));
  if (found) drawMeasured(pen, view, found.mark, found.pivot, bounds);
  const mark = section("mark");
  if (mark && mark !== "auto" && mark.box && (mark.frame ?? 0) === state.frame) drawBox(pen, view, mark.box);
  for (const handle of handles()) drawHandle(pen, view, handle);
}

function drawMeasured(pen: CanvasRenderingContext2D, view: Viewport, mark: Point, pivot: Point, bounds: boolean): void {
  line(pen, view, [pivot, mark], styled("--measured"), 1.5);
  cross(pen, view.toScreen(mark), 7, styled("--measured"));
  ring(pen, view.toScreen(pivot), 5, styled("--measured"));
  if (!bounds) return;
  const arm: Point = [mark[0] - pivot[0], mark[1] - pivot[1]];
  const lever = Math.hypot(...arm);
  for (const [radius, name] of RADII) {
    const colour = styled(name);
    ring(pen, view.toScreen(mark), radius * view.scale, colour);
    if (radius >= lever) continue;
    const turn = Math.asin(radius / lever), reach = Math.sqrt(lever ** 2 - radius ** 2) / lever;
    for (const side of [-turn, turn]) {
      const [c, s] = [Math.cos(side) * reach, Math.sin(side) * reach];
      line(pen, view, [pivot, [pivot[0] + c * arm[0] - s * arm[1], pivot[1] + s * arm[0] + c * arm[1]]], colour, 1);
    }
  }
}

function drawRegion(pen: CanvasRenderingContext2D, view: Viewport, region: Region): void {
  const colour = styled(region.mark ? "--found" : "--other");
  line(pen, view, [...region.outline_px, region.outline_px[0]!], colour, region.mark ? 2 : 1);
  if (region.mark) cross(pen, view.toScreen(region.centre_px), 6, colour);
}

function drawBox(pen: CanvasRenderingContext2D, view: Viewport, [x0, y0, x1, y1]: Box): void {
  line(pen, view, [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]], styled("--declared"), 1.5);
}

function drawHandle(pen: CanvasRenderingContext2D, view: Viewport, handle: Handle): void {
  const at = view.toScreen(handle.at), colour = styled("--declared");
  if (handle.name !== "mark") ring(pen, at, handle.name === "pivot" ? 9 : 6, colour);
  cross(pen, at, handle.name.startsWith("box") ? 4 : 12, colour);
  if (handle.name.startsWith("box")) return;
  pen.font = "12px system-ui, sans-serif";
  outlined(pen, () => pen.strokeText(handle.name, at[0] + 12, at[1] - 8), 3);
  pen.fillStyle = colour;
  pen.fillText(handle.name, at[0] + 12, at[1] - 8);
}

function line(pen: CanvasRenderingContext2D, view: Viewport, points: Point[], colour: string, width: number): void {
  pen.beginPath();
  points.forEach((point, k) => {
    const [x, y] = view.toScreen(point);
    if (k === 0) pen.moveTo(x, y);
    else pen.lineTo(x, y);
  });
  stroke(pen, colour, width);
}

function ring(pen: CanvasRenderingContext2D, [x, y]: Point, radius: number, colour: string): void {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  stroke(pen, colour, 1.5);
}

/** Draw a cross that leaves its middle free, so that the pixel there is seen. */
export function cross(pen: CanvasRenderingContext2D, [x, y]: Point, size: number, colour: string): void {
  const gap = size / 4;
  pen.beginPath();
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]] as Point[]) {
    pen.moveTo(x + gap * dx, y + gap * dy);
    pen.lineTo(x + size * dx, y + size * dy);
  }
  stroke(pen, colour, 1.5);
}

/** Stroke the path in a colour with a dark border, so that it is seen on any picture. */
function stroke(pen: CanvasRenderingContext2D, colour: string, width: number): void {
  outlined(pen, () => pen.stroke(), width + 2);
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
}

function outlined(pen: CanvasRenderingContext2D, draw: () => void, width: number): void {
  pen.strokeStyle = "rgb(0 0 0 / 45%)";
  pen.lineWidth = width;
  draw();
}
