"""A network trained to pick the right rotation of each view out of all its rotations."""

import math
from collections.abc import Iterator
from itertools import islice

import torch
from jaxtyping import Float32, Int64
from torch.nn.functional import log_softmax, relu

from tussock.world.errors import SettingError
from tussock.world.settings import number, whole

from .base import Images, Learned, Model, Scans, Scores, Shapes, model
from .filter_bank import FilterBank
from .rotations import gaussian, linear_each, one_by_one


@model
class MLPRotation(Model):
    """One hidden layer of ReLU units whose output at all rotations of a view is a softmax: every wrong rotation is a negative.

    The target is a Gaussian over the rotations about the learned heading, so that neighbours are nearly as good. While it learns,
    the columns of views jitter, as they do between positions close to each other, and noise keeps it from learning the views by
    heart. Familiarity is the network's output. Constant memory.

    Attributes:
        units: Hidden units of each network.
        target_deg: Standard deviation of the target (deg).
        noise: Standard deviation of the noise on the views, as a share of theirs.
        jitter_deg: Standard deviation of the shift of their columns (deg).
        steps: Of the training, by AdamW; None means as many as there are views, at least 500.
        rate: Largest learning rate.
        batch_size: Views per step.
        weight_decay: Of AdamW.
    """

    name = "mlp-rotation"
    paper = "the thesis's network, trained on all rotations; here"
    takes_mask = True
    renamed = {"sway_deg": "jitter_deg", "penalty": "weight_decay"}  # noqa: RUF012

    units: int = whole(100)
    target_deg: float = number(6.0, low=0.1, high=180, unit="deg")
    noise: float = number(1.5, low=0)
    jitter_deg: float = number(6.0, low=0, unit="deg")
    steps: int | None = whole(None, optional=True)
    rate: float = number(5e-3, low=0)
    batch_size: int = whole(50)
    weight_decay: float = number(0.3, low=0)

    def segment_of(self, views: Images) -> Int64[torch.Tensor, " n"]:
        """Which of several networks each training view is for: here there is one."""
        return torch.zeros(len(views), dtype=torch.int64)

    def _learn(self, views: Images) -> Learned:
        random = self._random()
        segment = self.segment_of(self._seen(views))
        n, height, width = views.shape
        steps = self.steps or max(500, n)
        networks = int(segment.max()) + 1
        weights = torch.randn(networks * self.units, height, width, generator=random) / (height * width) ** 0.5
        biases = torch.zeros(networks * self.units)
        output = torch.randn(networks, self.units, generator=random) / self.units**0.5
        parameters = [self._on_device(each).requires_grad_() for each in (weights, biases, output)]

        target = self._on_device(gaussian(width, math.radians(self.target_deg)))
        noise = self.noise * float(self._pixels(views).std())
        optimiser = torch.optim.AdamW(parameters, lr=self.rate, weight_decay=self.weight_decay, fused=True)
        schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: rate_share(step / steps))
        for batch in islice(batches(n, self.batch_size, random), steps):
            seen = jittered(views[self._on_device(batch)], math.radians(self.jitter_deg), random)
            grain = self._on_device(torch.randn(seen.shape, generator=random))
            if self.mask is None:
                responses = self._bank(*parameters[:2]).responses(seen.add_(grain, alpha=noise))
            else:  # the noise is added to what is normalised
                responses = self._bank(*parameters[:2]).responses(seen)
                responses = responses + FilterBank(parameters[0], mask=self.mask.linear()).responses(noise * grain)
            outputs = network_outputs(responses, parameters[2])  # (n, w, networks)
            log_shares = log_softmax(outputs.flatten(start_dim=1), dim=1).reshape(outputs.shape)
            loss = -(log_shares[torch.arange(len(batch)), :, segment[batch]] @ target).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        return dict(zip(("weights", "biases", "output"), (each.detach() for each in parameters), strict=True))

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and each network has its units."""
        super().check_learned(shape, learned)
        units = learned["output"].numel()
        if not len(learned["weights"]) == len(learned["biases"]) == units:
            raise SettingError(f"{self.name}: {len(learned['weights'])} weights for {units} units")

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"weights": (None, height, width), "biases": (None,), "output": (None, self.units)}

    def _prepare(self) -> None:
        self._responses = self._bank(self.learned["weights"], self.learned["biases"]).responses

    def _outputs(self, views: Images) -> Float32[torch.Tensor, "n w networks"]:
        return one_by_one(
            lambda responses: network_outputs(responses[None], self.learned["output"])[0], self._responses(views)
        )

    def _scan(self, views: Images) -> Scans:
        return self._familiarity(self._outputs(views))

    def _score(self, views: Images) -> Scores:
        weights, biases = self.learned["weights"].flatten(start_dim=1), self.learned["biases"]
        activity = relu(linear_each(self._seen(views).flatten(start_dim=1), weights, biases))
        return self._familiarity(linear_each(activity, readout(self.learned["output"]).T))

    def _familiarity(self, outputs: Float32[torch.Tensor, "*views networks"]) -> Float32[torch.Tensor, "*views"]:
        """Of views with such outputs."""
        return outputs[..., 0]


def jittered(views: Images, deviation: float, random: torch.Generator) -> Images:
    """Views whose columns are each shifted by a smooth random amount, as they are where the eye stands at a position close by.

    The shift is a sum of three waves around the circle, of random size and phase: what is near moves against what lies ahead and
    behind.

    Args:
        views: (n, h, w)
        deviation: Standard deviation (rad) of the shift over columns and views.
        random: On the CPU, so that the shifts are the same on all devices.
    """
    n, _, width = views.shape
    columns = torch.arange(width)
    phases = torch.outer(torch.tensor([1, 2, 3]), columns * (2 * math.pi / width))
    sizes = torch.randn(n, 6, generator=random) * (deviation * width / (2 * math.pi) / math.sqrt(3))
    shifted = columns + sizes @ torch.cat([phases.sin(), phases.cos()])
    floor = shifted.floor()
    column, share = floor.long().to(views.device), (shifted - floor).to(views.device)[:, None]
    left, right = (views.gather(2, (column + step).remainder(width)[:, None].expand(views.shape)) for step in (0, 1))
    return torch.lerp(left, right, share)


def batches(n: int, size: int, random: torch.Generator) -> Iterator[torch.Tensor]:
    """Random indices below n without end: all of them, in batches, before any comes again."""
    while True:
        yield from torch.randperm(n, generator=random).split(size)


def rate_share(done: float) -> float:
    """Share of the largest learning rate when a share of the training is done: up in the first tenth, then down along a cosine."""
    return min(1.0, 10 * done + 0.01) * 0.5 * (1 + math.cos(math.pi * done))


def network_outputs(
    responses: Float32[torch.Tensor, "n w all_units"], output: Float32[torch.Tensor, "networks units"]
) -> Float32[torch.Tensor, "n w networks"]:
    """Output of networks that see the same views, from the inputs of the units of all of them, one network after the other."""
    return relu(responses) @ readout(output)


def readout(output: Float32[torch.Tensor, "networks units"]) -> Float32[torch.Tensor, "all_units networks"]:
    """Weights of the units of all networks, one network after the other, in the output of each."""
    own = torch.eye(len(output), device=output.device)
    return (output[:, :, None] * own[:, None]).flatten(0, 1)
