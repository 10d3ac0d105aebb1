"""What a familiarity model is, and what those here share."""

import copy
import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any, ClassVar, Protocol, TypeVar, get_origin, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64

from tussock.world.errors import InputError
from tussock.world.specs import format_spec, own_parameters

from .filter_bank import in_parts

WIDEST = 8192  # columns of a view: the engine's matrices have half as many rows, and a column each
NARROWEST = 4  # as of an eye
LARGEST = 1e12  # number in a view, or learned: sums of squares over whole views stay far from float32's largest
# What is learned as whole numbers; labels are of their own type, and all else is float32.
WHOLE = ("index", "wiring", "rows", "columns")

Images = Float32[torch.Tensor, "n h w"]
Scans = Float32[torch.Tensor, "n w"]
Learned = dict[str, torch.Tensor]
Self = TypeVar("Self", bound="Model")


@runtime_checkable
class FamiliarityModel(Protocol):
    """Learns the views of a route and scores other views by how familiar they are at every rotation.

    Views are feature images (n, h, w) as an `Encoding` makes them; for training they face along the route. Views of several
    routes are learned one route after the other.
    """

    def fit(self, views: Images) -> "FamiliarityModel":
        """Learn the views (forgetting earlier ones). Raises InputError for none, or for values that are not finite."""
        ...

    def scan(self, views: Images) -> Scans:
        """Familiarity, higher is more familiar, of each view turned left by 0, 1, .. w - 1 columns.

        Raises InputError before `fit`, and for views of another size than the learned ones.
        """
        ...


