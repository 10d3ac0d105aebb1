"""Memories of a navigator: models that learn what is seen in some directions, and are asked only about what is seen now.

How large familiarity is differs from model to model. So a memory also learns how familiar its own views are, and how familiar views are
that face the other way: between the two lies its unfamiliarity, from 0 to about 1, which means the same for every model.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32

from tussock.world.errors import SettingError
from tussock.world.geometry import columns_of_turn

from ..models.base import FamiliarityModel, Images, Model, score

SAMPLE = 64  # views by which a memory learns how familiar views are
LIMIT = 100.0  # of unfamiliarity, which has no bounds where a memory cannot tell its own views from others


@dataclass(frozen=True, kw_only=True)
class Memory:
    """A trained model, and how familiar it finds views.

    Attributes:
        model: The model.
        familiar: Familiarity of the views that it learned, the median.
        unfamiliar: That of the same views turned by half a turn.
    """

    model: FamiliarityModel
    familiar: float
    unfamiliar: float

    @classmethod
    def of(cls, model: FamiliarityModel, views: Images) -> "Memory":
        """A copy of an untrained model, after it has learned views (n, h, w)."""
        if isinstance(model, Model) and model.shape is not None:
            raise SettingError(
                f"{type(model).__name__} has learned already, and this navigator learns views that face in several directions; "
                "give a model's name in place of its file"
            )
        model = copy.deepcopy(model)
        model.fit(views)
        return cls.from_trained(model, views)

    @classmethod
    def from_trained(cls, model: FamiliarityModel, views: Images) -> "Memory":
        """A model that has learned these views (n, h, w)."""
        chosen = views[np.linspace(0, len(views) - 1, min(SAMPLE, len(views))).round().astype(int)]
        away = chosen.roll(chosen.shape[2] // 2, dims=2)
        return cls(
            model=model,
            familiar=float(score(model, chosen).median()),
            unfamiliar=float(score(model, away).median()),
        )

    def familiarity(self, views: Images) -> Float[np.ndarray, " n"]:
        """Familiarity of views (n, h, w) at their present heading."""
        return score(self.model, views).double().cpu().numpy()

    def unfamiliarity(self, views: Images) -> Float[np.ndarray, " n"]:
        """Unfamiliarity of views (n, h, w) at their present heading: 0 as of learned views, 1 as of views that face the other way."""
        return self.unfamiliarity_of(self.familiarity(views))

    def unfamiliarity_of(self, familiarity: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Unfamiliarity of views that the model has scored already, as in a scan."""
        spread = max(self.familiar - self.unfamiliar, 1e-12)
        return ((self.familiar - familiarity) / spread).clip(-LIMIT, LIMIT)


def learned_before(memory: Memory | None, navigator: object) -> Memory:
    """The memory of a navigator, once it has learned. Raises SettingError before that, as where its model comes from a file."""
    if memory is None:
        raise SettingError(
            f"{type(navigator).__name__} has not learned how familiar its views are; let it learn, with a model's name in place of a file"
        )
    return memory


def turned(views: Images, angles: Sequence[float]) -> Float32[torch.Tensor, "nk h w"]:
    """Views (n, h, w) as they are seen after turning left by each angle (rad), rounded to whole columns: (n k, h, w), a view's together."""
    columns = [round(float(columns_of_turn(angle, views.shape[2]))) for angle in angles]
    return torch.stack([views.roll(each, dims=2) for each in columns], dim=1).flatten(0, 1)
