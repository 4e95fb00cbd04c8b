"""A clip's uncertainty budget: in a typical frame, in the worst frame, over the clip, and the bounds of the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anglecam.budget.gum import Combined, Comparison, Propagated, combine, compare, propagate
from anglecam.budget.terms import ErrorSources, TermOverTime, angle_draws, terms_over_time
from anglecam.data.series import CONTRACT_RADII_PX
from anglecam.data.typing import Floats
from anglecam.measurement.bounds import worst_case, worst_case_both_ends

PAPER = ((6.0, 0.28), (10.0, 0.68))
"""Pixel errors, px, and the angle errors that the paper states for them, degrees (text on Fig. 8)."""


@dataclass(frozen=True)
class FrameBudget:
    """The uncertainty of one frame's angle, in degrees, because significant digits refer to the stated unit."""

    index: int
    """Index among the measured frames."""
    frame: int
    """Number of the frame in the clip."""
    time: float
    """Time of the frame, s."""
    angle_deg: float
    lever_px: float
    sigma_deg: float
    """Standard uncertainty from the terms that the series' sigma contains."""
    combined: Combined
    """Uncertainty from all terms, by the GUM."""
    drawn: Propagated
    """Distribution by Monte Carlo; uncertain standard uncertainties widen their term to Student's t."""
    comparison: Comparison
    """Comparison of ``combined`` with ``drawn``."""
    drawn_as_known: Propagated
    """Distribution by Monte Carlo with every standard uncertainty taken as known."""
    linearity: Comparison
    """Comparison of ``drawn_as_known`` with ± 1.960·u: the effect of linearisation alone."""


@dataclass(frozen=True)
class PixelBound:
    """The angle error, rad, due to a position that is wrong by up to a number of pixels, by four definitions."""

    radius_px: float
    """Radius r of the circle of possible positions, px."""
    lever_px: float
    """Lever arm R, px."""
    worst: float
    """Largest error with the mark anywhere within the circle: asin(r/R)."""
    worst_both: float
    """Largest error with mark and pivot each anywhere within a circle: asin(2r/R)."""
    standard: float
    """Standard uncertainty with the mark uniformly distributed in the disc, hence r/2 along the path: r/(2R)."""
    standard_both: float
    """Standard uncertainty with mark and pivot each uniformly distributed in a disc: r/(√2·R)."""


@dataclass(frozen=True)
class Budget:
    """The uncertainty of a clip's angles."""

    name: str
    """Name of the recording."""
    sources: ErrorSources
    terms_over_time: tuple[TermOverTime, ...]
    sigma: Floats
    """(n,) standard uncertainty from the terms that the series' sigma contains, rad."""
    total: Floats
    """(n,) standard uncertainty from all terms, rad."""
    typical: FrameBudget
    """The frame with the median uncertainty."""
    worst: FrameBudget
    """The frame with the largest uncertainty."""
    bounds: tuple[PixelBound, ...]
    """Bounds by radius, at the clip's median lever arm."""
    notes: tuple[str, ...]
    """What the budget does not include, and what that could contribute; one line each."""

    @property
    def lever_px(self) -> float:
        """The clip's median lever arm, px."""
        return float(np.median(self.sources.lever_px))


