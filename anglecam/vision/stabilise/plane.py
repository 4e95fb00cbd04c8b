"""How the picture of a plane, such as a desk or a wall, moves before a camera that is held in the hand.

Such a camera shifts and rolls, comes nearer and tilts. The pictures of a plane from two places are related by a
homography (Hartley and Zisserman 2004, section 13.1). It is fitted to small windows that are tracked from the first
picture, each picture from where the one before had them; what stands out of the plane or moves does not follow.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cv2
import numpy as np

from anglecam.data.typing import Flags, Floats, Image
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.image.reduction import reduced, reduction
from anglecam.vision.image.transforms import turn_of
from anglecam.vision.stabilise.tile_cuts import brightness
from anglecam.vision.stabilise.windows import find_windows, follow_windows, subtract_local_mean

_TOLERANCE_PX = 1.5
"""Distance from the homography up to which a window follows, px: things on a desk stand out of it."""
_BACK_PX = 0.5
"""Distance up to which a window that is tracked there and back is the same window, px."""
_MIN_WINDOWS, _MIN_SHARE = 12, 0.5
"""Fewest windows that follow, and their least share of those that are found again: a body that moves has fewer than the
scenery."""
_MIN_AREA = 0.3
"""Least share of the picture that their hull covers; beyond it the homography is extrapolated."""
_LONGEST_PX = 640.0
"""Longer side to which pictures are reduced. A telephone's pictures show no finer details than their codec's noise, and
windows of a fixed size see more of the scenery."""
_STILL_PX, _STILL_SHARE = 0.5, 0.1
"""Displacement up to which a window stands still, px, and the least share of windows that do so where the camera is at
rest."""
_CENTRED = 0.2
"""RMS motion of the point of a plane that moves least, over that of its middle, below which the plane rotates about
it: a body does; a camera in the hand moves all points."""
_HELD_PX = 2.0
"""Least RMS motion of that point before a camera in the hand, px; less is a camera's shaking, or noise."""
_MAX_ROLL = np.radians(4.0)
"""Largest roll of a camera in the hand, rad; whatever turns further is a mechanism."""


def follow_plane(images: Iterable[Image | None]) -> list[Floats | None]:
    """Return the homographies (3, 3) into each picture from the first one that shows something.

    Parameters
    ----------
    images : iterable of ndarray or None
        (h, w, 3) blue, green, red, or (h, w, 1) brightness; ``None`` where a frame cannot be decoded: the camera is
        then taken to be where it was before.

    Returns
    -------
    list of ndarray or None
        ``None`` where no plane is followed: too few windows agree, or they cover too little of the picture.
    """
    first: Image | None = None
    to_small: Floats = np.eye(3)
    moves: list[Floats | None] = []
    latest: Floats = np.eye(3)
    for image in images:
        if image is None:
            moves.append(np.linalg.inv(to_small) @ latest @ to_small)
            continue
        picture = subtract_local_mean(reduced(brightness(image), _LONGEST_PX))
        if first is None:
            to_small = reduction(image.shape[:2], _LONGEST_PX)
            windows = find_windows(picture, pixel_noise([picture]))[0]
            if len(windows) < _MIN_WINDOWS:
                moves.append(None)
                continue
            first = picture
        move = _homography(first, picture, windows, latest)
        latest = latest if move is None else move
        moves.append(None if move is None else np.linalg.inv(to_small) @ move @ to_small)
    return moves


def stands_still(images: Sequence[Image]) -> bool:
    """Return whether windows of the first picture are found in their places in most of the others.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, or (h, w, 1) brightness, spread over a clip.

    Returns
    -------
    bool
        ``False`` too where the scenery shows too few windows to tell.
    """
    pictures = [subtract_local_mean(reduced(brightness(image), _LONGEST_PX)) for image in images]
    windows = find_windows(pictures[0], pixel_noise(pictures[:1]))[0]
    if len(windows) < _MIN_WINDOWS:
        return False
    others = pictures[1:]
    still = 0
    for done, picture in enumerate(others):
        if 2 * still >= len(others) or 2 * (still + len(others) - done) < len(others):
            break  # the pictures that are left change nothing
        moved, found = _tracked(pictures[0], picture, windows)
        still += int((np.hypot(*moved[found].T) < _STILL_PX).sum() > _STILL_SHARE * len(windows))
    return 2 * still >= len(others)


def moves_in_the_hand(moves: Sequence[Floats | None], size: tuple[int, int]) -> bool:
    """Return whether all points of the plane move, and do so visibly. A body turns about one of them.

    Parameters
    ----------
    moves : sequence of ndarray or None
        (3, 3) from `follow_plane`.
    size : tuple of int
        Width and height of the picture, px.

    Returns
    -------
    bool
        False where no plane was followed.
    """
    known = [move for move in moves if move is not None]
    if not known:
        return False
    middle = np.array([size[0] / 2.0, size[1] / 2.0])
    # near the middle of the picture a homography is an affine map: place + (A - 1)(place - middle) + shift
    at = [cv2.perspectiveTransform((middle + 50.0 * np.array([[[0, 0], [1, 0], [0, 1]]])), move)[0] for move in known]
    shifts = np.array([points[0] - middle for points in at])
    stretch = np.array([np.column_stack([p[1] - p[0], p[2] - p[0]]) / 50.0 - np.eye(2) for p in at])
    shifts, stretch = shifts - shifts.mean(axis=0), stretch - stretch.mean(axis=0)
    arm = np.linalg.lstsq(stretch.reshape(-1, 2), -shifts.reshape(-1), rcond=None)[0]
    least = shifts + stretch @ arm
    return bool((least**2).mean() > max(_CENTRED**2 * (shifts**2).mean(), _HELD_PX**2))


def seen_from_first(image: Image, move: Floats, first: Image) -> Image:
    """Return a picture as the camera would have seen it from its first place; beyond its edges the first picture."""
    size = image.shape[1::-1]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    shown = cv2.warpPerspective(image, move, size, flags=flags).reshape(image.shape)
    inside = cv2.warpPerspective(np.full(image.shape[:2], 255, np.uint8), move, size, flags=flags) == 255
    return np.where(inside[..., None], shown, first)


def _homography(first: Image, picture: Image, windows: Floats, latest: Floats) -> Floats | None:
    """Fit the homography from the first picture to windows tracked from where the latest one puts them."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    near = cv2.warpPerspective(picture, latest, picture.shape[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE)
    moved, same = _tracked(first, near, windows)
    if same.sum() < _MIN_WINDOWS:
        return None
    cv2.setRNGSeed(0)
    move, follows = cv2.findHomography(
        windows[same], (windows + moved)[same], cv2.RANSAC, ransacReprojThreshold=_TOLERANCE_PX
    )
    if move is None or not _is_scenery(windows[same], windows[same][follows.ravel() > 0], first.size):
        return None
    whole = latest @ move
    return None if abs(turn_of(whole)) > _MAX_ROLL else np.asarray(whole / whole[2, 2])


def _tracked(first: Image, other: Image, windows: Floats) -> tuple[Floats, Flags]:
    """Return (n, 2) displacements of windows, px, and (n,) which of them are found back where they were."""
    moved = follow_windows(first, other, windows)
    back = follow_windows(other, first, windows + moved)
    return moved, np.hypot(*(moved + back).T) < _BACK_PX


def _is_scenery(found: Floats, following: Floats, area_px2: int) -> bool:
    hull = cv2.contourArea(cv2.convexHull(following.astype(np.float32)))
    return len(following) >= max(_MIN_WINDOWS, _MIN_SHARE * len(found)) and bool(hull >= _MIN_AREA * area_px2)
