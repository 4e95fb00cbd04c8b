"""A tracker's file format is one module: added to the package, it is found, read and measured like the others."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.tracks.files import FORMATS, TRACKS_ENDINGS, find_tracks, name_by_tool, read_tracks, tracker_names

MODULE = '''
"""The files of toytracker: the line ``# toytracker``, a header, then frame, x and y of nose and neck."""

import numpy as np

from anglecam.io.tracks.tracks import Tracks
from anglecam.io.tracks.tracks_format import TracksFormat


def _read(file):
    rows = np.loadtxt(file.path, delimiter=",", skiprows=2, ndmin=2)
    points = rows[:, None, 1:].reshape(len(rows), 1, 2, 2)
    return Tracks(file.path, ("",), ("nose", "neck"), points, np.full(points.shape[:3], np.nan))


FORMAT = TracksFormat(
    program="toytracker",
    kind="file",
    endings=(".csv", ".toy"),
    recognises=lambda file: file.first_line == "# toytracker",
    read=_read,
    clip_name=lambda stem: stem.removesuffix("-toy") if stem.endswith("-toy") else None,
)
'''
PROGRAM = """
import json, sys
from pathlib import Path

import anglecam.io.tracks

anglecam.io.tracks.__path__.append(sys.argv[1])

from anglecam.errors import InputError
from anglecam.io.rig import Rig, RigKeypoints
from anglecam.io.session import find_measurable, recording_name
from anglecam.io.tracks.files import TRACKS_ENDINGS, read_tracks, tracker_names
from anglecam.measurement.tracks import measure_tracks

folder = Path(sys.argv[2])
rig = Rig(marks=RigKeypoints(mouth="nose", pivot="neck", rate_hz=30.0))
toy = folder / "nod-toy.csv"
measured = measure_tracks(toy, rig)
try:
    read_tracks(folder / "other.csv")
except InputError as refusal:
    refused = str(refusal)
print(json.dumps({
    "found": [path.name for path in find_measurable(folder, rig)[0]],
    "name": recording_name(toy),
    "angle_deg": list(map(float, measured.series.angle * 57.29577951308232)),
    "by": measured.by,
    "usual_limit": read_tracks(toy).usual_limit,
    "deeplabcut": read_tracks(folder / "film.csv").software,
    "endings": TRACKS_ENDINGS,
    "trackers": tracker_names(),
    "refused": refused,
    "h5py is loaded": "h5py" in sys.modules,
}))
"""


def _alternatives(names):
    """Return ``A, B or C``."""
    return " or ".join([", ".join(names[:-1]), names[-1]])


def test_the_formats_are_those_of_the_packages_modules():
    programs = [f.program for f in FORMATS]
    assert {"DeepLabCut", "SLEAP"} <= set(programs)
    assert programs == sorted(set(programs))
    assert {".csv", ".h5", ".hdf5"} <= set(TRACKS_ENDINGS)
    assert tracker_names() == _alternatives(programs)


@pytest.fixture(scope="module")
def with_toytracker(tmp_path_factory):
    """Return what a new interpreter reports in which the package holds one more module."""
    package, folder = tmp_path_factory.mktemp("package"), tmp_path_factory.mktemp("clips")
    (package / "toytracker.py").write_text(MODULE)
    angle = np.radians(5.0 * np.sin(np.arange(40) / 5.0))
    rows = np.column_stack([np.arange(40), 200 + 100 * np.cos(angle), 300 - 100 * np.sin(angle)])
    lines = "".join(f"{frame:.0f},{x:.6f},{y:.6f},200,300\n" for frame, x, y in rows)
    (folder / "nod-toy.csv").write_text("# toytracker\nframe,nose_x,nose_y,neck_x,neck_y\n" + lines)
    (folder / "film.csv").write_text("scorer,a,a\nbodyparts,nose,nose\ncoords,x,y\n0,1,2\n")
    (folder / "other.csv").write_text("time_s,angle_deg\n0,1\n")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, package, folder],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), np.degrees(angle)


def test_one_more_module_makes_its_files_measurable(with_toytracker):
    report, angle = with_toytracker
    np.testing.assert_allclose(report["angle_deg"], angle - np.median(angle), atol=1e-4)
    assert report["by"] == "nose (toytracker)"
    assert report["name"] == "nod"
    assert report["usual_limit"] == 0.0
    assert set(report["endings"]) == {*TRACKS_ENDINGS, ".toy"}


def test_formats_that_share_an_ending_are_distinguished_by_their_content(with_toytracker):
    report, _ = with_toytracker
    assert report["found"] == ["film.csv", "nod-toy.csv"]
    assert report["deeplabcut"] == "DeepLabCut"


def test_messages_list_every_program(with_toytracker):
    report, _ = with_toytracker
    programs = sorted([*(f.program for f in FORMATS), "toytracker"])
    assert report["trackers"] == _alternatives(programs)
    texts = sorted([*(f"{f.program} {f.kind}" for f in FORMATS if ".csv" in f.endings), "toytracker file"])
    refused = f"not a {_alternatives(texts)} (it begins with 'time_s,angle_deg')"
    assert report["refused"].endswith(f"other.csv: {refused}")


def test_text_formats_do_not_load_hdf5(with_toytracker):
    assert with_toytracker[0]["h5py is loaded"] is False


def test_a_file_of_an_unknown_ending_is_refused_in_one_line(tmp_path):
    path = tmp_path / "points.txt"
    path.write_text("1 2 3\n")
    with pytest.raises(InputError, match=r"points\.txt: not a DeepLabCut table.* or ") as refused:
        read_tracks(path)
    assert "\n" not in str(refused.value)
    assert find_tracks(tmp_path) == []
    assert name_by_tool("points") is None
