"""The noise of a series of angles, as the series itself shows it: what a smooth motion cannot be.

A mechanism moves smoothly from frame to frame, and errors that differ from frame to frame do not. Differences of high
order remove a smooth motion and keep such errors (Type A evaluation, GUM 4.2). Torques that jump, and motion that is
fast for the frame rate, leave something, too: it differs between orders and from one part of the motion to another,
where white noise is the same in all. Where they differ, nothing is concluded.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import stats

from anglecam.data.typing import Floats
from anglecam.measurement.sigma import Sigma

_ORDERS = (4, 6, 8)
"""Of the differences. At half of the Nyquist frequency the last one is 0.3 times the first."""
_QUANTILES = (0.25, 0.5, 0.75)
"""Of their magnitudes."""
_ALIKE = 2.0
"""Largest ratio of the estimates by all orders and quantiles that white noise has, as a rule: of series of 60 frames of
noise 3 % have more, of 100 frames 0.2 %, and are left as they are. The motion of the 205 recordings in ``configs``,
steps, chirps and stops, with noise of 0.0001° added, is taken for noise of 0.0004° at most at 30 Hz; at 15 Hz, too,
but for a torque that walks at random: 0.013°."""
_FEWEST = 30
"""Differences by which an estimate is known well enough."""
_MISSING = 1.9
"""Usual intervals from one frame to the next from which on a frame is missing between them."""


def white_noise(time: Floats, angle: Floats) -> float:
    """Return the standard deviation of errors that differ from frame to frame, rad; 0 where it may be motion.

    Times may be those of a container that rounds them, or those of a camera with an uneven rate. So the frames are
    taken at their times, and at even intervals; an error of the times only adds to the noise.

    Parameters
    ----------
    time : ndarray
        (n,) s, increasing.
    angle : ndarray
        (n,) rad.

    Returns
    -------
    float
        0 also for less than `_FEWEST` stretches of consecutive frames.

    Examples
    --------
    >>> time = np.arange(300) / 30
    >>> motion = 0.2 * np.sin(3.0 * time)
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal(300)
    >>> 0.9e-3 < white_noise(time, motion + noise) < 1.1e-3, white_noise(time, motion) < 1e-6
    (True, True)
    """
    if len(time) < _FEWEST + _ORDERS[-1]:
        return 0.0
    either = [_estimates(time, angle), _estimates(np.arange(len(time), dtype=float), angle, time)]
    estimates = min(either, key=lambda one: float(np.median(one)))
    alike = float(estimates.max()) <= _ALIKE * float(estimates.min()) < np.inf
    return float(np.median(estimates)) if alike else 0.0


def beyond_stated(sigma: Sigma, time: Floats, angle: Floats) -> float:
    """Return by which noise angles scatter beyond their stated noise, rad: standard deviation, added in squares.

    Parameters
    ----------
    sigma : Sigma
        Of n angles. An error of the pose counts as noise: it differs from frame to frame if the pose does.
    time, angle : ndarray
        (n,) s and rad.
    """
    stated2 = float(np.median(sigma.noise**2 + sigma.pose**2))
    return float(np.sqrt(max(0.0, white_noise(time, angle) ** 2 - stated2)))


def _estimates(place: Floats, angle: Floats, time: Floats | None = None) -> Floats:
    """Return the estimates of the noise by all orders and quantiles; infinite ones where frames are too few.

    The frames are at places (n,) on the axis of the motion; those between which one is missing are told by ``time``.
    """
    step = np.diff(place if time is None else time)
    usual = float(np.median(step))
    found = list[Floats]()
    for order in _ORDERS:
        steps = sliding_window_view(step, order)
        whole = (steps.max(axis=1) < _MISSING * usual) & (steps.min(axis=1) > 0.0)
        if whole.sum() < _FEWEST:
            return np.array([np.inf])
        places, angles = (sliding_window_view(one, order + 1)[whole] for one in (place, angle))
        # divided differences, scaled to keep the standard deviation of independent errors
        apart = (places[:, :, None] - places[:, None, :]) / np.ptp(places, axis=1)[:, None, None]
        apart[:, np.arange(order + 1), np.arange(order + 1)] = 1.0
        weights = 1.0 / apart.prod(axis=2)
        weights /= np.linalg.norm(weights, axis=1, keepdims=True)
        differences = np.abs((weights * angles).sum(axis=1))
        found.append(np.quantile(differences, _QUANTILES) / stats.norm.ppf(0.5 + np.array(_QUANTILES) / 2.0))
    return np.concatenate(found)
