"""Draws sessions to film: effect, size, plant, commands, rig and camera of each case come from a seed.

    .venv/bin/python -m benchmarks.blind.drawn_films --first 100 --seeds 3 --out build/drawn
    .venv/bin/python -m benchmarks.blind.films --cases build/drawn --keep build/drawn

The folders are like those of ``tests/blind``.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import yaml

from anglecam.effects import effect
from benchmarks.blind.drawn import ALL, NUMBERED, OUTSIDE, draw
from benchmarks.blind.judged import true_values
from benchmarks.blind.sessions import HELD_OUT, Effects, look, scaled, spec_of
from synth.spec import Spec
from synth.spec.picture import LIPSTICKS, SKINS, Camera
from synth.take import FACE_Z

LEAST_DEG, MOST_DEG = 0.04, 0.5
"""Range of the base model's residual: from approximately ten times a film's noise to plainly visible."""
WITHIN_SIGMA = 3
READ_OUT = 0.9
"""Largest readout time of a rolling shutter, as a share of the frame interval."""
MOST_TILT_DEG = 25.0
"""Largest camera tilt; a user would notice a larger one."""
HALVINGS = 4
"""Number of times a size that the rig cannot show is halved."""


def film_spec(name: str, seed: int) -> Spec:
    """Draw the spec of a film.

    Parameters
    ----------
    name : str
        An id of `benchmarks.blind.drawn.ALL`.
    seed : int
        Seed of all random choices.

    Returns
    -------
    Spec
        A spec for ``synth`` that declares pivot, mouth and held-out recordings, and a neutral if a constant torque
        acts.

    Raises
    ------
    ValueError
        If the rig cannot show any size of the effect.
    """
    rng = np.random.default_rng([seed, NUMBERED.index(name), 2])
    content = spec_of(_sized(name, seed, rng), seed=seed).model_dump(mode="json", exclude_unset=True)
    content["camera"] |= _camera(rng)
    if "rolling_shutter" in content["effects"]:
        # a sensor reads its last row before the next frame begins
        rows = content["effects"]["rolling_shutter"]
        rows["row_time_s"] = min(rows["row_time_s"], READ_OUT / (content["camera"]["fps"] * Camera().size[1]))
    content["rig"] |= {
        "head": str(rng.choice(["female", "male"])),
        "skin": str(rng.choice(list(SKINS))),
        "lips": str(rng.choice([lips for lips in LIPSTICKS if lips != "bare"])),
    }
    spec = Spec.model_validate(content)
    seen = look(spec)
    x, y = seen.pinhole.project([*seen.mark_offset, FACE_Z])
    declared: dict[str, Any] = {
        "mouth": {"rgb": list(spec.rig.lips_rgb)},
        "pivot": {"near": [round(x + rng.uniform(-3, 3)), round(y + rng.uniform(-3, 3))], "marker": "auto"},
        "facing": spec.rig.facing,
        "held_out": list(HELD_OUT),
    }
    if name == "constant_torque":
        ahead, up = seen.mouth
        declared["neutral"] = round(math.degrees(math.atan2(up, ahead)), 3)
    return spec.model_copy(update={"declare": declared})


def _sized(name: str, seed: int, rng: np.random.Generator) -> Effects:
    """Draw the effect's size; halve it while the rig cannot show it."""
    leaves_deg = math.exp(rng.uniform(math.log(LEAST_DEG), math.log(MOST_DEG)))
    for halving in range(HALVINGS):
        try:
            effects = scaled(draw(name, seed), seed, leaves_deg / 2**halving, sigma_deg=1.0)
        except ValueError as error:
            cause = error
            continue
        if effects[name].get("tilt_deg", 0.0) <= MOST_TILT_DEG:
            return effects
        cause = ValueError(f"{name}: session {seed} shows less of it than can be seen")
    raise cause


def _camera(rng: np.random.Generator) -> dict[str, Any]:
    codecs: list[dict[str, Any]] = [
        {"codec": "mjpeg", "quality": int(rng.integers(1, 5))},
        {"codec": "ffv1"},
        {"codec": "h264", "crf": int(rng.integers(14, 21))},
    ]
    return {
        "fps": float(rng.choice([25, 30, 40])),
        "noise_grey": float(rng.uniform(1, 3)),
        "gamma": float(rng.choice([1.0, 2.2])),
        "focus_blur_px": float(rng.uniform(0, 0.8)),
        **codecs[rng.integers(len(codecs))],
    }


def write_case(name: str, seed: int, out: Path) -> None:
    """Write ``spec.yaml`` and ``expected.yaml`` of one case into its folder ``NAME-SEED``.

    Raises
    ------
    ValueError
        As from `film_spec`.
    """
    spec = film_spec(name, seed)
    values = true_values(spec, spec.effects.model_dump(exclude_none=True))
    parameters = [
        {"name": effect(one).parameters[0].name, "value": float(f"{value:.6g}"), "within_sigma": WITHIN_SIGMA}
        for one, value in values.items()
    ]
    expected = {
        "verdict": "unexplained" if name in OUTSIDE else "attributed",
        "effects": list(values),
        "parameters": parameters,
    }
    folder = out / f"{name}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    for file, content in (("spec.yaml", spec.model_dump(mode="json", exclude_unset=True)), ("expected.yaml", expected)):
        (folder / file).write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def main(
    out: Annotated[Path, typer.Option(help="Folder for the cases.")],
    first: Annotated[int, typer.Option(help="First seed.")] = 100,
    seeds: Annotated[int, typer.Option(help="Sessions of each effect.")] = 3,
    effects: Annotated[str, typer.Option(help="Comma-separated ids; all by default.")] = "",
) -> None:
    """Draw the cases of all effects, including those outside the ledger."""
    for name in effects.split(",") if effects else ALL:
        for seed in range(first, first + seeds):
            try:
                write_case(name, seed, out)
            except ValueError as error:
                typer.echo(f"{name}, seed {seed}: {error}", err=True)


if __name__ == "__main__":
    typer.run(main)
