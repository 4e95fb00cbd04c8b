"""The errors of a measured angle, term by term, for one frame and for the whole clip.

`ErrorSources` holds the sizes of the errors. `terms_over_time` linearises the effect of each error on the angle in
every frame, as the series' sigma does. `angle_draws` propagates the errors through the geometry without linearisation,
so the two check each other.

The model of the measurement, with p the pivot, m the mark and m₀ the mark's mean position in the frames that define
neutral, each with its error::

    θ = ∠(m + e − p) − ∠(m₀ + e₀ − p) + ω·e_time

or, where the rotation φ of the whole body was registered and has the pivot sensitivity g = ∂φ/∂p, ::

    θ = φ + e − (φ₀ + e₀) + (g − g₀)·e_p + ω·e_time

Every angle is that of the line in the rectified view. Where a tilt was declared and corrected, its error is a term too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.budget.gum import Distribution, Term, widening
from anglecam.camera.tilt import Tilt
from anglecam.data.typing import Floats

Draw = Callable[[np.random.Generator, int], Floats]


@dataclass(frozen=True)
class Neutral:
    """The line that counts as zero, as a mean over frames, and its errors."""

    frames: int
    """Number of frames that define it."""
    poses: int
    """Number of distinct poses among the frames."""
    place_px: Floats
    """(2,) mean position of the mark relative to the pivot, ahead and up, px."""
    along: Floats
    """(2,) mean of the unit vectors perpendicular to the lever, ahead and up."""
    noise_px: float
    """Standard uncertainty of the mean position due to the picture's noise, px."""
    registration: float = 0.0
    """Standard uncertainty of the mean line due to registration, rad."""
    pivot_sensitivity: Floats | None = None
    """(2,) mean change of a registered line with an error of the pivot in x and y of the picture, rad/px."""


@dataclass(frozen=True)
class ErrorSources:
    """Sizes of the errors of an angle series; arrays of length n, one entry for each measured frame."""

    frame: NDArray[np.int64]
    """Numbers of the measured frames."""
    time: Floats
    """Times of the frames, s."""
    angle: Floats
    """Angle from neutral, rad."""
    line: Floats
    """Direction of the line pivot→mark, rad, upward positive."""
    lever_px: Floats
    """Distance from pivot to mark, px."""
    mirrored: bool
    """Whether the rig faces left, so that angles are counted clockwise in the picture."""
    pivot_px: Floats
    """(2,) pivot in the picture, px."""
    pivot_covariance_px2: Floats
    """(2, 2) covariance of the pivot in the picture, px²."""
    pivot_source: str
    """``marker``, ``centre of rotation`` or both."""
    pivot_dof: float
    """Degrees of freedom of the covariance."""
    noise_px: Floats
    """Standard uncertainty along the path of the error that differs from frame to frame, px."""
    noise_dof: float
    """Degrees of freedom of ``noise_px``."""
    pose_px: float
    """Standard uncertainty of the error that depends on the pose alone, px."""
    pose_dof: float
    """Degrees of freedom of ``pose_px``."""
    neutral: Neutral | None
    """``None`` if neutral is declared and therefore has no error."""
    registration: Floats | None = None
    """Standard uncertainty of a line measured by registration, rad. ``noise_px`` and ``pose_px`` are then zero, except
    in frames without a registration."""
    pivot_sensitivity: Floats | None = None
    """(n, 2) change of a registered line with an error of the pivot along x and y of the picture, rad/px; ``None``: the
    sensitivity follows from the geometry."""
    mark_on_body: Floats | None = None
    """Standard uncertainty of the line to which registered rotations are added where neutral is declared, rad."""
    lens_px: Floats | None = None
    """Standard uncertainty, due to the calibration, of the mark's position along its path relative to neutral, px."""
    tilt: Tilt | None = None
    within_exposure: Floats | None = None
    """Standard uncertainty due to acceleration within the exposure, rad."""
    exposure_s: float | None = None
    """Length of the exposure, s; the camera may have stamped the frame at any time within it."""
    clock_s: float | None = None
    """Resolution of the file's time stamps, s."""

    @property
    def speed(self) -> Floats:
        """Angular speed, rad/s."""
        return np.gradient(self.angle, self.time) if len(self.time) > 1 else np.zeros(len(self.time))

    @property
    def upright(self) -> Floats:
        """(2,) signs that convert x and y of the picture to ahead and up, in which lines are counted."""
        return np.array([-1.0 if self.mirrored else 1.0, -1.0])

    @property
    def places_px(self) -> Floats:
        """(n, 2) position of the mark relative to the pivot, ahead and up, px."""
        return self.lever_px[:, None] * np.column_stack([np.cos(self.line), np.sin(self.line)])


