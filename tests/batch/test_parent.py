"""A measuring process ends with its parent, even while a library holds the interpreter lock."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

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
        child = int(parent.stdout.readline())
        assert is_alive(child)
        parent.kill()
        parent.wait()
        until = time.monotonic() + 5.0
        while is_alive(child) and time.monotonic() < until:
            time.sleep(0.01)
        ended = not is_alive(child)
        if not ended:
            os.kill(child, signal.SIGKILL)
        assert ended


def test_a_process_whose_parent_ended_before_it_could_ask_ends_at_once():
    program = (
        "import sys; from anglecam.end_with_parent import end_with_parent; end_with_parent(int(sys.argv[1])); print(1)"
    )
    found = subprocess.run([sys.executable, "-c", program, "1"], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout) == (1, "")
