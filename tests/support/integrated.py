"""Motions of effects by SciPy's integration of their equations, piece by piece between the switches of a command."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from anglecam.data.command import Command
from anglecam.effects import effect
from anglecam.models.plant import Plant

A, B, C = 26.0, 524.0, 508.0
TIME = np.arange(0.0, 4.0, 1 / 30)
COMMAND = Command(np.array([0.0, 0.5, 1.5, 2.5]), np.radians([0.0, 15.0, -12.0, 20.0]))
Rates = Callable[[float, np.ndarray, float], list[float]]


def integrated(rates: Rates, first: tuple[float, ...] = (0.0, 0.0), command: Command = COMMAND) -> np.ndarray:
    """Return the angle at `TIME`; ``rates`` takes time, state and command, and the state begins with angle and rate.

    Steps of at most 1 ms and tight tolerances keep the error at a kink below a millionth of a degree.
    """
    state, angle = np.array(first), np.zeros(len(TIME))
    for (begin, end), u in zip(pairwise([*command.time, TIME[-1] + 1e-9]), command.angle, strict=True):
        inside = (begin <= TIME) & (end > TIME)
        motion = solve_ivp(
            rates, (begin, end), state, args=(u,), rtol=1e-9, atol=1e-11, max_step=1e-3, t_eval=[*TIME[inside], end]
        )
        angle[inside], state = motion.y[0, :-1], motion.y[:, -1]
    return angle


def predicted(effect_id: str, *parameters: float, command: Command = COMMAND) -> np.ndarray:
    """Return the prediction of a plant with one effect, from rest at neutral."""
    return Plant((effect(effect_id),)).predict(np.array([A, B, C, *parameters]), TIME, command, np.zeros(2))


def largest_deg(difference: np.ndarray) -> float:
    """Return the largest magnitude, degrees."""
    return float(np.degrees(np.abs(difference)).max())


def changes_nothing_at_its_null(effect_id: str) -> bool:
    """Return whether the effect at its null predicts the base model's motion."""
    base = Plant().predict(np.array([A, B, C]), TIME, COMMAND, np.zeros(2))
    return largest_deg(predicted(effect_id, *effect(effect_id).null) - base) < 1e-4
