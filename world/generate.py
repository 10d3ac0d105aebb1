"""Worlds from a few numbers and a seed: what grows where.

Vegetation is a Neyman-Scott process: parents fall where a smooth random field is high, plants scatter around parents,
and clearings and winding corridors stay open. A skyline of trees and tall shrubs rings the field.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from . import plants
from .errors import InputError
from .geometry import Bounds
from .params import PRESETS, WorldParams
from .scene import RGB, Ground, World

GENERATOR = 1  # raise it whenever the same seed gives another world

Field = Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, " n"]]
Layout = dict[str, Float[np.ndarray, "n 4"]]  # per kind: x, y, size (m), and the tone (0 to 1) that colours follow
Streams = dict[str, np.random.Generator]

STREAMS = ("land", "bush", "stone", "tussock", "grass", "leaf", "tree")  # new ones go last: old seeds stay as they are


def generate_world(params: WorldParams, seed: int) -> World:
    """Grow a world: the same parameters and seed give the same bytes.

    `World.origin` says how to make it again. Raises InputError for a seed that is not a whole number >= 0.
    """
    layout, streams = _layout(params, seed)
    field = Bounds(0.0, 0.0, float(params.field_width), float(params.field_depth))
    triangles, rgb = [np.zeros((0, 3, 3), np.float32)], [np.zeros((0, 3), np.uint8)]
    for kind, places in layout.items():
        for x, y, size, tone in places.tolist():
            beyond = max(-x, x - params.field_width, -y, y - params.field_depth, 0.0)
            corners, colours = _grow(kind, size, tone, min(params.haze * beyond, 0.6), params, streams[kind])
            triangles.append(corners + np.array([x, y, 0], np.float32))
            rgb.append(colours)
    preset = next((name for name, known in PRESETS.items() if known == params), None)
    return World(
        triangles=np.concatenate(triangles),
        rgb=np.concatenate(rgb),
        ground=Ground(params.ground_rgb, _grown(field, params.ground_margin)),
        sky_rgb=params.sky_rgb,
        field=field,
        origin={"generator": GENERATOR, "preset": preset, "seed": int(seed), "params": params.to_dict()},
    )


def plant_positions(params: WorldParams, seed: int) -> dict[str, Float[np.ndarray, "n 2"]]:
    """Where each plant, stone and tree of the world of this seed stands (m), per kind."""
    return {kind: places[:, :2] for kind, places in _layout(params, seed)[0].items()}


def seeded(seed: int) -> np.random.Generator:
    """The generator of a seed. Raises InputError for one that is not a whole number >= 0."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"the seed is {seed!r}; give a whole number >= 0")
    return np.random.default_rng(int(seed))


def _layout(params: WorldParams, seed: int) -> tuple[Layout, Streams]:
    """Places of all kinds, and the generator that each kind's shapes are to be drawn from."""
    streams: Streams = dict(zip(STREAMS, seeded(seed).spawn(len(STREAMS)), strict=True))
    p, land = params, streams["land"]
    fertile, tone = _smooth_field(p.patch_size, land), _smooth_field(2 * p.patch_size, land)
    open_ground = _open_ground(p, land)
    area = _grown(Bounds(0, 0, p.field_width, p.field_depth), p.border)

    def some(kind: str, density: float, size: float, spread: float, apart: float = 0.0, evenly: bool = False):
        rng = streams[kind]
        count = round(density * (area.x_max - area.x_min) * (area.y_max - area.y_min))
        xy = _scatter(count, area, None if evenly else fertile, open_ground, apart, p, rng)
        sizes = size * np.clip(rng.lognormal(0, spread, count), 0.4, 2.1)
        return np.column_stack([xy, sizes, 0.5 + 0.5 * np.tanh(1.5 * tone(xy))])

    layout = {
        "bush": some("bush", p.bush_density, p.bush_height, p.size_spread, p.bush_height),
        "stone": some("stone", p.stone_density, p.stone_size, 1.4 * p.size_spread, p.stone_size),
        "tussock": some("tussock", p.tussock_density, p.tussock_height, p.size_spread, 0.7 * p.tussock_height),
        "grass": some("grass", p.grass_density, p.grass_height, p.size_spread),
        "leaf": some("leaf", p.leaf_density, p.leaf_length, 0.25, evenly=True),
        "tree": _skyline(p, streams["tree"]),
    }
    _gather(layout["grass"], layout["tussock"], p.grass_near_tussocks, streams["grass"])
    return layout, streams


