"""The commands that look at images and at where they lead: ridf, catchment, place. Heavy packages are imported where they are used."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.world.errors import FileError, SettingError

from .options import LearningOptions, ModelOptions, SourceOptions
from .terminal import message, progress
from .worlds import numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tussock.world.geometry import Pose, Route

AT = "Pose of the reference view (m, degrees counter-clockwise from +x). Default: the views of the route."
At = Annotated[str | None, tyro.conf.arg(metavar="X,Y,HEADING_DEG", help=AT)]


@dataclass
class RidfCommand(SourceOptions):
    """Measure how the image difference grows as the eye turns, and as it moves away: depth and width of its minimum."""

    at: At = None
    apart_m: float = 0.5
    """Without --at, route views at least this far apart are the references."""
    displacements_m: str = "0,0.05,0.1,0.2,0.4"
    """Views this far to the left and right of a reference are turned, and compared with it."""
    reach_m: float = 0.5
    """Views up to this far ahead, behind, to the left and right are compared at the heading of the reference."""
    out: Path = Path("ridf.png")
    """Figure to write (.png or .svg)."""

    def run(self) -> dict[str, Any]:
        import numpy as np

        from ..measures.figures import difference_figure
        from ..measures.image_difference import rotational, spread, translational

        check_figure(self.out)
        sides = distances(self.displacements_m, "--displacements-m")
        check_distance(self.apart_m, "--apart-m")
        check_distance(self.reach_m, "--reach-m")
        experiment = self.experiment()
        world = experiment.open_world()
        route = None if self.at else experiment.open_route(world)
        with experiment.open_renderer(world) as renderer:
            message(f"renderer: {renderer.backend}")
            references = np.array([seen_at(self.at, renderer)]) if route is None else spread(route, self.apart_m)
            rotations = rotational(renderer, experiment.encoding, references, sides)
            translations = translational(renderer, experiment.encoding, references, self.reach_m)
        save(difference_figure(rotations, translations), self.out)
        return {
            "encoding": str(experiment.encoding),
            "n_references": len(references),
            "rotational": {f"{each.displacement:g} m": rotational_row(each) for each in rotations},
            "translational": {
                name: {
                    "minimum": each.valley.minimum,
                    "depth": each.valley.depth,
                    "width_m": each.valley.width,
                }
                for name, each in translations.items()
            },
            "figure": str(self.out),
        }


def rotational_row(found: Any) -> dict[str, Any]:
    """What the command reports of one displacement: means over the references; the width is of those that have one."""
    import numpy as np

    widths = [each.width for each in found.valleys if each.width is not None]
    return {
        "distance_m": found.distance,
        "minimum": float(np.mean([each.minimum for each in found.valleys])),
        "depth": float(np.mean([each.depth for each in found.valleys])),
        "width_deg": math.degrees(float(np.mean(widths))) if widths else None,
        "median_error_deg": float(np.median(np.abs(np.degrees(found.errors)))),
    }


@dataclass
class CatchmentCommand(ModelOptions):
    """Map from where the image difference leads to a view or a route, and where a model recovers its heading."""

    at: At = None
    grid_m: float = 0.1
    """In a world, positions are the multiples of this in x and y; of an image database, those of its views .."""
    within_m: float = 0.5
    """.. within this distance of the reference."""
    heading: Annotated[str, tyro.conf.arg(metavar="best|reference")] = "best"
    """Compare views at the rotation that fits best, or at the heading of the reference."""
    out: Path = Path("catchment.png")
    """Figure to write (.png or .svg)."""

    def run(self) -> dict[str, Any]:
        from ..measures.catchment import catchment, landscape, positions_around
        from ..measures.figures import catchment_figure
        from ..tested_poses import route_views_of

        check_figure(self.out)
        check_distance(self.within_m, "--within-m")
        check_distance(self.grid_m, "--grid-m")
        if self.heading not in ("best", "reference"):
            raise SettingError(f"--heading {self.heading!r}: give best or reference")
        experiment = self.experiment()
        world = experiment.open_world()
        route = None if self.at else experiment.open_route(world)
        if experiment.route_database is not None and experiment.grid_database is None:
            raise SettingError("a catchment needs views around the route; give --grid-database")
        with experiment.open_renderer(world) as renderer:
            message(f"renderer: {renderer.backend}")
            references = seen_at(self.at, renderer) if route is None else route_views_of(experiment, route)
            poses, spacing = positions_around(renderer, references, grid=self.grid_m, within=self.within_m)
            model = self.learned(experiment, renderer, references)
            with progress("comparing", "views") as report:
                ground = landscape(
                    renderer,
                    experiment.encoding,
                    model,
                    references,
                    poses,
                    spacing,
                    best=self.heading == "best",
                    progress=report,
                )
        found = catchment(ground)
        save(catchment_figure(ground, found, references, None if experiment.route_database else world), self.out)
        return (
            {"model": str(model), "encoding": str(experiment.encoding)}
            | numbers_of(ground, found)
            | {"figure": str(self.out)}
        )

    def learned(self, experiment: Any, renderer: Any, references: "Route | Pose") -> Any:
        """The model that has learned the reference."""
        import numpy as np

        from tussock.world.geometry import Pose

        if not isinstance(references, Pose):
            return experiment.train(renderer, experiment.open_route(renderer.world)).model.model
        model = experiment.make_model()
        model.fit(experiment.encoding.for_eye(experiment.eye).at(renderer, np.array([references])))
        return model


def numbers_of(ground: Any, found: Any) -> dict[str, Any]:
    """What the command reports of a catchment."""
    import numpy as np

    from tussock.world.geometry import wrap_angle

    away = ~ground.home
    descent = np.abs(np.degrees(wrap_angle(found.downhill - ground.homeward)))[
        away
    ]  # nan, and so not within, in a local minimum
    errors = np.degrees(ground.errors)
    share = {
        f"{name}_within_{limit}": float((values <= limit).mean()) if len(values) else None
        for name, values in (("descent", descent), ("heading", errors))
        for limit in (45, 90)
    }
    area = {f"heading_area_{limit}_m2": float((errors <= limit).sum() * ground.cell) for limit in (45, 90)}
    return {
        "n_positions": len(errors),
        "spacing_m": ground.spacing,
        "area_m2": found.area,
        "volume": found.volume,
        "reach_m": found.reach,
        **share,
        **area,
    }


@dataclass
class PlaceCommand(LearningOptions):
    """Recognise where views near a route were taken: recall@N, and the area under the precision-recall curve."""

    grid_m: float | None = None
    """Queries are at the multiples of this in x and y (default: 0.2), or those of --grid-database .."""
    within_m: float = 0.2
    """.. within this distance of the route."""
    tolerance_m: float = 0.25
    """A match is correct within this distance of the query."""
    aligned: bool = False
    """Compare views at one compass heading, instead of at the rotation that fits best."""
    out: Path = Path("place.png")
    """Figure to write (.png or .svg)."""

    def run(self) -> dict[str, Any]:
        import numpy as np

        from ..measures.figures import place_figure
        from ..measures.image_difference import differences_of_places
        from ..measures.place_recognition import recognise
        from ..tested_poses import poses_to_test

        check_figure(self.out)
        experiment = self.experiment()
        world, route = experiment.open_world_and_route()
        queries = poses_to_test(experiment, world, route, grid=self.grid_m, within=self.within_m)
        with experiment.open_renderer(world) as renderer:
            message(f"renderer: {renderer.backend}")
            wanted = experiment.training_poses(world, route)
            with progress("comparing", "views") as report:
                difference, references = differences_of_places(
                    experiment.encoding, renderer, queries, wanted, aligned=self.aligned, progress=report
                )
        found = recognise(difference, queries[:, :2], references[:, :2], self.tolerance_m)
        save(place_figure(found, self.tolerance_m), self.out)
        return {
            "encoding": str(experiment.encoding),
            "n_queries": len(queries),
            "n_references": len(references),
            "n_recognisable": int(found.recognisable.sum()),
            "precision_recall_area": found.area,
            **{f"recall_at_{n}": value for n, value in found.recall_at.items()},
            "median_distance_m": float(np.median(found.distance)),
            "figure": str(self.out),
        }


def seen_at(text: str | None, renderer: Any) -> "Pose":
    """The pose of --at; of an image database, that of the view which is nearest to it. Raises SettingError."""
    import numpy as np

    from tussock.world.geometry import Pose

    from ..measures.image_difference import viewpoints

    x, y, heading_deg = numbers(text or "", "--at", "X,Y,HEADING_DEG", "5,5,90")
    if not (all(map(math.isfinite, (x, y, heading_deg))) and renderer.world.field.contains(x, y)):
        raise SettingError(f"--at {text}: that is outside the world ({renderer.world.field}); choose a position inside")
    seen, usable = viewpoints(renderer, np.array([[x, y, math.radians(heading_deg)]]))
    if not usable.all():
        raise SettingError(f"--at {text}: the image database has no view near there; choose another position")
    return Pose(*seen[0].tolist())


def distances(text: str, flag: str) -> list[float]:
    """Distances from 0 (m), separated by commas. Raises SettingError."""
    found = numbers(text, flag, ",".join("D" * (text.count(",") + 1)), "0,0.1,0.2")
    if not all(math.isfinite(each) and each >= 0 for each in found):
        raise SettingError(f"{flag} {text}: give distances from 0, for example 0,0.1,0.2")
    return list(dict.fromkeys(found))


def check_distance(value: float, flag: str) -> None:
    """Refuse a distance that is not over 0. Raises SettingError."""
    if not (math.isfinite(value) and value > 0):
        raise SettingError(f"{flag} {value:g}: give a distance over 0")


def check_figure(path: Path) -> None:
    """Refuse a figure that could not be written after the work. Raises FileError."""
    from tussock.world.atomic import check_writable

    if path.suffix.lower() not in (".png", ".svg"):
        raise FileError(f"{path}: a figure is written as .png or .svg")
    check_writable(path)


def save(figure: "Figure", path: Path) -> None:
    """Write a figure."""
    import matplotlib

    from ..reports.drawing import STYLE, save_picture

    with matplotlib.rc_context(STYLE):
        save_picture(figure, path)
