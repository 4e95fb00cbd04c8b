"""Which explanation of what moves in a film predicts held-out pixels best, and whether it is the right one."""
