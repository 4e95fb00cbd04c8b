"""What the servos draw: energy and power of each nod, and how the voltage sags with the current, Figs. 12 and 13.

A servo at rest shows 6 V; driven, it draws 0.6 A and shows 3.5 V: 2.1 W, and 33.6 W for the sixteen of a head. The
supply was far from its limits, so what sags is the way to the servo: a source V = V0 − R·I, with R = 4.17 Ω between
those two states. Such a source gives at most V0²/(4R) = 2.16 W, at 0.72 A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.errors import InputError

SERVOS = 16
"""Of the paper's head, face and neck."""
_ON, _OFF = 0.3, 0.15
"""Share of the way from the idle current to the busy one at which a nod begins and ends."""
_SIGMAS = 5.0
"""Of the idle current's noise that the busy one must stand above it."""
_IDLE, _BUSY = 0.1, 0.99
"""Quantiles of the current that tell the two."""
_MAD = 1.4826


@dataclass(frozen=True)
class PowerLog:
    """Voltage and current at a servo's terminals; arrays of length n."""

    name: str
    """File that it is from."""
    time: Floats
    """s, increasing."""
    voltage: Floats
    """V."""
    current: Floats
    """A."""


@dataclass(frozen=True)
class NodPower:
    """What one nod takes."""

    start: float
    """s."""
    end: float
    """s."""
    energy: float
    """J."""
    charge: float
    """A·s."""
    mean_power: float
    """W."""
    peak_power: float
    """W, of one sample."""
    peak_current: float
    """A."""
    lowest_voltage: float
    """V."""


@dataclass(frozen=True)
class VoltageSource:
    """The fitted source V = V0 − R·I."""

    open_voltage: float
    """V0, V."""
    resistance: float
    """R, Ω."""
    covariance: Floats
    """(2, 2) of V0 and R, for noise that is correlated in time."""
    residual: float
    """Standard deviation of voltages about the line, V."""
    range: tuple[float, float]
    """Currents that it was fitted to, A."""

    def voltage(self, current: ArrayLike) -> Floats:
        """Return V at a current (A), V."""
        return np.asarray(self.open_voltage - self.resistance * np.asarray(current, dtype=float))

    def sigma(self, current: ArrayLike) -> Floats:
        """Return the standard uncertainty of `voltage`, V."""
        at = np.asarray(current, dtype=float)
        (v, vr), (_, r) = self.covariance
        return np.asarray(np.sqrt(np.maximum(v - 2.0 * at * vr + at**2 * r, 0.0)))

    def power(self, current: ArrayLike) -> Floats:
        """Return V·I at a current (A), W."""
        return np.asarray(self.voltage(current) * np.asarray(current, dtype=float))

    @property
    def greatest_power(self) -> float:
        """What a load can draw at most, V0²/(4R), W; infinite for a source that does not sag."""
        return self.open_voltage**2 / (4.0 * self.resistance) if self.resistance > 0.0 else np.inf


@dataclass(frozen=True)
class PowerUse:
    """What a log tells."""

    nods: tuple[NodPower, ...]
    """In order of time."""
    source: VoltageSource
    idle_power: float
    """Mean outside the nods, W; NaN where there is no such time."""
    all_servos: float
    """Mean power of a nod times `SERVOS`, W: if all were driven at once, "which is not the case practically"."""


def power_use(log: PowerLog, nods: Sequence[tuple[float, float]] | None = None) -> PowerUse:
    """Work out energy and power of each nod and the sag of the voltage.

    Parameters
    ----------
    log : PowerLog
        Of one servo.
    nods : sequence of (float, float), optional
        Start and end of each, s; found from the current by `find_nods` if not given.

    Returns
    -------
    PowerUse
        With a `NodPower` for each.

    Raises
    ------
    InputError
        Where a nod lies outside the log, none is found or the current does not vary.
    """
    spans = list(find_nods(log) if nods is None else nods)
    if not spans:
        raise InputError(f"{log.name}: no nod: nothing to work out the power of")
    told = tuple(nod_power(log, *span) for span in spans)
    middles = (log.time[1:] + log.time[:-1]) / 2.0
    power = log.voltage * log.current
    idle = ~np.any([(middles >= a) & (middles <= b) for a, b in spans], axis=0)
    widths = np.diff(log.time)
    resting = (
        float(widths[idle] @ ((power[1:] + power[:-1]) / 2.0)[idle] / widths[idle].sum()) if idle.any() else np.nan
    )
    driven = sum(n.energy for n in told) / sum(n.end - n.start for n in told)
    return PowerUse(told, fit_source(log), resting, SERVOS * driven)


