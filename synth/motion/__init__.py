"""The true motion: what is commanded, what the drive makes of it, and how the head answers, from event to event.

    command   rows of the command file, a human nod
    drive     controller, dead time, rate limit, play and lag in closed form
    plant     the base model or the paper's neck, the four-bar, the servo's limits
    load      friction, springs, gravity, what swings on the head
    integrate the whole from kink to kink

Nothing is smoothed, and nothing comes from what `anglecam` fits with.
"""

from synth.motion.command import command_rows
from synth.motion.move import Motion, move
from synth.motion.neck import linear_model

__all__ = ["Motion", "command_rows", "linear_model", "move"]
