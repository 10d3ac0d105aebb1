"""Infomax: learn a view, discard it, keep only how the network changed."""

import torch
from jaxtyping import Float32

from tussock.world.settings import number, whole

from .base import Images, IncrementalModel, Learned, Scans, Shapes, model

# Presets of the rate: eta / N of one update, for `units` units of `inputs` inputs.
RATES = {
    # for views of mean 0 and variance 1, as the edges encoding makes
    "z-scored": lambda inputs, units: 1.0 / (inputs * units),
    # for views in 0..1 (BoB robotics)
    "unit-range": lambda inputs, units: 0.97 / (inputs * units),
    # Baddeley et al. 2012; Knight et al. 2019
    "baddeley": lambda inputs, units: 0.01 / units,
}
UNITS = 2500  # units whose inputs at all rotations are computed at once; limits the memory that this takes


@model
class Infomax(IncrementalModel):
    """A layer of tanh units that each view decorrelates once; familiarity is minus the sum of the absolute inputs of the units.

    For a view x: u = W x, y = tanh u, W += eta / N (W - (y + u) (W^T u)^T). Section 3.3.3 of the thesis. Constant memory.

    Attributes:
        units: Number of units; None means as many as (visible) pixels.
        rate: "z-scored", "unit-range" or "baddeley" (see RATES), or the value of eta / N.
        traversals: Passes over the views, in their order.
    """

    name = "infomax"
    paper = "Baddeley et al. 2012"
    takes_mask = True

    units: int | None = whole(None, optional=True)
    rate: str | float = number("z-scored", low=0, names=RATES)
    traversals: int = whole(1)

    def _begin(self, height: int, width: int) -> Learned:
        inputs = self._size(height, width)
        weights = self._on_device(torch.randn(self.units or inputs, inputs, generator=self._random()))
        deviation, mean = torch.std_mean(weights, dim=1, keepdim=True)
        return {"weights": self._as_filters((weights - mean) / deviation, torch.Size((height, width)))}

    def _add(self, learned: Learned, views: Images) -> Learned:
        filters = learned["weights"]
        weights = (filters.flatten(start_dim=1) if self.mask is None else self.mask.select(filters)).clone()
        units, inputs = weights.shape
        rate = RATES[self.rate](inputs, units) if isinstance(self.rate, str) else self.rate
        for _ in range(self.traversals):
            for view in self._pixels(views):
                infomax_update(weights, view, rate)
        return {"weights": self._as_filters(weights, views.shape[1:])}

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"weights": (self.units or self._size(height, width), height, width)}

    def _prepare(self) -> None:
        self._banks = [self._bank(weights) for weights in self.learned["weights"].split(UNITS)]

    def _scan(self, views: Images) -> Scans:
        total = torch.zeros(len(views), views.shape[2], device=views.device)
        for bank in self._banks:
            total -= bank.responses(views).abs_().sum(dim=2)
        return total


def infomax_update(
    weights: Float32[torch.Tensor, "units inputs"], view: Float32[torch.Tensor, " inputs"], rate: float
) -> None:
    """Add rate (W - (y + u) u^T W) to the weights, in place: u^T W is a vector, so this is an update of rank one."""
    u = weights @ view
    back = u @ weights
    weights.addr_(torch.tanh(u) + u, back, beta=1 + rate, alpha=-rate)
