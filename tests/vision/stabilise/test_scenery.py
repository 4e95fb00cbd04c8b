"""Whether a camera stands still, from frames spread over a clip."""

from anglecam.vision.stabilise.scenery import find_scenery


def test_no_pictures_show_no_scenery():
    assert find_scenery([]) is None
