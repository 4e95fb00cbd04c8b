"""What can go wrong outside our own code, as exceptions whose text is the one line that the user reads."""


class AnglecamError(Exception):
    """Base of every failure that is told to the user in one line: ``what: how much, what next``."""


class RigError(AnglecamError):
    """The call, the rig file or the make-up of a session is wrong; nothing can be done with it (exit status 2)."""


class InputError(AnglecamError):
    """One clip, series or command file cannot be used; the others of the call still can (exit status 1)."""
