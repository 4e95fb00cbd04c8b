"""Kernels are compiled once, whoever asks for them and however often, and what is there is used without Numba."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from filelock import FileLock

from anglecam.prepare import Kernels

LOG = """
import os
from numba.core import event

class Log(event.Listener):
    def on_start(self, event): pass
    def on_end(self, event):
        kernel = event.data["dispatcher"].py_func
        if kernel.__module__.startswith("tiny"):
            with open(os.environ["COMPILED"], "a") as log:
                log.write(kernel.__name__ + "\\n")

event.register("numba:compile", Log())
"""
KERNEL = """
from numba import njit
{}

@njit("float64(float64)", cache=True)
def {}(x):
    return {}
"""


class Tiny:
    """A package of three kernels, the third one of which calls the first."""

    def __init__(self, folder: Path) -> None:
        self.root, self.log, self.cache = folder / "tiny", folder / "compiled.txt", folder / "cache"
        self.root.mkdir()
        (self.root / "__init__.py").write_text(LOG)
        (self.root / "one.py").write_text(KERNEL.format("", "one", "x + 1.0"))
        (self.root / "two.py").write_text(KERNEL.format("", "two", "x * 2.0"))
        (self.root / "three.py").write_text(KERNEL.format("from tiny.one import one", "three", "one(x) ** 3.0"))
        (self.root / "plain.py").write_text("")
        self.environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(folder), str(Path(__file__).parents[1])]),
            "COMPILED": str(self.log),
            "NUMBA_CACHE_DIR": str(self.cache),
        }

    def start(self, program: str = "from anglecam.prepare import prepare_kernels; prepare_kernels('tiny')"):
        return subprocess.Popen(
            [sys.executable, "-c", program], env=self.environment, stderr=subprocess.PIPE, text=True
        )

    def prepare(self) -> str:
        """Prepare the kernels and return what it printed on standard error."""
        process = self.start()
        said = process.communicate()[1]
        assert process.returncode == 0, said
        return said

    def compiled(self) -> Counter[str]:
        return Counter(self.log.read_text().split() if self.log.exists() else ())

    def stamp(self) -> Path:
        (stamp,) = self.cache.glob("*.json")
        return stamp


@pytest.fixture
def tiny(tmp_path: Path) -> Tiny:
    return Tiny(tmp_path)


ONCE = Counter(["one", "two", "three"])


def test_processes_that_begin_at_once_compile_no_kernel_twice(tiny: Tiny):
    processes = [tiny.start() for _ in range(3)]
    said = [process.communicate()[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert tiny.compiled() == ONCE
    assert sum("compiling" in lines for lines in said) == 1
    assert not list(tiny.cache.glob("*.locks"))


def test_what_is_there_is_used_in_silence_and_without_numba(tiny: Tiny):
    assert "tiny: kernels compiled in" in tiny.prepare()
    program = "import sys; from anglecam.prepare import prepare_kernels; prepare_kernels('tiny')"
    process = tiny.start(f"{program}; sys.exit(sum(name in sys.modules for name in ('numba', 'numpy', 'filelock')))")
    assert process.communicate()[1] == ""
    assert process.returncode == 0


def test_another_process_that_compiles_is_waited_for(tiny: Tiny):
    tiny.prepare()
    stamp, text = tiny.stamp(), tiny.stamp().read_text()
    stamp.unlink()
    with FileLock(stamp.with_suffix(".lock")):
        process = tiny.start()
        assert process.stderr
        assert "waiting for another process" in process.stderr.readline()
        stamp.write_text(text)
    assert process.communicate()[1] == ""
    assert tiny.compiled() == ONCE


def test_after_a_kill_the_next_call_goes_on(tiny: Tiny):
    process = tiny.start()
    while not (kept := list(tiny.cache.glob("*/*.nbc"))):
        time.sleep(0.01)
    process.kill()
    process.communicate()
    first = kept[0].name.split(".")[0]
    tiny.prepare()
    assert set(tiny.compiled()) == set(ONCE)
    assert tiny.compiled()[first] == 1
    assert tiny.prepare() == ""


def test_only_a_changed_kernel_is_compiled_again(tiny: Tiny):
    tiny.prepare()
    (tiny.root / "plain.py").write_text("# another file\n")
    assert tiny.prepare() == ""
    (tiny.root / "two.py").write_text(KERNEL.format("", "two", "x * 2.5"))
    assert "compiling" in tiny.prepare()
    assert tiny.compiled() == ONCE + Counter(["two"])
    next(tiny.cache.glob("*/one.one-*.nbi")).unlink()
    tiny.prepare()
    assert tiny.compiled()["one"] == 2


def test_without_a_folder_that_can_be_written_to_it_still_works(tiny: Tiny):
    for path in (tiny.cache, tiny.root / "__pycache__", tiny.root.parent / "caches"):
        path.touch()  # a file, where a folder would have to be
    tiny.environment |= {"XDG_CACHE_HOME": str(tiny.root.parent / "caches")}
    program = "from anglecam.prepare import prepare_kernels; prepare_kernels('tiny'); from tiny.three import three"
    process = tiny.start(f"{program}; assert three(1.0) == 8.0; assert three.stats.cache_hits")
    said = process.communicate()[1]
    assert process.returncode == 0, said
    assert "no folder for compiled kernels can be written to" in said
    assert tiny.compiled() == ONCE


def test_a_module_that_cannot_be_imported_is_named_and_tried_again(tiny: Tiny):
    (tiny.root / "two.py").write_text("from numba import njit\nraise ImportError\n")
    assert "could not be compiled beforehand: tiny.two" in tiny.prepare()
    assert tiny.compiled() == ONCE - Counter(["two"])
    assert "could not be compiled beforehand: tiny.two" in tiny.prepare()


def test_the_modules_are_found_by_what_they_import():
    assert "anglecam.vision.registration.turn_kernel" in Kernels("anglecam").modules()
    assert "anglecam.prepare" not in Kernels("anglecam").modules()
