"""Check whether anglecam can work on this machine: packages, codecs, threads, cache, memory, disk, a self-test."""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

import av
import numpy as np

from anglecam.errors import AnglecamError
from anglecam.free_memory import free_memory
from anglecam.prepare import Kernels
from anglecam.progress import Progress, Stage, unseen
from anglecam.threads import cores, native_threads
from anglecam.workflow.self_test import FRAMES, self_test

REQUIRED_CODECS = ("ffv1", "mjpeg", "h264")
"""Codecs of the films that anglecam is tested with."""
FURTHER_CODECS = ("hevc", "vp9", "av1", "mpeg4", "prores", "rawvideo")
"""Codecs of phones and cameras; without one of them only films in it cannot be read."""
LEAST_MEMORY, LEAST_DISK = 2**30, 2**30
"""Bytes. Measuring a clip in full HD takes 0.7 GB; a recording of an hour takes about 1 GB."""
LARGEST_ERROR_SIGMAS = 3.0
"""RMS error of the self-test in units of the stated uncertainty above which the uncertainty is wrong. The ratio of a
sound installation is near 1."""


@dataclass(frozen=True)
class Check:
    """The result of one check."""

    name: str
    found: str
    """What was found, for people."""
    figures: dict[str, Any]
    """The same for programs; keys end in their units."""
    problem: str | None = None
    """What is wrong and what to do, in one line; ``None`` if nothing is."""


def checks(progress: Progress = unseen) -> Iterator[Check]:
    """Yield the results of all checks, the self-test last, because it takes seconds.

    Parameters
    ----------
    progress : Progress
        Called with each stage.
    """
    progress(Stage("checking packages, codecs, threads, memory and disk"))
    yield check_versions()
    yield check_codecs()
    yield check_threads()
    yield check_kernel_cache()
    yield check_memory()
    yield check_disk()
    progress(Stage("measuring a drawn film; the first time, kernels are compiled for up to a minute"))
    yield check_self_test()


def check_versions() -> Check:
    """Check that every package that anglecam requires is installed."""
    found: dict[str, str] = {"python": platform.python_version(), "anglecam": version("anglecam")}
    missing = []
    for requirement in requires("anglecam") or ():
        if "extra ==" in requirement:
            continue
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            missing.append(name)
    problem = f"versions: {', '.join(missing)} not installed; install anglecam again" if missing else None
    shown = ("python", "anglecam", "numpy", "scipy", "av", "opencv-python-headless", "numba")
    return Check("versions", ", ".join(f"{name} {found[name]}" for name in shown if name in found), found, problem)


def check_codecs() -> Check:
    """Check that the codecs of the usual films can be decoded."""
    readable = {name: _decodes(name) for name in (*REQUIRED_CODECS, *FURTHER_CODECS)}
    lacking = [name for name in REQUIRED_CODECS if not readable[name]]
    problem = (
        f"codecs: PyAV cannot decode {', '.join(lacking)}; install PyAV's wheel (pip install av)" if lacking else None
    )
    others = [name for name, can in readable.items() if not can]
    found = "decodes " + ", ".join(name for name, can in readable.items() if can)
    return Check("codecs", found + (f"; not {', '.join(others)}" if others else ""), readable, problem)


def check_threads() -> Check:
    """State how many cores this process may use, and how many threads a clip gets."""
    figures = {"cores": cores(), "threads": native_threads(), "machine_cores": os.cpu_count()}
    found = f"{figures['threads']} threads for a clip, {figures['cores']} cores of {figures['machine_cores']}"
    return Check("threads", found, figures)


def check_kernel_cache() -> Check:
    """Check that compiled kernels can be kept, without which every start compiles, and whether they have been."""
    kernels = Kernels("anglecam")
    folder = kernels.folder
    if folder is None or not _can_write(folder):
        problem = (
            "kernel cache: no folder for compiled kernels can be written to, so every start compiles for up to a"
            " minute; set NUMBA_CACHE_DIR to a folder that can"
        )
        return Check("kernel cache", "none", {"folder": None, "writable": False, "compiled": False}, problem)
    compiled = kernels.prepared()
    found = f"{folder}, {'compiled' if compiled else 'compiled by the first command that measures'}"
    return Check("kernel cache", found, {"folder": str(folder), "writable": True, "compiled": compiled})


def check_memory() -> Check:
    """Check that enough memory is free."""
    free = free_memory()
    problem = f"memory: {_gib(free)} are free; a clip in full HD needs 0.7 GiB" if free < LEAST_MEMORY else None
    return Check("memory", f"{_gib(free)} free", {"free_bytes": free}, problem)


def check_disk() -> Check:
    """Check that enough space is free where temporary files and results go."""
    free = {str(folder): shutil.disk_usage(folder).free for folder in (Path(tempfile.gettempdir()), Path.cwd())}
    full = [f"{folder} has {_gib(left)}" for folder, left in free.items() if left < LEAST_DISK]
    problem = f"disk: {' and '.join(full)} left" if full else None
    found = ", ".join(f"{_gib(left)} free in {folder}" for folder, left in free.items())
    return Check("disk", found, {"free_bytes": free}, problem)


def check_self_test() -> Check:
    """Measure a drawn film whose angle is known."""
    try:
        result = self_test()
    except AnglecamError as failure:
        return Check("self-test", "failed", {}, f"self-test: {failure.one_line}")
    error, sigma = np.degrees([result.rms_error, result.rms_sigma]).tolist()
    figures = {
        "frames": result.frames,
        "measured": result.measured,
        "rms_error_deg": error,
        "rms_sigma_deg": sigma,
        "duration_s": result.duration_s,
    }
    found = (
        f"{result.measured} of {result.frames} frames in {result.duration_s:.1f} s after compiling,"
        f" error {error:.2g}° RMS, stated uncertainty {sigma:.2g}°"
    )
    problem = None
    if result.frames != FRAMES or result.measured < result.frames:
        problem = f"self-test: {result.measured} of {FRAMES} frames were measured; please report it"
    elif not error <= LARGEST_ERROR_SIGMAS * sigma:
        problem = f"self-test: the angle is wrong by {error:.2g}° where {sigma:.2g}° is stated; please report it"
    return Check("self-test", found, figures, problem)


def _decodes(codec: str) -> bool:
    try:
        av.codec.Codec(codec, "r")
    except av.codec.codec.UnknownCodecError:
        return False
    return True


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _gib(size: int) -> str:
    return f"{size / 2**30:.1f} GiB"
