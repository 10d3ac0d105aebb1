"""Materials of OBJ files (MTL), as trimesh keeps them: Kd, map_Kd with its options, map_d, d and Tr."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np

from .materials import Material, white_image

_NOT_DRAWN = {"-mm": (0.0, 1.0), "-t": (0.0, 0.0, 0.0)}  # options, with the numbers that change nothing


def obj_material(simple: Any, get: Callable[[str], bytes] | None) -> Material:
    """The material of a mesh from a `SimpleMaterial` of trimesh.

    Args:
        simple: The material.
        get: Gives the content of a file next to the mesh, or raises OSError.
    """
    keys, image = simple.kwargs, simple.image
    if image is not None and image.format is None:  # trimesh made it, in place of a material file that is missing
        image = None
    options = {key.removeprefix("map_kd"): values for key, values in keys.items() if key.startswith("map_kd-")}
    red, green, blue = _colour(simple, image)
    alpha_image = None
    lost = [
        f"option {name} of a texture" for name, unchanged in _NOT_DRAWN.items() if _changes(options, name, unchanged)
    ]
    if "map_d" in keys:
        alpha_image = _image(" ".join(keys["map_d"]), get)
        if image is None and alpha_image is not None:
            image = white_image(alpha_image.size)
        lost += [] if alpha_image is not None else [f"the holes in {' '.join(keys['map_d'])!r}, which cannot be read"]
    clamp = options.get("-clamp", ["off"])[0].lower() == "on"
    return Material(
        name=str(simple.name),
        image=image,
        alpha_image=alpha_image,
        key=(simple.name,) if _is_mtl(keys) else None,
        factor=np.clip([red, green, blue, _opacity(keys)], 0, 1),
        wrap=("clamp", "clamp") if clamp else ("repeat", "repeat"),
        alpha="blend",
        transform=_transform(options),
        lost=tuple(lost),
    )


def _changes(options: dict[str, list[str]], name: str, unchanged: tuple[float, ...]) -> bool:
    """Whether an option is there with other numbers than those that change nothing."""
    words = options.get(name, [])
    return tuple(map(float, words)) != unchanged[: len(words)]


def _colour(simple: Any, image: Any) -> np.ndarray:
    """What the texture, or white, is multiplied by (0..1)."""
    keys = simple.kwargs
    if image is None:
        return np.broadcast_to(keys.get("kd", 1.0), 3)
    kd = np.broadcast_to(keys.get("kd", 1.0), 3)
    # Black, and the colours of trimesh's default material, are written by programs that do not multiply by them.
    never_meant = not kd.any() or all(np.allclose(keys.get(key, 0), 0.4) for key in ("kd", "ka", "ks"))
    return np.ones(3) if never_meant else kd


def _is_mtl(keys: dict[str, Any]) -> bool:
    """Whether a material was in an MTL file, of which trimesh keeps what it does not use."""
    return bool(keys)


def _opacity(keys: dict[str, Any]) -> float:
    """1 is opaque. A material that would be invisible is opaque: programs that mix `d` and `Tr` up write 0 for all."""
    try:
        opacity = float(keys["d"][-1]) if "d" in keys else 1 - float(keys["tr"][-1]) if "tr" in keys else 1.0
    except (ValueError, IndexError):
        return 1.0
    return opacity if opacity > 0 else 1.0


def _transform(options: dict[str, list[str]]) -> np.ndarray:
    """-s and -o as a matrix for (u, v, 1) with v down: u s + o, and likewise v, which goes up in MTL."""
    su, sv = _pair(options.get("-s", []), 1.0)
    ou, ov = _pair(options.get("-o", []), 0.0)
    return np.array([(su, 0, ou), (0, sv, 1 - sv - ov)], dtype=float)


def _pair(words: list[str], default: float) -> tuple[float, float]:
    u, v, *_ = [*(float(word) for word in words), default, default]
    return u, v


def _image(name: str, get: Callable[[str], bytes] | None) -> Any:
    """An image next to the mesh, or None where it is not found or is not an image."""
    from PIL import Image

    try:
        return None if get is None else Image.open(io.BytesIO(get(name)))
    except OSError:
        return None
