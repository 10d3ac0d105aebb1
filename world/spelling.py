"""A model or a world in words: its name, and the parameters that it is to have, as in `mushroom-body inputs=10 cells=20000`."""

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

from .errors import InputError

ELSEWHERE = ("seed", "device")  # no spelling holds them: they are flags of the command line
CONSTANTS = {"true": True, "false": False, "none": None}


def own_parameters(kind: Any) -> dict[str, Any]:
    """The parameters of a dataclass that can be spelled, with their defaults."""
    return {f.name: f.default for f in dataclasses.fields(kind) if f.init and f.name not in ELSEWHERE}


def split_words(text: str) -> list[str]:
    """The words of a text, parted by white space outside parentheses."""
    return re.findall(r"(?:\([^()]*\)|\S)+", text)


def split_list(text: str) -> list[str]:
    """What a text lists, parted by commas outside parentheses."""
    return [part.strip() for part in re.split(r",(?![^()]*\))", text)]


def read_parameters(words: list[str], name: str, kind: Any) -> dict[str, Any]:
    """The parameters of a dataclass that words such as `rate=0.1` give. Raises InputError where they give none of its.

    What the values mean is for the dataclass to say. name: that people know it by.
    """
    own = own_parameters(kind)
    parameters = {}
    for word in words:
        key, _, value = word.partition("=")
        if not (key and value):
            raise InputError(f"{word!r} is no parameter; give name=value, without spaces")
        if key in ELSEWHERE:
            raise InputError(f"the {key} is not spelled here; give it as --{key}, in Python as {key}=")
        if key not in own:
            raise InputError(f"{name} has no parameter {key!r}; there are {', '.join(own) or 'none'}")
        if key in parameters:
            raise InputError(f"{key} is given twice; give it once")
        parameters[key] = read_value(value, own[key])
    return parameters


def read_value(text: str, default: Any) -> Any:
    """What a text spells for a parameter with this default: one value, or several as in `100,50` or `(100,50)`.

    Where the default is several, one value is a tuple of one.
    """
    several = isinstance(default, tuple)
    usual = default[0] if several else default
    whole = usual is None or isinstance(usual, int)
    bare = text[1:-1] if text.startswith("(") and text.endswith(")") else text
    if several or "," in text or bare != text:
        parts = bare.strip().removesuffix(",")
        return tuple(read_single(part.strip(), whole) for part in parts.split(",")) if bare.strip() else ()
    return read_single(text, whole)


def read_single(text: str, whole: bool) -> Any:
    """The number (where it can be, a whole one), the constant or the name that a text spells."""
    if whole and re.fullmatch(r"[+-]?\d{1,18}", text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        return CONSTANTS.get(text, text)


def spell(name: str, parameters: Mapping[str, Any], kind: Any) -> str:
    """A name, and those of its parameters that are not the defaults of the dataclass: what `read_parameters` reads."""
    own = own_parameters(kind)
    words = [f"{key}={spell_value(parameters[key])}" for key in own if parameters[key] != own[key]]
    return " ".join([name, *words])


def spell_value(value: Any) -> str:
    """What `read_value` reads as this value."""
    if isinstance(value, (tuple, list)):
        return f"({','.join(map(spell_value, value))})"
    return str(value).lower() if value is None or isinstance(value, bool) else str(value)
