"""Nonlinear least squares whose nuisance parameters follow the shared ones: variable projection.

A trial step of the shared parameters p takes the nuisance parameters x of every recording along, by the Gauss-Newton
step that is best for them at the new p. Only p remains for the trust-region method, whose Jacobian is then the
projected one, however many recordings there are. The derivative of the projection is left out (Kaufman, BIT 15, 1975):
near the solution it is of second order in the residual.

A recording's x changes its own prediction only, so a step can be better in one recording and worse in another: each
keeps the best x that was tried.
Golub and Pereyra, Separable nonlinear least squares, Inverse Problems 19, 2003, R1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from anglecam.data.typing import Floats
from anglecam.identification.joined import Joined, Predicted
from anglecam.identification.slopes import Slopes
from anglecam.models.curved_plant import CurvedPlant
from anglecam.models.model import Model
from anglecam.models.plant import Plant

SETTLED = 1e-3
"""Log-likelihood; a fit ends when its last step, or the last `PATIENCE` steps of a model with kinks, gained no more
than this. Along a ridge it would otherwise continue with many tiny steps."""
PATIENCE = 3
"""Steps; with a kinked prediction one small step may precede a large one."""
HELD = 1e-12
"""rad; error that a parameter makes when it leaves its start by its magnitude. It holds a parameter on which the
prediction does not depend: without it the Jacobian is rank-deficient, and SciPy's step is as long as the trust region
allows."""
INSIDE = 1e-10
"""Least distance from a bound, relative to the bound or to 1, at which SciPy begins."""
NEXT_TO = 1e-4
"""Distance from a bound, in magnitudes of a parameter, from which the parameter is moved onto the bound."""
SHORTENED = (0.25, 0.05, 0.01)
"""Shares of a step of the nuisance parameters that are tried, one after another, where the whole step gains nothing."""


@dataclass(frozen=True)
class Point:
    """Values of all unknowns, and what they predict."""

    parameters: Floats
    """(p,) shared parameters, SI."""
    own: Floats
    """(R, k) nuisance parameters."""
    predicted: Predicted = field(repr=False)
    white: Floats = field(repr=False)
    """(N,) whitened residuals, rad."""
    costs: Floats = field(repr=False)
    """(R,) sum of squares of each recording's whitened residuals, rad²; infinite where the model diverges."""

    @property
    def cost(self) -> float:
        """Sum of squared whitened residuals, rad²."""
        return float(self.costs.sum())


def point_at(model: Model, joined: Joined, parameters: Floats, own: Floats, near: Floats | None = None) -> Point:
    """Predict with given unknowns; ``near`` as in `Joined.predict`."""
    predicted = joined.predict(model, parameters, own, near)
    white = joined.errors(predicted)
    return Point(parameters, own, predicted, white, _costs(joined, white))


def fit_shared(model: Model, joined: Joined, begin: Point, most: int) -> tuple[Point, Slopes]:
    """Fit shared and nuisance parameters.

    Parameters
    ----------
    model : Model
        The model.
    joined : Joined
        The recordings.
    begin : Point
        Where to start, within the bounds; its cost must be finite.
    most : int
        Most trial steps.

    Returns
    -------
    Point
        The best point found.
    Slopes
        The derivatives there.
    """
    here, slopes, steps = _fit_by_trust_region(model, joined, begin, _slopes_at(model, joined, begin), most)
    while steps < most:
        # with a kinked prediction a recording may have refused every whole step: let it go on alone
        alone, _ = fit_nuisance(model, joined, here, most, slopes)
        if alone is here:
            break
        before, here, slopes = here, alone, _slopes_at(model, joined, alone)
        if not before.cost - here.cost > _settled_gain(joined) * here.cost:
            break
        here, slopes, more = _fit_by_trust_region(model, joined, here, slopes, most - steps)
        steps += more
    return _onto_bounds(model, joined, here, slopes)


def fit_nuisance(
    model: Model, joined: Joined, begin: Point, most: int, slopes: Slopes | None = None
) -> tuple[Point, Slopes]:
    """Fit the nuisance parameters only, each recording by itself; the shared parameters are held.

    Parameters
    ----------
    model, joined, begin, most
        As in `fit_shared`.
    slopes : Slopes, optional
        The derivatives at ``begin``, if they are known.

    Returns
    -------
    Point
        The best point found; ``begin`` itself if none is better.
    Slopes
        The derivatives there. Those with respect to the shared parameters are zeros, unless none is better.
    """
    here = begin
    slopes = slopes or _slopes_at(model, joined, here, fixed=True)
    for _ in range(most):
        before, step = here, slopes.own_change(here.white)
        expected = _costs(joined, here.white - slopes.without_own(here.white))
        least = _settled_gain(joined) * here.cost
        if float(expected.sum()) <= least:
            break
        unsettled = expected > least / len(expected)
        shorter = (share * step for share in SHORTENED)
        for smaller in (step, *_smaller_steps(model, slopes, here.white), *shorter):
            tried = point_at(model, joined, here.parameters, before.own + smaller, before.predicted.motion)
            here = _better(joined, here, tried)
            if np.all(here.costs[unsettled] < before.costs[unsettled]):
                break
        if here.cost == before.cost:
            break
        slopes = _slopes_at(model, joined, here, fixed=True)
    return here, slopes