@runtime_checkable
class SnapshotModel(FamiliarityModel, Protocol):
    """A model that keeps views and so can say which of them was recognised."""

    def match(self, views: Images) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and the index of the learned view that each rotation resembles most."""
        ...


@runtime_checkable
class Following(Protocol):
    """One walk along what a `SequenceModel` learned, which remembers where it has come to."""

    @property
    def progress(self) -> float | None:
        """Share of the learned sequence, 0 to 1, that it believes to have walked; None while it does not know."""
        ...

    def look(
        self, view: Float32[torch.Tensor, "h w"], allowed: Bool[np.ndarray, " w"]
    ) -> tuple[Float32[torch.Tensor, " w"], Int64[torch.Tensor, " w"]]:
        """Familiarity of each rotation and the learned view it resembles, going by where the walk is; of the `allowed`
        rotations the best becomes where it is.
        """
        ...


@runtime_checkable
class SequenceModel(SnapshotModel, Protocol):
    """A model whose familiarity depends on where along the route a walk has come to."""

    def follow(self) -> Following:
        """Begin a walk, not knowing yet where."""
        ...


@dataclass(kw_only=True, eq=False)
class Model(ABC):
    """A model by its name: parameters are the fields, and what training leaves behind is `learned`, nothing else.

    device: where it learns and scans, as torch names devices ("cpu", "cuda"). seed: of everything it draws.
    learned: named tensors; they and the parameters are what a model file holds. shape: (h, w) of the views it learned, or None.
    """

    name = ""  # each class has its own
    paper = ""
    CHOICES: ClassVar[dict[str, Collection[str]]] = {}  # of parameters that are names
    LIMITS: ClassVar[
        dict[str, tuple[float, float]]
    ] = {}  # of numbers, both ends allowed, where they are not the usual ones

    device: str = "cpu"
    seed: int = 0
    learned: Learned = field(init=False, repr=False, default_factory=dict)
    shape: tuple[int, int] | None = field(init=False, repr=False, default=None)

    def __str__(self) -> str:
        """What `make_model` makes it of, untrained, beside seed and device: its name and the parameters that are not the defaults."""
        defaults = own_parameters(type(self))
        return format_spec(
            self.name, {key: self.parameters[key] for key in defaults if self.parameters[key] != defaults[key]}
        )

    def fit(self: Self, views: Images) -> Self:
        """Learn the views, forgetting earlier ones. Raises InputError for no views and for values beyond LARGEST."""
        self.check_parameters()
        check_device(self.device)
        check_training(views)
        views = self._here(views)
        self.restore((views.shape[1], views.shape[2]), self._learn(views))
        return self

    def scan(self, views: Images) -> Scans:
        """Familiarity of each rotation, higher is more familiar. Raises InputError before `fit` and for views of another shape."""
        check_scan(views, self.shape)
        if len(views) == 0:
            return torch.empty(0, views.shape[2])
        scans = torch.cat([self._scan(self._here(part)) for part in in_parts(views)])
        if not torch.isfinite(scans).all():
            raise InputError(
                f"{self.name}: familiarity is beyond float32 (has its training come to large weights?); scale the views"
            )
        return scans

    def restore(self, shape: tuple[int, int], learned: Learned) -> None:
        """Take over what was learned, from training or from a file; where that fails, it knows what it knew.

        Raises InputError for tensors that cannot be this model's.
        """
        self.check_learned(shape, learned)
        restored = copy.copy(self)
        restored.learned, restored.shape = {key: self._here(tensor) for key, tensor in learned.items()}, shape
        restored._prepare()
        vars(self).update(vars(restored))

    def check_parameters(self) -> None:
        """Raise InputError for parameters that mean nothing, going by their defaults.

        A name is one of CHOICES. A number lies within LIMITS; where these say nothing, a whole number is at least 1 (the seed 0), a
        single other number at least 0. Where the default is several numbers, there is at least one.
        """
        for each in dataclasses.fields(self):
            value = getattr(self, each.name)
            if each.init and each.name != "device" and not (value is None and each.default is None):
                if get_origin(each.type) is tuple and not isinstance(value, (tuple, list)):
                    raise InputError(f"{self.name}: {each.name} {value!r}; give several, as {each.default!r}")
                self._check_parameter(each.name, value, each.default)

    def _check_parameter(self, name: str, value: Any, default: Any) -> None:
        several = isinstance(default, tuple)
        usual = default[0] if several else default
        if usual is None or isinstance(usual, int):
            kind, words, limits = Integral, "a whole number", (0 if name == "seed" else 1, 2**62)
        else:
            kind, words, limits = Real, "a number", (-np.inf if several else 0, np.inf)
        low, high = self.LIMITS.get(name, limits)
        choices = self.CHOICES.get(name, ())
        numbers = name in self.LIMITS or not choices

        def means_something(each: Any) -> bool:
            if isinstance(each, str):
                return each in choices
            number = numbers and isinstance(each, kind) and not isinstance(each, bool)
            return number and math.isfinite(each) and low <= float(each) <= high

        values = value if several and isinstance(value, (tuple, list)) else [value]
        if len(values) == 0:
            raise InputError(f"{self.name}: {name} is empty; give at least one")
        if not all(map(means_something, values)):
            hints = [f"one of {', '.join(choices)}"] if choices else []
            hints += [f"{words} from {low:g} to {high:g}"] if numbers else []
            raise InputError(f"{self.name}: {name} {value!r}; give {' or '.join(hints)}")

    @property
    def memory_bytes(self) -> int:
        """Size of what it has learned."""
        return sum(tensor.nbytes for tensor in self.learned.values())

    @property
    def parameters(self) -> dict[str, Any]:
        """What it was made with, by name."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init}

    def _here(self, tensor: torch.Tensor) -> torch.Tensor:
        return tensor.to(self.device)

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """Raise InputError where a model with these parameters cannot have learned this from views of `shape`."""
        if shape[1] > WIDEST:
            raise InputError(f"{self.name}: views of {shape[1]} columns; give at most {WIDEST} (--resize)")
        expected = self._shapes(*shape)
        if learned.keys() != expected.keys():
            raise InputError(f"{self.name}: it learns {', '.join(expected)}, not {', '.join(learned) or 'nothing'}")
        for key, tensor in learned.items():
            fits = len(tensor.shape) == len(expected[key]) and all(
                want in (None, size) and size > 0 for want, size in zip(expected[key], tensor.shape, strict=True)
            )
            if not fits:
                raise InputError(f"{self.name}: {key} of shape {tuple(tensor.shape)}, not {expected[key]}")
            kind, name = tensor.dtype, key.rpartition(".")[2]
            if kind != (torch.int64 if name in WHOLE else torch.float32) and name != "classes":
                raise InputError(f"{self.name}: {key} of type {kind}, which it does not learn")
            if tensor.is_floating_point() and not all_bounded(tensor):
                raise InputError(
                    f"{self.name}: the {key} are not finite, or over {LARGEST:g}; if they grew without bound, give a lower rate"
                )

    def _random(self) -> torch.Generator:
        """A generator at the beginning of this model's draws. On the CPU, so that every device draws the same."""
        return torch.Generator().manual_seed(self.seed)

    @abstractmethod
    def _learn(self, views: Images) -> Learned:
        """What remains of the views."""

    @abstractmethod
    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        """Names and shapes of what it learns from views of height x width; None where the size varies."""

    @abstractmethod
    def _scan(self, views: Images) -> Scans:
        """Familiarity of each rotation of views that were checked."""

    @abstractmethod
    def _prepare(self) -> None:
        """Derive from `learned` what scanning needs; attributes are replaced, never changed in place (see `restore`)."""


