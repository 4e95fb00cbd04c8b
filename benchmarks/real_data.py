"""Compares anglecam's results on three published recordings with the publications.

EMPS: a motor drive that pushes a carriage, its position in m taken as an angle in rad and its force in N as the
command, so that c = 1/M; the record with added pulses is held out. A single pendulum released from 93°. A film of a red
ball on a thread. The data are not modified; sessions are written to a temporary folder.

    .venv/bin/python benchmarks/real_data.py FOLDER

FOLDER contains ``emps``, ``single-pendulum`` and ``pendulum-red-ball``.
Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System Identification Benchmarks,
2019. Kaheman et al., The experimental multi-arm pendulum on a cart, arXiv 2205.06231. FiloSottile/Pendolo-OpenCV, 2010.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, decimate, filtfilt

from anglecam.data.record import Record
from anglecam.effects import Effect, effect
from anglecam.identification.fit import Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.multiple_shooting import windows
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.io.files import write_atomically
from anglecam.io.session import read_session
from anglecam.loop.close import close_records
from anglecam.loop.cross_validation import Prediction, predict_held_out, split_records
from anglecam.models.plant import Plant
from anglecam.workflow.session import measure_session

Floats = NDArray[np.float64]

TICK_S = 1e-3
"""Sample time of both encoders."""
EVERY = 10
"""Ticks between the angles that are used: 100 Hz, as published; at 50 Hz the likelihood has worse local optima."""
HELD = 5
"""Ticks that are averaged for one row of the force."""
FROM_HANGING = (0.3, np.pi)
"""Starting values of gravity's sine, G (rad/s²) and θ0 (rad); with a small G the fit starts near the linear model."""
PENDULUM_S = 15.0
"""Part of the record that is used: in the first 15 s drag is distinguishable from the bearing's dry friction, which
dominates the rest of the 55 s."""


def write_emps(folder: Path, session: Path) -> None:
    """Write both EMPS records as a session; a force sample applies to half a tick before and after it."""
    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        _, position, force = read_emps(folder, name)
        kept = np.arange(0, len(position), EVERY)
        rows = len(force) // HELD
        _write(session / f"{name}.angles.csv", "time_s,angle_deg", kept * TICK_S, np.degrees(position[kept]))
        means = force[: rows * HELD].reshape(rows, HELD).mean(axis=1)
        begins = (np.arange(rows) * HELD - 0.5) * TICK_S
        _write(session / f"{name}.command.csv", "time_s,command_deg", begins, np.degrees(means))
    (session / "rig.yaml").write_text("neutral: 0.0\nheld_out: [DATA_EMPS_PULSES]\n")


def write_pendulum(folder: Path, session: Path) -> None:
    """Write the first `PENDULUM_S` of the pendulum's record as a session of one free swing, 0 hanging down."""
    data = loadmat(folder / "SinglePendulumDataForParameterEstimation.mat")
    angle = np.concatenate([part[0] for name in ("Y_id", "Y_vad") for part in data[name][:, 0]]) - np.pi
    kept = np.arange(0, round(PENDULUM_S / TICK_S), EVERY)
    _write(session / "swing.angles.csv", "time_s,angle_deg", kept * TICK_S, np.degrees(angle[kept]))


def link_film(folder: Path, session: Path) -> None:
    """Make a session of the film, whose pivot is above the picture."""
    (session / "ball.avi").symlink_to(folder / "esempio.avi")
    (session / "rig.yaml").write_text("mouth: {rgb: [215, 50, 25]}\npivot: {marker: none}\n")


def read_emps(folder: Path, name: str) -> tuple[Floats, Floats, Floats]:
    """Return time (s), position (m) and the motor's force (N) of an EMPS record at 1 kHz."""
    data = loadmat(folder / f"{name}.mat")
    return data["t"].ravel(), data["qm"].ravel(), data["gtau"].item() * data["vir"].ravel()


def records_of(write, folder: Path) -> list[Record]:  # type: ignore[no-untyped-def]
    """Write a session to a temporary folder and read it like any session."""
    with tempfile.TemporaryDirectory() as place:
        write(folder, Path(place))
        return list(measure_session(read_session(Path(place))).records)


