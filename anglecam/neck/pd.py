"""PD control of the neck: closed loops of any plant, Eq. (37) and Fig. 16, and their stability margins.

The controller is in the feedback path, U = r − K_p·θ − K_d·θ̇, so the reference r has the unit of the plant's input.
With a plant G the closed loop is G/(1 + G·(K_p + K_d·s)); of the paper's SYS2 that is Eq. (37).

SYS2's output is in degrees and its input has no unit. Its steady state of 23.58 belongs to a step of height 1, which
stands for the step that the paper commanded, after which the head rested at 22°. K_p and K_d of Fig. 16 are therefore
per degree. K_p = 0.01 takes 19 % of the steady state away, 1/(1 + 23.58·K_p); K_d takes none.
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
"""Per degree; the paper gives 0, 10⁻⁴ and 10⁻² and finds the least loss with the first two."""
FIG_16_K_D = (0.0, 1e-3, 5e-3, 1e-2)
"""s per degree; the paper finds damping with 0.5·10⁻² to 10⁻²."""
_STILL = 1e-3
"""Share of the way within which a motion counts as at rest."""


@dataclass(frozen=True)
class PdGains:
    """Gains of U = r − K_p·θ − K_d·θ̇, in units of the plant's input over those of its output."""

    proportional: float = 0.0
    """K_p; V/rad for a plant in volts and radians."""
    derivative: float = 0.0
    """K_d, s times the unit of K_p."""


@dataclass(frozen=True)
class Margins:
    """Margins of a stable loop; all NaN for an unstable one."""

    gain: float
    """Factor on the loop gain that makes the loop unstable, the one nearest to 1; infinite if there is none."""
    phase: float
    """Least rotation of the locus in either direction that makes it unstable, rad; infinite if the gain is never 1."""
    delay: float
    """Least added delay that makes it unstable, s; infinite if there is none."""
    modulus: float
    """Least distance of the locus from −1, 1/max|S|."""
    sensitivity: float
    """M_s = max|S|, the largest amplification of a disturbance."""


@dataclass(frozen=True)
class ClosedLoop:
    """A plant with a controller, and its step response."""

    gains: PdGains
    system: control.TransferFunction
    """From reference to output."""
    figures: StepFigures
    """For a step of height 1; `NO_STEP` if the loop is not stable."""
    margins: Margins
    loss: float
    """Share of the uncontrolled steady state by which control reduces it."""

    @property
    def reference_gain(self) -> float:
        """Factor on the reference that compensates `loss`."""
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
    """Output of the controller, V."""
    figures: StepFigures
    """From the initial angle to rest, with the steady state in rad, not per volt; `NO_STEP` without a rest."""


def sys2() -> control.TransferFunction:
    """Return the third-order model SYS2 of Eq. (36), degrees per unit step."""
    gain = 47.3859
    return control.tf(gain * np.array([1.0, 56.8, 980.1]), np.polymul([1.0, 13.22], [1.0, 12.29, 149.0]))


def eq_37(gains: PdGains) -> control.TransferFunction:
    """Return the closed loop of Eq. (37), with the rounded coefficients that the paper prints."""
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
    """Return the closed loop of a linear plant with a PD controller in the feedback path.

    Parameters
    ----------
    plant : control.TransferFunction
        Strictly proper, continuous, one input and one output.
    gains : PdGains
        In the plant's units.

    Returns
    -------
    ClosedLoop
        Stable or not; an unstable loop has no figures.

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
    """Return the response to a step of the reference, (n,) in the plant's unit of output."""
    return height * linear_step(loop.system.num[0][0], loop.system.den[0][0], time)


def gains_table(
    plant: control.TransferFunction,
    proportional: Sequence[float] = FIG_16_K_P,
    derivative: Sequence[float] = FIG_16_K_D,
) -> tuple[ClosedLoop, ...]:
    """Return the closed loop for every pair of gains, as in Fig. 16: K_d varies faster than K_p."""
    return tuple(close_loop(plant, PdGains(K_p, K_d)) for K_p in proportional for K_d in derivative)


def loop_margins(loop: control.TransferFunction) -> Margins:
    """Return the margins of a stable loop.

    With derivative feedback the loop gain may rise through 1 and fall again, and the loop may be nearer to instability
    by a lead than by a lag, or by less gain than by more. The nearer one is returned.

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
    # Extremes of |1 + L|: its turning points, and its values at zero and infinite frequency.
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
        r from time 0, V.
    duration : float
        s. If the motion is not at rest, within 0.1 % of the way over the last tenth, there are no figures.
    start : (float, float)
        Angle (rad) and rate (rad/s) at time 0.
    points : int
        Number of instants of the result.

    Returns
    -------
    PdMotion
        Evenly spaced in time.

    Raises
    ------
    ValueError
        If the integration fails before the end because the neck leaves the reach of its linkage.
    """

    def voltage(angle: float, rate: float) -> float:
        return reference - gains.proportional * angle - gains.derivative * rate

    def slope(now: float, state: Floats) -> list[float]:
        angle, rate = float(state[0]), float(state[1])
        alpha = float(acceleration(angle, rate, voltage(angle, rate)))
        if not math.isfinite(alpha):
            raise ValueError(f"the head leaves its linkage's reach at {math.degrees(angle):.1f}° after {now:.3f} s")
        return [rate, alpha]

    time = np.linspace(0.0, duration, points)
    run = solve_ivp(slope, (0.0, duration), start, method="DOP853", t_eval=time, rtol=1e-9, atol=1e-11)
    if not run.success:
        raise ValueError(f"the controlled motion cannot be integrated to {duration:g} s: {run.message}")
    angle, rate = run.y
    volts = reference - gains.proportional * angle - gains.derivative * rate
    return PdMotion(
        time, angle, rate, volts, _figures(time, angle, lambda q: float(acceleration(q, 0.0, voltage(q, 0.0))))
    )


def linearised(acceleration: Acceleration, angle: float, voltage: float) -> control.TransferFunction:
    """Return the linear plant at a state of rest, rad per V, by central differences.

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
    steps = np.eye(3) * step
    a_theta, a_omega, a_u = ((acceleration(*(at + d)) - acceleration(*(at - d))) / (2.0 * step) for d in steps)
    return control.tf([a_u], [1.0, -a_omega, -a_theta])


def _figures(time: Floats, angle: Floats, at_rest: Callable[[float], float]) -> StepFigures:
    """Return the step figures of a motion that ends where ``at_rest``, the acceleration at rest, is zero.

    `NO_STEP` if it ends elsewhere.
    """
    last, way = float(angle[-1]), float(angle[-1] - angle[0])
    if not way or np.abs(angle[-len(angle) // 10 :] - last).max() > _STILL * abs(way):
        return NO_STEP
    rest = newton(at_rest, last, x1=last + _STILL * way, tol=1e-12, disp=False)
    if not abs(rest - last) <= _STILL * abs(way):
        return NO_STEP
    share = (angle - angle[0]) / (rest - angle[0])
    rise = first_crossing(time, share, HIGH) - first_crossing(time, share, LOW)
    return StepFigures(rise, max(0.0, float(share.max()) - 1.0), settling(time, share), float(rest))
