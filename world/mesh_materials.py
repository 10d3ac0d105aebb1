"""Colours of meshes that trimesh has read: one per triangle, from its corners, its material or its texture."""

from typing import Any

import numpy as np
from jaxtyping import Float, Float32, UInt8

from .errors import FileError
from .settings import MAX_COORDINATE


def texture_of(mesh) -> Any:
    """The image that a mesh is textured with, or None."""
    if mesh.visual.kind != "texture" or mesh.visual.uv is None:
        return None
    material = mesh.visual.material
    image = getattr(material, "baseColorTexture", None)
    return image if image is not None else getattr(material, "image", None)


def texture_factor(mesh) -> Float[np.ndarray, "3"]:
    """What the texture of a mesh is multiplied by, 0..1 (glTF's baseColorFactor; 1 where a material has none)."""
    factor = getattr(mesh.visual.material, "baseColorFactor", None)
    if factor is None:
        return np.ones(3)
    factor = np.asarray(factor)[:3]
    return factor / 255 if factor.dtype.kind in "ui" else factor.astype(float)


def face_rgb(mesh) -> UInt8[np.ndarray, "n 3"]:
    """One colour per triangle: its own, the mean of its corners', or the mean of its texture over it.

    Raises FileError for texture coordinates that are not finite.
    """
    image = texture_of(mesh)
    if image is not None:
        if not (np.abs(mesh.visual.uv) <= MAX_COORDINATE).all():
            raise FileError(f"a texture coordinate is not finite, or over {MAX_COORDINATE:g}; repair the mesh")
        mean = _mean_of_texture(np.asarray(image.convert("RGB")), mesh.visual.uv[mesh.faces].astype(np.float32))
        return np.rint(mean * texture_factor(mesh)).astype(np.uint8)
    if mesh.visual.kind == "texture":
        return np.tile(np.asarray(mesh.visual.material.main_color[:3], dtype=np.uint8), (len(mesh.faces), 1))
    if mesh.visual.kind == "vertex":
        corners = np.asarray(mesh.visual.vertex_colors)[mesh.faces, :3]
        return np.rint(corners.mean(axis=1)).astype(np.uint8)
    return np.asarray(mesh.visual.face_colors)[:, :3].astype(np.uint8)


def _mean_of_texture(
    image: UInt8[np.ndarray, "h w 3"], uv: Float32[np.ndarray, "n 3 2"], side: int = 16
) -> UInt8[np.ndarray, "n 3"]:
    """Mean colour of an image over triangles in texture space (u right, v up, both wrap), from side^2 samples of each."""
    steps = (np.arange(side) + 0.5) / side
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    corner = np.where(u + v > 1, [1 - u, 1 - v], [u, v]).astype(np.float32)  # the square folded onto the triangle
    weights = np.stack([1 - corner.sum(axis=0), *corner])  # (3, side^2)
    total = np.zeros((len(uv), 3))
    height, width = image.shape[:2]
    for weight in weights.T:
        at = np.tensordot(uv, weight, axes=(1, 0))  # (n, 2)
        x = np.floor(at[:, 0] % 1 * width).astype(int).clip(0, width - 1)
        y = np.floor((1 - at[:, 1]) % 1 * height).astype(int).clip(0, height - 1)
        total += image[y, x]
    return np.rint(total / side**2).astype(np.uint8)
