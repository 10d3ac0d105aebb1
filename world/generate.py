"""What grows where in a generated world, from its parameters and a seed.

Plants follow a Neyman-Scott process: parents are placed where a smooth random field is high, and plants are scattered around
them. Clearings and winding corridors stay open. A skyline of trees and tall shrubs surrounds the field. Speckles, litter and
pebbles may cover the ground, a hedge hide its end, and far hills stand around it. Where the ground is not flat, all stands on it.
"""

import numpy as np
from jaxtyping import Float

from .errors import SettingError
from .far_hills import far_hills
from .geometry import Bounds
from .ground_cover import litter, speckles
from .hedge import hedge
from .herbs import culms, herb
from .land import Land, land_of
from .params import WorldParams
from .pebbles import pebbles
from .plant_groups import GROUND, OTHER, GroupsBuilder, PlantGroups
from .plant_parts import NO_PLANT, Plant, joined
from .plants import bush, grass, leaf, stone, tree, tussock
from .random_fields import PlaneFunction, random_field, random_ring
from .trees import branching_tree

GENERATOR = 1  # version: raise it whenever the same seed gives another world

Layout = dict[str, Float[np.ndarray, "n 4"]]  # of each kind: x, y, size (m), and tone (0 to 1), which colours follow
Streams = dict[str, np.random.Generator]

STREAMS = (  # append new ones: old seeds stay as they are
    "land", "bush", "stone", "tussock", "grass", "leaf", "tree",
    "herb", "culm", "litter", "inner_tree", "speckles", "hedge", "relief", "pebble", "far_hills",
)  # fmt: skip
TREES = ("tree", "inner_tree")
SHAPES = {"bush": bush, "stone": stone, "tussock": tussock, "leaf": leaf, "herb": herb}
AT_ONCE = {
    "grass": grass,
    "culm": culms,
    "litter": litter,
    "pebble": pebbles,
}  # of these there are thousands: all of a kind are shaped at once
KINDS = {"inner_tree": "tree"}  # what a kind is called in PlantGroups, where that differs


def generate_relief(params: WorldParams, seed: int) -> Land | None:
    """The ground of a world, or None where it is flat. Raises SettingError for a seed that is not a whole number from 0."""
    return land_of(params, streams_of(seed)["relief"])


def generate_plants(params: WorldParams, seed: int, land: Land | None) -> tuple[Plant, PlantGroups]:
    """All plants, stones and trees of a world, and which are which: the same parameters and seed give the same bytes.

    They stand on the land, if there is one, whose triangles are the last. Trees keep their shape; of all else each corner is raised by
    the height of the ground beneath it.

    Raises SettingError for a seed that is not a whole number from 0.
    """
    layout, streams = plant_layout(params, seed)
    pieces, groups = [NO_PLANT], GroupsBuilder()
    feet: list[tuple[int, float, float]] = []  # of each tree: which piece it is, x and y (m)
    for kind, rows in layout.items():
        if kind in AT_ONCE:
            piece, row = AT_ONCE[kind](params, rows, streams[kind])
            groups.add(kind, rows[:, :2], row)
            pieces.append(piece)
            continue
        for x, y, size, tone in rows.tolist():
            if kind in TREES:
                piece = _tree(params, x, y, size, tone, streams[kind])
                feet.append((len(pieces), x, y))
            else:
                piece = SHAPES[kind](params, size, tone, streams[kind])
            groups.add(KINDS.get(kind, kind), np.array([(x, y)]), np.zeros(len(piece.rgb), np.int64))
            pieces.append(piece._replace(triangles=piece.triangles + np.array([x, y, 0], np.float32)))
    if land is None:
        pieces.append(speckles(params, streams["speckles"]))
        groups.add_none(len(pieces[-1].rgb), GROUND)
    around = [hedge(params, streams["hedge"]), far_hills(params, streams["far_hills"])]
    groups.add_none(sum(len(piece.rgb) for piece in around), OTHER)
    pieces += around
    if land is None:
        return joined(pieces), groups.build()
    below = [piece.triangles[..., :2].astype(np.float64) for piece in pieces]
    for piece, x, y in feet:
        below[piece][:] = x, y
    raised = joined(pieces)
    raised = raised._replace(triangles=land.raised(raised.triangles, np.concatenate(below)))
    groups.add_none(len(land.ground.rgb), GROUND)
    return joined([raised, land.ground]), groups.build(land.height)


def _tree(p: WorldParams, x: float, y: float, size: float, tone: float, rng: np.random.Generator) -> Plant:
    """A tree of some height (m) that stands at a position (m), whose distance from the field decides its haze."""
    field = p.field
    haze = p.haze_at(max(field.x_min - x, x - field.x_max, field.y_min - y, y - field.y_max, 0.0))
    return (branching_tree if p.tree_forks else tree)(p, size, tone, rng, haze)


