"""The commands that re-run published studies. Heavy packages are imported where they are used."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.world.errors import InputError

from ..training_setup import ROUTE_SPACING
from .options import PathOptions, flags_of
from .terminal import message as say
from .terminal import progress_of_parts

if TYPE_CHECKING:
    from ..studies.thesis.material import Material


@dataclass
class StudyOptions(PathOptions):
    """What a study looks at: a world and a route through it, or image databases of both."""

    grid_database: Path | None = None
    """Take the grid's views from this image database (see tussock database) instead of drawing them; needs --route-database."""
    route_database: Path | None = None
    """Take the route's views from this one."""
    spacing_m: float = ROUTE_SPACING
    """Distance between route views."""
    seeds: int | None = None
    """Repeat for so many seeds from --seed on. Default: 3 where world or route are generated, so 3 of them; else 1, as each network is
    started from three seeds anyway."""
    quick: bool = False
    """A first look: one seed and one start of each network, shorter training, small grid searches, fewer pixels."""
    out: Path = Path("replication")
    """Folder for the report; studies that were finished there are not done again."""
    overwrite: bool = False
    """Replace the report of something else that the folder holds."""
    json: bool = False
    """Print one JSON object instead of text."""

    def replicate(self, names: tuple[str, ...], title: str, only: str | None = None) -> dict[str, Any]:
        """Do studies for all seeds and write the report."""
        from ..studies.thesis.report import check_report_folder, exhibits_of, verdicts, write_report
        from ..studies.thesis.settings import Settings
        from ..studies.thesis.thesis import run_studies

        self.check()
        about = self.about(names) | ({} if only is None else {"Figure": only})
        exhibits_of(names, only)
        check_report_folder(self.out, about, overwrite=self.overwrite)
        runs, first = {}, None
        material = None
        for seed in self.all_seeds():
            if material is None or self.grows():
                material = self.material(seed)
            first = first or material
            settings = Settings(seed=seed, quick=self.quick)
            if len(self.all_seeds()) > 1:
                say(f"seed {seed} of {self.all_seeds()[0]} to {self.all_seeds()[-1]}")
            with progress_of_parts() as report:
                runs[seed] = run_studies(material, settings, self.out / "findings", names, report)
        assert first is not None
        runs = {seed: {name: run[name] for name in names} for seed, run in runs.items()}
        write_report(self.out, runs, first, about=about, command=self.command(), title=title, only=only)
        judged = verdicts(runs)
        return {
            "report": str(self.out / "report.html"), "results": str(self.out / "results.json"),
            "claims": {verdict.claim.key: {"figure": verdict.claim.figure, "holds": verdict.words} for verdict in judged},
        }  # fmt: skip

    def check(self) -> None:
        """Refuse flags that do not go together. Raises InputError."""
        if (self.grid_database is None) != (self.route_database is None):
            raise InputError("--grid-database and --route-database go together; give both, or neither")
        if self.seeds is not None and self.seeds < 1:
            raise InputError(f"--seeds {self.seeds}: give at least 1")

    def grows(self) -> bool:
        """Whether another seed is another world or route."""
        from tussock.world.params import is_generated

        return self.grid_database is None and (is_generated(self.world) or self.route is None)

    def all_seeds(self) -> range:
        """The seeds to repeat for."""
        count = self.seeds or (3 if self.grows() and not self.quick else 1)
        return range(self.seed, self.seed + count)

    def material(self, seed: int) -> "Material":
        """The views to study."""
        from ..studies.thesis.material import material_of_databases, material_of_world

        if self.grid_database is not None and self.route_database is not None:
            return material_of_databases(self.grid_database, self.route_database)
        world, route = dataclasses.replace(self, seed=seed).open_route()
        return material_of_world(world, route, self.eye(), backend=self.renderer, spacing=self.spacing_m)

    def width_and_height(self) -> tuple[int, int]:
        """Columns and rows of a panorama; a first look takes half as many."""
        return (360, 75) if self.quick and self.size is None else super().width_and_height()

    def about(self, names: tuple[str, ...]) -> dict[str, Any]:
        """What is studied, in words."""
        from tussock.world.params import is_generated

        if self.grid_database is not None:
            seen = {"Grid views": str(self.grid_database), "Route views": str(self.route_database)}
        else:
            width, height = self.width_and_height()
            world = f"{self.world}, generated" if is_generated(self.world) else self.world
            seen = {
                "World": world, "Route": "generated" if self.route is None else str(self.route),
                "Views": f"{width} x {height} pixels, one every {100 * self.spacing_m:g} cm of the route",
                "Eye": f"{self.eye_height_m:g} m high, from {self.bottom_deg:g} to {self.top_deg:g} degrees"
                + (f", {self.samples} x {self.samples} rays a pixel" if self.samples else ""),
            }  # fmt: skip
        first, last = self.all_seeds()[0], self.all_seeds()[-1]
        seeds = str(first) if last == first else f"{first} to {last}; figures and tables are of the first"
        return (
            seen
            | {"Studies": ", ".join(names), "Seeds": seeds}
            | ({"Depth": "a first look (--quick)"} if self.quick else {})
        )

    def command(self) -> str:
        """How one figure of the report is made alone; {study} and {figure} are to be filled in."""
        given = (
            flags_of(self, StudyOptions, leave_out=("out", "overwrite", "json")).replace("{", "{{").replace("}", "}}")
        )
        return f"tussock study {{study}} --figure {{figure}}{' ' * bool(given)}{given} --out {{name}}"


@dataclass
class ThesisCommand(StudyOptions):
    """Re-run the whole study that this project grew from, figure by figure, and write a report to read beside it."""

    out: Path = Path("thesis")
    """Folder for the report; studies that were finished there are not done again."""

    def run(self) -> dict[str, Any]:
        from ..studies.thesis.thesis import STUDIES

        return self.replicate(tuple(STUDIES), "The thesis, figure by figure")


@dataclass
class StudyCommand(StudyOptions):
    """Re-run one study of the thesis."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")] = tyro.MISSING
    """setting, visual-compass, frequency, resolution, classifier, corners, confidence or beyond."""
    figure: str | None = None
    """Make this figure or table alone, called by its number."""
    out: Path = Path("study")
    """Folder for the report; studies that were finished there are not done again."""

    def run(self) -> dict[str, Any]:
        from ..studies.thesis.thesis import STUDIES

        if self.name not in STUDIES:
            raise InputError(f"unknown study {self.name!r}; give one of {', '.join(STUDIES)}")
        return self.replicate((self.name,), STUDIES[self.name].title, self.figure)
