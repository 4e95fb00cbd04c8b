"""The lock on an output folder, on file systems with and without locks."""

from __future__ import annotations

import errno
import fcntl
import os
import re

import pytest

from anglecam.batch.lock import is_current, locked, start_run
from anglecam.batch.output_folder import OutputFolder
from anglecam.errors import RigError


def test_a_second_batch_is_refused_and_does_not_disturb_the_first(tmp_path):
    folder = OutputFolder(tmp_path)
    with locked(folder):
        run = start_run(folder)
        with pytest.raises(RigError, match=rf"another batch is at work there \(process {os.getpid()} on .*\)$"):
            locked(folder).__enter__()
        assert is_current(folder, run)
    assert not is_current(folder, run)


@pytest.mark.parametrize("code", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_refused_in_one_line(tmp_path, monkeypatch, code):
    def refuse(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", refuse)
    message = re.escape(f"--out {tmp_path}: cannot be locked ({os.strerror(code)})")
    with pytest.raises(RigError, match=f"^{message}$"):
        locked(OutputFolder(tmp_path)).__enter__()
    assert not list(tmp_path.glob(".anglecam/*run*"))
