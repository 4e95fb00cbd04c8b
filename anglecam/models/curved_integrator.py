"""The integrator of the equation of motion with a torque of free form beside the effects of a ledger.

It is compiled apart from `anglecam.models.integrator`, because even a curve that is not there would slow every fit.
Most plants to which a curve is added have no effects, and the integrator for them is compiled in a few seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.models.compiled_effects import CompiledEffects, compile_effects
from anglecam.models.integrator import COMPILED, SOURCES, Integrator, compile_run
from anglecam.models.torque_curve import curve_at


def table_with_curve(table: Floats, curve: Floats) -> Floats:
    """Append a curve to the parameter table of the effects.

    Parameters
    ----------
    table : (r, w) ndarray
        From `CompiledEffects.table`.
    curve : (k,) ndarray
        Header and coefficients, as `anglecam.models.torque_curve.curve_at` takes them.

    Returns
    -------
    (s, w) ndarray
        The curve fills the last rows.
    """
    width = table.shape[1]
    return np.concatenate([table, np.append(curve, np.zeros(-len(curve) % width)).reshape(-1, width)])


def _with_curve(effects: CompiledEffects) -> CompiledEffects:
    """Return the functions of a ledger and a curve, which follows the effects in the parameter table."""
    bare_rows, bare_rates, last = effects.rows, effects.rates, max(1, len(effects.ids))

    @njit
    def rows(table):  # type: ignore[no-untyped-def]  # compiled
        return bare_rows(table[:last]) + (table[last:].reshape(-1),)  # numba joins tuples only so

    @njit(forceinline=True)
    def rates(time, theta, omega, extra, v, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        acceleration, torque, derivatives = bare_rates(time, theta, omega, extra, v, abc, rows)
        return acceleration + curve_at(time, theta, omega, v, rows[7]), torque, derivatives

    return replace(effects, rows=rows, rates=rates)


_NO_EFFECTS = compile_effects(())
_run_without_effects = compile_run(_with_curve(_NO_EFFECTS))
_run_with_ledger = compile_run(_with_curve(COMPILED))


def _compile_once(code: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return both integrators, compiled by the first process that runs them; see `integrator.SOURCES`.

    Their arguments and results are those of `anglecam.models.integrator.integrate`.
    """

    @njit(nogil=True, cache=True)
    def without_effects(time, edges, first, knots, spans, lag, abc, table, max_step, near):  # type: ignore[no-untyped-def]
        assert len(code) > 0
        return _run_without_effects(time, edges, first, knots, spans, lag, abc, table, max_step, near)

    @njit(nogil=True, cache=True)
    def with_ledger(time, edges, first, knots, spans, lag, abc, table, max_step, near):  # type: ignore[no-untyped-def]
        assert len(code) > 0
        return _run_with_ledger(time, edges, first, knots, spans, lag, abc, table, max_step, near)

    return without_effects, with_ledger


_without_effects, _with_ledger = _compile_once(SOURCES)
WITHOUT_EFFECTS = Integrator(_NO_EFFECTS, _without_effects)
"""The integrator of a curve alone."""
WITH_LEDGER = Integrator(COMPILED, _with_ledger)
"""The integrator of `anglecam.effects.LEDGER` and a curve."""
