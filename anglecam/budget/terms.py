"""What errs in a measured angle, term by term, for one frame and for the whole clip.

`ErrorSources` says how large the errors are; `terms_over_time` how much each turns the angle in every frame, linearised, as
the series' sigma has it; `angle_draws` what the unlinearised geometry makes of them, so that one checks the other.

The model of the measurement, with p the pivot, m the mouth and m₀ the mouth's mean place in the frames that define
neutral, each with its error::

    θ = ∠(m + e − p) − ∠(m₀ + e₀ − p) + ω·e_time

or, where the turn φ of the whole head was registered and pulls by g = ∂φ/∂p on an error of the pivot, ::

    θ = φ + e − (φ₀ + e₀) + (g − g₀)·e_p + ω·e_time

Each angle is that of the line in a square view; where a tilt was declared and undone, the tilt errs too.
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
    """The line that counts as zero, as a mean over frames, and what errs in it."""

    frames: int
    poses: int
    """Distinct poses among the frames."""
    place_px: Floats
    """(2,) mean place of the mouth from the pivot, ahead and up, px."""
    along: Floats
    """(2,) mean of the unit vectors across the lever, ahead and up."""
    noise_px: float
    """Standard uncertainty of that mean by the picture's noise, px."""
    registration: float = 0.0
    """Standard uncertainty of the mean line by registration, rad."""
    pivot_sensitivity: Floats | None = None
    """(2,) mean change of a registered line with an error of the pivot, x and y of the picture, rad/px."""


@dataclass(frozen=True)
class ErrorSources:
    """How large the errors behind an angle series are; arrays of length n, an entry a measured frame."""

    frame: NDArray[np.int64]
    """Numbers of the measured frames."""
    time: Floats
    """s."""
    angle: Floats
    """From neutral, rad."""
    line: Floats
    """Direction of pivot→mouth, rad, an upward nod positive."""
    lever_px: Floats
    """Pivot to mouth, px."""
    mirrored: bool
    """Whether the face looks to the left, so that angles are counted clockwise in the picture."""
    pivot_px: Floats
    """(2,) px in the picture."""
    pivot_covariance_px2: Floats
    """(2, 2) px² in the picture."""
    pivot_source: str
    """``marker``, ``centre of rotation`` or both."""
    pivot_dof: float
    """Degrees of freedom of the covariance."""
    noise_px: Floats
    """Standard uncertainty along the path of what differs from frame to frame, px."""
    noise_dof: float
    pose_px: float
    """Standard uncertainty of what depends on the pose alone, px."""
    pose_dof: float
    neutral: Neutral | None
    """``None`` where neutral is declared and so has no error of its own."""
    registration: Floats | None = None
    """Standard uncertainty of a line read by registration, rad; ``noise_px`` and ``pose_px`` are zero then, unless they
    err besides."""
    pivot_sensitivity: Floats | None = None
    """(n, 2) change of such a line with an error of the pivot along x and y of the picture, rad/px; without it the
    geometry tells."""
    mouth_on_head: Floats | None = None
    """Standard uncertainty of the line on which registered turns stand where neutral is declared, rad."""
    lens_px: Floats | None = None
    """How far the calibration may still displace the mouth along its path against neutral, standard uncertainty, px."""
    tilt: Tilt | None = None
    within_exposure: Floats | None = None
    """Standard uncertainty by motion that is not steady within the exposure, rad."""
    exposure_s: float | None = None
    """Length of the exposure, anywhere in which the camera may have stamped the frame, s."""
    clock_s: float | None = None
    """Step in which the file holds times, s."""

    @property
    def speed(self) -> Floats:
        """Angular speed, rad/s."""
        return np.gradient(self.angle, self.time) if len(self.time) > 1 else np.zeros(len(self.time))

    @property
    def upright(self) -> Floats:
        """(2,) signs that turn x and y of the picture into ahead and up, by which lines are counted."""
        return np.array([-1.0 if self.mirrored else 1.0, -1.0])

    @property
    def places_px(self) -> Floats:
        """(n, 2) the mouth from the pivot, ahead and up, px."""
        return self.lever_px[:, None] * np.column_stack([np.cos(self.line), np.sin(self.line)])


