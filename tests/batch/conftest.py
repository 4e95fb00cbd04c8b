"""The command in the test's process, and measured there."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest

from anglecam.cli.app import main
from support.measured_here import run_batch


@pytest.fixture(scope="module")
def measured_here() -> Iterator[None]:
    """Let the commands of a test file that run in the test's process also measure there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.batch.run.run_batch", run_batch)
        yield


@pytest.fixture
def batch_here(
    measured_here: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return what runs the command in the test's process: its exit status and what it prints."""

    def call(*arguments: object) -> subprocess.CompletedProcess[str]:
        monkeypatch.setattr(sys, "argv", ["anglecam", "batch", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        said, errors = capfd.readouterr()
        code = ended.value.code
        assert code is None or isinstance(code, int)
        return subprocess.CompletedProcess(sys.argv, code or 0, said, errors)

    return call
