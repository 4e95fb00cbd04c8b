"""Forward models: from parameters and a command to the angle over time."""
