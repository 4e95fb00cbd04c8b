"""What the search for a torque of free form returns, and the search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.effects.effect import Values
from anglecam.effects.seen import Seen
from anglecam.identification.fit import Fit
from anglecam.loop.candidates import Candidate
from anglecam.loop.cross_validation import Gain, Prediction
from anglecam.loop.free_form.band import Band, band_of
from anglecam.loop.free_form.search import curve_of, search
from anglecam.loop.free_form.visited import Visited, visit
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.screen import Change, changes, directions


@dataclass(frozen=True)
class FreeForm:
    """A torque that a model lacks, as a smooth function of one or two quantities."""

    band: Band
    """The function over the range visited, without the part that the base model can follow."""
    fit: Fit
    """The model with the function, on the fitted recordings."""
    before: Prediction = field(repr=False)
    """Of the held-out recordings by the model without it, or of all frames by cross-validation if none is held out."""
    after: Prediction = field(repr=False)
    """The same with it."""
    gain: Gain
    resembles: dict[str, float]
    """Effect id → similarity, largest first: the correlation of the changes that the function and the effect make to
    the angles, after what the plant's parameters can follow was removed."""


def find_free_form(
    base: Fit,
    before: Prediction,
    fitted: Sequence[Record],
    predicted: Sequence[Record],
    ledger: Sequence[Effect],
    candidates: Sequence[Candidate],
    rng: np.random.Generator,
    policy: Policy = DEFAULT,
) -> FreeForm | None:
    """Look for a torque of free form that improves the prediction of a model.

    Parameters
    ----------
    base : Fit
        The model that leaves structure, on ``fitted``.
    before : Prediction
        Of the held-out recordings by ``base``, or of all frames by cross-validation if none is held out.
    fitted, predicted : sequence of Record
        Recordings to fit, and to predict only.
    ledger : sequence of Effect
        Effects with which the function is compared.
    candidates : sequence of Candidate
        Effects that were fitted; with these parameters they are compared as well.
    rng : numpy.random.Generator
        For bootstrap intervals.
    policy : Policy
        Thresholds.

    Returns
    -------
    FreeForm or None
        ``None`` if no function improves the prediction significantly.
    """
    visited = visit(base, fitted)
    found = search(visited, before, predicted, rng, policy)
    if found is None:
        return None
    similar = _resembling(visited, found.fit, ledger, candidates, policy)
    return FreeForm(band_of(found.fit, visited), found.fit, before, found.after, found.gain, similar)


def _resembling(
    visited: Visited, fit: Fit, ledger: Sequence[Effect], candidates: Sequence[Candidate], policy: Policy
) -> dict[str, float]:
    """Return the effects whose change of the angles is similar to the curve's, with any parameters that are tried."""
    base, curve = visited.fit, curve_of(fit)
    own = base.slopes.without_followed(visited.responses(curve) @ fit.parameters[len(fit.parameters) - curve.count :])
    tried = [*changes(base, visited.records, ledger), *_fitted_changes(base, visited.records, candidates)]
    found: dict[str, float] = {}
    for one in directions(base, visited.records, tried, policy):
        along = float(one.change @ own) / (one.size * float(np.linalg.norm(own)))
        similarity = along if one.one_sided else abs(along)
        found[one.effect.id] = max(similarity, found.get(one.effect.id, 0.0))
    least = policy.free_form.least_similarity
    return {name: found[name] for name in sorted(found, key=lambda name: -found[name]) if found[name] >= least}


def _fitted_changes(base: Fit, records: Sequence[Record], candidates: Sequence[Candidate]) -> list[Change]:
    """Return the changes that effects make with the parameters that were fitted."""
    found = []
    for one in candidates:
        values = one.fit.parameters[len(one.fit.parameters) - len(one.effect.parameters) :]
        at_these = replace(one.effect, starts=_only(tuple(one.effect.complete(values).tolist())))
        found += [c for c in changes(base, records, [at_these]) if np.allclose(c.start, values)]
    return found


def _only(values: Values) -> Callable[[Seen], Sequence[Values]]:
    """Return a function that starts an effect at given parameters."""
    return lambda seen: [values]
