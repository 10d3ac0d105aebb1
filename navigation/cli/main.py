"""The command line: gives flags to the commands, and prints their results."""

import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from importlib.metadata import version
from typing import Annotated, Any, Union

import tyro

from tussock.world.errors import InputError

from .benchmark import BenchmarkCommand
from .databases import DatabaseCheckCommand, DatabaseGridCommand, DatabaseRouteCommand
from .models import CompareCommand, EvaluateCommand, ModelsCommand, PlayCommand, RunCommand, TrainCommand
from .protocols import protocol_commands
from .studies import StudyCommand, ThesisCommand
from .sweeps import ReportCommand, SweepCommand
from .terminal import library_messages, message, show
from .worlds import RouteCommand, ViewCommand, WorldCommand

# A command by its name, or a sentence and the commands that go under one name.
COMMANDS: dict[str, Any] = {
    "world": WorldCommand,
    "view": ViewCommand,
    "route": RouteCommand,
    "evaluate": EvaluateCommand,
    "train": TrainCommand,
    "compare": CompareCommand,
    "models": ModelsCommand,
    "run": RunCommand,
    "play": PlayCommand,
    "sweep": SweepCommand,
    "report": ReportCommand,
    "benchmark": BenchmarkCommand,
    "replicate": (
        "Re-run a published study and write a report to read next to it.",
        {"thesis": ThesisCommand},  # and the protocols: see `commands_for`
    ),
    "study": StudyCommand,
    "database": (
        "Draw image databases in the BoB format, and look for what is wrong with them.",
        {"grid": DatabaseGridCommand, "route": DatabaseRouteCommand, "check": DatabaseCheckCommand},
    ),
}


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line for bad input, 1 when a check finds something, 130 when interrupted."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments == ["--version"]:
        print(f"tussock {version('tussock')}")
        return
    command = tyro.cli(
        choice_of(commands_for(arguments)),
        prog="tussock",
        args=arguments,
        config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
        description="Insect visual route navigation: make a world, look around in it, learn a route, walk it home.",
    )
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what is open is closed and viewers are ended
    try:
        if command.json:
            with library_messages(), standard_output_as_error():
                result = command.run()
            print(json.dumps(result), flush=True)
        else:
            with library_messages():
                result = command.run()
            show(result)
        if result.get("ok") is False:  # what was to be checked is not as it should be
            sys.exit(1)
    except InputError as error:
        fail(str(error))
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except RuntimeError as error:
        if "allocate" not in str(error) and "out of memory" not in str(error):
            raise
        fail("not enough memory for this model; take fewer pixels (--resize), or another model")  # as torch says it
    except MemoryError as error:
        fail(f"not enough memory ({error}); take a smaller --size, or fewer views")
    except KeyboardInterrupt:
        message("tussock: interrupted")
        sys.exit(130)


def commands_for(arguments: list[str]) -> dict[str, Any]:
    """The commands that some arguments choose from. Protocols, which packages may add, are looked for only after `replicate`."""
    if arguments[:1] != ["replicate"]:
        return COMMANDS
    sentence, fixed = COMMANDS["replicate"]
    return COMMANDS | {"replicate": (sentence, fixed | protocol_commands(*arguments[1:2]))}


def choice_of(commands: dict[str, Any]) -> Any:
    """The type, as tyro reads it, of one of several commands."""

    def group(sentence: str, below: dict[str, Any]) -> Any:
        choice = Annotated[choice_of(below), tyro.conf.arg(name="")]

        def chosen(command: choice) -> Any:  # pyright: ignore[reportInvalidTypeForm] (made from a dictionary)
            return command

        chosen.__doc__ = sentence
        return chosen

    kinds = [
        Annotated[Any, tyro.conf.subcommand(name, constructor=group(*each) if isinstance(each, tuple) else each)]
        for name, each in commands.items()
    ]
    return Union[*kinds, Annotated[None, tyro.conf.Suppress]]  # the last so that one command is a choice, too


@contextmanager
def standard_output_as_error() -> Iterator[None]:
    """Send what anyone prints to standard error meanwhile, libraries that write to file descriptor 1 included."""
    sys.stdout.flush()
    output = os.dup(1)
    os.dup2(2, 1)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(output, 1)
        os.close(output)


def fail(error: str) -> None:
    """Print what was wrong in one line and exit with code 2."""
    message(f"tussock: {' '.join(error.split())}")
    sys.exit(2)


if __name__ == "__main__":
    main()
