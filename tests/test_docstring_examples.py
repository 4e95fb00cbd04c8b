"""The examples in docstrings run and print what they state.

They find two names ready: ``clip``, a film of 60 frames in which a mark swings by ±8° about a marked pivot, and
``session``, a folder of two angle series with their commands, of a plant with a = 26 1/s, b = 524 1/s², c = 508 1/s².
"""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import numpy as np
import pytest

import anglecam
from support.drawn import Look, draw_frames, write_clip
from support.motion import Plant, Recording, command_rows, move

ROOT = Path(__file__).parents[1]
RATE_HZ = 30
NOISE_DEG = 0.05


def _modules_with_examples() -> list[str]:
    sources = sorted((ROOT / "anglecam").rglob("*.py"))
    paths = [path.relative_to(ROOT).with_suffix("") for path in sources if ">>> " in path.read_text()]
    return [".".join(path.parts[:-1] if path.name == "__init__" else path.parts) for path in paths]


def _public_face() -> dict[str, object]:
    named = {name: getattr(anglecam, name) for name in anglecam.__all__ if not name.startswith("__")}
    return {name: thing for name, thing in named.items() if not name.endswith("Error")}


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("examples")
    angles = 8.0 * np.sin(2.0 * np.pi * np.arange(60) / RATE_HZ)
    write_clip(folder / "clip.avi", draw_frames(Look(marker="ring", red_object=None), angles))
    session = folder / "session"
    session.mkdir()
    rng = np.random.default_rng(1)
    for kind in ("stairs", "chirp"):
        recording = Recording(kind, kind, duration_s=5.0)
        rows = command_rows(recording, rng)
        time = np.arange(0.0, recording.duration_s, 1.0 / RATE_HZ)
        angle = move(Plant(), recording, time, rows) + rng.normal(0.0, NOISE_DEG, len(time))
        for path, table, header in (
            (session / f"{kind}.command.csv", rows, "time_s,command_deg"),
            (session / f"{kind}.angles.csv", np.column_stack([time, angle]), "time_s,angle_deg"),
        ):
            np.savetxt(path, table, "%.6f", ",", header=header, comments="")
    return {"clip": str(folder / "clip.avi"), "session": str(session)}


_WHOLE_WAY = "anglecam.api"  # `test_hidden_backlash` of `tests/test_tutorials.py` goes it by the command line


@pytest.mark.parametrize(
    "module_name",
    [pytest.param(name, marks=pytest.mark.sweep) if name == _WHOLE_WAY else name for name in _modules_with_examples()],
)
def test_examples_print_what_they_state(module_name: str, names: dict[str, str]) -> None:
    module = importlib.import_module(module_name)
    outcome = doctest.testmod(module, extraglobs=names, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert outcome.attempted > 0
    assert outcome.failed == 0


def test_every_function_of_the_public_face_has_an_example() -> None:
    functions = {n: t for n, t in _public_face().items() if callable(t) and not isinstance(t, type)}
    assert set(functions) == {"measure", "identify", "close_loop"}
    assert [name for name, function in functions.items() if ">>> " not in (function.__doc__ or "")] == []
