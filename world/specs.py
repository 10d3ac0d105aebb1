"""Specs: a name and its parameters as one text, such as `mushroom-body inputs=10 cells=20000`.

Models, navigators and generated worlds are written like this on the command line, in sweep files and in tables.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from .errors import SettingError

RESERVED = ("seed", "device", "model")  # never part of a spec: the experiment decides them
CONSTANTS = {"true": True, "false": False, "none": None}
KEYWORDS = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


@dataclass(frozen=True)
class Spec:
    """A class or function with parameters; the object is not made yet.

    Attributes:
        name: Name of the target.
        target: Class or function that makes the object.
        parameters: Those that differ from the defaults of the target.
    """

    name: str
    target: Callable[..., Any]
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def make(self, **more: Any) -> Any:
        """The object.

        Args:
            **more: Other parameters; a reserved one, such as the seed, is left out if the target does not take it.

        Raises:
            SettingError: Where a parameter without a default is missing, or one is unknown or given twice.
        """
        given = {key: value for key, value in more.items() if key not in RESERVED or takes(self.target, key)}
        try:
            signature_of(self.target).bind(**self.parameters, **given)
        except TypeError as error:
            raise SettingError(f"{str(self)!r} cannot be made ({error}); give its parameters as name=value") from error
        return self.target(**self.parameters, **given)

    def __hash__(self) -> int:
        return hash(str(self))

    def __str__(self) -> str:
        return format_spec(self.name, self.parameters)


def parse_spec(text: str, find: Callable[[str], Callable[..., Any]]) -> Spec:
    """The spec that a text holds.

    Args:
        text: A name, and parameters as `name=value`, separated by spaces.
        find: Gives the class or function of a name.

    Raises:
        SettingError: For an unknown name, and for a parameter that the target does not have.
    """
    name, *words = split_words(text) or [""]
    target = find(name)
    if not callable(target):
        raise SettingError(
            f"{name!r} is of type {type(target).__name__}, not a class or function; name one that makes it"
        )
    parameters = parse_parameters(words, name, target)
    defaults = own_parameters(target)
    return Spec(name, target, {key: value for key, value in parameters.items() if value != defaults.get(key, ...)})


@cache  # a sweep asks for the same few thousands of times
def signature_of(target: Callable[..., Any]) -> inspect.Signature:
    """The parameters of a class or function. Raises SettingError for objects that have none."""
    try:
        return inspect.signature(target)
    except (TypeError, ValueError) as error:
        raise SettingError(f"{target!r} has no parameters to set ({error}); name a class or function") from error


@cache
def own_parameters(target: Callable[..., Any]) -> Mapping[str, Any]:
    """The parameters of a class or function that a spec may set, with their defaults (None where it has none)."""
    return {
        name: None if each.default is each.empty else each.default
        for name, each in signature_of(target).parameters.items()
        if name not in RESERVED and each.kind in KEYWORDS
    }


def split_words(text: str) -> list[str]:
    """The words of a text, separated by white space outside parentheses."""
    return re.findall(r"(?:\([^()]*\)|\S)+", text)


def split_list(text: str) -> list[str]:
    """The items of a text, separated by commas outside parentheses."""
    return [part.strip() for part in re.split(r",(?![^()]*\))", text)]


def parse_parameters(words: list[str], name: str, target: Callable[..., Any]) -> dict[str, Any]:
    """The parameters that words such as `rate=0.1` give. Their values are checked where the object is made.

    Args:
        words: Parameters as `name=value`; an angle may be given in degrees, as `name_deg=value`.
        name: Name of the target, for messages.
        target: Class or function whose parameters they are. It may list former names of these in `renamed`.

    Raises:
        SettingError: For a parameter that the target does not have, and for one that is given twice.
    """
    own = own_parameters(target)
    parameters = {}
    for word in words:
        key, _, value = word.partition("=")
        if not (key and value):
            raise SettingError(f"{word!r} is not a parameter; give name=value, without spaces")
        key = getattr(target, "renamed", {}).get(key, key)
        in_degrees = not takes(target, key) and key.removesuffix("_deg") in own
        key = key.removesuffix("_deg") if in_degrees else key
        if key in RESERVED:
            raise SettingError(f"{key} cannot be part of {name!r}; give it as --{key}, in Python as {key}=")
        if not takes(target, key):
            angles = {
                each.name for each in getattr(target, "__attrs_attrs__", ()) if each.metadata.get("unit") == "rad"
            }
            names = [f"{each}_deg" if each in angles else each for each in own]
            raise SettingError(f"{name} has no parameter {key!r}; its parameters are {', '.join(names) or 'none'}")
        if key in parameters:
            raise SettingError(f"{key} is given twice; give it once")
        parameters[key] = _radians(word, value, own.get(key)) if in_degrees else parse_value(value, own.get(key))
    return parameters


def _radians(word: str, text: str, default: Any) -> Any:
    """The angle or angles (rad) of a parameter that is given in degrees. Raises SettingError for anything but numbers."""
    value = parse_value(text, (0.0,) if isinstance(default, tuple) else 0.0)
    try:
        return tuple(map(math.radians, value)) if isinstance(value, tuple) else math.radians(value)
    except TypeError as error:
        raise SettingError(f"{word!r} is not an angle; give a number of degrees") from error


def parse_value(text: str, default: Any) -> Any:
    """The value that a text holds: one, or several as in `100,50` or `(100,50)`.

    Args:
        text: The value.
        default: Default of the parameter. Where it is a tuple, a single value becomes a tuple of one; where it is neither a
            whole number nor None, numbers are read as float.
    """
    several = isinstance(default, tuple)
    example = default[0] if several and default else default
    whole = example is None or isinstance(example, int)
    bare = text[1:-1] if text.startswith("(") and text.endswith(")") else text
    if several or "," in text or bare != text:
        parts = bare.strip().removesuffix(",")
        return tuple(parse_single(part.strip(), whole) for part in parts.split(",")) if bare.strip() else ()
    return parse_single(text, whole)


def parse_single(text: str, whole: bool) -> Any:
    """The number (an int if `whole` and possible), the constant or the text that a text holds."""
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


def takes(target: Callable[..., Any], name: str) -> bool:
    """Whether a class or function takes a keyword."""
    taken = signature_of(target).parameters.values()
    return any(each.kind is each.VAR_KEYWORD or (each.name == name and each.kind in KEYWORDS) for each in taken)
