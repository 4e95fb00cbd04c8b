"""The clocks of a measured session: what its motion and its lamps show together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.identification.clock_fit import fit_clocks
from anglecam.identification.clocks import Clocks, clocks_of
from anglecam.workflow.session import MeasuredSession


def session_clocks(
    measured: MeasuredSession, records: Sequence[Record], effects: Sequence[tuple[Effect, Floats]] = ()
) -> Clocks | None:
    """Return offset and drift of the clocks of some recordings.

    Parameters
    ----------
    measured : MeasuredSession
        From `anglecam.workflow.session.measure_session`; its lamps separate clock offsets from the dead time.
    records : sequence of Record
        The recordings to fit.
    effects : sequence of (Effect, (k,) ndarray)
        Of the plant, with starting values of their parameters, SI.

    Returns
    -------
    Clocks or None
        ``None`` for the logs of an encoder, which have one clock, and as of
        `anglecam.identification.clock_fit.fit_clocks`.
    """
    if measured.session.rig.source == "encoder":
        return None
    commands = {recording.name: recording.command for recording in measured.session.recordings}
    as_filed = [replace(r, command=commands[r.name]) if r.command is not None else r for r in records]
    fit = fit_clocks(as_filed, effects)
    if fit is None:
        return None
    dated = {}
    for series in measured.series:
        command, lit = commands[series.name], series.evidence.lamp_s
        change = None if command is None else command.first_change()
        if change is not None and lit is not None:
            dated[series.name] = (0.5 * (lit[0] + lit[1]) - change, (lit[1] - lit[0]) / math.sqrt(12.0))
    return clocks_of(fit, dated)
