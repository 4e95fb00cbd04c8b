import numpy as np
import pytest

from synth.exposure import Shutter, instants


@pytest.mark.parametrize(("exposure", "row_time"), [(0.02, 0.0), (0.02, 3e-5), (0.001, 5e-5), (0.0, 5e-5)])
@pytest.mark.parametrize("steps", [1, 3, 40])
def test_weights_sum_to_1_and_preserve_every_rows_mean_time(exposure, row_time, steps):
    shutter = Shutter(exposure, row_time, 480)
    planned = instants(shutter, 1.7, path_px=float(steps), step_px=1.0)
    np.testing.assert_allclose(planned.weights.sum(axis=0), 1.0, atol=1e-12)
    mean = planned.weights.T @ planned.times
    np.testing.assert_allclose(mean, shutter.row_times(1.7), atol=1e-12)
    assert (planned.weights >= 0).all()


def test_a_still_mark_needs_one_instant_and_a_moving_mark_needs_them_in_proportion_to_its_path():
    shutter = Shutter(0.02, 0.0, 480)
    assert len(instants(shutter, 0.0, 0.09, 0.5).times) == 1
    assert len(instants(shutter, 0.0, 0.11, 0.5).times) == 2
    assert len(instants(shutter, 0.0, 10.0, 0.5).times) == 21


def test_the_blur_of_uniform_motion_is_as_wide_as_the_exposure():
    shutter = Shutter(0.02, 0.0, 480)
    planned = instants(shutter, 0.0, path_px=12.0, step_px=0.25)
    spread = (planned.weights[:, 0] * planned.times**2).sum()
    assert spread == pytest.approx(0.02**2 / 12, rel=1e-3)


def test_only_the_middle_row_of_a_rolling_shutter_is_open_at_the_frames_time():
    rows = Shutter(0.0, 5e-5, 481).row_times(2.0)
    assert rows[240] == pytest.approx(2.0)
    assert rows[480] - rows[0] == pytest.approx(480 * 5e-5)
