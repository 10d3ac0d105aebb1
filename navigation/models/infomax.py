"""Infomax: learn a view, discard it, keep only how the network changed."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float32

from .base import Images, IncrementalModel, Learned, Scans
from .filter_bank import FilterBank

# Presets in use, as eta / N: the rate of one update for `units` units of `inputs` inputs.
RATES = {
    "z-scored": lambda inputs, units: (
        1.0 / (inputs * units)
    ),  # views of mean 0 and variance 1, as the edges encoding makes
    "unit-range": lambda inputs, units: 0.97 / (inputs * units),  # views in 0..1 (BoB robotics)
    "baddeley": lambda inputs, units: 0.01 / units,  # Baddeley et al. 2012; Knight et al. 2019
}


@dataclass(kw_only=True, eq=False)
class Infomax(IncrementalModel):
    """A layer of tanh units decorrelated by each view once; familiarity is minus the sum of their absolute inputs.

    For a view x: u = W x, y = tanh u, W += eta / N (W - (y + u) (W^T u)^T). Section 3.3.3 of the thesis. Constant memory.

    units: how many; None is as many as pixels. rate: "z-scored", "unit-range" or "baddeley" (see RATES), or eta / N itself.
    traversals: how often the views are passed, in order.
    """

    name = "infomax"
    paper = "Baddeley et al. 2012"

    CHOICES = {"rate": RATES}  # noqa: RUF012
    LIMITS = {"rate": (0.0, np.inf)}  # noqa: RUF012
    units: int | None = None
    rate: str | float = "z-scored"
    traversals: int = 1

    def _begin(self, height: int, width: int) -> Learned:
        inputs = height * width
        weights = self._here(torch.randn(self.units or inputs, inputs, generator=self._random()))
        deviation, mean = torch.std_mean(weights, dim=1, keepdim=True)
        return {"weights": ((weights - mean) / deviation).reshape(-1, height, width)}

    def _add(self, learned: Learned, views: Images) -> Learned:
        weights = learned["weights"].flatten(start_dim=1).clone()
        units, inputs = weights.shape
        rate = RATES[self.rate](inputs, units) if isinstance(self.rate, str) else self.rate
        for _ in range(self.traversals):
            for view in views.flatten(start_dim=1):
                infomax_update(weights, view, rate)
        return {"weights": weights.reshape(-1, *views.shape[1:])}

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"weights": (self.units or height * width, height, width)}

    def _prepare(self) -> None:
        self._bank = FilterBank(self.learned["weights"])

    def _scan(self, views: Images) -> Scans:
        total = torch.zeros(len(views), views.shape[2], device=views.device)
        for responses in self._bank.chunks(views):
            total -= responses.abs().sum(dim=2)
        return total


def infomax_update(
    weights: Float32[torch.Tensor, "units inputs"], view: Float32[torch.Tensor, " inputs"], rate: float
) -> None:
    """Add rate (W - (y + u) u^T W) to the weights, in place: u^T W is a vector, so this is an update of rank one."""
    u = weights @ view
    back = u @ weights
    weights.addr_(torch.tanh(u) + u, back, beta=1 + rate, alpha=-rate)
