"""Verdicts that test processes share are those of a closing, and are not made twice."""

from __future__ import annotations

import pytest

from anglecam.effects import effect
from anglecam.loop.close import close_records
from anglecam.loop.verdict_json import verdict_as_dict
from support.closed import CANONICAL, ClosedSessions

NAME = "one recording"


def test_a_verdict_is_read_as_it_was_written_and_by_another_process_too(closed, monkeypatch):
    made = close_records(CANONICAL[NAME].records())
    assert verdict_as_dict(closed(NAME)) == verdict_as_dict(made)
    monkeypatch.setattr("support.closed.close_records", lambda *_, **__: pytest.fail("it is closed already"))
    again = ClosedSessions(closed.folder)(NAME)
    assert verdict_as_dict(again) == verdict_as_dict(made)
    assert [accepted.effect for accepted in again.accepted] == [effect("dead_time")]


def test_other_code_or_another_session_has_another_file(tmp_path, monkeypatch):
    files = set()
    monkeypatch.setattr("support.closed.close_records", lambda records, **options: len(records))
    for code in (b"one", b"other"):
        monkeypatch.setattr("support.closed._code", lambda code=code: code)
        for name in (NAME, "late"):
            ClosedSessions(tmp_path)(name)
            files |= set(tmp_path.glob("*.verdict"))
    assert len(files) == 4