def budget_of(name: str, sources: ErrorSources, radii_px: tuple[float, ...] = CONTRACT_RADII_PX) -> Budget:
    """Compute a clip's uncertainty budget.

    Parameters
    ----------
    name : str
        Name of the recording.
    sources : ErrorSources
        Its error sources.
    radii_px : tuple of float
        Radii of the pixel bounds, in addition to 6 px and 10 px.

    Returns
    -------
    Budget
        Equal sources give equal budgets: the Monte Carlo has a fixed seed.
    """
    terms = terms_over_time(sources)
    variance = np.array([term.contribution**2 for term in terms])
    total = np.sqrt(variance.sum(axis=0))
    sigma = np.sqrt(variance[[term.in_sigma for term in terms]].sum(axis=0))
    order = np.argsort(total)
    lever = float(np.median(sources.lever_px))
    return Budget(
        name=name,
        sources=sources,
        terms_over_time=terms,
        sigma=sigma,
        total=total,
        typical=_frame(sources, terms, sigma, int(order[(len(order) - 1) // 2])),
        worst=_frame(sources, terms, sigma, int(order[-1])),
        bounds=tuple(pixel_bound(r, lever) for r in sorted({*CONTRACT_RADII_PX, *radii_px})),
        notes=_not_included(sources),
    )


def pixel_bound(radius_px: float, lever_px: float) -> PixelBound:
    """Return worst cases and standard uncertainties of the angle for positions within ``radius_px`` at a lever arm.

    Examples
    --------
    >>> bound = pixel_bound(6.0, 843.0)
    >>> [round(math.degrees(angle), 3) for angle in (bound.worst, bound.worst_both, bound.standard)]
    [0.408, 0.816, 0.204]
    """
    return PixelBound(
        radius_px,
        lever_px,
        float(worst_case(radius_px, lever_px)),
        float(worst_case_both_ends(radius_px, lever_px)),
        radius_px / (2.0 * lever_px),
        radius_px / (math.sqrt(2.0) * lever_px),
    )


def budget_as_dict(budget: Budget) -> dict[str, Any]:
    """Return the content of ``NAME.budget.json``; infinite degrees of freedom become ``null`` in the file."""
    s = budget.sources
    mean2 = float((budget.total**2).mean())
    return {
        "name": budget.name,
        "frames_measured": len(s.frame),
        "lever_px": budget.lever_px,
        "pivot": {
            "x_px": s.pivot_px[0],
            "y_px": s.pivot_px[1],
            "covariance_px2": s.pivot_covariance_px2,
            "source": s.pivot_source,
        },
        "neutral": {
            "line_deg": math.degrees(s.line[0] - s.angle[0]),
            "frames": None if s.neutral is None else s.neutral.frames,
            "poses": None if s.neutral is None else s.neutral.poses,
        },
        "typical": _frame_as_dict(budget, budget.typical),
        "worst": _frame_as_dict(budget, budget.worst),
        "rms": {
            "sigma_deg": math.degrees(math.sqrt((budget.sigma**2).mean())),
            "combined_deg": math.degrees(math.sqrt(mean2)),
            "terms": [
                {
                    "name": term.name,
                    "in_sigma": term.in_sigma,
                    "contribution_deg": math.degrees(math.sqrt((term.contribution**2).mean())),
                    "share": float((term.contribution**2).mean()) / mean2,
                }
                for term in budget.terms_over_time
            ],
        },
        "bounds": [
            {
                "radius_px": b.radius_px,
                "lever_px": b.lever_px,
                "worst_case_deg": math.degrees(b.worst),
                "worst_case_both_ends_deg": math.degrees(b.worst_both),
                "standard_deg": math.degrees(b.standard),
                "standard_both_ends_deg": math.degrees(b.standard_both),
            }
            for b in budget.bounds
        ],
        "paper": [
            {"radius_px": r, "stated_deg": stated, "implied_lever_px": implied_lever(r, stated)} for r, stated in PAPER
        ],
        "not_included": list(budget.notes),
    }


def implied_lever(radius_px: float, stated_deg: float) -> float:
    """Return the lever arm, px, at which the worst case of a pixel error r is the stated angle θ: r / sin θ.

    Examples
    --------
    The two angles that the paper states do not belong to one lever arm:

    >>> [round(implied_lever(radius, stated)) for radius, stated in PAPER]
    [1228, 843]
    """
    return radius_px / math.sin(math.radians(stated_deg))


def _frame(sources: ErrorSources, terms: tuple[TermOverTime, ...], sigma: Floats, i: int) -> FrameBudget:
    stated = [term.at(i) for term in terms]
    certain = replace(sources, noise_dof=math.inf, pose_dof=math.inf, pivot_dof=math.inf)
    combined, as_known = combine(stated), combine([replace(term, dof=math.inf) for term in stated])
    drawn, drawn_as_known = (_draw_degrees(s, i) for s in (sources, certain))
    angle = math.degrees(sources.angle[i])
    return FrameBudget(
        index=i,
        frame=int(sources.frame[i]),
        time=float(sources.time[i]),
        angle_deg=angle,
        lever_px=float(sources.lever_px[i]),
        sigma_deg=math.degrees(sigma[i]),
        combined=combined,
        drawn=drawn,
        comparison=compare(angle, combined, drawn),
        drawn_as_known=drawn_as_known,
        linearity=compare(angle, as_known, drawn_as_known),
    )


def _draw_degrees(sources: ErrorSources, i: int) -> Propagated:
    draw = angle_draws(sources, i)
    return propagate(lambda rng, m: np.degrees(draw(rng, m)))


def _frame_as_dict(budget: Budget, one: FrameBudget) -> dict[str, Any]:
    combined = one.combined
    return {
        "frame": one.frame,
        "time_s": one.time,
        "angle_deg": one.angle_deg,
        "lever_px": one.lever_px,
        "sigma_deg": one.sigma_deg,
        "combined_deg": combined.standard,
        "degrees_of_freedom": combined.dof,
        "coverage_factor": combined.coverage_factor,
        "expanded_deg": combined.expanded,
        "interval_95_deg": [one.angle_deg - combined.expanded, one.angle_deg + combined.expanded],
        "terms": [
            {
                "name": t.name,
                "estimate": t.estimate,
                "standard_uncertainty": t.uncertainty,
                "unit": t.unit,
                "distribution": t.shape,
                "degrees_of_freedom": t.dof,
                "sensitivity": t.sensitivity,
                "sensitivity_unit": f"°/{t.unit}",
                "contribution_deg": t.contribution,
                "share": share,
                "in_sigma": over_time.in_sigma,
                "known": t.known,
            }
            for over_time, t, share in zip(budget.terms_over_time, combined.terms, combined.shares, strict=True)
        ],
        "monte_carlo": _drawn_as_dict(one.drawn, one.comparison),
        "monte_carlo_uncertainties_as_known": _drawn_as_dict(one.drawn_as_known, one.linearity),
    }


def _drawn_as_dict(drawn: Propagated, comparison: Comparison) -> dict[str, Any]:
    return {
        "trials": drawn.trials,
        "mean_deg": drawn.estimate,
        "standard_deg": drawn.standard,
        "interval_95_deg": [drawn.low, drawn.high],
        "numerical_error_deg": drawn.error,
        "tolerance_deg": comparison.tolerance,
        "distance_low_deg": comparison.low,
        "distance_high_deg": comparison.high,
        "gum_validated": comparison.agrees,
    }


def _not_included(s: ErrorSources) -> tuple[str, ...]:
    """Return a line on each unknown error, with the effect of a plausible amount of it in the clip's worst frame."""
    farthest = float(np.abs(np.sin(s.angle)).max())
    fastest = float(np.abs(s.speed).max())
    notes = []
    if s.neutral is None:
        notes.append("neutral is declared: it is a definition and has no uncertainty")
    if s.lens_px is None:
        effect = math.degrees(0.1 / float(s.lever_px.min()))
        notes.append(
            f"no calibration of the lens: a distortion that shifts the mark by 0.1 px along its path adds {effect:.3f}°"
        )
    if s.tilt is None:
        effect = math.degrees(0.5 * math.radians(3.0) ** 2 * farthest)
        notes.append(f"no tilt is declared: a camera 3° off the axis of rotation adds up to {effect:.3f}°")
    if s.exposure_s is None and s.clock_s is None:
        effect = math.degrees(fastest * 1e-3)
        notes.append(f"no error of the time: 1 ms adds up to {effect:.3f}° at the fastest moment")
    return tuple(notes)
