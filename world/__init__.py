"""Worlds to walk in: geometry, plants, scenes, routes and their files."""

from .errors import InputError
from .geometry import Bounds, Pose, Route
from .scene import Ground, World

__all__ = ["Bounds", "Ground", "InputError", "Pose", "Route", "World"]
