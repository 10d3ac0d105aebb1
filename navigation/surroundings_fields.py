"""The values that fields of `Surroundings` take, in each form in which they are given. Light to import."""

import os
from pathlib import Path
from typing import Any

from tussock.world.errors import SettingError


def as_world(value: Any) -> Any:
    """A world; a file as text, as the command line gives it."""
    if isinstance(value, str):
        return value
    from tussock.world.params import is_generated
    from tussock.world.scene import World

    if isinstance(value, Path):
        return os.path.join(os.curdir, value) if is_generated(str(value)) else str(value)  # a file named like a preset
    if not isinstance(value, World):
        raise SettingError(f"world is {value!r}; give a preset's name, a file or a World")
    return value


def as_route(value: Any) -> Any:
    """A route; a file as its path."""
    if isinstance(value, str | Path):
        return Path(value)
    from tussock.world.geometry import Route

    if not isinstance(value, Route | None):
        raise SettingError(f"route is {value!r}; give a Route, its file, or None")
    return value


def as_folder(value: Any) -> Any:
    """The folder of an image database as its path."""
    return value if value is None else Path(value)


def as_light(value: Any) -> Any:
    """The spec of a light."""
    if value is None:
        return None
    from tussock.world.light import light_spec

    return light_spec(value)
