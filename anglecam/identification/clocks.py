"""Clock offset and dead time of a session, as far as its recordings distinguish them.

The motion shows the sum d_r = δ_r + τ of a recording's clock offset and the dead time of the mechanism. A delay acts
alike before and after anything that does not change with time, such as a torque limit or a lag, so no motion separates
the two. A lamp that dates the command in one recording does: there τ = d_r − δ_r, and τ holds for all recordings of the
rig. Without a lamp only the differences of the d_r are clock offsets alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from anglecam.data.rounding import with_uncertainty
from anglecam.data.typing import Floats
from anglecam.identification.clock_fit import ClockFit

ALIASES = ("dead_time", "actuator_lag")
"""Effects that delay the motion as a clock offset does."""
SIGNIFICANT = 3.0
"""Standard uncertainties from which on an offset or a drift is pointed out."""


@dataclass(frozen=True)
class Clocks:
    """Clocks of the commands against the clips'; arrays with an entry for each recording."""

    names: tuple[str, ...]
    offsets: Floats
    """Time of the clip's clock when the command's shows zero, s; with the dead time where `dead_time` is ``None``."""
    offset_sigmas: Floats
    """Standard uncertainties, s."""
    drifts: Floats | None
    """Excess of the clip's rate over the command's; ``None`` where the recordings do not determine it."""
    drift_sigmas: Floats | None
    dead_time: tuple[float, float] | None
    """Dead time and its standard uncertainty, s; ``None`` where no lamp separates it from the offsets."""
    equal_p_value: float
    """Probability that equal offsets differ as much by chance; NaN for a single recording."""

    @property
    def alias(self) -> str:
        """What the offsets cannot be distinguished from, in a sentence."""
        if self.dead_time is not None:
            return "a lamp dates the command, so the offsets are those of the clocks alone"
        common = (
            "each offset contains the dead time (and the lag) of the mechanism, because no recording shows a lamp that"
            " lights at the first command change"
        )
        if self.equal_p_value < 1e-3:
            return f"{common}; the differences between recordings are clock offsets, because a dead time is common"
        return common

    @property
    def notes(self) -> tuple[str, ...]:
        """One line for each recording whose clock differs significantly from the command's."""
        return tuple(filter(None, map(self._note, range(len(self.names)))))

    def _note(self, i: int) -> str | None:
        parts = []
        offset, sigma = float(self.offsets[i]), float(self.offset_sigmas[i])
        if abs(offset) > SIGNIFICANT * sigma:
            side = "after" if offset > 0.0 else "before"
            parts.append(
                f"the motion comes {with_uncertainty(abs(offset), sigma, ' s')} {side} the command's time stamps"
            )
        if self.drifts is not None and self.drift_sigmas is not None:
            drift, sigma = 1e6 * float(self.drifts[i]), 1e6 * float(self.drift_sigmas[i])
            if abs(drift) > SIGNIFICANT * sigma:
                sign = "+" if drift > 0.0 else ""
                parts.append(
                    f"the clip's clock runs {sign}{with_uncertainty(drift, sigma, ' ppm')} against the command's"
                )
        return f"{self.names[i]}: {', and '.join(parts)}" if parts else None

    def as_dict(self) -> dict[str, Any]:
        """Return the value of ``clock`` in ``model.json``."""
        found: dict[str, Any] = {}
        for i, name in enumerate(self.names):
            drift, sigma = None, self.offset_sigmas[i]
            if self.drifts is not None and self.drift_sigmas is not None:
                drift = {"value": 1e6 * self.drifts[i], "sigma": 1e6 * self.drift_sigmas[i]}
            found[name] = {
                "offset_s": {"value": self.offsets[i] if np.isfinite(sigma) else np.nan, "sigma": sigma},
                "drift_ppm": drift,
            }
        dead = None if self.dead_time is None else dict(zip(("value", "sigma"), self.dead_time, strict=True))
        found["alias"] = {
            "effects": list(ALIASES) if dead is None else [],
            "dead_time_s": dead,
            "equal_offsets_p_value": self.equal_p_value,
            "statement": self.alias,
        }
        return found


def clocks_of(fit: ClockFit, dated: Mapping[str, tuple[float, float]]) -> Clocks:
    """Separate clock offsets from the dead time where a lamp dates a command.

    Parameters
    ----------
    fit : ClockFit
        Of the recordings with their commands' times as in the files.
    dated : mapping
        From the name of a recording to its clock offset by the lamp and that offset's standard uncertainty, s.

    Returns
    -------
    Clocks
        With the dead time as the weighted mean over the dated recordings, and each offset as the delay less it.
    """
    count = len(fit.names)
    covariance = fit.covariance[:count, :count]
    drift_sigmas = None if fit.drifts is None else np.sqrt(np.diag(fit.covariance)[count:])
    offsets, sigmas, dead = fit.delays, np.sqrt(np.diag(covariance)), None
    lamps = [i for i, name in enumerate(fit.names) if name in dated]
    if lamps:
        by_lamp = np.array([dated[fit.names[i]] for i in lamps])
        # the lamps' errors are independent of each other and of the motion's
        joint = covariance[np.ix_(lamps, lamps)] + np.diag(by_lamp[:, 1] ** 2)
        weights = np.linalg.solve(joint, np.ones(len(lamps)))
        weights /= weights.sum()
        tau = float(weights @ (fit.delays[lamps] - by_lamp[:, 0]))
        dead = (tau, float(np.sqrt(weights @ joint @ weights)))
        share = np.zeros((count, count))
        share[:, lamps] = weights
        less = np.eye(count) - share
        offsets = fit.delays - tau
        lamp_variance = float(np.sum((weights * by_lamp[:, 1]) ** 2))
        sigmas = np.sqrt(np.diag(less @ covariance @ less.T) + lamp_variance)
    return Clocks(fit.names, offsets, sigmas, fit.drifts, drift_sigmas, dead, _equal_p_value(fit.delays, covariance))


def _equal_p_value(delays: Floats, covariance: Floats) -> float:
    """Return the p-value of χ² for delays that are all equal."""
    count = len(delays)
    if count < 2 or not np.all(np.isfinite(covariance)):
        return float("nan")
    contrast = np.eye(count)[1:] - np.eye(count)[:1]
    apart = contrast @ delays
    chi2 = float(apart @ np.linalg.solve(contrast @ covariance @ contrast.T, apart))
    return float(special.chdtrc(count - 1, max(chi2, 0.0)))
