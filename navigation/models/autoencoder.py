"""An autoencoder: views that it cannot reconstruct are unfamiliar."""

import torch
from jaxtyping import Float32

from tussock.world.settings import number, whole

from ..feature_mask import energies
from .base import Images, Learned, Model, Scans, Scores, Shapes, model
from .rotations import linear_each, one_by_one


@model
class Autoencoder(Model):
    """One hidden layer of tanh units with tied weights; familiarity is minus the RMS error of the reconstruction.

    h = tanh(W v + c), reconstruction r = W^T h + b. It is scored at all rotations without forming one: |v - r|^2 = |v|^2 - 2 v . r + |r|^2,
    where v . r = h . W v + b . v and |r|^2 = h^T (W W^T) h + 2 h . W b + |b|^2. Trained by Adam. Constant memory.

    Attributes:
        units: Number of hidden units.
        epochs: Passes over the views.
        rate: Learning rate of Adam.
        batch_size: Views per step of Adam.
        noise: Standard deviation of the noise added to the views while training (denoising), as a share of theirs.
    """

    name = "autoencoder"
    paper = "Vincent et al. 2008; Philippides et al. 2015"
    takes_mask = True

    units: int = whole(100, high=10_000)  # W W^T is its square
    epochs: int = whole(50)
    rate: float = number(1e-3, low=0)
    batch_size: int = whole(20)
    noise: float = number(0.5, low=0)

    def _learn(self, views: Images) -> Learned:
        random = self._random()
        data = self._pixels(views)
        inputs = data.shape[1]
        weights = (torch.randn(self.units, inputs, generator=random) / inputs**0.5).to(self.device).requires_grad_()
        hidden = torch.zeros(self.units, device=self.device, requires_grad=True)
        visible = data.mean(dim=0).requires_grad_()
        noise = self.noise * data.std()
        optimiser = torch.optim.Adam([weights, hidden, visible], lr=self.rate)
        for _ in range(self.epochs):
            for batch in torch.randperm(len(data), generator=random).split(self.batch_size):
                batch_views = data[batch.to(self.device)]
                noisy = batch_views + noise * torch.randn(batch_views.shape, generator=random).to(self.device)
                reconstruction = torch.tanh(noisy @ weights.T + hidden) @ weights + visible
                optimiser.zero_grad()
                (reconstruction - batch_views).square().mean().backward()
                optimiser.step()
        shape = views.shape[1:]
        return {
            "weights": self._as_filters(weights.detach(), shape),
            "visible": self._as_filters(visible.detach()[None], shape)[0],
            "hidden": hidden.detach(),
        }

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"weights": (self.units, height, width), "visible": (height, width), "hidden": (self.units,)}

    def _prepare(self) -> None:
        weights, visible = self.learned["weights"].flatten(start_dim=1), self.learned["visible"].flatten()
        self._responses = self._bank(torch.cat([self.learned["weights"], self.learned["visible"][None]])).responses
        self._encoder, self._decoder = weights, weights.T.contiguous()
        self._overlap, self._projection, self._energy = weights @ weights.T, weights @ visible, visible @ visible

    def _scan(self, views: Images) -> Scans:
        responses = self._responses(views)  # (n, w, units + 1)
        drive, bias = responses[..., :-1], responses[..., -1]
        h = torch.tanh(drive + self.learned["hidden"])
        product = (h * drive).sum(dim=2) + bias
        energy = one_by_one(self._energies, h)
        squared = energies(views, self.mask) - 2 * product + energy
        return -(squared.clamp(min=0) / self._size(*views.shape[1:])).sqrt().float()

    def _score(self, views: Images) -> Scores:
        pixels = self._seen(views).flatten(start_dim=1)
        h = torch.tanh(linear_each(pixels, self._encoder, self.learned["hidden"]))
        reconstruction = linear_each(h, self._decoder, self.learned["visible"].flatten())
        squared = (pixels - reconstruction).square().sum(dim=1)
        return -(squared / self._size(*views.shape[1:])).sqrt()

    def _energies(self, h: Float32[torch.Tensor, "w units"]) -> Float32[torch.Tensor, " w"]:
        """|r|^2 of the reconstructions."""
        return (h * (h @ self._overlap)).sum(dim=1) + 2 * (h @ self._projection) + self._energy
