"""The commands that re-run the thesis. Heavy packages are imported where they are used."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.world.errors import SettingError

from ..settings_table import degrees
from ..training_setup import ROUTE_SPACING
from .options import RouteOptions, flags_of
from .terminal import message, progress_of_parts

if TYPE_CHECKING:
    from ..studies.thesis.items import Item
    from ..studies.thesis.study_data import StudyData


@dataclass
class StudyOptions(RouteOptions):
    """What a study looks at: a world and a route through it, or image databases of both."""

    grid_database: Path | None = None
    """Take the grid's views from this image database (see tussock database) instead of drawing them; needs --route-database."""
    route_database: Path | None = None
    """Take the route's views from this one."""
    spacing_m: float = ROUTE_SPACING
    """Distance between route views."""
    seeds: int | None = None
    """Repeat for this number of seeds, from --seed on. Default: 3 different worlds or routes where they are generated; else 1, as each
    network is trained from three random starts anyway."""
    quick: bool = False
    """A first look: one seed and one start of each network, shorter training, small grid searches, fewer pixels."""
    out: Path = Path("replication")
    """Folder for the report; studies that were finished there are not done again."""
    overwrite: bool = False
    """Replace the report of something else in the folder."""

    def replicate(self, names: tuple[str, ...], title: str, only: str | None = None) -> dict[str, Any]:
        """Do studies for all seeds and write the report. only: the one figure or table to make."""
        from ..reports.report import REPORT, RESULTS, check_report_folder
        from ..studies.thesis.report import items_of, write_thesis_report

        self.check()
        about = self.about(names) | ({} if only is None else {"Figure": only})
        items_of(names, only)
        check_report_folder(self.out, about, overwrite=self.overwrite)
        runs, data = self.runs(names)
        outcomes = write_thesis_report(
            self.out, runs, data, about=about, command=self.command, title=title, only=only, quick=self.quick
        )
        claims = [each for outcomes_of_study in outcomes.values() for each in outcomes_of_study]
        return {
            "report": str(self.out / REPORT),
            "results": str(self.out / RESULTS),
            "claims": {each.claim.key: {"figure": each.claim.figure, "holds": each.label} for each in claims},
        }

    def runs(self, names: tuple[str, ...]) -> tuple[dict[int, dict[str, Any]], "StudyData"]:
        """The results of studies for each seed, and the views of the first seed."""
        from ..studies.thesis.parameters import StudySettings
        from ..studies.thesis.studies import run_studies

        first, *others = seeds = self.all_seeds()
        data = first_data = self.data(first)
        runs = {}
        for seed in seeds:
            if seed in others and self.generates():
                data = self.data(seed)
            if others:
                message(f"seed {seed} of {first} to {seeds[-1]}")
            settings = StudySettings(seed=seed, quick=self.quick)
            with progress_of_parts() as report:
                results = run_studies(data, settings, self.out / "findings", names, report)
            runs[seed] = {name: results[name] for name in names}
        return runs, first_data

    def check(self) -> None:
        """Refuse flags that contradict each other. Raises SettingError."""
        if (self.grid_database is None) != (self.route_database is None):
            raise SettingError("--grid-database and --route-database go together; give both, or neither")
        if self.seeds is not None and self.seeds < 1:
            raise SettingError(f"--seeds {self.seeds}: give at least 1")

    def generates(self) -> bool:
        """Whether another seed means another world or route."""
        from tussock.world.params import is_generated

        return self.grid_database is None and (is_generated(self.world) or self.route is None)

    def all_seeds(self) -> range:
        """The seeds to repeat for."""
        count = self.seeds or (3 if self.generates() and not self.quick else 1)
        return range(self.seed, self.seed + count)

    def data(self, seed: int) -> "StudyData":
        """The views to study."""
        from ..studies.thesis.study_data import data_of_databases, data_of_world

        if self.grid_database is not None and self.route_database is not None:
            return data_of_databases(self.grid_database, self.route_database, self.headings)
        surroundings = dataclasses.replace(self, seed=seed).surroundings()
        world, route = surroundings.open_world_and_route()
        return data_of_world(world, route, surroundings.eye, spacing=self.spacing_m, backend=self.renderer)

    def settings(self) -> dict[str, Any]:
        """The settings that the flags give. A first look takes half as many columns and rows."""
        size = "360x75" if self.quick and self.size is None else self.size
        return super().settings() | {"size": size}

    def about(self, names: tuple[str, ...]) -> dict[str, Any]:
        """What is studied, for the head of the report."""
        first, last = self.all_seeds()[0], self.all_seeds()[-1]
        seeds = str(first) if last == first else f"{first} to {last}; figures and tables are of the first"
        depth = {"Depth": "a first look (--quick)"} if self.quick else {}
        return self.about_views() | {"Studies": ", ".join(names), "Seeds": seeds} | depth

    def about_views(self) -> dict[str, str]:
        """Where the views come from, for the head of the report."""
        from tussock.world.params import is_generated

        if self.grid_database is not None:
            return {"Grid views": str(self.grid_database), "Route views": str(self.route_database)}
        eye = self.surroundings().eye
        rays = f", {self.samples} x {self.samples} rays a pixel" if self.samples else ""
        return {
            "World": f"{self.world}, generated" if is_generated(self.world) else self.world,
            "Route": "generated" if self.route is None else str(self.route),
            "Views": f"{eye.width} x {eye.height} pixels, one every {100 * self.spacing_m:g} cm of the route",
            "Eye": f"{eye.z:g} m high, from {degrees(eye.bottom):g} to {degrees(eye.top):g} degrees{rays}",
        }

    def command(self, item: "Item") -> str:
        """The command line that makes one figure or table of the report alone."""
        given = flags_of(self, StudyOptions, leave_out=("out", "overwrite", "json"))
        return " ".join(
            filter(None, [f"tussock study {item.study} --figure '{item.number}'", given, f"--out {item.name}"])
        )


@dataclass
class ThesisCommand(StudyOptions):
    """Re-run the whole study that this project comes from, figure by figure, and write a report to read next to it."""

    out: Path = Path("thesis")
    """Folder for the report; studies that were finished there are not done again."""

    def run(self) -> dict[str, Any]:
        from ..studies.thesis.studies import STUDIES

        return self.replicate(tuple(STUDIES), "The thesis, figure by figure")


@dataclass
class StudyCommand(StudyOptions):
    """Re-run one study of the thesis."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")] = tyro.MISSING
    """setting, visual-compass, frequency, resolution, classifier, corners, confidence or beyond."""
    figure: str | None = None
    """Make this figure or table alone, by its number."""
    out: Path = Path("study")
    """Folder for the report; studies that were finished there are not done again."""

    def run(self) -> dict[str, Any]:
        from ..studies.thesis.studies import STUDIES

        if self.name not in STUDIES:
            raise SettingError(f"unknown study {self.name!r}; give one of {', '.join(STUDIES)}")
        return self.replicate((self.name,), STUDIES[self.name].title, self.figure)
