"""The commands: what each is for, in the groups that `tussock --help` shows."""

import ast
from shutil import get_terminal_size
from textwrap import wrap
from typing import Any

from .unimported import class_at

# Where the class of a command is, by its name; or a sentence and the commands that go under one name.
GROUPS: dict[str, dict[str, Any]] = {
    "Make a world and look around": {
        "world": "worlds:WorldCommand",
        "view": "worlds:ViewCommand",
        "route": "worlds:RouteCommand",
        "describe": "describe:DescribeCommand",
    },
    "Learn a route and walk it home": {
        "run": "models:RunCommand",
        "play": "models:PlayCommand",
        "train": "models:TrainCommand",
        "models": "models:ModelsCommand",
    },
    "Measure views and models": {
        "evaluate": "models:EvaluateCommand",
        "compare": "models:CompareCommand",
        "ridf": "images:RidfCommand",
        "catchment": "images:CatchmentCommand",
        "place": "images:PlaceCommand",
    },
    "Make many runs": {
        "sweep": "sweeps:SweepCommand",
        "report": "sweeps:ReportCommand",
        "benchmark": "benchmark:BenchmarkCommand",
        "replicate": (
            "Re-run a published study and write a report to read next to it.",
            {
                "thesis": "studies:ThesisCommand",
                "knight2019": "published_images:Knight2019Command",
                "stone2017": "worldless:Stone2017Command",
            },  # and the protocols
        ),
        "study": "studies:StudyCommand",
    },
    "Use pictures of real places": {
        "database": (
            "Draw image databases in the BoB format, make them of pictures, and look for what is wrong with them.",
            {
                "grid": "databases:DatabaseGridCommand",
                "route": "databases:DatabaseRouteCommand",
                "import": "pictures:DatabaseImportCommand",
                "check": "databases:DatabaseCheckCommand",
            },
        ),
        "unwrap": "pictures:UnwrapCommand",
    },
}
COMMANDS: dict[str, Any] = {name: each for group in GROUPS.values() for name, each in group.items()}


def overview() -> str:
    """All commands in their groups, a sentence each."""
    left = max(map(len, COMMANDS)) + 4
    width = max(left + 20, min(get_terminal_size().columns, 100))
    lines = ["usage: tussock COMMAND [flags]", "", "Insect visual route navigation: worlds, views, familiarity, walks."]
    for title, commands in GROUPS.items():
        lines += ["", title]
        for name, command in commands.items():
            first = f"  {name}".ljust(left)
            lines += wrap(
                _sentence(command),
                width,
                initial_indent=first,
                subsequent_indent=" " * left,
            )
    return "\n".join(
        [
            *lines,
            "",
            "A first walk: tussock run, and then: tussock play run",
            "The flags of a command: tussock COMMAND --help. The version: tussock --version",
        ]
    )


def _sentence(command: Any) -> str:
    """What a command does: the docstring of its class, which is read, not imported, as that takes long."""
    if isinstance(command, tuple):
        return command[0]
    found = class_at(f"{__package__}.{command}")
    return ast.get_docstring(found) or found.name
