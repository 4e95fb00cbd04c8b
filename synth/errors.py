"""Errors whose one line of text is shown to the user."""


class SpecError(Exception):
    """The call or the spec is wrong."""


class RenderError(Exception):
    """Drawing is not possible on this machine."""
