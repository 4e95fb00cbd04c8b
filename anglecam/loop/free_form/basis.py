"""The splines of a curve: their knots over the range visited, without the part that the base model can follow."""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from anglecam.data.typing import Floats
from anglecam.loop.free_form.visited import Visited
from anglecam.models.curved_plant import Curve
from anglecam.models.torque_curve import ORDER, Axis

ONE, TWO = 30, 9
"""Splines of a curve over one quantity, and along each axis of a curve over two. The penalty, not their number,
determines how smooth the curve is; fewer would leave a bias that the band does not contain."""


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
        Its bending is that of second differences of the coefficients; λ is 1.
    """
    axes = tuple(_axis(visited, name, len(over)) for name in over)
    wrapped = _each([_wrap(axis) for axis in axes])
    bare = Curve(axes, wrapped, (), ())
    along = np.sum([visited.followed(one, over).T @ one.acceleration(bare) for one in visited.stretches], axis=0)
    basis = wrapped @ null_space(along) if len(along) else wrapped
    bending = [
        _each([_second_differences(other.count) if other is axis else np.eye(other.count) for other in axes]) @ basis
        for axis in axes
    ]
    return Curve(axes, basis, tuple(bending), (1.0,) * len(axes))


def _axis(visited: Visited, name: str, count: int) -> Axis:
    values = visited.all(name)
    values = values[np.isfinite(values)]
    if name == "phase":
        return Axis(name, 0.0, 1.0, (ONE if count == 1 else TWO) + ORDER - 1)
    return Axis(name, float(values.min()), float(values.max()), ONE if count == 1 else TWO)


def _wrap(axis: Axis) -> Floats:
    """Return which free coefficient each spline has; on the phase the last three are the first three again."""
    if axis.quantity != "phase":
        return np.eye(axis.count)
    free = axis.count - ORDER + 1
    return np.eye(free)[np.arange(axis.count) % free]


def _second_differences(count: int) -> Floats:
    return np.diff(np.eye(count), n=2, axis=0)


def _each(matrices: list[Floats]) -> Floats:
    """Return the Kronecker product of one matrix for each axis."""
    first, *others = matrices
    for other in others:
        first = np.asarray(np.kron(first, other), dtype=np.float64)
    return first
