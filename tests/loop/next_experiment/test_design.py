"""The proposed experiment, played to a simulated rig with a known hidden effect, separates as much as predicted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import yaml

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.effects import effect
from anglecam.identification.fit import Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.noise import Noise
from anglecam.identification.output_error import fit_output_error
from anglecam.io.command_csv import read_command
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.next_experiment.commands import candidate_commands, limits_of
from anglecam.loop.next_experiment.design import separating_experiment, write_command
from anglecam.loop.policy import DEFAULT
from anglecam.loop.screen import Forecast
from anglecam.models.plant import Plant
from support.starts import first_start
from synth.motion import move
from synth.motion.command import command_rows
from synth.spec import Spec, read_spec

SLOW_STEPS = {
    "stairs": {"kind": "stairs", "levels_deg": [12, -9, 15, 0, -15, 6]},
    "step": {"kind": "step", "amplitude_deg": 15},
}
SLOW_TRIANGLE = {"triangle": {"kind": "triangle", "amplitude_deg": 12, "period_s": 6.0}}
RELEASES = {"high": {"kind": "free", "initial_angle_deg": 20}, "low": {"kind": "free", "initial_angle_deg": 7}}
SIGMA = np.radians(0.1)
SECONDS = 8.0
ENOUGH = DEFAULT.next_experiment.separated_sigmas


@dataclass(frozen=True)
class Rig:
    """A rig with a hidden effect, filmed at 30 Hz."""

    spec: Spec
    phi: float

    def film(self, index: int, rows: np.ndarray | None, seconds: float, seed: int) -> Record:
        recording = self.spec.recordings[index]
        start = recording.command.rest_s if rows is None else 0.0  # a free swing is filmed from its release
        time = np.arange(start, seconds, 1 / 30)
        angle = move(self.spec, recording, rows, seconds + 1.0).angle(time)
        fresh = np.random.default_rng(seed).normal(0.0, SIGMA, len(time))
        for i in range(1, len(time)):
            fresh[i] = self.phi * fresh[i - 1] + np.sqrt(1.0 - self.phi**2) * fresh[i]
        command = None if rows is None else Command(rows[:, 0], np.radians(rows[:, 1]))
        return Record(recording.name, time, angle + fresh, command, False, np.full(len(time), np.nan))

    def session(self, seed: int) -> list[Record]:
        rows = [command_rows(r, np.random.SeedSequence(seed)) for r in self.spec.recordings]
        return [self.film(i, r, SECONDS, 10 * seed + i) for i, r in enumerate(rows)]


@pytest.fixture
def rig(tmp_path):
    def build(effects, commands, phi=0.0):
        content = {
            "seed": 0,
            "plant": {"a": 26.0 if commands is not RELEASES else 6.0, "b": 524.0, "c": 508.0},
            "effects": effects,
            "recordings": [{"name": n, "duration_s": SECONDS, "command": c} for n, c in commands.items()],
        }
        path = tmp_path / "spec.yaml"
        path.write_text(yaml.safe_dump(content))
        return Rig(read_spec(path), phi)

    return build


def fit_each(records: list[Record], ids: list[str], phi: float = 0.0) -> list[Fit]:
    plant = Plant(driven=any(r.command is not None for r in records))
    base = fit_output_error(plant, records, [s[: plant.base_count] for s in start_parameters(records)], phi=phi)

    def fit(name: str) -> Fit:
        start = first_start(effect(name))
        return fit_with(base, records, Forecast(effect(name), start, start, start, 0.0))

    return [fit(name) for name in ids]


def noise(phi: float = 0.0) -> Noise:
    return Noise(SIGMA, phi, 0.05, "rest")


def ratio_gained(fits: list[Fit], records: list[Record], new: Record) -> float:
    """Return by how much one more recording raises the log-likelihood ratio of the first model to the second."""
    phi = fits[0].phi
    rise = [fit_output_error(f.model, [*records, new], [f.parameters], phi=phi).cost - f.cost for f in fits]
    return float(rise[1] - rise[0]) / (2.0 * SIGMA**2)


@pytest.mark.parametrize(
    ("hidden", "other", "phi"),
    [
        ({"actuator_lag": {"tau_s": 0.008}}, "dead_time", 0.0),
        ({"dead_time": {"tau_s": 0.008}}, "actuator_lag", 0.6),
        pytest.param({"coulomb_friction": {"torque": 0.5}}, "quadratic_drag", 0.0, marks=pytest.mark.sweep),
    ],
)
def test_the_proposed_recording_gains_the_predicted_likelihood_ratio_and_faster_than_repetition(
    rig, hidden, other, phi
):
    true_rig = rig(hidden, SLOW_STEPS, phi)
    records = true_rig.session(1)
    fits = fit_each(records, [*hidden, other], phi)
    experiment = separating_experiment(fits, records, noise(phi))
    rows = np.column_stack([experiment.command.time, np.degrees(experiment.command.angle)])
    gained = [ratio_gained(fits, records, true_rig.film(0, rows, experiment.duration, 100 + seed)) for seed in range(3)]
    promised = 0.5 * experiment.separation**2
    assert experiment.separation >= ENOUGH
    assert 0.5 * promised < np.mean(gained) < 2.0 * promised
    repeated = [ratio_gained(fits, records, record) for record in true_rig.session(9)]
    assert np.mean(gained) / experiment.duration > 2.0 * np.mean(repeated) / SECONDS


def test_no_candidate_exceeds_the_range_and_the_steps_of_recorded_commands(rig):
    records = rig({}, SLOW_STEPS).session(3)
    candidates = [c.command for c in candidate_commands(records, 3.6)]
    assert len(candidates) > 20
    levels = np.degrees(np.concatenate([c.angle for c in candidates]))
    assert levels.min() == pytest.approx(-15.0, abs=1e-5)
    assert levels.max() == pytest.approx(15.0, abs=1e-5)
    largest = max(np.abs(np.diff(np.degrees(c.angle))).max() for c in candidates)
    assert largest == pytest.approx(24.0, abs=1e-5)  # from -9° to 15° is the largest step of the stairs
    assert all(c.angle[0] == 0.0 and c.first_change() >= 0.5 for c in candidates)
    assert not limits_of(records).allow(Command(np.array([0.0, 1.0]), np.radians([0.0, 15.5])))
    assert not limits_of(records).allow(Command(np.array([0.0, 1.0, 1.3]), np.radians([-14.0, 0.0, 14.0])))


def test_no_steps_are_proposed_for_a_rig_that_was_only_moved_slowly(rig):
    records = rig({"quadratic_drag": {"q": 2.0}}, SLOW_TRIANGLE).session(4)
    experiment = separating_experiment(fit_each(records, ["quadratic_drag", "actuator_lag"]), records, noise())
    # the triangle of 12° and 6 s rises 8° in a second, 0.16° in an update of the servo
    assert np.abs(np.diff(np.degrees(experiment.command.angle))).max() < 0.1601
    steepest = np.degrees(
        np.ptp([experiment.command.at(np.arange(0, 4, 0.02) + d) for d in (0.01, 0.51)], axis=0)
    ).max()
    assert steepest < 4.01


def test_delay_and_lag_are_separated_by_a_fast_command_within_the_recorded_angles(rig):
    true_rig = rig({"actuator_lag": {"tau_s": 0.02}}, SLOW_STEPS)
    records = true_rig.session(5)
    experiment = separating_experiment(fit_each(records, ["actuator_lag", "dead_time"]), records, noise())
    command = experiment.command
    assert np.median(np.diff(command.time)) < 0.3
    assert experiment.duration == 4.0
    assert command.time[-1] < experiment.duration
    rows = np.column_stack([command.time, np.degrees(command.angle)])
    angle = move(true_rig.spec, true_rig.spec.recordings[0], rows, 5.0).angle(np.arange(0.0, 4.0, 0.01))
    seen = np.concatenate([r.angle for r in records])
    assert seen.min() - np.radians(0.6) < angle.min()  # 2 % of the range
    assert angle.max() < seen.max() + np.radians(0.6)


def test_effects_of_free_swings_are_separated_by_another_release_without_a_command(rig):
    true_rig = rig({"quadratic_drag": {"q": 0.1}}, RELEASES)
    records = true_rig.session(6)
    fits = fit_each(records, ["quadratic_drag", "coulomb_friction"])
    experiment = separating_experiment(fits, records, noise())
    assert experiment.command is None
    assert experiment.description.startswith("release from ")
    assert abs(float(experiment.description.split()[-1].rstrip("°"))) <= 21.0
    assert experiment.separation > 0.0


def test_a_pair_that_no_command_separates_does_not_affect_the_choice_for_the_other_pairs(rig):
    records = rig({"dead_time": {"tau_s": 0.002}}, SLOW_STEPS).session(7)
    fits = fit_each(records, ["dead_time", "actuator_lag", "quadratic_drag"])
    experiment = separating_experiment(fits, records, noise())
    alike = ("dead_time", "actuator_lag")
    assert experiment.separations[alike] < ENOUGH
    assert experiment.separated == (("dead_time", "quadratic_drag"), ("actuator_lag", "quadratic_drag"))
    assert experiment.separation >= ENOUGH
    hopeless = separating_experiment(fits[:2], records, noise())
    assert hopeless.separated == ()


def test_one_model_needs_no_experiment(rig):
    records = rig({}, SLOW_STEPS).session(8)
    assert separating_experiment(fit_each(records, ["dead_time"]), records, noise()) is None


def test_a_command_file_reads_back_as_it_was_written(rig, tmp_path):
    for candidate in candidate_commands(rig({}, SLOW_STEPS).session(8), 3.6):
        write_command(candidate.command, tmp_path / "next.command.csv")
        read = read_command(tmp_path / "next.command.csv")
        assert np.abs(read.time - candidate.command.time).max() < 1e-6
        assert np.abs(read.angle - candidate.command.angle).max() < 1e-8
