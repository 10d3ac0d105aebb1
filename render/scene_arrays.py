"""A world and an eye as arrays, ready for the loops that draw: on the CPU (scanline.py) and on the GPU (cuda.py)."""

from typing import NamedTuple

import numpy as np

from tussock.world.geometry import column_azimuths
from tussock.world.scene import World
from tussock.world.textures import WRAPS, product_table

from .colour_kernels import PLAIN
from .eye import Eye
from .false_colours import seen_colours
from .triangle_tree import tree_of


class Triangles(NamedTuple):
    """What the loops draw.

    Attributes:
        corners: (leaves, 3, 3, LEAF) x, y, z (m) of the three corners of each triangle, see `TriangleTree`.
        labels: (n,) a number over 0 for each triangle; of equally near ones, the one with the greatest label is seen.
        boxes: (6, m) the boxes of a `TriangleTree`, one coordinate after the other, so that loops over them are vectorised.
        cull: Whether triangles are seen from their front only.
    """

    corners: np.ndarray
    labels: np.ndarray
    boxes: np.ndarray
    cull: bool


class Rays(NamedTuple):
    """The rays of an eye.

    Attributes:
        azimuths: (width,) of the columns of rays, relative to the heading (rad).
        tangents: (height,) of the elevations of the rows of rays, which are evenly spaced.
        top: Elevation of the upper edge (rad).
        rows_per_rad: Rows of rays in one radian of elevation.
        per_pixel: Rays along each side of a pixel.
    """

    azimuths: np.ndarray
    tangents: np.ndarray
    top: float
    rows_per_rad: float
    per_pixel: int


class Paint(NamedTuple):
    """What makes pixels of rays.

    Attributes:
        colours: (n + 1,) by label, that of the sky (label 0) first: red, green, blue and alpha in 16 bits each, red lowest, so
            that one sum adds all four.
        weights: (height, per_pixel) of the rows of rays in each row of pixels, by solid angle; a row sums to 1 / per_pixel.
    """

    colours: np.ndarray
    weights: np.ndarray


class Lookup(NamedTuple):
    """Where rays find their colours in a textured world. The first arrays are by label, that of the sky first.

    Attributes:
        corners: (n + 1, 3, 3) of the triangles (m).
        index: (n + 1,) the texture; -1 for corner colours alone, PLAIN for one colour.
        holes: (n + 1,) whether some rays may pass through the triangle.
        uv: (n + 1, 3, 2) texture coordinates.
        corner_colours: (n + 1, 3, 4) see `Texturing`; (0, 3, 4) where there are none.
        texels: (texels,) of all textures, row by row: red, green, blue and alpha in 8 bits each, red lowest.
        textures: (k, 6) for each texture: where its texels begin, width, height, wrap across and down (index in WRAPS), and
            whether its texels are mixed.
        thresholds: (k,) `Texture.threshold`.
        products: `product_table`.
    """

    corners: np.ndarray
    index: np.ndarray
    holes: np.ndarray
    uv: np.ndarray
    corner_colours: np.ndarray
    texels: np.ndarray
    textures: np.ndarray
    thresholds: np.ndarray
    products: np.ndarray

    @classmethod
    def of(cls, world: World) -> "Lookup | None":
        """That of a world; None if it has no textures."""
        texturing = world.surface_texturing()
        if texturing is None:
            return None
        triangles, _ = world.surfaces()

        def by_label(values: np.ndarray, plain: int) -> np.ndarray:
            """Those of the triangles, the ground, and the sky, in the order of their labels."""
            rest = np.full((len(triangles) + 1 - len(values), *values.shape[1:]), plain, values.dtype)
            return np.ascontiguousarray(np.concatenate([values, rest])[::-1])

        colours, textures = texturing.colours, texturing.textures
        starts = np.cumsum([0] + [texture.rgba.shape[0] * texture.rgba.shape[1] for texture in textures])
        table = [
            (
                start,
                texture.rgba.shape[1],
                texture.rgba.shape[0],
                *map(WRAPS.index, texture.wrap),
                texture.filter == "linear",
            )
            for start, texture in zip(starts, textures, strict=False)
        ]
        return cls(
            corners=by_label(triangles, 0),
            index=by_label(
                np.where((texturing.index < 0) & (colours is None), PLAIN, texturing.index).astype(np.int32), PLAIN
            ),
            holes=by_label(texturing.may_have_holes(), 0),
            uv=by_label(texturing.uv, 0),
            corner_colours=np.empty((0, 3, 4), np.uint8) if colours is None else by_label(colours, 0),
            texels=np.concatenate([np.empty(0, "<u4"), *(texture.rgba.view("<u4").ravel() for texture in textures)]),
            textures=np.array(table, dtype=np.int64).reshape(-1, 6),
            thresholds=np.array([texture.threshold for texture in textures]),
            products=product_table(),
        )


class Scene(NamedTuple):
    """What is drawn, and how.

    Attributes:
        triangles: What the loops draw.
        rays: Along which they look.
        paint: What makes pixels of rays.
        lookup: Where rays find their colours; None in a world without textures.
    """

    triangles: Triangles
    rays: Rays
    paint: Paint
    lookup: Lookup | None

    @classmethod
    def of(cls, world: World, eye: Eye) -> "Scene":
        """That of a world, seen by an eye."""
        tree = tree_of(world)
        world = seen_colours(world, eye.spectrum)
        _, rgb = world.surfaces()
        labels = len(rgb) - tree.order  # of equally near triangles the first is seen
        triangles = Triangles(tree.corners, labels, np.ascontiguousarray(tree.boxes.T), not world.double_sided)
        elevations = eye.elevations(eye.rays)
        rows_per_rad = len(elevations) / (eye.top - eye.bottom)
        azimuths = column_azimuths(eye.width * eye.rays)
        rays = Rays(azimuths, np.tan(elevations), eye.top, rows_per_rad, eye.rays)
        covered = np.column_stack([rgb, np.full(len(rgb), 255)])[::-1]
        sky = (0, 0, 0) if world.light else world.sky_rgb  # the sky of a light is added to the views, see sky.py
        colours = np.vstack([[*sky, 0], covered]).astype("<u2").view("<i8")[:, 0]
        weights = np.cos(elevations).reshape(eye.height, eye.rays)
        paint = Paint(colours, weights / weights.sum(axis=1, keepdims=True) / eye.rays)
        return cls(triangles, rays, paint, Lookup.of(world))
