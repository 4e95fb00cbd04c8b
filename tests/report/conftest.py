"""A verdict that several pages show."""

import pytest

from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict
from support.motion import Plant
from support.series import session


@pytest.fixture(scope="session")
def dragged() -> Verdict:
    """Return the verdict on steps, a triangle and random steps of a body with drag, none of them held out."""
    return close_records(session(Plant(quadratic_drag=2.0), 21)[::2])
