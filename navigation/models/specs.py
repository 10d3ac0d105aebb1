"""Models by their specs: a name, perhaps with `opponent-` before it, and parameters."""

from collections.abc import Callable
from typing import Any

from tussock.world.errors import SettingError
from tussock.world.specs import Spec

from .base import FamiliarityModel
from .opponents import opponents_of
from .registry import MODELS, OPPONENT


def make_model(text: str, **parameters: Any) -> Any:
    """An untrained model.

    Args:
        text: Its name, after which parameters may follow: "mushroom-body inputs=10 cells=20000". `opponent-` before the name gives
            opponent memories. A class from outside is named by its entry point or as `package.module:Class`.
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
    """The class of a model's name, or a function that makes its opponent memories.

    Args:
        name: A name in MODELS, or `package.module:Class`, either with `opponent-` before it or not.
        importing: Whether `package.module:Class` may be imported.

    Raises:
        SettingError: For an unknown name, and for a class without `fit` and `scan`.
    """
    opposed = name.startswith(OPPONENT) and name not in MODELS
    cls = MODELS.find(name.removeprefix(OPPONENT) if opposed else name, importing=importing)
    if isinstance(cls, type) and not (hasattr(cls, "fit") and hasattr(cls, "scan")):
        raise SettingError(f"{name!r} is not a familiarity model: it lacks fit(views) or scan(views)")
    return opponents_of(cls) if opposed else cls


def present_names(target: Callable[..., Any], parameters: dict[str, Any]) -> dict[str, Any]:
    """Parameters under their present names, where a class lists former ones in `renamed`. Raises SettingError for both at once."""
    former = getattr(target, "renamed", {})
    present = {former.get(key, key): value for key, value in parameters.items()}
    if len(present) < len(parameters):
        raise SettingError(f"a parameter is given under two names among {', '.join(parameters)}; give it once")
    return present