def grow(base: Fit, records: Sequence[Record], added: Effect, size: float) -> Fit:
    """Add an effect and fit its parameters one after another, because shape parameters can compensate for the size.

    Parameters
    ----------
    base : Fit
        Fit of the plant without the effect.
    records : sequence of Record
        The fitted recordings.
    added : Effect
        Effect whose parameters all have the null value zero.
    size : float
        Starting value of its first parameter.

    Returns
    -------
    Fit
        With the effect.
    """
    fit, value = base, size
    for count in range(1, len(added.parameters) + 1):
        model = base.model.with_effect(replace(added, parameters=added.parameters[:count]))  # type: ignore[attr-defined]
        fit = fit_output_error(model, records, [np.append(fit.parameters, value)], nuisance=fit.nuisance)
        value = 0.0
    return fit


def carriage(fit: Fit) -> dict[str, float]:
    """Return mass (kg), friction in each direction (N, N·s/m) and stiffness of a fitted drive."""
    p = dict(zip(fit.model.names, fit.parameters.tolist(), strict=True))
    mass, uneven = 1.0 / p["c_per_s2"], p.get("difference_per_s", 0.0)
    dry, offset = p.get("friction_deg_per_s2", 0.0), p.get("asymmetry_deg_per_s2", 0.0)
    return {
        "M, kg": mass,
        "Fv, N·s/m": mass * p["a_per_s"],
        "Fc, N": mass * dry,
        "offset, N": mass * offset,
        "Fv+, N·s/m": mass * (p["a_per_s"] + uneven),
        "Fc+, N": mass * (dry + offset),
        "Fv-, N·s/m": mass * (p["a_per_s"] - uneven),
        "Fc-, N": mass * (dry - offset),
        "b·M, N/m": mass * p["b_per_s2"],
    }


def force_error(found: dict[str, float], folder: Path, name: str = "DATA_EMPS") -> float:
    """Return ‖τ − τ̂‖/‖τ‖ as published: with a zero-phase filter at 100 Hz, then every tenth sample."""
    _, position, force = read_emps(folder, name)
    numerator, denominator = butter(4, 100.0, fs=1.0 / TICK_S)
    position = filtfilt(numerator, denominator, position)
    rate = np.gradient(position, TICK_S)
    up, down = rate > 0.0, rate < 0.0
    model = found["M, kg"] * np.gradient(rate, TICK_S) + found.get("b·M, N/m", 0.0) * position
    model += up * (found["Fv+, N·s/m"] * rate + found["Fc+, N"]) + down * (found["Fv-, N·s/m"] * rate - found["Fc-, N"])
    ends = slice(50, -50)  # without the margins, where the filter is one-sided
    thinned = [
        decimate(x[ends], 10, ftype="fir", zero_phase=True) for x in (filtfilt(numerator, denominator, force), model)
    ]
    return float(np.linalg.norm(thinned[0] - thinned[1]) / np.linalg.norm(thinned[0]))


def fit_emps(records: Sequence[Record]) -> list[tuple[str, Fit, Fit]]:
    """Fit viscous friction, then add Coulomb friction with an offset, then asymmetric viscous friction.

    These are the published models. Stribeck's curve is left out because it can replace the asymmetric viscous friction.

    Returns
    -------
    list of (str, Fit, Fit)
        Name of the model, its fit in windows and its prediction of the held-out windows.
    """
    fitted, held_out = split_records(records, ["DATA_EMPS_PULSES"])
    base = fit_output_error(Plant(), fitted, start_parameters(fitted))
    fitted, held_out = (windows(part, base.parameters) for part in (fitted, held_out))
    viscous = fit_output_error(Plant(), fitted, [base.parameters])
    coulomb = effect("coulomb_friction")
    dry = grow(viscous, fitted, replace(coulomb, parameters=coulomb.parameters[:2]), 0.3)
    uneven = grow(dry, fitted, effect("damping_asymmetry"), 0.0)
    named = [("viscous", viscous), ("+ coulomb_friction", dry), ("+ damping_asymmetry", uneven)]
    return [(name, fit, predict_output_error(fit, held_out)) for name, fit in named]


