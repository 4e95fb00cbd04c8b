"""Build the documentation site: gather the pages, generate the reference and the pictures, run Zensical.

    python docs/build_site.py [OUT]

OUT is ``build`` by default; the site is then ``build/site``. Nothing is fetched, and a warning ends the build.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

from site_pages import effects, keys, notebook, options, pictures  # noqa: E402

PROJECT = {
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "benchmarks/README.md": "project/benchmarks.md",
    "configs/README.md": "project/specs.md",
    "README.md": "index.md",
}
"""Pages outside docs/, and where they are on the site."""
API = """# Functions and types

::: anglecam.api

::: anglecam.data.series.AngleSeries

::: anglecam.identification.identified.Identified

::: anglecam.loop.verdict.Verdict

::: anglecam.io.rig

::: anglecam.io.session.Session

::: anglecam.effects.effect.Effect

::: anglecam.errors
"""


def build(out: Path) -> Path:
    """Build the site in ``out/site`` and return that folder."""
    out.mkdir(parents=True, exist_ok=True)
    pages = out / "pages"
    shutil.rmtree(pages, ignore_errors=True)
    for source in sorted(DOCS.rglob("*.md")):
        _copy(source, pages / source.relative_to(DOCS), pages)
    for picture in (*DOCS.glob("*.jpg"), *DOCS.glob("*.webp")):
        shutil.copyfile(picture, pages / picture.name)
    for name, target in PROJECT.items():
        if target != "index.md":
            _copy(ROOT / name, pages / target, pages)
    for schema in sorted((ROOT / "anglecam/io/schemas").glob("*.json")):
        _write(pages / "schemas" / schema.name, schema.read_text())
    for name, text in effects.pages().items():
        _write(pages / "effects" / f"{name}.md", text)
    _write(pages / "reference/options.md", options.page())
    _write(pages / "reference/keys.md", keys.page())
    _write(pages / "reference/api.md", API)
    notebook.render(DOCS / "tutorials/notebook.ipynb", pages / "tutorials")
    pictures.draw(pages / "pictures")
    shutil.copyfile(DOCS / "zensical.toml", out / "zensical.toml")
    _zensical(out)
    return out / "site"


def _copy(source: Path, target: Path, pages: Path) -> None:
    """Copy a page; its links to files of the repository become links to pages of the site."""

    def linked(match: re.Match[str]) -> str:
        text, address, anchor = match.groups("")
        if address.startswith("http"):
            return match.group(0)
        return f"[{text}]({_relative(_on_site((source.parent / address).resolve()), target, pages)}{anchor})"

    text = re.sub(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)#\s]+)(#[^)]*)?\)", lambda m: linked(m), source.read_text())
    _write(target, _repository_link(text))


def _on_site(file: Path) -> str:
    """Return the place on the site of a file of the repository; a file that has none is named by its path."""
    name = file.relative_to(ROOT).as_posix()
    if name in PROJECT:
        return PROJECT[name]
    if name.startswith("anglecam/io/schemas/"):
        return f"schemas/{file.name}"
    if name.startswith("docs/"):
        return name.removeprefix("docs/").replace(".ipynb", ".md")
    return f"repository:{name}"


def _relative(place: str, target: Path, pages: Path) -> str:
    if place.startswith("repository:"):
        return place
    depth = len(target.relative_to(pages).parts) - 1
    return "../" * depth + place


def _repository_link(text: str) -> str:
    """Turn a link to a file that is only in the repository into its path."""
    return re.sub(r"\[[^\]]*\]\(repository:([^)]+)\)", r"`\1`", text)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _zensical(out: Path) -> None:
    """Run Zensical; any warning is an error."""
    program = Path(sys.executable).with_name("zensical")
    for folder in ("site", ".cache"):
        shutil.rmtree(out / folder, ignore_errors=True)
    call = [program, "build", "--strict", "--config-file", out / "zensical.toml"]
    done = subprocess.run(call, cwd=out, capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    if done.returncode or "warning" in said.lower():
        raise SystemExit(f"zensical:\n{said}")


if __name__ == "__main__":
    print(build(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "build"))
