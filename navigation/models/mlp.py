"""The thesis's classifier: a multi-layer perceptron that tells views along the route from turned ones."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Num
from scipy.optimize import minimize
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin
from threadpoolctl import threadpool_limits
from torch.nn.functional import binary_cross_entropy_with_logits, linear

from tussock.world.errors import SettingError
from tussock.world.geometry import columns_of_turn
from tussock.world.settings import choice, number, numbers, whole, wholes

from .base import Images, Learned, Model, Scans, Scores, Shapes, model
from .checks import check_scan, check_training
from .rotations import linear_each, one_by_one

ACTIVATIONS: dict[str, Callable[[torch.Tensor], torch.Tensor]] = {
    "identity": lambda x: x,
    "logistic": torch.sigmoid,
    "tanh": torch.tanh,
    "relu": torch.relu,
}
SMALL = 4 * 10**6  # multiplications in a pass over the views; below it, one thread is the quickest
PATIENCE = 10  # passes without progress after which sgd and adam stop

Layers = list[tuple[torch.Tensor, torch.Tensor]]  # weights (outputs, inputs) and biases (outputs,)
Views = Images | Float[np.ndarray, "n ..."]


@model
class MLP(ClassifierMixin, BaseEstimator, Model):
    """Trained on each view (on the route) and on turned copies of it (off the route); familiarity is the log-odds of "on".

    Section 4.4 of the thesis. A scikit-learn classifier: parameters are those of MLPClassifier, with its defaults but for max_iter,
    and so are `fit(views, y)`, `predict`, `predict_proba` and `get_params`; GridSearchCV takes it. `fit(views)` makes the negatives.
    The log-odds order views as the probability does, but do not saturate. Constant memory.

    Attributes:
        hidden_layer_sizes: Units of each hidden layer.
        activation: identity, logistic, tanh or relu.
        solver: lbfgs, sgd or adam.
        alpha: L2 penalty.
        batch_size: Views per step of sgd and adam.
        learning_rate_init: Learning rate of sgd and adam.
        max_iter: Limit of passes over the views.
        tol: Progress in the loss below which training ends.
        negatives_deg: How far the copies are turned to the left (deg).
        negatives_each: Copies of each view, which takes the turns one after the other.
    """

    name = "mlp"
    paper = "the thesis, section 4.4"
    dtypes = {"classes": None}  # noqa: RUF012
    takes_mask = True

    hidden_layer_sizes: tuple[int, ...] | int = wholes((100,), single=True)
    activation: str = choice("relu", ACTIVATIONS)
    solver: str = choice("adam", ("lbfgs", "sgd", "adam"))
    alpha: float = number(1e-4, low=0)
    batch_size: int = whole(200)
    learning_rate_init: float = number(1e-3, low=0)
    max_iter: int = whole(600)
    tol: float = number(1e-4, low=0)
    negatives_deg: tuple[float, ...] = numbers((-60.0, 60.0), unit="deg")
    negatives_each: int = whole(1)

    def __sklearn_clone__(self) -> "MLP":
        """An untrained copy. scikit-learn's own way demands that a parameter is the very object that was given."""
        return type(self)(**self.parameters).see(self.mask)

    def fit(self, views: Views, y: Any = None) -> "MLP":
        """Train from scratch.

        Args:
            views: (n, h, w), or with labels also (n, pixels).
            y: (n,) Labels: two different numbers, of which the larger means "on the route". None means that the views are on the route,
                and the negatives are made of them.

        Raises:
            SettingError: For views that cannot be learned, and for other labels.
        """
        images = as_images(views)
        if y is None:
            return super().fit(images)
        check_training(images)
        labels = np.asarray(y)
        if labels.shape != (len(images),):
            raise SettingError(f"{len(images)} views and labels of shape {labels.shape}; give each view one")
        classes = np.unique(labels) if labels.dtype.kind in "biuf" else labels
        if classes.dtype.kind not in "biuf" or not np.isfinite(classes).all() or len(classes) != 2:
            raise SettingError(f"labels {classes[:4].tolist()}; give two different numbers")
        targets = torch.as_tensor(labels == classes[1], dtype=torch.float32)
        learned = self._classify(self._on_device(images), targets, torch.as_tensor(classes))
        self.restore((images.shape[1], images.shape[2]), learned)
        return self

    def score(self, views: Views, y: Any = None, sample_weight: Any = None) -> Any:  # type: ignore[override]
        """Familiarity (n,) of views as they are; with labels the share that is predicted right, as scikit-learn has it."""
        return Model.score(self, as_images(views)) if y is None else super().score(views, y, sample_weight)

    def training_data(self, views: Images) -> tuple[Float32[torch.Tensor, "m h w"], Float32[torch.Tensor, " m"]]:
        """The views labelled 1, followed by turned copies of them labelled 0."""
        turns = [round(columns_of_turn(degrees, views.shape[-1], full_turn=360)) for degrees in self.negatives_deg]
        turned = [
            torch.roll(view, turns[(i + k) % len(turns)], dims=-1)
            for k in range(self.negatives_each)
            for i, view in enumerate(views)
        ]
        return torch.cat([views, torch.stack(turned)]), torch.cat([torch.ones(len(views)), torch.zeros(len(turned))])

    def decision_function(self, views: Views) -> Float[np.ndarray, " n"]:
        """Log-odds of the second class for views as they are."""
        images = as_images(views)
        check_scan(images, self.shape)
        seen = self._seen(self._on_device(images))
        return forward(seen.flatten(start_dim=1), self._layers, self.activation).cpu().numpy()

    def predict_proba(self, views: Views) -> Float[np.ndarray, "n 2"]:
        """Probability of each class for views as they are."""
        second = expit(self.decision_function(views).astype(float))
        return np.column_stack([1 - second, second])

    def predict(self, views: Views) -> Num[np.ndarray, " n"]:
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
        layers = self._train(self._pixels(images), self._on_device(targets))
        layers[0] = (self._as_filters(layers[0][0], images.shape[1:]).flatten(start_dim=1), layers[0][1])
        for k, (weights, biases) in enumerate(layers):
            learned |= {f"weights{k}": weights, f"biases{k}": biases}
        return learned

    def _sizes(self, pixels: int) -> list[int]:
        """Units of each layer, from the input to the output."""
        hidden = self.hidden_layer_sizes
        return [pixels, *((hidden,) if isinstance(hidden, int) else hidden), 1]

    def _shapes(self, height: int, width: int) -> Shapes:
        shapes: Shapes = {"classes": (2,)}
        for k, (before, after) in enumerate(pairwise(self._sizes(height * width))):
            shapes |= {f"weights{k}": (after, before), f"biases{k}": (after,)}
        return shapes

    def _prepare(self) -> None:
        assert self.shape is not None
        depth = sum(key.startswith("weights") for key in self.learned)
        self._layers = [(self.learned[f"weights{k}"], self.learned[f"biases{k}"]) for k in range(depth)]
        weights, biases = self._layers[0]
        self._responses = self._bank(weights.reshape(-1, *self.shape), biases).responses

    def _scan(self, views: Images) -> Scans:
        """The first layer's weights are the engine's filters; the others see its units at each rotation."""
        activity = ACTIVATIONS[self.activation](self._responses(views))  # (n, w, units)
        return one_by_one(lambda units: forward(units, self._layers[1:], self.activation), activity)

    def _score(self, views: Images) -> Scores:
        pixels = self._seen(views).flatten(start_dim=1)
        if self.activation == "logistic":  # torch rounds it differently where a row stands elsewhere in memory
            return one_by_one(lambda view: forward(view, self._layers, self.activation), pixels)
        return forward(pixels, self._layers, self.activation, linear_each)

    def _train(self, inputs: torch.Tensor, targets: torch.Tensor) -> Layers:
        """Fitted layers."""
        random = self._random()
        layers = self._first_layers(inputs.shape[1], random)
        restored = None
        if self.solver != "adam" and inputs.shape[1] > len(inputs):
            inputs, layers[0], restored = in_span(inputs, layers[0])
        layers = [(weights.requires_grad_(), biases.requires_grad_()) for weights, biases in layers]

        def loss(inputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
            fit = binary_cross_entropy_with_logits(forward(inputs, layers, self.activation), targets)
            return fit + 0.5 * self.alpha / len(inputs) * sum(weights.square().sum() for weights, _ in layers)

        parameters = [each for layer in layers for each in layer]
        products = len(inputs) * sum(weights.numel() for weights, _ in layers)
        with threadpool_limits(1 if products < SMALL else None):
            if self.solver == "lbfgs":
                self._minimise(parameters, lambda: loss(inputs, targets))
            else:
                self._descend(parameters, loss, inputs, targets, random)
        fitted = [(weights.detach(), biases.detach()) for weights, biases in layers]
        return fitted if restored is None else [restored(*fitted[0]), *fitted[1:]]

    def _first_layers(self, pixels: int, random: torch.Generator) -> Layers:
        """Random layers to begin with, as Glorot and Bengio (2010) draw them."""
        factor = 2 if self.activation == "logistic" else 6
        layers = []
        for before, after in pairwise(self._sizes(pixels)):
            bound = (factor / (before + after)) ** 0.5
            draw = [(torch.rand(shape, generator=random) * 2 - 1) * bound for shape in ((after, before), (after,))]
            layers.append((self._on_device(draw[0]), self._on_device(draw[1])))
        return layers

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
        best = minimize(value_and_gradient, start, jac=True, method="L-BFGS-B", options=options).x
        with torch.no_grad():
            torch.nn.utils.vector_to_parameters(torch.as_tensor(best).to(parameters[0]), parameters)

    def _descend(
        self,
        parameters: list[torch.Tensor],
        loss: Callable,
        inputs: torch.Tensor,
        targets: torch.Tensor,
        random: torch.Generator,
    ) -> None:
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
    n coordinates of a unit's weights, and the length of their orthogonal rest, are all that training can change, by a method for
    which rotations of the weights make no difference: gradient descent and L-BFGS, not Adam. (L-BFGS stops by the largest component
    of the gradient, which is another one here.)

    Returns:
        The views, the layer, and a function that brings a layer back.
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


def forward(
    inputs: torch.Tensor, layers: Layers, activation: str, linear: Callable[..., torch.Tensor] = linear
) -> torch.Tensor:
    """Logits (...) of inputs (..., pixels)."""
    for k, layer in enumerate(layers):
        inputs = linear(inputs, *layer)
        if k < len(layers) - 1:
            inputs = ACTIVATIONS[activation](inputs)
    return inputs[..., 0]


def as_images(views: Views) -> Images:
    """Views as the models take them; rows of pixels (n, pixels) become images of one row."""
    images = torch.as_tensor(views, dtype=torch.float32)
    return images[:, None] if images.ndim == 2 else images
