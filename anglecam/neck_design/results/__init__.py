"""What each verb of ``anglecam neck`` works out: one frozen dataclass a verb, in SI and radians."""
