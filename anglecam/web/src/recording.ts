// One recording on the page: its diagrams, its pictures and its slider under one cursor.

import { draw, type Chart } from "./chart";
import { times, type Curves, type Recording } from "./data";
import { Film } from "./film";

export class RecordingView {
  private readonly charts: Chart[] = [];
  private readonly data: Recording;
  private readonly film: Film | null;
  private readonly slider: HTMLInputElement | null;
  private pinned = 0;

  constructor(
    private readonly curves: Curves,
    number: number,
    readonly section: HTMLElement | null,
  ) {
    this.data = curves.recordings[number]!;
    const film = section?.querySelector<HTMLElement>(".film");
    this.film = film ? new Film(film) : null;
    this.slider = section?.querySelector<HTMLInputElement>("input[type=range]") ?? null;
    if (this.slider) {
      this.slider.max = String(times(this.data).length - 1);
      this.slider.addEventListener("input", () => this.pin(this.slider!.valueAsNumber));
    }
    section?.querySelectorAll<HTMLElement>(".step").forEach((button) =>
      button.addEventListener("click", () => this.pin(this.pinned + Number(button.dataset["step"]))),
    );
  }

  /** Draw the diagrams in those of the figures that have none yet. */
  mount(figures: Iterable<HTMLElement>): void {
    for (const figure of figures) {
      const plot = this.curves.plots[figure.dataset["plot"]!];
      if (!plot || figure.classList.contains("live")) continue;
      figure.classList.add("live");
      const chart: Chart = draw(figure, this.data, plot, Number(figure.dataset["height"] ?? 170), {
        over: (row) => this.point(row ?? this.pinned, chart),
        leave: () => this.point(this.pinned),
        click: (row) => this.click(row),
      });
      this.charts.push(chart);
    }
    this.point(this.pinned);
  }

  showBounds(shown: boolean): void {
    for (const chart of this.charts) chart.showBounds(shown);
  }

  resize(): void {
    for (const chart of this.charts) chart.resize();
    this.point(this.pinned);
  }

  /** Stay at a row until another is chosen. */
  pin(row: number): void {
    this.pinned = Math.min(Math.max(row, 0), times(this.data).length - 1);
    this.point(this.pinned);
  }

  private click(row: number): void {
    this.pin(row);
    if (this.film && !this.film.isInView()) this.film.dock(true);
  }

  /** Move cursor, slider and film to a row; the diagram whose own cursor asked for it is there already. */
  private point(row: number, from?: Chart): void {
    for (const chart of this.charts) if (chart !== from) chart.point(row);
    this.film?.show(row, this.data.first);
    if (!this.slider) return;
    this.slider.value = String(row);
    const angle = this.data.columns["angle"]?.[row];
    const stated = angle == null ? "no angle" : `${angle.toFixed(3)}°`;
    this.slider.setAttribute("aria-valuetext", `frame ${this.data.first + row}, ${times(this.data)[row]!.toFixed(3)} s, ${stated}`);
  }
}
