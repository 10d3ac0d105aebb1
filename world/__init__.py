"""Worlds to walk in: geometry, plants, scenes, routes and their files.

The names below are loaded when they are first used, so that the command line can speak before numpy is there.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .errors import InputError
    from .geometry import Bounds, Pose, Route
    from .scene import Ground, World

__all__ = ["Bounds", "Ground", "InputError", "Pose", "Route", "World"]

_HOMES = {
    "InputError": "errors", "Bounds": "geometry", "Pose": "geometry", "Route": "geometry", "Ground": "scene", "World": "scene",
}  # fmt: skip


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
