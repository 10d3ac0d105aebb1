"""What a person can cause: bad input, reported in one line."""


class InputError(ValueError):
    """Input that cannot be used. Its message gives what was given, where, and what to do instead.

    The command line prints the message and exits with code 2. The subclasses tell the kinds apart.
    """


class SettingError(InputError):
    """A flag, a parameter or an argument with a value that cannot be used."""


class FileError(InputError):
    """A file or folder that cannot be read or written."""


class DiskFullError(FileError):
    """A file that cannot be written because its disk is full."""


class MissingDependencyError(InputError):
    """A driver, library, program or display that is not on this machine."""
