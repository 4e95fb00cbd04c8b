"""The command `view`: a local page to look at clips, to declare the rig and to measure."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from anglecam.cli.progress import begin_loading, stages
from anglecam.terminal import screen
from anglecam.view.folder import open_folder


def view(
    path: Annotated[
        Path, typer.Argument(metavar="[CLIP | SESSION]", help="A clip, or a folder of clips of one rig.")
    ] = Path(),
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port to listen on; 0 is a free one.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address only.")] = False,
) -> None:
    """See, click and save: a page on this machine with frames, angles, the mark search and rig.yaml."""
    folder = open_folder(path)
    with stages() as progress:
        begin_loading(progress)
        from anglecam.view.serve import serve

    def ready(address: str) -> None:
        screen.print(f"anglecam view: {address}", soft_wrap=True, highlight=False)
        screen.print("The address is for this machine only. Ctrl-C ends it.", highlight=False)
        if not no_browser and _has_screen():
            webbrowser.open(address)

    serve(folder, port, ready)
    os._exit(0)  # a search for the mark may be under way in a thread; nothing waits for its result


def _has_screen() -> bool:
    """Return whether a window can appear: without one, a browser for text would take over the terminal."""
    return not sys.platform.startswith("linux") or any(os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY"))
