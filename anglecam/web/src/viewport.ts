// Which part of the picture is seen, and where: from pixels of the picture to pixels of the screen and back.

import type { Point } from "./api";

const MOST = 40;

export class Viewport {
  /** Screen pixels per pixel of the picture. */
  scale = 1;
  private left = 0;
  private top = 0;
  private zoom = 1;

  /** Fit a picture into a box of the screen, as far in as it was before. */
  fit(picture: Point, box: Point): void {
    const fitting = Math.min(box[0] / picture[0], box[1] / picture[1]);
    this.scale = fitting * this.zoom;
    for (const axis of [0, 1] as const) this.clamp(axis, picture, box);
  }

  /** Show the whole picture. */
  reset(): void {
    this.zoom = 1;
    this.left = this.top = 0;
  }

  /** Zoom by a factor about a place on the screen. */
  zoomAt(factor: number, at: Point, picture: Point, box: Point): void {
    const before = this.toPicture(at);
    this.zoom = Math.min(Math.max(this.zoom * factor, 1), MOST);
    this.fit(picture, box);
    const now = this.toPicture(at);
    this.left += before[0] - now[0];
    this.top += before[1] - now[1];
    this.fit(picture, box);
  }

  /** Move the picture by a distance on the screen. */
  pan(by: Point, picture: Point, box: Point): void {
    this.left -= by[0] / this.scale;
    this.top -= by[1] / this.scale;
    this.fit(picture, box);
  }

  /** Whether only a part of the picture is seen. */
  get isZoomed(): boolean {
    return this.zoom > 1;
  }

  /** From the picture to the screen. The centre of the top left pixel is (0, 0). */
  toScreen([x, y]: Point): Point {
    return [(x + 0.5 - this.left) * this.scale, (y + 0.5 - this.top) * this.scale];
  }

  /** From the screen to the picture. */
  toPicture([x, y]: Point): Point {
    return [x / this.scale + this.left - 0.5, y / this.scale + this.top - 0.5];
  }

  private clamp(axis: 0 | 1, picture: Point, box: Point): void {
    const seen = box[axis] / this.scale;
    const key = axis === 0 ? "left" : "top";
    const free = picture[axis] - seen;
    this[key] = free <= 0 ? free / 2 : Math.min(Math.max(this[key], 0), free);
  }
}
