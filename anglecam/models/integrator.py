"""The one compiled integrator, with every effect of the ledger at its port and at its null unless given.

    θ̈ = servo(c·v − b·θ) − a·θ̇ + Σ load_i(θ, θ̇) − dry friction,     τ·v̇ = u − v

It goes from *stop* to *stop*: frames and knots of the command, which is made of straight lines; the lag behind it is
solved in closed form. Because every knot is a stop, a delay is exact and the prediction is differentiable in it. As
long as nothing is nonlinear the way between stops is one Taylor series, exact to rounding; else it is classical
fourth-order Runge-Kutta. Dry friction is set-valued at rest, so the instant at which a velocity reaches zero is located
inside the step and the head then sticks until the torque on it exceeds the break-away level (Karnopp, J. Dyn. Syst.
Meas. Control 107, 1985).
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numba import njit

from anglecam import effects
from anglecam.effects import LEDGER

_SERVOS = sorted((e for e in LEDGER if e.servo is not None), key=lambda e: e.rank)
SERVO_IDS = tuple(e.id for e in _SERVOS)
"""In the order in which they act on the torque."""
LOAD_IDS = tuple(e.id for e in LEDGER if e.load is not None)
DRY_IDS = tuple(e.id for e in LEDGER if e.friction is not None)
TERMS = 16
"""Of a series whose steps are no longer than the plant's time constants: 1/18! is less than rounding."""
_SHARES = np.array([1.0 / ((k + 1) * (k + 2)) for k in range(TERMS)])
ROUNDING = 1e-17
"""rad; what a term of the series may leave out."""
NOTHING = 1e-13
"""rad; a lag that is nearer to its course than this has settled."""
FADED = 12.0
"""Time constants after which 6e-6 of a lag is left."""
WIDTH = max(len(e.parameters) for e in LEDGER)
"""Parameters an effect may have: the rows of the integrator's parameter tables are this long."""


def _tuple_of(count, item):  # type: ignore[no-untyped-def]  # compiled
    """Compile the tuple of an array's first items; to take them from the array costs more than to work with them."""
    if count == 0:
        return njit(lambda array: ())
    before = _tuple_of(count - 1, item)
    return njit(lambda array: before(array) + (item(array[count - 1]),))  # numba knows no other way


