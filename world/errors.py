"""Errors that a person can cause and correct: each is reported in one line."""


class InputError(ValueError):
    """Input that cannot be used.

    Its message is one line: what was given, where, and what to do instead. The command line prints it and exits with code 2.
    """


class SettingError(InputError):
    """A flag, a parameter or an argument with an invalid value."""


class FieldError(SettingError):
    """A field of a settings class with an invalid value.

    Its text names the class and the field, as in Python. Whoever asked for the value by another name gives `problem` with that one.

    Attributes:
        owner: What the class is called.
        field: The field, or "" where several of them do not go together.
        problem: What is wrong and what to do, such as "is 0; give a whole number from 1".
        in_degrees: The same with angles in degrees alone; "" where it is not about an angle.
    """

    def __init__(self, owner: str, field: str, problem: str, in_degrees: str = ""):
        super().__init__(owner, field, problem, in_degrees)  # all of them, so that it can be sent to another process
        self.owner, self.field, self.problem, self.in_degrees = owner, field, problem, in_degrees

    def __str__(self) -> str:
        return f"{self.owner}: {self.field} {self.problem}" if self.field else f"{self.owner}: {self.problem}"


class FileError(InputError):
    """A file or folder that cannot be read or written."""


class DiskFullError(FileError):
    """A file that cannot be written because its disk is full."""


class MissingDependencyError(InputError):
    """A driver, library, program or display that is missing on this machine."""


def first_line(error: BaseException) -> str:
    """The message of an error of another library, without the lines that only programmers read."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
