"""Which frames of a film a page shows."""

from __future__ import annotations

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.report.moments import choose_moments

N = 600
TIME = np.arange(N) / 30.0


def series(angle, status=None):
    return AngleSeries("a", TIME, angle, np.full(N, 1e-3), status or ("ok",) * N)


def reasons(moments):
    found = {}
    for moment in moments:
        for why in moment.why.split(", "):
            found.setdefault(why, []).append(moment.row)
    return found


def test_every_kind_of_moment_is_found_where_it_is():
    angle = np.sin(2.0 * np.pi * TIME / 4.0)  # extremes at 1 s, 3 s, …: frames 30, 90, …
    status = ["ok"] * N
    status[200:209] = ["occluded"] * 9
    angle[200:209] = np.nan
    residual = np.zeros(N)
    residual[[123, 456]] = -2.0, 1.0
    found = reasons(choose_moments(series(angle, tuple(status)), residual, "residual", [5.01], 60))
    assert found["no angle: occluded"] == [204]  # the middle of the run
    assert found["largest residual"] == [123, 456]
    assert found["the command changes"] == [151]  # the first frame after it
    assert found["turning point"] == list(range(30, N - 5, 60))
    assert sum(map(len, found.values())) == 60


def test_the_rest_is_evenly_spaced_and_holds_both_ends():
    moments = choose_moments(series(np.zeros(N)), None, "", [], 41)
    rows = [m.row for m in moments]
    assert (rows[0], rows[-1], len(rows)) == (0, N - 1, 41)
    assert np.diff(rows).max() <= 2 * np.diff(rows).min() + 1


def test_no_kind_takes_more_than_its_share_and_a_short_clip_is_shown_whole():
    noise = np.random.default_rng(0).normal(size=N)
    moments = choose_moments(series(noise), noise, "residual", TIME[::2].tolist(), 50)
    found = reasons(moments)
    assert len(moments) == 50
    assert all(len(found[why]) <= 10 for why in ("largest residual", "the command changes", "turning point"))
    assert len(found["evenly spaced"]) >= 20
    assert len(choose_moments(series(noise), noise, "residual", [], 2 * N)) == N


def test_a_frame_that_cannot_be_decoded_is_no_failure_to_show():
    status = ("undecodable",) * 3 + ("ok",) * (N - 3)
    angle = np.concatenate([np.full(3, np.nan), np.zeros(N - 3)])
    assert set(reasons(choose_moments(series(angle, status), None, "", [], 10))) == {"evenly spaced"}
