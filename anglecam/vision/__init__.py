"""From single frames to the mark, the pivot, the body's rotation and the camera's motion.

What is found over a whole clip and how it becomes an angle belongs in `anglecam.measurement`.
"""
