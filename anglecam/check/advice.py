"""What would make the angle surer, each change with a factor on sigma.

A position error e turns the line by e/R, with the lever R in pixels. The error of an edge by noise is

    e ∝ n·√w / (C·√N)       noise n, contrast C (grey levels), width w of the edge, N pixels along it

so a camera that is z times nearer divides the angle's error by z^1.5: R grows by z, and N by z. A body that is
already compared in the largest number of tiles shows no more edge pixels, and gains z. Shot noise falls relative to the
contrast as the square root of the light. Errors of codec and pixel grid have a size in pixels. Pivot and zero are
measured in the same pictures and follow the mixture of both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from anglecam.camera.shutter import blur_error, mean_off_middle
from anglecam.check.sigma_terms import SigmaTerms
from anglecam.data.typing import Floats
from anglecam.loop.policy import DEFAULT
from anglecam.measurement.clip import Measurement

ROUNDING = 1.0 / math.sqrt(12.0)
"""Noise of rounding to whole grey levels, which no light lowers."""
LIGHT = 2.0
MOST_NEARER, LEAST_NEARER = 4.0, 1.1
FILLED = 0.9
"""Share of the picture that mark, path and pivot may fill."""
ALL_TILES = 40
"""Tiles of a body at most."""
BEST_CONTRAST = 200.0
"""Contrast of a mark that stands out as far as a picture of 255 grey levels allows, grey levels."""
LOSSLESS = ("ffv1", "rawvideo", "huffyuv", "ffvhuff", "utvideo", "png", "bmp", "tiff")
WORTH_SAYING = 0.97
"""Factor from which on a change is no help."""
MARKED_PX = 0.1
"""Standard uncertainty of a pivot with a clean round mark, px."""
DETECTED_SIGMAS = 5.0
"""Norm of a change, in standard deviations of the scatter, that the residual test detects: about 3.3 for its p-value
among all tests and 1.6 for the chance to overlook it."""


@dataclass(frozen=True)
class Advice:
    """One change and what it would bring."""

    change: str
    """Short name, as in the file."""
    text: str
    """What to do."""
    sigma_factor: float
    """Sigma of a frame after the change, divided by that now."""
    size_factor: float
    """Smallest sizes of effects after the change, divided by those now."""


@dataclass(frozen=True)
class Seen:
    """What decides which change of the angles a session shows."""

    frames: int
    by_mark: bool
    """Whether the angles are those of the mark alone."""

    def smallest_rms(self, terms: SigmaTerms) -> float:
        """Return the RMS change of the angle, rad, that the session shows.

        The residual test needs a norm of some standard deviations of the scatter. In a film the loop also ignores
        structure below twice the noise floor, because errors of a measurement may follow the motion as an effect does.
        The floor is sigma or, where it is less, the scatter of the mark's distance from the pivot.
        """
        floor = DEFAULT.stepwise.film_error_sigmas * (terms.scatter if self.by_mark else terms.sigma)
        return max(DETECTED_SIGMAS * terms.scatter / math.sqrt(self.frames), floor)


def advice(now: SigmaTerms, measured: Measurement, codec: str, exposure_s: float | None, frames: int) -> list[Advice]:
    """List the changes that would help, the most helpful first.

    Parameters
    ----------
    now : SigmaTerms
        Of the film as it is.
    measured : Measurement
        Of a part of it.
    codec : str
        FFmpeg's name.
    exposure_s : float or None
        Exposure time, declared or estimated, s.
    frames : int
        Of a session.

    Returns
    -------
    list of Advice
        Without changes of less than 3 %.
    """
    noise = measured.detections.noise
    shot = math.sqrt(max(noise**2 - ROUNDING**2, 0.0) / LIGHT + ROUNDING**2) / noise
    tried = [
        ("light", f"{LIGHT:g} times the light (or a lens or sensor that takes it)", scaled(now, noise=shot)),
        *_nearer(now, measured),
        *_on_the_mark(now, measured),
    ]
    if codec not in LOSSLESS:
        tried.append(("codec", "less compression: twice the bit rate or a lossless codec", scaled(now, grid=0.5)))
    if "declared" not in measured.pivot and "marker" not in measured.pivot:
        usual = math.sqrt(float(np.trace(measured.angles.pivot.covariance_px2)) / 2.0)
        marked = replace(now, pivot=now.pivot * min(1.0, MARKED_PX / usual))
        tried.append(("shaft_mark", "a round mark on the shaft", marked))
    session = Seen(frames, measured.angles.registered is None)
    found = [_advice(*one, now, session) for one in tried]
    found += _exposure(now, measured, exposure_s, session)
    faster = replace(session, frames=2 * frames).smallest_rms(now) / session.smallest_rms(now)
    found.append(Advice("rate", "twice the frame rate, with the light for it", 1.0, faster))
    helping = [one for one in found if min(one.sigma_factor, one.size_factor) < WORTH_SAYING]
    return sorted(helping, key=lambda one: (one.size_factor, one.sigma_factor))


def _advice(change: str, text: str, after: SigmaTerms, now: SigmaTerms, session: Seen) -> Advice:
    sizes = session.smallest_rms(after) / session.smallest_rms(now)
    return Advice(change, text, after.sigma / now.sigma, sizes)


def scaled(now: SigmaTerms, noise: float = 1.0, grid: float = 1.0) -> SigmaTerms:
    """Return the terms with noise and errors of the grid multiplied; pivot and zero follow the mixture of both."""
    after = replace(now, noise=noise * now.noise, grid=grid * now.grid)
    mixed = after.scatter / now.scatter if now.scatter > 0.0 else 1.0
    return replace(after, pivot=mixed * now.pivot, zero=mixed * now.zero)


def _nearer(now: SigmaTerms, measured: Measurement) -> list[tuple[str, str, SigmaTerms]]:
    """Return what a camera that is nearer, and a finer sensor, would bring."""
    found = measured.angles.registered
    full = found is not None and len(found.clear[0]) >= ALL_TILES
    power = 1.0 if full else 1.5
    finer = 2.0**-power * 2.0
    tried = [("resolution", "twice the pixels a side, at the same light", scaled(now, finer, 0.5))]
    zoom = room_to_fill(measured)
    if zoom >= LEAST_NEARER:
        text = f"{zoom:.1f} times nearer (or zoomed in), so that the motion fills the picture"
        tried.append(("nearer", text, scaled(now, zoom**-power, 1.0 / zoom)))
    return tried


def room_to_fill(measured: Measurement) -> float:
    """Return how many times larger the picture could show the motion, the pivot included where it is in the picture."""
    series = measured.series
    assert series.mark_px is not None
    assert series.pivot_px is not None
    places = [series.mark_px[series.ok], series.pivot_px[series.ok][:1]]
    regions = [r.contour_px.reshape(-1, 2) for r in measured.detections.regions if r is not None]
    found = measured.angles.registered
    if found is not None:
        places.append(found.appearance.tiles.corners)
    points = np.concatenate([*places, *regions]).astype(float)
    size = np.array(measured.detections.size, float)
    inside = np.all((points >= 0.0) & (points < size), axis=1)
    extent = np.ptp(points[inside], axis=0)
    return float(np.clip(FILLED * np.min(size / np.maximum(extent, 1.0)), 1.0, MOST_NEARER))


def contrast_of(measured: Measurement) -> float | None:
    """Return the contrast of the mark against its surroundings, grey levels; ``None`` without a mark."""
    found = measured.detections.found
    return None if found is None else 1.0 / float(np.linalg.norm(found.model.weights))


def _on_the_mark(now: SigmaTerms, measured: Measurement) -> list[tuple[str, str, SigmaTerms]]:
    """Return what another mark would bring, where the angle is that of the mark alone."""
    contrast = contrast_of(measured)
    if measured.angles.registered is not None or contrast is None:
        return []
    larger = ("larger_mark", "a mark of twice the diameter", scaled(now, 2.0**-0.5, 2.0**-0.5))
    share = contrast / BEST_CONTRAST
    if share >= 1.0:
        return [larger]
    text = f"a mark that stands out by {BEST_CONTRAST:.0f} grey levels (now {contrast:.0f})"
    return [larger, ("contrast", text, scaled(now, share))]


def _exposure(now: SigmaTerms, measured: Measurement, exposure_s: float | None, session: Seen) -> list[Advice]:
    """Return what half the exposure would bring, with the light for it."""
    if exposure_s is None:
        return []
    whole, half = (within_exposure(measured, one) for one in (exposure_s, 0.5 * exposure_s))
    # an exposure that is not declared is not part of the stated sigma, but of the errors
    before = replace(now, exposure=whole)
    after = replace(now, exposure=half)
    text = f"half the exposure ({500.0 * exposure_s:.1f} ms), with the light for it: fast frames are blurred"
    return [_advice("exposure", text, after, before, session)]


def within_exposure(measured: Measurement, exposure_s: float) -> float:
    """Return the RMS uncertainty due to motion within an exposure, rad, as `measure` would state it."""
    angles, time = measured.angles, measured.series.time[measured.ok]
    lever: Floats = angles.lever_px
    terms = mean_off_middle(time, angles.line, exposure_s)
    if angles.registered is not None:
        terms = np.hypot(terms, blur_error(time, angles.line, lever, exposure_s))
    return float(np.sqrt(np.mean(terms**2)))