@dataclass(frozen=True)
class TermOverTime:
    """One term over the clip, in SI units; `at` returns it for one frame, in degrees."""

    name: str
    unit: str
    """Unit of the input: px, rad or s."""
    uncertainty: Floats
    """(n,) standard uncertainty of the input, in ``unit``."""
    sensitivity: Floats
    """(n,) change of the angle per unit of the input, rad per ``unit``."""
    known: str
    """What the uncertainty is known from, with its type of evaluation, A or B."""
    dof: float = math.inf
    distribution: Distribution = "normal"
    in_sigma: bool = True
    """Whether the series' sigma contains it; errors of the time are errors of ``time_s`` and not of the angle."""

    @property
    def contribution(self) -> Floats:
        """(n,) standard uncertainty of the angle due to this term, rad."""
        return np.abs(self.sensitivity) * self.uncertainty

    def at(self, i: int) -> Term:
        """Return the term in the ``i``-th measured frame, with the angle in degrees."""
        u, c = float(self.uncertainty[i]), float(self.sensitivity[i])
        if self.unit == "rad":
            return Term(self.name, "°", 0.0, math.degrees(u), self.distribution, c, self.dof, self.known)
        return Term(self.name, self.unit, 0.0, u, self.distribution, math.degrees(c), self.dof, self.known)


def terms_over_time(sources: ErrorSources) -> tuple[TermOverTime, ...]:
    """Return the terms of the angle's uncertainty in every frame, linearised.

    Parameters
    ----------
    sources : ErrorSources
        Sizes of the errors.

    Returns
    -------
    tuple of TermOverTime
        Mutually independent terms, without those that are zero in all frames. The root of the sum of the squared
        contributions of the terms ``in_sigma`` is the series' sigma, `anglecam.measurement.sigma.angle_sigma`.
    """
    s = sources
    n, lever = len(s.time), s.lever_px
    even = np.ones(n)
    along = np.column_stack([-np.sin(s.line), np.cos(s.line)]) * s.upright
    found: list[TermOverTime] = []
    pose, line0 = even, None
    sensitivity = -along / lever[:, None] if s.pivot_sensitivity is None else s.pivot_sensitivity
    if s.neutral is not None:
        k = s.neutral.poses
        pose = np.sqrt(np.maximum(1.0 + 1.0 / k - 2.0 / k * _shared(s, s.neutral), 0.0))
        line0 = np.hypot(s.neutral.noise_px / lever, s.neutral.registration)
        if s.neutral.pivot_sensitivity is not None:
            sensitivity = sensitivity - s.neutral.pivot_sensitivity
        elif s.pivot_sensitivity is None:
            sensitivity = sensitivity + s.neutral.along * s.upright / lever[:, None]
    # The pivot enters by its error along the direction in which the angle is sensitive to it.
    size = np.hypot(*sensitivity.T)
    direction = np.divide(sensitivity, size[:, None], out=along.copy(), where=size[:, None] > 0.0)
    pivot = np.sqrt(np.einsum("ni,ij,nj->n", direction, s.pivot_covariance_px2, direction))
    found.append(TermOverTime("picture noise", "px", s.noise_px, 1.0 / lever, "scatter at one pose (A)", s.noise_dof))
    found.append(
        TermOverTime(
            "pixel grid and codec", "px", s.pose_px * even, pose / lever, "scatter between poses (A)", s.pose_dof
        )
    )
    found.append(TermOverTime("pivot", "px", pivot, size, f"{s.pivot_source} (A)", s.pivot_dof))
    if s.registration is not None:
        found.append(TermOverTime("registration", "rad", s.registration, even, "fit to the picture (A)"))
    if s.mark_on_body is not None:
        found.append(TermOverTime("mark's position on the body", "rad", s.mark_on_body, even, "angles of the mark (A)"))
    if s.neutral is not None and line0 is not None:
        dof = s.noise_dof if s.registration is None else math.inf
        known = f"frames that define it: {s.neutral.frames} (A)"
        found.append(TermOverTime("neutral line", "rad", line0, -even, known, dof))
    if s.lens_px is not None:
        found.append(TermOverTime("lens", "px", s.lens_px, 1.0 / lever, "calibration's covariance (B)"))
    if s.tilt is not None and s.tilt.sigma > 0.0:
        # A difference over one standard uncertainty: without a tilt the derivative is zero and the error is not.
        change = s.tilt.turned(s.line, s.tilt.sigma) - s.line
        zero = s.line - s.angle
        change = change - (s.tilt.turned(zero, s.tilt.sigma) - zero)
        found.append(TermOverTime("camera tilt", "rad", s.tilt.sigma * even, change / s.tilt.sigma, "declared (B)"))
    if s.within_exposure is not None:
        found.append(
            TermOverTime("acceleration in the exposure", "rad", s.within_exposure, even, "exposure declared (B)")
        )
    for name, step, known in (
        ("instant within the exposure", s.exposure_s, "exposure declared (B)"),
        ("time stamp's step", s.clock_s, "the file's unit of time (B)"),
    ):
        if step is not None:
            u = step / math.sqrt(12.0) * even
            found.append(TermOverTime(name, "s", u, s.speed, known, distribution="uniform", in_sigma=False))
    return tuple(term for term in found if (term.uncertainty > 0.0).any())


