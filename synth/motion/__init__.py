"""The true motion of a recording, from the command to the head's angle.

    command    rows of the command file; nod: a human nod
    drive      the command after the controller and the effects on the command, in closed form
    mechanism  the plant's equation of motion: the base model, or the paper's neck (neck, linkage, servo)
    system     plant and effects (`synth.effects`) as a piecewise smooth right-hand side
    integrate  the integration from kink to kink

Nothing is smoothed, and no code is shared with the models that `anglecam` fits.
"""

from synth.motion.command import command_rows
from synth.motion.move import Motion, move
from synth.motion.neck import linear_model

__all__ = ["Motion", "command_rows", "linear_model", "move"]
