"""What meshes that trimesh has read look like: one mean colour per triangle, and where that is not all, a `Texturing`.

The rules:

- glTF: the colour of a place is the product, in linear light, of the material's factor, its texture, and the colours of the corners.
  Without any of these it is white. Corner colours in 8 bits are taken as display colours (sRGB): the standard says linear, but the
  programs that write them in 8 bits (trimesh, MeshLab, CloudCompare, Open3D) write display colours. In 16 bits or floats, as
  Blender writes them, they are linear.
- OBJ: map_Kd times Kd, in display colours. Colours of vertices are drawn in place of Kd; where there is a texture, it is drawn alone.
- PLY, STL and others: the colours of vertices or triangles in display colours; white without any.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, UInt8

from ..errors import FileError
from ..settings import MAX_COORDINATE
from ..textures import Texture, Texturing, product_table, to_display
from .gltf_materials import COLOURS, UV, as_material, carried_material
from .materials import Material
from .obj_materials import obj_material
from .stl_colours import stl_colours
from .texture_means import mean_rgb

log = logging.getLogger(__name__)

_WHITE = np.full((1, 1, 4), 255, dtype=np.uint8)


@dataclass(eq=False)
class _Covering:
    """What covers the triangles of a mesh.

    Attributes:
        material: Its image is drawn where `uv` is not None.
        colours: (n, 3, 4) of the corners; the material's factor is in them where `uv` is None.
        uv: (n, 3, 2) texture coordinates, v down, or None.
    """

    material: Material
    colours: UInt8[np.ndarray, "n 3 4"]
    uv: Float32[np.ndarray, "n 3 2"] | None = None

    def __post_init__(self):
        if self.material.alpha == "opaque":
            self.colours = _opaque(self.colours)


def appearance_of(
    meshes: Sequence[Any], path: Path, get: Callable[[str], bytes] | None = None
) -> tuple[UInt8[np.ndarray, "n 3"], Texturing | None]:
    """The mean colours of the triangles of meshes, and their textures.

    Args:
        meshes: Meshes of trimesh, from a file that `prepared_gltf` or `prepared_obj` has prepared.
        path: The file, for remarks about what is not drawn.
        get: Gives the content of a file next to it, or raises OSError.

    Returns:
        (n, 3) colours, and the texturing; None where these colours are all there is.

    Raises:
        FileError: A texture or texture coordinates cannot be used.
    """
    if not meshes:
        return np.empty((0, 3), np.uint8), None
    coverings = [_covering(mesh, path, get) for mesh in meshes]
    textures, numbers = _textures_of(coverings)
    _warn(coverings, textures, path)
    colours = np.concatenate([covering.colours for covering in coverings])
    index = np.repeat(numbers, [len(covering.colours) for covering in coverings]).astype(np.int32)
    means = np.rint(colours[..., :3].mean(axis=1)).astype(np.uint8)
    varied = (colours[..., :3] != colours[:, :1, :3]).any(axis=(1, 2))
    white = (colours == 255).all(axis=(1, 2))
    needed = np.where(
        index < 0, varied, ~white
    ).any()  # of the colours: the texture's, or the mean, are not all there is
    if not textures and not needed:
        return means, None
    none = np.zeros((1, 3, 2), np.float32)
    uv = [np.repeat(none, len(each.colours), axis=0) if each.uv is None else each.uv for each in coverings]
    texturing = Texturing(
        textures=tuple(textures), index=index, uv=np.concatenate(uv), colours=colours if needed else None
    )
    return product_table()[means, mean_rgb(texturing)], texturing


def _textures_of(coverings: Sequence[_Covering]) -> tuple[list[Texture], list[int]]:
    """The textures of meshes, each once, and the number of each mesh's texture, or -1."""
    textures: list[Texture] = []
    known: dict[Any, int] = {}
    numbers = []
    for covering in coverings:
        material, opaque = covering.material, bool((covering.colours[..., 3] == 255).all())
        if covering.uv is not None:
            key = id(covering) if material.key is None else (material.key, opaque, *material.settings)
        elif not opaque:
            key = "white", material.alpha, material.cutoff
        else:
            numbers.append(-1)
            continue
        if key not in known:
            known[key] = len(textures)
            white = Texture(rgba=_WHITE, alpha=material.alpha, cutoff=material.cutoff)
            texture = white if covering.uv is None else material.texture()
            if opaque and texture.rgba[..., 3].min() == 255:
                texture = replace(texture, alpha="opaque")
            textures.append(texture)
        numbers.append(known[key])
    return textures, numbers


