"""The page for each verdict: it holds the sentence, the figures and the numbers of ``loop.json``."""

from __future__ import annotations

from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from anglecam.identify import identify_records
from anglecam.loop.close import close_records
from anglecam.loop.result import sentence
from anglecam.report.page import write_report
from anglecam.rig import Rig
from anglecam.series import AngleSeries
from support.motion import Plant
from support.series import session


def _shaken(record):
    return replace(record, angle=record.angle + np.radians(0.4) * np.sin(8.0 * record.time))


@pytest.mark.parametrize(
    ("plant", "change", "verdict", "svgs"),
    [
        (Plant(quadratic_drag=2.0), lambda r: r, "attributed", 5),
        (Plant(), lambda r: r, "nothing_missing", 4),
        (Plant(), _shaken, "unexplained", 5),
    ],
)
def test_the_page_tells_the_verdict(tmp_path, plant, change, verdict, svgs):
    records = [change(r) for r in session(plant, 21)]
    found = close_records(records, held_out=["random"])
    assert found.verdict == verdict
    series = [AngleSeries(r.name, r.time, r.angle, r.sigma, ("ok",) * len(r.time)) for r in records]
    model = identify_records(found.fitted, Rig(), "oe2", held_out=found.held_out)
    write_report(tmp_path / "report.html", "a <b> & c", found, series, [model], [])
    page = unescape((tmp_path / "report.html").read_text())
    assert page.count("<svg") == svgs
    assert f"{np.degrees(found.before_held_out.rmse):.4f}" in page
    assert sentence(found) in page
    assert "a <b> & c" in page
    assert "a <b>" not in (tmp_path / "report.html").read_text()  # a session's name is text, not markup
