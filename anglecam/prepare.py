"""Have all numerical kernels of a package compiled and kept on disk before anything waits for them.

Numba compiles a kernel when its module is imported, which takes seconds, and keeps it in a folder. Here all modules
with kernels are compiled at once, in parallel, by the first process that needs one of them. A stamp beside Numba's
folder says for which sources, versions and processor that was done. Every other process reads the stamp, in some
milliseconds and without loading Numba, and goes on.

The stamp names the files that Numba wrote. If one is missing, the modules are compiled again, those that are still
there excepted.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import re
import sys
import tempfile
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree

_LOADS_NUMBA = re.compile(rb"^((from|import) numba\b|from anglecam\.effects import ports$)", re.MULTILINE)
"""In the source of a module with kernels; the ports compile the functions of effects."""
_OF_CODE = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")
"""Settings that change for which processor Numba compiles."""
_OF_PROCESSOR = re.compile(
    r"^(vendor_id|cpu family|model|model name|stepping|flags|Features|CPU \w+)\s*:.*$", re.MULTILINE
)


def prepare_kernels(package: str) -> None:
    """Compile the kernels of a package, unless that has been done.

    Call it before the first module with kernels is imported. It says on standard error that it compiles, and how long
    it took. Of several processes that call it at once one compiles, and the others wait.

    Parameters
    ----------
    package : str
        A package, such as ``"anglecam"``.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return
    kernels = Kernels(package)
    if kernels.folder is None:
        _use_temporary_folder(package)
        kernels = Kernels(package)
    if not kernels.prepared():
        kernels.prepare()


@dataclass(frozen=True)
class Kernels:
    """The kernels of a package and where they are kept."""

    package: str

    @cached_property
    def root(self) -> Path:
        """The package's folder."""
        spec = find_spec(self.package)
        assert spec is not None
        assert spec.submodule_search_locations
        return Path(spec.submodule_search_locations[0])

    @cached_property
    def folder(self) -> Path | None:
        """Where Numba keeps what it compiles, or that folder's parent; ``None`` where no such folder can be written.

        Numba asks in the same order (`numba.core.caching`): the folder that the user names, that of the module's
        bytecode, that of the user's caches.
        """
        named = os.environ.get("NUMBA_CACHE_DIR")
        likely = [Path(named)] if named else []
        return next(filter(_can_write, [*likely, self.root / "__pycache__", _user_caches() / "numba"]), None)

    @cached_property
    def stamp(self) -> Path:
        """The file that says for what the kernels were compiled."""
        versions = [sys.version, *(_version_file(name) for name in ("numba", "llvmlite"))]
        processor = [sys.platform, _processor(), *(os.environ.get(name) for name in _OF_CODE)]
        digest = hashlib.sha256(repr((self.root, versions, processor)).encode()).hexdigest()[:16]
        assert self.folder is not None
        return self.folder / f"{self.package}-kernels-{digest}.json"

    def prepared(self) -> bool:
        """Return whether all kernels were compiled from these sources, and are still there."""
        if self.folder is None:
            return False
        try:
            kept = json.loads(self.stamp.read_text("utf-8"))
            if not all(
                set(names) <= {path.name for path in Path(folder).iterdir()} for folder, names in kept["files"].items()
            ):
                return False
        except (OSError, ValueError):
            return False
        if kept["state"] == self._state():
            return True
        if kept["sources"] != self._sources():
            return False
        self._write_stamp(kept["files"])  # other files have changed, or none: a copy has other times
        return True

    def prepare(self) -> None:
        """Compile what is not compiled yet; one process at a time does it."""
        from filelock import FileLock, Timeout

        from anglecam.compile_kernels import compile_modules

        self.stamp.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(self.stamp.with_suffix(".lock"))
        try:
            lock.acquire(timeout=0)
        except Timeout:
            print(f"{self.package}: waiting for another process that compiles the kernels", file=sys.stderr, flush=True)
            lock.acquire()
        try:
            if self.prepared():
                return
            folders = compile_modules(self.package, self.modules(), self.stamp.with_suffix(".locks"))
            if folders is not None:
                self._write_stamp({folder: [path.name for path in Path(folder).glob("*.nbi")] for folder in folders})
        finally:
            lock.release()

    def modules(self) -> list[str]:
        """Return the modules with kernels, those with the longest sources first."""
        sources = sorted(self._kernel_sources(), key=lambda path: -path.stat().st_size)
        names = [".".join([self.package, *path.relative_to(self.root).with_suffix("").parts]) for path in sources]
        return [name.removesuffix(".__init__") for name in names]

    def _write_stamp(self, files: dict[str, list[str]]) -> None:
        """Write the stamp, given the files that Numba wrote to each of its folders."""
        text = json.dumps({"state": self._state(), "sources": self._sources(), "files": files})
        handle, name = tempfile.mkstemp(dir=self.stamp.parent, prefix=self.stamp.stem)
        with os.fdopen(handle, "w", encoding="utf-8") as out:
            out.write(text)
        Path(name).replace(self.stamp)

    def _state(self) -> str:
        """Return a digest of the names, times and sizes of all sources, which are read faster than the sources."""
        digest = hashlib.sha256()
        for path in self._all_sources():
            status = path.stat()
            digest.update(f"{path}\0{status.st_mtime_ns}\0{status.st_size}\0".encode())
        return digest.hexdigest()

    def _sources(self) -> str:
        """Return a digest of the sources of the modules with kernels."""
        digest = hashlib.sha256()
        for path in self._kernel_sources():
            digest.update(f"{path}\0".encode() + path.read_bytes())
        return digest.hexdigest()

    def _all_sources(self) -> list[Path]:
        found = []
        for folder, folders, names in os.walk(self.root):
            folders[:] = [name for name in folders if name not in ("__pycache__", "node_modules")]
            found += [Path(folder, name) for name in names if name.endswith(".py")]
        return sorted(found)

    def _kernel_sources(self) -> list[Path]:
        return [path for path in self._all_sources() if _LOADS_NUMBA.search(path.read_bytes())]


def _use_temporary_folder(package: str) -> None:
    """Have Numba keep what it compiles in a folder that lasts as long as this process."""
    folder = tempfile.mkdtemp(prefix=f"{package}-kernels-")
    atexit.register(rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = folder
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = folder
    print(
        f"{package}: no folder for compiled kernels can be written to, so every start compiles them;"
        " set NUMBA_CACHE_DIR to a folder that can",
        file=sys.stderr,
    )


def _can_write(folder: Path) -> bool:
    """Return whether a folder can be written to, or made."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def _user_caches() -> Path:
    """Return the folder of the user's caches."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _processor() -> str:
    """Return what is known of the processor without starting a program: its model and its abilities."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as file:
            first = "".join(iter(file.readline, "\n"))  # all cores are alike
    except OSError:
        return os.environ.get("PROCESSOR_IDENTIFIER", "")
    return "\n".join(found.group() for found in _OF_PROCESSOR.finditer(first))


def _version_file(package: str) -> bytes:
    """Return the file that states a package's version, which is not imported."""
    spec = find_spec(package)
    folders = spec.submodule_search_locations if spec else None
    return Path(folders[0], "_version.py").read_bytes() if folders else b""


if __name__ == "__main__":
    for name in sys.argv[1:]:
        prepare_kernels(name)
