"""What people see of a command while it works: messages, progress, results."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from typing import Any


def say(text: str) -> None:
    """Tell the person something that is not the result."""
    print(text, file=sys.stderr)


@contextmanager
def library_messages() -> Iterator[None]:
    """Show what the library logs, in lines on standard error, while the block runs."""

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            say(self.format(record))

    logger, handler, level = logging.getLogger("tussock"), Handler(logging.INFO), logging.getLogger("tussock").level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


@contextmanager
def saying_when_slow(text: str, seconds: float = 1.0) -> Iterator[None]:
    """Say what takes so long, once it takes longer than `seconds`."""
    timer = Timer(seconds, say, [text])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def progress_of_parts() -> Iterator[Callable[[str, int, int], object]]:
    """Show progress of work in parts; gives a function report(part, done, total)."""
    with progress("", "") as report:
        yield lambda part, done, total: report(done, total, description=part)


@contextmanager
def progress(what: str, unit: str, *, aloud: bool = False) -> Iterator[Callable[..., object]]:
    """Show progress on standard error, where that is a terminal; gives a function report(done, total, description=what).

    aloud: for work of hours: show the rate as well, and elsewhere, as in the log of a job, say a line now and then.
    """
    # Late: rich takes a tenth of a second that --help does not need.
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    words, numbers = TextColumn("{task.description}"), (MofNCompleteColumn(), TextColumn(unit), TimeRemainingColumn())
    console = Console(stderr=True)
    pace = _Pace(unit) if aloud else None
    with Progress(
        words, BarColumn(), *numbers, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(what, total=None)

        def report(done: int, total: int, **changed: Any) -> None:
            if pace is not None:
                pace.reached(done, total)
                changed["description"] = f"{what} {pace.rate:.3g} a second"
                if not console.is_terminal:
                    pace.tell()
            bar.update(task, completed=done, total=total, **changed)

        yield report


class _Pace:
    """How fast work goes on, in words."""

    SECONDS = 30.0  # between two lines

    def __init__(self, unit: str):
        self.unit, self.done, self.total = unit, 0, 0
        self.first: int | None = None  # done before this began
        self.began = self.told = time.monotonic()

    def reached(self, done: int, total: int) -> None:
        if self.first is None:
            self.first = done
        self.done, self.total = done, total

    @property
    def rate(self) -> float:
        """Of the work that was done here (1/s)."""
        return (self.done - (self.first or 0)) / max(time.monotonic() - self.began, 1e-9)

    def tell(self) -> None:
        """Say how far it is, unless that was said a moment ago."""
        if self.rate and (time.monotonic() - self.told > self.SECONDS or self.done == self.total):
            self.told = time.monotonic()
            minutes = (self.total - self.done) / self.rate / 60
            say(f"{self.done} of {self.total} {self.unit}, {self.rate:.3g} a second, {minutes:.3g} min left")


def show(result: dict[str, Any]) -> None:
    """Print a result for people: a line a value, a line each where a value is a list, a table where the rows have names, and a text
    of several lines as it stands.
    """
    width = max(map(len, result))
    for key, value in result.items():
        if isinstance(value, dict) and any(isinstance(row, dict) for row in value.values()):
            show_table(key, value)
        elif isinstance(value, dict):
            print(f"{key:<{width}}  {', '.join(f'{name} {text(each)}' for name, each in value.items()) or 'none'}")
        elif isinstance(value, list):
            for row in value:
                print("  ".join(map(text, row.values())) if isinstance(row, dict) else f"{key:<{width}}  {text(row)}")
        elif isinstance(value, str) and "\n" in value:
            print(value)
        else:
            print(f"{key:<{width}}  {text(value)}")


def show_table(name: str, rows: dict[str, dict[str, Any]]) -> None:
    """Print rows by their names; all have the same columns."""
    from rich.console import Console
    from rich.table import Table

    columns = next(iter(rows.values()))
    table = Table(
        name, *(column.replace("_", " ") for column in columns), box=None, pad_edge=False, header_style="bold"
    )
    for key, row in rows.items():
        table.add_row(key, *map(text, row.values()))
    # Where nobody looks, as in a pipe, a line a row however long.
    console = Console()
    Console(width=console.width if console.is_terminal else 200).print(table)


def text(value: Any) -> str:
    """A value as people read it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}" if value >= 10_000 else str(value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
