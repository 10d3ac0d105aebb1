"""What people see of a command: messages, progress, results."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from logging.handlers import MemoryHandler
from typing import Any

from tussock.world.progress import PrintedProgress

from .interruption import check_interrupted


def message(text: str) -> None:
    """Print something that is not the result."""
    print(text, file=sys.stderr)


@contextmanager
def library_messages() -> Iterator[None]:
    """Print what the library logs, as messages, while the block runs. The same text is printed once."""
    printed: set[str] = set()

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            text = self.format(record)
            if text not in printed:
                printed.add(text)
                message(text)

    logger = logging.getLogger("tussock")
    handler, level = Handler(logging.INFO), logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


@contextmanager
def held_messages() -> Iterator[Callable[[bool], None]]:
    """Hold what the library logs until the given function is called: with True it is printed, with False it is not. An error prints it."""
    logger = logging.getLogger("tussock")
    handlers, held = list(logger.handlers), MemoryHandler(capacity=10_000, flushLevel=logging.CRITICAL + 1)
    logger.handlers[:] = [held]

    def let_go(printed: bool) -> None:
        logger.handlers[:] = handlers
        records, held.buffer = held.buffer, []
        for record in records if printed else ():
            for handler in handlers:
                handler.handle(record)

    try:
        yield let_go
    finally:
        let_go(True)


@contextmanager
def progress_of_parts() -> Iterator[Callable[[str, int, int], object]]:
    """Show progress of work in parts; gives a function report(part, done, total)."""
    with progress("", "") as report:
        yield lambda part, done, total: report(done, total, description=part)


@contextmanager
def progress(what: str, unit: str, *, verbose: bool = False) -> Iterator[Callable[..., object]]:
    """Show progress on standard error, as a bar or, where that is not a terminal, as a line now and then; gives a function
    report(done, total, description=what).

    verbose: for work of hours: show the rate as well, and say when all is done.
    """
    # Late: rich takes a tenth of a second that --help does not need.
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), unit, TimeRemainingColumn())
    console = Console(stderr=True)
    line = PrintedProgress(what, unit, to_the_end=verbose)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)

        def report(done: int, total: int, description: str = what) -> None:
            nonlocal line
            check_interrupted()
            if description != line.what:
                line = PrintedProgress(description, unit, to_the_end=verbose)
            if not console.is_terminal:
                line(done, total)
            rate = f" {line.reached(done):.3g} a second" if verbose else ""
            bar.update(task, completed=done, total=total, description=description + rate)

        yield report


def show(result: dict[str, Any]) -> None:
    """Print a result for people: one line per value, one per item of a list, a table where rows have names, and a text of several lines
    as it is.
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
    # In a pipe, one line per row, however long.
    console = Console()
    Console(width=console.width if console.is_terminal else 200).print(table)


def text(value: Any) -> str:
    """A value as people read it."""
    if value is None:
        return "-"
    if isinstance(value, tuple):
        return ", ".join(map(text, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}" if value >= 10_000 else str(value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
