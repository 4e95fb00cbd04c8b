"""The paper's mechanism, equation by equation: geometry first."""

from anglecam.neck.fourbar import FourBar, StraightLine, head_angle, joints, reach, servo_angle, straight_line

__all__ = ["FourBar", "StraightLine", "head_angle", "joints", "reach", "servo_angle", "straight_line"]
