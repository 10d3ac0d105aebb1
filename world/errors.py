"""The one exception a person can cause: bad input, said in one line."""


class InputError(ValueError):
    """Input that cannot be used. Its message says what was given, where, and what to do instead.

    The command line prints the message and exits with code 2.
    """
