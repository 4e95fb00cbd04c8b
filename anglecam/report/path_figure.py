"""The signal path, command → actuator → load → camera, with the effects considered and attributed at each station.

Each attributed effect is drawn as the function that it computes, with its fitted parameters, over the range of these
recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect, Knots
from anglecam.effects import effect as entry
from anglecam.identification.fit import Fit
from anglecam.loop.stepwise import applicable
from anglecam.loop.verdict import Verdict
from anglecam.models.added_acceleration import added_acceleration
from anglecam.report.figures import AFTER, COMMAND, panel
from anglecam.report.wording import plain

STATIONS = {
    "command": "position demanded of the servo",
    "actuator": "torque of servo and linkage",
    "load": "motion of the body",
    "camera": "angle and time in the film",
}
TICK = 1e-3
"""Sampling interval of commands, s."""
STRETCHES = (0.6, 0.2, 0.06)
"""Lengths of the part of a command that is drawn, s; the first length at which the effect is visible is used."""
VISIBLE_SHARE = 0.1
"""Mean change, as a share of the command's range in that part, that is visible."""
SMALLEST_RANGE = 0.05
"""Smallest range of a command in the part that is drawn, as a share of its whole range."""


@dataclass(frozen=True)
class EffectCurve:
    """The function that an effect computes; arrays of length n, in degrees, seconds or milliseconds."""

    x: Floats
    y: Floats
    xlabel: str
    ylabel: str
    without: Floats | None = None
    """``y`` without the effect, for an effect that changes one curve into another."""


@dataclass(frozen=True)
class Station:
    """A station of the signal path, and the effects that were considered there."""

    name: str
    caption: str
    effects: tuple[tuple[str, str], ...]
    """Name and standing of each: ``found``, ``rival`` (cannot be distinguished from one that was found) or empty."""

    @property
    def found(self) -> bool:
        """Whether an effect was attributed here."""
        return any(standing == "found" for _, standing in self.effects)


def signal_path(verdict: Verdict) -> list[Station]:
    """Return the stations of the signal path in order."""
    considered = applicable([*verdict.fitted, *verdict.held_out])
    standing = {name: "rival" for a in verdict.accepted for name in a.rivals}
    standing |= {a.effect.id: "found" for a in verdict.accepted}
    return [
        Station(name, caption, tuple((plain(e.id), standing.get(e.id, "")) for e in considered if e.station == name))
        for name, caption in STATIONS.items()
    ]


def effect_panels(verdict: Verdict) -> list[tuple[str, str]]:
    """Draw each attributed effect as the function that it computes: its name and the SVG."""
    found = [(plain(a.effect.id), curve_of(a.effect, verdict.after, verdict.fitted)) for a in verdict.accepted]
    return [(name, panel(curve.ylabel, partial(_draw_curve, curve=curve), curve.xlabel)) for name, curve in found]


def curve_of(effect: Effect, fit: Fit, records: Sequence[Record]) -> EffectCurve:
    """Evaluate a fitted effect over the range of the recordings.

    Parameters
    ----------
    effect : Effect
        An effect of the fitted plant.
    fit : Fit
        Of a plant with that effect.
    records : sequence of Record
        The fitted recordings.

    Returns
    -------
    EffectCurve
        In degrees, seconds and milliseconds.
    """
    values = entry(effect.id).null  # staged parameters that the data do not require stay at their null
    fitted = effect.complete(np.array([fit.parameters[fit.model.names.index(p.name)] for p in effect.parameters]))
    values[: len(fitted)] = fitted
    if effect.port in ("command", "lag"):
        return _command_curve(effect, values, records)
    angles = [r.angle - e for r, e in zip(records, fit.residuals, strict=True)]
    if effect.port in ("timing", "observation"):
        return _camera_curve(effect, values, records, angles)
    angle = np.concatenate(angles)
    rates = [np.gradient(a, r.time) for a, r in zip(angles, records, strict=True)]
    velocity = np.concatenate(rates)
    abc = np.zeros(3)
    abc[: min(3, len(fit.parameters))] = fit.parameters[:3]
    levels = [np.zeros(len(r.time)) if r.command is None else r.command.at(r.time) for r in records]
    demanded = abc[2] * np.concatenate(levels) - abc[1] * angle
    if effect.port == "friction":
        return _friction_curve(effect, values, abc, demanded, velocity)
    if effect.port == "load":
        return _load_curve(effect, values, abc, np.concatenate([r.time for r in records]), angle, velocity)
    if effect.port == "dynamics":
        pairs = zip(records, angles, strict=True)
        torque = np.concatenate([added_acceleration(effect, values, abc, r.time, a, r.command) for r, a in pairs])
        return _ordered(np.degrees(angle), np.degrees(torque), "angle, °", "torque added, °/s²")
    at = zip(demanded, angle, velocity, strict=True)
    applied = np.array([effect.servo(q, t, w, abc, values) for q, t, w in at])
    return _ordered(np.degrees(demanded), np.degrees(applied), "torque demanded, °/s²", "torque applied, °/s²", True)


