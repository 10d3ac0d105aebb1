"""Pages of the reference that are made of the code: the commands, the parameters of worlds, and the settings of runs.

A Sphinx extension: it writes them into docs/reference before Sphinx reads the pages.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import docstring_parser

from tussock.navigation.cli.main import command_of
from tussock.navigation.cli.options import RunOptions
from tussock.navigation.cli.overview import COMMANDS
from tussock.navigation.settings_table import TYPES
from tussock.world.params import OTHERS, PRESETS, WORLDS, WorldParams
from tussock.world.settings import describe

FOLDER = Path(__file__).parent / "reference"


def setup(app: Any) -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", lambda _: write_pages(FOLDER))
    return {"parallel_read_safe": True}


def write_pages(folder: Path) -> None:
    """Write the pages that are made of the code; a page that would be the same is left as it is, so that it is not built again."""
    for name, text in {"commands": commands(), "worlds": worlds(), "settings": run_settings()}.items():
        page = folder / f"{name}.md"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def commands() -> str:
    """All commands, with their flags."""
    text = [
        "# Commands",
        "",
        "Every command and flag, as `tussock COMMAND --help` has them. All print one JSON object with `--json`.",
        "",
    ]
    for name in COMMANDS:
        found = command_of(name)
        if isinstance(found, tuple):
            text += [f"## tussock {name}", "", found[0], ""]
            for below, command in found[1].items():
                text += _command(f"{name} {below}", command, "###")
        else:
            text += _command(name, found, "##")
    return "\n".join(text) + "\n"


def _command(name: str, command: type, level: str) -> list[str]:
    rows = [(_flag(each), _default(each), help_of(command, each.name)) for each in dataclasses.fields(command)]
    return [
        f"{level} tussock {name}",
        "",
        inspect.getdoc(command) or "",
        "",
        *table(("flag", "default", "meaning"), rows),
    ]


def _flag(field: dataclasses.Field) -> str:
    metavars = [each.metavar for each in _notes(field.type) if getattr(each, "metavar", None)]
    return f"`{metavars[0] if 'Positional' in str(field.type) else '--' + field.name.replace('_', '-')}`"


def _default(field: dataclasses.Field) -> str:
    if field.default is dataclasses.MISSING:
        return "required" if field.default_factory is dataclasses.MISSING else ""
    if field.default is None or field.default is False or field.default == "":
        return ""
    return f"`{field.default:.6g}`" if isinstance(field.default, float) else f"`{field.default}`"


def help_of(command: type, name: str) -> str:
    """What a flag of a command means: what its annotation says, or else the text below it in the class, or in one that it is made of."""
    hint = get_type_hints(command, include_extras=True)[name]
    told = [getattr(each, "help", None) for each in _notes(hint)]
    if any(told):
        return next(filter(None, told))
    return next((texts[name] for cls in command.__mro__ if name in (texts := _texts(cls))), "")


def _notes(hint: Any) -> Iterable[Any]:
    """What annotations say beside the type."""
    if hasattr(hint, "__metadata__"):
        yield from hint.__metadata__
        yield from _notes(hint.__origin__)
    elif get_origin(hint) is not None:
        for each in get_args(hint):
            yield from _notes(each)


def _texts(cls: type) -> dict[str, str]:
    """The text below each field of a class."""
    try:
        return _descriptions(docstring_parser.parse_from_object(cls))
    except (OSError, TypeError):  # the class was made while the program ran, or is Python's own
        return {}


def worlds() -> str:
    """The presets of worlds, and all parameters with unit and range."""
    told = described(WorldParams)
    fields = describe(WorldParams)
    rows = [
        (
            f"`{name}`",
            told[name],
            each.get("unit", ""),
            _range(each),
            *(_value(WORLDS.find(preset)(), name) for preset in PRESETS),
        )
        for name, each in fields.items()
    ]
    return "\n".join([
        "# Parameters of worlds", "",
        "A preset's name, and after it any of these parameters, is a world: `--world 'meadow field_width=20 trees=0'`. A value outside its "
        "range is refused. In Python: `World.generate(WorldParams(field_width=20, trees=0), seed=7)`.", "",
        f"{', '.join(f'`{name}`' for name in PRESETS)} have the same parameters, with other defaults:", "",
        *table(("parameter", "meaning", "unit", "range", *PRESETS), rows), "",
        *(line for name in OTHERS for line in _of_its_own(name)),
    ]) + "\n"  # fmt: skip


def _of_its_own(name: str) -> list[str]:
    """The section of a preset that has parameters of its own."""
    preset = WORLDS.find(name)
    parameters = {each: about.default for each, about in inspect.signature(preset).parameters.items() if each != "seed"}
    rows = [(f"`{each}`", described(preset)[each], f"`{default:g}`") for each, default in parameters.items()]
    about = (inspect.getdoc(preset) or "").split("\n\n")[0]
    return [f"## {name}", "", about, "", *table(("parameter", "meaning", "default"), rows), ""]


def _range(field: dict[str, Any]) -> str:
    low, high = field.get("low"), field.get("high")
    return "0 to 255 each" if low is None or high is None else f"{low:g} to {high:g}"


def _value(params: WorldParams, name: str) -> str:
    value = getattr(params, name)
    return ", ".join(map(str, value)) if isinstance(value, tuple) else f"{value:g}"


def run_settings() -> str:
    """The settings of runs: columns of runs.parquet, and of the settings in summary.json."""
    rows = [
        (f"`{name}`", _kind(kind), help_of(RunOptions, name) if hasattr(RunOptions, name) else "")
        for name, kind in TYPES.items()
    ]
    return "\n".join([
        "# Settings of runs", "",
        "Everything that decides a run. These are the columns of a sweep's `runs.parquet`, the `settings` in `summary.json`, the axes of a "
        "[sweep file](../sweeps.md) and, with `-` in place of `_`, the flags of `tussock run`. The results beside them are in "
        "[a walk in numbers](../trajectory.md).", "",
        *table(("setting", "type", "meaning"), rows), "",
        "`runs.parquet` has beside these and the results: `key` (of the run), `command` (that repeats it), `error` (why it could not be "
        "walked), `seconds` and `learn_seconds`, and `recording` (the path of the recording, if there is one).",
    ]) + "\n"  # fmt: skip


def _kind(kind: Any) -> str:
    return (
        re.sub(r"<class '(?:\w+\.)*(\w+)'>", r"\1", str(kind)).replace("pathlib.", "").replace(" | None", ", or none")
    )


def described(documented: Any) -> dict[str, str]:
    """What a docstring says of each attribute of a class, or of each argument of a function."""
    return _descriptions(docstring_parser.parse(inspect.getdoc(documented) or ""))


def _descriptions(parsed: docstring_parser.Docstring) -> dict[str, str]:
    return {each.arg_name: " ".join((each.description or "").split()) for each in parsed.params}


def table(columns: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """The lines of a table in Markdown."""
    columns = list(columns)
    body = [[cell.replace("|", "\\|").replace("*", "\\*") for cell in row] for row in rows]
    return ["| " + " | ".join(each) + " |" for each in [columns, ["---"] * len(columns), *body]]
