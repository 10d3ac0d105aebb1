"""A restricted Boltzmann machine: a generative model of the route's views, trained without negatives."""

import torch
from torch.nn.functional import softplus

from tussock.world.settings import number, whole

from ..feature_mask import energies
from .base import Images, Learned, Model, Scans, Scores, Shapes, model
from .filter_bank import FilterBank
from .rotations import linear_each, one_by_one

Parameters = tuple[torch.Tensor, torch.Tensor, torch.Tensor]  # weights, visible biases, hidden biases


@model
class RBM(Model):
    """Binary hidden units over Gaussian visible ones of unit variance; familiarity is minus the free energy of a view.

    F(v) = |v - b|^2 / 2 - sum over units j of log(1 + exp(c_j + w_j . v)), up to a constant minus the log-probability of the view.
    Trained by contrastive divergence with one step (CD-1). Section 3.3.2 of the thesis. Constant memory.

    Attributes:
        units: Number of hidden units.
        epochs: Passes over the views.
        rate: Learning rate of the gradient ascent.
        momentum: Of the gradient ascent.
        batch_size: Views per step.
        scale: The views are multiplied by this first; it decides how much noise a visible unit has.
    """

    name = "rbm"
    paper = "Hinton 2002; Philippides et al. 2015"
    takes_mask = True

    units: int = whole(200)
    epochs: int = whole(50)
    rate: float = number(1e-3, low=0)
    momentum: float = number(0.9, low=0, high=0.999)
    batch_size: int = whole(20)
    scale: float = number(1.0, low=0)

    def _learn(self, views: Images) -> Learned:
        random = self._random()
        data = self.scale * self._pixels(views)
        weights = 0.01 * torch.randn(self.units, data.shape[1], generator=random).to(self.device)
        visible, hidden = data.mean(dim=0), torch.zeros(self.units, device=self.device)
        parameters = (weights, visible, hidden)
        velocities = [torch.zeros_like(each) for each in parameters]
        for _ in range(self.epochs):
            for batch in torch.randperm(len(data), generator=random).split(self.batch_size):
                gradients = self._gradients(data[batch.to(self.device)], parameters, random)
                for parameter, velocity, gradient in zip(parameters, velocities, gradients, strict=True):
                    velocity.mul_(self.momentum).add_(gradient, alpha=self.rate / len(batch))
                    parameter += velocity
        shape = views.shape[1:]
        return {
            "weights": self._as_filters(weights, shape),
            "visible": self._as_filters(visible[None], shape)[0],
            "hidden": hidden,
        }

    def _gradients(self, data: torch.Tensor, parameters: Parameters, random: torch.Generator) -> Parameters:
        """Of the log-probability of a batch by each of the parameters, by CD-1."""
        weights, visible, hidden = parameters
        on = torch.sigmoid(hidden + data @ weights.T)
        sample = (torch.rand(on.shape, generator=random).to(self.device) < on).float()
        reconstruction = visible + sample @ weights
        on_again = torch.sigmoid(hidden + reconstruction @ weights.T)
        of_weights = on.T @ data - on_again.T @ reconstruction
        return of_weights, (data - reconstruction).sum(dim=0), (on - on_again).sum(dim=0)

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"weights": (self.units, height, width), "visible": (height, width), "hidden": (self.units,)}

    def _prepare(self) -> None:
        hidden = self.learned["hidden"]
        filters = torch.cat([self.learned["weights"], self.learned["visible"][None]])
        self._scaled = None if self.mask is None else self.mask.scaled(self.scale)
        self._responses = FilterBank(filters, torch.cat([hidden, hidden.new_zeros(1)]), self._scaled).responses

    def _scan(self, views: Images) -> Scans:
        if self._scaled is None:
            views = self.scale * views
        responses = self._responses(views)  # (n, w, units + 1)
        of_visible = self.learned["visible"].square().sum()
        squared = energies(views, self._scaled) - 2 * responses[..., -1] + of_visible
        return (softplus(responses[..., :-1]).sum(dim=2) - squared / 2).float()

    def _score(self, views: Images) -> Scores:
        pixels = self.scale * self._seen(views).flatten(start_dim=1)
        responses = linear_each(pixels, self.learned["weights"].flatten(start_dim=1), self.learned["hidden"])
        squared = (pixels - self.learned["visible"].flatten()).square().sum(dim=1)
        return one_by_one(lambda each: softplus(each).sum(), responses) - squared / 2
