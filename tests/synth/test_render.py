"""Detailed checks of small films: 320 × 240, a few frames."""

import hashlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import av
import numpy as np
import pytest
import yaml

from support.oracle import border, centroid, coverage
from synth.cli import main
from synth.draw.engine import make_engine
from synth.errors import SpecError
from synth.mechanism import Part, build, poses
from synth.render import Solo, Studio
from synth.session import render
from synth.spec import Render, Spec
from synth.take import marks, perform, view

SPEC = {
    "seed": 5,
    "effects": {"dead_time": {"tau_s": 0.0412}, "coulomb_friction": {"torque": 2.5}},
    "camera": {"size": [320, 240], "codec": "ffv1"},
    "rig": {"lever_px": 100, "pivot_px": [120.3, 149.6]},
    "declare": {"mouth": {"rgb": [190, 35, 40]}, "held_out": ["two"]},
    "recordings": [
        {"name": "one", "duration_s": 1.0, "command": {"kind": "step", "amplitude_deg": 15, "rest_s": 0.51}},
        {"name": "two", "duration_s": 0.7, "command": {"kind": "free", "initial_angle_deg": -10, "rest_s": 0.5}},
    ],
}


def write_spec(folder: Path, **changes) -> Path:
    path = folder / "spec.yaml"
    path.write_text(yaml.safe_dump({**SPEC, **changes}))
    return path


def read_clip(path: Path) -> tuple[np.ndarray, np.ndarray]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = list(container.decode(stream))
        times = [float(frame.pts * frame.time_base) for frame in frames]
        return np.array(times), np.stack([frame.to_ndarray(format="rgb24") for frame in frames])


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rendered")
    render(write_spec(folder), folder / "session", folder / "truth")
    return folder


def test_session_and_truth_contain_the_files_of_the_contract(rendered):
    assert {path.name for path in (rendered / "session").iterdir()} == {
        "rig.yaml", "one.avi", "one.command.csv", "two.avi",
    }  # fmt: skip
    assert {path.name for path in (rendered / "truth").iterdir()} == {
        "truth.json", "one.truth.csv", "two.truth.csv",
    }  # fmt: skip
    header = (rendered / "truth" / "one.truth.csv").read_text().splitlines()[0]
    assert header.startswith("frame,time_s,true_time_s,angle_deg,mouth_x_px,mouth_y_px,pivot_x_px,pivot_y_px,")
    assert (rendered / "session" / "one.command.csv").read_text().splitlines()[0] == "time_s,command_deg"
    assert yaml.safe_load((rendered / "session" / "rig.yaml").read_text()) == SPEC["declare"]
    facts = json.loads((rendered / "truth" / "truth.json").read_text())
    assert facts["seed"] == 5
    assert facts["effects"]["dead_time"] == {"tau_s": 0.0412}


def test_nothing_of_the_truth_reaches_the_session(rendered):
    for path in (rendered / "session").iterdir():
        content = path.read_bytes().lower()
        for secret in (b"dead_time", b"coulomb", b"torque", b"0.0412", b"seed", b"truth", b"effect", b"lavc", b"lavf"):
            # compressed pixels may contain short words by chance; the headers precede the first frame
            assert secret not in (content.split(b"movi")[0] if path.suffix == ".avi" else content)
    with av.open(str(rendered / "session" / "one.avi")) as container:
        assert container.metadata == {}
        assert container.streams.video[0].metadata == {}


