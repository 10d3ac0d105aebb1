"""What a generated world is like: its parameters, the presets, and which texts name a generated world."""

from functools import lru_cache
from typing import Any, ClassVar

import attrs

from .errors import SettingError
from .geometry import Bounds
from .registry import LOCATION, Registry
from .settings import RGB, colour, number, settings, whole
from .specs import Spec

MAX_HAZE = 0.6  # share of the sky's colour in the farthest tree


@settings
class WorldParams:
    """Parameters of a generated world. Densities count plants per square metre of the field and its border.

    Colours are those of sunlit plants of medium height: light, shade and individual plants vary around them. Heights are medians.
    `describe(WorldParams)` gives the unit and range of each parameter.

    Attributes:
        field_width: Extent of the field from west to east; its south-western corner is at (0, 0).
        field_depth: Extent of the field from south to north.
        border: Plants also grow within this distance around the field.
        ground_margin: The ground continues this far around the field.
        ground_rgb: Colour of the ground.
        sky_rgb: Colour of the sky.
        patch_size: Distance between fertile and poor ground.
        patchiness: Standard deviation of the log density of plants between fertile and poor ground.
        cluster_plants: Mean number of plants in a cluster.
        cluster_radius: Standard deviation of the positions in a cluster.
        size_spread: Standard deviation of the log heights of plants.
        clearings: Number of clearings.
        clearing_radius: Median radius of a clearing.
        corridor_width: Width of the open corridors that wind through the field; 0 for none.
        tussock_density: Density of tussocks.
        tussock_height: Height of a tussock.
        tussock_blades: Number of blades of a tussock of median height.
        tussock_rgb: Colour of living blades.
        dry_rgb: Colour of dry blades.
        dry_share: Mean share of dry blades in a tussock; grass is dry in the same places.
        grass_density: Density of tufts of grass.
        grass_height: Height of a tuft.
        grass_blades: Maximum number of blades in a tuft.
        grass_near_tussocks: Share of the tufts that grow at the foot of a tussock.
        grass_rgb: Colour of grass.
        flower_share: Share of the tufts that have a flower.
        flower_rgb: Colour of flowers.
        bush_density: Density of bushes.
        bush_height: Height of a bush.
        bush_leaves: Number of leaves of a bush of median height.
        bush_rgb: Colour of the leaves of bushes.
        bark_rgb: Colour of the wood of bushes and trees.
        leaf_density: Density of fallen leaves.
        leaf_length: Length of a fallen leaf.
        leaf_rgb: Colour of fallen leaves.
        stone_density: Density of stones.
        stone_size: Largest width of a stone.
        stone_corners: Number of random points that a stone is the hull of.
        stone_rgb: Colour of stones.
        trees: Number of trees on the skyline, all around the field.
        tree_height: Height of a tree.
        tree_distance: Median distance of a tree from the edge of the field.
        tree_gaps: Share of the horizon without trees.
        tree_leaves: Number of triangles of a crown.
        tree_rgb: Colour of crowns in some directions.
        tree_other_rgb: Colour of crowns in the other directions.
        haze: Share of the sky's colour in a tree's, per metre of distance from the field.
        tree_density: Density of trees in the field itself.
        tree_forks: How often the trunks of trees fork into thinner branches, with the leaves at the last ones; 0 for crowns of
            lumps.
        herb_density: Density of herbs.
        herb_height: Height of a herb.
        herb_rgb: Colour of the leaves of herbs.
        herb_flower_rgb: Colour of the flowers of herbs.
        culm_density: Density of thin stems of grass with a seed head.
        culm_height: Height of such a stem.
        litter_density: Density of litter: leaves and dead stems that lie on the ground, so low that an insect walks over them.
        litter_length: Length of a leaf in the litter; stems are twice as long.
        litter_stems: Share of stems in the litter.
        litter_green: Share of the leaves in the litter that are alive, such as those of clover; they have the colour of herbs.
        speckle: Standard deviation of the log brightness of speckles of the ground; 0 for a ground of one colour.
        speckle_size: Width of a speckle.
        moss_share: Share of the ground that is covered with moss.
        moss_rgb: Colour of moss.
        hedge_height: Median height of a hedge where the ground ends, which hides the end from eyes lower than a third of it; 0 for none.
        hill_height: Height of hills, from the lowest valley to the highest top; 0 for none.
        hill_size: Distance between hills.
        mound_density: Density of mounds, as those of ants and moles.
        mound_height: Median height of a mound.
        mound_width: Median width of a mound; a mound that is twice as high is twice as wide.
        rut_depth: Depth of ruts: tracks that wind through the field; 0 for none.
        rut_width: Width of a rut.
        pebble_density: Density of pebbles; those that are lower than a step are walked over, the others are obstacles.
        pebble_size: Width of a pebble.
        far_hill_height: Height of hills far away, all around; 0 for none.
        far_hill_distance: Distance from the field to the first of them.
    """

    name: ClassVar[str] = "world"  # in errors

    field_width: float = number(10.0, low=1, high=100, unit="m")
    field_depth: float = number(10.0, low=1, high=100, unit="m")
    border: float = number(1.0, low=0, high=10, unit="m")
    ground_margin: float = number(15.0, low=1, high=200, unit="m")
    ground_rgb: RGB = colour((203, 170, 118))
    sky_rgb: RGB = colour((188, 212, 232))

    patch_size: float = number(1.4, low=0.1, high=20, unit="m")
    patchiness: float = number(0.9, low=0, high=3, unit="log density")
    cluster_plants: float = number(5.0, low=1, high=100, unit="plants")
    cluster_radius: float = number(0.4, low=0.01, high=10, unit="m")
    size_spread: float = number(0.38, low=0, high=1, unit="log height")
    clearings: int = whole(2, low=0, high=100, unit="clearings")
    clearing_radius: float = number(0.7, low=0.01, high=10, unit="m")
    corridor_width: float = number(0.4, low=0, high=5, unit="m")

    tussock_density: float = number(1.0, low=0, high=20, unit="1/m2")
    tussock_height: float = number(0.3, low=0.02, high=2, unit="m")
    tussock_blades: int = whole(16, low=1, high=500, unit="blades")
    tussock_rgb: RGB = colour((116, 152, 58))
    dry_rgb: RGB = colour((196, 168, 92))
    dry_share: float = number(0.25, low=0, high=1, unit="share of tussock blades")

    grass_density: float = number(14.0, low=0, high=200, unit="1/m2")
    grass_height: float = number(0.085, low=0.01, high=1, unit="m")
    grass_blades: int = whole(3, low=1, high=20, unit="blades")
    grass_near_tussocks: float = number(0.4, low=0, high=1, unit="share of grass")
    grass_rgb: RGB = colour((150, 164, 74))
    flower_share: float = number(0.02, low=0, high=1, unit="share of grass")
    flower_rgb: RGB = colour((226, 190, 60))

    bush_density: float = number(0.06, low=0, high=5, unit="1/m2")
    bush_height: float = number(0.55, low=0.05, high=3, unit="m")
    bush_leaves: int = whole(150, low=3, high=5000, unit="leaves")
    bush_rgb: RGB = colour((74, 108, 62))
    bark_rgb: RGB = colour((98, 76, 58))

    leaf_density: float = number(0.9, low=0, high=50, unit="1/m2")
    leaf_length: float = number(0.055, low=0.005, high=0.5, unit="m")
    leaf_rgb: RGB = colour((158, 94, 46))

    stone_density: float = number(0.13, low=0, high=10, unit="1/m2")
    stone_size: float = number(0.16, low=0.01, high=2, unit="m")
    stone_corners: int = whole(18, low=6, high=200, unit="corners")
    stone_rgb: RGB = colour((150, 142, 134))

    trees: int = whole(32, low=0, high=1000, unit="trees")
    tree_height: float = number(2.5, low=0.2, high=10, unit="m")
    tree_distance: float = number(2.4, low=0.1, high=50, unit="m")
    tree_gaps: float = number(0.3, low=0, high=0.95, unit="share of the horizon")
    tree_leaves: int = whole(100, low=3, high=5000, unit="triangles")
    tree_rgb: RGB = colour((72, 98, 56))
    tree_other_rgb: RGB = colour((122, 112, 48))
    haze: float = number(0.035, low=0, high=1, unit="share of sky per metre")
    tree_density: float = number(0.0, low=0, high=1, unit="1/m2")
    tree_forks: int = whole(0, low=0, high=4, unit="forks")

    herb_density: float = number(0.0, low=0, high=100, unit="1/m2")
    herb_height: float = number(0.15, low=0.02, high=1, unit="m")
    herb_rgb: RGB = colour((92, 132, 56))
    herb_flower_rgb: RGB = colour((232, 226, 214))

    culm_density: float = number(0.0, low=0, high=200, unit="1/m2")
    culm_height: float = number(0.35, low=0.05, high=2, unit="m")

    litter_density: float = number(0.0, low=0, high=500, unit="1/m2")
    litter_length: float = number(0.03, low=0.005, high=0.2, unit="m")
    litter_stems: float = number(0.5, low=0, high=1, unit="share of litter")
    litter_green: float = number(0.0, low=0, high=1, unit="share of leaves in litter")

    speckle: float = number(0.0, low=0, high=1, unit="log brightness")
    speckle_size: float = number(0.07, low=0.02, high=1, unit="m")
    moss_share: float = number(0.0, low=0, high=1, unit="share of the ground")
    moss_rgb: RGB = colour((94, 112, 52))
    hedge_height: float = number(0.0, low=0, high=20, unit="m")

    hill_height: float = number(0.0, low=0, high=20, unit="m")
    hill_size: float = number(4.0, low=0.5, high=100, unit="m")
    mound_density: float = number(0.0, low=0, high=5, unit="1/m2")
    mound_height: float = number(0.12, low=0.01, high=2, unit="m")
    mound_width: float = number(0.5, low=0.05, high=5, unit="m")
    rut_depth: float = number(0.0, low=0, high=0.5, unit="m")
    rut_width: float = number(0.4, low=0.1, high=3, unit="m")
    pebble_density: float = number(0.0, low=0, high=200, unit="1/m2")
    pebble_size: float = number(0.02, low=0.005, high=0.1, unit="m")
    far_hill_height: float = number(0.0, low=0, high=500, unit="m")
    far_hill_distance: float = number(150.0, low=20, high=2000, unit="m")

    @property
    def field(self) -> Bounds:
        """The field (m)."""
        return Bounds(0.0, 0.0, self.field_width, self.field_depth)

    @property
    def has_relief(self) -> bool:
        """Whether the ground is not flat."""
        return self.hill_height > 0 or self.rut_depth > 0 or self.mound_density > 0

    @property
    def land(self) -> Bounds:
        """Where there is ground (m): the field and its margin, and, where there are far hills, all that is within them."""
        return self.field.widened(
            max(self.ground_margin, 1.8 * self.far_hill_distance if self.far_hill_height else 0.0)
        )

    def haze_at(self, distance: float) -> float:
        """Share of the sky's colour in what stands at a distance from the field (m)."""
        return min(self.haze * distance, MAX_HAZE)

    def to_dict(self) -> dict[str, Any]:
        """The parameters as plain JSON types, as in `World.origin["params"]`; `WorldParams(**values)` is the inverse."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in attrs.asdict(self).items()}


# A preset returns WorldParams, as those of presets.py do, or takes a seed and returns a World.
PRESETS = {
    "tussock-field": "params:WorldParams",
    "meadow": "presets:MEADOW",
    "scrub": "presets:SCRUB",
    "tiny": "presets:TINY",
    "hay-meadow": "presets:HAY_MEADOW",
    "woodland": "presets:WOODLAND",
    "desert": "presets:DESERT",
}
OTHERS = {"orchard": "orchard:orchard", "arena": "arena:arena"}  # they have parameters of their own
WORLDS = Registry("worlds", "world", {name: f"tussock.world.{where}" for name, where in (PRESETS | OTHERS).items()})
DESCRIPTIONS = {  # what the worlds of tussock are
    "tussock-field": "Tussocks and short grass, bushes and trees about it; most results are of it",
    "meadow": "Thin grass on bare ground, few tussocks",
    "scrub": "Dry scrub on red ground: bushes, tussocks, stones",
    "tiny": "Fewer than 200 triangles, for tests and first tries",
    "hay-meadow": "Dense grasses, seed heads, herbs and flowers on a speckled ground with litter",
    "woodland": "Trees with branches, twigs and leaves over a ground of dead leaves, moss and herbs",
    "desert": "Sand with pebbles, dry tussocks and low shrubs, far hills all around",
    "orchard": "Single trees on open ground, as in the forests of Bee-Nav (2026)",
    "arena": "A round arena of a laboratory: a wall with bars and shapes around a plain floor",
}


def is_generated(text: str) -> bool:
    """Whether a text names a world to generate; otherwise it names a file.

    It does if its first word is the name of a preset, or `package.module:name`, and nothing but parameters (with `=`) follows.
    So "tiny world.glb" is a file. What is in the current folder does not matter: "tiny" is the preset, "./tiny" the file.
    """
    name, *words = text.split() or [""]
    return (name in WORLDS or bool(LOCATION.fullmatch(name))) and (not words or "=" in text)


def check_preset(text: str) -> None:
    """Refuse an unknown preset, and invalid parameters of one, without generating the world. Raises SettingError.

    Values are not checked for a preset from outside, unless it is made of WorldParams by functools.partial.
    """
    spec = WORLDS.spec(text)
    if getattr(spec.target, "func", spec.target) is WorldParams:
        try:
            _check_parameters(spec)
        except SettingError as error:
            raise SettingError(f"world {text!r}: {error}") from error


@lru_cache  # the runs of a sweep are in few kinds of worlds
def _check_parameters(spec: Spec) -> None:
    spec.make()


def preset_of(params: WorldParams) -> str | None:
    """The name of tussock's preset that has these parameters, or None."""
    return next((name for name in PRESETS if WORLDS.find(name)() == params), None)
