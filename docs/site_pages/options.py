"""The options of each command, from the command line itself."""

from __future__ import annotations

from typing import Any

import typer

from anglecam.cli.app import app


def page() -> str:
    """Return the page: a section for each command."""
    group = typer.main.get_command(app)
    parts = ["# Options of each command", "Generated from the commands; `--help` prints the same."]
    parts += list(_sections(group, "anglecam"))
    return "\n\n".join(parts) + "\n"


def _sections(group: Any, path: str) -> Any:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _sections(command, f"{path} {name}")
        else:
            with command.make_context(name, [], resilient_parsing=True) as context:
                text = command.get_help(context)
            yield f"## {path} {name}\n\n```text\n{text.replace('Usage: ' + name, f'Usage: {path} {name}')}\n```"
