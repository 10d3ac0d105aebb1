"""The command line: gives flags to the commands, and prints their results."""

import atexit
import gc
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, Union, get_args, get_type_hints

import tyro

from tussock.world.errors import InputError
from tussock.world.registry import suggestion

from ..setting_names import message_of
from .interruption import end_on_signals
from .name_check import check_names
from .overview import COMMANDS, overview
from .terminal import library_messages, message, show


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line for bad input, 1 when a check finds something, 130 when interrupted."""
    if arguments is None:
        tune_python()
        arguments = sys.argv[1:]
    if arguments == ["--version"]:
        print(f"tussock {version('tussock')}")
        return
    if not arguments or arguments[0] in ("-h", "--help"):
        with output_may_end():
            print(overview(), flush=True)
        sys.exit(0 if arguments else 2)
    if arguments[0] not in COMMANDS:
        fail(f"unknown command {arguments[0]!r}{suggestion(arguments[0], COMMANDS)}; tussock --help lists all")
    command = command_with_flags(arguments)
    end_on_signals()
    try:
        check_names(command)
        if command.json:
            with library_messages(), standard_output_as_error():
                result = command.run()
            with output_may_end():
                print(json.dumps(result), flush=True)
        else:
            with library_messages():
                result = command.run()
            with output_may_end():
                show(result)
                sys.stdout.flush()
        if result.get("ok") is False:  # what was to be checked is not as it should be
            sys.exit(1)
    except InputError as error:
        fail(message_of(error, [name for name, value in vars(command).items() if value is not None], "--"))
    except ModuleNotFoundError as error:
        if error.name != "torch":
            raise
        fail("this command needs torch, which is not installed; install it: pip install torch")
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


def command_with_flags(arguments: list[str]) -> Any:
    """The command that the arguments ask for. Exits where they ask for its help, or are wrong."""
    with output_may_end():  # that of the help
        try:
            return tyro.cli(
                choice_of({arguments[0]: command_of(*arguments[:2])}),
                prog="tussock",
                args=arguments,
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
            )
        finally:
            sys.stdout.flush()
    sys.exit(0)


def command_of(name: str, below: str = "") -> Any:
    """The class of a command, or a sentence and the classes of the commands under its name. Others are not imported, so help is fast."""
    command = _imported(COMMANDS[name])
    if name == "replicate":  # packages may add protocols
        from .protocols import protocol_commands

        sentence, fixed = command
        return sentence, fixed | {each: _with_plain_types(cls) for each, cls in protocol_commands(below).items()}
    return command


def _imported(command: Any) -> Any:
    """The class of a command, or a sentence and the classes of the commands under one name."""
    if isinstance(command, tuple):
        return command[0], {name: _imported(each) for name, each in command[1].items()}
    module, _, name = command.partition(":")
    return _with_plain_types(getattr(import_module(f".{module}", __package__), name))


def _with_plain_types(command: type) -> type:
    """A command whose help says INT where a flag takes a whole number or is left out: not {None}|INT, and no (default: None)."""
    for name, hint in get_type_hints(command, include_extras=True).items():
        told = [getattr(each, "metavar", None) for each in getattr(hint, "__metadata__", ())]
        kinds = get_args(hint.__origin__ if told else hint)
        if type(None) in kinds:
            metavar = "|".join(each.__name__.upper() for each in kinds if each is not type(None))
            shown = next(filter(None, told), metavar)
            command.__annotations__[name] = Annotated[hint, tyro.conf.arg(metavar=shown, help_behavior_hint="")]
    return command


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


def tune_python() -> None:
    """Settings for a process of its own: look for garbage in cycles rarely, and not at the end, and let threads take turns often.

    Imports make a million objects, none of them garbage. To look through these again and again takes a second of `tussock run`, half of
    it at the end.
    """
    gc.set_threshold(100_000)
    atexit.register(gc.freeze)
    # Seconds. With the usual 0.005, a thread that imports stops one that encodes views for that long at each array.
    sys.setswitchinterval(0.0002)


@contextmanager
def output_may_end() -> Iterator[None]:
    """Go on quietly after the block where what reads the output stops reading, as `head` does."""
    try:
        yield
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


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
