"""The splines of a curve: their knots over the range visited, without the part that the base model can follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import null_space

from anglecam.data.typing import Floats
from anglecam.loop.free_form.visited import Visited
from anglecam.models.curved_plant import Curve
from anglecam.models.torque_curve import ORDER, Axis

ONE, TIME, TWO = 14, 26, 6
"""Splines of a curve over one quantity, over the time, and along each axis of a curve over two. The penalty, not their
number, determines how smooth the curve is."""


def curve_over(visited: Visited, over: tuple[str, ...]) -> Curve:
    """Return the splines over one or two quantities, not yet penalised.

    Over the range visited the curve is orthogonal to whatever the base model can follow, so that its parameters do not
    compete with a, b, c and the zeros of the angle. Over the phase it is periodic.

    Parameters
    ----------
    visited : Visited
        From `anglecam.loop.free_form.visited.visit`.
    over : tuple of str
        One or two of `Visited.names`.

    Returns
    -------
    Curve
        Its penalty gives second differences of the coefficients, with λ = 1.
    """
    axes = tuple(_axis(visited, name, len(over)) for name in over)
    wrapped = _each(axes, [_wrap(axis) for axis in axes])
    bare = Curve(axes, wrapped, np.empty((0, wrapped.shape[1])))
    along = sum(visited.followed(one, over).T @ one.acceleration(bare) for one in visited.stretches)
    basis = wrapped @ null_space(np.asarray(along)) if np.size(along) else wrapped
    bent = [_each(axes, [_second_differences(a.count) if a is axis else np.eye(a.count) for a in axes]) for axis in axes]
    return replace(bare, basis=basis, penalty=np.vstack(bent) @ basis)


def _axis(visited: Visited, name: str, count: int) -> Axis:
    values = visited.all(name)
    values = values[np.isfinite(values)]
    if name == "phase":
        return Axis(name, 0.0, 1.0, (ONE if count == 1 else TWO) + ORDER - 1)
    splines = TWO if count > 1 else TIME if name == "time" else ONE
    return Axis(name, float(values.min()), float(values.max()), splines)


def _wrap(axis: Axis) -> Floats:
    """Return which free coefficient each spline has; on the phase the last three are the first three again."""
    if axis.quantity != "phase":
        return np.eye(axis.count)
    free = axis.count - ORDER + 1
    return np.eye(free)[np.arange(axis.count) % free]


def _second_differences(count: int) -> Floats:
    return np.diff(np.eye(count), n=2, axis=0)


def _each(axes: tuple[Axis, ...], matrices: list[Floats]) -> Floats:
    """Return the Kronecker product of one matrix for each axis."""
    first, *others = matrices
    for other in others:
        first = np.kron(first, other)
    return first