def _covering(mesh: Any, path: Path, get: Callable[[str], bytes] | None) -> _Covering:
    """What covers a mesh."""
    faces, attributes, visual = mesh.faces, mesh.vertex_attributes, mesh.visual
    white = np.full((len(faces), 3, 4), 255, dtype=np.uint8)
    if visual.kind != "texture":
        if visual.kind == "vertex":
            return _Covering(Material(), np.asarray(visual.vertex_colors)[faces])
        colours = stl_colours(mesh.face_attributes["stl"], path) if "stl" in mesh.face_attributes else None
        if colours is None and not visual.defined:  # trimesh would show grey; glTF, by its standard, white
            return _Covering(Material(), white)
        colours = np.asarray(visual.face_colors) if colours is None else colours
        return _Covering(Material(), np.repeat(colours[:, None], 3, axis=1))
    carried = carried_material(visual.material.name)
    if carried is not None:  # glTF
        material = as_material(carried, visual.material.baseColorTexture)
        colours = _display_bytes(attributes[COLOURS], linear=True)[faces] if COLOURS in attributes else white
        if material.image is None or UV not in attributes:
            return _Covering(material, material.times(colours))
        return _Covering(material, colours, _corners_uv(attributes[UV], faces, material))
    material = obj_material(visual.material, get) if hasattr(visual.material, "kwargs") else _other(visual.material)
    coloured = len(attributes.get("color", ())) == len(mesh.vertices)
    if material.image is not None and visual.uv is not None:
        if coloured:
            material = replace(material, lost=(*material.lost, "colours of vertices that also have a texture"))
        return _Covering(material, white, _corners_uv(visual.uv * [1, -1] + [0, 1], faces, material))
    if coloured:  # in place of Kd
        material = replace(material, factor=np.array([1, 1, 1, material.factor[3]]))
        return _Covering(material, material.times(_display_bytes(attributes["color"], linear=False)[faces]))
    return _Covering(material, material.times(white))


def _other(material: Any) -> Material:
    """The material of another format, as far as trimesh knows it."""
    factor = np.asarray(material.main_color, dtype=float) / 255
    return Material(image=getattr(material, "baseColorTexture", None), factor=factor, linear=True, alpha="blend")


def _display_bytes(colours: Any, *, linear: bool) -> UInt8[np.ndarray, "n 4"]:
    """Colours as display colours in bytes, opaque where they have no alpha.

    linear: whether those in 16 bits or floats are in linear light.
    """
    colours = np.asarray(colours)
    if colours.dtype != np.uint8:
        most = np.iinfo(colours.dtype).max if colours.dtype.kind in "iu" else 1.0
        if colours.dtype.kind == "f" and not linear and np.nanmax(colours, initial=0) > 1:
            most = 255.0  # some programs write 0..255
        share = np.clip(np.nan_to_num(colours.astype(float)) / most, 0, 1)
        if linear:
            share[:, :3] = to_display(share[:, :3])
        colours = np.rint(255 * share).astype(np.uint8)
    return colours if colours.shape[1] == 4 else np.column_stack([colours, np.full(len(colours), 255, np.uint8)])


def _corners_uv(uv: Float[np.ndarray, "m 2"], faces: np.ndarray, material: Material) -> Float32[np.ndarray, "n 3 2"]:
    """Texture coordinates of the corners, transformed, and moved by whole pictures to where float32 is precise."""
    uv = np.asarray(uv, dtype=float) @ material.transform[:, :2].T + material.transform[:, 2]
    if not (np.abs(uv) <= MAX_COORDINATE).all():  # False for nan
        raise FileError(f"a texture coordinate is not finite, or over {MAX_COORDINATE:g}; repair the mesh")
    corners = uv[faces]
    period = np.array([{"repeat": 1.0, "mirror": 2.0, "clamp": np.inf}[wrap] for wrap in material.wrap])
    pictures = np.where(np.isfinite(period), np.floor(corners.min(axis=1, keepdims=True) / period), 0.0)
    return (corners - pictures * np.where(np.isfinite(period), period, 0.0)).astype(np.float32)


def _opaque(colours: UInt8[np.ndarray, "n 3 4"]) -> UInt8[np.ndarray, "n 3 4"]:
    return np.concatenate([colours[..., :3], np.full((*colours.shape[:2], 1), 255, np.uint8)], axis=-1)


def _warn(coverings: Sequence[_Covering], textures: Sequence[Texture], path: Path) -> None:
    """Log what other programs show of the file and the renderers do not, once each."""
    losses = {loss: covering.material.name for covering in reversed(coverings) for loss in covering.material.lost}
    for loss, name in losses.items():
        log.warning(f"{path}: not drawn: {loss}" + (f" (material {name!r})" if name else ""))
    alphas = [texture.rgba[..., 3] for texture in textures if texture.alpha == "blend"]
    alphas += [each.colours[..., 3] for each in coverings if each.uv is None and each.material.alpha == "blend"]
    if any(np.mean((alpha > 25) & (alpha < 230)) > 0.1 for alpha in alphas if alpha.size):
        log.warning(
            f"{path}: some surfaces are translucent; those that are at least half opaque are drawn as opaque, the others not at all"
        )
