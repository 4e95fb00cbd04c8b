// The numbers of the shown frame: time, angle with its standard uncertainty, bounds, status.

import { byId } from "./dom";
import { cell } from "./overlay";
import { rowOf, state } from "./state";

/** Write what is known of the shown frame. */
export function showReadout(bounds: boolean): void {
  const { info, frame, series } = state;
  if (info === null) return;
  byId("frame-number").textContent = `frame ${frame} of ${info.times.length - 1}`;
  byId("frame-time").textContent = `${(info.times[frame] ?? 0).toFixed(4)} s`;
  const row = rowOf(frame);
  byId("frame-angle").textContent = series === null ? "not measured" : row === undefined ? "outside the range" : angle(row, bounds);
}

function angle(row: number, bounds: boolean): string {
  const s = state.series!;
  const value = cell(s.angle_deg, row), sigma = cell(s.sigma_deg, row);
  if (value === null) return s.status[row] ?? "";
  const digits = sigma === null || sigma <= 0 ? 3 : Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), 2), 5);
  const known = sigma === null ? "" : ` ± ${sigma.toFixed(digits)}`;
  const [six, ten] = [cell(s.bound_6px_deg, row), cell(s.bound_10px_deg, row)];
  const worst = bounds && six !== null && ten !== null ? `; worst case ±${six.toFixed(2)}° (6 px), ±${ten.toFixed(2)}° (10 px)` : "";
  return `${value.toFixed(digits)}${known}°${worst}`;
}
