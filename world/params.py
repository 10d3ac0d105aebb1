"""What a generated world is like: parameters with their units and ranges, and the presets."""

import dataclasses
from dataclasses import dataclass
from typing import Any

from .errors import InputError
from .scene import RGB, check_colour
from .specs import parse_parameters, split_words


def _number(default: float | int, unit: str, low: float | int, high: float | int) -> Any:
    """A field of WorldParams with its unit and the range it must lie in."""
    return dataclasses.field(default=default, metadata={"unit": unit, "low": low, "high": high})


@dataclass(frozen=True, kw_only=True)
class WorldParams:
    """What a generated world is like. Densities count plants a square metre of field and border.

    Colours are what sunlit vegetation of middling height shows; light, shade and individual plants vary around them.
    Raises InputError for a value outside its range.
    """

    field_width: float = _number(10.0, "m", 1, 50)  # east-west; the field's corner is at x = y = 0
    field_depth: float = _number(10.0, "m", 1, 50)  # north-south
    border: float = _number(1.0, "m", 0, 10)  # vegetation goes on this far around the field
    ground_margin: float = _number(15.0, "m", 1, 200)  # ground goes on this far around the field
    ground_rgb: RGB = (203, 170, 118)
    sky_rgb: RGB = (188, 212, 232)

    patch_size: float = _number(1.4, "m", 0.1, 20)  # how far fertile and poor ground lie apart
    patchiness: float = _number(0.9, "log density", 0, 3)  # how much they differ (standard deviation)
    cluster_plants: float = _number(5, "plants", 1, 100)  # mean size of a family of plants
    cluster_radius: float = _number(0.4, "m", 0.01, 10)
    size_spread: float = _number(0.38, "log height", 0, 1)  # standard deviation of plants' log heights
    clearings: int = _number(2, "clearings", 0, 100)
    clearing_radius: float = _number(0.7, "m", 0.01, 10)
    corridor_width: float = _number(0.4, "m", 0, 5)

    tussock_density: float = _number(1.0, "1/m2", 0, 20)
    tussock_height: float = _number(0.3, "m", 0.02, 2)  # median, as all heights here
    tussock_blades: int = _number(16, "blades", 1, 500)  # of a tussock of median height
    tussock_rgb: RGB = (116, 152, 58)
    dry_rgb: RGB = (196, 168, 92)
    dry_share: float = _number(0.25, "share of tussock blades", 0, 1)  # grass dries with them

    grass_density: float = _number(14.0, "1/m2", 0, 200)
    grass_height: float = _number(0.085, "m", 0.01, 1)
    grass_blades: int = _number(3, "blades", 1, 20)  # at most, a tuft
    grass_near_tussocks: float = _number(0.4, "share of grass", 0, 1)
    grass_rgb: RGB = (150, 164, 74)
    flower_share: float = _number(0.02, "share of grass", 0, 1)
    flower_rgb: RGB = (226, 190, 60)

    bush_density: float = _number(0.06, "1/m2", 0, 5)
    bush_height: float = _number(0.55, "m", 0.05, 3)
    bush_leaves: int = _number(150, "leaves", 3, 5000)
    bush_rgb: RGB = (74, 108, 62)
    bark_rgb: RGB = (98, 76, 58)

    leaf_density: float = _number(0.9, "1/m2", 0, 50)
    leaf_length: float = _number(0.055, "m", 0.005, 0.5)
    leaf_rgb: RGB = (158, 94, 46)

    stone_density: float = _number(0.13, "1/m2", 0, 10)
    stone_size: float = _number(0.16, "m", 0.01, 2)  # median of its largest width
    stone_corners: int = _number(18, "corners", 6, 200)
    stone_rgb: RGB = (150, 142, 134)

    trees: int = _number(32, "trees", 0, 1000)  # of the skyline, all around the field
    tree_height: float = _number(2.5, "m", 0.2, 10)
    tree_distance: float = _number(2.4, "m", 0.1, 50)  # median, from the edge of the field
    tree_gaps: float = _number(0.3, "share of the horizon", 0, 0.95)
    tree_leaves: int = _number(100, "triangles", 3, 5000)
    tree_rgb: RGB = (72, 98, 56)
    tree_other_rgb: RGB = (122, 112, 48)  # what the trees of other directions tend to
    haze: float = _number(0.035, "share of sky a metre", 0, 1)

    def __post_init__(self):
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if item.metadata:
                object.__setattr__(self, item.name, _checked(item, value))
            else:
                check_colour(item.name, value)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "WorldParams":
        """Parameters from plain JSON types, as `World.origin["params"]` has them; missing ones take their defaults."""
        if not isinstance(values, dict):
            raise InputError(f"parameters of a world are names and values, got {values!r}")
        names = {item.name for item in dataclasses.fields(cls)}
        if unknown := sorted(set(map(str, values)) - names):
            raise InputError(f"{unknown[0]!r} is no parameter of a world; there are {', '.join(sorted(names))}")
        plain: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**plain)

    @classmethod
    def named(cls, text: str) -> "WorldParams":
        """Those of a preset, which parameters may follow: "tussock-field field_width=20 tussock_density=2".

        Raises InputError for unknown presets and parameters, and for values out of range.
        """
        name, *words = split_words(text) or [""]
        if name not in PRESETS:
            raise InputError(f"unknown preset {name!r}; known: {', '.join(PRESETS)}")
        try:
            return dataclasses.replace(PRESETS[name], **parse_parameters(words, name, cls))
        except InputError as error:
            raise InputError(f"world {text!r}: {error}") from error

    def to_dict(self) -> dict[str, Any]:
        """The parameters as plain JSON types."""
        return {name: list(v) if isinstance(v, tuple) else v for name, v in dataclasses.asdict(self).items()}


