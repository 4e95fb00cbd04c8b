"""Tracks of DeepLabCut and SLEAP are read in every layout; other files are refused in one line."""

from __future__ import annotations

import pickle
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pandas as pd
import pytest

from anglecam.errors import InputError
from anglecam.io.tracks import deeplabcut
from anglecam.io.tracks.files import find_tracks, name_by_tool, read_tracks
from anglecam.io.tracks.names_in_pickle import read_names
from anglecam.io.tracks.tracks import choose_pair
from anglecam.io.tracks.tracks_format import open_tracks_file
from support.tracked import SCORER, frame, write_deeplabcut, write_sleap

RNG = np.random.default_rng(3)
POINTS = RNG.uniform(10.0, 500.0, (12, 2, 3, 2))
"""12 frames, 2 individuals, 3 points: no two axes have the same length but xy and individuals."""
SCORES = RNG.uniform(0.7, 1.0, (12, 2, 3))
NAMES = ("nose", "neck", "ear")


def read_as_deeplabcut(path):
    """Read a file by DeepLabCut's reader, whatever other formats have the same ending."""
    with open_tracks_file(path) as file:
        return deeplabcut.FORMAT.read(file)


def refusal(path, read=read_tracks) -> str:
    with pytest.raises(InputError) as caught:
        read(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


@pytest.mark.parametrize("ending", [".csv", ".h5"])
@pytest.mark.parametrize("layout", ["table", "fixed"])
def test_deeplabcut_of_several_animals_comes_back_as_it_was_written(tmp_path, ending, layout):
    path = tmp_path / f"film{SCORER}{ending}"
    write_deeplabcut(path, POINTS, SCORES, names=NAMES, individuals=("mia", "max"), layout=layout)
    tracks = read_tracks(path)
    assert (tracks.software, tracks.individuals, tracks.keypoints) == ("DeepLabCut", ("mia", "max"), NAMES)
    np.testing.assert_allclose(tracks.position_px, POINTS, rtol=1e-12)
    np.testing.assert_allclose(tracks.likelihood, SCORES, rtol=1e-12)


@pytest.mark.parametrize("ending", [".csv", ".h5"])
def test_deeplabcut_of_one_animal_has_three_header_rows_and_a_missing_row_is_a_frame_without_points(tmp_path, ending):
    table = frame(POINTS[:, :1], SCORES[:, :1], NAMES).drop(index=[4, 5])
    path = tmp_path / f"film{ending}"
    table.to_csv(path) if ending == ".csv" else table.to_hdf(path, key="df_with_missing", format="table", mode="w")
    tracks = read_tracks(path)
    assert tracks.position_px.shape == (12, 1, 3, 2)
    assert np.isnan(tracks.position_px[4:6]).all()
    np.testing.assert_allclose(np.delete(tracks.position_px, [4, 5], 0), np.delete(POINTS[:, :1], [4, 5], 0))


def test_columns_of_two_number_types_are_joined_from_two_blocks(tmp_path):
    table = frame(POINTS[:, :1], SCORES[:, :1], NAMES)
    table = table.astype({column: "float32" for column in table.columns if column[-1] == "likelihood"})
    for layout in ("table", "fixed"):
        path = tmp_path / f"{layout}.h5"
        table.to_hdf(path, key="df_with_missing", format=layout, mode="w")
        tracks = read_tracks(path)
        np.testing.assert_allclose(tracks.position_px, POINTS[:, :1])
        np.testing.assert_allclose(tracks.likelihood, SCORES[:, :1], rtol=1e-6)


def test_sleap_is_transposed_back(tmp_path):
    path = write_sleap(tmp_path / "film.analysis.h5", POINTS, SCORES, NAMES, ("mia", "max"))
    with h5py.File(path) as file:
        assert file["tracks"].shape == (2, 2, 3, 12)
    tracks = read_tracks(path)
    assert (tracks.software, tracks.individuals, tracks.keypoints) == ("SLEAP", ("mia", "max"), NAMES)
    np.testing.assert_array_equal(tracks.position_px, POINTS)
    np.testing.assert_array_equal(tracks.likelihood, SCORES)


@pytest.mark.parametrize("dims", ["frame track node xy", "xy node frame track"])
def test_the_order_of_sleap_axes_is_read_from_dims(tmp_path, dims):
    order = ["frame", "track", "node", "xy"]
    with h5py.File(tmp_path / "film.h5", "w") as file:
        file["node_names"], file["track_names"] = [b"nose", b"neck", b"ear"], [b"mia", b"max"]
        file["tracks"] = POINTS.transpose([order.index(d) for d in dims.split()])
        file["tracks"].attrs["dims"] = str(dims.split()).replace("'", '"')
        file["point_scores"] = SCORES.transpose([order.index(d) for d in dims.split() if d != "xy"])
    tracks = read_tracks(tmp_path / "film.h5")
    np.testing.assert_array_equal(tracks.position_px, POINTS)
    np.testing.assert_array_equal(tracks.likelihood, SCORES)


def test_untransposed_sleap_arrays_are_recognised_by_their_shape(tmp_path):
    with h5py.File(tmp_path / "film.h5", "w") as file:
        file["node_names"], file["track_names"] = [b"nose", b"neck", b"ear"], [b"mia", b"max"]
        file["tracks"] = POINTS.transpose(0, 2, 3, 1)
    np.testing.assert_array_equal(read_tracks(tmp_path / "film.h5").position_px, POINTS)


def test_sleap_without_track_names_or_scores_has_one_individual(tmp_path):
    with h5py.File(tmp_path / "film.h5", "w") as file:
        file["node_names"], file["track_names"] = [b"nose", b"neck", b"ear"], np.zeros(0)
        file["tracks"] = POINTS[:, :1].transpose(1, 3, 2, 0)
    tracks = read_tracks(tmp_path / "film.h5")
    assert tracks.individuals == ("",)
    assert np.isnan(tracks.likelihood).all()


def test_the_individual_with_the_most_frames_is_followed_and_reported(tmp_path):
    points = POINTS.copy()
    points[:5, 0, 0] = np.nan
    tracks = read_tracks(write_sleap(tmp_path / "film.h5", points, SCORES, NAMES, ("mia", "max")))
    pair = choose_pair(tracks, "nose", "neck", 0.2)
    np.testing.assert_array_equal(pair.mark_px, POINTS[:, 1, 0])
    assert pair.followed == "max is followed: it shows nose and neck most often (mia 7, max 12 frames)"


def test_a_point_of_no_animal_is_shared_by_all_animals(tmp_path):
    table = frame(POINTS, SCORES, NAMES, ("mia", "single"))
    rig, mia = [("single", "ear")], [("mia", "nose"), ("mia", "neck")]
    table = table.loc[:, [column[1:3] in rig + mia for column in table.columns]]
    table.to_csv(tmp_path / "film.csv")
    pair = choose_pair(read_tracks(tmp_path / "film.csv"), "nose", "ear", 0.6)
    np.testing.assert_allclose(pair.mark_px, POINTS[:, 0, 0])
    np.testing.assert_allclose(pair.pivot_px, POINTS[:, 1, 2])
    assert pair.followed.startswith("mia is followed")


def test_an_unlikely_point_is_missing_and_one_without_a_likelihood_is_not(tmp_path):
    scores = np.full((12, 1, 3), 0.9)
    scores[3, 0, 0], scores[4, 0, 0] = 0.59, np.nan
    tracks = read_tracks(write_deeplabcut(tmp_path / "film.csv", POINTS[:, :1], scores, names=NAMES))
    pair = choose_pair(tracks, "nose", "ear", tracks.usual_limit)
    assert np.flatnonzero(np.isnan(pair.mark_px[:, 0])).tolist() == [3]
    assert not np.isnan(pair.pivot_px).any()


def test_an_unknown_point_is_refused_with_a_list_of_the_known_ones(tmp_path):
    tracks = read_tracks(write_sleap(tmp_path / "film.h5", POINTS, SCORES, NAMES, ("mia", "max")))
    with pytest.raises(InputError, match=r"film\.h5: no point mouth in it; it has nose, neck, ear$"):
        choose_pair(tracks, "mouth", "neck", 0.2)


def test_a_table_is_read_without_pandas_and_pytables(tmp_path):
    path = write_deeplabcut(tmp_path / "film.h5", POINTS[:, :1], SCORES[:, :1], names=NAMES)
    program = (
        "import sys, pathlib, pickle; sys.modules.update(pandas=None, tables=None)\n"
        "from anglecam.io.tracks.files import read_tracks; import h5py\n"
        "pickle.load = pickle.loads = pickle.Unpickler = None\n"
        f"print(read_tracks(pathlib.Path({str(path)!r})).keypoints)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == str(NAMES), done.stderr


class _Bomb:
    def __reduce__(self):
        return exec, ("raise SystemExit('it was run')",)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_names_are_read_off_a_pickle_of_any_protocol_and_no_program_in_it_is_run(protocol):
    names = [("scorer", "nose", "x"), ("scorer", "nose", "y"), ("scorer", "mündchen", "x")]
    assert read_names(pickle.dumps(names, protocol)) == names
    for harmful in ([_Bomb()], _Bomb(), [("a", _Bomb())]):
        with pytest.raises(ValueError, match="stored as a program"):
            read_names(pickle.dumps(harmful, protocol))


@pytest.mark.parametrize(
    "damaged", [b"", b"(lp0\n", b"a.", b"(lp0\nVx\na.", b"I1\n.", b"g7\n.", b"\x80\x04]\x94K\x01a."]
)
def test_a_damaged_pickle_is_a_value_error(damaged):
    with pytest.raises(ValueError, match=r"."):
        read_names(damaged)


def test_a_table_whose_names_are_a_harmful_pickle_is_refused(tmp_path):
    path = write_deeplabcut(tmp_path / "film.h5", POINTS[:, :1], SCORES[:, :1], names=NAMES)
    with h5py.File(path, "a") as file:
        file["df_with_missing/table"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps([_Bomb()], 0))
    assert "stored as a program" in refusal(path)


def test_every_cut_of_an_hdf5_file_is_one_line(tmp_path):
    whole = write_deeplabcut(tmp_path / "film.h5", POINTS, SCORES, names=NAMES, individuals=("mia", "max"))
    data = whole.read_bytes()
    cut = tmp_path / "cut.h5"
    for share in (0.0, 0.05, 0.3, 0.6, 0.9, 0.99):
        cut.write_bytes(data[: int(share * len(data))])
        assert "cannot be read as HDF5" in refusal(cut)


def _is_refused(path) -> bool:
    try:
        read_tracks(path)
    except InputError as error:
        return "\n" not in str(error)
    return False


def test_flipped_bits_give_tracks_or_one_line(tmp_path):
    rng = np.random.default_rng(0)
    path = tmp_path / "damaged.h5"
    refused = 0
    for make in (write_deeplabcut, write_sleap):
        data = bytearray(make(tmp_path / "film.h5", POINTS[:, 0], names=NAMES).read_bytes())
        for _ in range(150):
            damaged = bytearray(data)
            for at in rng.integers(0, min(len(data), 8192), 12):
                damaged[at] ^= 1 << int(rng.integers(8))
            path.write_bytes(damaged)
            refused += _is_refused(path)
    assert refused > 20


def test_an_unknown_hdf5_file_is_refused_with_its_content(tmp_path):
    with h5py.File(tmp_path / "film.h5", "w") as file:
        file["images"], file["labels"] = np.zeros(3), np.zeros(3)
    refused = refusal(tmp_path / "film.h5")
    assert refused.endswith("not a DeepLabCut table or SLEAP analysis file (it holds images, labels)")
    (tmp_path / "text.h5").write_text("frame,x,y\n")
    assert "cannot be read as HDF5" in refusal(tmp_path / "text.h5")


def test_an_array_that_claims_an_absurd_size_or_lies_elsewhere_is_refused(tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_bytes(bytes(8 * 2 * 3 * 12))
    for name, options in {
        "absurd": {"shape": (1, 2, 3, 10**9), "chunks": (1, 2, 3, 10**5)},
        "elsewhere": {"shape": (1, 2, 3, 12), "external": [(str(secret), 0, h5py.h5f.UNLIMITED)]},
    }.items():
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            file["node_names"] = [b"nose", b"neck", b"ear"]
            file.create_dataset("tracks", dtype="f8", **options)
        line = refusal(tmp_path / f"{name}.h5")
        assert ("too many" if name == "absurd" else "not a dataset of this file") in line
    with h5py.File(tmp_path / "linked.h5", "w") as file:
        file["node_names"] = [b"nose", b"neck", b"ear"]
        file["tracks"] = h5py.ExternalLink(str(write_sleap(tmp_path / "film.h5", POINTS[:, 0], names=NAMES)), "/tracks")
    assert "no tracks in it" in refusal(tmp_path / "linked.h5")


def test_a_csv_that_is_no_table_of_tracks_is_one_line(tmp_path):
    good = write_deeplabcut(tmp_path / "good.csv", POINTS[:, 0, :2], SCORES[:, 0, :2]).read_text().splitlines()
    cases = {
        "a cell too many": ([*good[:5], good[5] + ",1", *good[6:]], "row 6 has 8 cells, the header has 7"),
        "a cell too few": ([*good[:5], good[5].rpartition(",")[0], *good[6:]], "row 6 has 6 cells"),
        "a word": ([*good[:5], good[5].rpartition(",")[0] + ",high", *good[6:]], "row 6: 'high' is not a number"),
        "no rows": (good[:3], "a header but no rows"),
        "another table": (["time_s,angle_deg", "0,1"], "not with scorer, bodyparts, coords"),
        "nothing": ([], "not a DeepLabCut table"),
        "frames backwards": ([*good[:3], good[4], good[3]], "does not number the frames"),
        "a far frame": ([*good[:4], "9999999" + good[4][1:]], "does not number the frames"),
        "pictures": ([*good[:3], "labeled-data/img001.png" + good[3][1:]], "'labeled-data/img001.png' is not a number"),
        "space": ([line.replace("likelihood", "z") for line in good], "coordinate 'z' in it"),
    }
    for lines, cause in cases.values():
        (tmp_path / "bad.csv").write_text("\n".join(lines) + "\n")
        assert cause in refusal(tmp_path / "bad.csv", read_as_deeplabcut)
        refusal(tmp_path / "bad.csv")
    (tmp_path / "bad.csv").write_bytes(b"\xff\xfe\x00scorer")
    assert "cannot be read as CSV" in refusal(tmp_path / "bad.csv", read_as_deeplabcut)
    assert "No such file" in refusal(tmp_path / "not_there.csv")
    assert "no such file" in refusal(tmp_path / "not_there.h5")


def test_a_table_of_labelled_pictures_is_refused(tmp_path):
    table = frame(POINTS[:, :1], SCORES[:, :1], NAMES)
    table.index = pd.Index([f"labeled-data/film/img{i}.png" for i in range(12)])
    table.to_hdf(tmp_path / "CollectedData.h5", key="df_with_missing", format="table", mode="w")
    assert "not numbered frames" in refusal(tmp_path / "CollectedData.h5")


def test_only_the_tracks_of_a_folder_are_found(tmp_path):
    write_deeplabcut(tmp_path / f"a{SCORER}.csv", POINTS[:, 0], names=NAMES)
    write_sleap(tmp_path / "b.analysis.h5", POINTS[:, 0], names=NAMES)
    shutil.copy(tmp_path / "b.analysis.h5", tmp_path / "c_skeleton.h5")
    (tmp_path / "broken.h5").write_bytes(b"\x89HDF")
    (tmp_path / "a.command.csv").write_text("time_s,command_deg\n0,0\n")
    (tmp_path / "notes.csv").write_bytes(b"\xff\xff\xff")
    with h5py.File(tmp_path / "images.h5", "w") as file:
        file["images"] = np.zeros(3)
    assert [p.name for p in find_tracks(tmp_path)] == [f"a{SCORER}.csv", "b.analysis.h5", "broken.h5"]


def test_the_clips_name_is_what_remains_without_the_programs_additions():
    assert name_by_tool(f"steps-1{SCORER}_filtered") == "steps-1"
    assert name_by_tool("steps-1DLC_Resnet50_nodJan1shuffle1_snapshot_200_el") == "steps-1"
    assert name_by_tool("labels.v002.000_steps-1.analysis") == "steps-1"
    assert name_by_tool("steps-1.analysis") == "steps-1"
    assert name_by_tool("steps-1_superanimal_quadruped_hrnet_w32") == "steps-1"
    assert name_by_tool("steps-1") is None