def nod_power(log: PowerLog, start: float, end: float) -> NodPower:
    """Integrate voltage times current over a span of time, straight between samples.

    Parameters
    ----------
    log : PowerLog
        What was measured.
    start, end : float
        s; between samples too.

    Returns
    -------
    NodPower
        Of that span.

    Raises
    ------
    InputError
        Where the span is empty or reaches beyond the log.
    """
    first, last = log.time[0], log.time[-1]
    if not first <= start < end <= last:
        raise InputError(f"{log.name}: no nod from {start:g} s to {end:g} s in a log from {first:g} s to {last:g} s")
    inside = (log.time > start) & (log.time < end)
    time = np.concatenate([[start], log.time[inside], [end]])
    voltage, current = np.interp(time, log.time, log.voltage), np.interp(time, log.time, log.current)
    power = voltage * current
    energy, charge = float(np.trapezoid(power, time)), float(np.trapezoid(current, time))
    return NodPower(
        start,
        end,
        energy,
        charge,
        energy / (end - start),
        float(power.max()),
        float(current.max()),
        float(voltage.min()),
    )


def find_nods(log: PowerLog, *, pause: float = 0.25, shortest: float = 0.05) -> tuple[tuple[float, float], ...]:
    """Find when the servo is driven: where the current stands well above idling.

    Parameters
    ----------
    log : PowerLog
        With some idle time in it, at least a tenth.
    pause : float
        Idling that parts two nods, s; shorter pauses are inside one.
    shortest : float
        A nod lasts at least as long, s.

    Returns
    -------
    tuple of (float, float)
        Start and end of each, s: where the current passes 15 % of the way from idle to busy, found by passing 30 %.

    Raises
    ------
    InputError
        Where the current never rises clearly above its noise.
    """
    idle, busy = np.quantile(log.current, [_IDLE, _BUSY])
    quiet = log.current[log.current <= (idle + busy) / 2.0]
    # Differences of neighbours, because the idle level itself may wander.
    noise = _MAD * float(np.median(np.abs(np.diff(quiet)))) / np.sqrt(2.0) if len(quiet) > 1 else 0.0
    if busy - idle <= _SIGMAS * max(noise, np.finfo(float).eps * abs(busy)):
        raise InputError(
            f"{log.name}: no nod found: the current lies between {idle:.3g} A and {busy:.3g} A with {noise:.2g} A of "
            "noise; give the nods' times"
        )
    level = float(np.median(quiet))
    above = log.current > level + _OFF * (busy - level)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]]).astype(int)))
    runs = [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]
    high = level + _ON * (busy - level)
    spans: list[tuple[float, float]] = []
    for first, last in runs:
        if log.current[first : last + 1].max() < high:
            continue
        begin, end = float(log.time[first]), float(log.time[last])
        if spans and begin - spans[-1][1] < pause:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((begin, end))
    return tuple(s for s in spans if s[1] - s[0] >= shortest)


def fit_source(log: PowerLog) -> VoltageSource:
    """Fit V = V0 − R·I to a log.

    Least squares of the voltage; its covariance is that of Newey and West (1987), because a servo that speeds up and
    stalls leaves residuals that follow each other. Noise of the current makes R too small, by the share of its
    variance that is noise.

    Parameters
    ----------
    log : PowerLog
        With the servo idle and driven.

    Returns
    -------
    VoltageSource
        With uncertainties.

    Raises
    ------
    InputError
        Where the current does not vary, so that nothing tells R.
    """
    low, high = float(log.current.min()), float(log.current.max())
    n = len(log.current)
    if not high - low > 1e-9 * max(abs(high), abs(low)):
        raise InputError(f"{log.name}: the current stays at {high:g} A: the sag of the voltage cannot be told")
    design = np.column_stack([np.ones(n), -log.current])
    inverse = np.linalg.inv(design.T @ design)
    solution = inverse @ design.T @ log.voltage
    left = log.voltage - design @ solution
    scores = design * left[:, None]
    lags = min(n // 4, _lags(left))
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        both = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (both + both.T)
    # Two parameters were fitted to so many independent stretches, not to n rows; n/(n − 2) for white noise.
    covariance = n / max(n - 2 * (lags + 1), 1) * inverse @ meat @ inverse
    return VoltageSource(float(solution[0]), float(solution[1]), covariance, float(left.std(ddof=2)), (low, high))


def _lags(left: Floats) -> int:
    """Return the number of lags for Bartlett's window: twice those over which residuals visibly follow each other.

    Looked at are means over lags m to 2m, m doubling: a faint and slow sway hides in the scatter of single lags.
    """
    n = len(left)
    size = 1 << (2 * n - 1).bit_length()
    follows = np.fft.irfft(np.abs(np.fft.rfft(left, size)) ** 2, size)[:n]
    last, lag = 0, 1
    while 2 * lag <= n // 4:
        if follows[lag : 2 * lag].mean() * np.sqrt(n * lag) > 2.0 * follows[0]:
            last = 2 * lag
        lag *= 2
    return 2 * last
