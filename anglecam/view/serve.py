"""Serve one folder on the loopback address until somebody interrupts."""

from __future__ import annotations

import contextlib
import secrets
import socket
from collections.abc import AsyncIterator, Callable

import uvicorn
from starlette.applications import Starlette
from starlette.types import ASGIApp

from anglecam.errors import RigError
from anglecam.view.folder import Folder
from anglecam.view.guard import Guard
from anglecam.view.routes import Api

_HOST = "127.0.0.1"
_GRACE_S = 1
"""Time for open connections to end when the server does."""


def application(folder: Folder, port: int, token: str) -> ASGIApp:
    """Return the guarded application that shows a folder.

    Parameters
    ----------
    folder : Folder
        What is shown.
    port : int
        On which it will be served.
    token : str
        A secret that every request has to bring.

    Returns
    -------
    ASGIApp
        It ends its jobs when it is shut down.
    """
    api = Api(folder)

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        yield
        api.jobs.close()

    return Guard(Starlette(routes=api.routes(), lifespan=lifespan), port, token)


def serve(folder: Folder, port: int, ready: Callable[[str], None]) -> None:
    """Serve a folder until the process is interrupted.

    Parameters
    ----------
    folder : Folder
        What is shown.
    port : int
        0 for a free one.
    ready : callable
        Called with the address, which holds the token, once connections are accepted.

    Raises
    ------
    RigError
        Where the port is taken.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((_HOST, port))
    except (OSError, OverflowError) as problem:
        listener.close()
        raise RigError(f"--port {port}: {getattr(problem, 'strerror', None) or 'no port has this number'}") from problem
    listener.listen()
    port, token = listener.getsockname()[1], secrets.token_urlsafe(24)
    config = uvicorn.Config(
        application(folder, port, token),
        log_level="critical",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=_GRACE_S,
    )
    ready(f"http://{_HOST}:{port}/?token={token}")
    with contextlib.suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listener])
