"""PD control about the neck: closed loops of any plant, Eq. (37) and Fig. 16, and how robust they are.

The controller stands in the feedback path, U = r − K_p·θ − K_d·θ̇, so a loop answers a reference r in the unit of the
plant's own input. With a plant G the closed loop is G/(1 + G·(K_p + K_d·s)); of the paper's SYS2 that is Eq. (37).

SYS2's output is in degrees and its input has no unit: its steady state of 23.58 is that of a step of height 1, which
stands for the one step that the paper commanded, after which the head rested at 22°. K_p and K_d of Fig. 16 are
therefore per degree. K_p = 0.01 takes 19 % of the steady state away, 1/(1 + 23.58·K_p); K_d takes none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import control
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import newton

from anglecam.data.step_figures import HIGH, LOW, NO_STEP, StepFigures, first_crossing, settling
from anglecam.data.typing import Floats
from anglecam.neck.linear import LinearNeck
from anglecam.neck.step import linear_step, linear_step_figures

Acceleration = Callable[[float, float, float], float]
"""θ̈ (rad/s²) of θ (rad), θ̇ (rad/s) and U (V)."""

FIG_16_K_P = (0.0, 1e-4, 1e-3, 1e-2)
"""Per degree; the paper names 0, 10⁻⁴ and 10⁻² and says that the first two lose least."""
FIG_16_K_D = (0.0, 1e-3, 5e-3, 1e-2)
"""s per degree; the paper names 0.5·10⁻² to 10⁻² as those that damp."""
_STILL = 1e-3
"""Of the way, within which a motion is at rest."""


@dataclass(frozen=True)
class PdGains:
    """U = r − K_p·θ − K_d·θ̇, in units of the plant's input over those of its output."""

    proportional: float = 0.0
    """K_p; V/rad for a plant in volts and radians."""
    derivative: float = 0.0
    """K_d, times second."""


@dataclass(frozen=True)
class Margins:
    """How far a stable loop is from instability; NaN throughout where it is not stable."""

    gain: float
    """Factor on the loop's gain that makes it unstable, the one nearest to 1; infinite if there is none."""
    phase: float
    """Least rotation of the locus, to either side, that does, rad; infinite where the loop's gain never is 1."""
    delay: float
    """Added delay that does, s; infinite if none."""
    modulus: float
    """Least distance of the locus from −1, 1/max|S|."""
    sensitivity: float
    """M_s = max|S|, how much a disturbance is amplified at worst."""


@dataclass(frozen=True)
class ClosedLoop:
    """A plant with a controller and how it answers a step."""

    gains: PdGains
    system: control.TransferFunction
    """From reference to output."""
    figures: StepFigures
    """Of a step of height 1; `NO_STEP` where the loop is not stable."""
    margins: Margins
    loss: float
    """Share of the steady state without control that control takes away."""

    @property
    def reference_gain(self) -> float:
        """Factor on the reference that makes up for `loss`."""
        return 1.0 / (1.0 - self.loss)


@dataclass(frozen=True)
class PdMotion:
    """A simulated closed loop; arrays of length n."""

    time: Floats
    """s."""
    angle: Floats
    """rad."""
    rate: Floats
    """rad/s."""
    voltage: Floats
    """What the controller gives the plant, V."""
    figures: StepFigures
    """From the starting angle to the rest; steady state in rad as it is, not per volt. `NO_STEP` without a rest."""


def sys2() -> control.TransferFunction:
    """Return the third-order model SYS2 of Eq. (36), degrees per unit step."""
    gain = 47.3859
    return control.tf(gain * np.array([1.0, 56.8, 980.1]), np.polymul([1.0, 13.22], [1.0, 12.29, 149.0]))


