"""A network trained to pick the right rotation of each view out of all its rotations."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import torch
from jaxtyping import Float32, Int64
from torch.nn.functional import log_softmax, pad, relu

from tussock.world.errors import InputError

from .base import Images, Learned, Model, Scans
from .filter_bank import FilterBank, all_rotations, bell


@dataclass(kw_only=True, eq=False)
class MLPRotation(Model):
    """One hidden layer of ReLU units whose output at all rotations of a view is a softmax: every wrong rotation is a negative.

    The target is a Gaussian over the rotations about the learned heading, so that neighbours are nearly as good. While it learns,
    views sway as from places nearby, and noise keeps it from learning them by heart. Familiarity is the network's output.
    Constant memory.

    units: hidden ones. target_deg: standard deviation of the target. noise: standard deviation of the noise on the views, in
    theirs. sway_deg: standard deviation of the shift of their columns. steps: of the training, by Adam; None takes as many as
    there are views, at least 500. rate, batch_size, penalty (decoupled weight decay): of the training.
    """

    name = "mlp-rotation"
    paper = "the thesis's network, trained on all rotations; here"

    LIMITS = {"target_deg": (0.1, 180.0)}  # noqa: RUF012
    units: int = 100
    target_deg: float = 6.0
    noise: float = 1.5
    sway_deg: float = 6.0
    steps: int | None = None
    rate: float = 5e-3
    batch_size: int = 50
    penalty: float = 0.3

    def stretch_of(self, views: Images) -> Int64[torch.Tensor, " n"]:
        """Which of several networks each training view is for: here there is one."""
        return torch.zeros(len(views), dtype=torch.int64)

    def _learn(self, views: Images) -> Learned:
        random = self._random()
        stretch = self.stretch_of(views)
        n, height, width = views.shape
        steps = self.steps or max(500, n)
        networks = int(stretch.max()) + 1
        weights = torch.randn(networks * self.units, height, width, generator=random) / (height * width) ** 0.5
        biases = torch.zeros(networks * self.units)
        output = torch.randn(networks, self.units, generator=random) / self.units**0.5
        parameters = [self._here(each).requires_grad_() for each in (weights, biases, output)]
        weights, biases, output = parameters

        target = self._here(bell(width, math.radians(self.target_deg)))
        noise = self.noise * float(views.std())
        optimiser = torch.optim.AdamW(parameters, lr=self.rate, weight_decay=self.penalty, fused=True)
        schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: warmth(step / steps))
        for batch in islice(batches(n, self.batch_size, random), steps):
            swaying = swayed(views[self._here(batch)], math.radians(self.sway_deg), random)
            seen = swaying.add_(self._here(torch.randn(swaying.shape, generator=random)), alpha=noise)
            outputs = network_outputs(FilterBank(weights, biases), output, seen)  # (n, w, networks)
            chances = log_softmax(outputs.flatten(start_dim=1), dim=1).reshape(outputs.shape)
            right = chances[torch.arange(len(batch)), :, stretch[batch]]
            loss = -(right @ target).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        return {"weights": weights.detach(), "biases": biases.detach(), "output": output.detach()}

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and each network has its units."""
        super().check_learned(shape, learned)
        units = learned["output"].numel()
        if not len(learned["weights"]) == len(learned["biases"]) == units:
            raise InputError(f"{self.name}: {len(learned['weights'])} weights for {units} units")

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"weights": (None, height, width), "biases": (None,), "output": (None, self.units)}

    def _prepare(self) -> None:
        self._bank = FilterBank(self.learned["weights"], self.learned["biases"])

    def _outputs(self, views: Images) -> torch.Tensor:
        return network_outputs(self._bank, self.learned["output"], views)

    def _scan(self, views: Images) -> Scans:
        return self._outputs(views)[..., 0]


def swayed(views: Images, deviation: float, random: torch.Generator) -> Images:
    """Views whose columns are shifted by a smooth random amount each, as they are where the eye stands a little beside.

    The shift (rad) is a sum of three waves around the circle, of random size and phase: what is near moves against what lies
    ahead and behind. Its standard deviation over columns and views is `deviation`. The same generator shifts all devices alike.
    """
    n, _, width = views.shape
    columns = torch.arange(width)
    phases = torch.outer(torch.tensor([1, 2, 3]), columns * (2 * math.pi / width))
    sizes = torch.randn(n, 6, generator=random) * (deviation * width / (2 * math.pi) / math.sqrt(3))
    at = columns + sizes @ torch.cat([phases.sin(), phases.cos()])
    whole = at.floor()
    column, share = whole.long().to(views.device), (at - whole).to(views.device)[:, None]
    here, beside = (views.gather(2, (column + step).remainder(width)[:, None].expand(views.shape)) for step in (0, 1))
    return torch.lerp(here, beside, share)


def batches(n: int, size: int, random: torch.Generator) -> Iterator[torch.Tensor]:
    """Random indices below n without end: all of them, in batches, before any comes again."""
    while True:
        yield from torch.randperm(n, generator=random).split(size)


def warmth(done: float) -> float:
    """Share of the full rate when a share of the training is done: up in the first tenth, then down along a cosine."""
    return min(1.0, 10 * done + 0.01) * 0.5 * (1 + math.cos(math.pi * done))


def network_outputs(
    bank: FilterBank, output: Float32[torch.Tensor, "networks units"], views: Images
) -> Float32[torch.Tensor, "n w networks"]:
    """Output of networks that see the same views; the bank holds the units of all of them, one network after the other."""
    own = torch.eye(len(output), device=output.device)
    readout = (output[:, :, None] * own[:, None]).flatten(0, 1)  # (units of all networks, networks)
    left = right = torch.zeros((), device=output.device)
    for part, even, odd in bank.halves(views):
        weights = pad(readout[part], (0, 0, 0, even.shape[2] - (part.stop - part.start)))
        left, right = left + relu(even + odd) @ weights, right + relu(even - odd) @ weights
    return all_rotations(left, right, views.shape[2]).movedim(0, 1)
