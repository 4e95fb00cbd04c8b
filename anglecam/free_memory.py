"""Memory that this process can still get."""

from __future__ import annotations

from pathlib import Path

import psutil


def free_memory() -> int:
    """Return what the machine and, on Linux, the control group leave, bytes."""
    left = int(psutil.virtual_memory().available)
    group = Path("/sys/fs/cgroup")
    limit, used = group / "memory.max", group / "memory.current"
    if limit.exists() and used.exists() and (text := limit.read_text(encoding="ascii").strip()) != "max":
        left = min(left, int(text) - int(used.read_text(encoding="ascii")))
    return left
