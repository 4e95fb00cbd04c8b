import math

import numpy as np
import pytest

from synth.exposure import Shutter
from synth.sensor import develop, flicker
from synth.shake import unrest
from synth.spec import Camera, Effects

SHAPE = (200, 300, 3)


def developed(level: float, gain: float = 1.0, **camera) -> np.ndarray:
    light = np.full(SHAPE, level / 255, dtype=np.float32)
    picture = develop(light, Camera.model_validate(camera), np.array([gain]), np.random.default_rng(1))
    assert picture.dtype == np.uint8
    return picture.astype(float)


def test_an_ideal_sensor_gives_the_grey_levels_of_the_light():
    assert (developed(117.0, noise_grey=0.0) == 117).all()


def test_read_noise_has_the_specified_standard_deviation_and_no_bias():
    picture = developed(117.3, noise_grey=2.0)
    # rounding adds a variance of 1/12 grey level squared
    assert picture.std() == pytest.approx(math.sqrt(4 + 1 / 12), rel=0.01)
    assert picture.mean() == pytest.approx(117.3, abs=0.02)


@pytest.mark.parametrize("level", [30.0, 200.0])
def test_shot_noise_is_the_poisson_noise_of_the_electrons(level):
    electrons = 2000.0
    picture = developed(level, noise_grey=1.0, electrons_at_white=electrons)
    counted = electrons * level / 255
    expected = math.sqrt((math.sqrt(counted) * 255 / electrons) ** 2 + 1 + 1 / 12)
    assert picture.std() == pytest.approx(expected, rel=0.015)


def test_gamma_brightens_half_the_light_to_more_than_half_the_grey():
    assert developed(127.5, noise_grey=0.0, gamma=2.2)[0, 0, 0] == round(255 * 0.5 ** (1 / 2.2))


def test_the_corners_lose_the_stated_share():
    picture = developed(200.0, noise_grey=0.0, vignetting=0.4)
    assert picture[0, 0, 0] == 120
    assert picture[100, 150, 0] == 200


def test_focus_blur_spreads_a_point_by_its_standard_deviation():
    light = np.zeros((61, 61, 3), dtype=np.float32)
    light[30, 30] = 20.0  # far above white, so that rounding is negligible
    camera = Camera(noise_grey=0.0, focus_blur_px=2.0)
    picture = develop(light, camera, np.ones(1), np.random.default_rng(0)).astype(float)[..., 0]
    x = np.arange(61) - 30
    assert math.sqrt((picture.sum(axis=0) * x**2).sum() / picture.sum()) == pytest.approx(2.0, rel=0.02)


def test_flicker_is_averaged_over_the_exposure_and_differs_from_row_to_row():
    camera = Camera.model_validate({"flicker": {"share": 0.1, "frequency_hz": 100.0}})
    rolling = flicker(camera, Shutter(0.0, 5e-5, 480), 0.0)
    assert np.ptp(rolling) == pytest.approx(0.2, rel=1e-3)
    whole_periods = flicker(camera, Shutter(0.02, 0.0, 480), 0.0013)
    np.testing.assert_allclose(whole_periods, 1.0, atol=1e-12)
    assert flicker(camera, Shutter(0.0, 0.0, 480), 0.0025)[0] == pytest.approx(1.1)


def test_vibration_has_its_standard_deviation_and_band_and_is_smooth():
    camera = Camera.model_validate({"shake": {"rms_px": 2.0, "frequency_hz": 5.0}})
    times = np.arange(0, 200, 0.01)
    moved = np.concatenate(
        [unrest(camera, Effects(), np.random.SeedSequence(seed)).shift(times) for seed in range(5)], axis=1
    )
    assert moved.std() == pytest.approx(2.0, rel=0.03)
    power = np.abs(np.fft.rfft(moved, axis=0)) ** 2
    above = np.fft.rfftfreq(len(times), 0.01) > 5.5
    assert power[above].sum() < 0.001 * power.sum()


def test_a_camera_that_stands_still_does_not_move():
    still = unrest(Camera(), Effects(), np.random.SeedSequence(0))
    assert (still.shift([0.0, 1.0]) == 0).all()
    assert (still.roll([0.0, 1.0]) == 0).all()


def test_angle_drift_turns_the_picture_at_its_rate():
    sagging = unrest(
        Camera(), Effects.model_validate({"angle_drift": {"rate_deg_per_s": 0.2}}), np.random.SeedSequence(0)
    )
    assert np.degrees(sagging.roll([3.0]))[0] == pytest.approx(0.6)