def _scatter(count: int, area: Bounds, fertile: Field | None, open_ground: Field, apart: float, p: WorldParams, rng):
    """`count` places (n, 2) in families around parents on fertile ground, `apart` metres from each other if they can.

    Without `fertile` they are scattered evenly. Open ground is kept open, unless there is no other room.
    """
    low, size = np.array(area[:2]), np.array([area.x_max - area.x_min, area.y_max - area.y_min])
    families = max(1, round(count / p.cluster_plants))
    parents = low + size * rng.random((20 * families, 2))
    if fertile is not None:
        weight = np.exp(p.patchiness * fertile(parents)) * (1e-3 + 1 - open_ground(parents))
        parents = parents[rng.choice(len(parents), families, p=weight / weight.sum())]
    kept = np.zeros((0, 2))
    for attempt in range(60):
        xy = low + size * rng.random((4 * count, 2))
        if fertile is not None and attempt < 40:
            of_family = rng.random(len(xy)) < 0.85  # the others stand alone
            around = parents[rng.integers(families, size=len(xy))] + rng.normal(0, p.cluster_radius, xy.shape)
            xy = np.where(of_family[:, None], around, xy)
        room = area.contains(xy[:, 0], xy[:, 1]) & (rng.random(len(xy)) >= open_ground(xy) * (attempt < 20))
        kept = _spaced(np.concatenate([kept, xy[room]]), count, apart * (attempt < 20))
        if len(kept) == count:
            break
    return kept


def _spaced(xy, count: int, apart: float):
    """The first `count` points, leaving out those within `apart` metres of one already taken."""
    if apart == 0:
        return xy[:count]
    kept: list[int] = []
    for i in range(len(xy)):
        if len(kept) < count and (np.hypot(*(xy[kept] - xy[i]).T) > apart).all():
            kept.append(i)
    return xy[kept]


def _gather(grass, tussocks, share: float, rng) -> None:
    """Move a share of the grass (rows of a layout, changed in place) to the feet of tussocks, the taller the more."""
    moved = np.flatnonzero(rng.random(len(grass)) < share)
    if len(tussocks) == 0 or len(moved) == 0:
        return
    host = tussocks[rng.choice(len(tussocks), len(moved), p=tussocks[:, 2] / tussocks[:, 2].sum())]
    angle, far = rng.uniform(-np.pi, np.pi, len(moved)), host[:, 2] * (0.25 + rng.gamma(1.5, 0.22, len(moved)))
    grass[moved, :2] = host[:, :2] + np.column_stack([far * np.cos(angle), far * np.sin(angle)])
    grass[moved, 2] *= 1.25  # tussocks shelter it
    grass[moved, 3] = host[:, 3]


def _skyline(p: WorldParams, rng) -> Float[np.ndarray, "n 4"]:
    """Places of the trees: an irregular ring with gaps, its height and kind varying with direction."""
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    dense, tall, kind = (_smooth_ring(angles, rng) for _ in range(3))
    weight = np.clip(dense - np.quantile(dense, p.tree_gaps), 0, None) ** 0.6 + 1e-9
    order = (np.arange(p.trees) + rng.random(p.trees)) / max(p.trees, 1)
    angle = np.interp(order, np.cumsum(weight) / weight.sum(), angles)
    row = np.searchsorted(angles, angle).clip(0, 719)
    height = p.tree_height * np.clip(np.exp(0.45 * tall[row]) * rng.lognormal(0, 0.22, p.trees), 0.42, 1.6)
    width, depth = p.field_width / 2, p.field_depth / 2
    to_edge = np.minimum(
        width / np.maximum(np.abs(np.cos(angle)), 1e-9), depth / np.maximum(np.abs(np.sin(angle)), 1e-9)
    )
    far = to_edge + p.tree_distance * np.clip(rng.lognormal(0, 0.6, p.trees), 0.4, 4) + 0.4 * height
    xy = np.column_stack([width + far * np.cos(angle), depth + far * np.sin(angle)])
    tone = np.clip(0.5 + 0.5 * np.tanh(2 * kind[row]) + rng.normal(0, 0.12, p.trees), 0, 1)
    return np.column_stack([xy, height, tone])


def _smooth_field(scale: float, rng) -> Field:
    """A smooth random field over the plane, of mean 0 and deviation 1, its hills about `scale` metres apart."""
    waves, phase = rng.normal(0, 1.6 / scale, (2, 48)), rng.uniform(0, 2 * np.pi, 48)
    return lambda xy: np.cos(xy @ waves + phase).sum(axis=1) / np.sqrt(24)


