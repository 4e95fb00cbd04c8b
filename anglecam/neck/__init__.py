"""The paper's equations, a file each: geometry, servo, head, spring, statics, motion, design relations, control.

The four-bar is re-exported here for the film generator. Import everything else from its module: the modules that step,
tune or optimise a neck need python-control, which is slow to load.
"""

from anglecam.neck.fourbar import FourBar, crank_reach, head_angle, joints, reach, servo_angle
from anglecam.neck.transmission import straight_line

__all__ = ["FourBar", "crank_reach", "head_angle", "joints", "reach", "servo_angle", "straight_line"]
