// The player: one frame of the clip, exact and without a video element, with what is drawn over it.

import { ask, frameAddress, type Found, type Point } from "./api";
import { byId } from "./dom";
import { drawOverlay } from "./overlay";
import { set, state, watch } from "./state";
import { Viewport } from "./viewport";

const REST_MS = 150;
const NEXT = 2;

export class Player {
  readonly canvas = byId<HTMLCanvasElement>("picture");
  readonly view = new Viewport();
  /** The shown frame, as it came from the server. */
  image: ImageBitmap | null = null;
  /** Number of the frame that `image` shows. */
  shown = -1;
  bounds = false;
  private wanted = "";
  private loading = false;
  private rest: ReturnType<typeof setTimeout> | undefined;

  constructor() {
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    watch((changed) => {
      if (changed.has("info")) {
        this.view.reset();
        this.canvas.style.aspectRatio = `${this.size[0]} / ${this.size[1]}`;
      }
      if (["info", "frame", "stage", "learnt"].some((key) => changed.has(key as never))) this.load();
      else this.draw();
    });
  }

  /** Size of the picture, px. */
  get size(): Point {
    return [state.info?.width ?? 1, state.info?.height ?? 1];
  }

  /** Size of the canvas on the screen. */
  get box(): Point {
    return [this.canvas.clientWidth, this.canvas.clientHeight];
  }

  /** Zoom about the middle, or about a place on the screen. */
  zoom(factor: number, at: Point = [this.box[0] / 2, this.box[1] / 2]): void {
    this.view.zoomAt(factor, at, this.size, this.box);
    this.draw();
  }

  /** Move the picture. */
  pan(by: Point): void {
    this.view.pan(by, this.size, this.box);
    this.draw();
  }

  /** Draw the frame and what belongs over it. */
  draw(): void {
    const density = devicePixelRatio, [width, height] = this.box;
    this.canvas.width = Math.round(width * density);
    this.canvas.height = Math.round(height * density);
    const pen = this.canvas.getContext("2d")!;
    pen.scale(density, density);
    if (this.image === null || state.info === null) return;
    this.view.fit(this.size, this.box);
    const [left, top] = this.view.toScreen([-0.5, -0.5]);
    pen.imageSmoothingEnabled = this.view.scale < 2;
    pen.drawImage(this.image, left, top, this.size[0] * this.view.scale, this.size[1] * this.view.scale);
    if (this.shown === state.frame) drawOverlay(pen, this.view, this.bounds);
  }

  /** Show the frame and stage of the state: JPEG while it changes, every pixel when it rests. */
  private load(): void {
    clearTimeout(this.rest);
    const { info, clip, frame, stage, learnt } = state;
    if (info === null) return;
    if (stage !== "film" && learnt === null) return this.draw();
    if (stage === "found") void this.loadFound();
    if (stage !== "film" && stage !== "found") {
      return this.want(`/api/clips/${clip}/frames/${frame}/${stage}.png?mark=${learnt!.key}`);
    }
    this.want(frameAddress(clip, frame, "jpg", info.version));
    this.rest = setTimeout(() => this.want(frameAddress(clip, frame, "png", info.version)), REST_MS);
  }

  private async loadFound(): Promise<void> {
    const { clip, frame, learnt } = state;
    const found = await ask<Found>(`/api/clips/${clip}/frames/${frame}/found?mark=${learnt!.key}`).catch(() => null);
    if (state.frame === frame && state.learnt === learnt) set({ found });
  }

  /** Load a picture; while one is loading, only the last that was wanted comes next. */
  private want(address: string): void {
    this.wanted = address;
    if (!this.loading) void this.loadWanted();
  }

  private async loadWanted(): Promise<void> {
    this.loading = true;
    while (this.wanted !== "") {
      const address = this.wanted;
      this.wanted = "";
      const picture = await fetchPicture(address);
      if (address.startsWith(`/api/clips/${state.clip}/`)) this.showPicture(picture, frameIn(address));
    }
    this.loading = false;
  }

  private showPicture(picture: ImageBitmap | null, frame: number): void {
    this.image?.close();
    this.image = picture;
    this.shown = frame;
    byId("no-picture").hidden = picture !== null;
    this.canvas.dataset.frame = String(frame);
    this.draw();
    if (picture !== null) this.fetchAhead(frame);
  }

  /** Let the browser have the next frames before they are asked for. */
  private fetchAhead(frame: number): void {
    const { info, clip, stage } = state;
    if (info === null || stage !== "film" || frame !== state.frame || this.wanted !== "") return;
    for (let k = frame + 1; k <= Math.min(frame + NEXT, info.times.length - 1); k++) {
      void fetch(frameAddress(clip, k, "jpg", info.version)).catch(() => null);
    }
  }
}

async function fetchPicture(address: string): Promise<ImageBitmap | null> {
  const answer = await fetch(address).catch(() => null);
  return answer?.ok ? createImageBitmap(await answer.blob()) : null;
}

function frameIn(address: string): number {
  return Number(/frames\/(\d+)/.exec(address)?.[1] ?? -1);
}