@dataclass(frozen=True)
class TermOverTime:
    """One term over the clip, SI; `at` states it for a frame in degrees."""

    name: str
    unit: str
    """Of the input: px, rad or s."""
    uncertainty: Floats
    """(n,) standard uncertainty of the input, in ``unit``."""
    sensitivity: Floats
    """(n,) rad for a ``unit``."""
    known: str
    """How the uncertainty is known."""
    dof: float = math.inf
    distribution: Distribution = "normal"
    in_sigma: bool = True
    """Whether the series' sigma holds it: what is wrong with the time is wrong with ``time_s``, not with the angle."""

    @property
    def contribution(self) -> Floats:
        """(n,) rad."""
        return np.abs(self.sensitivity) * self.uncertainty

    def at(self, i: int) -> Term:
        """Return the term of the ``i``-th measured frame, the angle in degrees."""
        u, c = float(self.uncertainty[i]), float(self.sensitivity[i])
        if self.unit == "rad":
            return Term(self.name, "°", 0.0, math.degrees(u), self.distribution, c, self.dof, self.known)
        return Term(self.name, self.unit, 0.0, u, self.distribution, math.degrees(c), self.dof, self.known)


def terms_over_time(sources: ErrorSources) -> tuple[TermOverTime, ...]:
    """List what errs and how much it turns the angle, frame by frame, linearised.

    Parameters
    ----------
    sources : ErrorSources
        How large the errors are.

    Returns
    -------
    tuple of TermOverTime
        Independent of each other, without those that are zero throughout. The root of the sum of the squares of
        those ``in_sigma`` is the series' sigma, `anglecam.measurement.sigma.angle_sigma`.
    """
    s = sources
    n, lever = len(s.time), s.lever_px
    even = np.ones(n)
    along = np.column_stack([-np.sin(s.line), np.cos(s.line)]) * s.upright
    found: list[TermOverTime] = []
    pose, line0 = even, None
    pull = -along / lever[:, None] if s.pivot_sensitivity is None else s.pivot_sensitivity
    if s.neutral is not None:
        k = s.neutral.poses
        pose = np.sqrt(np.maximum(1.0 + 1.0 / k - 2.0 / k * _shared(s, s.neutral), 0.0))
        line0 = np.hypot(s.neutral.noise_px / lever, s.neutral.registration)
        if s.neutral.pivot_sensitivity is not None:
            pull = pull - s.neutral.pivot_sensitivity
        elif s.pivot_sensitivity is None:
            pull = pull + s.neutral.along * s.upright / lever[:, None]
    reach = np.hypot(*pull.T)
    toward = np.divide(pull, reach[:, None], out=along.copy(), where=reach[:, None] > 0.0)
    pivot = np.sqrt(np.einsum("ni,ij,nj->n", toward, s.pivot_covariance_px2, toward))
    found.append(TermOverTime("picture noise", "px", s.noise_px, 1.0 / lever, "scatter at one pose (A)", s.noise_dof))
    found.append(
        TermOverTime(
            "pixel grid and codec", "px", s.pose_px * even, pose / lever, "scatter between poses (A)", s.pose_dof
        )
    )
    found.append(TermOverTime("pivot", "px", pivot, reach, f"{s.pivot_source} (A)", s.pivot_dof))
    if s.registration is not None:
        found.append(TermOverTime("registration", "rad", s.registration, even, "fit to the picture (A)"))
    if s.mouth_on_head is not None:
        found.append(
            TermOverTime("mouth's place on the head", "rad", s.mouth_on_head, even, "the mouth's own angles (A)")
        )
    if s.neutral is not None and line0 is not None:
        dof = s.noise_dof if s.registration is None else math.inf
        found.append(TermOverTime("neutral line", "rad", line0, -even, f"mean of {s.neutral.frames} frames (A)", dof))
    if s.lens_px is not None:
        found.append(TermOverTime("lens", "px", s.lens_px, 1.0 / lever, "calibration's covariance (B)"))
    if s.tilt is not None and s.tilt.sigma > 0.0:
        # A difference over one standard uncertainty: at a square view the slope is zero and the error is not.
        off = s.tilt.turned(s.line, s.tilt.sigma) - s.line
        zero = s.line - s.angle
        off = off - (s.tilt.turned(zero, s.tilt.sigma) - zero)
        found.append(TermOverTime("camera tilt", "rad", s.tilt.sigma * even, off / s.tilt.sigma, "declared (B)"))
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
    return tuple(course for course in found if (course.uncertainty > 0.0).any())


