"""What ommatidia see: a compound eye is a sparse matrix over a fine panorama.

An ommatidium in the direction o with the acceptance angle a sees the mean of the pixels p, with the weights

    cos(elevation of p) exp(-d^2 / (2 s^2)),  s = a / 2.355,  d the angle between p and o,

of sum 1. When the eye turns by one of `width` equal steps, it sees this of the panorama that is rolled by as many columns. So what an
ommatidium sees at all turns is one row of numbers, and those that look equally high, with the same acceptance and at azimuths that are
whole steps apart, share that row: they are some of its pixels. What all see at all turns is an image (rows, width), and a mask says
where in it there are ommatidia. It turns with the eye as a panorama does, so models scan it as any view behind a mask
(navigation/feature_mask.py).
"""

import logging
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64

from tussock.world.errors import SettingError

from .compile import compiled
from .compound import FWHM, REACH, TURNS
from .eye import Eye

log = logging.getLogger(__name__)
COARSE = 3  # pixels in an acceptance angle, at least
EQUAL = 9  # decimals (of degrees) to which directions are equal


class Receptors(NamedTuple):
    """The matrix of an eye, by rows of its image from top to bottom.

    Attributes:
        width: Turns, and columns of the image.
        starts: (rows + 1,) Where the entries of each row begin in the arrays below.
        places: (entries,) Of a pixel of the panorama, for the first column of the image, in the order of `_in_steps`.
        weights: (entries,)
        row: (n,) The row of the image that each ommatidium is in.
        column: (n,) Its column there.
    """

    width: int
    starts: Int64[np.ndarray, " ends"]
    places: Int64[np.ndarray, " entries"]
    weights: Float32[np.ndarray, " entries"]
    row: Int64[np.ndarray, " n"]
    column: Int64[np.ndarray, " n"]

    def visible(self, these: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, "rows width"]:
        """Where the image has some of the ommatidia."""
        visible = np.zeros((len(self.starts) - 1, self.width), dtype=bool)
        visible[self.row[these], self.column[these]] = True
        return visible

    def images(self, panoramas: Float32[np.ndarray, "n height width"]) -> Float32[np.ndarray, "n rows turns"]:
        """What the ommatidia of each row see at all turns."""
        images = np.empty((len(panoramas), len(self.starts) - 1, self.width), np.float32)
        for panorama, image in zip(panoramas, images, strict=True):
            _respond(_in_steps(panorama, self.width), self.starts, self.places, self.weights, image)
        return images

    def seen(self, panoramas: Float32[np.ndarray, "n height width"]) -> Float32[np.ndarray, "n ommatidia"]:
        """What each ommatidium sees at the present heading."""
        return self.images(panoramas)[:, self.row, self.column]


@lru_cache(maxsize=16)
def receptors_of(eye: Eye) -> Receptors:
    """The matrix of a compound eye. Raises SettingError where its panorama is too coarse for an ommatidium."""
    assert eye.compound is not None
    azimuth, elevation, acceptance, _ = eye.compound.ommatidia()
    _remark_on_panorama(eye, elevation, acceptance)
    width = _turns(eye.width)
    place = (np.pi - azimuth) * width / (2 * np.pi) - 0.5
    off = np.round(place - np.rint(place), EQUAL)
    off[off == -0.5] = 0.5
    kinds, row = np.unique(
        np.round(np.stack([-np.degrees(elevation), np.degrees(acceptance), off]), EQUAL), axis=1, return_inverse=True
    )
    column = np.rint(place - off).astype(np.int64) % width
    entries = [
        _entries(eye, width, math.radians(-height), math.radians(spread), shift) for height, spread, shift in kinds.T
    ]
    counts = [len(weights) for *_, weights in entries]
    rows, columns, weights = (np.concatenate(each) for each in zip(*entries, strict=True))
    starts, step = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), eye.width // width
    places = (rows * step + columns % step) * 2 * width + columns // step
    return Receptors(width, starts, places, weights.astype(np.float32), row.reshape(-1), column)


def _remark_on_panorama(eye: Eye, elevation: Float[np.ndarray, " n"], acceptance: Float[np.ndarray, " n"]) -> None:
    """Warn of a panorama that is too coarse for its ommatidia, or ends within what they see."""
    pixel = max(2 * np.pi / eye.width, (eye.top - eye.bottom) / eye.height)
    if pixel > acceptance.min() / COARSE:
        log.warning(
            "a pixel of the panorama is %.2g degrees wide, and the narrowest acceptance angle %.2g: what ommatidia see is imprecise; "
            "give a larger size, or none",
            *np.degrees([pixel, acceptance.min()]),
        )
    reach = acceptance / 2
    low, high = max(eye.bottom, -np.pi / 2 + 1e-9), min(eye.top, np.pi / 2 - 1e-9)
    cut = ((elevation + reach > high) & (eye.top < np.pi / 2 - 1e-9)) | (
        (elevation - reach < low) & (eye.bottom > 1e-9 - np.pi / 2)
    )
    if cut.any():
        log.warning(
            "%d of %d ommatidia look at the edge of the panorama (%.3g to %.3g degrees), and see only what is inside; give wider edges, or "
            "none",
            cut.sum(),
            len(cut),
            *np.degrees([eye.bottom, eye.top]),
        )


def _turns(width: int) -> int:
    """Turns of an eye whose panorama has this width: the fewest from TURNS on that divide it."""
    return next((turns for turns in range(TURNS, width) if width % turns == 0), width)


def _entries(eye: Eye, width: int, elevation: float, acceptance: float, shift: float) -> tuple[np.ndarray, ...]:
    """Rows, columns and weights of the pixels that an ommatidium sees which looks at a place of the first column of the image."""
    azimuth = np.pi - (0.5 + shift) * 2 * np.pi / width
    heights, turns = eye.elevations(), np.pi - (np.arange(eye.width) + 0.5) * 2 * np.pi / eye.width
    deviation = acceptance / FWHM
    # |p - o|^2 = 4 sin^2(d / 2), by differences of angles, which round less than a product of vectors does.
    half = np.sin((heights - elevation) / 2)[:, None] ** 2
    half = half + np.cos(elevation) * np.cos(heights)[:, None] * np.sin((turns - azimuth) / 2) ** 2
    angle = 2 * np.arcsin(np.sqrt(half.clip(max=1)))
    rows, columns = np.nonzero(angle <= REACH * deviation)
    weights = np.cos(heights)[rows] * np.exp(-0.5 * (angle[rows, columns] / deviation) ** 2)
    if not len(weights):
        raise SettingError(
            f"an acceptance angle of {np.degrees(acceptance):g} degrees is finer than a pixel of the panorama; give a larger size"
        )
    return rows, columns, weights / weights.sum()


def _in_steps(panorama: Float32[np.ndarray, "height width"], turns: int) -> Float32[np.ndarray, " pixels"]:
    """A panorama so that a turn is the next number: by rows and by column within a step, all turns twice around."""
    height, width = panorama.shape
    parts = panorama.reshape(height, turns, width // turns).transpose(0, 2, 1)
    return np.concatenate([parts, parts], axis=2).reshape(-1)


@compiled
def _respond(panorama, starts, places, weights, image):
    """Write what is seen of a panorama (see `_in_steps`) into image (rows, turns)."""
    turns = image.shape[1]
    for row in range(len(starts) - 1):
        total = image[row]
        total[:] = 0.0
        for k in range(starts[row], starts[row + 1]):
            weight, part = weights[k], panorama[places[k] : places[k] + turns]
            for turn in range(turns):  # without branches, so that it is vectorised
                total[turn] += weight * part[turn]
