"""The error sources of a measured clip combine to its sigma, however the angles were measured."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from anglecam.budget.collect import error_sources
from anglecam.budget.terms import angle_draws, terms_over_time
from anglecam.io.command_csv import read_command
from anglecam.io.rig import read_rig
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.mark_pass import detect_mark
from anglecam.measurement.registration_pass import Registered, register_clip
from anglecam.video.open_film import open_film
from support.drawn import Look, Recording, draw_session

LOST = slice(5, None, 9)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = tmp_path_factory.mktemp("nod")
    clips = [Recording("stairs", "stairs", duration_s=2.0, amplitude_deg=12.0)]
    path = draw_session(folder, look=Look(facing="left"), recordings=clips, seed=4, mouth="declared")["stairs"].clip
    return path, read_rig(folder / "rig.yaml"), read_command(folder / "stairs.command.csv")


def _once(function):
    """Return a function that calls ``function`` once and then always returns the same result."""
    found = []

    def once(*arguments):
        if not found:
            found.append(function(*arguments))
        return found[0]

    return once


@pytest.fixture(scope="module")
def detected():
    """Detect the mark once for all tests of this file; it does not depend on command and neutral, which they vary."""
    return _once(detect_mark)


@pytest.fixture(scope="module")
def registered():
    """Register once for all tests of this file."""
    return _once(register_clip)


def _sometimes(found: Registered) -> Registered:
    turn, noise, pose, sensitivity = (x.copy() for x in (found.turn, found.noise, found.pose, found.pivot_sensitivity))
    turn[LOST] = noise[LOST] = pose[LOST] = np.nan
    sensitivity[LOST] = np.nan
    return replace(found, turn=turn, noise=noise, pose=pose, pivot_sensitivity=sensitivity)


@pytest.mark.parametrize(
    ("registration", "neutral"),
    [
        ("never", "rest"),
        pytest.param("never", "declared", marks=pytest.mark.sweep),
        pytest.param("always", "rest", marks=pytest.mark.sweep),
        ("always", "median"),
        ("sometimes", "declared"),
    ],
)
def test_a_measured_clips_terms_combine_to_its_sigma(clip, detected, registered, monkeypatch, registration, neutral):
    path, rig, command = clip
    readings = {
        "never": lambda *_: "not requested",
        "always": registered,
        "sometimes": lambda *arguments: _sometimes(registered(*arguments)),
    }
    monkeypatch.setattr(import_module("anglecam.measurement.followed"), "detect_mark", detected)
    monkeypatch.setattr(import_module("anglecam.measurement.followed"), "register_clip", readings[registration])
    if neutral == "declared":
        rig = rig.model_copy(update={"neutral": -12.0})
    measured = measure_clip(open_film(path), rig, command if neutral == "rest" else None)
    sources = error_sources(measured, rig)
    sigma = measured.series.sigma[measured.series.ok]
    combined = np.sqrt(sum(c.contribution**2 for c in terms_over_time(sources) if c.in_sigma))
    assert combined == pytest.approx(sigma, rel=1e-6)
    names = {c.name for c in terms_over_time(sources)}
    assert ("registration" in names) == (registration != "never")
    assert ("picture noise" in names) == (registration != "always")
    certain = replace(sources, noise_dof=np.inf, pose_dof=np.inf, pivot_dof=np.inf)
    for i in (5, int(np.argmax(np.abs(sources.angle)))):
        spread = np.std(angle_draws(certain, i)(np.random.default_rng(3), 200_000))
        assert spread == pytest.approx(sigma[i], rel=0.01)
