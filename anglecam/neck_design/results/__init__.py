"""The results of ``anglecam neck``: one frozen dataclass a verb, in SI and radians."""