def _checked(item: dataclasses.Field, value) -> float | int:
    """The value of a numeric field as the type it is declared to be. Raises InputError if it cannot be used."""
    kind, wanted = (int, "a whole number") if item.type in (int, "int") else (float, "a number")
    low, high, unit = item.metadata["low"], item.metadata["high"], item.metadata["unit"]
    if isinstance(value, bool) or not isinstance(value, kind | int) or not low <= value <= high:
        raise InputError(f"{item.name} is {value!r}; give {wanted} in {low:g}..{high:g} ({unit})")
    return kind(value)


PRESETS: dict[str, WorldParams] = {
    "tussock-field": WorldParams(),
    "meadow": WorldParams(
        ground_rgb=(172, 152, 102), sky_rgb=(176, 208, 238), cluster_plants=9.0, cluster_radius=0.5, clearings=4,
        tussock_density=0.4, tussock_height=0.24, tussock_rgb=(96, 150, 54), dry_share=0.08,
        grass_density=20.0, grass_height=0.13, grass_near_tussocks=0.15, grass_rgb=(122, 170, 62), flower_share=0.16,
        flower_rgb=(226, 96, 130), bush_density=0.02, bush_rgb=(70, 124, 58), stone_density=0.03, leaf_density=0.3,
        trees=42, tree_height=2.4, tree_gaps=0.2, tree_rgb=(64, 112, 58), tree_other_rgb=(96, 132, 60),
    ),
    "scrub": WorldParams(
        ground_rgb=(206, 148, 104), sky_rgb=(196, 214, 226), patchiness=1.1, corridor_width=0.5,
        tussock_density=0.45, tussock_height=0.2, tussock_rgb=(150, 148, 84), dry_rgb=(214, 186, 120),
        dry_share=0.4, grass_density=11.0, grass_height=0.07, grass_rgb=(176, 160, 96), flower_share=0.0,
        bush_density=0.2, bush_height=0.5, bush_leaves=125, bush_rgb=(98, 116, 78), stone_density=0.4, stone_size=0.2,
        stone_rgb=(168, 128, 104), trees=32, tree_height=2.0, tree_gaps=0.45, tree_rgb=(88, 100, 66),
        tree_other_rgb=(132, 104, 70),
    ),
    "tiny": WorldParams(  # fewer than 200 triangles whatever the seed
        field_width=3.0, field_depth=3.0, border=0.0, ground_margin=6.0, patchiness=0.3, cluster_plants=1.0,
        clearings=0, corridor_width=0.0, size_spread=0.25, tussock_density=0.56, tussock_height=0.24, tussock_blades=4,
        grass_density=1.78, grass_blades=2, grass_height=0.04, flower_share=0.0, bush_density=0.0, leaf_density=0.0,
        stone_density=0.0, trees=7, tree_height=1.3, tree_distance=0.9, tree_leaves=8,
    ),
}  # fmt: skip


def is_generated(world: str) -> bool:
    """Whether a world that is called so is grown, from a preset, rather than read from a file."""
    return next(iter(world.split()), "") in PRESETS
