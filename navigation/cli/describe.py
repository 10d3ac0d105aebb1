"""The command that describes a world in numbers. Heavy packages are imported where they are used."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from tussock.world.errors import SettingError

from .images import check_figure, save
from .options import WORLD, MeshOptions
from .terminal import progress
from .worlds import world_of

MAX_PLACES = 10_000


@dataclass
class DescribeCommand(MeshOptions):
    """Measure what a world looks like from the ground: skyline, contrast, distances, image differences, places that look alike."""

    world: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="WORLD", help=WORLD)] = "tussock-field"
    ground: Annotated[str, tyro.conf.arg(metavar="flat|mesh")] = "flat"
    """flat: the eye is above z = 0, or on generated hills. mesh: above the ground of the world's mesh, as of a scan (docs/your-data.md)."""
    max_slope_deg: float = 45.0
    """Steepest ground of a mesh that can be stood on."""
    seed: int = 0
    """Seed of a generated world, and of the places."""
    places: int = 50
    """Random positions at which it is measured."""
    eye_height_m: float = 0.01
    """Height of the eye above the ground."""
    out: Path = Path("describe.png")
    """Figure to write (.png or .svg)."""

    def run(self) -> dict[str, Any]:
        from ..measures.description import MEASURES, describe, sampled_poses
        from ..measures.figures import description_figure

        if not 3 <= self.places <= MAX_PLACES:
            raise SettingError(f"--places {self.places}: give 3 to {MAX_PLACES:,}")
        if not (math.isfinite(self.eye_height_m) and self.eye_height_m > 0):
            raise SettingError(f"--eye-height-m {self.eye_height_m:g}: give metres over 0")
        check_figure(self.out)
        world = world_of(self)
        poses = sampled_poses(world, self.places, self.seed)
        with progress("describing", "places") as report:
            found = describe(world, poses, z=self.eye_height_m, progress=report)
        save(description_figure(found), self.out)
        slopes = {f"{name}_spectrum": {"slope": slope} for name, slope in found.slopes().items()}
        return {
            "world": self.world,
            "n_places": len(poses),
            "measures": {name: {"what": MEASURES[name], **row} for name, row in found.table().items()},
            **slopes,
            "figure": str(self.out),
        }
