"""The thesis's classifier (section 4.4): a multi-layer perceptron that tells views along the route from turned ones."""

import numpy as np
import torch
from jaxtyping import Float32
from torch import nn

from ..familiarity import Images, check_scan, check_training
from ..rotation import FilterBank


class MLP:
    """One hidden layer of ReLU units, trained by Adam on each view (on route) and on each view turned (off route).

    hidden: units. negative_turn: how far the off-route view is turned (rad): right and left in turn, view by view.
    iterations: passes over the data at most; training ends earlier when the loss has not fallen by `tolerance` in ten passes.
    learning_rate, batch_size, penalty (L2): as scikit-learn's MLPClassifier has them, which the thesis used.
    Familiarity is the log-odds of "on route", which orders views as the probability does but does not saturate.
    """

    def __init__(
        self, *, hidden: int = 100, negative_turn: float = np.pi / 3, iterations: int = 600, tolerance: float = 1e-4,
        learning_rate: float = 1e-3, batch_size: int = 200, penalty: float = 1e-4, seed: int = 0,
    ):  # fmt: skip
        self.hidden, self.negative_turn = hidden, negative_turn
        self.iterations, self.tolerance = iterations, tolerance
        self.learning_rate, self.batch_size, self.penalty = learning_rate, batch_size, penalty
        self.seed = seed
        self.shape: tuple[int, ...] | None = None

    def fit(self, views: Images) -> "MLP":
        """Train from scratch on the views and their turned copies."""
        check_training(views)
        random = torch.Generator().manual_seed(self.seed)
        images, labels = self.training_data(views)
        inputs = images.flatten(start_dim=1)
        first, second = _layer(inputs.shape[1], self.hidden, random), _layer(self.hidden, 1, random)
        parameters = [*first, *second]
        optimiser = torch.optim.Adam(parameters, lr=self.learning_rate)
        best, passes_since = torch.inf, 0
        for _ in range(self.iterations):
            total = 0.0
            for batch in torch.randperm(len(inputs), generator=random).split(self.batch_size):
                logits = _forward(inputs[batch], first, second)
                loss = nn.functional.binary_cross_entropy_with_logits(logits, labels[batch])
                loss = loss + 0.5 * self.penalty * (first[0].square().sum() + second[0].square().sum()) / len(batch)
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                total += loss.item() * len(batch) / len(inputs)
            passes_since = 0 if total < best - self.tolerance else passes_since + 1
            best = min(best, total)
            if passes_since > 10:
                break
        self.shape = tuple(views.shape[1:])
        weights, self._bias = (parameter.detach() for parameter in first)
        self._output, self._output_bias = (parameter.detach() for parameter in second)
        self._bank = FilterBank(weights.reshape(self.hidden, *self.shape))
        return self

    def training_data(self, views: Images) -> tuple[Float32[torch.Tensor, "2*n h w"], Float32[torch.Tensor, " 2*n"]]:
        """Views and their turned copies (first right, then left, and so on), labelled 1 and 0."""
        columns = round(self.negative_turn / (2 * np.pi) * views.shape[-1])
        turned = torch.stack(
            [torch.roll(view, columns if i % 2 else -columns, dims=-1) for i, view in enumerate(views)]
        )
        return torch.cat([views, turned]), torch.cat([torch.ones(len(views)), torch.zeros(len(views))])

    def scan(self, views: Images) -> Float32[torch.Tensor, "n w"]:
        """Log-odds of "on route" of each rotation: the hidden units' weights are the engine's filters."""
        check_scan(views, self.shape)
        responses = self._bank.responses(views)  # (n, hidden, w)
        activity = torch.relu(responses + self._bias[:, None])
        return torch.einsum("nmw,m->nw", activity, self._output[0]) + self._output_bias


def _layer(inputs: int, outputs: int, random: torch.Generator) -> list[torch.Tensor]:
    """Weights (outputs, inputs) and biases, uniform within Glorot's bound."""
    bound = (6 / (inputs + outputs)) ** 0.5
    weights = (torch.rand(outputs, inputs, generator=random) * 2 - 1) * bound
    biases = (torch.rand(outputs, generator=random) * 2 - 1) * bound
    return [weights.requires_grad_(), biases.requires_grad_()]


def _forward(inputs: torch.Tensor, first: list[torch.Tensor], second: list[torch.Tensor]) -> torch.Tensor:
    """Logits (n,) of flattened views (n, pixels)."""
    return nn.functional.linear(torch.relu(nn.functional.linear(inputs, *first)), *second)[:, 0]
