"""Why nothing is measured: what was seen, where, and the line of `rig.yaml` that may settle it."""

from __future__ import annotations

import numpy as np

from anglecam.engine.competition import SURE
from anglecam.engine.learn import Learnt

_REST = "to measure a mechanism at rest, declare pivot: {at: [x, y], sigma_px: s} in rig.yaml"


def why_nothing_turns(learnt: Learnt | None) -> str:
    """Return a sentence for a film in which no body is seen to turn.

    Parameters
    ----------
    learnt : Learnt, optional
        What moves; ``None`` where nothing does.
    """
    if learnt is None:
        return f"nothing is seen to turn; {_REST}"
    sample = learnt.sample
    change = np.abs(sample.pictures - sample.median).mean(axis=0)
    row, column = np.unravel_index(int(np.argmax(change)), change.shape)
    x, y = sample.in_film(np.array([column, row]))
    seen = f"something moves around {x:.0f},{y:.0f}"
    if learnt.explanations:
        best = learnt.explanations[0]
        if best.lead < SURE:
            seen += f", but nothing shows that it turns: {best.lead:.1f} standard errors, of {SURE:g} that it takes"
        else:
            off = 100.0 * best.fit.off_centre
            seen += f", but not about a fixed point: its middle is off by {off:.1f} % of its travel"
    frame = int(sample.frames[0])
    return f"{seen}; point at it: mark: {{at: [{x:.0f}, {y:.0f}], frame: {frame}}} in rig.yaml"
