"""Fuzzing with damaged files: each must be measured, or refused in one line that names it."""