def test_the_truth_records_every_frames_hash_and_the_edge_errors(rendered):
    _, frames = read_clip(rendered / "session" / "one.avi")
    rows = np.genfromtxt(rendered / "truth" / "one.truth.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert [hashlib.sha256(np.ascontiguousarray(frame)).hexdigest() for frame in frames] == list(rows["frame_sha256"])
    facts = json.loads((rendered / "truth" / "truth.json").read_text())
    assert 0 < facts["render"]["edge_error"]["half_plane_px"] < 0.01
    assert set(facts["versions"]) >= {"python", "anglecam", "numpy", "trimesh"}


def test_every_frame_is_in_the_file_at_its_time(rendered):
    for name, count in (("one", 30), ("two", 21)):
        times, frames = read_clip(rendered / "session" / f"{name}.avi")
        truth = np.genfromtxt(rendered / "truth" / f"{name}.truth.csv", delimiter=",", names=True)
        assert len(frames) == len(truth) == count
        np.testing.assert_allclose(times, truth["time_s"], atol=1e-8)
        np.testing.assert_allclose(times, np.arange(count) / 30, atol=1e-8)


def test_the_command_acts_late_by_the_hidden_delay_and_the_release_at_once(rendered):
    one = np.genfromtxt(rendered / "truth" / "one.truth.csv", delimiter=",", names=True)
    assert (one["angle_deg"][one["time_s"] < 0.51 + 0.0412] == 0).all()
    assert (one["angle_deg"][one["time_s"] > 0.51 + 0.0412] > 0).all()
    two = np.genfromtxt(rendered / "truth" / "two.truth.csv", delimiter=",", names=True)
    np.testing.assert_allclose(two["angle_deg"][:15], -10.0)
    assert two["angle_deg"][-1] > -10.0


def test_the_same_seed_gives_the_same_bytes_and_another_seed_different_noise(rendered, tmp_path):
    short = [{"name": "one", "duration_s": 0.3, "command": {"kind": "step", "amplitude_deg": 15, "rest_s": 0.51}}]
    frames = {}
    for name, seed in (("same", 5), ("other", 6)):
        (tmp_path / name).mkdir()
        path = write_spec(tmp_path / name, recordings=short, seed=seed)
        render(path, tmp_path / name / "session", tmp_path / name / "truth")
        frames[name] = read_clip(tmp_path / name / "session" / "one.avi")[1]
    first = read_clip(rendered / "session" / "one.avi")[1][: len(frames["same"])]
    np.testing.assert_array_equal(frames["same"], first)
    assert (frames["other"] != first).mean() > 0.5
    # a still head: only the noise changes from frame to frame
    assert np.std(first[1].astype(float) - first[0]) == pytest.approx(2.0 * np.sqrt(2), rel=0.03)


def marks_alone(spec: Spec) -> list[Part]:
    """Return the rig with bright lips and marker in separate colours, all else black: grey levels are areas."""
    shown = {"lips": [1e6, 0.0, 0.0], "marker": [0.0, 0.0, 1e6]}
    return [
        Part(part.name, part.body, part.mesh, np.zeros_like(part.colours) + shown.get(part.name, [0.0, 0.0, 0.0]))
        for part in build(spec)
    ]


@pytest.mark.parametrize(
    ("engine", "facing", "marker"),
    [
        ("raster", "right", "disc"),
        ("raster", "left", "ring"),
        pytest.param("pyrender", "left", "ring", marks=pytest.mark.sweep),
        pytest.param("pyrender", "right", "disc", marks=pytest.mark.sweep),
    ],
)
def test_the_picture_equals_the_analytic_oracles_and_the_truth_is_where_the_picture_shows_the_marks(
    engine, facing, marker
):
    spec = Spec.model_validate(
        {
            "camera": {"size": [320, 300]},
            "rig": {"lever_px": 150, "pivot_px": [150.3 if facing == "right" else 168.7, 170.6],
                    "facing": facing, "marker": marker},
            "recordings": [SPEC["recordings"][0]],
        }
    )  # fmt: skip
    seen = view(spec)
    (take,) = perform(spec, seen)
    parts = marks_alone(spec)
    lips = next(part.mesh for part in parts if part.name == "lips")
    with closing(make_engine(Render(engine=engine, quality="metrology"), parts, seen.pinhole, 1.0)) as stage:
        for frame in (0, 16, 20, 24, 28):  # the head is at rest up to the first of the others
            angle = float(take.motion.angle(take.table.taken[frame : frame + 1])[0])
            picture = stage.draw(seen.pinhole, poses(spec.rig, angle), slice(0, 300))
            picture = picture[:, ::-1] if facing == "left" else picture
            turned = lips.vertices[:, :2] @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
            scale = spec.rig.lever_px / np.hypot(*seen.mouth) * 1.5 / (1.5 - lips.vertices[:, 2])
            mirror = -1 if facing == "left" else 1
            shown = np.array(spec.rig.pivot_px) + turned * scale[:, None] * [mirror, -1]
            drawn = coverage(border(shown, lips.faces[:, ::mirror]), 320, 300)
            true = marks(seen, take)[frame]
            np.testing.assert_allclose(centroid(drawn), true[:2], atol=0.02)
            np.testing.assert_allclose(centroid(picture[..., 0]), true[:2], atol=0.02)
            np.testing.assert_allclose(centroid(picture[..., 2]), true[2:4], atol=0.02)
            assert np.sqrt(np.mean((picture[..., 0] - drawn)[(drawn > 0) & (drawn < 1)] ** 2)) < 0.02


def test_a_dead_worker_is_replaced_without_losing_frames_and_frames_do_not_depend_on_workers():
    spec = Spec.model_validate(SPEC)
    seen = view(spec)
    (take, _) = perform(spec, seen)
    frames = list(range(15))
    with Studio(spec, seen, 1) as studio:
        undisturbed = list(studio.film(take, frames))
        disturbed = []
        for frame in studio.film(take, frames):
            disturbed.append(frame)
            if len(disturbed) == 5:
                (worker,) = multiprocessing.active_children()
                worker.kill()
    np.testing.assert_array_equal(disturbed, undisturbed)
    with Solo(spec, seen) as solo:
        np.testing.assert_array_equal(list(solo.film(take, frames[::7])), undisturbed[::7])


def test_the_lips_are_as_red_as_declared(rendered):
    frame = read_clip(rendered / "session" / "one.avi")[1][0].astype(float)
    truth = np.genfromtxt(rendered / "truth" / "one.truth.csv", delimiter=",", names=True)[0]
    x, y = round(truth["mouth_x_px"]), round(truth["mouth_y_px"])
    np.testing.assert_allclose(frame[y - 3 : y + 4, x - 3 : x + 4].mean(axis=(0, 1)), [190, 35, 40], atol=20)


@pytest.mark.parametrize(("codec", "limit"), [("mjpeg", 2.0), ("h264", 8.0)])
def test_lossy_clips_keep_times_and_nearly_the_picture(rendered, tmp_path, codec, limit):
    short = [{**SPEC["recordings"][0], "duration_s": 0.4}]
    camera = {**SPEC["camera"], "codec": codec, "fps": 29.97}
    render(write_spec(tmp_path, recordings=short, camera=camera), tmp_path / "session", tmp_path / "truth")
    (clip,) = [path for path in (tmp_path / "session").iterdir() if path.stem == "one"]
    times, frames = read_clip(clip)
    np.testing.assert_allclose(times, np.arange(12) * 1001 / 30000, atol=1e-6)
    lossless = read_clip(rendered / "session" / "one.avi")[1][:12]
    assert np.abs(frames.astype(float) - lossless).mean() < limit


@pytest.mark.parametrize(("out", "truth"), [("same", "same"), ("session", "session/truth"), ("truth/session", "truth")])
def test_the_truth_must_not_be_in_the_sessions_folder(tmp_path, out, truth):
    with pytest.raises(SpecError, match="truth leaks"):
        render(write_spec(tmp_path), tmp_path / out, tmp_path / truth)


def test_a_session_does_not_mix_with_older_files(tmp_path):
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "old.avi").write_bytes(b"")
    with pytest.raises(SpecError, match=r"old\.avi"):
        render(write_spec(tmp_path), tmp_path / "session", tmp_path / "truth")


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"camera": {"fps": 0}}, "camera.fps"),
        ({"recordings": [{**SPEC["recordings"][1], "command": {"kind": "free", "initial_angle_deg": 40}}]},
         "recordings.0.command: the head would move"),
        ({"rig": {"lever_px": 400}}, "recordings.0.command: the mouth would leave"),
    ],
)  # fmt: skip
def test_a_bad_spec_ends_with_status_2_and_one_line(tmp_path, monkeypatch, capfd, changes, key):
    path = write_spec(tmp_path, **changes)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["synth", "render", str(path), "--out", "o", "--truth", "t"])
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # the test process keeps its signal handlers
    with pytest.raises(SystemExit) as ended:
        main()
    told = capfd.readouterr().err
    assert ended.value.code == 2
    assert key in told
    assert len(told.splitlines()) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"spec.yaml"}


