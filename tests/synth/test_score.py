import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from synth.errors import SpecError
from synth.score import score, score_clip
from synth.spec import read_spec
from synth.take import perform, view
from synth.truth import write_facts, write_take

SPEC = """
effects: {coulomb_friction: {torque: 2.0}}
recordings:
  - {name: one, duration_s: 1.0, command: {kind: step}}
  - {name: two, duration_s: 1.0, command: {kind: free, initial_angle_deg: 8}}
"""


@pytest.fixture
def truth(tmp_path):
    path = tmp_path / "spec.yaml"
    path.write_text(SPEC)
    spec = read_spec(path)
    seen = view(spec)
    folder = tmp_path / "truth"
    folder.mkdir()
    for take in perform(spec, seen):
        write_take(folder, seen, take, [""] * len(take.table.stamps))
    write_facts(folder, spec, seen, {})
    return folder


def write_angles(result: Path, truth: Path, name: str, error: np.ndarray, lost: set[int] = frozenset()) -> Path:
    """Write angles with a known error and lost rows."""
    true = np.genfromtxt(truth / f"{name}.truth.csv", delimiter=",", names=True)
    rows = ["frame,time_s,angle_deg,status"]
    for k, angle in enumerate(true["angle_deg"] + error):
        rows.append(f"{k},{true['time_s'][k]},,no_mouth" if k in lost else f"{k},{true['time_s'][k]},{angle},ok")
    path = result / f"{name}.angles.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_the_error_of_a_clip_is_its_rms_over_the_frames_that_are_ok(truth, tmp_path):
    path = write_angles(tmp_path, truth, "one", np.tile([0.03, -0.03], 15), lost={4, 5})
    scored = score_clip(path, truth / "one.truth.csv", has_command=True)
    assert (scored.name, scored.ok, scored.frames) == ("one", 28, 30)
    assert scored.rms_deg == pytest.approx(0.03)


def test_the_median_is_subtracted_only_without_a_command(truth, tmp_path):
    shifted = np.full(30, 1.5)
    free = score_clip(write_angles(tmp_path, truth, "two", shifted), truth / "two.truth.csv", has_command=False)
    assert free.rms_deg == pytest.approx(0.0, abs=1e-9)
    assert free.offset_deg == pytest.approx(1.5)
    commanded = score_clip(write_angles(tmp_path, truth, "one", shifted), truth / "one.truth.csv", has_command=True)
    assert commanded.rms_deg == pytest.approx(1.5)


def test_every_result_is_printed_with_its_truth(truth, tmp_path):
    result = tmp_path / "result"
    result.mkdir()
    write_angles(result, truth, "one", np.full(30, 0.01))
    model = {"a_per_s": {"value": 27.3, "sigma": 0.1}, "b_per_s2": {"value": 524.0}, "c_per_s2": {"value": 508.0}}
    loop = {
        "verdict": "attributed",
        "effects": [{"id": "coulomb_friction", "parameters": {"friction_deg_per_s2": {"value": 114.6, "sigma": 1.0}}}],
        "rmse_deg": {"before": {"fit": 0.5, "held_out": 0.75}, "after": {"fit": 0.01, "held_out": 0.02}},
        "model": model,
    }
    (result / "loop.json").write_text(json.dumps(loop))
    (result / "ekf.json").write_text(json.dumps({"estimator": "ekf", "parameters": model}))
    (result / "report.html").write_text("")
    text = io.StringIO()
    score(result, truth, Console(file=text, width=160))
    for said in ("0.0100", "30/30", "+5.0 %", "torque 2", "friction 2 ± 0.017", "0.7500", "0.0200", "report.html"):
        assert said in text.getvalue()


def test_a_folder_without_results_or_without_truth_is_an_error(truth, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(SpecError, match="neither"):
        score(tmp_path / "empty", truth, Console(file=io.StringIO()))
    with pytest.raises(SpecError, match=r"no truth\.json"):
        score(truth, tmp_path / "empty", Console(file=io.StringIO()))
