"""The one exception for wrong use: bad files, bad values, missing tools."""


class InputError(ValueError):
    """Input that cannot be used; the message says what was expected, what came and how to mend
    it."""
