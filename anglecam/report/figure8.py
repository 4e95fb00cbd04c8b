"""Fig. 8 of the paper, drawn for a frame of the user's clip: how an edge off by some pixels rotates the line."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.report.figures import STYLE, _svg
from anglecam.vision.mark.colour import EMPTY_LEVEL, FULL_LEVEL, fit_discriminant

RADII_PX = (6.0, 10.0)
_TRUE, _SIX, _TEN, _PIVOT = "#d7191c", "#2b6cff", "#12a150", "#ffd400"
_LINES = ((_SIX, "--"), (_TEN, "-."))
_CASING = [Stroke(linewidth=2.8, foreground="white", alpha=0.8), Normal()]
"""White border of a red line, so that it is visible on a red mark."""
_MARGIN_PX = 14
"""Margin around the mark's outline, px, so that both circles fit in."""
_INNER_PX = 2
"""Distance from the outline, px, within which a pixel counts neither as mark nor as background."""


@dataclass(frozen=True)
class Scene:
    """One frame and the outline and points measured in it."""

    image: Image
    """(h, w, 3) blue, green, red."""
    contour_px: NDArray[np.int32]
    """(k, 2) outline of the mark, px."""
    mark_px: Floats
    """(2,) px."""
    pivot_px: Floats
    """(2,) px."""


def figure8(scene: Scene) -> str:
    """Draw the six panels of Fig. 8, as SVG.

    (a) The mark, zoomed. (b) Lines from the pivoting axis: the measured line, and the tangents of the circles of 6 px
    and 10 px, the largest rotations that a point within the circle can cause. (c) The cropped image. (d) Canny edges of
    the map of the mark's fraction in each pixel. (e) The boundary filled. (f) The filled boundary with both circles.

    Parameters
    ----------
    scene : Scene
        The frame.

    Returns
    -------
    str
        An ``<svg>`` element that contains the pictures.
    """
    rows, columns = _window(scene)
    crop = scene.image[rows, columns]
    extent = (columns.start - 0.5, columns.stop - 0.5, rows.stop - 0.5, rows.start - 0.5)
    filled = _filled(scene)[rows, columns]
    edges = _edges(crop, filled)
    with plt.rc_context({**STYLE, "axes.grid": False, "axes.spines.top": True, "axes.spines.right": True}):
        figure, axes = plt.subplots(2, 3, figsize=(10, 6.4), layout="constrained")
        pictures = (scene.image, scene.image, crop, edges, filled, filled)
        titles = (
            "(a) zoomed mark",
            "(b) lines from the pivoting axis",
            "(c) cropped image",
            "(d) Canny edges",
            "(e) boundary filled",
            "(f) filled, circles of 6 px and 10 px",
        )
        for i, (ax, picture, title) in enumerate(zip(axes.flat, pictures, titles, strict=True)):
            whole = i < 2
            shown = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB) if picture.ndim == 3 else picture * 255
            ax.imshow(shown, cmap="gray", vmin=0, vmax=255, interpolation="nearest", extent=None if whole else extent)
            ax.set_title(title, fontsize=9, loc="left")
            ax.tick_params(labelsize=7, length=2)
        zoom, lines, *_, ringed = axes.flat
        _limit(zoom, scene.mark_px + np.array([[-1.0], [1.0]]) * 2.2 * max(RADII_PX))
        _draw_lines(zoom, scene)
        _draw_circles(zoom, scene.mark_px)
        both = np.stack([scene.mark_px, scene.pivot_px])
        _limit(lines, _widened(both, scene.image.shape))
        _draw_lines(lines, scene)
        _draw_circles(lines, scene.mark_px)
        lines.plot(*scene.pivot_px, "o", ms=5, mfc="none", mec=_PIVOT, mew=1.4)
        lines.legend(fontsize=7, loc="best", frameon=True, framealpha=0.85, edgecolor="none")
        _draw_circles(ringed, scene.mark_px)
        ringed.plot(*scene.mark_px, "+", color=_TRUE, ms=8, mew=1.4)
        return _svg(figure)


