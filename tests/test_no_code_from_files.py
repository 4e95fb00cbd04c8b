"""A file is data: nothing in anglecam can run what stands in one."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import anglecam

SOURCES = sorted(Path(anglecam.__file__).parent.rglob("*.py"))
FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__"}
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
FORBIDDEN_ATTRIBUTES = {
    ("yaml", "load"), ("yaml", "load_all"), ("yaml", "full_load"), ("yaml", "unsafe_load"), ("yaml", "UnsafeLoader"),
    ("yaml", "FullLoader"), ("yaml", "Loader"), ("os", "system"), ("os", "popen"), ("pd", "read_pickle"),
    ("pandas", "read_pickle"), ("pd", "read_hdf"), ("pandas", "read_hdf"), ("tempfile", "mktemp"),
}  # fmt: skip


def dangers(source: str) -> list[str]:
    """List what could run a file's content, with its line."""
    found = []
    for node in ast.walk(ast.parse(source)):
        said = None
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            said = next((m for m in modules if m.split(".")[0] in FORBIDDEN_MODULES), None)
            if isinstance(node, ast.ImportFrom):
                pairs = {(node.module, alias.name) for alias in node.names}
                said = said or next((".".join(map(str, p)) for p in pairs & FORBIDDEN_ATTRIBUTES), None)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            said = f"{node.value.id}.{node.attr}" if (node.value.id, node.attr) in FORBIDDEN_ATTRIBUTES else None
        elif isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name) and node.func.id in FORBIDDEN_CALLS:
                said = node.func.id
            for keyword in node.keywords:
                if keyword.arg in ("allow_pickle", "shell") and not (
                    isinstance(keyword.value, ast.Constant) and keyword.value.value is False
                ):
                    said = f"{keyword.arg}="
        if said:
            found.append(f"{said} in line {node.lineno}")
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(SOURCES[0].parent)))
def test_nothing_in_the_package_runs_what_stands_in_a_file(path):
    assert dangers(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from joblib import load",
        "import pickle.whatever",
        "eval('1')",
        "exec(text)",
        "yaml.load(stream)",
        "yaml.parse(text, Loader=yaml.FullLoader)",
        "from yaml import unsafe_load",
        "np.load(path, allow_pickle=True)",
        "subprocess.run(text, shell=True)",
        "os.system(text)",
    ],
)
def test_the_search_finds_each_of_them(source):
    assert len(dangers(source)) == 1


def test_the_search_covers_the_package():
    assert len(SOURCES) > 100
