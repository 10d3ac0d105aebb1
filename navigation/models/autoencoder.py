"""An autoencoder: what it cannot reconstruct it has not seen."""

from dataclasses import dataclass

import torch

from .base import Images, Learned, Model, Scans
from .filter_bank import FilterBank


@dataclass(kw_only=True, eq=False)
class Autoencoder(Model):
    """One hidden layer of tanh units with tied weights; familiarity is minus the RMS error of the reconstruction.

    h = tanh(W v + c), reconstruction r = W^T h + b. At all rotations without forming one: |v - r|^2 = |v|^2 - 2 v . r + |r|^2, where
    v . r = h . W v + b . v and |r|^2 = h^T (W W^T) h + 2 h . W b + |b|^2. Trained by Adam. Constant memory.

    units: hidden ones. epochs: passes over the views. rate, batch_size: of Adam. noise: standard deviation of the noise added to
    the views while training (denoising), in theirs.
    """

    name = "autoencoder"
    paper = "Vincent et al. 2008; Philippides et al. 2015"

    LIMITS = {"units": (1, 10_000)}  # noqa: RUF012 (the units' overlaps are its square)
    units: int = 100
    epochs: int = 50
    rate: float = 1e-3
    batch_size: int = 20
    noise: float = 0.5

    def _learn(self, views: Images) -> Learned:
        random = self._random()
        data = views.flatten(start_dim=1)
        inputs = data.shape[1]
        weights = (torch.randn(self.units, inputs, generator=random) / inputs**0.5).to(self.device).requires_grad_()
        hidden = torch.zeros(self.units, device=self.device, requires_grad=True)
        visible = data.mean(dim=0).requires_grad_()
        spread = data.std()
        optimiser = torch.optim.Adam([weights, hidden, visible], lr=self.rate)
        for _ in range(self.epochs):
            for batch in torch.randperm(len(data), generator=random).split(self.batch_size):
                seen = data[batch.to(self.device)]
                noisy = seen + self.noise * spread * torch.randn(seen.shape, generator=random).to(self.device)
                rebuilt = torch.tanh(noisy @ weights.T + hidden) @ weights + visible
                optimiser.zero_grad()
                (rebuilt - seen).square().mean().backward()
                optimiser.step()
        shape = views.shape[1:]
        return {
            "weights": weights.detach().reshape(-1, *shape), "visible": visible.detach().reshape(shape), "hidden": hidden.detach(),
        }  # fmt: skip

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"weights": (self.units, height, width), "visible": (height, width), "hidden": (self.units,)}

    def _prepare(self) -> None:
        weights, visible = self.learned["weights"].flatten(start_dim=1), self.learned["visible"].flatten()
        self._bank = FilterBank(torch.cat([self.learned["weights"], self.learned["visible"][None]]))
        self._overlap, self._lean, self._rest = weights @ weights.T, weights @ visible, visible @ visible

    def _scan(self, views: Images) -> Scans:
        responses = self._bank.responses(views)  # (n, w, units + 1)
        drive, bias = responses[..., :-1], responses[..., -1]
        h = torch.tanh(drive + self.learned["hidden"])
        product = (h * drive).sum(dim=2) + bias
        rebuilt = (h * (h @ self._overlap)).sum(dim=2) + 2 * (h @ self._lean) + self._rest
        squared = views.square().sum(dim=(1, 2))[:, None] - 2 * product + rebuilt
        return -(squared.clamp(min=0) / views[0].numel()).sqrt()
