"""What a familiarity model is."""

from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float32, Int64

from world.errors import InputError

Images = Float32[torch.Tensor, "n h w"]


@runtime_checkable
class FamiliarityModel(Protocol):
    """Learns the views of a route and scores other views by how familiar they are at every rotation.

    Views are feature images (n, h, w) as an `Encoding` makes them; for training they face along the route.
    """

    def fit(self, views: Images) -> "FamiliarityModel":
        """Learn the views (forgetting earlier ones). Raises InputError for none, or for values that are not finite."""
        ...

    def scan(self, views: Images) -> Float32[torch.Tensor, "n w"]:
        """Familiarity, higher is more familiar, of each view turned left by 0, 1, .. w - 1 columns.

        Raises InputError before `fit`, and for views of another size than the learned ones.
        """
        ...


@runtime_checkable
class SnapshotModel(FamiliarityModel, Protocol):
    """A model that keeps views and so can say which of them was recognised."""

    def match(self, views: Images) -> tuple[Float32[torch.Tensor, "n w"], Int64[torch.Tensor, "n w"]]:
        """`scan`, and the index of the learned view that each rotation resembles most."""
        ...


def check_training(views: Images) -> None:
    """Refuse views that no model can learn. Raises InputError."""
    if views.ndim != 3 or len(views) == 0:
        raise InputError(f"a model learns from at least one view (n, h, w), got shape {tuple(views.shape)}")
    check_finite(views)


def check_scan(views: Images, shape: tuple[int, ...] | None) -> None:
    """Refuse views that a model trained on images of `shape` (None: not trained) cannot score. Raises InputError."""
    if shape is None:
        raise InputError("this model has learned nothing yet; call fit(views) first")
    if views.ndim != 3 or tuple(views.shape[1:]) != tuple(shape):
        raise InputError(
            f"this model learned views of shape {tuple(shape)}, got {tuple(views.shape[1:])}; encode both alike"
        )
    check_finite(views)


def check_finite(views: Images) -> None:
    """Refuse NaN and infinity. Raises InputError."""
    if not torch.isfinite(views).all():
        bad = int(torch.nonzero(~torch.isfinite(views).all(dim=(1, 2)))[0, 0])
        raise InputError(f"view {bad} holds numbers that are not finite; check the encoding")