def touching_point(pivot_px: Floats, mark_px: Floats, radius_px: float, side: float) -> Floats:
    """Return the point where a tangent from the pivot touches the circle around the mark: the worst case within it.

    Parameters
    ----------
    pivot_px, mark_px : ndarray
        (2,) px.
    radius_px : float
        Radius r of the circle, px, smaller than the lever arm R.
    side : float
        1 or −1: which of the two tangents.

    Returns
    -------
    ndarray
        (2,) px, at a distance √(R² − r²) from the pivot and rotated by asin(r/R) from the line to the mark.

    Examples
    --------
    >>> touching_point(np.array([0.0, 0.0]), np.array([10.0, 0.0]), 6.0, 1.0).round(6)
    array([6.4, 4.8])
    """
    arm = mark_px - pivot_px
    lever = float(np.hypot(*arm))
    turn = side * np.arcsin(radius_px / lever)
    c, s = np.cos(turn), np.sin(turn)
    reach = np.sqrt(lever**2 - radius_px**2)
    return pivot_px + reach / lever * np.array([[c, -s], [s, c]]) @ arm


def _window(scene: Scene) -> tuple[slice, slice]:
    height, width = scene.image.shape[:2]
    (left, top), (right, bottom) = scene.contour_px.min(axis=0), scene.contour_px.max(axis=0)
    return (
        slice(max(int(top) - _MARGIN_PX, 0), min(int(bottom) + _MARGIN_PX + 1, height)),
        slice(max(int(left) - _MARGIN_PX, 0), min(int(right) + _MARGIN_PX + 1, width)),
    )


def _filled(scene: Scene) -> Image:
    blank = np.zeros(scene.image.shape[:2], np.uint8)
    return cv2.drawContours(blank, [scene.contour_px.reshape(-1, 1, 2)], -1, 1, cv2.FILLED)


def _edges(crop: Image, filled: Image) -> Image:
    """Return Canny edges of the mark's fraction in each pixel, computed as in the measurement."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _INNER_PX + 1,) * 2)
    inside, outside = cv2.erode(filled, disc) > 0, cv2.dilate(filled, disc) == 0
    model = fit_discriminant(crop[inside], crop[outside], crop[outside])
    smooth = cv2.GaussianBlur(model.fraction_map(crop), (3, 3), 0)
    step = (FULL_LEVEL - EMPTY_LEVEL) / 2.0
    return cv2.Canny(smooth, step, 2.0 * step) // 255


def _draw_lines(ax: Axes, scene: Scene) -> None:
    lever = float(np.hypot(*(scene.mark_px - scene.pivot_px)))
    ax.plot(*np.stack([scene.pivot_px, scene.mark_px]).T, color=_TRUE, lw=1.3, label="measured", path_effects=_CASING)
    for radius, (colour, dash), side in zip(RADII_PX, _LINES, (1.0, -1.0), strict=True):
        if radius >= lever:
            continue
        end = touching_point(scene.pivot_px, scene.mark_px, radius, side)
        off = np.degrees(np.arcsin(radius / lever))
        ax.plot(
            *np.stack([scene.pivot_px, end]).T, color=colour, ls=dash, lw=1.2, label=f"{radius:g} px off: {off:.2f}°"
        )
        ax.plot(*end, ".", color=colour, ms=7, mec="white", mew=0.6)


def _draw_circles(ax: Axes, centre: Floats) -> None:
    for radius, (colour, dash) in zip(RADII_PX, _LINES, strict=True):
        ax.add_patch(Circle((centre[0], centre[1]), radius, fill=False, ec=colour, ls=dash, lw=1.2))


def _limit(ax: Axes, corners: Floats) -> None:
    (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
    ax.set(xlim=(left, right), ylim=(bottom, top))


def _widened(points: Floats, shape: tuple[int, ...]) -> Floats:
    """Return the corners of a square window around points, within the picture."""
    half = 0.5 * float(np.ptp(points, axis=0).max()) + 3.0 * max(RADII_PX)
    middle = points.mean(axis=0)
    corners = np.stack([middle - half, middle + half])
    return np.clip(corners, -0.5, [shape[1] - 0.5, shape[0] - 0.5])
