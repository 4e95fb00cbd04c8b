"""How the picture of a plane, such as a desk or a wall, moves before a camera that is held in the hand.

Such a camera shifts and rolls, comes nearer and tilts. The pictures of a plane from two places are related by a
homography (Hartley and Zisserman 2004, section 13.1). It is fitted to small windows that are tracked from the first
picture, each picture from where the one before had them; what stands out of the plane or moves does not follow.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.image.transforms import turn_of
from anglecam.vision.stabilise.tile_cuts import brightness
from anglecam.vision.stabilise.windows import find_windows, follow_windows, subtract_local_mean

_TOLERANCE_PX = 1.5
"""Distance from the homography up to which a window follows, px: things on a desk stand out of it."""
_BACK_PX = 0.5
"""Distance up to which a window that is tracked there and back is the same window, px."""
_MIN_WINDOWS, _MIN_SHARE = 12, 0.5
"""Fewest windows that follow, and their least share of all: a body that moves has fewer than the scenery."""
_MIN_AREA = 0.3
"""Least share of the picture that their hull covers; beyond it the homography is extrapolated."""
_MAX_ROLL = np.radians(4.0)
"""Largest roll of a camera in the hand, rad; whatever turns further is a mechanism."""


def follow_plane(images: Iterable[Image | None]) -> list[Floats | None]:
    """Return the homographies (3, 3) from the first picture into each one.

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
    moves: list[Floats | None] = []
    latest: Floats = np.eye(3)
    for image in images:
        if image is None:
            moves.append(latest)
            continue
        picture = subtract_local_mean(brightness(image))
        if first is None:
            first = picture
            windows = find_windows(first, pixel_noise([first]))[0]
        move = _homography(first, picture, windows, latest) if len(windows) >= _MIN_WINDOWS else None
        latest = latest if move is None else move
        moves.append(move)
    return moves


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
    moved = follow_windows(first, near, windows)
    back = follow_windows(near, first, windows + moved)
    same = np.hypot(*(moved + back).T) < _BACK_PX
    if same.sum() < _MIN_WINDOWS:
        return None
    cv2.setRNGSeed(0)
    move, follows = cv2.findHomography(
        windows[same], (windows + moved)[same], cv2.RANSAC, ransacReprojThreshold=_TOLERANCE_PX
    )
    if move is None or not _is_scenery(windows, windows[same][follows.ravel() > 0], first.size):
        return None
    whole = latest @ move
    return None if abs(turn_of(whole)) > _MAX_ROLL else np.asarray(whole / whole[2, 2])


def _is_scenery(windows: Floats, following: Floats, area_px2: int) -> bool:
    hull = cv2.contourArea(cv2.convexHull(following.astype(np.float32)))
    return len(following) >= max(_MIN_WINDOWS, _MIN_SHARE * len(windows)) and bool(hull >= _MIN_AREA * area_px2)
