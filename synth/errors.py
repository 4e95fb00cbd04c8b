"""What can go wrong, in the one line that the user reads."""


class SpecError(Exception):
    """The call or the spec is wrong."""


class RenderError(Exception):
    """The machine cannot draw."""