def fit_swing(records: Sequence[Record], *more: tuple[str, float]) -> list[tuple[str, Fit, Prediction]]:
    """Fit the linear plant to a free swing, then add gravity's sine, then more effects, each with its starting size.

    Returns
    -------
    list of (str, Fit, Prediction)
        Name of the model, its fit and its prediction of every fifth second by a fit to the rest.
    """
    fitted = list(records)
    plant = Plant(driven=False)
    base = fit_output_error(plant, fitted, start_parameters(fitted))
    sine = plant.with_effect(effect("gravity_geometry"))
    near = fit_output_error(sine, windows(fitted, base.parameters), [np.append(base.parameters, FROM_HANGING)])
    found = fit_output_error(sine, fitted, [near.parameters])
    named = [("linear", base), ("+ gravity_geometry", found)]
    for name, size in more:
        named.append((f"+ {name}", grow(named[-1][1], fitted, effect(name), size)))
    return [(name, fit, predict_held_out(fit, fitted, [])[0]) for name, fit in named]


def main() -> None:
    """Print a table of the fits of known models and a table of the loop's verdicts."""
    folder = Path(sys.argv[1])
    emps, swing = records_of(write_emps, folder / "emps"), records_of(write_pendulum, folder / "single-pendulum")
    film = records_of(link_film, folder / "pendulum-red-ball")
    print("| data | model | quantity | published | ours | difference |\n| --- | --- | --- | --- | --- | --- |")
    published: dict[str, dict[str, float]] = {
        "viscous": {},
        "+ coulomb_friction": {"M, kg": 95.109, "Fv, N·s/m": 203.50, "Fc, N": 20.394, "offset, N": -3.165},
        "+ damping_asymmetry": {"Fv+, N·s/m": 166.7, "Fc+, N": 20.14, "Fv-, N·s/m": 240.4, "Fc-, N": 20.63},
    }
    published_error = {"+ coulomb_friction": 0.04083, "+ damping_asymmetry": 0.03112}
    for name, fit, prediction in fit_emps(emps):
        found = carriage(fit)
        for quantity, value in published[name].items():
            print(
                f"| EMPS | {name} | {quantity} | {value} | {found[quantity]:.2f} | {found[quantity] / value - 1:+.1%} |"
            )
        for record in ("DATA_EMPS", "DATA_EMPS_PULSES"):
            printed = f"{published_error[name]:.2%}" if name in published_error and record == "DATA_EMPS" else ""
            print(
                f"| {record} | {name} | force error | {printed} | {force_error(found, folder / 'emps', record):.2%} | |"
            )
        print(f"| PULSES | {name} | position in windows, µm RMS | | {1e6 * prediction.rmse:.0f} | |")
    for data, fits in (
        ("single pendulum", fit_swing(swing, ("quadratic_drag", 0.001))),
        ("red ball", fit_swing(film)),
    ):
        for name, fit, prediction in fits:
            print(f"| {data} | {name} | b, 1/s² | {64.2 if data != 'red ball' else ''} | {fit.parameters[1]:.2f} | |")
            print(f"| {data} | {name} | fit / held out, ° RMS | | {_deg(fit)} / {_deg(prediction)} | |")
    print("\n| data | verdict of the loop | held out before → after |\n| --- | --- | --- |")
    for data, records, held_out in (("EMPS", emps, ["DATA_EMPS_PULSES"]), ("pendulum", swing, []), ("ball", film, [])):
        verdict = close_records(records, held_out=held_out)
        names = ", ".join(a.effect.id for a in verdict.accepted) or verdict.verdict
        print(f"| {data} | {names} | {_deg(verdict.before_held_out)}° → {_deg(verdict.after_held_out)}° |", flush=True)


def _deg(fit: Fit | Prediction) -> str:
    return f"{np.degrees(fit.rmse):.3g}"


def _write(path: Path, header: str, time: Floats, value: Floats) -> None:
    with write_atomically(path) as stream:
        stream.write(header + "\n")
        stream.writelines(f"{t:.7f},{v:.9g}\n" for t, v in zip(time, value, strict=True))


if __name__ == "__main__":
    main()
