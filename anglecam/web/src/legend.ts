// The legend of a diagram: names, colours, and the values at the cursor.

import { times, type Band, type Curve, type Recording } from "./data";

export interface Legend {
  /** Write the values of a row; null empties them. */
  show(row: number | null): void;
  /** Show or hide the entry of a band. */
  showBand(band: Band, shown: boolean): void;
}

export function addLegend(parent: HTMLElement, recording: Recording, curves: Curve[], bands: Band[]): Legend {
  const list = document.createElement("ul");
  list.className = "legend";
  list.setAttribute("aria-hidden", "true"); // the slider says the same to a screen reader
  const clock = entry(list, "time", null);
  const lines = curves.map((curve) => ({ curve, value: entry(list, curve.label, curve.colour) }));
  const areas = bands.map((band) => ({ band, value: entry(list, band.label, band.colour) }));
  for (const { band, value } of areas) value.parentElement!.hidden = !band.shown;
  parent.append(list);
  return {
    show(row) {
      clock.textContent = row === null ? "" : `${times(recording)[row]!.toFixed(3)} s`;
      for (const { curve, value } of lines) value.textContent = row === null ? "" : degrees(recording.columns[curve.column]![row]!);
      for (const { band, value } of areas) {
        const half = row === null || typeof band.half === "number" ? band.half : recording.columns[band.half]![row]!;
        value.textContent = typeof half === "number" ? `± ${degrees(band.factor * half)}` : "";
      }
    },
    showBand(band, shown) {
      areas.find((area) => area.band === band)!.value.parentElement!.hidden = !shown;
    },
  };
}

function entry(list: HTMLElement, label: string, colour: string | null): HTMLElement {
  const item = document.createElement("li");
  if (colour !== null) {
    const swatch = document.createElement("i");
    swatch.style.background = colour;
    item.append(swatch);
  }
  const value = document.createElement("b");
  item.append(`${label} `, value);
  list.append(item);
  return value;
}

function degrees(value: number | null): string {
  return value === null ? "–" : `${value.toFixed(4).replace("-", "−")}°`;
}
