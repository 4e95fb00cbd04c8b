"""Where in a full turn about a hinted pivot a moving thing is, whatever it did between two frames.

A servo's horn turns by twenty degrees from one frame to the next, farther than an edge can be followed. In polar
coordinates about the pivot a rotation is a displacement along the angle. A pixel of the reference that differs from
the still background is the thing's; turned to where the thing is, such pixels are like the frame, and elsewhere like
the background. The difference of the two sums of squares is the logarithm of the likelihood ratio of "it is here" to
"the background is seen here", and it is a correlation, computed for all angles at once by Fourier transforms.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image

_ANGLES = 720
"""Angles of a full turn that are compared."""
_BLUR_PX = 1.5
"""Standard deviation of the filter before, px: a pixel of the polar picture far from the pivot is as wide."""
_DIFFERS = 0.2
"""Least difference from the background of the thing's pixels, as a share of the largest."""
_LARGEST = 0.999
"""Quantile of the differences that counts as the largest."""
_NEXT = np.pi / 4.0
"""Farthest turn from the predicted one, rad: the arms of a horn are alike."""


@dataclass(frozen=True)
class PolarReference:
    """What a thing looks like in the reference frame, in polar coordinates about a pivot."""

    pivot_px: Floats
    """(2,) px."""
    background: Image
    """(angles, radii, planes)."""
    thing: NDArray[np.complex128]
    """(frequencies, radii, 1) conjugate transform of the pixels' weights: 0 where the background is seen."""
    weighted: NDArray[np.complex128]
    """(frequencies, radii, planes) the same, multiplied by the picture."""

    def turn_in(self, image: Image, near: float | None = None) -> float:
        """Return how far the thing has turned in a frame since the reference, rad, counter-clockwise as seen.

        Parameters
        ----------
        image : ndarray
            (h, w, planes).
        near : float, optional
            Predicted turn, rad; the result is within an eighth of a turn of it.
        """
        seen = _unrolled(image, self.pivot_px, self.background.shape[1])
        background = self.background
        of_background = np.fft.rfft(background**2 - 2.0 * seen * background, axis=0)
        spectrum = self.thing * of_background + 2.0 * self.weighted * np.fft.rfft(seen, axis=0)
        likelihood = np.fft.irfft(spectrum.sum(axis=(1, 2)), _ANGLES)
        turns = -2.0 * np.pi * np.arange(_ANGLES) / _ANGLES  # polar angles count clockwise
        if near is None:
            return float(turns[likelihood.argmax()])
        apart = (turns - near + np.pi) % (2.0 * np.pi) - np.pi
        best = int(np.where(np.abs(apart) <= _NEXT, likelihood, -np.inf).argmax())
        return float(near + apart[best])


def learn_polar(reference: Image, background: Image, pivot_px: Floats) -> PolarReference:
    """Learn what the thing looks like that turns about a pivot.

    Parameters
    ----------
    reference, background : ndarray
        (h, w, planes).
    pivot_px : ndarray
        (2,) px.

    Returns
    -------
    PolarReference
        Turns are relative to the reference.
    """
    radii = max(reference.shape[:2]) // 2
    seen, behind = (_unrolled(picture, pivot_px, radii) for picture in (reference, background))
    differs = np.sqrt(((seen - behind) ** 2).sum(axis=2, keepdims=True))
    area = np.arange(radii)[None, :, None] / radii
    weight = area * (differs > _DIFFERS * np.quantile(differs, _LARGEST))
    thing, weighted = (np.conj(np.fft.rfft(part, axis=0)) for part in (weight, weight * seen))
    return PolarReference(pivot_px, behind, thing, weighted)


def _unrolled(image: Image, pivot_px: Floats, radii: int) -> Image:
    """Return the picture (angles, radii, planes) in polar coordinates about the pivot; black outside the picture."""
    picture = cv2.GaussianBlur(image.astype(np.float32), (0, 0), _BLUR_PX)
    flags = cv2.WARP_POLAR_LINEAR | cv2.INTER_LINEAR | cv2.WARP_FILL_OUTLIERS
    polar = cv2.warpPolar(picture, (radii, _ANGLES), (pivot_px[0], pivot_px[1]), radii, flags)
    return np.asarray(polar).reshape(_ANGLES, radii, -1)
