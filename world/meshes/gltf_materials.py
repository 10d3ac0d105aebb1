"""Materials of glTF files, carried through trimesh, which drops samplers, transforms of textures, and colours of vertices.

Before trimesh reads a file, `carry_materials` writes what a material says about its base colour into the name of the material, and
names the vertex attributes in use so that trimesh keeps them. `carried_material` reads the name afterwards.
"""

import json
import math
from typing import Any

import numpy as np
from jaxtyping import Float

from .materials import Material

UV, COLOURS = "_TUSSOCK_UV", "_TUSSOCK_COLOUR"  # vertex attributes
_MARK = "tussock material "
_WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_NEAREST = 9728
_SEEN_EXTENSIONS = {  # of materials, that change much of what is seen beyond the base colour
    "KHR_materials_transmission": "transparent (KHR_materials_transmission)",
    "KHR_materials_diffuse_transmission": "translucent (KHR_materials_diffuse_transmission)",
}


def carry_materials(tree: dict[str, Any]) -> None:
    """Change the JSON of a glTF file so that trimesh keeps what `appearance.py` needs."""
    materials = tree.get("materials", [])
    sets = []
    for material in materials:
        _take_diffuse_as_base(material)
        carried = _carried(tree, material)
        sets.append(carried["texcoord"])
        material["name"] = _MARK + json.dumps(carried)
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            uv = f"TEXCOORD_{sets[primitive['material']]}" if "material" in primitive else "TEXCOORD_0"
            for name, kept in ((uv, UV), ("COLOR_0", COLOURS)):
                attributes.pop(kept, None)
                if name in attributes:
                    attributes[kept] = attributes[name]
            attributes.pop("COLOR_0", None)  # trimesh takes colours in 16 bits wrongly
            for name in [name for name in attributes if name.startswith("TEXCOORD_")]:
                del attributes[name]  # and turns those in whole numbers upside down wrongly
            if "material" not in primitive:  # the standard's default one
                primitive["material"] = len(materials)
    if any(
        primitive.get("material") == len(materials)
        for mesh in tree.get("meshes", [])
        for primitive in mesh["primitives"]
    ):
        tree["materials"] = [*materials, {"name": _MARK + json.dumps(_carried(tree, {}))}]


def carried_material(name: Any) -> dict[str, Any] | None:
    """What `carry_materials` wrote into the name of a material; None for other names."""
    return json.loads(name[len(_MARK) :]) if isinstance(name, str) and name.startswith(_MARK) else None


def _take_diffuse_as_base(material: dict[str, Any]) -> None:
    """Take the diffuse colour of the older specular-glossiness model as the base colour."""
    old = material.get("extensions", {}).pop("KHR_materials_pbrSpecularGlossiness", None)
    if old is not None:
        pairs = (("diffuseTexture", "baseColorTexture"), ("diffuseFactor", "baseColorFactor"))
        material["pbrMetallicRoughness"] = {ours: old[theirs] for theirs, ours in pairs if theirs in old}


def _carried(tree: dict[str, Any], material: dict[str, Any]) -> dict[str, Any]:
    """What is needed of a material, for JSON."""
    base = material.get("pbrMetallicRoughness", {})
    texture = base.get("baseColorTexture")
    transform, sampler, image = {}, {}, None
    if texture is not None:
        transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
        source = tree["textures"][texture["index"]]
        image = source.get("extensions", {}).get("EXT_texture_webp", {}).get("source", source.get("source"))
        sampler = tree["samplers"][source["sampler"]] if "sampler" in source else {}
    nearest = sampler.get("magFilter", sampler.get("minFilter")) == _NEAREST
    return {
        "name": str(material.get("name", "")),
        "image": image,
        "factor": [float(value) for value in base.get("baseColorFactor", (1, 1, 1, 1))],
        "wrap": [_WRAPS[sampler.get(key, 10497)] for key in ("wrapS", "wrapT")],
        "filter": "nearest" if nearest else "linear",
        "alpha": {"MASK": "mask", "BLEND": "blend"}.get(material.get("alphaMode", "OPAQUE"), "opaque"),
        "cutoff": float(material.get("alphaCutoff", 0.5)) if material.get("alphaMode") == "MASK" else 0.5,
        "texcoord": int(transform.get("texCoord", texture.get("texCoord", 0) if texture else 0)),
        "transform": _transform(transform).tolist(),
        "lost": _lost(material),
    }


def _transform(transform: dict[str, Any]) -> Float[np.ndarray, "2 3"]:
    """KHR_texture_transform as a matrix for (u, v, 1): scaled, then turned counter-clockwise as seen (v goes down), then moved."""
    turn = float(transform.get("rotation", 0.0))
    c, s = math.cos(turn), math.sin(turn)
    x, y = transform.get("scale", (1, 1))
    along, down = transform.get("offset", (0, 0))
    return np.array([(c * x, s * y, along), (-s * x, c * y, down)], dtype=float)


def _lost(material: dict[str, Any]) -> list[str]:
    """What is seen in other programs and not here."""
    lost = [text for name, text in _SEEN_EXTENSIONS.items() if name in material.get("extensions", {})]
    if any(material.get("emissiveFactor", ())):
        lost.append("emissive light")
    return lost


def as_material(carried: dict[str, Any], image: Any) -> Material:
    """The material that was carried through trimesh, with its image."""
    return Material(
        name=carried["name"],
        image=image if carried["image"] is not None else None,
        key=carried["image"],
        factor=np.clip(np.array(carried["factor"], dtype=float), 0, 1),
        linear=True,
        wrap=tuple(carried["wrap"]),
        filter=carried["filter"],
        alpha=carried["alpha"],
        cutoff=carried["cutoff"],
        transform=np.array(carried["transform"]),
        lost=tuple(carried["lost"]),
    )