def _fit_by_trust_region(
    model: Model, joined: Joined, begin: Point, slopes: Slopes, most: int
) -> tuple[Point, Slopes, int]:
    """Return the best point that whole steps reach, the derivatives there, and the number of steps tried."""
    here = latest = begin
    held = HELD / model.scales
    bent = model.penalty if isinstance(model, CurvedPlant) else np.empty((0, len(held)))
    costs = [here.cost + float(np.sum((bent @ here.parameters) ** 2))]
    patience = 1 if isinstance(model, Plant) and not model.kinked else PATIENCE
    finite = [np.where(np.isfinite(bound), bound, 0.0) for bound in (model.lower, model.upper)]
    margin = [INSIDE * np.maximum(1.0, np.abs(bound)) for bound in finite]
    margin = [np.minimum(each, 0.25 * (model.upper - model.lower)) for each in margin]
    inside = np.clip(here.parameters, model.lower + margin[0], model.upper - margin[1])
    if not np.array_equal(inside, here.parameters):
        latest = _follow(model, joined, here, slopes, inside)
        if not np.isfinite(latest.cost):  # next to its bound the model diverges
            return here, slopes, 1

    def errors(parameters: Floats) -> Floats:
        nonlocal latest
        if not np.array_equal(parameters, latest.parameters):
            latest = _follow(model, joined, here, slopes, parameters)
        return np.concatenate([latest.white, held * (parameters - begin.parameters), bent @ parameters])

    def jacobian(parameters: Floats) -> Floats:
        """Return the derivatives at the point that was accepted, from which the next steps start."""
        nonlocal here, slopes
        if not np.array_equal(parameters, here.parameters):
            errors(parameters)
            here = latest
            slopes = _slopes_at(model, joined, here)
        return np.concatenate([-slopes.projected, np.diag(held), bent])

    def settled(intermediate_result: OptimizeResult) -> None:
        costs.append(2.0 * intermediate_result.cost)
        if len(costs) > patience and costs[-1 - patience] - costs[-1] <= _settled_gain(joined) * costs[-1]:
            raise StopIteration

    with np.errstate(divide="ignore"):  # SciPy divides by zero where the residual no longer depends on a parameter
        found = least_squares(
            errors,
            inside,
            jac=jacobian,
            bounds=(model.lower, model.upper),
            x_scale="jac",
            xtol=1e-9,
            ftol=1e-9,
            gtol=1e-12,
            max_nfev=most,
            callback=settled,
        )
    return here, slopes, found.nfev


def _onto_bounds(model: Model, joined: Joined, here: Point, slopes: Slopes) -> tuple[Point, Slopes]:
    """Move parameters next to a bound onto it, where that costs nothing; the interior steps never reach a bound."""
    near = NEXT_TO * model.scales
    moved = np.where(here.parameters - model.lower < near, model.lower, here.parameters)
    moved = np.where(model.upper - here.parameters < near, model.upper, moved)
    if np.array_equal(moved, here.parameters):
        return here, slopes
    there = _follow(model, joined, here, slopes, moved)
    if there.cost > (1.0 + _settled_gain(joined)) * here.cost:
        return here, slopes
    return there, _slopes_at(model, joined, there)


def _slopes_at(model: Model, joined: Joined, here: Point, *, fixed: bool = False) -> Slopes:
    """Return the derivatives at a point; ``fixed`` as in `Joined.slopes`."""
    return joined.slopes(model, here.parameters, here.own, here.predicted, fixed=fixed)


def _follow(model: Model, joined: Joined, here: Point, slopes: Slopes, parameters: Floats) -> Point:
    """Return the point at new shared parameters to which the nuisance parameters follow."""
    change = slopes.shared @ (parameters - here.parameters)
    left = here.white - change
    found = point_at(model, joined, parameters, here.own + slopes.own_change(left))
    # however far x is from its best, a short step of p along the projected gradient lowers the cost if x only follows
    for step in (-slopes.own_change(change), *_smaller_steps(model, slopes, left)):
        if found.cost < here.cost:
            break
        found = _better(joined, found, point_at(model, joined, parameters, here.own + step))
    return found


def _smaller_steps(model: Model, slopes: Slopes, left: Floats) -> Iterator[Floats]:
    """Yield (R, k) steps of the nuisance parameters for recordings that refuse the whole step.

    A body that friction holds stops a small rate at once: the derivative with respect to the rate is then almost zero
    and its step has no meaning. So the rates are held first, then all.
    """
    position = slopes.own.copy()
    position[:, 1 : model.states] = 0.0
    yield replace(slopes, own=position).own_change(left)
    yield np.zeros((len(slopes.edges) - 1, slopes.own.shape[1]))


def _costs(joined: Joined, white: Floats) -> Floats:
    """Return the (R,) sums of squares of each recording's whitened residuals, rad²; infinite where not finite."""
    costs = np.add.reduceat(white**2, joined.runs.edges[:-1])
    return np.where(np.isfinite(costs), costs, np.inf)


def _better(joined: Joined, one: Point, other: Point) -> Point:
    """Return, for each recording, the better of two points with the same shared parameters."""
    if not np.any(other.costs < one.costs):
        return one
    which = other.costs < one.costs
    rows = which[joined.runs.owner]
    angle = np.where(rows, other.predicted.angle, one.predicted.angle)
    motion = one.predicted.motion
    if motion is not None and other.predicted.motion is not None:
        motion = np.where(rows[:, None], other.predicted.motion, motion)
    return Point(
        one.parameters,
        np.where(which[:, None], other.own, one.own),
        Predicted(angle, motion),
        np.where(rows, other.white, one.white),
        np.where(which, other.costs, one.costs),
    )


def _settled_gain(joined: Joined) -> float:
    """Return the fall of the cost, as a share of the cost, that gains `SETTLED` in log-likelihood."""
    return 2.0 * SETTLED / len(joined.angle)
