"""Progress of long work: a function that is called with how much is done, of how much."""

import sys
import time
from collections.abc import Callable

Progress = Callable[[int, int], object]


def no_progress(done: int, total: int) -> None:
    """Report nothing."""


class PrintedProgress:
    """Prints a line on standard error now and then, where work takes long: how much is done, how fast, and how long the rest takes.

    Args:
        what: What is being done.
        unit: Of what it is counted in.
        to_the_end: Whether to print the last line where there was none before.
    """

    FIRST, PAUSE = 2.0, 10.0  # seconds until the first line, and between two

    def __init__(self, what: str, unit: str = "", *, to_the_end: bool = False):
        self.what, self.unit, self.to_the_end = what, unit, to_the_end
        self.began = time.monotonic()
        self.next = self.began + self.FIRST
        self.before: int | None = None  # done before this began

    def __call__(self, done: int, total: int) -> None:
        """Print how far it is, unless that was printed a moment ago."""
        rate = self.reached(done)
        if rate and (time.monotonic() > self.next or (self.to_the_end and done == total)):
            self.next = time.monotonic() + self.PAUSE
            counted = f"{done} of {total} {self.unit}".rstrip()
            left = in_words((total - done) / rate)
            print(f"{self.what}: {counted}, {rate:.3g} a second, {left} left", file=sys.stderr)

    def reached(self, done: int) -> float:
        """How much is done in a second, of the work that was done since this began (1/s)."""
        if self.before is None:  # what led to the first call is not counted: it may be other work
            self.before, self.began = done, time.monotonic()
        return (done - self.before) / max(time.monotonic() - self.began, 1e-9)


def in_words(seconds: float) -> str:
    """A duration, as short as people say it: 40 s, 12 min, 2.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"


def printed(progress: Progress | None, what: str, unit: str = "") -> Progress:
    """A progress that was given, or a new one that prints."""
    return PrintedProgress(what, unit) if progress is None else progress
