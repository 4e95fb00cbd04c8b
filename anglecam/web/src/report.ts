// The scripts of every page: curves and film of reports, and the table of an index.

import { readCurves, type Curves } from "./data";
import { RecordingView } from "./recording";
import { filterable, sortable } from "./table";

document.documentElement.classList.add("scripted");

function element<T extends HTMLElement>(id: string): T | null {
  return document.getElementById(id) as T | null;
}

function startCurves(curves: Curves): void {
  const views = curves.recordings.map((_recording, k) => {
    const section = document.querySelector<HTMLElement>(`section.recording[data-recording="${k}"]`);
    return new RecordingView(curves, k, section);
  });
  const bounds = element<HTMLInputElement>("bounds");
  const figuresOf = (k: number) => [...document.querySelectorAll<HTMLElement>(`.curve[data-recording="${k}"]`)];
  const mount = (k: number) => {
    const figures = figuresOf(k).filter((figure) => figure.offsetParent !== null || figure.clientWidth > 0);
    views[k]!.mount(figures);
    if (bounds) views[k]!.showBounds(bounds.checked);
  };
  const picker = element<HTMLSelectElement>("recording");
  if (picker) {
    picker.append(...curves.recordings.map((recording, k) => new Option(recording.name, String(k))));
    const choose = () => {
      views.forEach((view, k) => view.section && (view.section.hidden = k !== Number(picker.value)));
      mount(Number(picker.value));
    };
    picker.addEventListener("change", choose);
    choose();
  }
  views.forEach((_view, k) => mount(k));
  bounds?.addEventListener("change", () => views.forEach((view) => view.showBounds(bounds.checked)));
  let width = window.innerWidth;
  window.addEventListener("resize", () => {
    if (window.innerWidth === width) return;
    width = window.innerWidth;
    views.forEach((view) => view.resize());
  });
}

const curves = readCurves();
if (curves) startCurves(curves);

const table = document.querySelector<HTMLTableElement>("table.index");
if (table) {
  sortable(table);
  filterable(table, element<HTMLInputElement>("words")!, element<HTMLSelectElement>("status")!, element("count")!);
}
document.documentElement.dataset["ready"] = String(Math.round(performance.now()));
