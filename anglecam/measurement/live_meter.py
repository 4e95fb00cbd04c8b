"""The angle in one frame after another while they are filmed.

Each frame is measured as in the one reading of a long film (`anglecam.measurement.frame_reading`). What is found so is
kept, so that the recorded film is not searched again.
"""

from __future__ import annotations

import numpy as np

from anglecam.measurement.frame_reading import FrameReader
from anglecam.measurement.live_model import LiveAngle, LiveModel
from anglecam.measurement.live_reading import LiveReading
from anglecam.video.decode import Row
from anglecam.video.film import Film
from anglecam.video.picture import Picture


class LiveMeter:
    """Measures frames by what was learnt from the first ones.

    Parameters
    ----------
    model : LiveModel
        From the first frames.
    film : Film
        How the frames are stored and shown.
    """

    def __init__(self, model: LiveModel, film: Film) -> None:
        self.model = model
        self._film, self._reader = film, FrameReader(film, model.found, None, model.body)
        self._measured: list[bool] = []
        self._last: float | None = None

    def measure(self, row: Row) -> LiveAngle:
        """Measure the next frame; its direction counts the whole turns since the frame before."""
        picture = self._picture(row)
        self._reader.add(picture)
        self._measured.append(True)
        if picture.stored is None:
            return LiveAngle("undecodable")
        found = self.model.angle(*self._reader.newest())
        if np.isnan(found.line):
            return found
        near = self.model.neutral if self._last is None else self._last
        self._last = found.line + 2.0 * np.pi * round((near - found.line) / (2.0 * np.pi))
        return LiveAngle(found.status, self._last, found.sigma)

    def skip(self, row: Row) -> None:
        """Count the next frame without measuring it."""
        self._reader.skip(self._picture(row))
        self._measured.append(False)

    def reading(self) -> LiveReading:
        """Return what was found in all frames."""
        return LiveReading(self.model.found, self._reader.reading(), np.array(self._measured, bool))

    def _picture(self, row: Row) -> Picture:
        return Picture(len(self._measured), *row, self._film.display, self._film.bottom_first)
