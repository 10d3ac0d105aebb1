"""Errors that a person can cause and correct: each is reported in one line."""


class InputError(ValueError):
    """Input that cannot be used.

    Its message is one line: what was given, where, and what to do instead. The command line prints it and exits with code 2.
    """


class SettingError(InputError):
    """A flag, a parameter or an argument with an invalid value."""


class FileError(InputError):
    """A file or folder that cannot be read or written."""


class DiskFullError(FileError):
    """A file that cannot be written because its disk is full."""


class MissingDependencyError(InputError):
    """A driver, library, program or display that is missing on this machine."""


def first_line(error: BaseException) -> str:
    """The message of an error of another library, without the lines that only programmers read."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
