"""A notebook, executed and turned into a page."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import nbformat
from jupyter_client import AsyncKernelManager
from nbclient import NotebookClient

SECONDS = 600
"""Time limit of a cell."""


def render(notebook: Path, folder: Path) -> None:
    """Execute a notebook and write it as a page with its pictures; an error in a cell is an error here."""
    content = nbformat.read(notebook, as_version=4)
    kernel = AsyncKernelManager(kernel_name="python3", transport="ipc")
    NotebookClient(content, timeout=SECONDS, km=kernel).execute(cleanup_kc=True)
    parts: list[str] = []
    for number, cell in enumerate(content.cells):
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        parts += [part for output in cell.outputs if (part := _shown(output, notebook.stem, number, folder))]
    (folder / f"{notebook.stem}.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _shown(output: Any, stem: str, number: int, folder: Path) -> str:
    """Return an output as Markdown; a picture is written beside the page."""
    data = output.get("data", {})
    if "image/png" in data:
        name = f"{stem}-{number}.png"
        (folder / name).write_bytes(base64.b64decode(data["image/png"]))
        return f"![Output of the cell]({name})"
    if "text/html" in data:
        return f"<div>{''.join(data['text/html'].splitlines())}</div>"
    text = data.get("text/plain") or output.get("text", "")
    return f"```text\n{text.rstrip()}\n```" if text and output.get("name") != "stderr" else ""
