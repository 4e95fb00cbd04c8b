"""The angle of one recording over time.

Angles are radians, and a frame that could not be measured is NaN. `anglecam.io.series_csv` writes the files.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import astuple, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anglecam.data.camera_evidence import NO_EVIDENCE, CameraEvidence
from anglecam.data.derivatives import Derivatives
from anglecam.data.tables import html_curve, html_table, pandas_table, xarray_dataset
from anglecam.data.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

OK = "ok"
STATUSES = (OK, "no_mouth", "occluded", "ambiguous", "no_pivot", "duplicate", "undecodable")
"""``ok``, or the reason why a frame has no angle."""
CONTRACT_RADII_PX = (6.0, 10.0)
"""Radii of the paper's worst-case mark errors, px; every series file has a column for each."""
DERIVATIVE_COLUMNS = (
    "velocity_deg_s",
    "velocity_sigma_deg_s",
    "acceleration_deg_s2",
    "acceleration_sigma_deg_s2",
)
"""Columns of the fields of `Derivatives`, in order."""
SERIES_COLUMNS = (
    "frame",
    "time_s",
    "angle_deg",
    "sigma_deg",
    "bound_6px_deg",
    "bound_10px_deg",
    "line_deg",
    "mouth_x_px",
    "mouth_y_px",
    "pivot_x_px",
    "pivot_y_px",
    "status",
    "sigma_random_deg",
    "sigma_common_deg",
    *DERIVATIVE_COLUMNS,
)
"""Columns of a series as a table, in order."""


