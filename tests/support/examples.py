"""Six sessions to view and to measure by hand, each with a different difficulty.

To draw them: PYTHONPATH=tests python -m support.examples FOLDER TRUTH_FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

from .drawn import Look, Plant, Recording, draw_session, standard_recordings, write_truth

EXAMPLES: dict[str, dict] = {
    "ring_auto": {"look": Look()},
    "disc_dark": {
        "look": Look(marker="disc_dark", background="gradient", red_object="book", red_place="near"),
        "recordings": [Recording("stairs", "stairs"), Recording("chirp", "chirp", amplitude_deg=8.0)],
        "mouth": "declared",
    },
    "left_facing": {
        "look": Look(facing="left", lever_px=210.0, skin="dark", marker="ring_white", distractor="pendulum"),
        "recordings": [Recording("steps"), Recording("random", "random", held_out=True)],
    },
    "no_marker": {
        "look": Look(lever_px=150.0, marker="none", red_place="near", distractor="led"),
        "recordings": [Recording("stairs", "stairs", amplitude_deg=16.0), Recording("triangle", "triangle")],
        "hint_error_px": None,
    },
    "dead_time40": {"look": Look(lever_px=195.0, background="gradient"), "plant": Plant(dead_time_s=0.040)},
    "free_release": {
        "look": Look(marker="disc_bright", skin="dark"),
        "plant": Plant(a=1.2, b=60.0, c=0.0),
        "recordings": [
            Recording("release_up", "release", amplitude_deg=14.0),
            Recording("release_down", "release", amplitude_deg=-9.0, rest_s=0.0),
        ],
    },
}


def draw_examples(folder: str | Path, truth_folder: str | Path) -> None:
    """Film every example into a separate session, and write its truth to another folder."""
    for seed, (name, session) in enumerate(EXAMPLES.items()):
        session = {"recordings": standard_recordings(), "seed": seed} | session
        for clip, truth in draw_session(Path(folder) / name, **session).items():
            write_truth(Path(truth_folder) / name / f"{clip}.truth.csv", truth)


if __name__ == "__main__":
    draw_examples(*sys.argv[1:3])
