"""The figure of a calibration: the positions of the board's corners, their residuals and the lens distortion."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from anglecam.camera.calibrate import BoardCalibration
from anglecam.camera.lens import Lens
from anglecam.data.rounding import with_uncertainty
from anglecam.errors import printable
from anglecam.report.figures import AFTER, FAINT, MEASURED, STYLE

_ARROW_SHARE = 0.05
"""Length at which the largest residual is drawn, as a share of the picture's width."""


def plot_calibration(found: BoardCalibration, path: Path, title: str) -> None:
    """Draw a calibration: the corners over the picture, the residuals as a scatter plot, and the distortion.

    Parameters
    ----------
    found : BoardCalibration
        The result of `calibrate_clip`.
    path : Path
        A PNG file; its folder is created if missing.
    title : str
        The heading, which is the clip's name.
    """
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 3, figsize=(11.5, 4.0), width_ratios=(1.7, 1.0, 1.1), layout="constrained")
        _draw_coverage(axes[0], found)
        _draw_residuals(axes[1], found)
        _draw_distortion(axes[2], found)
        lens = found.calibration
        focal = with_uncertainty(lens.focal_px, lens.sigma("fx"), " px")
        figure.suptitle(
            f"{printable(title)}: {lens.views} poses, {lens.rms_px:.3f} px RMS, focal length {focal},"
            f" distortion {' '.join(found.terms) or 'none'}",
            fontsize=10,
            parse_math=False,
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110, format="png")
        plt.close(figure)


def _draw_coverage(axes: Axes, found: BoardCalibration) -> None:
    size = found.calibration.size
    assert size is not None
    corners = np.concatenate([view.corners_px for view in found.views])
    residuals = np.concatenate([view.residuals_px for view in found.views])
    longest = float(np.hypot(*residuals.T).max())
    scale = _ARROW_SHARE * size[0] / longest
    axes.quiver(*corners.T, *(scale * residuals).T, angles="xy", scale_units="xy", scale=1, color=AFTER, width=0.0015)
    axes.plot(*corners.T, ".", color=MEASURED, ms=1.5)
    axes.set(xlim=(0, size[0] - 1), ylim=(size[1] - 1, 0), aspect="equal", xlabel="x, px", ylabel="y, px")
    axes.set_title(f"corners, with residuals enlarged {scale:.0f} times", loc="left", fontsize=9)


def _draw_residuals(axes: Axes, found: BoardCalibration) -> None:
    residuals = np.concatenate([view.residuals_px for view in found.views])
    axes.plot(*residuals.T, ".", color=AFTER, ms=2, alpha=0.4)
    axes.set(aspect="equal", xlabel="found − reprojected, x, px", ylabel="y, px")
    axes.set_title("residuals", loc="left", fontsize=9)


def _draw_distortion(axes: Axes, found: BoardCalibration) -> None:
    """Draw the displacement of a point by the lens along the picture's diagonal, with two standard deviations."""
    lens = Lens(found.calibration)
    assert found.calibration.size is not None
    corner = np.array(found.calibration.size) - 1.0
    seen = np.linspace(0.0, 1.0, 81)[:, None] * corner
    along = corner / np.hypot(*corner)
    place = (seen - corner / 2.0) @ along
    moved = (seen - lens.rectify(seen)) @ along
    variance = np.einsum("i,nij,j->n", along, lens.covariance(seen), along)
    spread = 2.0 * np.sqrt(np.maximum(variance, 0.0))
    axes.fill_between(place, moved - spread, moved + spread, color=FAINT, label="±2σ")
    axes.plot(place, moved, color=AFTER, lw=1.0, label="distortion")
    for sign in (-1, 1):
        edge = sign * found.reach * np.hypot(*corner) / 2.0
        axes.axvline(edge, color=MEASURED, lw=0.6, ls=":", label="farthest corner found" if sign > 0 else None)
    axes.set(xlabel="position on the diagonal, px from the middle", ylabel="displacement, px")
    axes.set_title("distortion by the lens", loc="left", fontsize=9)
    axes.legend(fontsize=7)
