"""What people see of a command while it works: messages, progress, results."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


def say(text: str) -> None:
    """Tell the person something that is not the result."""
    print(text, file=sys.stderr)


@contextmanager
def progress(what: str, unit: str) -> Iterator[Callable[[int, int], object]]:
    """Show progress on standard error, where that is a terminal; gives a function report(done, total)."""
    # Late: rich takes a tenth of a second that --help does not need.
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    words, numbers = TextColumn("{task.description}"), (MofNCompleteColumn(), TextColumn(unit), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(
        words, BarColumn(), *numbers, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def show(result: dict[str, Any]) -> None:
    """Print a result for people: a line a value."""
    width = max(map(len, result))
    for key, value in result.items():
        print(f"{key:<{width}}  {f'{value:.4g}' if isinstance(value, float) else value}")
