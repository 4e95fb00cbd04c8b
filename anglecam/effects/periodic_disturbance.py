"""Periodic disturbance: a torque of a steady frequency that comes from outside, for example from a fan or a pump.

    θ̈ = c·u − a·θ̇ − b·θ + A·sin(2π·f·t + φ)

t is the time of the recording. The phase φ is therefore the same in all recordings only if their clocks start in step
with the disturbance; otherwise each recording has to be closed by itself. With fewer than two periods in the longest
recording nothing repeats there, and the torque is a step or a slow change that other causes can have as well.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.typing import Floats
from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Motion, Seen, sines_and_cosines

LOWEST_HZ, HIGHEST_HZ = 0.25, 15.0
FEWEST = 2.0
"""Periods in the longest recording."""
PER_CYCLE = 2
"""Frequencies that are tried for each cycle more in the longest recording. A wave between two of them shares 81 % of
its energy with either."""
MOST_TRIED = 800
BELOW_NYQUIST = 0.9
"""Share of half the frame rate up to which the residual is searched."""


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    return parameters[0] * np.sin(math.tau * parameters[1] * time + parameters[2])


def _frequencies(seen: Seen) -> Floats:
    lowest, highest = max(LOWEST_HZ, FEWEST / seen.span), min(HIGHEST_HZ, BELOW_NYQUIST * 0.5 / seen.interval)
    highest = max(highest, 2.0 * lowest)
    tried = min(MOST_TRIED, max(8, round(PER_CYCLE * seen.span * (highest - lowest))))
    return np.linspace(lowest, highest, tried)


def _searched(seen: Seen) -> list[Floats]:
    return sines_and_cosines(seen.times, math.tau * _frequencies(seen))


def _starts(seen: Seen) -> list[Values]:
    """Start with the waves over time that explain most of the residual."""
    waves = seen.waves(seen.times, math.tau * _frequencies(seen), most=3)
    found: list[Values] = [(max(w.amplitude, 1e-6), w.number / math.tau, w.phase) for w in waves]
    return found or [(0.01 * seen.torque + 1e-6, 1.0, 0.0)]


def _possible(parameters: Values, abc: Values, motion: Motion) -> bool:
    """Return whether the disturbance repeats itself within a recording."""
    return parameters[1] * motion.span >= FEWEST


EFFECT = Effect(
    id="periodic_disturbance",
    station="load",
    summary="Something outside pushes the body at a steady frequency, whatever is commanded.",
    equation="θ̈ = c·u − a·θ̇ − b·θ + A·sin(2π·f·t + φ)",
    relaxes="Eq. (14): no torque acts on the head but the servo's, the springs' and the weight's",
    parameters=(
        Parameter("amplitude_deg_per_s2", "A", 0.0, 0.0, 2000.0, to_file=math.degrees(1.0), swing_power=1),
        Parameter("frequency_hz", "f", 1.0, 0.05, 50.0),
        Parameter("phase_deg", "φ", 0.0, -2.0 * math.tau, 2.0 * math.tau, to_file=math.degrees(1.0), circular=True),
    ),
    aliases=("elastic_coupling",),
    separating_experiment="a minute of rest without any command: the disturbance goes on",
    source="Ljung, System Identification, 2nd ed., 1999, sec. 2.3",
    load=_load,
    starts=_starts,
    searched=_searched,
    possible=_possible,
    in_free_swing=False,
)
