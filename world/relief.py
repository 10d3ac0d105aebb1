"""The relief of a generated world: how high its ground is, as a smooth function of position.

It is the sum of hills, mounds (as those of ants and moles) and ruts. Each draws from a generator of its own, so that changing one
leaves the others where they are.
"""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from .geometry import Bounds
from .params import WorldParams
from .random_fields import PlaneFunction, random_field

RUT_MARGIN = 2.0  # m around the field in which ruts become flat
SHOULDERS = 0.2  # height of the soil on both sides of a rut, in depths of the rut
BATCH = 100_000  # positions at once
LARGEST = 1.8  # of mounds and ruts, in shares of their median size


@dataclass(frozen=True, eq=False)
class Relief:
    """The height of the ground of a generated world.

    Attributes:
        hills: Heights of the hills (m) at positions (m).
        mounds: Likewise of the mounds.
        ruts: Likewise of the ruts; negative in a rut.
    """

    hills: PlaneFunction
    mounds: PlaneFunction
    ruts: PlaneFunction

    @classmethod
    def of(cls, p: WorldParams, rng: np.random.Generator) -> "Relief":
        """The relief of a world with these parameters, drawn from a generator."""
        hills, mounds, ruts = rng.spawn(3)
        return cls(_hills(p, hills), _mounds(p, mounds), _ruts(p, ruts))

    def height(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Height at positions (both m)."""
        return _in_batches(lambda part: self.hills(part) + self.mounds(part) + self.ruts(part), xy)

    def is_dug(self, xy: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Whether there are mounds or ruts at positions (m): bare soil, and small shapes."""
        return _in_batches(lambda part: np.abs(self.mounds(part)) + np.abs(self.ruts(part)), xy) > 0


def _in_batches(function: PlaneFunction, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """The values of a function at many positions (m), within a bounded memory."""
    parts = [function(xy[start : start + BATCH]) for start in range(0, len(xy), BATCH)]
    return np.concatenate([np.zeros(0), *parts])


def _none(xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Flat."""
    return np.zeros(len(xy))


def _hills(p: WorldParams, rng: np.random.Generator) -> PlaneFunction:
    """Hills and valleys."""
    field = random_field(p.hill_size, rng)
    return (lambda xy: 0.5 * p.hill_height * np.tanh(field(xy))) if p.hill_height else _none


def _mounds(p: WorldParams, rng: np.random.Generator) -> PlaneFunction:
    """Round mounds of one shape and several sizes, scattered over the field and its border. Where two meet, the higher one counts."""
    area = p.field.widened(p.border)
    count = round(p.mound_density * area.size[0] * area.size[1])
    if count == 0:
        return _none
    size = np.clip(rng.lognormal(0, 0.3, count), 0.5, LARGEST)
    phase, middle = rng.uniform(0, 2 * np.pi, count), np.array(area[:2]) + area.size * rng.random((count, 2))
    tree, widest = KDTree(middle), 0.6 * p.mound_width * size.max()

    def height(xy):
        near = tree.query_ball_point(xy, widest, return_sorted=True)
        point = np.repeat(np.arange(len(xy)), [len(each) for each in near])
        mound = np.fromiter(chain.from_iterable(near), np.int64, len(point))
        away = xy[point] - middle[mound]
        uneven = 1 + 0.12 * np.cos(3 * np.arctan2(away[:, 1], away[:, 0]) + phase[mound])
        share = np.hypot(*away.T) / (0.5 * p.mound_width * size[mound] * uneven)
        highest = np.zeros(len(xy))
        np.maximum.at(highest, point, p.mound_height * size[mound] * _bump(share))
        return highest

    return height


def _ruts(p: WorldParams, rng: np.random.Generator) -> PlaneFunction:
    """Ruts with low shoulders. They follow the zero contours of a smooth random field, which wind through the whole field."""
    if p.rut_depth == 0:
        return _none
    waves, phase = rng.normal(0, 1 / (0.4 * min(p.field_width, p.field_depth)), (2, 12)), rng.uniform(0, 2 * np.pi, 12)

    def height(xy):
        angle = xy @ waves + phase
        slope = np.hypot(*(-np.sin(angle) @ waves.T).T)
        share = np.abs(np.cos(angle).sum(axis=1)) / np.maximum(slope, 1e-9) / (p.rut_width / 2)
        shape = SHOULDERS * _bump(2 * (share - 1.5)) - _bump(share)
        return p.rut_depth * shape * _bump(_beyond(p.field, xy) / RUT_MARGIN)

    return height


def _bump(share: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """A smooth bump: 1 at 0, and 0 from 1 on, to both sides."""
    return (1 - np.minimum(share**2, 1)) ** 2


def _beyond(field: Bounds, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """How far positions are outside the field (both m); 0 inside."""
    x0, y0, x1, y1 = field
    x, y = xy.T
    return np.hypot(np.maximum(np.maximum(x0 - x, x - x1), 0), np.maximum(np.maximum(y0 - y, y - y1), 0))
