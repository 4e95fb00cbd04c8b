"""Films that are meant to mislead, drawn with plain NumPy, and what `anglecam measure` makes of them."""
