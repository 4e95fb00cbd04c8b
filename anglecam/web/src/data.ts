// The data of a page, as anglecam/report/curves.py writes them.

export type Column = (number | null)[];

export interface Curve {
  column: string;
  label: string;
  colour: string;
  style: "line" | "dots" | "step";
}

export interface Band {
  label: string;
  colour: string;
  half: string | number;
  centre: string | null;
  factor: number;
  shown: boolean;
}

export interface Plot {
  label: string;
  curves: Curve[];
  bands: Band[];
  from_zero: boolean;
}

export interface Recording {
  name: string;
  first: number;
  columns: Record<string, Column>;
}

export interface Curves {
  recordings: Recording[];
  plots: Record<string, Plot>;
}

export function readCurves(): Curves | null {
  const text = document.getElementById("curves")?.textContent;
  return text ? (JSON.parse(text) as Curves) : null;
}

/** Time of every row, s. */
export function times(recording: Recording): number[] {
  return recording.columns["time"] as number[];
}

/** Row whose time is nearest. */
export function nearestRow(time: number[], t: number): number {
  let low = 0;
  let high = time.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle]! <= t) low = middle;
    else high = middle;
  }
  return t - time[low]! <= time[high]! - t ? low : high;
}
