"""What a published experiment is: its runs, its published parameters, and how its numbers follow from the runs."""

import logging
import math
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import pandas as pd
from matplotlib.figure import Figure

from tussock.world.errors import FileError, SettingError
from tussock.world.files import read_world, write_world
from tussock.world.geometry import Route
from tussock.world.meshes.reading import MeshReading
from tussock.world.params import is_generated
from tussock.world.progress import Progress
from tussock.world.route_files import write_route
from tussock.world.route_points import TEXT_SUFFIXES
from tussock.world.scene import World
from tussock.world.settings import settings, switch, whole

from ...content import content_of
from ...experiment import Experiment
from ...reports.claims import Claim
from ...reports.results import StudyResults
from ...sweeps.spec import Change, Sweep

log = logging.getLogger(__name__)

HOME = "-home"  # behind the name of a route that is walked from its end to its start
ROUTE_SUFFIXES = (".bin", ".mat", ".npy", ".npz", *filter(None, TEXT_SUFFIXES))


class Parameter(NamedTuple):
    """A parameter of the original experiment.

    Attributes:
        name: Its name in the report.
        published: Its published value, in words.
        here: Its value here; the same words where it is the same.
    """

    name: str
    published: str
    here: str


@dataclass(frozen=True)
class Item:
    """A figure or table of the report.

    Attributes:
        name: Name of its files and of its anchor in the page.
        title: Heading.
        table: Name of a table of the results.
        caption: Text below a figure or above a table.
        draw: Draws a figure of that table; without it, the item is the table.
    """

    name: str
    title: str
    table: str
    caption: str
    draw: Callable[[pd.DataFrame], Figure] | None = None


@settings
class Protocol:
    """A published experiment.

    Attributes:
        name: Its name on the command line.
        title: Title of the report.
        paper: The paper, as in a list of references.
        question: What the experiment asks, in a sentence.
        experiment: What all runs share.
        axes: What varies between runs besides the world and route, as `Sweep.over` takes it. One axis is "model".
        worlds: Number of worlds, with one route each, where none is given.
        quick_worlds: The same for a first look.
        quick_axes: Axes that have fewer choices in a first look.
        more_axes: The axes of a second set of runs, if there is one.
        parameters: Published parameters.
        differences: Differences from the original, one sentence each.
        measure: Computes the results from a table of walks, with the columns of a sweep's table and those of `of_walk`. "model" has
            the model's name without parameters, "place" the name of the route.
        claims: Claims of the paper that the results test. The figure of each is the name of an item.
        items: Figures and tables of the report.
        of_walk: Computes further columns for a walk, from its row of the table and its steps.
        columns: Columns of the steps that it needs, where only these are to be kept; see `Sweep.columns`.
        world: World preset where none is given.
        layout: Makes the route that is learned and walked of each route; None takes the route itself.
        both_ways: Each route is also learned and walked from its end to its start.
        prepare_world: Makes the world that is walked in of one from a file, as colours where the file has none.
        route_names: Names of the route files that are taken of a folder of them, without endings; all where there are none.
        as_published: A variant with the procedure of the original in every detail that is known (`--as-published`).
    """

    name: str
    title: str
    paper: str
    question: str
    experiment: Experiment
    axes: dict[str, Sequence[Any]]
    worlds: int = whole()
    quick_worlds: int = whole(1)
    quick_axes: dict[str, Sequence[Any]] = attrs.field(factory=dict)
    more_axes: dict[str, Sequence[Any]] = attrs.field(factory=dict)
    parameters: Sequence[Parameter] = ()
    differences: Sequence[str] = ()
    measure: Callable[[pd.DataFrame], StudyResults]
    claims: Sequence[Claim] = ()
    items: Sequence[Item]
    of_walk: Callable[[dict[str, Any], pd.DataFrame], dict[str, float]] = lambda row, steps: {}
    columns: Sequence[str] | None = None
    world: str = "tussock-field"
    layout: Callable[[Route], Route] | None = None
    both_ways: bool = switch(False)
    prepare_world: Callable[[World], World] | None = None
    route_names: Sequence[str] = ()
    as_published: "Protocol | None" = None

    def __attrs_post_init__(self) -> None:
        names = [item.name for item in self.items]
        if "model" not in self.axes:
            raise SettingError(f'protocol {self.name!r} has no axis "model"; give one, with at least one model')
        for claim in self.claims:
            if claim.figure not in names:
                raise SettingError(
                    f"protocol {self.name!r}: claim {claim.key!r} is shown by {claim.figure!r}; give one of its items: {', '.join(names)}"
                )

    def sweep(self, routes: list[Change], *, quick: bool = False, **changes: Any) -> Sweep:
        """The runs: one for each combination of the axes, on each route.

        Args:
            routes: Worlds with one route each; see `routes_in`.
            quick: A first look.
            changes: Of the experiment, for all runs.
        """
        base, axes = self.experiment.replace(threads=1, **changes), self.axes | (self.quick_axes if quick else {})
        sets = [Sweep.over(self.title, base, {"route": routes} | each) for each in (axes, self.more_axes) if each]
        return replace(sets[0], experiments=[run for each in sets for run in each.experiments], columns=self.columns)


