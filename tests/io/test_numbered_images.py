"""Numbered pictures of a folder are one film; what is no count is refused."""

from __future__ import annotations

import pytest

from anglecam.errors import InputError
from anglecam.io.numbered_images import find_numbered_images, has_numbered_images


def _fill(folder, names):
    for name in names:
        (folder / name).write_bytes(b"")
    return folder


def test_pictures_are_listed_by_number_and_not_by_name(tmp_path):
    _fill(
        tmp_path,
        [
            "run_10.png",
            "run_9.png",
            "run_8.png",
            "notes.txt",
            "._run_9.png",
            "._run_8.png",
            "cover.png",
            "rig.yaml",
            "1.csv",
        ],
    )
    assert has_numbered_images(tmp_path)
    assert [path.name for path in find_numbered_images(tmp_path).values()] == ["run_8.png", "run_9.png", "run_10.png"]


def test_a_missing_number_is_left_out(tmp_path):
    assert list(find_numbered_images(_fill(tmp_path, ["a1.jpg", "a2.jpg", "a4.jpg"]))) == [1, 2, 4]


@pytest.mark.parametrize(
    ("names", "cause"),
    [
        ([], "no numbered pictures"),
        (["only1.png"], "no numbered pictures"),
        (["a1.png", "a2.png", "b1.png", "b2.png"], r"several series \(a\*\.png, b\*\.png\)"),
        (["a1.png", "a01.png", "a2.png"], "the same number"),
        (["a1700000000.png", "a1700000033.png", "a1700000067.png"], "number them one by one"),
    ],
)
def test_what_is_no_count_is_refused_in_one_line(tmp_path, names, cause):
    with pytest.raises(InputError, match=cause) as caught:
        find_numbered_images(_fill(tmp_path, names))
    assert str(tmp_path) in str(caught.value)