def angle_draws(sources: ErrorSources, i: int) -> Draw:
    """Return a function that draws angles of one frame through the geometry itself, nothing linearised.

    Parameters
    ----------
    sources : ErrorSources
        How large the errors are. Places err along the path and across it alike; the pivot by its covariance; what
        was estimated together, together.
    i : int
        Which measured frame.

    Returns
    -------
    callable
        (generator, m) → (m,) angles from neutral, rad.
    """
    s = sources
    mouth = s.places_px[i]
    zero = s.line[i] - s.angle[i]
    neutral = s.neutral
    root = _root(s.pivot_covariance_px2)
    pull = np.zeros(2) if s.pivot_sensitivity is None else s.pivot_sensitivity[i]
    pull0 = np.zeros(2) if neutral is None or neutral.pivot_sensitivity is None else neutral.pivot_sensitivity
    share = 0.0 if neutral is None else float(_shared(s, neutral)[i]) / neutral.poses
    speed = float(s.speed[i])

    def draw(rng: np.random.Generator, m: int) -> Floats:
        def places(scale: float | Floats) -> Floats:
            return rng.standard_normal((m, 2)) * np.reshape(scale, (-1, 1))

        error = places(widening(rng, s.pivot_dof, m)) @ root.T
        pivot = error * s.upright if s.pivot_sensitivity is None else np.zeros(2)
        noise, grid = widening(rng, s.noise_dof, m), s.pose_px * widening(rng, s.pose_dof, m)
        pose = places(grid)
        line = _direction(mouth + places(s.noise_px[i] * noise) + pose - pivot) + error @ pull
        if s.lens_px is not None:
            line = line + rng.standard_normal(m) * (s.lens_px[i] / s.lever_px[i])
        for turned in (s.registration, s.mouth_on_head, s.within_exposure):
            if turned is not None:
                line = line + rng.standard_normal(m) * turned[i]
        line0: Floats = np.full(m, zero)
        if neutral is not None:
            own = math.sqrt(max(1.0 / neutral.poses - share**2, 0.0))
            errors = places(neutral.noise_px * noise) + share * pose + places(own * grid)
            # The mean of lines, which is what neutral is, and the line of the mean place differ by a hair: only the
            # error is taken from the place.
            place = neutral.place_px
            line0 = zero + _wrapped(_direction(place + errors - pivot) - _direction(place)) + error @ pull0
            line0 = line0 + rng.standard_normal(m) * neutral.registration
        if s.tilt is not None:
            slant = s.tilt.sigma * rng.standard_normal(m)
            line, line0 = s.tilt.turned(line, slant), s.tilt.turned(line0, slant)
        angle = s.angle[i] + _wrapped(line - line0 - s.angle[i])
        for step in (s.exposure_s, s.clock_s):
            if step is not None:
                angle = angle + speed * step * (rng.random(m) - 0.5)
        return angle

    return draw


def _shared(s: ErrorSources, neutral: Neutral) -> Floats:
    """Return (n,) how much of a pose's error is the same in the neutral pose: exp(−d²/2), d px apart."""
    apart = s.places_px - neutral.place_px
    return np.exp(-(apart**2).sum(axis=1) / 2.0)


def _root(covariance: Floats) -> Floats:
    values, axes = np.linalg.eigh(covariance)
    return axes * np.sqrt(np.maximum(values, 0.0))


def _direction(place: Floats) -> Floats:
    return np.arctan2(place[..., 1], place[..., 0])


def _wrapped(angle: Floats) -> Floats:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
