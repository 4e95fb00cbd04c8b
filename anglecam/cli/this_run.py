"""How this command was called, for the pages that it writes."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from anglecam.report.origin import Run


def this_run(rig: Path | None = None) -> Run:
    """Return the command line and the time of this run; ``rig`` is the rig file that it names."""
    from anglecam.report.origin import Run, now

    return Run(shlex.join(["anglecam", *sys.argv[1:]]), now(), rig)
