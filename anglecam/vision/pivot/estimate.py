"""The pivot: declared, or estimated from a round marker, the centre of rotation of the mark's path and a hint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.pivot.marker import RoundMarker

_MAX_RADIUS_SIGMA = 0.2
"""Relative uncertainty of the path's radius above which its centre alone is no pivot."""
_DISAGREE = 9.21
"""99 % point of χ² with two degrees of freedom."""
_MARKED, _NEARER = 0.4, 0.1
"""Probabilities, before looking, that a rig has a round marker on its pivot, and that it has one which is nearer to the
camera than the mark."""
_ALIGNED = 0.3
"""The same, that it has another round thing on the line through the pivot along which a short arc cannot place it.
Mechanisms are symmetric: screws and joints of the frame lie on that line more often than beside it."""
_ROUGH = 3.0
"""Times the usual uncertainty of a hint that a rough one has."""
_CERTAIN = 0.95
"""Probability from which on a round thing counts as the pivot's marker."""


@dataclass(frozen=True)
class PivotEstimate:
    """The pivot with its uncertainty."""

    centre_px: Floats
    """(2,) px."""
    covariance_px2: Floats
    """(2, 2) px²."""
    source: str
    """``declared``, or one or more of ``marker``, ``centre of rotation`` and ``hint``."""
    doubt: str | None = None
    """Message where it rests on a round thing that the mark's path does not verify."""
    elsewhere: bool = False
    """Whether the motion shows another centre than the hint says."""


def combine_pivot(
    marker: RoundMarker | None,
    circle: Circle | None,
    hint: PivotEstimate | None = None,
    round_things_per_px2: float = 0.0,
    displacement_px2: Floats | None = None,
) -> tuple[PivotEstimate | None, str | None]:
    """Combine what is known about the pivot, each by its inverse covariance.

    A round thing is the pivot's marker only if the motion, or the hint, says so. Three cases compete: it marks the
    pivot, or it is on the shaft but nearer to the camera than the mark, which displaces it in the picture, or it is
    another round thing, such as a screw. With the density q of round things and N(S) the density of its distance from
    the pivot that motion or hint predict, for the covariance S of either case, the weights are::

        0.4·N(C + C_marker),    0.1·N(C + C_marker + D),    q + 0.3·N₁ / 2r

    with the covariance D of the displacement, the path's radius r, and the density N₁ of the distance across the least
    certain direction. The pivot is that of the heaviest case. Its covariance is that of the mixture around it or, where
    the weight of the third case exceeds 5 %, that of the third case around it. A marker at the centre of a long arc is
    thus a certain pivot. A round thing that the arc is too short to verify is as uncertain as the arc's centre.

    Parameters
    ----------
    marker : RoundMarker, optional
        The round thing, if one was found.
    circle : Circle, optional
        The mark's path, if the mark moved.
    hint : PivotEstimate, optional
        What is declared about the pivot's place.
    round_things_per_px2 : float
        Density of other round things in the picture, 1/px²; zero where the marker is declared.
    displacement_px2 : ndarray, optional
        (2, 2) covariance of the marker's displacement if it is at another depth than the mark, px².

    Returns
    -------
    pivot : PivotEstimate or None
        ``None`` where nothing determines it.
    note : str or None
        Message for the user where the round thing is not the pivot.
    """
    expected = _expected(circle, hint)
    if marker is None or expected is None:
        found = None if marker is None else PivotEstimate(marker.centre_px, marker.covariance_px2, "marker")
        return found or expected, None
    D = np.zeros((2, 2)) if displacement_px2 is None else displacement_px2
    cases = [
        _case(expected, marker.centre_px, marker.covariance_px2),
        _case(expected, marker.centre_px, marker.covariance_px2 + D),
    ]
    other = round_things_per_px2
    if circle is not None and other > 0.0:
        other += _ALIGNED * _density_across(expected, marker) / (2.0 * circle.radius_px)
    weight = np.array([_MARKED * cases[0].density, _NEARER * cases[1].density, other])
    distance = float(np.hypot(*(marker.centre_px - expected.centre_px)))
    if min(case.away for case in cases) > _DISAGREE or weight.sum() == 0.0:
        return expected, _disagreement(expected, marker, distance)
    weight /= weight.sum()
    means = np.array([*(case.centre_px for case in cases), expected.centre_px])
    covariances = np.array([*(case.covariance_px2 for case in cases), expected.covariance_px2])
    centre = means[np.argmax(weight)]
    off = means - centre
    covariance = np.einsum("k,kij->ij", weight, covariances) + np.einsum("k,ki,kj->ij", weight, off, off)
    doubt = note = None
    if weight[2] > 1.0 - _CERTAIN:
        covariance = covariances[2] + np.outer(off[2], off[2])
        doubt = (
            f"the round thing {distance:.0f} px from the expected pivot may be something else (probability"
            f" {weight[2]:.0%}); the pivot is known to {np.sqrt(np.trace(covariance) / 2.0):.1f} px"
        )
    if cases[0].away > _DISAGREE:
        note = _disagreement(expected, marker, distance)
    return PivotEstimate(centre, covariance, f"marker and {expected.source}", doubt, expected.elsewhere), note


