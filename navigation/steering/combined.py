"""What navigators have in common that are made of other navigators: these by their specs, and what each of them remembers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from jaxtyping import Float
from numpy import ndarray

from tussock.world.errors import SettingError
from tussock.world.specs import Spec, takes

from ..models.base import FamiliarityModel
from .navigator import Images, Journey, LearningPlaces, Navigator, PathIntegrating, tell_put_back
from .registry import NAVIGATORS


def navigator_spec(value: Any) -> Spec:
    """The spec of a navigator inside another one's: a text, or what its parentheses were read as. Raises SettingError."""
    if isinstance(value, Spec):
        return value
    parts = value if isinstance(value, tuple | list) else [value]
    if not all(isinstance(part, str | int | float) for part in parts) or not parts:
        raise SettingError(f"{value!r} is not a navigator; give its name, or '(lateral gain=8)' in parentheses")
    return NAVIGATORS.spec(",".join(map(str, parts)))


def made(spec: Spec, model: Any, seed: int) -> Navigator:
    """The navigator of a spec. Raises SettingError for what is none, and for one without a model where the eye does not see everything."""
    fits = takes(spec.target, "model") or not getattr(spec.target, "reads_views", True)
    if getattr(model, "mask", None) is not None and not fits:
        raise SettingError(f"the navigator {str(spec)!r} takes no model; give no field and no mask")
    navigator = spec.make(model=model, seed=seed)
    if not isinstance(navigator, Navigator):
        raise SettingError(f"{str(spec)!r} is not a navigator; name one, such as 'scan'")
    return navigator


def take_trained(navigators: Sequence[Navigator]) -> bool:
    """Whether all of some navigators can use a model that has learned already."""
    return all(getattr(navigator, "takes_trained", True) for navigator in navigators)


def learn_each(navigators: Sequence[Navigator], views: Images, places: Float[ndarray, "n 3"] | None) -> None:
    """Let navigators learn the views of a route; `places` for those that learn them, too."""
    for navigator in navigators:
        if places is not None and isinstance(navigator, LearningPlaces):
            navigator.learn_at(views.clone(), places)
        else:
            navigator.learn(views.clone())


def models_of(navigators: Sequence[Navigator]) -> tuple[FamiliarityModel, ...]:
    """The trained models that navigators steer by."""
    own = [getattr(each, "models", None) or (getattr(each, "model", None),) for each in navigators]
    return tuple(model for models in own for model in models if model is not None)


@dataclass
class Remembered:
    """What an agent remembers of each of several navigators.

    Attributes:
        parts: One for each.
    """

    parts: list[Any]

    def resume(self, progress: float) -> None:
        """Tell each that the agent was put back, after this share (0 to 1) of the route."""
        for part in self.parts:
            tell_put_back(part, progress)


def travel(navigators: Sequence[Navigator], memory: Remembered, journey: Journey) -> None:
    """Let those navigators that integrate paths take in the way out."""
    for navigator, part in zip(navigators, memory.parts, strict=True):
        if isinstance(navigator, PathIntegrating):
            navigator.travel(part, journey)