def _chain_of_servos(servos, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the servo functions, one after another, each with its row of the parameter table, into one function."""
    if row == len(servos):
        return njit(lambda torque, theta, abc, table: torque)
    first, others = servos[row], _chain_of_servos(servos, row + 1)
    return njit(lambda torque, theta, abc, table: others(first(torque, theta, abc, table[row]), theta, abc, table))


def _sum_of_loads(loads, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the sum of all load functions, each with its row of the parameter table, into one function."""
    if row == len(loads):
        return njit(lambda theta, omega, table: 0.0)
    first, others = loads[row], _sum_of_loads(loads, row + 1)
    return njit(lambda theta, omega, table: first(theta, omega, table[row]) + others(theta, omega, table))


def _sum_of_dries(dries, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the sums of the levels of dry friction, and the widest of Stribeck's speeds, into one function."""
    if row == len(dries):
        return njit(lambda table: (0.0, 0.0, 0.0, 0.0))
    first, others = dries[row], _sum_of_dries(dries, row + 1)

    @njit
    def total(table):  # type: ignore[no-untyped-def]
        up, down, breakaway, speed = first(table[row])
        more_up, more_down, more_breakaway, more_speed = others(table)
        return up + more_up, down + more_down, breakaway + more_breakaway, max(speed, more_speed)

    return total


_row = _tuple_of(WIDTH, njit(lambda value: value))
_rows_of_servos, _rows_of_loads, _rows_of_dries = (_tuple_of(len(ids), _row) for ids in (SERVO_IDS, LOAD_IDS, DRY_IDS))
_servo = _chain_of_servos([e.servo for e in _SERVOS])
_load = _sum_of_loads([e.load for e in LEDGER if e.load is not None])
_friction = _sum_of_dries([e.friction for e in LEDGER if e.friction is not None])


@njit
def _smooth(theta, omega, v, abc, servos, loads):  # type: ignore[no-untyped-def]  # compiled
    torque = _servo(abc[2] * v - abc[1] * theta, theta, abc, servos)
    return torque - abc[0] * omega + _load(theta, omega, loads)


@njit
def _asked(after, line, lag):  # type: ignore[no-untyped-def]  # compiled
    """Return v at some time after the last stop; ``line`` is u there, its slope, and how far v is off its course."""
    if lag == 0.0:
        return line[0] + line[1] * after
    return line[0] + line[1] * (after - lag) + line[2] * np.exp(-after / lag)


@njit
def _opposing(omega, direction, dry):  # type: ignore[no-untyped-def]  # compiled
    """Return dry friction while sliding, positive against an upward motion (Armstrong-Hélouvry et al. 1994)."""
    if direction == 0.0:
        return 0.0
    level = dry[0] if direction > 0.0 else dry[1]
    if dry[3] > 0.0:
        level += max(dry[2] - level, 0.0) * np.exp(-((omega / dry[3]) ** 2))
    return direction * level


@njit
def _held(torque, dry):  # type: ignore[no-untyped-def]  # compiled
    return abs(torque) <= max(dry[2], dry[0] if torque > 0.0 else dry[1])


@njit
def _step(theta, omega, begin, h, line, lag, abc, servos, loads, dry, direction):  # type: ignore[no-untyped-def]
    v1, v2, v3 = _asked(begin, line, lag), _asked(begin + 0.5 * h, line, lag), _asked(begin + h, line, lag)
    k1 = _smooth(theta, omega, v1, abc, servos, loads) - _opposing(omega, direction, dry)
    o2 = omega + 0.5 * h * k1
    k2 = _smooth(theta + 0.5 * h * omega, o2, v2, abc, servos, loads) - _opposing(o2, direction, dry)
    o3 = omega + 0.5 * h * k2
    k3 = _smooth(theta + 0.5 * h * o2, o3, v2, abc, servos, loads) - _opposing(o3, direction, dry)
    o4 = omega + h * k3
    k4 = _smooth(theta + h * o3, o4, v3, abc, servos, loads) - _opposing(o4, direction, dry)
    return theta + h * (omega + 2.0 * o2 + 2.0 * o3 + o4) / 6.0, omega + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0


@njit
def _advance(theta, omega, begin, h, line, lag, abc, servos, loads, dry):  # type: ignore[no-untyped-def]  # compiled
    """Advance by ``h``, through any number of standstills."""
    frictionless = dry[0] == 0.0 and dry[1] == 0.0 and dry[2] == 0.0
    if frictionless:
        return _step(theta, omega, begin, h, line, lag, abc, servos, loads, dry, 0.0)
    left = h
    while left > 0.0:
        now = begin + h - left
        if omega == 0.0:
            # what pulls at the end of the step counts too: a command that rises tears the head off within it
            torque = _smooth(theta, 0.0, _asked(now, line, lag), abc, servos, loads)
            later = _smooth(theta, 0.0, _asked(begin + h, line, lag), abc, servos, loads)
            if _held(torque, dry):
                if _held(later, dry):
                    return theta, 0.0
                low, high = 0.0, left
                for _ in range(40):
                    middle = 0.5 * (low + high)
                    if _held(_smooth(theta, 0.0, _asked(now + middle, line, lag), abc, servos, loads), dry):
                        low = middle
                    else:
                        high = middle
                left -= high
                now += high
                torque = later
                if left <= 0.0:
                    return theta, 0.0
            direction = np.sign(torque)
        else:
            direction = np.sign(omega)
        new_theta, new_omega = _step(theta, omega, now, left, line, lag, abc, servos, loads, dry, direction)
        if new_omega * direction >= 0.0:
            return new_theta, new_omega
        # false position (Illinois) on the step length at which the velocity vanishes
        low, high, f_low, f_high = 0.0, left, omega, new_omega
        if omega == 0.0:  # set off and turned back within one step: look for the turn after the start
            low = 1e-3 * left
            f_low = _step(theta, omega, now, low, line, lag, abc, servos, loads, dry, direction)[1]
            if f_low * direction <= 0.0:
                return theta, 0.0
        middle = high
        for _ in range(30):
            middle = (low * f_high - high * f_low) / (f_high - f_low)
            new_theta, new_omega = _step(theta, omega, now, middle, line, lag, abc, servos, loads, dry, direction)
            if abs(new_omega) < 1e-12 or high - low < 1e-12:
                break
            if new_omega * direction > 0.0:
                low, f_low = middle, new_omega
                f_high *= 0.5
            else:
                high, f_high = middle, new_omega
                f_low *= 0.5
        theta, omega = new_theta, 0.0
        left -= max(middle, 1e-9)
    return theta, omega


@njit
def _glide(theta, omega, way, line, lag, abc):  # type: ignore[no-untyped-def]  # compiled
    """Advance the linear plant by ``way``, in steps no longer than its own time constants."""
    pace = max(abs(abc[0]), np.sqrt(abs(abc[1])))
    at = 0.0
    while at < way:
        off = line[2] * np.exp(-at / lag) if lag > 0.0 else 0.0
        if abs(off) < NOTHING:
            off = 0.0
        fastest = max(pace, 1.0 / lag) if off != 0.0 else pace
        h = way - at
        pieces = np.ceil(h * fastest)
        if pieces > 1.0:
            h /= pieces
        theta, omega = _series(theta, omega, h, line[0] + line[1] * (at - lag), line[1], off, lag, abc)
        at = at + h if pieces > 1.0 else way
    return theta, omega


@njit
def _series(theta, omega, h, level, slope, off, lag, abc):  # type: ignore[no-untyped-def]  # compiled
    """Sum the Taylor series of θ over a step: of its terms, θ̈ = c·v − aθ̇ − bθ gives each from the two before it."""
    damping, stiffness, drive = abc[0] * h, abc[1] * h * h, abc[2] * h * h
    before, last = theta, omega * h
    angle, rate = before + last, last
    fade = -h / lag if off != 0.0 else 0.0
    forced, fading = drive * level, drive * off
    for k in range(TERMS):
        term = (forced + fading - damping * (k + 1) * last - stiffness * before) * _SHARES[k]
        before, last = last, term
        angle += last
        rate += (k + 2) * last
        forced = drive * slope * h if k == 0 else 0.0
        fading *= fade / (k + 1)
        if k > 1 and abs(last) + abs(before) + abs(fading) < ROUNDING:
            break
    return angle, rate / h


@njit
def _run(time, theta, omega, knots, lag, abc, servos, loads, dries, max_step):  # type: ignore[no-untyped-def]
    n, m = len(time), knots.shape[1]
    plant, servo_rows, load_rows = (abc[0], abc[1], abc[2]), _rows_of_servos(servos), _rows_of_loads(loads)
    states = np.empty((n, 2))
    states[0] = theta, omega
    dry = _friction(_rows_of_dries(dries))
    k, now = -1, time[0]
    while k + 1 < m and knots[0, k + 1] <= now:
        k += 1
    line = np.zeros(3)
    line[0], line[1] = _line(knots, k, now)
    v = line[0]
    for i in range(1, n):
        while now < time[i]:
            stop = time[i]
            if k + 1 < m and knots[0, k + 1] < stop:
                stop = knots[0, k + 1]
            line[0], line[1] = _line(knots, k, now)
            line[2] = v - line[0] + line[1] * lag
            if max_step == 0.0:
                theta, omega = _glide(theta, omega, stop - now, line, lag, abc)
            else:
                # a short lag fades within a step: while it does, steps are no longer than half of it
                fading = min(FADED * lag, stop - now) if abs(line[2]) > NOTHING else 0.0
                for leg in range(2):
                    begin, end = (0.0, fading) if leg == 0 else (fading, stop - now)
                    longest = min(max_step, 0.5 * lag) if leg == 0 else max_step
                    steps = int(np.ceil((end - begin) / longest)) if end > begin else 0
                    for step in range(steps):
                        h = (end - begin) / steps
                        theta, omega = _advance(
                            theta, omega, begin + step * h, h, line, lag, plant, servo_rows, load_rows, dry
                        )
            v = _asked(stop - now, line, lag)
            now = stop
            while k + 1 < m and knots[0, k + 1] <= now:
                k += 1
        states[i] = theta, omega
    return states


@njit
def _line(knots, k, now):  # type: ignore[no-untyped-def]  # compiled
    """Return the command's level and slope at an instant after knot ``k``; -1 is before the first."""
    if k < 0:
        return knots[1, 0], 0.0
    return knots[1, k] + knots[2, k] * (now - knots[0, k]), knots[2, k]


def _sources() -> str:
    """Hash the code that a run is compiled from: the ledger's files and this one."""
    files = [Path(__file__), *sorted(Path(effects.__path__[0]).glob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


SOURCES = _sources()
"""To be enclosed by what is compiled once for all processes: numba's cache looks at one file and what is enclosed."""


def _compile_once(code):  # type: ignore[no-untyped-def]  # compiled
    """Return the integrator, compiled by the first process that runs it."""

    @njit(nogil=True, cache=True)
    def integrate(time, theta, omega, knots, lag, abc, servos, loads, dries, max_step):  # type: ignore[no-untyped-def]
        """Return angle and rate at ``time``; compiled, so all arguments are taken as they come.

        Parameters
        ----------
        time : (n,) ndarray
            Increasing instants, s; the state is given at the first of them, where a lag has settled.
        theta, omega : float
            Angle from equilibrium at zero command (rad) and its rate (rad/s) at ``time[0]``.
        knots : (3, m) ndarray
            Of the command: instants (s), levels (rad) and slopes (rad/s); before the first its level holds.
        lag : float
            τ, s.
        abc : (3,) ndarray
            a (1/s), b (1/s²), c (1/s²) of Eq. (30).
        servos, loads, dries : (k, WIDTH) ndarray
            Parameters of the effects at the three ports, a row each in the order of `SERVO_IDS`, `LOAD_IDS`, `DRY_IDS`.
        max_step : float
            Longest step, s; 0 where no effect acts at the three ports.

        Returns
        -------
        (n, 2) ndarray
            Angle, rad, and rate, rad/s.
        """
        assert len(code) > 0
        return _run(time, theta, omega, knots, lag, abc, servos, loads, dries, max_step)

    return integrate


integrate = _compile_once(SOURCES)
