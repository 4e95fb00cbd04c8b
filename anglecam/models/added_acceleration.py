"""What an effect with additional states adds along a known motion: for drawing, not for fitting."""

from __future__ import annotations

import numpy as np

from anglecam.data.command import Command
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.models.plant import KINKED_STEP


def added_acceleration(
    effect: Effect, values: Floats, abc: Floats, time: Floats, angle: Floats, command: Command | None
) -> Floats:
    """Return the angular acceleration that an effect at the port ``dynamics`` adds along a motion.

    Its states are integrated in Runge-Kutta steps along angle and rate, which are interpolated between the frames.

    Parameters
    ----------
    effect : Effect
        An effect at the port ``dynamics``.
    values : (k,) ndarray
        Its parameters, SI.
    abc : (3,) ndarray
        a (1/s), b (1/s²), c (1/s²).
    time : (n,) ndarray
        Frame times, s.
    angle : (n,) ndarray
        Angle, rad.
    command : Command or None
        The command; ``None`` for a free swing.

    Returns
    -------
    (n,) ndarray
        rad/s².
    """
    rate, parameters, plant = np.gradient(angle, time), tuple(map(float, values)), tuple(map(float, abc))

    def evaluate(t: float, states: Floats) -> tuple[Floats, float]:
        v = 0.0 if command is None else float(command.at(np.array([t]))[0])
        theta, omega = float(np.interp(t, time, angle)), float(np.interp(t, time, rate))
        derivatives = np.empty(effect.states)
        added = effect.dynamics(t, theta, omega, v, plant, states, parameters, derivatives)
        return derivatives, added

    states = np.zeros(effect.states)
    if effect.initial is not None:
        v = 0.0 if command is None else float(command.at(time[:1])[0])
        effect.initial(float(angle[0]), float(rate[0]), v, plant, parameters, states)
    result = np.empty(len(time))
    result[0] = evaluate(time[0], states)[1]
    for i in range(1, len(time)):
        steps = max(1, int(np.ceil((time[i] - time[i - 1]) / KINKED_STEP)))
        h = (time[i] - time[i - 1]) / steps
        for step in range(steps):
            t = time[i - 1] + step * h
            d1 = evaluate(t, states)[0]
            d2 = evaluate(t + 0.5 * h, states + 0.5 * h * d1)[0]
            d3 = evaluate(t + 0.5 * h, states + 0.5 * h * d2)[0]
            d4 = evaluate(t + h, states + h * d3)[0]
            states = states + h * (d1 + 2.0 * d2 + 2.0 * d3 + d4) / 6.0
        result[i] = evaluate(time[i], states)[1]
    return result
