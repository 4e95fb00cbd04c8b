"""The exposure time from the blur of a mark."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.check.blur import exposure_from_blur
from anglecam.workflow.clip import measure_source, open_source
from benchmarks.hostile.draw import Film, ball, plain, write

RATE, SIZE = 30.0, (240, 180)
TIME = np.arange(60) / RATE


def _swing_deg(time):
    return 30.0 * np.cos(2.0 * np.pi * 1.0 * time)


def _film(folder, exposure_s):
    shares = (np.arange(7) + 0.5) / 7 - 0.5

    def frame(t):
        pictures = []
        for angle in np.radians(_swing_deg(t + exposure_s * shares)) if exposure_s else [np.radians(_swing_deg(t))]:
            picture = plain(SIZE)
            ball(picture, (120.0, 20.0), 6, (35, 35, 40))
            ball(picture, (120.0 + 120.0 * np.sin(angle), 20.0 + 120.0 * np.cos(angle)), 9)
            pictures.append(picture)
        return np.mean(pictures, axis=0)

    return write(Film("swing", (frame(t) for t in TIME), times_s=TIME), folder)


@pytest.mark.parametrize("exposure_s", [pytest.param(0.012, marks=pytest.mark.sweep), 0.025])
def test_the_exposure_is_found_within_its_uncertainty(tmp_path, exposure_s):
    found = exposure_from_blur(measure_source(open_source(_film(tmp_path, exposure_s))))
    assert found is not None
    value, sigma = found
    assert abs(value - exposure_s) < 2.0 * sigma
    assert sigma < 0.25 * exposure_s


def test_a_sharp_film_has_no_exposure_to_state(tmp_path):
    found = exposure_from_blur(measure_source(open_source(_film(tmp_path, 0.0))))
    assert found is None or found[0] < 0.003
