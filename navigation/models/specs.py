"""Models by their specs: a name, perhaps with `opponent-` or `hemifields-` before it, and parameters."""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from tussock.world.errors import SettingError
from tussock.world.specs import Spec

from .base import FamiliarityModel
from .hemifield_memories import hemifields
from .opponents import opponent
from .registry import HEMIFIELDS, MODELS, OPPONENT, split_prefix

TWO_MEMORIES = {OPPONENT: opponent, HEMIFIELDS: hemifields}


def make_model(text: str, **parameters: Any) -> Any:
    """An untrained model.

    Args:
        text: Its name, after which parameters may follow: "mushroom-body inputs=10 cells=20000". `opponent-` before the name gives
            opponent memories, `hemifields-` memories of both hemifields. A class from outside is named by its entry point or as
            `package.module:Class`.
        parameters: Further parameters of the class, and `seed` and `device`, which cannot be part of the text.

    Raises:
        SettingError: For unknown names and parameters, and for invalid values.
    """
    spec = model_spec(text)
    given = present_names(spec.target, parameters)
    if twice := spec.parameters.keys() & given.keys():
        raise SettingError(f"model {text!r}: {', '.join(sorted(twice))} is also given as a keyword; give it once")
    return spec.make(**given)


def model_spec(text: str) -> Spec:
    """The spec that a text holds, as for `make_model`. Raises SettingError for an unknown name or parameter."""
    return MODELS.spec(text, find_model)


def find_model(name: str, *, importing: bool = True) -> Callable[..., FamiliarityModel]:
    """The class of a model's name, or a function that makes two memories of it.

    Args:
        name: A name in MODELS, or `package.module:Class`, either with `opponent-` or `hemifields-` before it or not.
        importing: Whether `package.module:Class` may be imported.

    Raises:
        SettingError: For an unknown name, and for a class without `fit` and `scan`.
    """
    prefix, single = split_prefix(name)
    cls = MODELS.find(single, importing=importing)
    if isinstance(cls, type) and not (hasattr(cls, "fit") and hasattr(cls, "scan")):
        raise SettingError(f"{name!r} is not a familiarity model: it lacks fit(views) or scan(views)")
    return two_memories_of(cls, prefix) if prefix else cls


@cache
def two_memories_of(cls: Callable[..., FamiliarityModel], prefix: str) -> Callable[..., FamiliarityModel]:
    """A function that makes two memories, with the parameters of a class of models."""

    def make(**parameters: Any) -> FamiliarityModel:
        return TWO_MEMORIES[prefix](cls(**parameters))

    make.__signature__ = inspect.signature(cls)  # type: ignore[attr-defined]
    make.__module__, make.__qualname__ = cls.__module__, f"{prefix}{getattr(cls, '__qualname__', '')}"
    make.renamed = getattr(cls, "renamed", {})  # type: ignore[attr-defined]
    return make


def present_names(target: Callable[..., Any], parameters: dict[str, Any]) -> dict[str, Any]:
    """Parameters under their present names, where a class lists former ones in `renamed`. Raises SettingError for both at once."""
    former = getattr(target, "renamed", {})
    present = {former.get(key, key): value for key, value in parameters.items()}
    if len(present) < len(parameters):
        raise SettingError(f"a parameter is given under two names among {', '.join(parameters)}; give it once")
    return present
