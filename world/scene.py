"""The world: coloured triangles, a ground and a sky."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from .errors import SettingError
from .flight import Flight
from .generate import GENERATOR, generate_plants, generate_relief
from .geometry import Bounds
from .ground import QUAD_UV, Ground, check_bounds, check_colour
from .light import Light
from .params import WORLDS, WorldParams, preset_of
from .plant_groups import PlantGroups
from .settings import MAX_COORDINATE, RGB
from .terrain import MAX_SLOPE, Part, Terrain
from .textures import Texturing

if TYPE_CHECKING:
    from .change import Change
    from .geometry import Route

Made = TypeVar("Made")


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Everything that can be seen. Immutable.

    Attributes:
        triangles: (n, 3, 3) corners: triangle, corner, xyz (m, z up).
        rgb: (n, 3) one colour per triangle.
        ground: The ground, or None.
        sky_rgb: Colour of the sky.
        field: Where an agent may be (m).
        double_sided: False culls back faces: a triangle is visible only from the side that (v1 - v0) x (v2 - v0) points to.
        origin: How the world was made (preset, seed, parameters); it is saved and loaded with the world.
        origin_m: What was subtracted from the coordinates of the file (m): they are those of the world plus this.
        texturing: Textures and corner colours of the triangles, or None. `rgb` is then the mean colour of each triangle, which
            maps and recordings show; the renderers draw the texturing.
        terrain: The ground of the mesh, which agents stand on (see `on_mesh`), or where they fly; None: they stand at z = 0. A generated
            world whose ground is not flat has one.
        reflectance: (n, 3) the colours in even light, which another light is put on (see light.py); None: those of `rgb`.
        plants: Which triangles are which plant; None where this is not known.
        light: The light that its colours show (see render/lighting.py), and that makes the sky; None: a sky of one colour.
        unlit: The world that the light was put on; None where there is no light, or where it was read with its light from a file.
    """

    triangles: Float32[np.ndarray, "n 3 3"]
    rgb: UInt8[np.ndarray, "n 3"]
    ground: Ground | None
    sky_rgb: RGB
    field: Bounds
    double_sided: bool = True
    origin: dict[str, Any] = dataclasses.field(default_factory=dict)
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texturing: Texturing | None = None
    terrain: Terrain | Flight | None = None
    reflectance: UInt8[np.ndarray, "n 3"] | None = None
    plants: PlantGroups | None = None
    light: Light | None = None
    unlit: "World | None" = None

    def __post_init__(self):
        n = len(self.triangles)
        arrays = [("triangles", (n, 3, 3), np.float32), ("rgb", (n, 3), np.uint8)]
        for label, shape, kind in arrays + [("reflectance", (n, 3), np.uint8)] * (self.reflectance is not None):
            array = getattr(self, label)
            if array.shape != shape or array.dtype != kind:
                raise SettingError(f"{label} of a world are {shape} {np.dtype(kind)}, got {array.shape} {array.dtype}")
            array = array.copy()
            array.flags.writeable = False
            object.__setattr__(self, label, array)
        valid = np.abs(self.triangles) <= MAX_COORDINATE  # False for nan
        if not valid.all():
            invalid = int(valid.all(axis=(1, 2)).argmin())
            raise SettingError(
                f"triangle {invalid} of the world has a corner that is not finite, or over {MAX_COORDINATE:g} m away; repair the mesh"
            )
        if not (self.ground is None or isinstance(self.ground, Ground)):
            raise SettingError(f"the ground of a world is a Ground or None, got {type(self.ground).__name__}")
        if self.texturing is not None and len(self.texturing.index) != n:
            raise SettingError(f"the texturing of a world is of its {n} triangles, got {len(self.texturing.index)}")
        if self.plants is not None and len(self.plants.of) != n:
            raise SettingError(f"the plants of a world are of its {n} triangles, got {len(self.plants.of)}")
        check_colour("the colour of the sky", self.sky_rgb)
        check_bounds("the field", self.field)
        if not (len(self.origin_m) == 3 and np.isfinite(self.origin_m).all()):
            raise SettingError(f"origin_m is {self.origin_m!r}; give three finite numbers (m)")

    @classmethod
    def generate(cls, params: WorldParams | str = "tussock-field", seed: int = 0) -> "World":
        """Generate a world. The same arguments give the same bytes.

        Args:
            params: Parameters, or the name of a preset, which parameters may follow: "tussock-field field_width=20". A preset
                of your own is named as `package.module:name`, or registered.
            seed: A whole number from 0.

        Raises:
            SettingError: For an unknown preset or parameter, an invalid value, or an invalid seed.
        """
        made = WORLDS.spec(params).make(seed=seed) if isinstance(params, str) else params
        if isinstance(made, World):
            return made
        if not isinstance(made, WorldParams):
            raise SettingError(
                f"the world {params!r} gives an object of type {type(made).__name__}; a preset returns WorldParams or a World"
            )
        land = generate_relief(made, seed)
        plant, groups = generate_plants(made, seed, land)
        world = cls(
            **plant._asdict(),
            plants=groups,
            ground=Ground(made.ground_rgb, made.land) if land is None else None,
            sky_rgb=made.sky_rgb,
            field=made.field,
            origin={"generator": GENERATOR, "preset": preset_of(made), "seed": int(seed), "params": made.to_dict()},
        )
        n = len(world.triangles)
        return world if land is None else world.on_mesh(part=(n - len(land.ground.rgb), n))

    def on_mesh(self, max_slope: float = MAX_SLOPE, part: Part | None = None) -> "World":
        """The same world, where agents stand on its triangles (and `ground`); terrain.py explains on which of them.

        Args:
            max_slope: Steepest ground that can be stood and walked on (rad).
            part: The first of the triangles that are the ground, and the one after the last. None: as in `terrain`, or unknown.

        Raises:
            InputError: Where nothing can be stood on.
        """
        if part is None and isinstance(self.terrain, Terrain):
            part = self.terrain.part
        if (
            part is not None
            and isinstance(self.terrain, Terrain)
            and (part, max_slope) == (self.terrain.part, self.terrain.max_slope)
        ):
            return self
        terrain = Terrain.of(self.surfaces()[0], float(np.prod(self.field.size)), max_slope, part)
        return dataclasses.replace(self, terrain=terrain)

    def flown(self, flight: Flight) -> "World":
        """The same world, where agents fly: they move on a surface in the air, and pass over and under what it does not cross."""
        return dataclasses.replace(self, terrain=flight)

    def changed(self, change: "Change | str", seed: int = 0, route: "Route | None" = None) -> "World":
        """The same world after a change, such as plants removed or wind (docs/changes.md). Where nothing changes, it is this world.

        Args:
            change: What changes: "removed amount=0.2", "wind amount=0.5 direction_deg=90", or several with `|` between them. An `amount` is
                from 0, which changes nothing, to 1.
            seed: Of what is drawn, such as which plants. The same seed gives the same bytes.
            route: Through the world: a new object then stands next to it.

        Raises:
            SettingError: For an unknown change or parameter, an invalid value, and a change of plants where there are none.
        """
        from .change import Change

        change = Change.parse(change) if isinstance(change, str) else change
        if change.of_light:
            raise SettingError(
                f"{str(change)!r} changes the light, which is put on a world after its shapes have changed: "
                "lit(world.changed('removed amount=0.2'), light.later(4.0))"
            )
        return change.apply(self, seed, route)

    def without_light(self) -> "World":
        """The world before a light was put on it, with the sky, the field and the sides that it has now; itself where that is not known."""
        if self.unlit is None:
            return self
        return dataclasses.replace(self.unlit, sky_rgb=self.sky_rgb, field=self.field, double_sided=self.double_sided)

    def ground_height(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Height of what agents stand or fly on at positions (both m): 0, or that of the terrain; nan where it has no ground."""
        return np.zeros(len(xy)) if self.terrain is None else self.terrain.height(xy)

    def stands(self, xy: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Whether there is ground at positions (m)."""
        return ~np.isnan(self.ground_height(xy))

    def surfaces(self) -> tuple[Float32[np.ndarray, "m 3 3"], UInt8[np.ndarray, "m 3"]]:
        """Triangles and colours, with the triangles of the ground (facing up) at the end: what a renderer draws."""
        if self.ground is None:
            return self.triangles, self.rgb
        own = self.ground.triangles(), self.ground.colours()
        return np.concatenate([self.triangles, own[0]]), np.concatenate([self.rgb, own[1]])

    def surface_texturing(self) -> Texturing | None:
        """The textures of all that `surfaces` has; None where there are none. A ground without parts has no texture."""
        parts = () if self.ground is None else self.ground.parts
        if not parts:
            return self.texturing
        n, k = len(self.triangles), 2 * len(parts)
        own = self.texturing or Texturing(
            textures=(), index=np.full(n, -1, np.int32), uv=np.zeros((n, 3, 2), np.float32)
        )
        return Texturing(
            textures=own.textures + tuple(part.texture for part in parts),
            index=np.concatenate([own.index, len(own.textures) + np.arange(k, dtype=np.int32) // 2]).astype(np.int32),
            uv=np.concatenate([own.uv, np.tile(QUAD_UV, (len(parts), 1, 1))]),
            colours=None if own.colours is None else np.concatenate([own.colours, np.full((k, 3, 4), 255, np.uint8)]),
        )


def once_per_world(make: Callable[[World], Made]) -> Callable[[World], Made]:
    """A function of a world whose result is kept as long as the world, which never changes."""
    kept: WeakKeyDictionary[World, Made] = WeakKeyDictionary()

    @wraps(make)
    def get(world: World) -> Made:
        if world not in kept:
            kept[world] = make(world)
        return kept[world]

    return get
