"""A sweep file: which runs it asks for. Everything that can be refused is refused before the first of them."""

import dataclasses
import itertools
import json
import math
import re
import tomllib
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from types import NoneType
from typing import Any

from tussock.world.errors import InputError
from tussock.world.params import is_generated

from ..cli.run_options import FILE_SUFFIX, RunOptions

MOST_RUNS = 1_000_000
SETTINGS = {each.name: each for each in dataclasses.fields(RunOptions)}
_TYPES = typing.get_type_hints(RunOptions)
Choice = dict[str, Any]  # settings that go together


@dataclass(frozen=True)
class Sweep:
    """What a sweep file asks for: a run for each combination of one choice an axis.

    title: in the person's words. fixed: settings of all runs. axes: by name, their choices: what each sets.
    """

    title: str
    fixed: Choice
    axes: dict[str, list[Choice]]

    def __len__(self) -> int:
        return math.prod(map(len, self.axes.values()))

    def runs(self) -> Iterator[RunOptions]:
        """The settings of each run, the last axis changing fastest. Each learns and walks on one thread, where nothing else is said."""
        for choices in itertools.product(*self.axes.values()):
            merged: Choice = {"threads": 1} | self.fixed
            for choice in choices:
                merged |= choice
            yield RunOptions(**merged)


