"""Specs: a name and its parameters as one text, such as `mushroom-body inputs=10 cells=20000`.

Models, navigators and generated worlds are named so on the command line, in sweep files and in tables.
"""

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import SettingError

RESERVED = ("seed", "device", "model")  # never part of a spec: an experiment gives them
CONSTANTS = {"true": True, "false": False, "none": None}


@dataclass(frozen=True)
class Spec:
    """What a spec names, not made yet.

    Attributes:
        name: As people write it.
        target: Class or function that makes it.
        parameters: Those that are not the defaults of the target.
    """

    name: str
    target: Callable[..., Any]
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, thing: Any) -> "Spec":
        """The spec of a class, or of an object that keeps its parameters under their names."""
        target = thing if isinstance(thing, type) else type(thing)
        defaults = own_parameters(target)
        given = {} if thing is target else {name: getattr(thing, name) for name in defaults}
        name = getattr(target, "name", "") or f"{target.__module__}:{target.__qualname__}"
        return cls(name, target, {key: value for key, value in given.items() if value != defaults[key]})

    def make(self, **more: Any) -> Any:
        """The object. more: further parameters, such as the seed; one that the target does not take is left out if it is reserved."""
        taken = inspect.signature(self.target).parameters
        anything = any(each.kind is each.VAR_KEYWORD for each in taken.values())
        given = {key: value for key, value in more.items() if anything or key in taken or key not in RESERVED}
        return self.target(**self.parameters, **given)

    def __str__(self) -> str:
        return format_spec(self.name, self.parameters)


def parse_spec(text: str, find: Callable[[str], Callable[..., Any]]) -> Spec:
    """The spec that a text holds. find: the class or function of a name.

    Raises SettingError for an empty text, and for parameters that the target does not have.
    """
    name, *words = split_words(text) or [""]
    target = find(name)
    parameters = parse_parameters(words, name, target)
    defaults = own_parameters(target)
    return Spec(name, target, {key: value for key, value in parameters.items() if value != defaults.get(key, ...)})


def own_parameters(target: Callable[..., Any]) -> dict[str, Any]:
    """The parameters of a class or function that a spec may set, with their defaults (None where it has none)."""
    return {
        name: None if each.default is each.empty else each.default
        for name, each in inspect.signature(target).parameters.items()
        if name not in RESERVED and each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)
    }


def split_words(text: str) -> list[str]:
    """The words of a text, separated by white space outside parentheses."""
    return re.findall(r"(?:\([^()]*\)|\S)+", text)


def split_list(text: str) -> list[str]:
    """The items of a text, separated by commas outside parentheses."""
    return [part.strip() for part in re.split(r",(?![^()]*\))", text)]


def parse_parameters(words: list[str], name: str, target: Callable[..., Any]) -> dict[str, Any]:
    """The parameters that words such as `rate=0.1` give. Raises SettingError where the target has no such parameter.

    Whether a value makes sense is checked where the object is made. name: for messages.
    """
    own = own_parameters(target)
    anything = any(each.kind is each.VAR_KEYWORD for each in inspect.signature(target).parameters.values())
    parameters = {}
    for word in words:
        key, _, value = word.partition("=")
        if not (key and value):
            raise SettingError(f"{word!r} is not a parameter; give name=value, without spaces")
        if key in RESERVED:
            raise SettingError(f"{key} cannot be part of {name!r}; give it as --{key}, in Python as {key}=")
        if key not in own and not anything:
            raise SettingError(f"{name} has no parameter {key!r}; its parameters are {', '.join(own) or 'none'}")
        if key in parameters:
            raise SettingError(f"{key} is given twice; give it once")
        parameters[key] = parse_value(value, own.get(key))
    return parameters


def parse_value(text: str, default: Any) -> Any:
    """The value that a text holds for a parameter with this default: one, or several as in `100,50` or `(100,50)`.

    Where the default is a tuple, a single value becomes a tuple of one.
    """
    several = isinstance(default, tuple)
    usual = default[0] if several and default else default
    whole = usual is None or isinstance(usual, int)
    bare = text[1:-1] if text.startswith("(") and text.endswith(")") else text
    if several or "," in text or bare != text:
        parts = bare.strip().removesuffix(",")
        return tuple(parse_single(part.strip(), whole) for part in parts.split(",")) if bare.strip() else ()
    return parse_single(text, whole)


def parse_single(text: str, whole: bool) -> Any:
    """The number (a whole one if `whole` and possible), the constant or the text that a text holds."""
    if whole and re.fullmatch(r"[+-]?\d{1,18}", text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        return CONSTANTS.get(text, text)


def format_spec(name: str, parameters: Mapping[str, Any]) -> str:
    """A name and parameters as `parse_spec` reads them."""
    return " ".join([name, *(f"{key}={format_value(value)}" for key, value in parameters.items())])


def format_value(value: Any) -> str:
    """A value as `parse_value` reads it."""
    if isinstance(value, tuple | list):
        return f"({','.join(map(format_value, value))})"
    return str(value).lower() if value is None or isinstance(value, bool) else str(value)
