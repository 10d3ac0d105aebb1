"""What models do with all rotations of a view: take views in batches, weigh rotations, smooth over them."""

import math
from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch.nn.functional import linear

from tussock.world.geometry import turn_of_columns

from .products import dot_products

NEGLIGIBLE = 1e-6  # weight of a rotation, as a share of the largest, that changes no average in float32
ROTATIONS = 6144  # of views that a model scores at once; what is held on the way is then 100 MB or so
ALONE = 2**15  # pixels of a view from which on torch's threads share the sum of one view, but not those of several


def in_batches(views: Float32[torch.Tensor, "n h w"]) -> tuple[Float32[torch.Tensor, "batch h w"], ...]:
    """Views in batches that have ROTATIONS at most, but at least one view each."""
    size = max(1, ROTATIONS // views.shape[2])
    return views.tensor_split(max(1, math.ceil(len(views) / size)))


def one_by_one(function: Callable[..., torch.Tensor], *of_views: torch.Tensor) -> torch.Tensor:
    """A function of each view, or of what was computed of it, stacked.

    Products of matrices, and Fourier transforms, may round a row differently when there are others, or when it stands elsewhere in
    memory (so it is copied). This way a view is scanned to the same bytes as alone.
    """
    return torch.stack([function(*(each.clone() for each in of_view)) for of_view in zip(*of_views, strict=True)])


def linear_each(
    rows: Float32[torch.Tensor, "n k"],
    weights: Float32[torch.Tensor, "m k"],
    biases: Float32[torch.Tensor, " m"] | None = None,
) -> Float32[torch.Tensor, "n m"]:
    """torch's `linear`, which on a CPU gives a row the same bytes as alone, and takes less time for few rows."""
    if rows.device.type != "cpu":
        return linear(rows, weights, biases)
    products = rows.new_empty(len(rows), len(weights))
    dot_products(rows.contiguous().numpy(), weights.contiguous().numpy(), products.numpy())
    return products if biases is None else products + biases


def gaussian(width: int, deviation: float) -> Float32[torch.Tensor, " {width}"]:
    """A Gaussian over the rotations about rotation 0, of sum 1.

    Args:
        width: Number of rotations.
        deviation: Its standard deviation (rad), over 0.
    """
    turns = torch.as_tensor(turn_of_columns(np.arange(width), width), dtype=torch.float32)
    return torch.softmax(-0.5 * (turns / deviation) ** 2, dim=0)


def smoothed(scans: Float32[torch.Tensor, "n w"], deviation: float) -> Float32[torch.Tensor, "n w"]:
    """Each rotation averaged with its neighbours.

    Args:
        scans: (n, w)
        deviation: Standard deviation (rad) of the Gaussian weights; 0 leaves the scans as they are.
    """
    if deviation == 0:
        return scans
    width = scans.shape[1]
    rotation = torch.arange(width)
    weights = gaussian(width, deviation)[(rotation[:, None] - rotation) % width]
    weights = weights.to(scans.device)
    return one_by_one(lambda scan: scan @ weights, scans)


def weights_ahead(
    width: int, deviation: float
) -> tuple[Int64[torch.Tensor, " rotations"], Float32[torch.Tensor, " rotations"]]:
    """The rotations that `smoothed` averages at rotation 0, and their weights.

    Args:
        width: Number of rotations.
        deviation: Standard deviation (rad) of the Gaussian weights; with 0 it is rotation 0 alone.
    """
    weights = gaussian(width, deviation) if deviation else torch.ones(1)
    rotations = (weights > NEGLIGIBLE * weights[0]).nonzero()[:, 0]
    return rotations, weights[rotations]
