"""Memory that this process can still get."""

from __future__ import annotations

from pathlib import Path


def free_memory() -> int | None:
    """Return what the machine and the control group leave, bytes; ``None`` where the system does not tell."""
    left = []
    meminfo = Path("/proc/meminfo")
    if meminfo.exists():
        lines = dict(line.split(":", 1) for line in meminfo.read_text().splitlines())
        left.append(int(lines["MemAvailable"].split()[0]) * 1024)
    group = Path("/sys/fs/cgroup")
    limit, used = group / "memory.max", group / "memory.current"
    if limit.exists() and used.exists() and (text := limit.read_text().strip()) != "max":
        left.append(int(text) - int(used.read_text()))
    return min(left, default=None)
