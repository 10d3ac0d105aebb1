"""A restricted Boltzmann machine: a generative model of the route's views, trained without negatives."""

from dataclasses import dataclass

import torch
from torch.nn.functional import softplus

from .base import Images, Learned, Model, Scans
from .filter_bank import FilterBank


@dataclass(kw_only=True, eq=False)
class RBM(Model):
    """Binary hidden units over Gaussian visible ones of unit variance; familiarity is minus the free energy of a view.

    F(v) = |v - b|^2 / 2 - sum over units j of log(1 + exp(c_j + w_j . v)), up to a constant minus the log-probability of the view.
    Trained by contrastive divergence with one step (CD-1). Section 3.3.2 of the thesis. Constant memory.

    units: hidden ones. epochs: passes over the views. rate, momentum, batch_size: of the gradient ascent.
    scale: the view is multiplied by this first, which sets how much noise a visible unit has.
    """

    name = "rbm"
    paper = "Hinton 2002; Philippides et al. 2015"

    LIMITS = {"momentum": (0.0, 0.999)}  # noqa: RUF012
    units: int = 200
    epochs: int = 50
    rate: float = 1e-3
    momentum: float = 0.9
    batch_size: int = 20
    scale: float = 1.0

    def _learn(self, views: Images) -> Learned:
        random = self._random()
        data = self.scale * views.flatten(start_dim=1)
        inputs = data.shape[1]
        weights = 0.01 * torch.randn(self.units, inputs, generator=random).to(self.device)
        visible, hidden = data.mean(dim=0), torch.zeros(self.units, device=self.device)
        velocity = [torch.zeros_like(each) for each in (weights, visible, hidden)]
        for _ in range(self.epochs):
            for batch in torch.randperm(len(data), generator=random).split(self.batch_size):
                seen = data[batch.to(self.device)]
                on = torch.sigmoid(hidden + seen @ weights.T)
                sample = (torch.rand(on.shape, generator=random).to(self.device) < on).float()
                dreamt = visible + sample @ weights
                on_again = torch.sigmoid(hidden + dreamt @ weights.T)
                gradients = (on.T @ seen - on_again.T @ dreamt, (seen - dreamt).sum(dim=0), (on - on_again).sum(dim=0))
                for parameter, speed, gradient in zip((weights, visible, hidden), velocity, gradients, strict=True):
                    speed.mul_(self.momentum).add_(gradient, alpha=self.rate / len(batch))
                    parameter += speed
        shape = views.shape[1:]
        return {"weights": weights.reshape(-1, *shape), "visible": visible.reshape(shape), "hidden": hidden}

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"weights": (self.units, height, width), "visible": (height, width), "hidden": (self.units,)}

    def _prepare(self) -> None:
        hidden = self.learned["hidden"]
        filters = torch.cat([self.learned["weights"], self.learned["visible"][None]])
        self._bank = FilterBank(filters, torch.cat([hidden, hidden.new_zeros(1)]))

    def _scan(self, views: Images) -> Scans:
        responses = self._bank.responses(self.scale * views)  # (n, w, units + 1)
        visible = self.learned["visible"]
        squared = (
            (self.scale * views).square().sum(dim=(1, 2))[:, None] - 2 * responses[..., -1] + visible.square().sum()
        )
        return softplus(responses[..., :-1]).sum(dim=2) - squared / 2