def _smooth_ring(angles, rng) -> Float[np.ndarray, " n"]:
    """A smooth random function of direction, of mean 0 and deviation 1."""
    k = np.arange(1, 9)
    size, phase = rng.normal(0, 1, 8) * k**-0.35, rng.uniform(0, 2 * np.pi, 8)
    values = np.cos(angles[:, None] * k + phase) @ size
    return (values - values.mean()) / values.std()


def _open_ground(p: WorldParams, rng) -> Field:
    """Where nothing grows: 1 within clearings and corridors, 0 outside, smooth between.

    Corridors follow the zero contours of a smooth random field, which wind through the whole field and never end in it.
    """
    centres = rng.random((p.clearings, 2)) * [p.field_width, p.field_depth]
    radius = p.clearing_radius * rng.lognormal(0, 0.3, p.clearings)
    scale = 0.3 * min(p.field_width, p.field_depth)
    waves, phase, ragged = rng.normal(0, 1 / scale, (2, 12)), rng.uniform(0, 2 * np.pi, 12), _smooth_field(0.4, rng)

    def share(xy):
        angle = xy @ waves + phase
        slope = np.hypot(*(-np.sin(angle) @ waves.T).T)
        beside = np.abs(np.cos(angle).sum(axis=1)) / np.maximum(slope, 1e-9) - p.corridor_width / 2
        away = np.hypot(*np.moveaxis(xy[:, None] - centres, -1, 0)) - radius
        edge = np.minimum(beside, away.min(axis=1, initial=np.inf)) + 0.06 * ragged(xy)
        return np.clip(0.5 - edge / 0.12, 0, 1) if p.corridor_width or p.clearings else np.zeros(len(xy))

    return share


def _grow(kind: str, size: float, tone: float, haze: float, p: WorldParams, rng) -> plants.Plant:
    """One plant, stone or tree of `size` metres. tone: 0 to 1, the way colours drift over the land."""
    if kind == "tussock":
        blades = round(p.tussock_blades * np.clip(size / p.tussock_height, 0.6, 1.5))
        return plants.tussock(
            height=size, spread=0.04 + 0.14 * size, blades=blades, rgb=_mixed(p.tussock_rgb, p.grass_rgb, 0.5 * tone),
            dry_rgb=p.dry_rgb, dry_share=min(1.0, p.dry_share * (0.5 + tone)), rng=rng,
        )  # fmt: skip
    if kind == "grass":
        rgb = _mixed(p.grass_rgb, p.dry_rgb, min(0.9, 4 * p.dry_share * max(0.0, tone - 0.4)))
        flower = p.flower_rgb if rng.random() < p.flower_share else None
        return plants.grass(
            height=size, blades=int(rng.integers(1, p.grass_blades + 1)), rgb=rgb, flower_rgb=flower, rng=rng
        )
    if kind == "bush":
        leaves, width = max(3, round(p.bush_leaves * size / p.bush_height)), size * rng.uniform(0.8, 1.6)
        rgb = _mixed(p.bush_rgb, p.grass_rgb, 0.5 * tone)
        return plants.bush(height=size, width=width, leaves=leaves, rgb=rgb, bark_rgb=p.bark_rgb, rng=rng)
    if kind == "leaf":
        return plants.leaf(length=size, rgb=_mixed(p.leaf_rgb, p.dry_rgb, 0.6 * tone), rng=rng)
    if kind == "stone":
        return plants.stone(size=size, corners=p.stone_corners, rgb=p.stone_rgb, rng=rng)
    conical = float(np.clip(2.2 * tone - 1.1, 0, 1))
    width = size * rng.uniform(0.55, 1.05) * (1 - 0.4 * conical)
    bigger = size * width / (0.7 * p.tree_height**2)  # a bigger crown needs more leaves, unless they are few anyway
    leaves = round(p.tree_leaves * np.clip(bigger, 0.6, 2.2)) if p.tree_leaves >= 75 else p.tree_leaves
    rgb, bark = (_mixed(c, p.sky_rgb, haze) for c in (_mixed(p.tree_rgb, p.tree_other_rgb, 1 - tone), p.bark_rgb))
    return plants.tree(height=size, width=width, taper=conical, leaves=leaves, rgb=rgb, bark_rgb=bark, rng=rng)


def _mixed(rgb: RGB, other: RGB, share: float) -> RGB:
    r, g, b = (round(a + (c - a) * share) for a, c in zip(rgb, other, strict=True))
    return r, g, b


def _grown(bounds: Bounds, by: float) -> Bounds:
    return Bounds(bounds.x_min - by, bounds.y_min - by, bounds.x_max + by, bounds.y_max + by)
