"""The written manual agrees with the code: links, lists and examples."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from anglecam.effects import LEDGER
from anglecam.identification.estimators import ESTIMATORS
from anglecam.io.tracks.files import FORMATS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
README_WORDS = 1500


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text())
    made = {f"effects/{effect.id}.md" for effect in LEDGER}  # by docs/build_site.py, like the pictures
    missing = [t for t in targets if not t.startswith(("http", "pictures/")) and not (page.parent / t).exists()]
    assert set(missing) <= made


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_examples_are_valid_python(page: Path) -> None:
    for example in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
        ast.parse(example)


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().split()) <= README_WORDS


def test_every_effect_estimator_and_tracker_format_is_in_the_manual() -> None:
    effects, estimators, tracks = (
        (ROOT / "docs" / name).read_text() for name in ("effects.md", "identification.md", "measuring.md")
    )
    assert [e.id for e in LEDGER if f"| `{e.id}` |" not in effects] == []
    assert [p.name for e in LEDGER for p in e.parameters if f"`{p.name}`" not in effects] == []
    assert [name for name in ESTIMATORS if f"| `{name}`" not in estimators] == []
    assert [f.program for f in FORMATS if f.program not in tracks] == []