def eq_37(gains: PdGains) -> control.TransferFunction:
    """Return the closed loop as Eq. (37) prints it, with its rounded coefficients."""
    g1, a2, a3 = 47.385, 56.8, 980.1
    b2, b3, b4 = 25.5, 311.5, 1969.8
    K_p, K_d = gains.proportional, gains.derivative
    below = [1.0 + g1 * K_d, b2 + g1 * (K_p + a2 * K_d), b3 + g1 * (a2 * K_p + a3 * K_d), b4 + g1 * a3 * K_p]
    return control.tf(g1 * np.array([1.0, a2, a3]), below)


def linear_plant(neck: LinearNeck) -> control.TransferFunction:
    """Return Eq. (30) of a neck, rad per V."""
    return control.tf([neck.c], [1.0, neck.a, neck.b])


def third_order_plant(parameters: Sequence[float]) -> control.TransferFunction:
    """Return the plant of `anglecam.models.third_order.ThirdOrder`'s parameters: d2, d1, d0, n2, n1, n0."""
    return control.tf(list(parameters[3:]), [1.0, *parameters[:3]])


def close_loop(plant: control.TransferFunction, gains: PdGains) -> ClosedLoop:
    """Put a PD controller into the feedback path of a linear plant.

    Parameters
    ----------
    plant : control.TransferFunction
        Strictly proper, continuous, one input and one output.
    gains : PdGains
        In the plant's units.

    Returns
    -------
    ClosedLoop
        Whether it is stable shows in its figures.

    Raises
    ------
    ValueError
        If the plant is not strictly proper.
    """
    controller = control.tf([gains.derivative, gains.proportional], [1.0])
    system = control.feedback(plant, controller)
    figures = linear_step_figures(system.num[0][0], system.den[0][0])
    loss = 1.0 - 1.0 / (1.0 + gains.proportional * rest_gain(plant)) if gains.proportional else 0.0
    stable = bool((system.poles().real < 0.0).all())
    margins = loop_margins(plant * controller) if stable else Margins(*(math.nan,) * 5)
    return ClosedLoop(gains, system, figures, margins, loss)


def loop_response(loop: ClosedLoop, time: Floats, height: float = 1.0) -> Floats:
    """Return what a loop answers to a step of the reference, (n,) in the plant's unit of output."""
    return height * linear_step(loop.system.num[0][0], loop.system.den[0][0], time)


def gains_table(
    plant: control.TransferFunction,
    proportional: Sequence[float] = FIG_16_K_P,
    derivative: Sequence[float] = FIG_16_K_D,
) -> tuple[ClosedLoop, ...]:
    """Close the loop with every pair of gains, as in Fig. 16: K_p by K_p, K_d within."""
    return tuple(close_loop(plant, PdGains(K_p, K_d)) for K_p in proportional for K_d in derivative)


def loop_margins(loop: control.TransferFunction) -> Margins:
    """Return the margins of a stable loop.

    Derivative feedback makes loops whose gain rises through 1 and falls again, and which may be nearer to instability
    by a lead than by a lag, or by less gain than by more: the nearer one counts.

    Parameters
    ----------
    loop : control.TransferFunction
        Plant times controller, proper; the closed loop is stable.

    Returns
    -------
    Margins
        With S = 1/(1 + L).
    """
    factors, phases, distances, _, crossing, _ = control.stability_margins(loop, returnall=True)
    factors = factors[factors > 0.0]
    gain = float(factors[np.argmin(np.abs(np.log(factors)))]) if len(factors) else math.inf
    lag = np.mod(np.radians(phases), 2.0 * np.pi)
    phase = float(np.minimum(lag, 2.0 * np.pi - lag).min(initial=math.inf))
    delay = float((lag / crossing).min(initial=math.inf))
    # Turning points of |1 + L| and its two ends, where it need not turn.
    above, below = loop.num[0][0], loop.den[0][0]
    ends = [abs(1.0 + rest_gain(loop)), abs(1.0 + (above[0] / below[0] if len(above) == len(below) else 0.0))]
    modulus = float(min([*distances, *ends]))
    return Margins(gain, phase, delay, modulus, 1.0 / modulus)


