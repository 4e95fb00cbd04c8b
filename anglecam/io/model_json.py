"""Find and read the file of a model: ``loop.json`` or ``model.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from anglecam.errors import InputError
from anglecam.io.files import read_json

LOOP, MODEL = "loop.json", "model.json"


def model_file(path: Path) -> Path:
    """Return the file of a model: ``path``, or in a folder its ``loop.json``, otherwise its ``model.json``.

    Raises
    ------
    InputError
        If the folder has neither.
    """
    if not path.is_dir():
        return path
    for name in (LOOP, MODEL):
        if (path / name).is_file():
            return path / name
    raise InputError(f"{path}: neither {LOOP} nor {MODEL} is in this folder")


def read_model_file(path: Path) -> dict[str, Any]:
    """Read the keys and values of a ``loop.json`` or a ``model.json``.

    Raises
    ------
    InputError
        If the file cannot be read or holds something else.
    """
    try:
        content = read_json(path)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    except ValueError as fault:
        raise InputError(f"{path}: neither a {LOOP} nor a {MODEL} of anglecam") from fault
    if not isinstance(content, dict):
        raise InputError(f"{path}: neither a {LOOP} nor a {MODEL} of anglecam")
    return content
