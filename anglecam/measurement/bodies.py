"""What is stated of each body that moves in a clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.series import AngleSeries, Body
from anglecam.data.typing import Floats
from anglecam.engine.body import body_of
from anglecam.engine.every_body import Moving, elsewhere, probability, turns_relative
from anglecam.engine.sample import FRAMES
from anglecam.io.rig import Rig
from anglecam.measurement.detections import Detections
from anglecam.measurement.followed import Followed


def first_body(followed: Followed, series: AngleSeries) -> Body:
    """Return the body that is measured first, a mark or what turns without one."""
    detections = followed.detections
    x, y = np.nanmedian(series.pivot_px, axis=0) if series.pivot_px is not None else (np.nan, np.nan)
    return Body(
        number=1,
        pivot_px=(float(x), float(y)),
        joint_to=None,
        extent_px=_extent_of_mark(detections) if detections.body is None else detections.body.extent_px,
        amplitude=half_range(series.angle),
        posterior=probability(_lead_of_mark(followed) if detections.learnt is None else detections.learnt.lead),
        moves="turns",
        series=series,
    )


def found_body(number: int, moving: Moving, series: AngleSeries | None, carrier: AngleSeries | None) -> Body:
    """Return a body that was found besides the first.

    Parameters
    ----------
    number : int
        From 2.
    moving : Moving
        It, in the sampled frames.
    series : AngleSeries, optional
        Its angle, where it was followed through all frames.
    carrier : AngleSeries, optional
        That of the body that carries its pivot.
    """
    turns, body = moving.moves == "turns", body_of(moving.fit.target)
    x, y = moving.motion.centre_px
    return Body(
        number=number,
        pivot_px=(float(x), float(y)) if turns else None,
        joint_to=None if moving.joint_to is None else moving.joint_to + 1,
        extent_px=float("nan") if body is None else body.reach / moving.sample.scale,
        amplitude=half_range(moving.motion.turn if series is None else series.angle),
        posterior=moving.posterior,
        moves=moving.moves,
        series=series,
        relative=None if series is None or carrier is None else series.angle - carrier.angle,
    )


def body_name(name: str, number: int) -> str:
    """Return the name of the series of a body of a recording: that of the recording, or ``NAME.b2``."""
    return name if number == 1 else f"{name}.b{number}"


def renumbered(bodies: Sequence[Body], name: str) -> tuple[Body, ...]:
    """Return bodies with the numbers of their order, and their series with the names that belong to these."""
    number = {body.number: k for k, body in enumerate(bodies, start=1)}
    return tuple(
        replace(
            body,
            number=k,
            joint_to=None if body.joint_to is None else number[body.joint_to],
            series=None if body.series is None else replace(body.series, name=body_name(name, k)),
        )
        for k, body in enumerate(bodies, start=1)
    )


def other_finalists(detections: Detections) -> list[Moving]:
    """Return what else turns in a clip by the competition that found its body; nothing where a mark was followed."""
    return [] if detections.learnt is None else elsewhere(detections.learnt)


def note_on_others(first: Body, others: Sequence[Moving], detections: Detections, rig: Rig) -> str | None:
    """Return a line where something else turns, by another motion, and the rig does not say which one is meant."""
    declared = rig.body is not None or rig.mouth != "auto" or rig.pivot.expected is not None
    learnt = detections.learnt
    if declared or learnt is None or first.pivot_px is None:
        return None
    meant = learnt.explanations[0].fit.proposal
    for number, other in enumerate(others, start=2):
        same = meant.in_frames(learnt.sample.frames, other.sample.frames)
        if other.moves == "turns" and turns_relative(same, other.motion):
            x, y = other.motion.centre_px
            return (
                "two things turn: one about {:.0f},{:.0f}, which is measured, and one about {:.0f},{:.0f}; body: {} in"
                " rig.yaml measures the other one, and --bodies all both"
            ).format(*first.pivot_px, x, y, number)
    return None


def half_range(angle: Floats) -> float:
    """Return half the range of angles (n,), NaN where they are unknown."""
    known = angle[np.isfinite(angle)]
    return 0.5 * float(np.ptp(known)) if len(known) else 0.0


def _extent_of_mark(detections: Detections) -> float:
    """Return the root mean square distance of a mark's pixels from its middle, as if it were round, px."""
    area = [region.area_px2 for region in detections.regions if region is not None]
    return float(np.sqrt(np.median(area) / (2.0 * np.pi))) if area else float("nan")


def _lead_of_mark(followed: Followed) -> float:
    """Return by how much a mark on a circle is more probable than one at rest, in standard errors.

    The difference of the log densities of a frame is that of the squared distances, from the middle of all places and
    from the circle, over twice a variance, which cancels. Frames are as many as of a body, so that both compare.
    """
    places, angles = followed.angles.mark_px, followed.angles
    off = angles.lever_px - np.median(angles.lever_px)
    better = ((places - places.mean(axis=0)) ** 2).sum(axis=1) - off**2
    some = better[np.unique(np.linspace(0, len(better) - 1, FRAMES).round().astype(int))]
    error = float(some.std(ddof=1)) / np.sqrt(len(some)) if len(some) > 1 else 0.0
    return float(some.mean()) / error if error > 0.0 else 0.0
