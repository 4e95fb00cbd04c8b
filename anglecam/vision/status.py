"""Why a frame has no angle, as far as single frames can show it.

`anglecam.data.series.STATUSES` lists all causes. ``no_mouth`` is fixed by the file format, whatever the mark is.
"""

NO_MARK, OCCLUDED, AMBIGUOUS, UNDECODABLE = "no_mouth", "occluded", "ambiguous", "undecodable"