def routes_in(world: str, routes: list[Path], *, seed: int = 0, count: int = 1) -> list[Change]:
    """Worlds with one route each, as choices of an axis.

    Args:
        world: A world preset or file.
        routes: Route files, all in the world of `seed`.
        seed: First seed of the worlds and routes that are generated.
        count: Number of these, where there are no route files.

    Returns:
        The world and route of an experiment, for each route.
    """
    if not is_generated(world) and Path(world).is_file():
        world = str(Path(world).resolve())  # so that workers in other folders find it
    if routes:
        paths = [route.resolve() if route.is_file() else route for route in routes]
        return [{"world": world, "world_seed": seed, "route": path} for path in paths]
    return [{"world": world, "world_seed": each, "route_seed": each} for each in range(seed, seed + count)]


def prepared(protocol: Protocol, routes: list[Change], folder: Path) -> list[Change]:
    """Worlds and routes as the protocol prepares and lays them out, in files; otherwise as they are.

    Args:
        protocol: The experiment.
        routes: Worlds with one route each; see `routes_in`.
        folder: For the files. Those of the same names are replaced.
    """
    return _laid_out(protocol, _in_prepared_world(protocol, routes, folder), folder / "routes")


def _in_prepared_world(protocol: Protocol, routes: list[Change], folder: Path) -> list[Change]:
    given = routes[0]["world"]  # all have the same, where it is a file
    if protocol.prepare_world is None or is_generated(given):
        return routes
    world = read_world(given, routes[0].get("reading", MeshReading()))
    if (changed := protocol.prepare_world(world)) is world:
        return routes
    path = folder / f"world-{content_of(changed)[:8]}.glb"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_world(changed, path)
    return [{**each, "world": str(path.resolve()), "reading": MeshReading()} for each in routes]


def _laid_out(protocol: Protocol, routes: list[Change], folder: Path) -> list[Change]:
    if protocol.layout is None and not protocol.both_ways:
        return routes
    folder.mkdir(parents=True, exist_ok=True)
    changed = []
    for number, each in enumerate(routes, 1):
        _, route = protocol.experiment.replace(**each).open_world_and_route()
        name = Path(each["route"]).stem if "route" in each else f"seed{each['route_seed']}"
        ways = {name: route if protocol.layout is None else protocol.layout(route)}
        if protocol.both_ways:
            ways[name + HOME] = back(ways[name])
        for label, way in ways.items():
            write_route(way, path := folder / f"{number:02}-{label}.csv")
            changed.append({**each, "route": path.resolve()})
    return changed


def back(route: Route) -> Route:
    """The way from a route's end to its start, facing back."""
    poses = route.poses[::-1].copy()
    poses[:, 2] += math.pi
    return Route(poses)


def route_names(rows: Collection[dict[str, Any]]) -> list[str]:
    """The name of each run's route in a report: its file's name, with the folder where several files have the same name."""
    routes = {row["route"] for row in rows if row["route"]}
    stems = Counter(Path(route).stem for route in routes)
    names = {route: Path(route).stem if stems[Path(route).stem] == 1 else route for route in routes}
    return [names.get(row["route"]) or f"route {row['route_seed']}" for row in rows]


def models_in(walks: pd.DataFrame) -> list[str]:
    """The models of a table of walks, in their order in the table."""
    return list(dict.fromkeys(walks["model"]))


def check_models(walks: pd.DataFrame, models: list[str]) -> None:
    """Refuse a table of walks in which a model has none. Raises SettingError."""
    for model in models:
        if model not in set(walks["model"]):
            raise SettingError(f"no walk with {model} could be made; the column error of runs.parquet has the reasons")


@settings
class WalklessProtocol:
    """What published experiments in which nothing walks have in common.

    Attributes:
        name: Name of the command.
        title: Of the report.
        paper: Authors, year, title and journal.
        question: What the experiment asks.
        parameters: Of the original, and what they are here.
        differences: From the original, a sentence each.
        claims: What the paper claims.
        items: Figures and tables of the report.
    """

    name: str
    title: str
    paper: str
    question: str
    parameters: Sequence[Parameter] = ()
    differences: Sequence[str] = ()
    claims: Sequence[Claim] = ()
    items: Sequence[Item]


@settings
class DatabaseProtocol(WalklessProtocol):
    """A published experiment on published images.

    Attributes:
        measure: Computes the results from the folder of the images, a seed, and a function that is called with how much is done.
    """

    measure: Callable[[Path, int, Progress], StudyResults]


def route_files(given: list[Path], names: Sequence[str] = (), world: Path | None = None) -> list[Path]:
    """The route files of some paths, each of which is a file or a folder of files.

    Args:
        given: The paths.
        names: Names of files, without endings. Of a folder that has any of these they are taken, of another folder all files.
        world: File of the world, which may be in the same folder.

    Raises:
        FileError: For a folder without any route file.
    """
    files = []
    for path in given:
        if not path.is_dir():
            files.append(path)
            continue
        inside = sorted(each for each in path.iterdir() if each.is_file() and each.suffix.lower() in ROUTE_SUFFIXES)
        inside = [each for each in inside if world is None or not each.samefile(world)]
        if not inside:
            raise FileError(
                f"the folder {path} has no route file ({', '.join(ROUTE_SUFFIXES)}); give another, or files"
            )
        published = [each for each in inside if each.stem in names]
        if names and len(published) < len(names):
            taken = published or inside
            log.warning(
                "%s has %d of the %d published routes; %s are taken",
                path,
                len(published),
                len(names),
                ", ".join(each.stem for each in taken),
            )
        files += published or inside
    return files
