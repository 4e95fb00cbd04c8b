"""Films and bad inputs made to order; nothing here knows how anglecam measures."""
