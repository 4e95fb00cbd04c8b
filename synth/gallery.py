"""A contact sheet with one frame of every spec."""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from synth.errors import SpecError
from synth.render import Studio, workers
from synth.session import progress_bar
from synth.spec import Spec, read_spec
from synth.take import perform, view

SHIPPED = Path(__file__).resolve().parents[1] / "configs"
"""The specs that a checkout contains."""

_TILE = (320, 240)
_LABEL = 24
"""Height of the caption under a picture, px."""


def gallery(specs: Mapping[Path, Spec], out: Path) -> Path:
    """Render one frame of each spec to ``gallery.png``.

    Parameters
    ----------
    specs : mapping of Path to Spec
        The specs and their files; empty for all shipped specs.
    out : Path
        Folder, created if it does not exist.

    Returns
    -------
    Path
        Path of the picture.

    Raises
    ------
    SpecError
        If a spec is wrong or there is no spec.
    RenderError
        If this machine cannot draw off-screen.
    """
    shown = specs or {path: read_spec(path) for path in sorted(SHIPPED.glob("*.yaml"))}
    if not shown:
        raise SpecError(f"{SHIPPED}: no specs there; name some")
    out.mkdir(parents=True, exist_ok=True)
    with progress_bar() as progress, ThreadPoolExecutor(workers()) as side_by_side:
        pictures = side_by_side.map(_one_frame, shown.keys(), shown.values())
        drawn = progress.track(pictures, total=len(shown), description="gallery")
        tiles = [_labelled(picture, path.stem) for picture, path in zip(drawn, shown, strict=True)]
    columns = min(len(tiles), math.ceil(math.sqrt(1.5 * len(tiles))))
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % columns)
    sheet = np.vstack([np.hstack(tiles[start : start + columns]) for start in range(0, len(tiles), columns)])
    written = out / "gallery.png"
    if not cv2.imwrite(str(written), sheet[..., ::-1]):
        raise OSError(f"{written}: cannot be written")
    return written


def _one_frame(path: Path, spec: Spec) -> NDArray[np.uint8]:
    """Draw the frame with the head farthest from neutral."""
    seen = view(spec)
    try:
        take = perform(spec, seen)[0]
    except SpecError as error:
        raise SpecError(f"{path}: {error}") from error
    own = np.flatnonzero(~take.table.repeats)
    frame = int(own[np.argmax(np.abs(take.motion.angle(take.table.taken[own])))])
    with Studio(spec, seen, 1) as studio:
        return next(studio.film(take, [frame]))


def _labelled(picture: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    height, width = picture.shape[:2]
    scale = min(_TILE[0] / width, _TILE[1] / height)
    small = cv2.resize(picture, (round(width * scale), round(height * scale)), interpolation=cv2.INTER_AREA)
    tile = np.full((_TILE[1] + _LABEL, _TILE[0], 3), 255, dtype=np.uint8)
    tile[: small.shape[0], : small.shape[1]] = small
    cv2.putText(tile, name, (6, _TILE[1] + 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)
    return tile