def seeded(seed: int) -> np.random.Generator:
    """The generator of a seed. Raises SettingError for a seed that is not a whole number from 0."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise SettingError(f"the seed is {seed!r}; give a whole number from 0")
    return np.random.default_rng(int(seed))


def streams_of(seed: int) -> Streams:
    """The generators of a world, by what they are for. Raises SettingError as `seeded` does."""
    return dict(zip(STREAMS, seeded(seed).spawn(len(STREAMS)), strict=True))


def plant_layout(params: WorldParams, seed: int) -> tuple[Layout, Streams]:
    """Where every plant, stone and tree of a world is, by kind, and the generator for the shapes of each kind."""
    streams = streams_of(seed)
    p, land = params, streams["land"]
    fertility, tone = random_field(p.patch_size, land), random_field(2 * p.patch_size, land)
    open_ground = _open_ground(p, land)
    area = p.field.widened(p.border)

    def rows_of(kind: str, density: float, size: float, spread: float, apart: float = 0.0, clustered: bool = True):
        rng = streams[kind]
        count = round(density * area.size[0] * area.size[1])
        xy = _scatter(count, area, fertility if clustered else None, open_ground, apart, p, rng)
        sizes = size * np.clip(rng.lognormal(0, spread, count), 0.4, 2.1)
        return np.column_stack([xy, sizes, 0.5 + 0.5 * np.tanh(1.5 * tone(xy))])

    layout = {
        "bush": rows_of("bush", p.bush_density, p.bush_height, p.size_spread, p.bush_height),
        "stone": rows_of("stone", p.stone_density, p.stone_size, 1.4 * p.size_spread, p.stone_size),
        "tussock": rows_of("tussock", p.tussock_density, p.tussock_height, p.size_spread, 0.7 * p.tussock_height),
        "grass": rows_of("grass", p.grass_density, p.grass_height, p.size_spread),
        "leaf": rows_of("leaf", p.leaf_density, p.leaf_length, 0.25, clustered=False),
        "tree": _skyline(p, streams["tree"]),
        "herb": rows_of("herb", p.herb_density, p.herb_height, p.size_spread),
        "culm": rows_of("culm", p.culm_density, p.culm_height, 0.5 * p.size_spread),
        "litter": _scattered(p.litter_density, p.litter_length, area, streams["litter"]),
        "inner_tree": rows_of("inner_tree", p.tree_density, p.tree_height, 0.5 * p.size_spread, 0.25 * p.tree_height),
        "pebble": _scattered(p.pebble_density, p.pebble_size, area, streams["pebble"]),
    }
    _move_to_tussocks(layout["grass"], layout["tussock"], p.grass_near_tussocks, streams["grass"])
    return layout, streams


def _scatter(
    count: int,
    area: Bounds,
    fertility: PlaneFunction | None,
    open_ground: PlaneFunction,
    apart: float,
    p: WorldParams,
    rng: np.random.Generator,
) -> Float[np.ndarray, "n 2"]:
    """Positions of plants in clusters on fertile ground, or evenly scattered if there is no `fertility`.

    They are `apart` metres from each other, and off the open ground, unless there is no other room for all of them.
    """
    low = np.array(area[:2])
    clusters = max(1, round(count / p.cluster_plants))
    parents = low + area.size * rng.random((20 * clusters, 2))
    if fertility is not None:
        weight = np.exp(p.patchiness * fertility(parents)) * (1e-3 + 1 - open_ground(parents))
        parents = parents[rng.choice(len(parents), clusters, p=weight / weight.sum())]
    kept = np.zeros((0, 2))
    for attempt in range(60):
        xy = low + area.size * rng.random((4 * count, 2))
        if fertility is not None and attempt < 40:
            in_cluster = rng.random(len(xy)) < 0.85  # the others are alone
            around = parents[rng.integers(clusters, size=len(xy))] + rng.normal(0, p.cluster_radius, xy.shape)
            xy = np.where(in_cluster[:, None], around, xy)
        free = area.contains(xy[:, 0], xy[:, 1]) & (rng.random(len(xy)) >= open_ground(xy) * (attempt < 20))
        kept = _thinned(np.concatenate([kept, xy[free]]), count, apart * (attempt < 20))
        if len(kept) == count:
            break
    return kept


def _thinned(xy, count: int, apart: float) -> Float[np.ndarray, "n 2"]:
    """The first `count` points, without those that are within `apart` metres of an earlier one."""
    if apart == 0:
        return xy[:count]
    cells = (
        np.floor(xy / (1.001 * apart)).astype(int).tolist()
    )  # what is within `apart` of a point is in a cell next to its own
    kept: list[int] = []
    kept_in: dict[tuple[int, int], list[int]] = {}
    for i, (column, row) in enumerate(cells):
        if len(kept) == count:
            break
        near = [k for dx in (-1, 0, 1) for dy in (-1, 0, 1) for k in kept_in.get((column + dx, row + dy), ())]
        if not near or (np.hypot(*(xy[near] - xy[i]).T) > apart).all():
            kept.append(i)
            kept_in.setdefault((column, row), []).append(i)
    return xy[kept]


def _scattered(density: float, size: float, area: Bounds, rng: np.random.Generator) -> Float[np.ndarray, "n 4"]:
    """Rows of the litter and of pebbles: anywhere, on open ground as well."""
    count = round(density * area.size[0] * area.size[1])
    xy = np.array(area[:2]) + area.size * rng.random((count, 2))
    sizes = size * np.clip(rng.lognormal(0, 0.4, count), 0.4, 2.1)
    return np.column_stack([xy, sizes, rng.random(count)])


def _move_to_tussocks(grass, tussocks, share: float, rng: np.random.Generator) -> None:
    """Move a share of the grass (rows of a layout, changed in place) to the feet of tussocks, more to the taller ones."""
    moved = np.flatnonzero(rng.random(len(grass)) < share)
    if len(tussocks) == 0 or len(moved) == 0:
        return
    host = tussocks[rng.choice(len(tussocks), len(moved), p=tussocks[:, 2] / tussocks[:, 2].sum())]
    angle, distance = rng.uniform(-np.pi, np.pi, len(moved)), host[:, 2] * (0.25 + rng.gamma(1.5, 0.22, len(moved)))
    grass[moved, :2] = host[:, :2] + np.column_stack([distance * np.cos(angle), distance * np.sin(angle)])
    grass[moved, 2] *= 1.25  # tussocks shelter it
    grass[moved, 3] = host[:, 3]


def _skyline(p: WorldParams, rng: np.random.Generator) -> Float[np.ndarray, "n 4"]:
    """Rows of the trees: an irregular ring with gaps, whose heights and kinds vary with the direction."""
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    density, tallness, kind = (random_ring(angles, rng) for _ in range(3))
    weight = np.clip(density - np.quantile(density, p.tree_gaps), 0, None) ** 0.6 + 1e-9
    order = (np.arange(p.trees) + rng.random(p.trees)) / max(p.trees, 1)
    angle = np.interp(order, np.cumsum(weight) / weight.sum(), angles)
    nearest = np.searchsorted(angles, angle).clip(0, 719)
    height = p.tree_height * np.clip(np.exp(0.45 * tallness[nearest]) * rng.lognormal(0, 0.22, p.trees), 0.42, 1.6)
    width, depth = p.field_width / 2, p.field_depth / 2
    to_edge = np.minimum(
        width / np.maximum(np.abs(np.cos(angle)), 1e-9), depth / np.maximum(np.abs(np.sin(angle)), 1e-9)
    )
    distance = to_edge + p.tree_distance * np.clip(rng.lognormal(0, 0.6, p.trees), 0.4, 4) + 0.4 * height
    xy = np.column_stack([width + distance * np.cos(angle), depth + distance * np.sin(angle)])
    tone = np.clip(0.5 + 0.5 * np.tanh(2 * kind[nearest]) + rng.normal(0, 0.12, p.trees), 0, 1)
    return np.column_stack([xy, height, tone])


def _open_ground(p: WorldParams, rng: np.random.Generator) -> PlaneFunction:
    """Where nothing grows: 1 in clearings and corridors, 0 outside, smooth at their edges.

    Corridors follow the zero contours of a smooth random field, which wind through the whole field and never end inside it.
    """
    centres = rng.random((p.clearings, 2)) * [p.field_width, p.field_depth]
    radius = p.clearing_radius * rng.lognormal(0, 0.3, p.clearings)
    scale = 0.3 * min(p.field_width, p.field_depth)
    waves, phase, ragged = rng.normal(0, 1 / scale, (2, 12)), rng.uniform(0, 2 * np.pi, 12), random_field(0.4, rng)

    def share(xy):
        angle = xy @ waves + phase
        slope = np.hypot(*(-np.sin(angle) @ waves.T).T)
        to_corridor = np.abs(np.cos(angle).sum(axis=1)) / np.maximum(slope, 1e-9) - p.corridor_width / 2
        to_clearings = np.hypot(*np.moveaxis(xy[:, None] - centres, -1, 0)) - radius
        edge = np.minimum(to_corridor, to_clearings.min(axis=1, initial=np.inf)) + 0.06 * ragged(xy)
        return np.clip(0.5 - edge / 0.12, 0, 1) if p.corridor_width or p.clearings else np.zeros(len(xy))

    return share
