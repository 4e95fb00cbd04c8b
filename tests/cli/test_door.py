"""What is wrong with a call is said before anything is loaded that takes long to load.

The calls of one command run one after another in a fresh interpreter: a library that one of them loads stays loaded.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

HEAVY = ("numba", "llvmlite", "cv2", "scipy", "skimage", "matplotlib", "av", "pandas", "pyarrow", "h5py", "control")
"""Libraries that take longer to load than a wrong call may take in all."""
PROGRAM = f"""
import json, sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

from anglecam.cli.app import main as anglecam
from synth.cli import main as synth

found = []
for program, *arguments in json.load(sys.stdin):
    sys.argv = [program, *arguments]
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as said:
        try:
            {{"anglecam": anglecam, "synth": synth}}[program]()
            status = 0
        except SystemExit as left:
            status = left.code or 0
    found.append([status, said.getvalue(), [name for name in {HEAVY!r} if name in sys.modules]])
json.dump(found, sys.stdout)
"""

LAID = {
    "film/a.mp4": "a film is not opened",
    "typo/a.mp4": "a film is not opened",
    "typo/rig.yaml": "pivott: {near: [1, 2]}",
    "empty/a.mp4": "",
    "series/a.angles.csv": "time_s,angle_deg\n0,1\n0.1,2\n",
    "bad.yaml": "pivott: {near: [1, 2]}",
    "neck.yaml": "masss: 3",
    "text": "no model",
    "spec.yaml": "platn: {}",
}
TYPO = ("unknown key pivott; did you mean pivot?", 2)
NO_FILE = ("no.avi: no such file", 1)
EMPTY = ("a.mp4: empty file", 1)
OUT = "--out out"
CALLS = {
    "help": [
        *((f"anglecam {verb} --help", "", 0) for verb in (
            "", "check", "measure", "live", "budget", "calibrate", "identify", "close", "certify", "export", "batch",
            "doctor", "view", "neck", "neck kinematics", "neck response", "neck pd",
        )),
        *((f"synth {verb} --help", "", 0) for verb in ("", "render", "score", "gallery")),
        ("anglecam --version", "", 0),
        ("anglecam mesure", "No such command", 2),
        ("anglecam doctor now", "unexpected extra argument", 2),
    ],
    "measure": [
        (f"anglecam measure no.avi {OUT}", *NO_FILE),
        (f"anglecam measure empty/a.mp4 {OUT}", *EMPTY),
        (f"anglecam measure typo/a.mp4 {OUT}", *TYPO),
        (f"anglecam measure film/a.mp4 --rig bad.yaml {OUT}", *TYPO),
        (f"anglecam measure film/a.mp4 --rig no.yaml {OUT}", "no.yaml: cannot be read", 2),
        (f"anglecam measure film/a.mp4 --from x {OUT}", "--from", 2),
        (f"anglecam measure film/a.mp4 --from 9 --to 3 {OUT}", "no frame lies from 9 to 3", 2),
        (f"anglecam measure typo/a.mp4 typo/a.mp4 {OUT}", "has the same name; measure them to separate folders", 2),
        ("anglecam measure film/a.mp4 --out text", "is a file; give a folder", 2),
        (f"anglecam measure series/a.angles.csv {OUT}", "holds angles already", 1),
    ],
    "other clips": [
        ("anglecam check no.avi", *NO_FILE),
        ("anglecam check empty/a.mp4", *EMPTY),
        ("anglecam check typo/a.mp4", *TYPO),
        ("anglecam check film/a.mp4 --command no.csv", "no.csv: cannot be read as CSV", 1),
        (f"anglecam budget no.avi {OUT}", *NO_FILE),
        (f"anglecam budget typo/a.mp4 {OUT}", *TYPO),
        (f"anglecam budget empty/a.mp4 series/a.mp4 {OUT}", "has the same name", 1),
        (f"anglecam calibrate no.avi {OUT}", *NO_FILE),
        (f"anglecam calibrate film/a.mp4 --board 9 {OUT}", "--board 9", 2),
        (f"anglecam live no.avi {OUT}", *NO_FILE),
        (f"anglecam live typo/a.mp4 {OUT}", *TYPO),
        (f"anglecam live film/a.mp4 --command no.csv {OUT}", "no.csv: cannot be read as CSV", 1),
        ("anglecam view no.avi", "no.avi: no such file or folder", 2),
        ("anglecam view series", "no clip in this folder", 2),
    ],
    "sessions": [
        (f"anglecam identify no {OUT}", "no: no such folder", 2),
        (f"anglecam identify typo {OUT}", *TYPO),
        (f"anglecam identify series --estimator oe9 {OUT}", "choose one of ekf, neck, oe2, oe3", 2),
        (f"anglecam identify series --neck neck.yaml {OUT}", "used by --estimator neck only", 2),
        (f"anglecam identify series --estimator neck --neck neck.yaml {OUT}", "unknown key masss", 2),
        (f"anglecam close no {OUT}", "no: no such folder", 2),
        (f"anglecam close typo {OUT}", *TYPO),
        (f"anglecam close series --hold-out b {OUT}", "hold out b: no such recording", 2),
        (f"anglecam certify typo {OUT}", *TYPO),
        (f"anglecam certify series --hold-out b {OUT}", "hold out b: no such recording", 2),
        ("anglecam export no.json --to urdf", "no.json: cannot be read", 1),
        ("anglecam export text --to urdf", "neither a loop.json nor a model.json", 1),
        ("anglecam export text --to stl", "--to stl: choose one of", 2),
    ],
    "batch": [
        (f"anglecam batch no {OUT}", "no: no such folder", 2),
        (f"anglecam batch film --rig bad.yaml {OUT}", *TYPO),
        (f"anglecam batch film --jobs 0 {OUT}", "--jobs", 2),
        ("anglecam batch film --out text", "is a file; give a folder", 2),
    ],
    "neck": [
        ("anglecam neck kinematics --neck no.yaml", "no.yaml: cannot be read", 2),
        ("anglecam neck statics --neck neck.yaml", "unknown key masss", 2),
        ("anglecam neck design --model no.json", "no.json: cannot be read", 1),
        ("anglecam neck pd --model text", "neither a loop.json nor a model.json", 1),
        ("anglecam neck response --measured no.csv", "no.csv: cannot be read as CSV", 1),
        ("anglecam neck sensitivity --neck neck.yaml", "unknown key masss", 2),
        ("anglecam neck power no.csv", "no.csv: cannot be read as CSV", 1),
    ],
    "synth": [
        (f"synth render no.yaml {OUT} --truth truth", "no.yaml: cannot be read", 2),
        (f"synth render spec.yaml {OUT} --truth truth", "unknown key platn; did you mean plant?", 2),
        ("synth score no --truth no", "no truth.json in it", 2),
        (f"synth gallery spec.yaml {OUT}", "unknown key platn; did you mean plant?", 2),
    ],
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    here = tmp_path_factory.mktemp("door")
    for name, text in LAID.items():
        (here / name).parent.mkdir(exist_ok=True)
        (here / name).write_text(text)
    return here


@pytest.mark.parametrize("group", CALLS)
def test_a_wrong_call_is_answered_without_loading_what_measures(folder, group):
    calls = [call.split() for call, _, _ in CALLS[group]]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=json.dumps(calls),
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | {"NO_COLOR": "1"},
        timeout=300,
        check=True,
    )
    for (call, says, code), (status, said, loaded) in zip(CALLS[group], json.loads(done.stdout), strict=True):
        assert says in said, call
        assert (call, status, loaded) == (call, code, [])
