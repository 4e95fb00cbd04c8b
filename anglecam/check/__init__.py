"""Will it work: from a few seconds of film, the uncertainty to expect, what could be seen, and what would help."""
