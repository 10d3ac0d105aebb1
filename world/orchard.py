"""An orchard: single trees on open ground, as in the forests that Bee-Nav (2026) was tested in."""

import numpy as np
from jaxtyping import Float

from .errors import SettingError
from .generate import seeded
from .geometry import Bounds
from .params import WorldParams
from .plant_groups import GroupsBuilder
from .plant_parts import NO_PLANT, joined
from .plants import tree
from .scene import Ground, World

CLEAR, AROUND, MAX_AROUND = (
    5.0,
    10.0,
    3,
)  # no tree within CLEAR of the middle (m), and at most MAX_AROUND within AROUND (m)
GROUND_MARGIN = 400.0  # m beyond the field
ATTEMPTS = 100_000


def orchard(seed: int, trees: int = 15, reach: float = 50.0, apart: float = 5.0, height: float = 6.0) -> World:
    """Trees at random positions about the middle, (0, 0), which is kept clear: where home is.

    Args:
        seed: A whole number from 0.
        trees: Their number.
        reach: They stand within this distance of the middle, east, west, north and south (m); so wide is the field.
        apart: Least distance between two of them (m).
        height: Their median height (m).

    Raises:
        SettingError: For invalid values, and where the trees do not fit.
    """
    for name, value, low in (("trees", trees, 0), ("reach", reach, 1), ("apart", apart, 0), ("height", height, 0.2)):
        kind = "whole number" if name == "trees" else "number"
        if isinstance(value, bool) or not isinstance(value, int if name == "trees" else int | float):
            raise SettingError(f"the orchard's {name} is {value!r}; give a {kind}")
        if not low <= value < np.inf:
            raise SettingError(f"the orchard's {name} is {value!r}; give a {kind} from {low:g}")
    land, shapes = seeded(seed).spawn(2)
    params, pieces, groups = WorldParams(), [NO_PLANT], GroupsBuilder()
    for x, y in _positions(trees, float(reach), float(apart), land).tolist():
        size, tone = height * float(np.clip(land.lognormal(0, 0.25), 0.6, 1.6)), float(land.random())
        piece = tree(params, size, tone, shapes)
        groups.add("tree", np.array([(x, y)]), np.zeros(len(piece.rgb), np.int64))
        pieces.append(piece._replace(triangles=piece.triangles + np.array([x, y, 0], np.float32)))
    field = Bounds(-float(reach), -float(reach), float(reach), float(reach))
    return World(
        **joined(pieces)._asdict(),
        plants=groups.build(),
        ground=Ground((150, 158, 96), field.widened(GROUND_MARGIN)),
        sky_rgb=params.sky_rgb,
        field=field,
        origin={
            "preset": "orchard",
            "seed": int(seed),
            "trees": trees,
            "reach": reach,
            "apart": apart,
            "height": height,
        },
    )


def _positions(trees: int, reach: float, apart: float, land: np.random.Generator) -> Float[np.ndarray, "n 2"]:
    """Where trees stand (m): evenly spread, each far enough from the others and from the middle."""
    kept = np.zeros((0, 2))
    for _ in range(ATTEMPTS):
        if len(kept) == trees:
            return kept
        xy = land.uniform(-reach, reach, 2)
        middle = np.hypot(*xy)
        crowded = middle < AROUND and (np.hypot(*kept.T) < AROUND).sum() >= MAX_AROUND
        if middle >= CLEAR and not crowded and (np.hypot(*(kept - xy).T) >= apart).all():
            kept = np.vstack([kept, xy])
    raise SettingError(
        f"no room for {trees} trees within {reach:g} m and {apart:g} m apart; give fewer, or less distance"
    )
