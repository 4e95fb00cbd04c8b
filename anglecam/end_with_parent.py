"""End a process when its parent ends, however the parent ends: by itself, by a crash, or by SIGKILL.

On Linux the kernel ends the process: `prctl(2)`, ``PR_SET_PDEATHSIG``. The signal arrives even while a library holds
Python's interpreter lock, as compilation and decoding do for seconds. Elsewhere the process ends when it reads the end
of its standard input, whose other end only the parent holds (see `anglecam.batch.serve`); it can then outlive
its parent by the time that such a library takes.

As a program, ``python end_with_parent.py PARENT MODULE`` makes this request and then runs a module. It is run by its
path and loads nothing of the package before: on a busy machine, these imports take seconds, during which the process
would outlive its parent.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1
"""Number of the request in ``linux/prctl.h``."""


def end_with_parent(parent: int) -> None:
    """Have the kernel end this process with the thread that started it, where the kernel can.

    Parameters
    ----------
    parent : int
        Process id of the parent. If it has ended already, this process ends at once.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))
    # it ended before the request; on Windows the parent may be a launcher in between, which says nothing
    if sys.platform != "win32" and os.getppid() != parent:
        os._exit(1)


if __name__ == "__main__":
    end_with_parent(int(sys.argv[1]))
    from runpy import run_module

    run_module(sys.argv[2], run_name="__main__")