@dataclass(frozen=True)
class AngleSeries:
    """One recording's angle, frame by frame; arrays of length n, NaN where ``status`` is not ``ok``.

    Examples
    --------
    >>> import numpy as np
    >>> series = AngleSeries(
    ...     "swing",
    ...     time=np.array([0.0, 0.1, 0.2]),
    ...     angle=np.array([0.0, np.nan, 0.2]),
    ...     sigma=np.array([1e-3, np.nan, 1e-3]),
    ...     status=("ok", "occluded", "ok"),
    ... )
    >>> series.ok
    array([ True, False,  True])
    >>> series.angle[series.ok]
    array([0. , 0.2])
    """

    name: str
    """The recording's name: the clip's file name without its ending."""
    time: Floats
    """Seconds on the clip's clock, strictly increasing."""
    angle: Floats
    """Angle from neutral, rad, upward positive."""
    sigma: Floats
    """Standard uncertainty of ``angle``, rad; NaN throughout where the source states none."""
    status: tuple[str, ...]
    """One of `STATUSES` for each frame."""
    line: Floats | None = None
    """Absolute direction of the line pivot→mark from the image's horizontal, rad."""
    mark_px: Floats | None = None
    """(n, 2) position of the mark, x to the right and y down, px."""
    pivot_px: Floats | None = None
    """(n, 2) position of the pivot, px."""
    bounds: dict[float, Floats] = field(default_factory=dict)
    """Worst-case angle error, rad, for a mark anywhere within the radius (the key), px."""
    first_frame: int = 0
    """Number in the film of the first row's frame; the others follow without a gap."""
    sigma_random: Floats | None = None
    """Part of ``sigma`` that differs from frame to frame, rad; the rest, in squares, is common to all frames."""
    derivatives: Derivatives | None = None
    """Velocity and acceleration; ``None`` in a series from a file without them, or without a stated sigma."""
    bodies: tuple[Body, ...] = field(default=(), repr=False)
    """What moves in the film, this series' body first; empty where nobody looked."""
    evidence: CameraEvidence = NO_EVIDENCE
    """Evidence of the film besides the angle; empty for a series without a film."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(n,) whether the angle of each frame is measured."""
        return np.array([s == OK for s in self.status])

    @property
    def sigma_common(self) -> Floats:
        """(n,) part of ``sigma`` that all frames share, rad; NaN where the parts are not known."""
        if self.sigma_random is None:
            return np.full(len(self.time), np.nan)
        return np.asarray(np.sqrt(np.maximum(self.sigma**2 - self.sigma_random**2, 0.0)))

    @property
    def common_share(self) -> float:
        """Relative standard uncertainty of the scale of the motion, which all frames share; NaN where not known.

        A common error e(θ) vanishes at neutral, but for the zero's. It grows with the chord 2·sin(θ/2), as that of a
        displaced pivot does. The slope of ``sigma_common`` squared over the chord squared separates the two.
        """
        ok = self.ok
        chord2, common2 = 4.0 * np.sin(0.5 * self.angle[ok]) ** 2, self.sigma_common[ok] ** 2
        if not np.isfinite(common2).all() or not chord2.any():
            return float("nan")
        apart, from_zero = chord2 - chord2.mean(), float(common2 @ chord2 / (chord2 @ chord2))
        slope = float(common2 @ apart / (apart @ apart)) if apart.any() else from_zero
        return float(np.sqrt(min(max(slope, 0.0), from_zero)))

    def columns(self) -> dict[str, NDArray]:
        """Return the series as the columns of its file, in order: degrees, pixels, NaN for an empty cell.

        Returns
        -------
        dict of str to ndarray
            (n,) values by name. Radii of ``bounds`` other than 6 px and 10 px become the last columns.
        """
        n = len(self.time)
        empty = np.full((n, 2), np.nan)
        mark = empty if self.mark_px is None else self.mark_px
        pivot = empty if self.pivot_px is None else self.pivot_px
        line = empty[:, 0] if self.line is None else self.line
        further = sorted(set(self.bounds) - set(CONTRACT_RADII_PX))
        bounds = {r: np.degrees(self.bounds.get(r, empty[:, 0])) for r in (*CONTRACT_RADII_PX, *further)}
        angle, sigma = np.degrees(self.angle), np.degrees(self.sigma)
        contract_bounds = [bounds[r] for r in CONTRACT_RADII_PX]
        frame = np.arange(n) + self.first_frame
        cells = [frame, self.time, angle, sigma, *contract_bounds, np.degrees(line), *mark.T, *pivot.T]
        random = empty[:, 0] if self.sigma_random is None else self.sigma_random
        parts = [np.degrees(random), np.degrees(self.sigma_common)]
        rates = [empty[:, 0]] * 4 if self.derivatives is None else [np.degrees(v) for v in astuple(self.derivatives)]
        columns = dict(zip(SERIES_COLUMNS, [*cells, np.array(self.status, dtype=str), *parts, *rates], strict=True))
        return columns | {f"bound_{r:g}px_deg": bounds[r] for r in further}

    def to_pandas(self) -> pd.DataFrame:
        """Return the series as a table: the columns of ``NAME.angles.csv``, not rounded, by ``frame``.

        Returns
        -------
        pandas.DataFrame
            n rows; angles are degrees, as the columns' names say.

        Raises
        ------
        ImportError
            If pandas is not installed.

        Examples
        --------
        >>> import numpy as np
        >>> angle = np.radians([0.0, 1.5])
        >>> AngleSeries("swing", np.array([0.0, 0.1]), angle, angle, ("ok", "ok")).to_pandas()[["time_s", "angle_deg"]]
               time_s  angle_deg
        frame
        0         0.0        0.0
        1         0.1        1.5
        """
        return pandas_table(self.columns(), "frame")

    def to_xarray(self) -> xr.Dataset:
        """Return the series as a dataset with the variables of ``NAME.angles.nc``: poses as `movement` holds them.

        Returns
        -------
        xarray.Dataset
            ``position`` (time, space, keypoints, individuals), px; angles, their uncertainty and bounds (time),
            degrees, as the variables' names say; ``time``, s; ``frame`` and ``status`` (time).

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        n = len(self.time)
        columns = self.columns()
        points = [np.full((n, 2), np.nan) if p is None else p for p in (self.mark_px, self.pivot_px)]
        variables: dict[str, tuple[tuple[str, ...], Any]] = {
            "position": (("time", "space", "keypoints", "individuals"), np.stack(points, axis=-1)[..., None]),
            **{k: (("time",), v) for k, v in columns.items() if "_deg" in k or k == "status"},
        }
        coordinates: dict[str, tuple[tuple[str, ...], Any]] = {
            "time": (("time",), self.time),
            "frame": (("time",), columns["frame"]),
            "space": (("space",), ["x", "y"]),
            "keypoints": (("keypoints",), ["mouth", "pivot"]),
            "individuals": (("individuals",), ["head"]),
        }
        dataset = xarray_dataset(variables, coordinates, {"source_software": "anglecam", "name": self.name})
        dataset["position"].attrs["units"] = "pixel"
        return dataset

    def _repr_html_(self) -> str:
        """Return a summary and the curve of the angle, for notebooks."""
        ok = self.ok
        causes = ", ".join(f"{count} {cause}" for cause, count in Counter(self.status).items() if cause != OK)
        rows = [["frames measured", f"{ok.sum()} of {len(ok)}" + (f" ({causes})" if causes else "")]]
        if ok.any():
            angle, seconds = np.degrees(self.angle[ok]), self.time[-1] - self.time[0]
            sigma = np.degrees(np.median(self.sigma[ok]))
            rows += [
                ["duration", f"{seconds:.3f} s"],
                ["angle", f"{angle.min():.2f}° … {angle.max():.2f}°"],
                ["median standard uncertainty", f"{sigma:.2g}°" if np.isfinite(sigma) else "not stated"],
            ]
        return html_table(self.name, ["", ""], rows) + html_curve(self.time, self.angle, "angle over time")


@dataclass(frozen=True)
class Body:
    """A body that moves in a film."""

    number: int
    """From 1, the body that is measured first."""
    pivot_px: tuple[float, float] | None
    """About where it turns, px; of a joint its place in the median pose of the body that carries it. ``None`` for a
    body that does not turn."""
    joint_to: int | None
    """Number of the body that carries its pivot; ``None`` for a pivot at rest."""
    extent_px: float
    """Root mean square distance of its pixels from their middle, px."""
    amplitude: float
    """Half the range of its angle in the film, rad."""
    posterior: float
    """Probability that it predicts the film better than its rivals; see `anglecam.engine.every_body.probability`."""
    moves: str
    """``turns``, ``translates`` or ``otherwise``."""
    series: AngleSeries | None = field(default=None, repr=False)
    """Its angle in every frame; ``None`` where it was not measured."""
    relative: Floats | None = field(default=None, repr=False)
    """(n,) its angle less that of the body that carries its pivot, rad; ``None`` without either of them."""