def rest_gain(system: control.TransferFunction) -> float:
    """Return the gain at rest, output over input; infinite for a system that integrates."""
    above, below = (np.trim_zeros(polynomial[0][0], "f")[::-1] for polynomial in (system.num, system.den))
    shared = min(int(np.argmax(above != 0.0)), int(np.argmax(below != 0.0))) if len(above) else 0
    if not len(above) or above[shared] == 0.0:
        return 0.0
    return float(above[shared] / below[shared]) if below[shared] else math.inf


def simulate_pd(
    acceleration: Acceleration,
    gains: PdGains,
    reference: float,
    duration: float,
    *,
    start: tuple[float, float] = (0.0, 0.0),
    points: int = 4001,
) -> PdMotion:
    """Simulate PD control of a neck that need not be linear, after a step of the reference.

    Parameters
    ----------
    acceleration : callable
        θ̈ of (θ, θ̇, U), such as the large-angle Eq. (31).
    gains : PdGains
        V/rad and V·s/rad.
    reference : float
        r from time 0 on, V.
    duration : float
        s, long enough to come to rest, within 0.1 % of the way over its last tenth; else there are no figures.
    start : (float, float)
        Angle (rad) and rate (rad/s) at time 0.
    points : int
        Instants of the result.

    Returns
    -------
    PdMotion
        Evenly in time.

    Raises
    ------
    ValueError
        If the motion cannot be followed to the end: the neck leaves what its linkage reaches.
    """

    def voltage(angle: float, rate: float) -> float:
        return reference - gains.proportional * angle - gains.derivative * rate

    def slope(now: float, state: Floats) -> list[float]:
        angle, rate = float(state[0]), float(state[1])
        answer = float(acceleration(angle, rate, voltage(angle, rate)))
        if not math.isfinite(answer):
            raise ValueError(f"the head leaves what it can reach, at {math.degrees(angle):.1f}° after {now:.3f} s")
        return [rate, answer]

    time = np.linspace(0.0, duration, points)
    run = solve_ivp(slope, (0.0, duration), start, method="DOP853", t_eval=time, rtol=1e-9, atol=1e-11)
    if not run.success:
        raise ValueError(f"the controlled motion cannot be followed to {duration:g} s: {run.message}")
    angle, rate = run.y
    told = reference - gains.proportional * angle - gains.derivative * rate
    return PdMotion(
        time, angle, rate, told, _figures(time, angle, lambda q: float(acceleration(q, 0.0, voltage(q, 0.0))))
    )


def linearised(acceleration: Acceleration, angle: float, voltage: float) -> control.TransferFunction:
    """Return the linear plant about a state of rest, rad per V, by central differences.

    Parameters
    ----------
    acceleration : callable
        θ̈ of (θ, θ̇, U).
    angle, voltage : float
        A state of rest, rad and V.

    Returns
    -------
    control.TransferFunction
        Second order, for `close_loop` and its margins.
    """
    step = 1e-5
    at = np.array([angle, 0.0, voltage])
    ways = np.eye(3) * step
    a_theta, a_omega, a_u = ((acceleration(*(at + w)) - acceleration(*(at - w))) / (2.0 * step) for w in ways)
    return control.tf([a_u], [1.0, -a_omega, -a_theta])


def _figures(time: Floats, angle: Floats, standing: Callable[[float], float]) -> StepFigures:
    """Read figures off a motion towards where ``standing``, the acceleration at rest, is zero; else `NO_STEP`."""
    last, way = float(angle[-1]), float(angle[-1] - angle[0])
    if not way or np.abs(angle[-len(angle) // 10 :] - last).max() > _STILL * abs(way):
        return NO_STEP
    rest = newton(standing, last, x1=last + _STILL * way, tol=1e-12, disp=False)
    if not abs(rest - last) <= _STILL * abs(way):
        return NO_STEP
    share = (angle - angle[0]) / (rest - angle[0])
    rise = first_crossing(time, share, HIGH) - first_crossing(time, share, LOW)
    return StepFigures(rise, max(0.0, float(share.max()) - 1.0), settling(time, share), float(rest))