def _friction_curve(effect: Effect, values: Floats, abc: Floats, torque: Floats, velocity: Floats) -> EffectCurve:
    """Return the friction over the velocity, or over the servo's torque if it depends on that."""
    if effect.friction(0.0, 0.0, abc, values) != effect.friction(1.0, 0.0, abc, values):
        q = np.linspace(torque.min(), torque.max(), 400)
        level = np.array([effect.friction(one, 0.0, abc, values)[0] for one in q])
        return EffectCurve(np.degrees(q), np.degrees(level), "torque demanded, °/s²", "friction torque, °/s²")
    up, down, breakaway, speed = effect.friction(0.0, 0.0, abc, values)
    omega = np.linspace(velocity.min(), velocity.max(), 400)
    level = np.where(omega > 0.0, up, down)
    if speed > 0.0:
        level = level + np.maximum(breakaway - level, 0.0) * np.exp(-((omega / speed) ** 2))
    return EffectCurve(np.degrees(omega), -np.degrees(np.sign(omega) * level), "velocity, °/s", "friction torque, °/s²")


def _load_curve(
    effect: Effect, values: Floats, abc: Floats, time: Floats, angle: Floats, velocity: Floats
) -> EffectCurve:
    """Return the torque added over the time at the largest velocity, or else over the velocity, or over the angle."""
    t, fastest = np.linspace(time.min(), time.max(), 800), np.max(np.abs(velocity))
    over_time = np.array([effect.load(one, 0.0, fastest, abc, values) for one in t])
    if np.ptp(over_time) > 0.0:
        return EffectCurve(t, np.degrees(over_time), "time, s", "torque added, °/s²")
    torque = np.array([effect.load(0.0, q, w, abc, values) for q, w in zip(angle, velocity, strict=True)])
    of_velocity = np.ptp([effect.load(0.0, 0.0, w, abc, values) for w in velocity]) > 0.0
    x, name = (velocity, "velocity, °/s") if of_velocity else (angle, "angle, °")
    return _ordered(np.degrees(x), np.degrees(torque), name, "torque added, °/s²")


def _command_curve(effect: Effect, values: Floats, records: Sequence[Record]) -> EffectCurve:
    """Return the part of a command in which the effect changes most of its range, or all of a short command."""
    runs = [(r, r.command, np.arange(r.time[0], r.time[-1], TICK)) for r in records if r.command is not None]
    pairs = [(r.name, t, c.at(t), _arriving(effect, values, c, t)) for r, c, t in runs]
    least = SMALLEST_RANGE * max(float(np.ptp(demanded)) for _, _, demanded, _ in pairs)

    def curve(name: str, time: Floats, demanded: Floats, arriving: Floats) -> EffectCurve:
        return EffectCurve(time, np.degrees(arriving), f"time in {name}, s", "command, °", np.degrees(demanded))

    best, most = curve(*pairs[0]), 0.0
    for stretch in STRETCHES:
        size = round(stretch / TICK)
        for name, time, demanded, arriving in pairs:
            for start in range(0, len(time) - size, max(1, size // 6)):
                part = slice(start, start + size)
                move = float(np.ptp(demanded[part]))
                both = np.concatenate([demanded[part], arriving[part]])
                share = float(np.mean(np.abs(arriving - demanded)[part]) / max(np.ptp(both), least))
                if move >= least and share > most:
                    best, most = curve(name, time[part], demanded[part], arriving[part]), share
        if most >= VISIBLE_SHARE:
            break
    return best


def _arriving(effect: Effect, values: Floats, command: Command, time: Floats) -> Floats:
    """Return the command after the effect, sampled every `TICK`."""
    demanded = command.at(time)
    if effect.lag is not None:
        from scipy.signal import lfilter  # loading it takes most of a second, so only this figure does

        kept = float(np.exp(-TICK / max(effect.lag(values), 1e-9)))
        # the lag starts at rest at the first level
        return demanded[0] + lfilter([0.0, 1.0 - kept], [1.0, -kept], demanded - demanded[0])
    if effect.command is None:
        raise TypeError(f"{effect.id} does not act on the command")
    knots = effect.command(Knots(*command.knots), values)
    at = np.maximum(np.searchsorted(knots.time, time, side="right") - 1, 0)
    since = np.maximum(time - knots.time[at], 0.0)  # before the first knot its level holds
    return knots.level[at] + knots.slope[at] * since


def _camera_curve(effect: Effect, values: Floats, records: Sequence[Record], angles: Sequence[Floats]) -> EffectCurve:
    act, factor, name = effect.observation, 180.0 / np.pi, "angle shown − true, °"
    if act is None:
        act, factor, name = effect.timing, 1e3, "time shown − true, ms"

    def change(record: Record, angle: Floats) -> Floats:
        assert act is not None  # one of the two ports is filled
        return factor * (act(record.time, angle, values, record.view) - (angle if effect.observation else record.time))

    drifts = any(np.ptp(change(r, np.zeros(len(r.time)))) > 0.0 for r in records)
    x = [r.time - r.time[0] if drifts else np.degrees(a) for r, a in zip(records, angles, strict=True)]
    y = [change(r, a) for r, a in zip(records, angles, strict=True)]
    sign = 1.0 if effect.observation else -1.0
    return _ordered(np.concatenate(x), sign * np.concatenate(y), "time, s" if drifts else "angle, °", name)


def _ordered(x: Floats, y: Floats, xlabel: str, ylabel: str, with_identity: bool = False) -> EffectCurve:
    order = np.argsort(x)
    return EffectCurve(x[order], y[order], xlabel, ylabel, x[order] if with_identity else None)


def _draw_curve(axes: Axes, curve: EffectCurve) -> None:
    if curve.without is not None:
        axes.plot(curve.x, curve.without, color=COMMAND, lw=1.0, ls="--", label="without it")
    axes.plot(curve.x, curve.y, color=AFTER, lw=1.5, label="with it")
