"""A camera's calibration in OpenCV's model: camera matrix, distortion, covariance; reading and writing its file.

Files are written in OpenCV's YAML, with the covariance as a further key, so every tool that reads OpenCV's files reads
them. Files may be read as YAML, XML or JSON, as cv2.FileStorage writes them, or as the YAML of ROS.
"""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from anglecam.data.typing import Floats
from anglecam.errors import RigError
from anglecam.io.files import read_text, write_atomically

DISTORTION_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "taux", "tauy")
"""Names of the distortion coefficients in OpenCV's order."""
_MOST_BYTES = 512 * 1024
"""Size above which a file is not read; a calibration with the corners of a hundred pictures has this size."""
_STACK = 512 * _MOST_BYTES
"""Stack for the parser, bytes: OpenCV uses up to 330 bytes for each level of nesting, which takes at least one byte of
text."""
_LENGTHS = (4, 5, 8, 12, 14)
_IN_MEMORY = cv2.FILE_STORAGE_MEMORY
_MATRIX_KEYS = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
_DISTORTION_KEYS = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "dist_coeffs",
    "dist_coeff",
    "distCoeffs",
    "D",
)
_SIZE_KEYS = (("image_width", "image_Width"), ("image_height", "image_Height"))


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibration of a camera and its lens."""

    size: tuple[int, int] | None
    """Width and height of the pictures that the calibration applies to, px; ``None`` if not stated."""
    camera_matrix: Floats
    """(3, 3), px."""
    distortion: Floats
    """(n,) 4, 5, 8, 12 or 14 coefficients in OpenCV's order, `DISTORTION_NAMES`."""
    covariance: Floats | None = None
    """(4 + n, 4 + n) covariance of fx, fy, cx, cy (px) and the n coefficients; ``None`` if the file states none."""
    rms_px: float | None = None
    """RMS error of the reprojected corners, px; ``None`` if the file states none."""
    views: int = 0
    """Number of pictures of a board that the calibration was made from; 0 if the file states none."""

    @property
    def focal_px(self) -> float:
        """Focal length, px: the geometric mean over both axes."""
        return float(np.sqrt(self.camera_matrix[0, 0] * self.camera_matrix[1, 1]))

    def sigma(self, name: str) -> float:
        """Return the standard uncertainty of ``fx``, ``fy``, ``cx``, ``cy`` (px) or a coefficient such as ``k1``."""
        if self.covariance is None:
            return float("nan")
        index = ("fx", "fy", "cx", "cy", *DISTORTION_NAMES).index(name)
        return float(np.sqrt(self.covariance[index, index]))


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file that OpenCV, ROS or anglecam wrote.

    Parameters
    ----------
    path : Path
        YAML, XML or JSON with ``camera_matrix``, ``distortion_coefficients`` (or ``dist_coeffs``) and, optionally,
        ``image_width`` and ``image_height``, against which a clip's size is checked.

    Returns
    -------
    Calibration
        With a covariance if the file holds one.

    Raises
    ------
    RigError
        If the file is missing, is not a calibration, or its numbers cannot be those of a camera.
    """
    content = _open(path)
    matrix = _numbers(_first(content, _MATRIX_KEYS))
    if matrix is None:
        raise RigError(f"{path}: not a calibration: no camera_matrix in it")
    distortion = _numbers(_first(content, _DISTORTION_KEYS))
    if distortion is None:
        raise RigError(f"{path}: not a calibration: no distortion_coefficients in it")
    if _is_fisheye(content):
        raise RigError(f"{path}: a fisheye model; only OpenCV's ordinary model can be used")
    if matrix.size != 9 or not np.isfinite(matrix).all():
        raise RigError(f"{path}: camera_matrix: expected 3×3 numbers, found {matrix.size}")
    if distortion.size not in _LENGTHS or not np.isfinite(distortion).all():
        raise RigError(f"{path}: distortion_coefficients: expected 4, 5, 8, 12 or 14 numbers, found {distortion.size}")
    K = matrix.reshape(3, 3)
    if min(K[0, 0], K[1, 1]) <= 0.0 or not np.allclose([*K[2], K[1, 0]], [0.0, 0.0, 1.0, 0.0]):
        raise RigError(f"{path}: camera_matrix: expected rows fx 0 cx, 0 fy cy, 0 0 1")
    if K[0, 1] != 0.0:
        raise RigError(f"{path}: camera_matrix: a skew of {K[0, 1]:g} px, which OpenCV's model does not have")
    width, height = (_number(content, keys) for keys in _SIZE_KEYS)
    covariance = _numbers(_first(content, ("intrinsics_covariance",)))
    n = 4 + distortion.size
    if covariance is not None and (covariance.size != n * n or not np.isfinite(covariance).all()):
        raise RigError(f"{path}: intrinsics_covariance: expected {n}×{n} numbers, found {covariance.size}")
    return Calibration(
        size=None if width is None or height is None else (int(width), int(height)),
        camera_matrix=K,
        distortion=distortion,
        covariance=None if covariance is None else covariance.reshape(n, n),
        rms_px=_number(content, ("avg_reprojection_error",)),
        views=int(_number(content, ("nr_of_frames",)) or 0),
    )


def write_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration as OpenCV's YAML, including its covariance.

    Parameters
    ----------
    calibration : Calibration
        The calibration.
    path : Path
        A ``.yaml`` file; an existing one is replaced.
    """
    store = cv2.FileStorage("calibration.yaml", cv2.FILE_STORAGE_WRITE | _IN_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML)
    if calibration.size is not None:
        store.write("image_width", calibration.size[0])
        store.write("image_height", calibration.size[1])
    store.write("camera_matrix", calibration.camera_matrix)
    store.write("distortion_coefficients", calibration.distortion.reshape(1, -1))
    if calibration.rms_px is not None:
        store.write("avg_reprojection_error", calibration.rms_px)
        store.write("nr_of_frames", calibration.views)
    if calibration.covariance is not None:
        store.write("intrinsics_covariance", calibration.covariance)
    with write_atomically(path) as stream:
        stream.write(store.releaseAndGetString())


