"""Pictures for the page: PNG without loss where pixels count, JPEG where speed counts."""

from __future__ import annotations

import cv2

from anglecam.data.typing import Image

JPEG = [cv2.IMWRITE_JPEG_QUALITY, 88]
PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
MEDIA_TYPES = {"jpg": "image/jpeg", "png": "image/png"}


def encode_picture(image: Image, kind: str) -> bytes:
    """Encode a picture.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) blue, green, red, or (h, w) brightness, bytes.
    kind : {'jpg', 'png'}
        PNG keeps every pixel.

    Returns
    -------
    bytes
        The file.
    """
    _, encoded = cv2.imencode(f".{kind}", image, PNG if kind == "png" else JPEG)
    return encoded.tobytes()
