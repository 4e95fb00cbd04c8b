import av
import numpy as np
import pytest

from synth.clip import clip_writer
from synth.clock import timetable
from synth.spec import Camera, Effects

SEED = np.random.SeedSequence(3)


def table(duration: float = 4.0, effects: dict | None = None, **camera):
    return timetable(Camera.model_validate(camera), Effects.model_validate(effects or {}), duration, SEED)


@pytest.mark.parametrize("fps", [15.0, 29.97, 30.0, 60.0, 120.0])
def test_a_good_camera_takes_frames_at_their_time_stamps(fps):
    good = table(fps=fps)
    np.testing.assert_allclose(good.times, good.taken, atol=1e-12)
    assert len(good.taken) == round(4 * fps)


def test_a_fast_clock_shows_a_second_before_a_second_has_passed():
    fast = table(effects={"clock_scale": {"scale": 1.02}})
    np.testing.assert_allclose(fast.times, 1.02 * fast.taken, atol=1e-12)
    np.testing.assert_allclose(np.diff(fast.times), 1 / 30, atol=1e-12)


def test_a_wrong_declared_rate_stretches_the_clip():
    wrong = table(fps=30.0, declared_fps=25.0)
    np.testing.assert_allclose(wrong.times, 1.2 * wrong.taken, atol=1e-12)


def test_a_dropped_frame_leaves_a_gap_and_a_duplicate_keeps_the_true_time_of_the_repeated_picture():
    bad = table(duration=40.0, dropped=0.1, duplicated=0.05)
    assert len(bad.taken) == pytest.approx(0.9 * 1200, abs=4 * np.sqrt(1200 * 0.09))
    assert bad.repeats.mean() == pytest.approx(0.05, abs=0.025)
    assert not bad.repeats[0]
    own = ~bad.repeats
    np.testing.assert_allclose(bad.times[own], bad.taken[own], atol=1e-12)
    for frame in np.flatnonzero(bad.repeats):
        assert bad.taken[frame] == bad.taken[frame - 1]
    assert set(np.round(np.diff(bad.times) * 30)) >= {1.0, 2.0}


def test_variable_intervals_stay_within_their_bounds_and_time_increases():
    uneven = table(interval_jitter=0.4, container="mp4", codec="h264")
    gaps = np.diff(uneven.taken) * 30
    assert gaps.min() >= 0.6
    assert gaps.max() <= 1.4
    assert gaps.std() == pytest.approx(0.8 / np.sqrt(12), rel=0.15)
    np.testing.assert_allclose(uneven.times, uneven.taken, atol=1 / 90_000)


COMBINATIONS = [
    ("mjpeg", "avi"), ("mjpeg", "mp4"), ("mjpeg", "mkv"), ("ffv1", "avi"), ("ffv1", "mkv"), ("h264", "avi"),
    ("h264", "mp4"), ("h264", "mkv"),
]  # fmt: skip


@pytest.mark.parametrize(("codec", "container"), COMBINATIONS)
@pytest.mark.parametrize(
    "trouble", [{}, {"fps": 29.97}, {"dropped": 0.2, "duplicated": 0.2}, {"declared_fps": 25}, {"interval_jitter": 0.4}]
)
def test_a_files_time_stamps_are_those_of_the_timetable(tmp_path, codec, container, trouble):
    if container == "avi" and ("interval_jitter" in trouble or (codec == "h264" and "dropped" in trouble)):
        return  # refused by the spec: AVI cannot represent it
    camera = Camera.model_validate({"size": [96, 64], "codec": codec, "container": container, **trouble})
    planned = timetable(camera, Effects(), 1.0, SEED)
    path = tmp_path / f"clip.{container}"
    picture = np.random.default_rng(0).integers(0, 255, (64, 96, 3), dtype=np.uint8)
    with clip_writer(path, camera, planned) as write:
        for _ in planned.stamps:
            write(picture)
    with av.open(str(path)) as clip:
        # the decoder's own stamps: for H.264 in AVI libavformat invents presentation times one frame too late
        said = [float((f.dts if (codec, container) == ("h264", "avi") else f.pts) * f.time_base) for f in clip.decode()]
    np.testing.assert_allclose(said, planned.times, atol=1e-9)


def test_avi_refuses_a_variable_rate():
    with pytest.raises(ValueError, match="fixed frame rate"):
        Camera(interval_jitter=0.2)
