"""A picture of what a compound eye sees: each ommatidium as the part of the sphere that is nearer to it than to others, unwrapped."""

import numpy as np
from jaxtyping import Float, Int64, UInt8
from scipy.spatial import KDTree

from .eye import Eye
from .ommatidia import EITHER, LEFT, RIGHT, Ommatidia
from .receptors import receptors_of

WIDTH = 1440  # of a picture, in pixels
CORNER = 0.7  # of the distance to its fifth neighbour, as far as a facet reaches; a hexagon's corner is at 0.577 of it
FEW = 6  # ommatidia that have too few neighbours to be facets: each is a disc, as wide as its acceptance angle
LINE = 0.7  # brightness at the edge of a facet
NOWHERE = -1  # no ommatidium looks there


def draw_ommatidia(view: UInt8[np.ndarray, "height width 4"], eye: Eye) -> UInt8[np.ndarray, "rows columns 4"]:
    """What the ommatidia of an eye see, as facets: ahead in the middle, left on the left; black, and no alpha, where none looks.

    Where both eyes look at a place, the one of that side is shown.

    Args:
        view: The panorama that the eye looks at (uint8, red, green, blue and alpha).
        eye: A compound eye.
    """
    assert eye.compound is not None
    facets = _facets(eye.compound.ommatidia(), eye.top, eye.bottom)
    channels = np.moveaxis(view, -1, 0).astype(np.float32)
    seen = np.rint(receptors_of(eye).seen(channels)).astype(np.uint8).T
    seen[~eye.ommatidia_in_field()] = 0
    picture = np.concatenate([seen, np.zeros((1, 4), np.uint8)])[facets]  # the last one for NOWHERE
    edge = np.zeros(facets.shape, dtype=bool)
    edge[:-1] |= facets[:-1] != facets[1:]
    edge |= facets != np.roll(facets, -1, axis=1)
    picture[edge, :3] = np.rint(LINE * picture[edge, :3]).astype(np.uint8)
    return picture


def _facets(eyes: Ommatidia, top: float, bottom: float) -> Int64[np.ndarray, "rows columns"]:
    """The ommatidium that each pixel of a picture shows, or NOWHERE."""
    elevation = top - (np.arange(round(WIDTH * (top - bottom) / (2 * np.pi))) + 0.5) * 2 * np.pi / WIDTH
    azimuth = np.pi - (np.arange(WIDTH) + 0.5) * 2 * np.pi / WIDTH
    pixels = _directions(*np.meshgrid(azimuth, elevation)).reshape(-1, 3)
    of_eye = {side: _nearest(eyes, side, pixels) for side in (LEFT, RIGHT, EITHER)}
    left = np.broadcast_to(azimuth > 0, (len(elevation), WIDTH)).reshape(-1)
    facets = np.where(left, of_eye[LEFT], of_eye[RIGHT])
    for other in (of_eye[LEFT], of_eye[RIGHT], of_eye[EITHER]):
        facets = np.where(facets == NOWHERE, other, facets)
    return facets.reshape(len(elevation), WIDTH)


def _nearest(eyes: Ommatidia, side: int, pixels: Float[np.ndarray, "p 3"]) -> Int64[np.ndarray, " p"]:
    """For each direction the ommatidium of a side whose facet it is in, or NOWHERE."""
    (these,) = np.nonzero(eyes.side == side)
    if len(these) == 0:
        return np.full(len(pixels), NOWHERE)
    directions = _directions(eyes.azimuth[these], eyes.elevation[these])
    tree = KDTree(directions)
    if len(these) <= FEW:
        distance, index = tree.query(pixels)
        return np.where(distance <= eyes.acceptance[these][index] / 2, these[index], NOWHERE)
    apart = tree.query(directions, k=6)[0][:, -1]  # the nearest is the ommatidium itself
    distance, index = tree.query(pixels)
    return np.where(distance <= CORNER * apart[index], these[index], NOWHERE)


def _directions(azimuth: Float[np.ndarray, "*n"], elevation: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 3"]:
    """Unit vectors: ahead, to the left, up."""
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)
