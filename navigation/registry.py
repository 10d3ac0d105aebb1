"""Where classes from outside join: models, encoding steps, navigators, worlds and protocols."""

from importlib import import_module
from typing import Any

from tussock.world.errors import SettingError
from tussock.world.registry import Registry

# Where each registry stands, by its group.
REGISTRIES = {
    "models": "tussock.navigation.models:MODELS",
    "encodings": "tussock.navigation.encoding:STEPS",
    "navigators": "tussock.navigation.steering:NAVIGATORS",
    "worlds": "tussock.world.params:WORLDS",
    "changes": "tussock.world.change:CHANGES",
    "protocols": "tussock.navigation.studies.protocols:PROTOCOLS",
}


def register(group: str, name: str, target: Any) -> None:
    """Enter something of your own under a name, for this process; it then works wherever the built-in ones do.

    Args:
        group: "models", "encodings", "navigators", "worlds", "changes" or "protocols".
        name: By which it is known, on the command line too.
        target: The class; for protocols and worlds see docs/extending.md.

    Raises:
        SettingError: For an unknown group, or a name that tussock uses itself.
    """
    registry(group).register(name, target)


def registry(group: str) -> Registry:
    """The registry of a group. Raises SettingError for an unknown one."""
    if group not in REGISTRIES:
        raise SettingError(f"unknown group {group!r}; give one of {', '.join(REGISTRIES)}")
    module, _, name = REGISTRIES[group].partition(":")
    return getattr(import_module(module), name)
