"""Films path-traced by Mitsuba 3, an independent renderer, with known truth."""
