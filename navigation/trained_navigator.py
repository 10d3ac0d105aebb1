"""A navigator that has learned a route, with what it was trained on."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tussock.render.renderer import Renderer
    from tussock.world.geometry import Route

    from .encoding import Encoding
    from .failures import Diagnostics
    from .models.base import FamiliarityModel
    from .models.files import TrainedModel
    from .steering.navigator import Navigator


@dataclass(frozen=True, kw_only=True)
class TrainedNavigator:
    """A navigator that has learned a route, where it can walk.

    Attributes:
        renderer: Of the world.
        route: That it has learned.
        navigator: What steers.
        model: Its familiarity model with what it was trained on; None where the navigator has none.
        poses: (n, 3) Where the views were learned; None where that is not known.
        views: (n, h, w) The encoded views that were learned, in float32 (1,400 of 90 x 25 pixels are 13 MB), where a model keeps them
            itself, its own; None where they are not at hand.
        seconds: That learning took.
        encoding: Of these views.
    """

    renderer: "Renderer"
    route: "Route"
    navigator: "Navigator"
    model: "TrainedModel | None"
    poses: Any
    views: Any
    seconds: float
    encoding: "Encoding"

    @cached_property
    def diagnostics(self) -> "Diagnostics":
        """What finds out why steps are poor."""
        from .failures import Diagnostics
        from .models.base import recognises

        learned = None
        if self.model is None and self.poses is not None and any(map(recognises, self.models)):
            learned = self.encoding, self.poses
        return Diagnostics(self.renderer, self.model, self.route, self.views, learned=learned)

    @property
    def models(self) -> "Sequence[FamiliarityModel]":
        """The trained models that it steers by: those of its attribute `models`, or its one model."""
        own = () if self.model is None else (self.model.model,)
        return getattr(self.navigator, "models", own)

    @property
    def memory_bytes(self) -> int | None:
        """Size of what they have learned; None where it steers by none, or one of them does not tell."""
        from .models.base import memory_bytes

        sizes = [size for model in self.models if (size := memory_bytes(model)) is not None]
        return sum(sizes) if sizes and len(sizes) == len(self.models) else None
