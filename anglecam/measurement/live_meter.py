"""The angle in one frame after another while they are filmed.

Each frame is measured as in the one reading of a long film (`anglecam.measurement.frame_reading`).
"""

from __future__ import annotations

import numpy as np

from anglecam.measurement.body_ahead import turn_ahead
from anglecam.measurement.live_model import LiveAngle, LiveModel
from anglecam.measurement.registration_pass import DOUBT_PX
from anglecam.video.decode import Row
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.mark.mark_search import MarkSearch
from anglecam.vision.registration.turn import NO_TURN

_UNKNOWN = (np.nan, np.nan)


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
        self._turns = _UNKNOWN

    def measure(self, number: int, row: Row) -> LiveAngle:
        """Measure the next frame; its direction counts the whole turns since the last one that was measured."""
        picture = Picture(number, *row, self._film.display, self._film.bottom_first)
        found = LiveAngle("undecodable") if picture.stored is None else self._angle(picture)
        if picture.stored is None:
            self._lose()
        self._before = picture
        if np.isnan(found.line):
            return found
        self._last = found.line + 2.0 * np.pi * round((self._last - found.line) / (2.0 * np.pi))
        return LiveAngle(found.status, self._last, found.sigma)

    def skip(self) -> None:
        """Leave the next frame out."""
        self._lose()
        self._before = None

    def _lose(self) -> None:
        self._search.lose()
        self._turns = _UNKNOWN

    def _angle(self, picture: Picture) -> LiveAngle:
        model = self._model
        mark = model.mark_in(self._search.regions(picture.index, self._film.size, picture.colours_in))
        if model.body is None:
            return model.angle(mark, NO_TURN)
        if isinstance(mark, str):  # the motion of the last two frames goes on
            begin, reach = 2.0 * self._turns[1] - self._turns[0], DOUBT_PX
        else:
            begin, reach = model.body.begin([mark]), 0.0
        turn = turn_ahead(model.body, self._film, picture, self._before, begin, reach)
        self._turns = self._turns[1], turn.turn if model.shows(turn) else np.nan
        return model.angle(mark, turn)
