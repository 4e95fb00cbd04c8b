"""What the page asks for: the folder, its clips' frames and angles, the mark search, the rig, the jobs."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route

from anglecam.data.typing import Image
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.files import json_text
from anglecam.io.rig import Rig, read_rig
from anglecam.io.rig_update import changed_rig, read_rig_text, update_rig
from anglecam.io.session import rig_beside
from anglecam.view.clips import Clips, OpenClip, version_of
from anglecam.view.folder import Folder
from anglecam.view.jobs import Jobs
from anglecam.view.pictures import MEDIA_TYPES, encode_picture
from anglecam.view.series_json import series_as_dict
from anglecam.view.stages import STAGES, found_in, stage_picture
from anglecam.workflow.session_results import REPORT

STATIC = Path(__file__).parents[1] / "web" / "static"
_PAGE_FILES = {
    "view.html": "text/html",
    "view.js": "text/javascript",
    "view.css": "text/css",
    "icon.svg": "image/svg+xml",
}
_THREADS = ThreadPoolExecutor(8)
_KEPT = {"cache-control": "private, max-age=3600"}
"""For pictures: the page's address of one names the version of its clip, or the mark."""
_SANDBOX = {"content-security-policy": "sandbox allow-scripts; default-src 'unsafe-inline' data: blob:"}
"""For the report: its scripts run, but cannot reach this server."""


class _MissingError(AnglecamError):
    """What was asked for does not exist."""

    def __init__(self) -> None:
        super().__init__("there is no such thing")


class Api:
    """The routes of one opened folder.

    Parameters
    ----------
    folder : Folder
        What is open.
    """

    def __init__(self, folder: Folder) -> None:
        self.folder, self.clips, self.jobs = folder, Clips(), Jobs()

    def routes(self) -> list[Route]:
        """Return the routes."""
        clip = "/api/clips/{clip:int}"
        table: list[tuple[str, str, Callable[[Request], Response]]] = [
            ("GET", "/", lambda request: _page_file("view.html")),
            ("GET", "/static/{file}", lambda request: _page_file(request.path_params["file"])),
            ("GET", "/api/folder", self.describe),
            ("GET", clip, self.describe_clip),
            ("GET", clip + "/series", self.series),
            ("GET", clip + "/frames/{number:int}.{kind}", self.frame),
            ("GET", clip + "/frames/{number:int}/found", self.found),
            ("GET", clip + "/frames/{number:int}/{stage}.png", self.stage),
            ("GET", "/api/rig", self.rig),
            ("GET", "/api/jobs/{job:int}", lambda request: _json(asdict(self.jobs.state(request.path_params["job"])))),
            ("DELETE", "/api/jobs/{job:int}", lambda r: _json(asdict(self.jobs.cancel(r.path_params["job"])))),
            ("GET", "/result/" + REPORT, self.report),
        ]
        with_body: list[tuple[str, str, Callable[[Request, Any], Response]]] = [
            ("POST", clip + "/mark", self.learn),
            ("PUT", "/api/rig", self.save_rig),
            ("POST", "/api/jobs", self.start_job),
        ]
        plain = [Route(path, _answered(answer), methods=[method]) for method, path, answer in table]
        return plain + [Route(path, _answered_with_body(answer), methods=[way]) for way, path, answer in with_body]

    def describe(self, request: Request) -> Response:
        """Answer with the folder, its clips, and what has been done."""
        folder, running = self.folder, self.jobs.running
        clips = [{"name": printable(c.name), "measured": folder.series_file(c).is_file()} for c in folder.clips]
        return _json(
            {
                "name": printable(folder.path.name),
                "clips": clips,
                "is_session": folder.is_session,
                "has_report": (folder.results / REPORT).is_file(),
                "job": None if running is None else running.id,
            }
        )

    def describe_clip(self, request: Request) -> Response:
        """Answer with what the page has to know before it shows frames."""
        path = self._clip(request)
        opened = self._open(request)
        film = opened.film
        return _json(
            {
                "name": printable(path.name),
                "version": version_of(path),
                "width": film.width,
                "height": film.height,
                "codec": film.codec,
                "times": opened.reader.times.tolist(),
            }
        )

    def series(self, request: Request) -> Response:
        """Answer with the measured angles, or null."""
        return _json(series_as_dict(self.folder, self._clip(request), self._rig()))

    def frame(self, request: Request) -> Response:
        """Answer with a frame: PNG without loss, or JPEG."""
        return _picture(self._image(request), request.path_params["kind"])

    def learn(self, request: Request, content: Any) -> Response:
        """Find the mark with the page's settings; answer with its key and what it is."""
        rig = changed_rig(self.folder.rig_file, _sections(content))
        key = self.clips.learn(self._clip(request), rig)
        found = self.clips.mark(key).found
        return _json({"key": key, "rgb": found.model.mean_rgb, "cue": found.cue, "area_px2": found.area_px2})

    def stage(self, request: Request) -> Response:
        """Answer with the picture of a stage of the mark search."""
        stage = request.path_params["stage"]
        if stage not in STAGES:
            raise _MissingError
        mark = self.clips.mark(request.query_params.get("mark", ""))
        return _picture(stage_picture(self._image(request), mark.found, stage), "png")

    def found(self, request: Request) -> Response:
        """Answer with the regions of a frame, and which is the mark."""
        return _json(found_in(self._image(request), self.clips.mark(request.query_params.get("mark", ""))))

    def rig(self, request: Request) -> Response:
        """Answer with the rig file's keys as they are written."""
        text = read_rig_text(self.folder.rig_file)
        return _json({"sections": text.content, "version": text.version, "has_comments": text.has_comments})

    def save_rig(self, request: Request, content: Any) -> Response:
        """Write changed sections into the rig file; answer as `rig`."""
        sections, version = _sections(content), content.get("version")
        path = self.folder.rig_file
        try:
            update_rig(path, sections, str(version))
        except OSError as problem:
            raise InputError(f"{path}: cannot be written ({problem.strerror or problem})") from problem
        return self.rig(request)

    def start_job(self, request: Request, content: Any) -> Response:
        """Start to measure a clip, or to close the session's loop."""
        out = str(self.folder.results)
        if content.get("kind") == "close" and self.folder.is_session:
            asked = {"session": str(self.folder.path), "out": out}
        elif content.get("kind") == "measure":
            asked = {"clip": str(self._number(content.get("clip"))), "out": out}
        else:
            raise InputError("there is no such job")
        return _json(asdict(self.jobs.start(asked)))

    def report(self, request: Request) -> Response:
        """Answer with the report of the closed loop."""
        path = self.folder.inside(self.folder.results / REPORT)
        if not path.is_file():
            raise _MissingError
        return FileResponse(path, headers=_SANDBOX)

    def _clip(self, request: Request) -> Path:
        return self._number(request.path_params["clip"])

    def _number(self, number: Any) -> Path:
        if not isinstance(number, int) or not 0 <= number < len(self.folder.clips):
            raise _MissingError
        return self.folder.inside(self.folder.clips[number])

    def _rig(self) -> Rig:
        path = self.folder.rig_file
        # numbered pictures may have their rig file beside their folder
        return read_rig(path) if path.exists() or self.folder.is_session else rig_beside(self.folder.clips[0])

    def _open(self, request: Request) -> OpenClip:
        try:
            rig = self._rig()
        except RigError:  # a clip can be looked at while its rig file is wrong
            rig = Rig()
        return self.clips.open(self._clip(request), rig)

    def _image(self, request: Request) -> Image:
        opened, number = self._open(request), request.path_params["number"]
        if number >= len(opened.reader.times):
            raise _MissingError
        image = opened.image(number)
        if image is None:
            raise InputError(f"frame {number} cannot be decoded")
        return image


