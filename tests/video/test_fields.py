"""Interlaced films: of the two instants in a picture the first is shown, at the frame's time."""

from __future__ import annotations

import av
import numpy as np
import pytest

from anglecam.io.rig import Rig, RigMark, RigPivot
from anglecam.measurement.clip import measure_clip
from anglecam.video.fields import fill_rows
from anglecam.video.open_film import open_film
from support import things
from support.encoded import encode

DECLARED = Rig(mouth=RigMark(rgb=(200, 40, 40)), pivot=RigPivot(at=(120.0, 20.0), sigma_px=0.1))


def _planes(field: np.ndarray) -> list[np.ndarray]:
    """Return a field's planes in YUV 4:2:0."""
    height, width = field.shape[:2]
    stacked = av.VideoFrame.from_ndarray(np.ascontiguousarray(field), format="bgr24").to_ndarray(format="yuv420p")
    u, v = stacked[height:].reshape(2, height // 2, width // 2)
    return [stacked[:height], u, v]


def _woven(first: np.ndarray, second: np.ndarray, bottom_first: bool) -> np.ndarray:
    """Return a picture in YUV 4:2:0 whose lines belong to two instants in turn, as an interlaced camera makes it."""
    top, bottom = (second, first) if bottom_first else (first, second)
    planes = []
    for upper, lower in zip(_planes(top[0::2]), _planes(bottom[1::2]), strict=True):
        plane = np.empty((2 * len(upper), upper.shape[1]), np.uint8)
        plane[0::2], plane[1::2] = upper, lower
        planes.append(plane)
    return np.concatenate([plane.reshape(-1, first.shape[1]) for plane in planes])


@pytest.mark.parametrize(
    ("bottom_first", "rig"),
    [
        pytest.param(False, DECLARED, id="top field first, declared", marks=pytest.mark.sweep),
        pytest.param(True, Rig(), id="bottom field first, nothing declared"),
        pytest.param(True, DECLARED, id="bottom field first, declared", marks=pytest.mark.sweep),
        pytest.param(False, Rig(), id="top field first, nothing declared", marks=pytest.mark.sweep),
    ],
)
def test_an_interlaced_film_gives_the_angles_of_its_first_fields(tmp_path, monkeypatch, bottom_first, rig):
    monkeypatch.setattr(things, "SIZE", (240, 200))
    angles = 20.0 * np.sin(np.arange(80) / 10.0)  # 60 fields a second
    drawn = things.film(tmp_path / "fields.mkv", things.ball((200, 40, 40), 9.0, (120.0, 20.0), 140.0), angles)
    fields = [frame.image for frame in open_film(drawn).frames()]
    pictures = [_woven(*pair, bottom_first) for pair in zip(fields[0::2], fields[1::2], strict=True)]
    order = "bff=1" if bottom_first else "tff=1"
    options = {"qp": "16", "threads": "1", "x264-params": order}  # with rate control every file is another one
    film = open_film(encode(tmp_path / "dv.mp4", pictures, options=options, interlaced=True))
    assert film.bottom_first == bottom_first
    assert film.interlaced == 40
    measured = measure_clip(film, rig)
    assert any("40 frames are interlaced" in note for note in measured.notes)
    series = measured.series
    assert series.ok.all()
    np.testing.assert_allclose(series.time, np.arange(40) / 30.0, atol=1e-9)
    off = np.degrees(series.angle) - angles[0::2]
    sigma = np.degrees(np.median(series.sigma))  # where the pivot is not declared, it is most of it
    assert np.std(off) < sigma < (0.1 if rig is DECLARED else 0.4)  # half a frame later the angle is up to 2° different
    assert np.std(np.degrees(series.angle) - angles[1::2]) > 1.0


@pytest.mark.parametrize("bottom_first", [False, True])
@pytest.mark.parametrize("height", [48, 47])
def test_a_smooth_picture_is_restored_from_its_field(bottom_first, height):
    y, x = np.mgrid[:height, :64]
    smooth = (128 + 60 * np.sin(y / 5.0) * np.cos(x / 6.0)).round().astype(np.uint8)[..., None].repeat(3, axis=2)
    first = int(bottom_first)
    filled = fill_rows(smooth[first::2], height, bottom_first)
    np.testing.assert_array_equal(filled[first::2], smooth[first::2])
    assert np.abs(filled[4:-4].astype(int) - smooth[4:-4]).max() <= 2
    assert np.abs(filled.astype(int) - smooth).max() <= 14  # at the edge there are no lines beyond
