"""The thesis's classifier: a multi-layer perceptron that tells views along the route from turned ones."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from scipy.optimize import minimize
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin
from threadpoolctl import threadpool_limits
from torch.nn.functional import binary_cross_entropy_with_logits, linear

from tussock.world.errors import InputError
from tussock.world.geometry import columns_of_turn

from .base import Images, Learned, Model, Scans, check_scan, check_training
from .filter_bank import FilterBank

ACTIVATIONS: dict[str, Callable[[torch.Tensor], torch.Tensor]] = {
    "identity": lambda x: x,
    "logistic": torch.sigmoid,
    "tanh": torch.tanh,
    "relu": torch.relu,
}
SMALL = 4 * 10**6  # multiplications in a pass over the views
PATIENCE = 10  # passes without progress after which sgd and adam stop

Layers = list[tuple[torch.Tensor, torch.Tensor]]  # weights (outputs, inputs) and biases (outputs,)


@dataclass(kw_only=True, eq=False, repr=False)
class MLP(ClassifierMixin, BaseEstimator, Model):
    """Trained on each view (on the route) and on turned copies of it (off the route); familiarity is the log-odds of "on".

    Section 4.4 of the thesis. Parameters are scikit-learn's MLPClassifier's, with its defaults but for max_iter, and so is what
    `fit(views, y)`, `predict`, `predict_proba` and `get_params` do: GridSearchCV takes it. `fit(views)` makes the negatives.
    The log-odds order views as the probability does, but do not saturate. Constant memory.

    hidden_layer_sizes: units of each hidden layer. activation: identity, logistic, tanh or relu. solver: lbfgs, sgd or adam.
    alpha: L2 penalty. tol: progress under which training ends. max_iter: passes over the views at most.
    negatives_deg: how far the copies are turned to the left; each view is given `negatives_each` of them, in rotation.
    """

    name = "mlp"
    paper = "the thesis, section 4.4"

    CHOICES = {"activation": ACTIVATIONS, "solver": ("lbfgs", "sgd", "adam")}  # noqa: RUF012
    hidden_layer_sizes: tuple[int, ...] | int = (100,)
    activation: str = "relu"
    solver: str = "adam"
    alpha: float = 1e-4
    batch_size: int = 200
    learning_rate_init: float = 1e-3
    max_iter: int = 600
    tol: float = 1e-4
    negatives_deg: tuple[float, ...] = (-60.0, 60.0)
    negatives_each: int = 1

    def fit(self, views: Images | Float[np.ndarray, "n ..."], y: Any = None) -> "MLP":
        """Train from scratch: on views (n, h, w) and the negatives made of them, or on views (n, h, w) or (n, pixels) and labels.

        y: labels (n,) of two different numbers, of which the larger stands for "on the route".
        """
        images = as_images(views)
        if y is None:
            return super().fit(images)
        self.check_parameters()
        check_training(images)
        found = np.asarray(y)
        if found.shape != (len(images),):
            raise InputError(f"{len(images)} views and labels of shape {found.shape}; give each view one")
        classes = np.unique(found) if found.dtype.kind in "biuf" else found
        if classes.dtype.kind not in "biuf" or not np.isfinite(classes).all() or len(classes) != 2:
            raise InputError(f"labels {classes[:4].tolist()}; give two different numbers")
        targets = torch.as_tensor(found == classes[1], dtype=torch.float32)
        learned = self._classify(self._here(images), targets, torch.as_tensor(classes))
        self.restore((images.shape[1], images.shape[2]), learned)
        return self

    def training_data(self, views: Images) -> tuple[Float32[torch.Tensor, "m h w"], Float32[torch.Tensor, " m"]]:
        """The views labelled 1, followed by turned copies of them labelled 0."""
        turns = [round(columns_of_turn(degrees, views.shape[-1], full_turn=360)) for degrees in self.negatives_deg]
        turned = [
            torch.roll(view, turns[(i + k) % len(turns)], dims=-1)
            for k in range(self.negatives_each)
            for i, view in enumerate(views)
        ]
        return torch.cat([views, torch.stack(turned)]), torch.cat([torch.ones(len(views)), torch.zeros(len(turned))])

    def decision_function(self, views: Images | Float[np.ndarray, "n ..."]) -> Float[np.ndarray, " n"]:
        """Log-odds of the second class for views as they are."""
        images = as_images(views)
        check_scan(images, self.shape)
        return forward(self._here(images.flatten(start_dim=1)), self._layers, self.activation).cpu().numpy()

    def predict_proba(self, views: Images | Float[np.ndarray, "n ..."]) -> Float[np.ndarray, "n 2"]:
        """Probability of each class for views as they are."""
        second = expit(self.decision_function(views).astype(float))
        return np.column_stack([1 - second, second])

    def predict(self, views: Images | Float[np.ndarray, "n ..."]) -> np.ndarray:
        """The more probable class of each view."""
        return self.classes_[(self.decision_function(views) > 0).astype(int)]

    @property
    def classes_(self) -> np.ndarray:
        """The two labels, the smaller first."""
        return self.learned["classes"].cpu().numpy()

    def _learn(self, views: Images) -> Learned:
        return self._classify(*self.training_data(views), torch.tensor([0, 1]))

    def _classify(
        self, images: Float32[torch.Tensor, "m h w"], targets: Float32[torch.Tensor, " m"], classes: torch.Tensor
    ) -> Learned:
        """A network that tells images whose target is 1 from those whose target is 0."""
        learned: Learned = {"classes": classes}
        for k, (weights, biases) in enumerate(self._train(images.flatten(start_dim=1), self._here(targets))):
            learned |= {f"weights{k}": weights, f"biases{k}": biases}
        return learned

    def _sizes(self, pixels: int) -> list[int]:
        """Units of each layer, from the input to the output."""
        hidden = self.hidden_layer_sizes
        return [pixels, *((hidden,) if isinstance(hidden, int) else hidden), 1]

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        shapes: dict[str, tuple[int | None, ...]] = {"classes": (2,)}
        for k, (before, after) in enumerate(pairwise(self._sizes(height * width))):
            shapes |= {f"weights{k}": (after, before), f"biases{k}": (after,)}
        return shapes

    def _prepare(self) -> None:
        assert self.shape is not None
        depth = sum(key.startswith("weights") for key in self.learned)
        self._layers = [(self.learned[f"weights{k}"], self.learned[f"biases{k}"]) for k in range(depth)]
        weights, biases = self._layers[0]
        self._bank = FilterBank(weights.reshape(-1, *self.shape), biases)

    def _scan(self, views: Images) -> Scans:
        """The first layer's weights are the engine's filters; the others see its units at each rotation."""
        activity = self._bank.responses(views)  # (n, w, units)
        rest = self._layers[1:]
        return forward(ACTIVATIONS[self.activation](activity), rest, self.activation)

    def _train(self, inputs: torch.Tensor, targets: torch.Tensor) -> Layers:
        """Fitted layers."""
        random = self._random()
        factor = 2 if self.activation == "logistic" else 6
        layers = []
        for before, after in pairwise(self._sizes(inputs.shape[1])):
            bound = (factor / (before + after)) ** 0.5  # Glorot's
            draw = [(torch.rand(shape, generator=random) * 2 - 1) * bound for shape in ((after, before), (after,))]
            layers.append(tuple(self._here(each) for each in draw))
        if self.solver != "adam" and inputs.shape[1] > len(inputs):
            inputs, layers[0], restored = in_span(inputs, layers[0])
        else:
            restored = None
        layers = [tuple(each.requires_grad_() for each in layer) for layer in layers]

        def loss(inputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
            fit = binary_cross_entropy_with_logits(forward(inputs, layers, self.activation), targets)
            return fit + 0.5 * self.alpha / len(inputs) * sum(weights.square().sum() for weights, _ in layers)

        parameters = [each for layer in layers for each in layer]
        products = len(inputs) * sum(weights.numel() for weights, _ in layers)
        # Small ones are quickest on one thread, and far quicker where other programs keep the cores busy.
        with threadpool_limits(1 if products < SMALL else None):
            if self.solver == "lbfgs":
                self._minimise(parameters, lambda: loss(inputs, targets))
            else:
                self._descend(parameters, loss, inputs, targets, random)
        fitted = [(weights.detach(), biases.detach()) for weights, biases in layers]
        return fitted if restored is None else [restored(*fitted[0]), *fitted[1:]]

    def _minimise(self, parameters: list[torch.Tensor], loss: Callable[[], torch.Tensor]) -> None:
        """L-BFGS on all data at once, as scikit-learn does it."""

        def value_and_gradient(flat: Float64[np.ndarray, " p"]) -> tuple[float, Float64[np.ndarray, " p"]]:
            with torch.no_grad():
                torch.nn.utils.vector_to_parameters(torch.as_tensor(flat).to(parameters[0]), parameters)
            value = loss()
            gradient = torch.autograd.grad(value, parameters)
            return value.item(), torch.cat([each.flatten() for each in gradient]).double().cpu().numpy()

        start = torch.nn.utils.parameters_to_vector(parameters).detach().double().cpu().numpy()
        options = {"maxiter": self.max_iter, "maxfun": 15_000, "gtol": self.tol, "ftol": 64 * np.finfo(float).eps}
        found = minimize(value_and_gradient, start, jac=True, method="L-BFGS-B", options=options)
        with torch.no_grad():
            torch.nn.utils.vector_to_parameters(torch.as_tensor(found.x).to(parameters[0]), parameters)

    def _descend(
        self, parameters: list[torch.Tensor], loss: Callable, inputs: torch.Tensor, targets: torch.Tensor, random: torch.Generator
    ) -> None:  # fmt: skip
        """Stochastic gradient descent with Nesterov momentum, or Adam, until the loss no longer falls."""
        rate = self.learning_rate_init
        optimiser = (
            torch.optim.Adam(parameters, lr=rate, fused=True)
            if self.solver == "adam"
            else torch.optim.SGD(parameters, lr=rate, momentum=0.9, nesterov=True)
        )
        best, passes_since = torch.inf, 0
        for _ in range(self.max_iter):
            total = 0.0
            for batch in torch.randperm(len(inputs), generator=random).to(inputs.device).split(self.batch_size):
                value = loss(inputs[batch], targets[batch])
                optimiser.zero_grad()
                value.backward()
                optimiser.step()
                total += value.item() * len(batch) / len(inputs)
            passes_since = 0 if total < best - self.tol else passes_since + 1
            best = min(best, total)
            if passes_since > PATIENCE:
                break


def in_span(inputs: torch.Tensor, layer: tuple) -> tuple[torch.Tensor, tuple, Callable[..., tuple]]:
    """Views and first layer in an orthonormal basis, for views (n, pixels) that have more pixels than there are views.

    Gradients of the weights lie in the span of the views, all but that of the penalty, which shrinks what is orthogonal to it. So
    n coordinates of a unit's weights, and the length of their orthogonal rest, are all that training by a method that rotations of
    the weights do not change can alter: gradient descent and L-BFGS, not Adam. (L-BFGS stops by the largest component of the
    gradient, which is another one here.) Returns views, layer and the way back of a layer.
    """
    weights, biases = layer
    basis = torch.linalg.qr(inputs.T).Q  # (pixels, n)
    inside = weights @ basis
    rest = weights - inside @ basis.T
    length = rest.norm(dim=1, keepdim=True)
    rest = rest / length.clamp(min=torch.finfo(rest.dtype).tiny)

    def restored(weights: torch.Tensor, biases: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return weights[:, :-1] @ basis.T + weights[:, -1:] * rest, biases

    reduced = torch.cat([inputs @ basis, torch.zeros(len(inputs), 1, device=inputs.device)], dim=1)
    return reduced, (torch.cat([inside, length], dim=1), biases), restored


def forward(inputs: torch.Tensor, layers: Layers, activation: str) -> torch.Tensor:
    """Logits (...) of inputs (..., pixels)."""
    for k, layer in enumerate(layers):
        inputs = linear(inputs, *layer)
        if k < len(layers) - 1:
            inputs = ACTIVATIONS[activation](inputs)
    return inputs[..., 0]


def as_images(views: Images | Float[np.ndarray, "n ..."]) -> Images:
    """Views as the models take them; rows of pixels (n, pixels) become images of one row."""
    images = torch.as_tensor(views, dtype=torch.float32)
    return images[:, None] if images.ndim == 2 else images
