"""What is made beside a verdict: a part that fails is reported as missing with its cause, and costs nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def attempt(name: str, make: Callable[[], T], missing: list[str]) -> T | None:
    """Make one part; note it as missing if that fails.

    Parameters
    ----------
    name : str
        The part, as the user knows it.
    make : callable
        Makes and returns it.
    missing : list of str
        Gets one line if the part fails.

    Returns
    -------
    object or None
        What ``make`` returned.

    Raises
    ------
    OSError
        If a file cannot be written: then nothing else can be, either.
    """
    try:
        return make()
    except OSError:
        raise
    except Exception as fault:  # noqa: BLE001  # whatever fails beside a verdict must not cost the verdict
        missing.append(f"{name}: missing ({type(fault).__name__}: {fault})")
        return None
