"""Damaged files: whatever is wrong with one, it is measured or refused in one line that names it."""
