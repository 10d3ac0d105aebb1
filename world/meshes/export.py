"""The triangles of a world as meshes of trimesh, with their textures and colours, in their order."""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Int

from ..scene import World
from ..textures import Texture

_WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}  # of glTF samplers
_FILTERS = {"nearest": 9728, "linear": 9729}


def meshes_of(world: World) -> dict[str, Any]:
    """A mesh for each run of triangles with the same texture, by names in their order. Triangles share no corners."""
    return {f"{i:06d}": _mesh(world, run) for i, run in enumerate(_runs(world))}


def material_writer(world: World) -> Callable[[dict[str, Any]], None]:
    """A function that enters the materials of `meshes_of` into the JSON of a glTF file that trimesh makes of them.

    trimesh does not write samplers, and takes textures for equal that differ only in them.
    """
    numbers = {f"{i:06d}": _number(world, run) for i, run in enumerate(_runs(world))}

    def change(tree: dict[str, Any]) -> None:
        by_trimesh, written = tree.get("materials", []), {}
        for mesh in tree["meshes"]:
            number, primitive = numbers[mesh["name"]], mesh["primitives"][0]
            if number < 0 or world.texturing is None:
                continue
            if number not in written:
                image = by_trimesh[primitive["material"]]["pbrMetallicRoughness"]["baseColorTexture"]["index"]
                written[number] = _add_material(
                    tree, world.texturing.textures[number], tree["textures"][image]["source"]
                )
            primitive["material"] = written[number]["name"]
        if written:
            tree["materials"] = list(written.values())
            places = {material["name"]: i for i, material in enumerate(tree["materials"])}
            for mesh in tree["meshes"]:
                if "material" in mesh["primitives"][0]:
                    mesh["primitives"][0]["material"] = places[mesh["primitives"][0]["material"]]

    return change


def _add_material(tree: dict[str, Any], texture: Texture, image: int) -> dict[str, Any]:
    """A glTF material that shows a texture, whose entry and sampler are added to the file."""
    kind = _FILTERS[texture.filter]
    across, down = (_WRAPS[wrap] for wrap in texture.wrap)
    samplers = tree.setdefault("samplers", [])
    samplers.append({"magFilter": kind, "minFilter": kind, "wrapS": across, "wrapT": down})
    tree["textures"].append({"source": image, "sampler": len(samplers) - 1})
    base = {"baseColorTexture": {"index": len(tree["textures"]) - 1}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    alpha = {"alphaMode": texture.alpha.upper()} | ({"alphaCutoff": texture.cutoff} if texture.alpha == "mask" else {})
    return {"name": f"texture {len(samplers) - 1}", "pbrMetallicRoughness": base, "doubleSided": True} | alpha


def _runs(world: World) -> list[Int[np.ndarray, " n"]]:
    """Numbers of triangles that follow each other and have the same texture."""
    ends = [] if world.texturing is None else np.flatnonzero(np.diff(world.texturing.index)) + 1
    return np.split(np.arange(len(world.triangles)), ends)


def _number(world: World, run: Int[np.ndarray, " n"]) -> int:
    """The texture of a run, or -1."""
    return -1 if world.texturing is None else int(world.texturing.index[run[0]])


def _mesh(world: World, run: Int[np.ndarray, " n"]) -> Any:
    """A mesh of a run of triangles."""
    import trimesh
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    texturing, number = world.texturing, _number(world, run)
    corners, faces = world.triangles[run].reshape(-1, 3), np.arange(3 * len(run)).reshape(-1, 3)
    colours = None
    if texturing is not None and texturing.colours is not None:
        colours = texturing.colours[run].reshape(-1, 4)
    if texturing is None or number < 0:
        if colours is None:
            colours = np.repeat(np.column_stack([world.rgb[run], np.full(len(run), 255, np.uint8)]), 3, axis=0)
        return trimesh.Trimesh(corners, faces, vertex_colors=colours, process=False)
    u, v = texturing.uv[run].reshape(-1, 2).astype(float).T
    material = PBRMaterial(baseColorTexture=Image.fromarray(texturing.textures[number].rgba))
    visual = TextureVisuals(uv=np.column_stack([u, 1 - v]), material=material)
    if colours is not None:
        visual.vertex_attributes["color"] = colours
    return trimesh.Trimesh(corners, faces, visual=visual, process=False)