def disagreement_with_path(declared: PivotEstimate, circle: Circle) -> str | None:
    """Return a message where the centre of the mark's path is not the declared pivot, ``None`` where it may be."""
    difference, spread = declared.centre_px - circle.centre_px, declared.covariance_px2 + circle.centre_covariance_px2
    if not np.isfinite(spread).all() or difference @ np.linalg.solve(spread, difference) <= _DISAGREE:
        return None
    return (
        f"the declared pivot and the centre of rotation are {np.hypot(*difference):.1f} px apart (uncertainty"
        f" {np.sqrt(np.trace(spread) / 2.0):.1f} px); the declared pivot is used"
    )


@dataclass(frozen=True)
class _Case:
    """The pivot if the marker shows it with a given covariance."""

    density: float
    """Of the marker's place, 1/px²."""
    away: float
    """Squared distance of marker and expected pivot, in units of its variance."""
    centre_px: Floats
    covariance_px2: Floats


def _case(expected: PivotEstimate, marker_px: Floats, covariance: Floats) -> _Case:
    difference, spread = marker_px - expected.centre_px, covariance + expected.covariance_px2
    away = float(difference @ np.linalg.solve(spread, difference))
    gain = expected.covariance_px2 @ np.linalg.inv(spread)
    return _Case(
        density=float(np.exp(-away / 2.0) / (2.0 * np.pi * np.sqrt(np.linalg.det(spread)))),
        away=away,
        centre_px=expected.centre_px + gain @ difference,
        covariance_px2=np.asarray(gain @ covariance, dtype=float),
    )


def _density_across(expected: PivotEstimate, marker: RoundMarker) -> float:
    """Return the density of the marker's distance from the line along which the pivot is least certain, 1/px."""
    across = np.linalg.eigh(expected.covariance_px2)[1][:, 0]
    variance = float(across @ (expected.covariance_px2 + marker.covariance_px2) @ across)
    away = float(across @ (marker.centre_px - expected.centre_px))
    return float(np.exp(-(away**2) / (2.0 * variance)) / np.sqrt(2.0 * np.pi * variance))


def _disagreement(expected: PivotEstimate, marker: RoundMarker, distance: float) -> str:
    sigma = float(np.sqrt(np.trace(marker.covariance_px2 + expected.covariance_px2) / 2.0))
    shown_by = " and ".join(f"the {one}" for one in expected.source.split(" and "))
    return (
        f"the round marker is {distance:.2f} px apart from the pivot by {shown_by} (uncertainty {sigma:.2f} px);"
        f" that pivot is used"
    )


def _expected(circle: Circle | None, hint: PivotEstimate | None) -> PivotEstimate | None:
    """Return the pivot by the mark's motion and by the hint, each by its inverse covariance.

    A short arc determines the direction to its centre well, and the distance badly. A hint is a rough one if the motion
    is then more probable. Where the two contradict each other all the same, one of them is less certain than it states:
    the covariance grows by χ² over its expectation (Birge, Physical Review 40, 1932).
    """
    if circle is None or not np.isfinite(circle.covariance_px2).all():
        return hint
    shown = circle.covariance_px2[2, 2] < (_MAX_RADIUS_SIGMA * circle.radius_px) ** 2
    if hint is None:
        return PivotEstimate(circle.centre_px, circle.centre_covariance_px2, "centre of rotation") if shown else None
    difference = circle.centre_px - hint.centre_px
    hints = [hint.covariance_px2, _ROUGH**2 * hint.covariance_px2]
    spreads = [one + circle.centre_covariance_px2 for one in hints]
    aways = [float(difference @ np.linalg.solve(spread, difference)) for spread in spreads]
    k = int(np.argmin([away + np.linalg.slogdet(spread)[1] for away, spread in zip(aways, spreads, strict=True)]))
    gain = hints[k] @ np.linalg.inv(spreads[k])
    covariance = (hints[k] - gain @ hints[k]) * max(1.0, aways[k] / len(difference))
    source = "hint and centre of rotation"
    return PivotEstimate(
        hint.centre_px + gain @ difference, np.asarray(covariance), source, elsewhere=aways[k] > _DISAGREE
    )
