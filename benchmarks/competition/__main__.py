"""Lets the results of the trackers compete on drawn films, by how well they predict held-out pixels.

    .venv/bin/python -m benchmarks.competition FIRST LAST [--only-follow]

Of each film with a seed from FIRST to LAST the row says which tracker predicts best, how far its turns are from the
truth in the sampled frames, and whether another tracker was right. Samples and proposals are kept in
build/competition; with ``--only-follow`` nothing more is done.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from anglecam.engine.score import Proposal, Score, best_rival, score
from benchmarks.competition.films import Contest, contest
from benchmarks.drawn.kinds import KINDS

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "build" / "competition"
ROWS = Path(__file__).with_name("rows.json")
RIGHT_DEG = 0.3
RIGHT_SHARE = 0.05
"""A proposal is right if it is off, RMS, by less than either: degrees, or a share of the true motion's RMS."""
PROBABLE = 0.95
"""Probability from which on an explanation counts as better than another one."""
KINDS_OF_ROW = ("right", "wrong", "no tracker is right", "nothing proposed", "no sample")


@dataclass(frozen=True)
class Row:
    """What became of one film."""

    name: str
    faults: str
    verdict: str
    """One of `KINDS_OF_ROW`, for the tracker that predicts best."""
    winner: str = ""
    error_deg: float | None = None
    share: float | None = None
    """Error of the winner, RMS in the sampled frames, as it is and by the true motion's RMS."""
    ahead_of_next: float | None = None
    """Probability that the winner predicts better than the next tracker."""
    rival: str = ""
    ahead_of_rival: float | None = None
    """What else the winner's motion may be, and the probability that the winner predicts better."""
    ahead_of_truth: float | None = None
    others: str = ""
    """The other trackers, those that are right in capitals."""

    @property
    def accepted(self) -> bool:
        """Whether the winner is more probable than what it may be mistaken for."""
        return self.ahead_of_rival is not None and self.ahead_of_rival >= PROBABLE


def row_of(kind: str, seed: int) -> Row:
    """Let the trackers of one film compete."""
    found = contest(kind, seed, KEPT)
    if isinstance(found, str):
        return Row(f"{kind}-{seed}", "", "no sample", rival=found)
    if not found.found:
        return Row(found.name, found.faults, "nothing proposed")
    scores = {one.name: score(found.sample, one.name, one.poses(found.sample)) for one in found.proposals}
    ranked = sorted(found.found, key=lambda one: -scores[one.name].total)
    right = {one.name: _is_right(*off) for one in ranked if (off := _error(one, found)) is not None}
    winner = ranked[0]
    error = _error(winner, found) or (float("nan"), float("nan"))
    rival = best_rival(found.sample, winner)
    verdict = "right" if right.get(winner.name) else "wrong" if any(right.values()) else "no tracker is right"
    return Row(
        found.name,
        found.faults,
        verdict,
        winner.name,
        *error,
        _ahead(scores, ranked),
        rival.name,
        scores[winner.name].ahead_of(rival),
        scores[winner.name].ahead_of(max((scores[one.name] for one in found.true), key=lambda s: s.total)),
        " ".join(one.name.upper() if right.get(one.name) else one.name for one in ranked[1:]),
    )


def _ahead(scores: dict[str, Score], ranked: list[Proposal]) -> float | None:
    return scores[ranked[0].name].ahead_of(scores[ranked[1].name]) if len(ranked) > 1 else None


def _error(one: Proposal, film: Contest) -> tuple[float, float] | None:
    """Return a proposal's error against the part that fits best, RMS: degrees, and by that part's motion."""
    known = np.isfinite(one.turn)
    if known.sum() < 3:
        return None
    errors = []
    for true in film.true:
        off = np.exp(1j * (one.turn - true.turn)[known])
        rms = float(np.sqrt((np.angle(off / off.mean()) ** 2).mean()))
        errors.append((np.degrees(rms), rms / float(np.std(true.turn))))
    return min(errors)


def _is_right(error_deg: float, share: float) -> bool:
    return error_deg < RIGHT_DEG or share < RIGHT_SHARE


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--only-follow", action="store_true")
    chosen = parser.parse_args()
    films = [(list(KINDS)[seed % len(KINDS)], seed) for seed in range(chosen.first, chosen.last + 1)]
    if chosen.only_follow:
        for kind, seed in films:
            contest(kind, seed, KEPT)
            print(f"{kind}-{seed}", file=sys.stderr, flush=True)
        return
    rows = []
    for kind, seed in films:
        rows.append(row_of(kind, seed))
        print(rows[-1], file=sys.stderr, flush=True)
    ROWS.write_text("[\n" + ",\n".join(json.dumps(asdict(row)) for row in rows) + "\n]\n")
    print(table(rows))


def table(rows: list[Row]) -> str:
    """Return the counts, and the films in which the winner is not right, as Markdown."""
    counts = Counter((row.verdict, row.accepted) for row in rows)
    lines = ["| of the tracker that predicts best | films | accepted |", "| --- | --- | --- |"]
    lines += [
        f"| {kind} | {counts[kind, True] + counts[kind, False]} | {counts[kind, True]} |" for kind in KINDS_OF_ROW
    ]
    lines += [
        "",
        "| film | faults | winner | off | next | rival | others |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        if row.verdict in ("wrong", "no tracker is right") or (row.verdict == "right" and not row.accepted):
            off = "" if row.error_deg is None else f"{row.error_deg:.2f}°, {100.0 * (row.share or 0.0):.0f} %"
            ahead = "" if row.ahead_of_next is None else f"{row.ahead_of_next:.2f}"
            rival = f"{row.rival} {row.ahead_of_rival:.2f}"
            cells = (row.name, row.faults, row.winner, off, ahead, rival, row.others)
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