def _answered(answer: Callable[[Request], Response]) -> Callable[[Request], Any]:
    """Return an endpoint that works in a thread and turns faults into answers."""

    async def endpoint(request: Request) -> Response:
        return await _in_thread(lambda: answer(request))

    return endpoint


def _answered_with_body(answer: Callable[[Request, Any], Response]) -> Callable[[Request], Any]:
    async def endpoint(request: Request) -> Response:
        try:
            content = await request.json()
        except ValueError:
            return PlainTextResponse("not JSON\n", status_code=400)
        if not isinstance(content, dict):
            return PlainTextResponse("not an object\n", status_code=400)
        return await _in_thread(lambda: answer(request, content))

    return endpoint


async def _in_thread(answer: Callable[[], Response]) -> Response:
    """Answer in a thread; when the server ends, it does not wait for a search that is under way."""
    return await asyncio.get_running_loop().run_in_executor(_THREADS, _or_fault, answer)


def _or_fault(answer: Callable[[], Response]) -> Response:
    try:
        with blame(Path("anglecam view")):
            return answer()
    except AnglecamError as problem:
        return _json({"problem": str(problem)}, status=404 if isinstance(problem, _MissingError) else 422)


def _sections(content: Any) -> dict[str, Any]:
    sections = content.get("sections")
    if not isinstance(sections, dict):
        raise InputError("no sections of a rig file in the request")
    return sections


def _json(content: Any, status: int = 200) -> Response:
    return Response(json_text(content), status, media_type="application/json")


def _picture(image: Image, kind: str) -> Response:
    if kind not in MEDIA_TYPES:
        raise _MissingError
    return Response(encode_picture(image, kind), media_type=MEDIA_TYPES[kind], headers=_KEPT)


def _page_file(name: str) -> Response:
    if name not in _PAGE_FILES:
        raise _MissingError
    return FileResponse(STATIC / name, media_type=_PAGE_FILES[name])