def read_sweep(path: Path) -> Sweep:
    """The sweep that a TOML file asks for. Raises InputError, naming the line, for what cannot be run.

    File names in it are relative to its folder.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text in UTF-8; give a sweep file (docs/sweeps.md)") from error
    return _Reader(path, text).sweep()


class _Reader:
    """Turns a sweep file into a `Sweep`, knowing where in the file it is."""

    def __init__(self, path: Path, text: str):
        self.path, self.lines = path, text.splitlines()
        try:
            self.document = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise InputError(f"{path} is not TOML: {error}") from error

    def sweep(self) -> Sweep:
        """The sweep, every run of it checked."""
        for key, value in self.document.items():
            if key not in ("title", "fixed", "axes"):
                raise self.error("", key, f"unknown {key!r}; a sweep has title, [fixed] and [axes]")
            if not isinstance(value, str if key == "title" else dict):
                raise self.error("", key, f"{key} is {'a text' if key == 'title' else f'a table, [{key}]'}")
        if not self.document.get("axes"):
            raise InputError(
                f"{self.path} has no [axes]; name what is to vary, for example offset-m = [-0.1, 0.0, 0.1]"
            )
        fixed = self.settings("fixed", self.document.get("fixed", {}))
        axes: dict[str, list[Choice]] = {}
        for name, values in self.document["axes"].items():
            if name.replace("-", "_") in axes:
                raise self.error("axes", name, f"{name} is there twice; leave one out")
            axes[name.replace("-", "_")] = self.choices(name, values)
        self.check_names(fixed, axes)
        sweep = Sweep(title=self.document.get("title", self.path.stem), fixed=fixed, axes=axes)
        if (count := math.prod(map(len, axes.values()))) > MOST_RUNS:
            raise InputError(f"{self.path} asks for {count:,} runs; ask for {MOST_RUNS:,} at most")
        self.check_values(fixed, axes)
        for number, run in enumerate(sweep.runs(), 1):
            try:
                run.check()
            except InputError as error:
                raise InputError(f"{self.path}, run {number} of {len(sweep)}: {error}") from error
        return sweep

    def check_names(self, fixed: Choice, axes: dict[str, list[Choice]]) -> None:
        """Refuse what is set twice, and axes whose choices set different things."""
        setters = {key: ("fixed", key) for key in fixed}
        for name, choices in axes.items():
            for key in choices[0]:
                if key in setters:
                    raise self.error("axes", name, f"{key} is set here and in {' '.join(setters[key])}; leave one out")
                setters[key] = ("axis", name)
            if any(choice.keys() != choices[0].keys() for choice in choices):
                raise self.error("axes", name, f"all choices of {name} set the same: {', '.join(choices[0])}")
            if len({json.dumps(choice, default=str) for choice in choices}) < len(choices):
                raise self.error(
                    "axes", name, f"{name} has the same choice twice; a run repeats to the byte: vary its seed"
                )

    def check_values(self, fixed: Choice, axes: dict[str, list[Choice]]) -> None:
        """Check each setting by itself, so that the error can name the line it stands in."""
        single = [("fixed", key, {key: value}) for key, value in fixed.items()]
        single += [("axes", name, choice) for name, choices in axes.items() for choice in choices]
        for table, name, choice in single:
            try:
                RunOptions(**choice).check()
            except InputError as error:
                raise self.error(table, name, str(error), *choice.values()) from error

    def choices(self, name: str, values: Any) -> list[Choice]:
        """The choices of an axis: a list of values, of tables that set several settings each, or a range of numbers."""
        if isinstance(values, dict):
            values = self.numbers(name, values)
        if not isinstance(values, list) or not values:
            raise self.error(
                "axes", name, f"{name} is a list with something in it, or a range: {{ from = 0, to = 19 }}"
            )
        if all(isinstance(value, dict) for value in values):
            return [self.settings("axes", value, at=name) for value in values]
        return [self.settings("axes", {name: value}) for value in values]

    def numbers(self, name: str, given: dict[str, Any]) -> list[float]:
        """The numbers of { from = , to = , step = } (1 where it is left out) or { from = , to = , count = }, both ends included."""
        keys = set(given)
        known = keys in ({"from", "to"}, {"from", "to", "step"}, {"from", "to", "count"})
        if not known or not all(_is_number(value) for value in given.values()):
            raise self.error(
                "axes", name, f"a range is {{ from = 0, to = 19 }}, with step or count if need be, not {given}"
            )
        low, high = given["from"], given["to"]
        step = given.get("step", 1)
        steps = (high - low) / step if step > 0 else -1
        count = given.get("count", math.floor(steps + 1e-9) + 1 if 0 <= steps <= MOST_RUNS else 0)
        if not (
            isinstance(count, int)
            and 1 <= count <= MOST_RUNS
            and 0 <= high - low < math.inf
            and (count > 1 or low == high)
        ):
            raise self.error("axes", name, f"the range {given} holds no numbers, or too many")
        if "count" in given and count > 1:
            step = (high - low) / (count - 1)
        # Decimal fractions as people write them: 0.3, not 0.30000000000000004.
        return [value if isinstance(value := low + k * step, int) else round(value, 12) for k in range(count)]

    def settings(self, table: str, given: dict[str, Any], at: str | None = None) -> Choice:
        """Settings by the names of the flags of tussock run, with values of their types."""
        chosen = {}
        for key, value in given.items():
            name, line = key.replace("-", "_"), at or key
            if name not in SETTINGS:
                near = get_close_matches(name, SETTINGS, 1)
                hint = f"did you mean {near[0].replace('_', '-')}?" if near else "see tussock run --help"
                raise self.error(table, line, f"{key!r} is no setting of a run; {hint}")
            kinds = typing.get_args(_TYPES[name]) or (_TYPES[name],)
            if not _fits(value, kinds):
                raise self.error(table, line, f"{key} is {value!r}; give {_words(kinds)}", value)
            if name in chosen:
                raise self.error(table, line, f"{key} is set twice")
            chosen[name] = self.value(name, value, kinds)
        return chosen

    def value(self, name: str, value: Any, kinds: tuple[type, ...]) -> Any:
        """A value as the flag has it; file names as they are from everywhere."""
        if name == "world" and Path(value).suffix and not is_generated(value):
            return str((self.path.parent / value).resolve())
        if name == "model" and value.endswith(FILE_SUFFIX):
            return str((self.path.parent / value).resolve())
        if Path in kinds:
            return (self.path.parent / value).resolve()
        return float(value) if float in kinds else value

    def error(self, table: str, key: str, message: str, *values: Any) -> InputError:
        """Bad input, with the line that it stands in: that of the key, or of a value below it that is told."""
        line = self.line_of(table, key)
        for value in values:
            spelled = json.dumps(value, default=str)
            here = [n for n in range(line, len(self.lines) + 1) if spelled in self.lines[n - 1]]
            line = here[0] if here else line
        return InputError(f"{self.path}, line {line}: {message}")

    def line_of(self, table: str, key: str) -> int:
        """Number of the line where a key of a table stands; that of the table, or 1, where it cannot be told."""
        within, found = "", 1
        spelled = re.sub(r"\\?[-_]", "[-_]", re.escape(key))  # as a flag or as a column
        for number, line in enumerate(self.lines, 1):
            header = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", line)
            if header:
                within = header.group(1)
                found = number if within.split(".")[0] in (table or key) else found
                if within in (key, f"{table}.{key}"):
                    return number
            elif within == table and re.match(rf"""\s*["']?{spelled}["']?\s*=""", line):
                return number
        return found


def _fits(value: Any, kinds: tuple[type, ...]) -> bool:
    """Whether a TOML value is of one of the types; a whole number is a number."""
    if isinstance(value, bool):
        return bool in kinds
    if isinstance(value, int):
        return _is_number(value) and (int in kinds or float in kinds)
    return (isinstance(value, float) and float in kinds) or (isinstance(value, str) and (str in kinds or Path in kinds))


def _words(kinds: tuple[type, ...]) -> str:
    names = {str: "a text", int: "a whole number", float: "a number", bool: "true or false", Path: "a file name"}
    return " or ".join(names[kind] for kind in kinds if kind is not NoneType)


def _is_number(value: Any) -> bool:
    """Whether it is a finite number, a whole one of 64 bits at most."""
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, int) and not isinstance(value, bool) and -(2**63) <= value < 2**63
