"""Home vector: a small network, trained on a learning flight, tells from a view where home is (Bee-Nav)."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
import torch
from jaxtyping import Float
from torch.nn.functional import conv1d, pad

from tussock.world.geometry import column_azimuths
from tussock.world.settings import number, settings, whole

from ..models.rotations import one_by_one
from ..threads import one_torch_thread
from .navigator import Images, Look, Motion
from .places import Places, needs_places

KERNEL = 5  # columns that a unit looks at
WEIGHT_BYTES = 4
BATCH = 16  # views per step of the training
MIN_SCALE = 1e-6  # m

Vectors = Float[torch.Tensor, "n 2"]  # ahead and to the left
Layer = tuple[torch.Tensor, torch.Tensor]  # weights (units out, units in, kernel) and biases (units out,)


@settings
class HomeVector:
    """Turns to the home vector that a network finds in the view; its step shortens with the vector.

        home = 1/w sum of a(column) u(column),    step = slowest + (1 - slowest) |home| / whole_step_at, at most 1

    The network gives each of the w columns of the view a weight a, and u is the unit vector in which the column looks, seen from the
    agent. It is convolutional around the horizon, so a view that is turned gives the same vector, turned; and a mirrored view gives
    the mirrored vector. So one view of each place is enough, and no compass is needed: the original learns views in all rotations
    instead. It is trained to predict the way home that the agent's path integration measured on its learning flight. Bee-Nav:
    "Efficient robot navigation inspired by honeybee learning flights", Nature (2026).

    Attributes:
        memory_kb: Size of the network (kB, of 4 bytes a weight): it has as many units as fit. The original's are of 3.4 and 42 kB.
        passes: Over the views of the learning flight.
        rate: Learning rate of AdamW.
        slowest: The shortest step, as a share of a whole one.
        whole_step_at: Length of the home vector from which on steps are whole (m).
        seed: Of the first weights, and of the order of the views.
    """

    memory_kb: float = number(3.4, above=0, high=1e5, unit="kB")
    passes: int = whole(60)
    rate: float = number(5e-3, above=0)
    slowest: float = number(0.2, above=0, high=1)
    whole_step_at: float = number(0.5, above=0, unit="m")
    seed: int = whole(0, low=0)
    network: "Network" = attrs.field(init=False)

    def learn(self, views: Images) -> None:
        """Refuse views without places. Raises SettingError."""
        raise needs_places("home-vector")

    def learn_at(self, views: Images, places: Places) -> None:
        """Train the network on the views (n, h, w) of a learning flight and the ways home from their places."""
        with one_torch_thread():
            network = Network(views, units_within(1000 * self.memory_kb / WEIGHT_BYTES, views.shape[1]), self.seed)
            network.train(views, ways_home(places), self.passes, self.rate)
        object.__setattr__(self, "network", network)

    def begin(self) -> None:
        """An agent remembers nothing from look to look."""

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent to its home vector."""
        with torch.no_grad():
            ahead, left = one_by_one(lambda view: self.network(view[None])[0], look.views).double().numpy().T
        length, turn = np.hypot(ahead, left), np.arctan2(left, ahead)
        step = (self.slowest + (1 - self.slowest) * length / self.whole_step_at).clip(max=1.0)
        direction = look.compass + turn
        home = length[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
        return Motion(turn=turn, step=step, signals={"home_vector": home})


def ways_home(places: Places) -> Vectors:
    """The way home from each place, ahead and to the left (m)."""
    x, y, heading = places.T
    cos, sin = np.cos(heading), np.sin(heading)
    return torch.as_tensor(np.column_stack([-x * cos - y * sin, x * sin - y * cos]), dtype=torch.float32)


def units_within(weights: float, rows: int) -> int:
    """The greatest number of units whose network has no more weights than this, but at least 1.

    Args:
        weights: Number of weights and biases.
        rows: Of the views.
    """
    units = 1
    while weights_of(units + 1, rows) <= weights:
        units += 1
    return units


def weights_of(units: int, rows: int) -> int:
    """Number of weights and biases of a network with three layers of units, and one unit in the last."""
    return KERNEL * units * (rows + 2 * units) + 3 * units + units + 1


class Network:
    """A convolutional network around the horizon, of three layers, whose output is a home vector.

    Attributes:
        layers: Weights and biases.
        dilations: Columns between those that a unit of each layer looks at. Together the layers see most of the horizon.
        mean: (h, 1) Mean of each row of the views that it learned.
        deviation: Standard deviation of their pixels.
        scale: Root mean square of the ways home that it learned (m).
    """

    def __init__(self, views: Images, units: int, seed: int):
        """A network with random weights for views (n, h, w), as He et al. (2015) draw them."""
        self.random = torch.Generator().manual_seed(seed)
        shapes = [(units, views.shape[1], KERNEL), (units, units, KERNEL), (units, units, KERNEL), (1, units, 1)]
        self.layers: list[Layer] = [
            (torch.randn(shape, generator=self.random) * (2 / (shape[1] * shape[2])) ** 0.5, torch.zeros(shape[0]))
            for shape in shapes
        ]
        width = views.shape[2]
        self.dilations = (1, max(1, width // 20), max(1, width // 5))
        azimuths = torch.as_tensor(column_azimuths(width), dtype=torch.float32)
        self.directions = torch.stack([azimuths.cos(), azimuths.sin()], dim=1)  # (w, 2)
        self.mean = views.mean(dim=(0, 2))[:, None]
        self.deviation = float((views - self.mean).std(correction=0).clamp(min=1e-6))
        self.scale = 1.0

    def __call__(self, views: Images) -> Vectors:
        """The home vectors of views (n, h, w) (m): the mean of those of the views and of their mirror images, mirrored back."""
        inputs = (views - self.mean) / self.deviation
        direct, mirrored = self._vectors(inputs), self._vectors(inputs.flip(2))
        return self.scale * (direct + mirrored * torch.tensor([1.0, -1.0])) / 2

    def _vectors(self, inputs: torch.Tensor) -> Vectors:
        *hidden, last = self.layers
        for layer, dilation in zip(hidden, self.dilations, strict=True):
            reach = dilation * (KERNEL // 2)
            inputs = conv1d(pad(inputs, (reach, reach), mode="circular"), *layer, dilation=dilation).relu()
        return conv1d(inputs, *last)[:, 0] @ self.directions / len(self.directions)

    def train(self, views: Images, ways: Vectors, passes: int, rate: float) -> None:
        """Learn the ways home (n, 2) of views (n, h, w) (m), by the mean squared error."""
        self.scale = max(float(ways.square().sum(dim=1).mean().sqrt()), MIN_SCALE)
        parameters = [each.requires_grad_() for layer in self.layers for each in layer]
        optimiser = torch.optim.AdamW(parameters, lr=rate)
        steps = passes * -(-len(views) // BATCH)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
        for _ in range(passes):
            for batch in torch.randperm(len(views), generator=self.random).split(BATCH):
                loss = ((self(views[batch]) - ways[batch]) / self.scale).square().sum(dim=1).mean()
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                schedule.step()
        self.layers = [(weights.detach(), biases.detach()) for weights, biases in self.layers]
