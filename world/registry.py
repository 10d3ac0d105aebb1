"""Registries: classes and functions by name, those of tussock, of installed packages and of scripts."""

import difflib
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from .errors import SettingError
from .specs import Spec, own_parameters, parse_spec

LOCATION = re.compile(r"\w+(\.\w+)*:\w+")  # `package.module:Class`, the name of anything that is not registered


class Registry:
    """Classes or functions of one kind, by name.

    A name is looked up among those of tussock, then among those that were registered in this process, then among the entry
    points of installed packages. Anything else is named by its location, `package.module:Class`.

    Attributes:
        group: Name of the registry. `tussock.` and this is its group of entry points.
        kind: What is registered, for messages.
        builtin: The names of tussock, each with its location.
    """

    def __init__(self, group: str, kind: str, builtin: Mapping[str, str]):
        self.group, self.kind, self.builtin = group, kind, dict(builtin)
        self._registered: dict[str, Any] = {}

    def register(self, name: str, target: Any) -> None:
        """Add a name for this process. Raises SettingError for a name of tussock, and for one that a spec could not hold."""
        if name in self.builtin:
            raise SettingError(f"{name!r} is a {self.kind} of tussock; register yours under another name")
        if not name or re.search(r"[\s|,=()]", name):
            raise SettingError(f"{name!r} cannot name a {self.kind}; give a name without spaces and without | , = ( )")
        if target is None or isinstance(target, str | int | float):
            raise SettingError(f"{target!r} is not a {self.kind}; register a class or function")
        self._registered[name] = target

    @property
    def registered(self) -> dict[str, Any]:
        """What was registered in this process, by name."""
        return dict(self._registered)

    @property
    def names(self) -> list[str]:
        """All names, those of tussock first."""
        return list(dict.fromkeys([*self.builtin, *self._registered, *self._installed]))

    def __contains__(self, name: str) -> bool:
        return name in {*self.names, *map(location_of, self._registered.values()), *map(self.where, self._installed)}

    def find(self, name: str, *, importing: bool = True) -> Any:
        """The class or function of a name.

        Args:
            name: A known name, or a location.
            importing: Whether a location may be imported that is not yet known; it is a known name from then on.

        Raises:
            SettingError: For a name that is unknown or cannot be imported. It lists the known names.
        """
        if name in self.builtin:
            return _load(self.builtin[name])
        for registered, target in self._registered.items():
            if name in (registered, location_of(target)):
                return target
        for point in self._installed.values():
            if name in (point.name, point.value):
                return self._open(point)
        if importing and LOCATION.fullmatch(name):
            self._registered[name] = self._import(name)
            return self._registered[name]
        hint = "import it first" if LOCATION.fullmatch(name) else "or package.module:Class"
        raise SettingError(
            f"unknown {self.kind} {name!r}{suggestion(name, self.names)}; known: {', '.join(self.names)}, {hint}"
        )

    def check(self, name: str) -> None:
        """Refuse a name that is neither known nor a location, without importing anything. Raises SettingError."""
        if name not in self and not LOCATION.fullmatch(name):
            self.find(name)

    def where(self, name: str) -> str | None:
        """The `module:attribute` that a name stands for, without importing it; None for what a script registered."""
        if name in self.builtin:
            return self.builtin[name]
        if name in self._registered:
            return None
        return self._installed[name].value if name in self._installed else name

    def spec(self, text: str, find: Callable[[str], Callable[..., Any]] | None = None) -> Spec:
        """The spec that a text holds. Raises SettingError for an unknown name or parameter.

        Args:
            text: A name, after which parameters may follow.
            find: Gives the class or function of a name; None means those of this registry.
        """
        try:
            return parse_spec(text, find or self.find)
        except SettingError as error:
            raise error if repr(text) in str(error) else SettingError(f"{self.kind} {text!r}: {error}") from error

    def spec_of(self, thing: Any) -> Spec:
        """The spec of a class, or of an object that keeps its parameters under their names."""
        target = thing if isinstance(thing, type) else type(thing)
        defaults = own_parameters(target)
        if missing := [name for name in defaults if thing is not target and not hasattr(thing, name)]:
            raise SettingError(f"{thing!r} does not keep its {', '.join(missing)}; give its class, or a spec")
        given = {} if thing is target else {name: getattr(thing, name) for name in defaults}
        return Spec(
            self.name_of(target), target, {key: value for key, value in given.items() if value != defaults[key]}
        )

    def name_of(self, target: Any) -> str:
        """The name of a class or function, or its location if it has none."""
        for name, registered in self._registered.items():
            if registered is target:
                return name
        location = location_of(target)
        known = {name: point.value for name, point in self._installed.items()} | self.builtin
        return next((name for name, value in known.items() if value == location), location)

    def name_in_files(self, target: Any) -> str:
        """The name of a class of tussock, the location of any other: what it is called may differ between processes."""
        location = location_of(target)
        return next((name for name, value in self.builtin.items() if value == location), location)

    @cached_property
    def _installed(self) -> dict[str, Any]:
        """The entry points by their names."""
        return {each.name: each for each in entry_points(group=f"tussock.{self.group}")}

    def _open(self, point: Any) -> Any:
        """What an entry point of an installed package refers to."""
        try:
            return point.load()
        except (Exception, SystemExit) as error:  # whatever another package does when it is imported
            raise SettingError(
                f"the {self.kind} {point.name!r} of an installed package cannot be loaded ({error}); repair the package"
            ) from error

    def _import(self, location: str) -> Any:
        """What is at a location. Modules in the current folder are found as well, after all others."""
        if "" not in sys.path:
            sys.path.append("")
        try:
            return _load(location)
        except (Exception, SystemExit) as error:  # whatever the module does when it is imported
            raise SettingError(
                f"the {self.kind} {location!r} cannot be imported ({error}); give package.module:Class of an installed package, "
                "or of a file in the current folder"
            ) from error


def suggestion(name: str, known: Iterable[str]) -> str:
    """What to add to an error about an unknown name: the known one that it is nearly, or nothing."""
    similar = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean {similar[0]!r}?)" if similar else ""


def location_of(target: Any) -> str:
    """The `module:name` of a class or function; other objects have no name there."""
    return f"{target.__module__}:{getattr(target, '__qualname__', '')}"


def _load(location: str) -> Any:
    """What is at a location."""
    module, _, name = location.partition(":")
    return getattr(import_module(module), name)
