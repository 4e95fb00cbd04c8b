"""What the picture shows is taken for the loop only where the camera, and not its noise, stands between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.series import AngleSeries
from anglecam.measurement.uncorrected import uncorrected

TIME = np.arange(240) / 30.0
ANGLE = np.radians(14.0) * np.sin(2.0 * TIME) * np.cos(0.7 * TIME)
PIVOT, LEVER = np.array([240.0, 300.0]), 200.0


def filmed(mark, *, facing=1.0, shown=lambda line: line, noise_px=0.01):
    line = np.radians(-0.6) + ANGLE
    seen = shown(line)
    arm = LEVER * np.column_stack([facing * np.cos(seen), -np.sin(seen)])
    mouth = PIVOT + arm + np.random.default_rng(0).normal(0.0, noise_px, (len(TIME), 2))
    return AngleSeries(
        name="one",
        time=TIME,
        angle=ANGLE,
        sigma=np.full(len(TIME), 1e-5),
        status=("ok",) * len(TIME),
        line=line,
        mark_px=mouth,
        pivot_px=np.broadcast_to(PIVOT, mouth.shape),
        evidence=CameraEvidence(marker_px=tuple(PIVOT + mark)),
    )


@pytest.mark.parametrize("facing", [1.0, -1.0])
def test_a_mark_beside_the_axis_is_shown_to_the_loop_as_that_alone(facing):
    series, differs = uncorrected([filmed((6.0, -4.0), facing=facing)])
    assert differs
    assert series[0].evidence.only_pivot_differs
    arm = LEVER * np.column_stack([facing * np.cos(series[0].line), -np.sin(series[0].line)])
    assert np.median(np.hypot(*arm.T)) == pytest.approx(LEVER)
    ahead, up = facing * 6.0 / LEVER, 4.0 / LEVER
    line = np.radians(-0.6) + ANGLE
    expected = np.arctan2(np.sin(line) - up, np.cos(line) - ahead)
    assert np.std(series[0].line - expected) == pytest.approx(0.01 / LEVER, rel=0.2)
    assert series[0].sigma[0] == pytest.approx(0.01 / LEVER, rel=0.2)


def test_a_bent_view_is_not_taken_for_a_mark_beside_the_axis():
    series, differs = uncorrected([filmed((0.0, 0.0), shown=lambda line: line + 0.2 * line**2)])
    assert differs
    assert series[0].evidence.only_pivot_differs is False


def test_where_it_cannot_be_said_whether_more_than_the_mark_is_beside_nothing_is_said():
    barely = filmed((6.0, -4.0), shown=lambda line: line + 0.0075 * line**2)
    series, differs = uncorrected([barely])
    assert differs
    assert series[0].evidence.only_pivot_differs is None


def test_an_angle_read_off_the_mouth_does_not_tell_what_else_than_the_pivot_may_be_wrong():
    bent = filmed((6.0, -4.0), shown=lambda line: line + 0.2 * line**2)
    arm = bent.mark_px - PIVOT
    evidence = replace(bent.evidence, from_mark=True)
    line = np.arctan2(-arm[:, 1], arm[:, 0])
    alone = replace(bent, line=line, evidence=evidence, sigma=np.full(len(TIME), 5e-5))
    (shown,), differs = uncorrected([replace(alone, angle=alone.line - np.radians(-0.6))])
    assert differs
    assert shown.evidence.only_pivot_differs is None
    assert shown.sigma == pytest.approx(5e-5)
    for turn, slanted in (((0.3, 0.01), True), ((-0.3, 0.01), True), ((0.3, 0.1), False), ((0.04, 0.001), False)):
        (shown,), _ = uncorrected([replace(alone, evidence=replace(evidence, outline_turn=turn))])
        assert (shown.evidence.only_pivot_differs is False) == slanted


def test_noise_however_large_is_no_difference():
    one = filmed((0.0, 0.0), noise_px=0.5)
    series, differs = uncorrected([one])
    assert not differs
    assert series[0] is one


def test_a_series_without_a_mark_stays_as_it_is():
    one = AngleSeries("one", TIME, ANGLE, np.full(len(TIME), np.nan), ("ok",) * len(TIME))
    assert uncorrected([one]) == ([one], False)
