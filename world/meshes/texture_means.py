"""The mean colour of textures over triangles, for maps, recordings, and whatever else shows one colour per triangle."""

import numpy as np
from jaxtyping import Float32, UInt8

from ..textures import Texture, Texturing

_SIDES = (4, 16)  # samples along a side, for triangles of few texels and of many
_FEW = 4.0  # texels across


def mean_rgb(texturing: Texturing) -> UInt8[np.ndarray, "n 3"]:
    """The mean texel of each triangle (holes aside, if there is anything else); white where it has no texture."""
    means = np.full((len(texturing.index), 3), 255, dtype=np.uint8)
    for number, texture in enumerate(texturing.textures):
        size = np.array(texture.rgba.shape[1::-1])
        few = (np.ptp(texturing.uv, axis=1) * size).max(axis=1) <= _FEW
        for chosen, side in ((few, _SIDES[0]), (~few, _SIDES[1])):
            chosen = np.flatnonzero(chosen & (texturing.index == number))
            for part in np.array_split(chosen, len(chosen) // 100_000 + 1):
                means[part] = _means(texture, texturing.uv[part], side)
    return means


def _means(texture: Texture, uv: Float32[np.ndarray, "n 3 2"], side: int) -> UInt8[np.ndarray, "n 3"]:
    """Mean texels over triangles, from side^2 samples of each."""
    i, j = np.indices((side, side)).reshape(2, -1)
    corner = (np.array([i, j]) + 1 / 3)[:, i + j < side], (np.array([i, j]) + 2 / 3)[:, i + j < side - 1]
    corner = np.concatenate(corner, axis=1) / side  # the middles of side^2 equal triangles, upright and upside down
    weights = np.stack([1 - corner.sum(axis=0), *corner])  # (3, side^2)
    seen, everything, count = np.zeros((len(uv), 3)), np.zeros((len(uv), 3)), np.zeros((len(uv), 1))
    height, width = texture.rgba.shape[:2]
    for weight in weights.T:
        at = np.tensordot(uv.astype(float), weight, axes=(1, 0))  # (n, 2)
        x, y = wrapped(at[:, 0], width, texture.wrap[0]), wrapped(at[:, 1], height, texture.wrap[1])
        texels = texture.rgba[y, x]
        opaque = texels[:, 3:] >= texture.threshold
        seen, everything, count = seen + texels[:, :3] * opaque, everything + texels[:, :3], count + opaque
    return np.rint(np.where(count > 0, seen / np.maximum(count, 1), everything / side**2)).astype(np.uint8)


def wrapped(places: np.ndarray, size: int, wrap: str) -> np.ndarray:
    """The texels (0 to size - 1) that stand at texture coordinates along one axis."""
    texels = np.floor(places * size).astype(np.int64)
    if wrap == "repeat":
        return texels % size
    if wrap == "mirror":
        texels %= 2 * size
        return np.minimum(texels, 2 * size - 1 - texels)
    return texels.clip(0, size - 1)
