"""The compiled functions of an effect inside the equation of motion: one signature for each port.

An effect's function is compiled alone, kept on disk, and reaches the integrator as an address. The integrator is
therefore the same machine code for every ledger, and an edit of one effect compiles that effect alone. A call through
an address takes a few nanoseconds.

Parameters and states travel as pointers to float64 numbers, which are read as ``parameters[0]``. The same functions
can be called from Python with tuples or arrays.

    @servo       (torque, θ, ω, abc, parameters) → torque
    @load        (time, θ, ω, abc, parameters) → acceleration added
    @friction    (torque, θ, abc, parameters) → level up, level down, break-away level, Stribeck speed
    @dynamics    (time, θ, ω, v, abc, states, parameters, derivatives) → acceleration added; fills ``derivatives``
    @initial     (θ, ω, v, abc, parameters, states); fills ``states``

`anglecam.effects.effect.Effect` states the units. A division by zero gives no error but an infinite number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from llvmlite.ir import FunctionType
from numba import cfunc, types
from numba.core.typing import Signature, signature
from numba.extending import intrinsic

Numbers = types.CPointer(types.float64)
"""float64 numbers in a row."""
MOST_PARAMETERS = 8
"""Parameters that a function may read. An omitted staged parameter reads as 0, as if it had been given."""
_REAL = types.float64
SERVO = LOAD = signature(_REAL, _REAL, _REAL, _REAL, Numbers, Numbers)
FRICTION = signature(types.UniTuple(_REAL, 4), _REAL, _REAL, Numbers, Numbers)
DYNAMICS = signature(_REAL, _REAL, _REAL, _REAL, _REAL, Numbers, Numbers, Numbers, Numbers)
INITIAL = signature(types.void, _REAL, _REAL, _REAL, Numbers, Numbers, Numbers)


def _compiled(function: Callable[..., Any], *, form: Signature) -> Any:
    return cfunc(form, cache=True, error_model="numpy")(function)


servo = partial(_compiled, form=SERVO)
load = partial(_compiled, form=LOAD)
friction = partial(_compiled, form=FRICTION)
dynamics = partial(_compiled, form=DYNAMICS)
initial = partial(_compiled, form=INITIAL)


def caller_of(form: Signature) -> Any:
    """Return a compiled function (address, arguments) → result that calls what stands at an address.

    Parameters
    ----------
    form : Signature
        One of the signatures of this module.

    Returns
    -------
    intrinsic
        For compiled code. ``address`` is the ``address`` of a function with that signature, and ``arguments`` is a
        tuple.
    """

    @intrinsic
    def call(typing, address, arguments):  # type: ignore[no-untyped-def]  # compiled
        def generate(context, builder, typed, values):  # type: ignore[no-untyped-def]
            kinds = [context.get_value_type(kind) for kind in form.args]
            function = FunctionType(context.get_value_type(form.return_type), kinds).as_pointer()
            given = [builder.extract_value(values[1], i) for i in range(len(kinds))]
            return builder.call(builder.inttoptr(values[0], function), given)

        return form.return_type(address, arguments), generate

    return call


@intrinsic
def _pointer_to(typing, array):  # type: ignore[no-untyped-def]  # compiled
    def generate(context, builder, typed, values):  # type: ignore[no-untyped-def]
        return context.make_array(array)(context, builder, values[0]).data

    return types.CPointer(array.dtype)(array), generate


@intrinsic
def _shifted(typing, pointer, count):  # type: ignore[no-untyped-def]  # compiled
    def generate(context, builder, typed, values):  # type: ignore[no-untyped-def]
        return builder.gep(values[0], [values[1]])

    return pointer(pointer, count), generate


pointer_to: Any = _pointer_to
"""Compiled (array) → a pointer to its first number; the array must live as long as the pointer is used.

The integrator hands on pointers: an array's references are counted at every call, which costs more than an effect."""
shifted: Any = _shifted
"""Compiled (pointer, count) → a pointer that is ``count`` numbers further on."""
