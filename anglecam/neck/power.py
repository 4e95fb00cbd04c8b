"""Power of the servos: energy and power of each nod, and the sag of the voltage with the current, Figs. 12 and 13.

The voltage at a servo is 6 V at rest. When driven, the servo draws 0.6 A at 3.5 V: 2.1 W, and 33.6 W for the sixteen
servos of a head. The supply was far from its limits, so the voltage drops on the way to the servo. This is a source
V = V0 − R·I, with R = 4.17 Ω between those two states; it can deliver at most V0²/(4R) = 2.16 W, at 0.72 A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.errors import InputError

SERVOS = 16
"""Number of servos of the paper's head, face and neck."""
_ON, _OFF = 0.3, 0.15
"""Share of the way from idle to driven current: a nod must exceed the first and lasts while above the second."""
_SIGMAS = 5.0
"""Least distance of the driven from the idle current, in standard deviations of the idle noise."""
_IDLE, _DRIVEN = 0.1, 0.99
"""Quantiles of the current that estimate the idle and the driven level."""
_MAD = 1.4826
"""Standard deviation over median absolute deviation, for normal noise."""


@dataclass(frozen=True)
class PowerLog:
    """Voltage and current at a servo's terminals; arrays of length n."""

    name: str
    """Name of the file."""
    time: Floats
    """s, increasing."""
    voltage: Floats
    """V."""
    current: Floats
    """A."""


@dataclass(frozen=True)
class NodPower:
    """Energy and power of one nod."""

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
    """Largest power of a sample, W."""
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
    """(2, 2) of V0 and R, valid for noise that is correlated in time."""
    residual: float
    """Standard deviation of the voltages around the line, V."""
    range: tuple[float, float]
    """Lowest and highest fitted current, A."""

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
        """Largest power that a load can draw, V0²/(4R), W; infinite for a source that does not sag."""
        return self.open_voltage**2 / (4.0 * self.resistance) if self.resistance > 0.0 else np.inf


@dataclass(frozen=True)
class PowerUse:
    """Nods and source of a log."""

    nods: tuple[NodPower, ...]
    """In order of time."""
    source: VoltageSource
    idle_power: float
    """Mean power between the nods, W; NaN if there is no such time."""
    all_servos: float
    """Mean power of a nod times `SERVOS`, W, as if all were driven at once, "which is not the case practically"."""


def power_use(log: PowerLog, nods: Sequence[tuple[float, float]] | None = None) -> PowerUse:
    """Return energy and power of each nod and the sag of the voltage.

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
        If a nod lies outside the log, none is found, or the current does not vary.
    """
    spans = list(find_nods(log) if nods is None else nods)
    if not spans:
        raise InputError(f"{log.name}: no nod found, so there is no power to report")
    found = tuple(nod_power(log, *span) for span in spans)
    middles = (log.time[1:] + log.time[:-1]) / 2.0
    power = log.voltage * log.current
    idle = ~np.any([(middles >= a) & (middles <= b) for a, b in spans], axis=0)
    widths = np.diff(log.time)
    resting = (
        float(widths[idle] @ ((power[1:] + power[:-1]) / 2.0)[idle] / widths[idle].sum()) if idle.any() else np.nan
    )
    driven = sum(n.energy for n in found) / sum(n.end - n.start for n in found)
    return PowerUse(found, fit_source(log), resting, SERVOS * driven)


def nod_power(log: PowerLog, start: float, end: float) -> NodPower:
    """Integrate voltage times current over a span of time, linear between samples.

    Parameters
    ----------
    log : PowerLog
        What was measured.
    start, end : float
        s; may lie between samples.

    Returns
    -------
    NodPower
        Of that span.

    Raises
    ------
    InputError
        If the span is empty or reaches beyond the log.
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
    """Return the times at which the servo is driven: the current is well above its idle level.

    Parameters
    ----------
    log : PowerLog
        With the servo idle for at least a tenth of the time.
    pause : float
        Shortest idle time between two nods, s; a shorter pause belongs to one nod.
    shortest : float
        Shortest duration of a nod, s.

    Returns
    -------
    tuple of (float, float)
        Start and end of each, s: where the current passes 15 % of the way from idle to driven. A nod must exceed 30 %.

    Raises
    ------
    InputError
        If the current never rises clearly above its noise.
    """
    idle, driven = np.quantile(log.current, [_IDLE, _DRIVEN])
    quiet = log.current[log.current <= (idle + driven) / 2.0]
    # differences of neighbours, because the idle level itself may drift
    noise = _MAD * float(np.median(np.abs(np.diff(quiet)))) / np.sqrt(2.0) if len(quiet) > 1 else 0.0
    if driven - idle <= _SIGMAS * max(noise, np.finfo(float).eps * abs(driven)):
        raise InputError(
            f"{log.name}: no nod found: the current lies between {idle:.3g} A and {driven:.3g} A with {noise:.2g} A of "
            "noise; give the nods' times"
        )
    level = float(np.median(quiet))
    above = log.current > level + _OFF * (driven - level)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]]).astype(int)))
    runs = [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]
    high = level + _ON * (driven - level)
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

    Least squares of the voltage. The covariance is that of Newey and West (1987), because a servo that speeds up and
    stalls leaves autocorrelated residuals. Noise of the current biases R low, by the share of noise in its variance.

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
        If the current does not vary, so that R is not determined.
    """
    low, high = float(log.current.min()), float(log.current.max())
    n = len(log.current)
    if not high - low > 1e-9 * max(abs(high), abs(low)):
        raise InputError(f"{log.name}: the current stays at {high:g} A: the sag of the voltage cannot be determined")
    design = np.column_stack([np.ones(n), -log.current])
    inverse = np.linalg.inv(design.T @ design)
    solution = inverse @ design.T @ log.voltage
    residuals = log.voltage - design @ solution
    scores = design * residuals[:, None]
    lags = min(n // 4, _lags(residuals))
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        both = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (both + both.T)
    # two parameters were fitted to n/(lags + 1) independent stretches, not to n rows; n/(n − 2) for white noise
    covariance = n / max(n - 2 * (lags + 1), 1) * inverse @ meat @ inverse
    return VoltageSource(float(solution[0]), float(solution[1]), covariance, float(residuals.std(ddof=2)), (low, high))


def _lags(residuals: Floats) -> int:
    """Return the number of lags for Bartlett's window: twice the range over which residuals are clearly autocorrelated.

    The autocorrelation is averaged over lags m to 2m with m doubling, because the scatter of single lags hides a weak
    and slow variation.
    """
    n = len(residuals)
    size = 1 << (2 * n - 1).bit_length()
    autocorrelation = np.fft.irfft(np.abs(np.fft.rfft(residuals, size)) ** 2, size)[:n]
    last, lag = 0, 1
    while 2 * lag <= n // 4:
        if autocorrelation[lag : 2 * lag].mean() * np.sqrt(n * lag) > 2.0 * autocorrelation[0]:
            last = 2 * lag
        lag *= 2
    return 2 * last
