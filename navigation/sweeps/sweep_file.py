"""Sweep files: TOML that names settings of `tussock run`, fixed ones and axes. Bad ones are refused before the first run."""

import json
import math
import re
import tomllib
import typing
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from types import NoneType
from typing import Any

from tussock.render.compound import SUFFIXES
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.params import is_generated

from ..experiment import Experiment
from ..experiment_fields import MODEL_SUFFIX
from ..experiment_keys import WALK_SETTINGS
from ..experiment_settings import TYPES, experiment_of
from ..models.files import TrainedModel
from ..setting_names import message_of
from .spec import Sweep, combinations

MAX_RUNS = 1_000_000
ALWAYS = {"threads": 1}  # where a sweep file does not say otherwise: runs share the cores
Choice = dict[str, Any]  # settings that go together
Place = tuple[str, str, Choice]  # of settings in the file: the table, the key, and what it sets


def read_sweep(path: Path) -> Sweep:
    """The sweep that a TOML file asks for; file names in it are relative to its folder.

    Raises:
        InputError: Naming the line, for what cannot be run.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FileError(f"{path} is not a text in UTF-8; give a sweep file (docs/sweeps.md)") from error
    return _Reader(path, text).sweep()


class _Reader:
    """Turns a sweep file into a `Sweep`; knows where in the file everything stands."""

    def __init__(self, path: Path, text: str):
        self.path, self.lines = path, text.splitlines()
        self.models: dict[Path, TrainedModel] = {}  # each file of a model is read once
        try:
            self.document = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise FileError(f"{path} is not TOML: {error}") from error

    def sweep(self) -> Sweep:
        """The sweep, every run of it checked."""
        for key, value in self.document.items():
            if key not in ("title", "fixed", "axes"):
                raise self.error("", key, f"unknown {key!r}; a sweep has title, [fixed] and [axes]")
            if not isinstance(value, str if key == "title" else dict):
                raise self.error("", key, f"{key} is {'a text' if key == 'title' else f'a table, [{key}]'}")
        if not self.document.get("axes"):
            raise FileError(f"{self.path} has no [axes]; name what is to vary, for example offset-m = [-0.1, 0.0, 0.1]")
        fixed = self.settings("fixed", self.document.get("fixed", {}))
        axes: dict[str, list[Choice]] = {}
        for name, values in self.document["axes"].items():
            if name.replace("-", "_") in axes:
                raise self.error("axes", name, f"{name} is there twice; leave one out")
            axes[name.replace("-", "_")] = self.choices(name, values)
        self.check_names(fixed, axes)
        if (count := math.prod(map(len, axes.values()))) > MAX_RUNS:
            raise FileError(f"{self.path} asks for {count:,} runs; ask for {MAX_RUNS:,} at most")
        title = self.document.get("title", self.path.stem)
        return Sweep(title, axes, list(self.experiments(fixed, axes)))

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

    def experiments(self, fixed: Choice, axes: dict[str, list[Choice]]) -> Iterator[Experiment]:
        """The experiment of every combination."""
        set_always: list[Place] = [("fixed", key, {key: value}) for key, value in fixed.items()]

        def make(choices: Sequence[Choice]) -> Experiment:
            places = set_always + [("axes", name, choice) for name, choice in zip(axes, choices, strict=True)]
            try:
                return self.experiment(places)
            except InputError as error:
                text = message_of(error, {key for _, _, choice in places for key in choice})
                place = self.responsible(places, str(error))
                if place is None:
                    given = ", ".join(f"{key} {value}" for each in choices for key, value in each.items())
                    raise SettingError(f"{self.path}, {given}: {text}") from error
                table, name, choice = place
                raise self.error(table, name, text, *choice.values()) from error

        return combinations(list(axes.values()), make, lambda name: name in WALK_SETTINGS)

    def experiment(self, places: list[Place]) -> Experiment:
        """The experiment of settings that stand in several places."""
        merged = dict(ALWAYS)
        for _, _, choice in places:
            merged |= choice
        experiment = experiment_of(merged, self.models)
        experiment.check_reading()  # otherwise first when the world is opened, by which time others have run
        return experiment

    def responsible(self, places: list[Place], message: str) -> Place | None:
        """The place without which an error goes away; the last of several."""
        for place in reversed(places):
            try:
                self.experiment([each for each in places if each is not place])
            except InputError as error:
                if str(error) == message:
                    continue
            return place
        return None

    def choices(self, name: str, values: Any) -> list[Choice]:
        """The choices of an axis: a list of values, of tables that set several settings each, or a range of numbers."""
        if isinstance(values, dict):
            values = self.numbers(name, values)
        if not isinstance(values, list) or not values:
            raise self.error(
                "axes", name, f"{name} is a list with at least one value, or a range: {{ from = 0, to = 19 }}"
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
        count = given.get("count", math.floor(steps + 1e-9) + 1 if 0 <= steps <= MAX_RUNS else 0)
        finite = isinstance(count, int) and 1 <= count <= MAX_RUNS and 0 <= high - low < math.inf
        if not (finite and (count > 1 or low == high)):
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
            if name not in TYPES:
                near = get_close_matches(name, TYPES, 1)
                hint = f"did you mean {near[0].replace('_', '-')}?" if near else "see tussock run --help"
                raise self.error(table, line, f"{key!r} is not a setting of a run; {hint}")
            kinds = typing.get_args(TYPES[name]) or (TYPES[name],)
            if not _fits(value, kinds):
                raise self.error(table, line, f"{key} is {value!r}; give {_describe(kinds)}", value)
            if name in chosen:
                raise self.error(table, line, f"{key} is set twice")
            chosen[name] = self.value(name, value, kinds)
        return chosen

    def value(self, name: str, value: Any, kinds: tuple[type, ...]) -> Any:
        """A value as the flag has it; file names as they are from everywhere."""
        if name == "world" and Path(value).suffix and not is_generated(value):
            return str((self.path.parent / value).resolve())
        if name == "model" and value.endswith(MODEL_SUFFIX):
            return str((self.path.parent / value).resolve())
        if name == "eye" and Path(value).suffix.lower() not in SUFFIXES:
            return value
        if name in ("mask", "eye") and ":" not in value:  # otherwise its pixels or its ommatidia
            return str((self.path.parent / value).resolve())
        if Path in kinds:
            return (self.path.parent / value).resolve()
        return float(value) if float in kinds else value

    def error(self, table: str, key: str, message: str, *values: Any) -> SettingError:
        """Bad input, with the line where it stands: that of the key, or of one of the values below it."""
        line = self.line_of(table, key)
        for value in values:
            text = json.dumps(value, default=str)
            here = [n for n in range(line, len(self.lines) + 1) if text in self.lines[n - 1]]
            line = here[0] if here else line
        return SettingError(f"{self.path}, line {line}: {message}")

    def line_of(self, table: str, key: str) -> int:
        """Number of the line where a key of a table stands; that of the table, or 1, where it is not found."""
        within, found = "", 1
        pattern = re.sub(r"\\?[-_]", "[-_]", re.escape(key))  # as a flag or as a column
        for number, line in enumerate(self.lines, 1):
            header = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", line)
            if header:
                within = header.group(1)
                found = number if within.split(".")[0] in (table or key) else found
                if within in (key, f"{table}.{key}"):
                    return number
            elif within == table and re.match(rf"""\s*["']?{pattern}["']?\s*=""", line):
                return number
        return found


def _fits(value: Any, kinds: tuple[type, ...]) -> bool:
    """Whether a TOML value is of one of the types; a whole number is a number."""
    if isinstance(value, bool):
        return bool in kinds
    if isinstance(value, int):
        return _is_number(value) and (int in kinds or float in kinds)
    return (isinstance(value, float) and float in kinds) or (isinstance(value, str) and (str in kinds or Path in kinds))


def _describe(kinds: tuple[type, ...]) -> str:
    names = {str: "a text", int: "a whole number", float: "a number", bool: "true or false", Path: "a file name"}
    return " or ".join(names[kind] for kind in kinds if kind is not NoneType)


def _is_number(value: Any) -> bool:
    """Whether it is a finite number, a whole one of 64 bits at most."""
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, int) and not isinstance(value, bool) and -(2**63) <= value < 2**63
