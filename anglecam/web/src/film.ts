// The pictures of one recording: shows the one that is nearest to a row.

interface Shown {
  row: number;
  element: HTMLElement;
  svg: SVGSVGElement;
}

const MAGNIFIED_PX = 70;
const LEAST_VISIBLE_PX = 80; // a picture of which less is in the window counts as out of view

export class Film {
  private readonly pictures: Shown[];
  private shown: Shown | null = null;
  private magnified = false;

  constructor(private readonly element: HTMLElement) {
    this.pictures = [...element.querySelectorAll<HTMLElement>(".picture")].map((picture) => ({
      row: Number(picture.dataset["row"]),
      element: picture,
      svg: picture.querySelector("svg")!,
    }));
    this.on(".magnify", (box) => {
      this.magnified = box.checked;
      this.frame();
    });
    this.on(".overlay", (box) => {
      for (const { svg } of this.pictures) svg.classList.toggle("plain", !box.checked);
    });
    element.querySelector(".undock")?.addEventListener("click", () => this.dock(false));
    const cameIntoView = new IntersectionObserver(
      () => {
        if (this.isInView()) this.dock(false); // what the observer has seen may be older than a click
      },
      { rootMargin: `-${LEAST_VISIBLE_PX}px 0px` },
    );
    cameIntoView.observe(element.parentElement!);
  }

  get isEmpty(): boolean {
    return this.pictures.length === 0;
  }

  /** Show the picture that is nearest to a row, and say how far away it is. */
  show(row: number, first: number): void {
    if (this.isEmpty) return;
    const best = this.pictures.reduce((a, b) => (Math.abs(b.row - row) < Math.abs(a.row - row) ? b : a));
    if (best !== this.shown) {
      this.shown?.element.classList.remove("shown");
      best.element.classList.add("shown");
      this.shown = best;
      this.frame();
    }
    const away = best.row - row;
    const where = `The cursor is at frame ${first + row}; the nearest picture is ${Math.abs(away)} later or earlier.`;
    const text = away === 0 ? "" : where.replace("later or earlier", away > 0 ? "later" : "earlier");
    const line = this.element.querySelector(".away")!;
    if (line.textContent !== text) line.textContent = text;
  }

  /** Keep the picture in view in a corner, while another part of the page is read. */
  dock(docked: boolean): void {
    if (!this.isEmpty) this.element.classList.toggle("docked", docked);
  }

  isInView(): boolean {
    const box = this.element.parentElement!.getBoundingClientRect();
    return box.bottom > LEAST_VISIBLE_PX && box.top < window.innerHeight - LEAST_VISIBLE_PX;
  }

  /** Set the part of the picture that is seen. */
  private frame(): void {
    if (!this.shown) return;
    const { svg } = this.shown;
    svg.dataset["whole"] ??= svg.getAttribute("viewBox")!;
    const mark = svg.querySelector(".bound");
    const [, , width, height] = svg.dataset["whole"].split(" ").map(Number) as [number, number, number, number];
    const close = this.magnified && mark;
    const w = MAGNIFIED_PX;
    const h = (MAGNIFIED_PX * height) / width;
    const x = Number(mark?.getAttribute("cx")) - w / 2;
    const y = Number(mark?.getAttribute("cy")) - h / 2;
    svg.setAttribute("viewBox", close ? `${x} ${y} ${w} ${h}` : svg.dataset["whole"]);
  }

  private on(selector: string, act: (box: HTMLInputElement) => void): void {
    const box = this.element.querySelector<HTMLInputElement>(selector);
    box?.addEventListener("change", () => act(box));
  }
}
