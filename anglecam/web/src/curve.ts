// A curve over time with its standard uncertainty as a band, and one cursor. It knows nothing of the page around it.

import uPlot from "uplot";
import { styled } from "./dom";

export interface Band {
  /** Half width at each time; null where there is no value. */
  half: (number | null)[];
  label: string;
  /** Custom property of the style sheet that holds the colour. */
  colour: string;
}

export interface CurveData {
  time: number[];
  value: (number | null)[];
  /** The value's name and unit. */
  label: string;
  bands: Band[];
  /** Another curve at the same times, such as the command. */
  beside?: { value: (number | null)[]; label: string };
}

/** Draw a curve into an element; a click or an arrow key calls `pick` with the index of a time. */
export class Curve {
  private plot: uPlot | null = null;
  private data: CurveData | null = null;
  private at = 0;

  constructor(
    private readonly host: HTMLElement,
    private readonly height: () => number,
    private readonly pick: (index: number) => void,
  ) {
    new ResizeObserver(() => this.resize()).observe(host);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.data));
  }

  /** Show data in place of those that were shown; null removes the plot. */
  show(data: CurveData | null): void {
    this.plot?.destroy();
    this.plot = null;
    this.data = data;
    if (data === null) return;
    this.plot = new uPlot(this.options(data), columns(data), this.host);
    this.plot.over.addEventListener("click", (event) => this.pickAt(event.clientX));
  }

  /** Put the cursor at the time of an index. */
  moveTo(index: number): void {
    this.at = index;
    this.plot?.redraw(false, false);
  }

  private pickAt(x: number): void {
    const plot = this.plot!;
    this.pick(plot.posToIdx(x - plot.over.getBoundingClientRect().left)); // the plot's own cursor may lag by a frame
  }

  private resize(): void {
    if (this.host.clientWidth > 0) this.plot?.setSize({ width: this.host.clientWidth, height: this.height() });
  }

  private options(data: CurveData): uPlot.Options {
    const ink = styled("--ink"), faint = styled("--line"), accent = styled("--accent");
    const axis = { stroke: ink, grid: { stroke: faint, width: 1 }, ticks: { stroke: faint, width: 1 } };
    const hidden = { stroke: "transparent", points: { show: false } };
    const edges = data.bands.flatMap(() => [hidden, hidden]);
    const beside = data.beside ? [{ label: data.beside.label, stroke: styled("--command"), width: 1, points: { show: false }, paths: uPlot.paths.stepped!({ align: 1 }) }] : [];
    return {
      width: this.host.clientWidth,
      height: this.height(),
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, points: { show: false } },
      scales: { x: { time: false } },
      axes: [
        { ...axis, label: "time, s", labelSize: 18, size: 34 },
        { ...axis, label: data.label, labelSize: 18, size: 52 },
      ],
      series: [{ label: "time" }, { label: data.label, stroke: accent, width: 1.5, points: { show: false } }, ...beside, ...edges],
      bands: data.bands.map((band, k) => {
        const first = 2 + beside.length + 2 * k;
        return { series: [first, first + 1] as [number, number], fill: styled(band.colour) };
      }),
      hooks: { draw: [(plot) => this.drawCursor(plot)] },
    };
  }

  private drawCursor(plot: uPlot): void {
    const time = this.data?.time[this.at];
    if (time === undefined) return;
    const { ctx, bbox } = plot;
    const x = Math.round(plot.valToPos(time, "x", true));
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.save();
    ctx.strokeStyle = styled("--cursor");
    ctx.lineWidth = 2 * devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    const value = this.data?.value[this.at];
    if (value !== null && value !== undefined) {
      ctx.fillStyle = styled("--cursor");
      ctx.beginPath();
      ctx.arc(x, plot.valToPos(value, "y", true), 4 * devicePixelRatio, 0, 2 * Math.PI);
      ctx.fill();
    }
    ctx.restore();
  }
}

function columns(data: CurveData): uPlot.AlignedData {
  const edges = data.bands.flatMap((band) =>
    [1, -1].map((side) => data.value.map((value, i) => sum(value, band.half[i], side))),
  );
  const beside = data.beside ? [data.beside.value] : [];
  return [data.time, data.value, ...beside, ...edges] as uPlot.AlignedData;
}

function sum(value: number | null, half: number | null | undefined, side: number): number | null {
  return value === null || half === null || half === undefined ? null : value + side * half;
}
