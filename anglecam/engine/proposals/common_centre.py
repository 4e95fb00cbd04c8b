"""One centre about which a body turns, from its places and orientations in some frames.

    place = c + a·exp(iθ),     orientation = exp(iθ)

Places are complex numbers with the imaginary axis upwards, so that angles grow counter-clockwise as seen. Where the
orientation does not show, as of a ball, the turn follows from the direction about the centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from anglecam.data.typing import Floats
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal

Complexes = NDArray[np.complex128]
_USUAL_PX = 1.0
"""Error of a place up to which it counts by its square, and beyond by its amount."""


def up(points_px: Floats) -> Complexes:
    """Return points (…, 2), px, as complex numbers."""
    return np.asarray(points_px[..., 0] - 1j * points_px[..., 1])


def turn_about(centre: complex, arm: complex, place: Complexes, spin: Complexes) -> Floats:
    """Return the turn that explains places and orientations best about a centre.

    Parameters
    ----------
    centre, arm : complex
        c and a, px.
    place : (K,) ndarray of complex
        px; NaN where the body is not seen.
    spin : (K,) ndarray of complex
        Orientations times the mean square distance of the body's pixels from their middle, px²; 0 where it does not
        show.
    """
    return np.asarray(np.angle(spin + (place - centre) * np.conj(arm)))


def fit_centre(place: Complexes, spin: Complexes, centre: complex, arm: complex) -> tuple[complex, complex]:
    """Fit centre and arm to places and orientations, robustly.

    Parameters
    ----------
    place, spin : (K,) ndarray of complex
        As of `turn_about`.
    centre, arm : complex
        To begin with.

    Returns
    -------
    tuple of complex
        Centre and arm, px.
    """
    seen = np.isfinite(place)
    at, oriented = place[seen], spin[seen]
    reach = np.sqrt(np.abs(oriented))
    shown = oriented / np.maximum(reach, 1e-9)

    def off(values: Floats) -> Floats:
        c, a = complex(values[0], values[1]), complex(values[2], values[3])
        turned = np.exp(1j * turn_about(c, a, at, oriented))
        both = np.concatenate([at - c - a * turned, shown - reach * turned])
        return np.concatenate([both.real, both.imag])

    start = [centre.real, centre.imag, arm.real, arm.imag]
    scale = max(1.0, abs(arm))
    fitted = optimize.least_squares(off, start, loss="soft_l1", f_scale=_USUAL_PX, x_scale=scale, max_nfev=30).x
    return complex(fitted[0], fitted[1]), complex(fitted[2], fitted[3])


def centre_of_poses(place: Complexes, spin: Complexes) -> tuple[complex, complex]:
    """Return centre and arm from places and orientations alone, by linear least squares."""
    seen = np.isfinite(place)
    design = np.column_stack([np.ones(seen.sum()), np.exp(1j * np.angle(spin[seen]))])
    centre, arm = np.linalg.lstsq(design, place[seen], rcond=None)[0]
    return complex(centre), complex(arm)


def same_path(one: Complexes, other: Complexes, tolerance_px: float) -> bool:
    """Tell whether two paths (K,) are one: half of the frames in which both are known show them at one place."""
    apart = np.abs(one - other)
    known = np.isfinite(apart)
    return bool(known.any() and np.median(apart[known]) < tolerance_px)


def proposal_of(sample: Sample, name: str, centre: complex, turn: Floats) -> Proposal:
    """Return a proposal with its centre in the film and its turn from the median."""
    known = np.isfinite(turn)
    smooth = np.full(len(turn), np.nan)
    smooth[known] = np.unwrap(turn[known])
    at = np.array([centre.real, -centre.imag])
    return Proposal(name, (at + 0.5) / sample.scale - 0.5 + sample.corner_px, smooth - np.nanmedian(smooth))