class IncrementalModel(Model):
    """A model that learns view by view, and goes on learning at any time."""

    def partial_fit(self, views: Images) -> "IncrementalModel":
        """Learn further views of the same shape on top of what it knows; where that fails, it knows what it knew."""
        if self.shape is None:
            return self.fit(views)
        check_training(views)
        check_scan(views, self.shape)
        self.restore(self.shape, self._add(self.learned, self._here(views)))
        return self

    def _learn(self, views: Images) -> Learned:
        return self._add(self._begin(views.shape[1], views.shape[2]), views)

    @abstractmethod
    def _begin(self, height: int, width: int) -> Learned:
        """What it knows before the first view."""

    @abstractmethod
    def _add(self, learned: Learned, views: Images) -> Learned:
        """`learned`, which stays as it is, with views added one after the other."""


def check_device(device: str) -> None:
    """Refuse a device that torch cannot use here. Raises InputError."""
    try:
        torch.zeros(1, device=device).item()
    except (RuntimeError, AssertionError, TypeError) as error:
        raise InputError(f"device {device!r} cannot be used here ({str(error).splitlines()[0]})") from error


def check_training(views: Images) -> None:
    """Refuse views that no model can learn. Raises InputError."""
    if views.ndim != 3 or len(views) == 0:
        raise InputError(f"a model learns from at least one view (n, h, w), got shape {tuple(views.shape)}")
    if views.shape[1] < 1 or not NARROWEST <= views.shape[2] <= WIDEST:
        raise InputError(
            f"views of {views.shape[2]} x {views.shape[1]} pixels; give {NARROWEST} to {WIDEST} columns (--resize) and at least a row"
        )
    check_numbers(views)


def check_scan(views: Images, shape: tuple[int, ...] | None) -> None:
    """Refuse views that a model trained on images of `shape` (None: not trained) cannot score. Raises InputError."""
    if shape is None:
        raise InputError("this model has learned nothing yet; call fit(views) first")
    if views.ndim != 3 or tuple(views.shape[1:]) != tuple(shape):
        raise InputError(
            f"this model learned views of shape {tuple(shape)}, got {tuple(views.shape[1:])}; encode both alike"
        )
    check_numbers(views)


def check_numbers(views: Images) -> None:
    """Refuse what is not float32, NaN, infinity and what is beyond LARGEST. Raises InputError."""
    if views.dtype != torch.float32:
        raise InputError(f"views are float32, got {views.dtype}; give views.float()")
    if not all_bounded(views):
        bad = int((views.abs() <= LARGEST).flatten(start_dim=1).all(dim=1).int().argmin())
        raise InputError(f"view {bad} holds numbers that are not finite, or over {LARGEST:g}; check the encoding")


def all_bounded(tensor: torch.Tensor) -> bool:
    """Whether all numbers lie within LARGEST, which NaN does not."""
    if tensor.numel() == 0:
        return True
    least, greatest = tensor.aminmax()
    return float(least) >= -LARGEST and float(greatest) <= LARGEST


def memory_bytes(model: FamiliarityModel) -> int | None:
    """Size of what a model has learned; None where it does not tell."""
    return getattr(model, "memory_bytes", None)
