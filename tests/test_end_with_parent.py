"""A measuring process ends with its parent, even while a library holds the interpreter lock."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from anglecam import end_with_parent
from support.tiny import is_alive

HOLDS_THE_LOCK = """
import ctypes, os, sys, threading
from anglecam.end_with_parent import end_with_parent
end_with_parent(int(sys.argv[1]))
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()
print(os.getpid(), flush=True)
ctypes.PyDLL(None).sleep(60)  # called without releasing the lock
"""
PARENT = f"""
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", {HOLDS_THE_LOCK!r}, str(os.getpid())], stdin=subprocess.PIPE)
time.sleep(60)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a signal for it")
def test_a_process_that_holds_the_interpreter_lock_ends_when_its_parent_is_killed():
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True) as parent:
        below = int(parent.stdout.readline())
        assert is_alive(below)
        parent.kill()
        parent.wait()
        until = time.monotonic() + 5.0
        while is_alive(below) and time.monotonic() < until:
            time.sleep(0.01)
        ended = not is_alive(below)
        if not ended:
            os.kill(below, signal.SIGKILL)
        assert ended


def test_a_process_whose_parent_ended_before_it_could_ask_ends_before_it_loads_anything():
    command = [sys.executable, "-P", "-X", "importtime", end_with_parent.__file__, "1", "anglecam"]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.returncode == 1
    assert "ctypes" in found.stderr
    assert "anglecam" not in found.stderr
