"""Infomax: learn a view, discard it, keep only how the network changed."""

import torch
from jaxtyping import Float32

from tussock.world.settings import number, whole

from .base import Images, Learned, Scans, Scores, Shapes, model
from .checks import MAX_VALUE
from .filter_bank import FilterBank
from .incremental import IncrementalModel
from .rotations import linear_each
from .spectra import Spectra

# Presets of the rate: eta / N of one update, for `units` units of `inputs` inputs.
RATES = {
    # for views of mean 0 and variance 1, as the edges encoding makes
    "z-scored": lambda inputs, units: 1.0 / (inputs * units),
    # for views in 0..1 (BoB robotics)
    "unit-range": lambda inputs, units: 0.97 / (inputs * units),
    # Baddeley et al. 2012; Knight et al. 2019
    "baddeley": lambda inputs, units: 0.01 / units,
}
UNITS = (
    2500  # units whose inputs at all rotations are computed at once behind a mask; limits the memory that this takes
)
BLOCK = 128  # units whose weights are read and changed at once, so that they stay in the processor's cache

Change = tuple[Float32[torch.Tensor, " units"], Float32[torch.Tensor, " inputs"]]  # y + u, and u^T W


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
        weights = learned["weights"].clone()
        change = None
        for _ in range(self.traversals):
            for view in self._seen(views):
                change = infomax_change(weights.flatten(start_dim=1), view.flatten(), self._rate(weights), change)
        if change is not None:
            enter(weights.flatten(start_dim=1), change, self._rate(weights))
        return {"weights": weights}

    def _learn_more(self, shape: tuple[int, int], views: Images) -> None:
        """One view changes the weights in place, where nobody else holds them and they certainly stay bounded."""
        self._check_form(shape, self._learned)
        if self._lent or len(views) * self.traversals > 1:
            return self._replace(shape, views)
        weights = self._learned["weights"]
        rate = self._rate(weights)
        change = infomax_change(weights.flatten(start_dim=1), self._seen(views).flatten(), rate)
        bound = (1 + rate) * self._bound + rate * float(change[0].abs().max()) * float(change[1].abs().max())
        if not bound <= MAX_VALUE:
            return self._replace(shape, views)
        self._forget_banks()
        self._bound = bound
        return enter(weights.flatten(start_dim=1), change, rate)

    def _replace(self, shape: tuple[int, int], views: Images) -> None:
        super()._learn_more(shape, views)
        self._lent = False  # they are new

    def _rate(self, weights: Float32[torch.Tensor, "units h w"]) -> float:
        """eta / N."""
        return (
            self.rate
            if not isinstance(self.rate, str)
            else RATES[self.rate](self._size(*weights.shape[1:]), len(weights))
        )

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"weights": (self.units or self._size(height, width), height, width)}

    def _prepare(self) -> None:
        self._forget_banks()
        self._bound = float(self._learned["weights"].abs().max())  # of the absolute weights

    def _forget_banks(self) -> None:
        """The weights change: what scans need is made of them at the next one."""
        self._spectra: Spectra | None = None
        self._banks: list[FilterBank] | None = None

    def _scan(self, views: Images) -> Scans:
        weights = self._learned["weights"]
        if self.mask is not None:
            self._banks = self._banks or [self._bank(some) for some in weights.split(UNITS)]
            return -sum(bank.responses(views).abs_().sum(dim=2) for bank in self._banks)  # type: ignore[return-value]
        self._spectra = self._spectra or Spectra(weights)
        activity = torch.zeros(len(views), views.shape[2], device=views.device)
        for chunk in self._spectra.chunks(views):
            activity[chunk.views] += chunk.absolute()
        return -activity

    def _score(self, views: Images) -> Scores:
        weights = self._learned["weights"].flatten(start_dim=1)
        return -linear_each(self._seen(views).flatten(start_dim=1), weights).abs().sum(dim=1)


def infomax_update(
    weights: Float32[torch.Tensor, "units inputs"], view: Float32[torch.Tensor, " inputs"], rate: float
) -> None:
    """Add rate (W - (y + u) u^T W) to the weights, in place."""
    enter(weights, infomax_change(weights, view, rate), rate)


def infomax_change(
    weights: Float32[torch.Tensor, "units inputs"],
    view: Float32[torch.Tensor, " inputs"],
    rate: float,
    pending: Change | None = None,
) -> Change:
    """What a view changes: y + u and u^T W. As u^T W is a vector, the change is of rank one.

    The time goes into reading the weights. So all that is done to a block of them is done while it is in the processor's cache: the
    change by the view before this one, where it is still `pending`, is entered, too.
    """
    u, back = weights.new_empty(len(weights)), torch.zeros_like(view)
    for start in range(0, len(weights), BLOCK):
        rows = slice(start, start + BLOCK)
        if pending is not None:
            enter(weights[rows], (pending[0][rows], pending[1]), rate)
        torch.mv(weights[rows], view, out=u[rows])
        back.addmv_(weights[rows].mT, u[rows])
    return torch.tanh(u) + u, back


def enter(weights: Float32[torch.Tensor, "units inputs"], change: Change, rate: float) -> None:
    """Add rate (W - (y + u) u^T W) to some units of the weights, in place."""
    weights.addr_(*change, beta=1 + rate, alpha=-rate)
