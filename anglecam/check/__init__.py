"""Will it work: from a few seconds of film, the uncertainty to expect, the effects that could be seen, what would help."""
