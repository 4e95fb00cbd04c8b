"""Why nothing is measured: what was seen, where, and the line of `rig.yaml` that may settle it."""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.engine.competition import OFF_CENTRE, RIGHT, SURE
from anglecam.engine.hints import Hints, obeys
from anglecam.engine.learn import Learnt

_UNSURE = 10
"""Frames in which a look-alike pose is nearly as probable: each is wrong with a probability of less than 0.05, so that
in half of the films with so many one of them is."""
_JUMP_DEG, _FASTER, _USUAL = 60.0, 3.0, 0.95
"""Least step between two frames that may be a jump, and how many times as large it is as nearly all others. Of 52 drawn
films that are measured rightly none has such a step."""
_REST = "to measure a mechanism at rest, declare pivot: {at: [x, y], sigma_px: s} in rig.yaml"


def why_nothing_turns(learnt: Learnt | None, first_frame: int) -> str:
    """Return a sentence for a film in which no body is seen to turn.

    Parameters
    ----------
    learnt : Learnt, optional
        What moves; ``None`` where nothing does.
    first_frame : int
        Number in the film of the first frame that is measured.
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
        elif best.share < RIGHT:
            seen += f", but a turn explains {best.share:.0%} of what it should, of {RIGHT:.0%} that it takes"
        elif best.fit.off_centre <= OFF_CENTRE:
            seen += ", but it turns by less than 1°, which a thing that stretches does as well"
        else:
            off = 100.0 * best.fit.off_centre
            seen += f", but not about a fixed point: its middle is off by {off:.1f} % of its travel"
    frame = first_frame + int(sample.frames[0])
    return f"{seen}; point at it: mark: {{at: [{x:.0f}, {y:.0f}], frame: {frame}}} in rig.yaml"


def why_ambiguous(ambiguous: Flags, first_frame: int) -> str | None:
    """Return a sentence where look-alike poses were perhaps not told apart in (n,) frames."""
    frames = np.flatnonzero(ambiguous)
    if len(frames) < _UNSURE:
        return None
    first = first_frame + int(frames[0])
    return (
        f"in {len(frames)} frames, the first of them {first}, what turns looks the same in another pose that is"
        " nearly as probable, and what follows may be off by the turn between the two; mark one of the like parts"
    )


def why_jump(turn: Floats, first_frame: int) -> str | None:
    """Return a sentence where what is followed jumps once, as where another like thing is seen instead.

    Parameters
    ----------
    turn : ndarray
        (n,) rad; NaN where nothing is seen.
    first_frame : int
        Number in the film of the first frame that is measured.
    """
    seen = np.flatnonzero(np.isfinite(turn))
    step = np.degrees(np.abs(np.angle(np.exp(1j * np.diff(turn[seen])))))
    if len(step) == 0:
        return None
    k = int(np.argmax(step))
    before, after = first_frame + seen[k], first_frame + seen[k + 1]
    if step[k] < max(_JUMP_DEG, _FASTER * float(np.quantile(step, _USUAL))):
        return None
    return (
        f"from frame {before} to {after} what is followed turns by {step[k]:.0f}°, faster than it is ever seen"
        " to turn; another like part may be seen from there on; mark one of them"
    )


def why_another(learnt: Learnt, declared: Hints, first_frame: int) -> str | None:
    """Return a sentence where what turns is not what is declared.

    Parameters
    ----------
    learnt : Learnt
        The first explanation is the body that is followed.
    declared : Hints
        A mark or a fixed pivot. What is only a hint is no declaration.
    first_frame : int
        Number in the film of the first frame that is measured.
    """
    first = learnt.explanations[0]
    if obeys(first.fit, learnt.sample, declared):
        return None
    x, y = first.fit.proposal.centre_px
    meant = []
    if declared.pivot_px is not None:
        meant.append("pivot {:.0f},{:.0f}".format(*declared.pivot_px))
    if declared.mark_px is not None:
        middle = 0.5 * (declared.mark_px[:2] + declared.mark_px[2:])
        meant.append("mark around {:.0f},{:.0f} in frame {}".format(*middle, first_frame + declared.mark_frame))
    return f"what is seen to turn, about {x:.0f},{y:.0f}, is not what is declared ({' and '.join(meant)})"
