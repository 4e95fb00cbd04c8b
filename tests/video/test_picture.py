"""A part of a picture has the colours of the whole; two pictures are the same only bit for bit."""

from __future__ import annotations

import av
import numpy as np
import pytest

from anglecam.video.display import Display
from anglecam.video.picture import Picture, to_colours

SIZE = 150, 98


def _stored(form: str, seed: int = 0) -> av.VideoFrame:
    rng = np.random.default_rng(seed)
    smooth = rng.integers(0, 256, (SIZE[1] // 7, SIZE[0] // 5, 3)).astype(np.uint8).repeat(7, 0).repeat(5, 1)
    return av.VideoFrame.from_ndarray(np.ascontiguousarray(smooth), format="rgb24").reformat(format=form)


def _picture(stored: av.VideoFrame, display: Display | None = None) -> Picture:
    return Picture(0, 0.0, stored, display or Display((stored.width, stored.height)), None)


@pytest.mark.parametrize("form", ["yuv420p", "yuvj420p", "yuv422p", "yuvj422p", "yuv444p", "yuvj444p", "bgr0", "gray"])
def test_a_part_has_the_colours_of_the_whole(form):
    stored = _stored(form)
    whole = _picture(stored).colours
    for rows, columns in (
        (slice(0, 20), slice(0, 31)),
        (slice(33, 70), slice(41, 90)),
        (slice(80, 98), slice(99, 150)),
    ):
        np.testing.assert_array_equal(_picture(stored).colours_in((rows, columns)), whole[rows, columns])


@pytest.mark.parametrize("form", ["yuv420p", "yuvj444p", "yuv420p10le", "bgr0", "bgr24", "gbrp", "gray"])
def test_lines_follow_each_other_in_memory_whatever_ffmpeg_pads_them_with(form):
    picture = _picture(_stored(form))
    for image in (picture.colours, picture.brightness):
        assert image.shape[:2] == SIZE[::-1]
        assert image.flags.c_contiguous


@pytest.mark.parametrize("form", ["yuvj420p", "yuvj444p", "bgr0"])
def test_colours_within_a_part_are_those_of_the_whole_and_the_rest_need_not_be(form):
    stored, part = _stored(form), (slice(33, 70), slice(41, 90))
    whole, picture = _picture(stored).colours, _picture(stored)
    within = picture.colours_within(part)
    assert within.shape == whole.shape
    np.testing.assert_array_equal(within[part], whole[part])
    assert ("colours" in picture.__dict__) is not picture.has_parts
    assert Picture(1, 0.1, None, Display(SIZE), None).colours_within(part) is None


def test_a_part_of_a_turned_picture_is_that_of_the_shown_one():
    stored = _stored("yuv420p")
    turned = Display((stored.width, stored.height), transposed=True, mirrored=True)
    picture = _picture(stored, turned)
    assert picture.colours_in((slice(5, 25), slice(0, 9))).shape == (20, 9, 3)
    np.testing.assert_array_equal(picture.colours_in((slice(5, 25), slice(0, 9))), picture.colours[5:25, :9])


def test_jpeg_colours_are_those_of_ffmpeg_to_one_grey_level():
    stored = _stored("yuvj444p")
    off = to_colours(stored).astype(int) - stored.to_ndarray(format="bgr24")
    assert np.abs(off).max() <= 1
    assert (off != 0).mean() < 0.05


@pytest.mark.parametrize("form", ["yuvj420p", "yuvj444p", "bgr0"])
def test_pictures_are_the_same_only_bit_for_bit(form):
    stored = _stored(form)
    other = stored.to_ndarray(format="bgr24")
    other[50:54, 60:64] ^= 32
    changed = av.VideoFrame.from_ndarray(other, format="bgr24").reformat(format=form)
    again = av.VideoFrame.from_ndarray(stored.to_ndarray(format="bgr24"), format="bgr24").reformat(format=form)
    assert _picture(changed).is_same_as(_picture(changed))
    assert not _picture(changed).is_same_as(_picture(again))
    assert not _picture(stored).is_same_as(Picture(1, 0.1, None, Display(SIZE), None))
