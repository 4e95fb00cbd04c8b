"""Pictures without their brightness: what differs in colour alone.

Light and shadows multiply all three colours of a pixel, so that the logarithms of their ratios do not change
(Finlayson, Hordley, Lu and Drew, IEEE Transactions on Pattern Analysis and Machine Intelligence 28, 2006). In them, a
shadow that passes is not seen, and a body that is as bright as the wall behind it may be. The two ratios are mixed so
that what changes differs most from the noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from anglecam.data.typing import Floats, Image

_DARK = 16.0
"""Grey levels that are added, black of television: the ratios of dark colours are noise."""
_LEVELS, _MIDDLE = 64.0, 128.0
"""Grey levels for a ratio of e, and for the film's usual colour."""
_SMALL_PX = 120
"""Longer side of the pictures from which the mixture is found."""
_LEAST = 1e-4
"""Standard deviation of a ratio below which a film is grey: a hundredth of a grey level of a hundred, far less than the
rounding of colours gives."""


def tint_of(images: Sequence[Image]) -> Floats | None:
    """Return the mixture of colour ratios in which what changes stands out most.

    Parameters
    ----------
    images : sequence of ndarray
        (height, width, 3) BGR, spread over a film whose camera stands still, nearly.

    Returns
    -------
    (3,) ndarray or None
        Weights of the two ratios, and what the usual colour gives; ``None`` for a grey film.
    """
    height, width = images[0].shape[:2]
    scale = min(1.0, _SMALL_PX / max(width, height))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = np.stack([cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in images])
    ratios = np.stack([_ratios(one) for one in small])
    usual = np.median(ratios, axis=0)
    # of dark pixels the ratios are as noisy as they are dark
    off = (ratios - usual) * (small.mean(axis=(0, 3))[..., None] + _DARK) / _MIDDLE
    change = (off**2).sum(axis=-1)
    quiet = np.median(change, axis=0)
    at_rest = off[:, quiet <= np.median(quiet)].reshape(-1, 2)
    noise = at_rest.T @ at_rest / len(at_rest)
    every = off.reshape(-1, 2)
    total = every.T @ every / len(every)
    if np.trace(total) < _LEAST**2:
        return None
    _, mixtures = linalg.eigh(total, noise + _LEAST**2 * np.eye(2))
    weights = mixtures[:, -1] / np.hypot(*mixtures[:, -1])
    return np.append(weights, float(np.median(usual @ weights)))


def tinted(picture: Image, tint: Floats) -> NDArray[np.float32]:
    """Return the mixture of colour ratios of a picture (h, w, 3), BGR, as grey levels (h, w)."""
    mixed = _ratios(picture) @ tint[:2] - tint[2]
    return np.asarray(np.clip(_MIDDLE + _LEVELS * mixed, 0.0, 255.0), np.float32)


def _ratios(picture: Image) -> Floats:
    """Return the logarithms (h, w, 2) of blue and of red over green."""
    logarithm = np.log(picture.astype(np.float32) + np.float32(_DARK))
    return np.asarray(logarithm[..., ::2] - logarithm[..., 1:2], float)
