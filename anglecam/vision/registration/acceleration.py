"""Extrapolation of an iteration whose steps shrink slowly: by Aitken for one ratio, by Anderson for several."""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Floats

MAX_RATIO = 0.98
"""Largest ratio of a step to its predecessor with which steps are extended."""
_MEMORY = 4
"""Rounds that Anderson's method remembers."""
_LEAST_SHARE = 1e-3
"""Singular values of the steps' differences below this share of the largest are noise."""


class PlainSteps:
    """No extrapolation."""

    def extended(self, state: Floats, step: Floats, steady: bool) -> Floats:
        """Return the step to be made.

        Parameters
        ----------
        state : ndarray
            (size,) present place, from any origin.
        step : ndarray
            (size,) plain step from there.
        steady : bool
            Whether the iteration is still the same as a round ago; if not, nothing is extrapolated.
        """
        return step


class AitkenSteps(PlainSteps):
    """Aitken's extrapolation of every second step, with the ratio of the first two components (Aitken 1926)."""

    def __init__(self) -> None:
        self._before: Floats | None = None

    def extended(self, state: Floats, step: Floats, steady: bool) -> Floats:
        """Return the step times 1/(1 − r), to the sum of all that follow, each r times its predecessor."""
        if not steady or self._before is None:
            self._before = step
            return step
        before, now = self._before[:2], step[:2]
        # After an extrapolation the ratio is estimated anew, from the next two steps.
        self._before = None
        ratio = float(before @ now) / max(float(before @ before), 1e-12)
        return step * (1.0 / (1.0 - min(ratio, MAX_RATIO)) if ratio > 0.0 else 1.0)


class AndersonSteps(PlainSteps):
    """Anderson's extrapolation: the step that would vanish if steps were linear in the states (Anderson 1965)."""

    def __init__(self) -> None:
        self._states: list[Floats] = []
        self._steps: list[Floats] = []

    def extended(self, state: Floats, step: Floats, steady: bool) -> Floats:
        """Return a step at most 1/(1 − `MAX_RATIO`) times as long as the plain one."""
        kept = _MEMORY - 1 if steady else 0
        self._states = [*self._states[len(self._states) - min(kept, len(self._states)) :], state]
        self._steps = [*self._steps[len(self._steps) - min(kept, len(self._steps)) :], step]
        if len(self._steps) == 1:
            return step
        of_steps, of_states = np.diff(self._steps, axis=0).T, np.diff(self._states, axis=0).T
        share = np.linalg.lstsq(of_steps, step, rcond=_LEAST_SHARE)[0]
        whole = step - (of_states + of_steps) @ share
        most = float(np.linalg.norm(step)) / (1.0 - MAX_RATIO)
        return np.asarray(whole * min(1.0, most / max(float(np.linalg.norm(whole)), 1e-12)))
