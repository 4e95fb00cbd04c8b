"""Only the person at this machine gets in: every request is checked before anything of it is looked at.

A web page that is open in the same browser can send requests to a local server, and by DNS rebinding even under a name
of its own. So the request has to be for 127.0.0.1 or localhost at this port, a stated origin has to be this server, and
the token that was printed has to come along: first in the address, then in a cookie that other pages cannot send.
"""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders, QueryParams
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

TOKEN_HEADER = "x-anglecam-token"
_HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self';"
        " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}
"""Added to every answer that does not set them itself."""


class Guard:
    """Lets a request through to the application, or refuses it with 403.

    Parameters
    ----------
    app : ASGIApp
        What is guarded.
    port : int
        On which the server listens.
    token : str
        A secret.
    """

    def __init__(self, app: ASGIApp, port: int, token: str) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._cookie = f"anglecam_{port}"  # cookies of all ports of a host are sent to each of them

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        answer = self._refusal_or_entry(scope)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await (self._app if answer is None else answer)(scope, receive, send_guarded)

    def _refusal_or_entry(self, scope: Scope) -> Response | None:
        """Return the answer to a request that does not reach the application."""
        headers = Headers(scope=scope)
        if headers.get("host") not in self._hosts:
            return _refused("this server answers to 127.0.0.1 only")
        origin = headers.get("origin")
        if origin is not None and origin not in {f"http://{host}" for host in self._hosts}:
            return _refused("the request comes from another page")
        if self._is_token(headers.get(TOKEN_HEADER)) or self._is_token(self._in_cookie(headers)):
            return None
        if scope["path"] == "/" and self._is_token(QueryParams(scope["query_string"]).get("token")):
            answer = RedirectResponse("/", status_code=303)
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="strict")
            return answer
        return _refused("open the address that anglecam view has printed, with its token")

    def _is_token(self, given: str | None) -> bool:
        return given is not None and secrets.compare_digest(given.encode(), self._token.encode())

    def _in_cookie(self, headers: Headers) -> str | None:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return None
        return None if found is None else found.value


def _refused(cause: str) -> Response:
    return PlainTextResponse(f"refused: {cause}\n", status_code=403)