def angle_draws(sources: ErrorSources, i: int) -> Draw:
    """Return a function that draws angles of one frame through the geometry, without linearisation.

    Parameters
    ----------
    sources : ErrorSources
        Sizes of the errors. Positions have the same error along the path and across it; the pivot's error has its
        covariance; uncertainties that were estimated together share one draw of their error.
    i : int
        Index of the measured frame.

    Returns
    -------
    callable
        (generator, m) → (m,) angles from neutral, rad.
    """
    s = sources
    mark = s.places_px[i]
    zero = s.line[i] - s.angle[i]
    neutral = s.neutral
    root = _root(s.pivot_covariance_px2)
    sensitivity = np.zeros(2) if s.pivot_sensitivity is None else s.pivot_sensitivity[i]
    sensitivity0 = np.zeros(2) if neutral is None or neutral.pivot_sensitivity is None else neutral.pivot_sensitivity
    share = 0.0 if neutral is None else float(_shared(s, neutral)[i]) / neutral.poses
    speed = float(s.speed[i])

    def draw(rng: np.random.Generator, m: int) -> Floats:
        def places(scale: float | Floats) -> Floats:
            return rng.standard_normal((m, 2)) * np.reshape(scale, (-1, 1))

        error = places(widening(rng, s.pivot_dof, m)) @ root.T
        pivot = error * s.upright if s.pivot_sensitivity is None else np.zeros(2)
        noise, grid = widening(rng, s.noise_dof, m), s.pose_px * widening(rng, s.pose_dof, m)
        pose = places(grid)
        line = _direction(mark + places(s.noise_px[i] * noise) + pose - pivot) + error @ sensitivity
        if s.lens_px is not None:
            line = line + rng.standard_normal(m) * (s.lens_px[i] / s.lever_px[i])
        for sigma in (s.registration, s.mark_on_body, s.within_exposure):
            if sigma is not None:
                line = line + rng.standard_normal(m) * sigma[i]
        line0: Floats = np.full(m, zero)
        if neutral is not None:
            rest = math.sqrt(max(1.0 / neutral.poses - share**2, 0.0))
            errors = places(neutral.noise_px * noise) + share * pose + places(rest * grid)
            # Neutral is the mean of the lines, which differs slightly from the line to the mean position: only the
            # error is computed from the position.
            place = neutral.place_px
            line0 = zero + _wrapped(_direction(place + errors - pivot) - _direction(place)) + error @ sensitivity0
            line0 = line0 + rng.standard_normal(m) * neutral.registration
        if s.tilt is not None:
            tilt = s.tilt.sigma * rng.standard_normal(m)
            line, line0 = s.tilt.turned(line, tilt), s.tilt.turned(line0, tilt)
        angle = s.angle[i] + _wrapped(line - line0 - s.angle[i])
        for step in (s.exposure_s, s.clock_s):
            if step is not None:
                angle = angle + speed * step * (rng.random(m) - 0.5)
        return angle

    return draw


def _shared(s: ErrorSources, neutral: Neutral) -> Floats:
    """Return (n,) the share of a pose's error that the neutral pose has too: exp(−d²/2) at a distance of d px."""
    difference = s.places_px - neutral.place_px
    return np.exp(-(difference**2).sum(axis=1) / 2.0)


def _root(covariance: Floats) -> Floats:
    values, axes = np.linalg.eigh(covariance)
    return axes * np.sqrt(np.maximum(values, 0.0))


def _direction(place: Floats) -> Floats:
    return np.arctan2(place[..., 1], place[..., 0])


def _wrapped(angle: Floats) -> Floats:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
