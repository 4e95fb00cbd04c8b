"""A plate before a camera that rolls: what is not known of the roll is in its sigma."""

from __future__ import annotations

import numpy as np

from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from benchmarks.hostile import turning
from benchmarks.hostile.draw import write


def test_the_error_of_the_camera_s_roll_is_in_sigma(tmp_path):
    film = next(film for film in turning.films() if film.name == "rolls-plate-red")
    measured = measure_clip(open_film(write(film, tmp_path)), Rig())
    error = np.degrees(measured.series.angle) - film.angle_deg
    error -= np.median(error)
    assert np.sqrt((error**2).mean()) < 0.1
    assert 0.7 < np.sqrt(((error / np.degrees(measured.series.sigma)) ** 2).mean()) < 2.0  # 3.0 without the roll's