def _open(path: Path) -> dict[str, Any]:
    """Return a file's content as numbers, texts, lists and mappings."""
    try:
        text = read_text(path, _MOST_BYTES)
    except OSError as error:
        raise RigError(f"{path}: calibration cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise RigError(f"{path}: not a calibration: not a text file") from error
    if not text.lstrip().startswith(("%YAML", "<?xml", "{")):
        text = f"%YAML:1.0\n---\n{text}"  # ROS omits the first line, which OpenCV requires
    try:
        content = _parsed(text)
    # OpenCV's Python binding raises SystemError for a text that cannot be parsed
    except (cv2.error, SystemError, RecursionError) as error:
        raise RigError(f"{path}: not a calibration: not YAML, XML or JSON as OpenCV writes it") from error
    if not isinstance(content, dict):
        raise RigError(f"{path}: not a calibration: no keys in it")
    return content


def _parsed(text: str) -> Any:
    """Parse a text with OpenCV, in a thread whose stack suffices for the deepest nesting that `_MOST_BYTES` allow."""

    def read() -> Any:
        store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | _IN_MEMORY)
        return _plain(store.root())

    before = threading.stack_size(_STACK)
    try:
        with ThreadPoolExecutor(1) as deep:
            return deep.submit(read).result()
    finally:
        threading.stack_size(before)


def _plain(node: Any) -> Any:
    """Convert a node, which is valid only while its file is open, into plain Python objects."""
    if node.isMap():
        return {key: _plain(node.getNode(key)) for key in node.keys()}  # noqa: SIM118 - a node is not a mapping
    if node.isSeq():
        return [_plain(node.at(i)) for i in range(node.size())]
    return node.real() if node.isReal() or node.isInt() else node.string() if node.isString() else None


def _first(content: dict[str, Any], keys: tuple[str, ...]) -> Any:
    """Return the value of the first of ``keys`` that is present."""
    return next((content[key] for key in keys if content.get(key) is not None), None)


def _number(content: dict[str, Any], keys: tuple[str, ...]) -> float | None:
    value = _first(content, keys)
    return value if isinstance(value, float) else None


def _numbers(value: Any) -> Floats | None:
    """Return all numbers of a matrix, or of nested lists, in their order; NaN for a value that is not a number."""
    if isinstance(value, dict):
        value = value.get("data")
    if value is None:
        return None
    if not isinstance(value, list):
        return np.array([value if isinstance(value, float) else np.nan])
    parts = [_numbers(item) for item in value]
    return np.concatenate([part for part in parts if part is not None] or [np.empty(0)])


def _is_fisheye(content: dict[str, Any]) -> bool:
    return bool(content.get("fisheye_model")) or content.get("distortion_model") in ("equidistant", "fisheye")
