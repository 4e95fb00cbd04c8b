"""A verdict that several pages show."""

import pytest

from anglecam.loop.verdict import Verdict
from support.closed import ClosedSessions


@pytest.fixture(scope="session")
def dragged(closed: ClosedSessions) -> Verdict:
    """Return the verdict on steps, a triangle and random steps of a body with drag, none of them held out."""
    return closed("dragging, none held out")
