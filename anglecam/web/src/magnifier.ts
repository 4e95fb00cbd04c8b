// A magnifier: the pixels around a place, enlarged, with a cross at the place itself and its coordinates.

import type { Point } from "./api";
import { styled } from "./dom";
import { cross } from "./overlay";

const SIDE = 144;
const ENLARGED = 9;

/** Draw the picture around a place into a canvas, and its coordinates below. */
export function drawMagnifier(canvas: HTMLCanvasElement, image: CanvasImageSource, at: Point, corner: "left" | "right"): void {
  const density = devicePixelRatio;
  canvas.width = canvas.height = SIDE * density;
  canvas.dataset.corner = corner;
  canvas.hidden = false;
  const pen = canvas.getContext("2d")!;
  pen.scale(density, density);
  pen.imageSmoothingEnabled = false;
  pen.fillStyle = "#000";
  pen.fillRect(0, 0, SIDE, SIDE);
  const middle = SIDE / 2;
  pen.translate(middle - (at[0] + 0.5) * ENLARGED, middle - (at[1] + 0.5) * ENLARGED);
  pen.scale(ENLARGED, ENLARGED);
  pen.drawImage(image, 0, 0);
  pen.setTransform(density, 0, 0, density, 0, 0);
  cross(pen, [middle, middle], 40, styled("--declared"));
  pen.fillStyle = "rgb(0 0 0 / 70%)";
  pen.fillRect(0, SIDE - 20, SIDE, 20);
  pen.fillStyle = "#fff";
  pen.font = "12px ui-monospace, monospace";
  pen.textAlign = "center";
  pen.fillText(`${at[0].toFixed(1)}, ${at[1].toFixed(1)}`, middle, SIDE - 6);
}
