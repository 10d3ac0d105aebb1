"""A published experiment: the runs it asks for, what was published, and how its numbers come from the runs."""

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.errors import InputError

from ...reports.findings import Findings
from ...sweeps.spec import Choice, Sweep


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A setting of the original, as published, and what it is here; the same words where it is the same."""

    name: str
    published: str
    here: str


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """A table or figure of the report.

    name: of files and anchors. table: of the findings. draw: makes a figure of that table; None shows its rows.
    """

    name: str
    title: str
    caption: str
    table: str
    draw: Callable[[pd.DataFrame], Any] | None = None


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """An experiment that others published, to be done again.

    name: as the command line has it. paper: in full. question: in a sentence. settings: of all runs. axes: what varies beside the
    world and route. world, worlds: the generated worlds that it takes where none is given, a route each. quick_worlds, quick_axes: a
    first look. parameters: published ones beside ours. differences: from the original, in sentences. of_walk: numbers of a walk, from
    its row and its steps, added to its row. measures: what all walks together say; exhibits: of that.
    """

    name: str
    title: str
    paper: str
    question: str
    settings: Choice
    axes: dict[str, list[Choice]]
    worlds: int
    quick_worlds: int
    quick_axes: dict[str, list[Choice]]
    parameters: tuple[Parameter, ...]
    differences: tuple[str, ...]
    measures: Callable[[pd.DataFrame], Findings]
    exhibits: tuple[Exhibit, ...]
    of_walk: Callable[[dict[str, Any], pd.DataFrame], dict[str, float]] = field(default=lambda row, steps: {})
    world: str = "tussock-field"

    def sweep(self, places: "list[Choice]", *, quick: bool = False) -> Sweep:
        """The runs: each choice of the axes at each place. quick: fewer choices, where the protocol says which."""
        axes = self.axes | (self.quick_axes if quick else {})
        return Sweep(title=self.title, fixed=self.settings, axes={"place": places} | axes)


def places(world: str, routes: list[Path], *, seed: int = 0, count: int = 1) -> list[Choice]:
    """Worlds with a route each: given routes through one world, or `count` generated ones, of the seeds from `seed` on."""
    if Path(world).is_file():
        world = str(Path(world).resolve())  # found from everywhere
    if routes:
        found = [route.resolve() if route.is_file() else route for route in routes]
        return [{"world": world, "world_seed": seed, "route": route} for route in found]
    return [{"world": world, "world_seed": each, "route_seed": each} for each in range(seed, seed + count)]


def place_names(rows: Collection[dict[str, Any]]) -> list[str]:
    """What a report calls the place of each run: the name of the route's file, in full where several have it."""
    routes = [row["route"] for row in rows]
    stems = Counter(Path(route).stem for route in {each for each in routes if each})
    short = {route: Path(route).stem if stems[Path(route).stem] == 1 else route for route in routes if route}
    return [short[route] if route else f"route {row['route_seed']}" for route, row in zip(routes, rows, strict=True)]


def by_model(walks: pd.DataFrame) -> list[str]:
    """The models of a table of walks, in the order in which they stand in it."""
    return list(dict.fromkeys(walks["model"]))


def check_walked(walks: pd.DataFrame, models: list[str]) -> None:
    """Refuse to judge a protocol of which a model did not walk at all. Raises InputError."""
    for model in models:
        if model not in set(walks["model"]):
            raise InputError(f"no walk with {model} could be made; the table of runs says why")
