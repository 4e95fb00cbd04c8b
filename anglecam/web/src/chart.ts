/*! uPlot 1.6, (c) 2025 Leon Sorokin, MIT License: Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated documentation files (the "Software"), to deal in the Software without restriction, including without limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the Software is furnished to do so, subject to the following conditions: The above copyright notice and this permission notice shall be included in all copies or substantial portions of the Software. THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE. */
// One diagram over time: curves and bands of one recording, drawn by uPlot.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { addLegend, type Legend } from "./legend";
import { times, type Band, type Column, type Curve, type Plot, type Recording } from "./data";

const GRID = { stroke: "#eceff2", width: 1 };
const AXIS = { stroke: "#57606a", grid: GRID, ticks: GRID, font: "11px system-ui, sans-serif" };

export interface Chart {
  /** Move the cursor to a row without telling anybody. */
  point(row: number): void;
  /** Show or hide the bands that are drawn on demand. */
  showBounds(shown: boolean): void;
  resize(): void;
}

export interface Listener {
  /** The pointer rests on a row; null where it is beside all rows. */
  over(row: number | null): void;
  /** The pointer has left the diagram. */
  leave(): void;
  /** A row was clicked. */
  click(row: number): void;
}

export function draw(parent: HTMLElement, recording: Recording, plot: Plot, height: number, listener: Listener): Chart {
  const bands = plot.bands.filter((band) => hasBand(recording, band));
  const curves = plot.curves.filter((curve) => recording.columns[curve.column]);
  const edges = bands.flatMap((band) => bandEdges(recording, band));
  const data = [times(recording), ...edges, ...curves.map((curve) => recording.columns[curve.column]!)];
  let pointing = false;
  let legend: Legend | null = null;
  const chart = new uPlot(
    {
      width: widthOf(parent),
      height,
      cursor: {
        y: false,
        drag: { x: true, y: false },
        sync: { key: `recording-${recording.name}`, setSeries: false },
        points: { size: 6 },
      },
      legend: { show: false },
      scales: { x: { time: false }, y: { range: rangeOf(plot) } },
      axes: [
        { ...AXIS, size: 34, values: (_u, ticks) => ticks.map((t) => `${+t.toFixed(6)} s`) },
        { ...AXIS, size: 58, label: plot.label, labelSize: 16, labelFont: "11px system-ui, sans-serif", values: plainTicks },
      ],
      series: [
        {},
        ...bands.flatMap(bandSeries),
        ...curves.map(curveSeries),
      ],
      bands: bands.map((band, k) => ({ series: [2 * k + 2, 2 * k + 1], fill: band.colour })),
      hooks: {
        setCursor: [
          (u) => {
            if (pointing || !isUnderPointer(u)) return;
            const row = u.cursor.left! < 0 ? null : (u.cursor.idx ?? null);
            legend?.show(row);
            listener.over(row);
          },
        ],
      },
    },
    data as uPlot.AlignedData,
    parent,
  );
  legend = addLegend(parent, recording, curves, bands);
  onClick(chart, listener);
  chart.over.addEventListener("mouseleave", () => listener.leave());
  return {
    point(row) {
      pointing = true;
      const left = chart.valToPos(times(recording)[row]!, "x");
      chart.setCursor({ left, top: chart.over.clientHeight / 2 }, false);
      pointing = false;
      legend?.show(row);
    },
    showBounds(shown) {
      bands.forEach((band, k) => {
        if (band.shown) return;
        legend?.showBand(band, shown);
        chart.setSeries(2 * k + 1, { show: shown }, false);
        chart.setSeries(2 * k + 2, { show: shown }, false);
      });
    },
    resize: () => chart.setSize({ width: widthOf(parent), height }),
  };
}

function widthOf(parent: HTMLElement): number {
  return Math.max(200, parent.clientWidth);
}

function isUnderPointer(u: uPlot): boolean {
  return u.over.matches(":hover");
}

/** A click is a press and a release at one place; a drag zooms. */
function onClick(chart: uPlot, listener: Listener): void {
  let pressed = NaN;
  chart.over.addEventListener("mousedown", (event) => (pressed = event.clientX));
  chart.over.addEventListener("click", (event) => {
    if (Math.abs(event.clientX - pressed) > 3) return;
    const left = event.clientX - chart.over.getBoundingClientRect().left; // the plot's own cursor may lag by a frame
    listener.click(chart.posToIdx(left));
  });
}

function hasBand(recording: Recording, band: Band): boolean {
  const columns = [band.half, band.centre].filter((name): name is string => typeof name === "string");
  return columns.every((name) => recording.columns[name]);
}

/** Lower and upper edge of a band. */
function bandEdges(recording: Recording, band: Band): [Column, Column] {
  const half = band.half;
  const at = (column: string | null, k: number) => (column === null ? 0 : recording.columns[column]![k]!);
  const edge = (sign: number) =>
    times(recording).map((_t, k) => {
      const middle = at(band.centre, k);
      const width = typeof half === "number" ? half : at(half, k);
      return middle === null || width === null ? null : middle + sign * band.factor * width;
    });
  return [edge(-1), edge(1)];
}

function bandSeries(band: Band): uPlot.Series[] {
  const edge = { show: band.shown, stroke: band.colour, width: 1, points: { show: false } };
  return [edge, edge];
}

function curveSeries(curve: Curve): uPlot.Series {
  const dots = curve.style === "dots";
  const series: uPlot.Series = {
    stroke: curve.colour,
    width: dots ? 0 : 1.3,
    points: dots ? { show: true, size: 3, fill: curve.colour } : { show: false },
  };
  if (curve.style === "step") series.paths = uPlot.paths.stepped!({ align: 1 });
  if (dots) series.paths = () => null;
  return series;
}

function rangeOf(plot: Plot): uPlot.Range.Function {
  return (_u, low, high) => {
    if (low == null || high == null) return [0, 1];
    const margin = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1e-3;
    return [plot.from_zero ? 0 : low - margin, high + margin];
  };
}

function plainTicks(_u: uPlot, ticks: number[]): string[] {
  return ticks.map((tick) => String(+tick.toPrecision(6)).replace("-", "−"));
}
