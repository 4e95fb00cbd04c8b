"""The option ``--json``, which every command gets: one JSON document on standard output, all else on standard error.

A command states its results with `report`; without ``--json`` this has no effect. The document also holds
``problems``, the lines of standard error that the exit status stands for. It is printed whether or not the command
succeeds, so that a program reads one document in every case but a wrong call.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from anglecam.errors import AnglecamError, printable
from anglecam.io.files import json_text
from anglecam.terminal import screen

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on standard output, messages on standard error.")
]
_document: ContextVar[dict[str, Any] | None] = ContextVar("document", default=None)


def report(**content: Any) -> None:
    """Add content to the JSON document; a list is appended to the list of the same key."""
    document = _document.get()
    if document is None:
        return
    for key, value in content.items():
        document[key] = [*document.get(key, []), *value] if isinstance(value, list) else value


def report_file(key: str, path: Path) -> None:
    """Add the content of a JSON file that the command has written."""
    if _document.get() is not None and path.exists():
        report(**{key: json.loads(path.read_text(encoding="utf-8"))})


def with_json(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the option ``--json``."""

    @wraps(command)
    def called(*, as_json: bool = False, **options: Any) -> None:
        with _one_document(as_json):
            command(**options)

    option = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Json)
    parameters = [*inspect.signature(command, eval_str=True).parameters.values(), option]
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called


@contextmanager
def _one_document(wanted: bool) -> Iterator[None]:
    """Print the document when the block ends, also by an error; until then the screen is standard error."""
    if not wanted:
        yield
        return
    document: dict[str, Any] = {"problems": []}
    token, screen.stderr = _document.set(document), True
    try:
        yield
    except AnglecamError as problem:
        document["problems"] += problem.args
        raise
    except typer.Exit:
        raise
    except Exception as fault:
        document["problems"].append(printable(f"internal error, please report it ({type(fault).__name__}: {fault})"))
        raise
    finally:
        _document.reset(token)
        screen.stderr = False
        print(json_text(document))