def call(spec: Path, folder: Path, **environment: str) -> subprocess.Popen:
    command = [str(Path(sys.executable).with_name("synth")), "render", str(spec)]
    command += ["--out", str(folder / "session"), "--truth", str(folder / "truth")]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment})


def test_h264_gives_the_same_bytes_whatever_the_memory_contains(tmp_path):
    short = [{"name": "one", "duration_s": 0.7, "command": {"kind": "free", "rest_s": 0.5}}]
    camera = {"size": [160, 128], "codec": "h264"}
    path = write_spec(tmp_path, recordings=short, camera=camera, rig={"lever_px": 50, "pivot_px": [60, 80]})
    with call(path, tmp_path / "filled", MALLOC_PERTURB_="165") as rendering:
        render(path, tmp_path / "here" / "session", tmp_path / "here" / "truth")
        assert rendering.wait(60) == 0
    one, other = ((tmp_path / where / "session" / "one.mp4").read_bytes() for where in ("filled", "here"))
    assert one == other


def test_pyrender_makes_films_too_and_records_its_edge_errors(tmp_path):
    short = [{**SPEC["recordings"][0], "duration_s": 0.2}]
    render_spec = {"engine": "pyrender", "quality": "standard"}
    render(write_spec(tmp_path, recordings=short, render=render_spec), tmp_path / "session", tmp_path / "truth")
    _, frames = read_clip(tmp_path / "session" / "one.avi")
    assert frames.shape == (6, 240, 320, 3)
    facts = json.loads((tmp_path / "truth" / "truth.json").read_text())
    assert 0.001 < facts["render"]["edge_error"]["half_plane_px"] < 0.1


@pytest.mark.parametrize("blow", [pytest.param(signal.SIGTERM, marks=pytest.mark.sweep), signal.SIGKILL])
def test_ending_the_command_ends_its_workers(tmp_path, blow):
    long = [{**SPEC["recordings"][0], "duration_s": 8.0}]
    with call(write_spec(tmp_path, recordings=long), tmp_path) as rendering:
        while not list((tmp_path).glob("session/.unfinished-*")):
            assert rendering.poll() is None
            time.sleep(0.1)
        rendering.send_signal(blow)
        # workers hold the other end of the pipe: it closes when the last worker ends
        rendering.communicate(timeout=120)
    assert not (tmp_path / "session" / "one.avi").exists()
