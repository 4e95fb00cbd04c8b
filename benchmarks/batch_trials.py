"""What becomes of good results when something goes wrong in a first batch or in a second one.

    PYTHONPATH=tests .venv/bin/python benchmarks/batch_trials.py [trouble ...]

Each row is one run of the command on the clips and with the trouble of `tests/support/batch_trials.py`. Files are
compared byte by byte with those of a batch without trouble, of the clip as it was or as it is after its bytes have
changed. Afterwards the trouble is over and the batch is called again; the last column states whether its files are
those of a batch without trouble. ``tests/batch/test_good_results_stay.py`` asserts the same.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from datetime import date
from pathlib import Path

from support.batch_trials import TRIALS, Call, Lab, Trial, call_batch, good, make_lab, restored
from support.tiny import results

COLUMNS = ("trouble", "batch", "before", "equal", "newer", "lost", "exit status", "printed", "afterwards")


def row(trial: Trial, lab: Lab, out: Path, *, second: bool) -> list[str]:
    """Run one trial and return its row."""
    if second:
        shutil.copytree(lab.out, out)
    before = good(out)
    with restored(lab):
        call = trial.cause(lab, out)
    after = good(out)
    equal = sum(after[name] == lab.files[name] for name in after)
    newer = sum(after[name] == lab.newer.get(name) != lab.files[name] for name in after)
    lost = [name for name, content in before.items() if after.get(name) not in (content, lab.newer.get(name))]
    lost += [name for name, content in after.items() if content not in (lab.files[name], lab.newer.get(name))]
    again = call_batch(*lab.asked, "--jobs", 1, "--out", out, "--retry-failed")
    restored_all = again == Call(0, ()) and results(out) == lab.files
    counts = (len(before), equal, newer, len(lost), call.status)
    printed = "; ".join(f"`{shortened(line, lab, out)}`" for line in call.lines) or "nothing"
    return [
        trial.name,
        "second" if second else "first",
        *map(str, counts),
        printed,
        "equal" if restored_all else "different",
    ]


def shortened(line: str, lab: Lab, out: Path) -> str:
    """Return a line with the folders' names in place of temporary paths, and without addresses that vary."""
    line = re.sub(r"_do-[0-9a-f-]+ ", "", line.replace(str(lab.folder), "LAB").replace(str(out), "OUT"))
    return re.sub(r"tcp://[\d.]+:\d+", "tcp://HOST:PORT", re.sub(r"process \d+ on [^)]+", "process N on HOST", line))


def main(names: list[str]) -> None:
    """Run the trials of these names, or all, and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        top = Path(folder)
        lab = make_lab(top)
        print(f"{date.today():%d %B %Y}; {len(good(lab.out))} good files of 3 clips\n")
        print(f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}")
        trials = {trial.cause.__name__: trial for trial in TRIALS}
        for trial in [trials[name] for name in names or trials]:
            for second in (False, True):
                out = top / f"{trial.cause.__name__}-{second}" / "out"
                out.parent.mkdir()
                print(f"| {' | '.join(row(trial, lab, out, second=second))} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
