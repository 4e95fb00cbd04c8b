"""Why a frame has no angle, as far as vision can know it; `anglecam.data.series.STATUSES` lists all causes."""

NO_MARK, OCCLUDED, AMBIGUOUS, UNDECODABLE = "no_mouth", "occluded", "ambiguous", "undecodable"
