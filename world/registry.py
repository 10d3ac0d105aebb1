"""Registries: names for classes that tussock brings, that installed packages bring, or that a script registers.

Anything else is named by where it stands, as `package.module:Class`.
"""

import sys
from collections.abc import Mapping
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .errors import SettingError
from .specs import Spec, parse_spec


class Registry:
    """Classes (or functions) of one kind, by name.

    Names are looked up among those of tussock, then those that were registered, then the entry points of installed packages.

    Attributes:
        group: Name of the registry, and after `tussock.` of its group of entry points.
        kind: What is registered, for messages.
        builtin: Names of tussock's own, each with where it stands, as `module:Class`.
    """

    def __init__(self, group: str, kind: str, builtin: Mapping[str, str]):
        self.group, self.kind, self.builtin = group, kind, dict(builtin)
        self._registered: dict[str, Any] = {}

    def register(self, name: str, target: Any) -> None:
        """Enter something under a name, for this process. Raises SettingError for a name that tussock uses itself."""
        if name in self.builtin:
            raise SettingError(f"{name!r} is a {self.kind} of tussock; register yours under another name")
        if not name or any(character.isspace() or character in "|,=()" for character in name):
            raise SettingError(f"{name!r} cannot name a {self.kind}; give a name without spaces and without | , = ( )")
        self._registered[name] = target

    @property
    def names(self) -> list[str]:
        """All names: tussock's own first, in their order."""
        return list(dict.fromkeys([*self.builtin, *self._registered, *self._installed]))

    def __contains__(self, name: str) -> bool:
        return name in self.builtin or name in self._registered or name in self._installed

    def find(self, name: str, *, importing: bool = True) -> Any:
        """What a name stands for; `package.module:Class` is imported, unless importing is False, and then known.

        Raises SettingError for an unknown name, which lists the known ones.
        """
        if name in self.builtin:
            return _attribute(self.builtin[name])
        if name in self._registered:
            return self._registered[name]
        if name in self._installed:
            return self._loaded(self._installed[name])
        if ":" in name and importing:
            self._registered[name] = self._imported(name)
            return self._registered[name]
        hint = "import it first" if ":" in name else "or package.module:Class"
        raise SettingError(f"unknown {self.kind} {name!r}; known: {', '.join(self.names)}, {hint}")

    def where(self, name: str) -> str | None:
        """The `module:attribute` that a name stands for, without importing it; None for what a script registered."""
        if name in self.builtin:
            return self.builtin[name]
        if name in self._registered:
            return None
        return self._installed[name].value if name in self._installed else name

    def spec(self, text: str) -> Spec:
        """The spec that a text holds. Raises SettingError for an unknown name or parameter."""
        try:
            return parse_spec(text, self.find)
        except SettingError as error:
            raise error if repr(text) in str(error) else SettingError(f"{self.kind} {text!r}: {error}") from error

    def name_of(self, target: Any) -> str:
        """The name of something: the one it is known by, else where it stands."""
        for name, known in self._registered.items():
            if known is target:
                return name
        where = f"{target.__module__}:{target.__qualname__}"
        for name, place in {**self.builtin, **{each.name: each.value for each in self._installed.values()}}.items():
            if place == where:
                return name
        return where

    @cached_property
    def _installed(self) -> dict[str, EntryPoint]:
        return {each.name: each for each in entry_points(group=f"tussock.{self.group}")}

    def _loaded(self, point: EntryPoint) -> Any:
        try:
            return point.load()
        except (ImportError, AttributeError) as error:
            raise SettingError(
                f"the {self.kind} {point.name!r} of an installed package cannot be loaded ({error}); repair the package"
            ) from error

    def _imported(self, name: str) -> Any:
        """What stands at `package.module:Class`; modules of the current folder are found as well, as with python -m."""
        if "" not in sys.path:
            sys.path.append("")
        try:
            return _attribute(name)
        except (ImportError, AttributeError, ValueError) as error:
            raise SettingError(
                f"the {self.kind} {name!r} cannot be imported ({error}); give package.module:Class of an installed package, or of a "
                "file in this folder"
            ) from error


def _attribute(where: str) -> Any:
    """What stands at `module:attribute`."""
    module, _, attribute = where.partition(":")
    return getattr(import_module(module), attribute)
