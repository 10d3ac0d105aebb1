"""Pebbles on the ground of a generated world: small flat stones. Colours include sunlight."""

import numpy as np
from jaxtyping import Float, Int

from .params import WorldParams
from .plant_parts import Plant, sunlit

CORNERS = 5  # of a pebble's outline
THICKNESS = (0.15, 0.32)  # in widths of a pebble
TOP = 0.6  # width of its top, in widths of the pebble


def pebbles(
    p: WorldParams, rows: Float[np.ndarray, "pebbles 4"], rng: np.random.Generator
) -> tuple[Plant, Int[np.ndarray, " n"]]:
    """Pebbles with sloping sides and an uneven top. A pebble that is lower than STEP_HEIGHT of terrain.py is walked over.

    Args:
        p: Parameters of the world.
        rows: x, y, width (m) and tone of each: from 0 to 1, their colour goes from that of stones to that of the ground.
        rng: Generator to draw from.

    Returns:
        All pebbles, and the row of each triangle.
    """
    n = len(rows)
    angle = np.arange(CORNERS) * 2 * np.pi / CORNERS + rng.uniform(-0.4, 0.4, (n, CORNERS)) + rng.uniform(0, 6, (n, 1))
    long, turn = rng.uniform(1.0, 1.5, (n, 1)), rng.uniform(0, np.pi, (n, 1))
    reach = (
        rows[:, 2:3] / 2 * rng.uniform(0.8, 1.1, (n, CORNERS)) * np.where(np.cos(angle - turn) ** 2 > 0.5, long, 1.0)
    )
    outline = reach[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    height = rows[:, 2:3] * rng.uniform(*THICKNESS, (n, 1)) * rng.uniform(0.75, 1.0, (n, CORNERS))
    low = np.concatenate([rows[:, None, :2] + outline, np.zeros((n, CORNERS, 1))], axis=2)
    high = np.concatenate([rows[:, None, :2] + TOP * outline, height[..., None]], axis=2)
    following, above = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    fan = [np.stack([high[:, 0], high[:, i], high[:, i + 1]], axis=1) for i in range(1, CORNERS - 1)]
    sides = [np.stack([low, following, above], axis=2), np.stack([low, above, high], axis=2)]
    triangles = np.concatenate([*sides, np.stack(fan, axis=1)], axis=1)
    share = 0.6 * rows[:, 3:]
    rgb = (np.array(p.stone_rgb) * (1 - share) + np.array(p.ground_rgb) * share) * rng.lognormal(0, 0.16, (n, 1))
    each = triangles.shape[1]
    return sunlit(triangles.reshape(-1, 3, 3), rgb.repeat(each, axis=0)), np.arange(n).repeat(each)
