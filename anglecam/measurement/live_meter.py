"""The angle in one frame after another while they are filmed.

Each frame is measured as in the one reading of a long film (`anglecam.measurement.frame_reading`).
"""

from __future__ import annotations

import numpy as np

from anglecam.measurement.body_ahead import turn_ahead
from anglecam.measurement.live_model import LiveAngle, LiveModel
from anglecam.video.decode import Row
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.mark.mark_search import MarkSearch
from anglecam.vision.registration.turn import NO_TURN


class LiveMeter:
    """Measures frames by what was learnt from earlier ones.

    Parameters
    ----------
    model : LiveModel
        From the earlier frames.
    film : Film
        How the frames are stored and shown.
    """

    def __init__(self, model: LiveModel, film: Film) -> None:
        self._film = film
        self._before: Picture | None = None
        self._last = model.neutral
        self.relearn(model)

    def relearn(self, model: LiveModel) -> None:
        """Measure the next frames by what was learnt from more frames."""
        self._model = model
        self._search = MarkSearch(model.found, model.path.is_mark)

    def measure(self, number: int, row: Row) -> LiveAngle:
        """Measure the next frame; its direction counts the whole turns since the last one that was measured."""
        picture = Picture(number, *row, self._film.display, self._film.bottom_first)
        found = LiveAngle("undecodable") if picture.stored is None else self._angle(picture)
        if picture.stored is None:
            self._search.lose()
        self._before = picture
        if np.isnan(found.line):
            return found
        self._last = found.line + 2.0 * np.pi * round((self._last - found.line) / (2.0 * np.pi))
        return LiveAngle(found.status, self._last, found.sigma)

    def skip(self) -> None:
        """Leave the next frame out."""
        self._search.lose()
        self._before = None

    def _angle(self, picture: Picture) -> LiveAngle:
        regions = self._search.regions(picture.index, self._film.size, picture.colours_in)
        body = self._model.body
        if body is None:
            return self._model.angle(regions, NO_TURN)
        turn = turn_ahead(body, self._film, picture, self._before, body.begin(regions))()
        return self._model.angle(regions, turn)
