"""What a familiarity model is, and what the models here share."""

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, Protocol, TypeVar, dataclass_transform, runtime_checkable

import attrs
import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int64

from tussock.world.errors import SettingError
from tussock.world.settings import instance_of, whole
from tussock.world.specs import format_spec, own_parameters

from ..devices import check_device
from ..feature_mask import WITH_MASK, FeatureMask, check_takes_partial, is_partial
from .checks import MAX_COLUMNS, Images, check_bounded, check_familiarity, check_form, check_scan, check_training
from .filter_bank import FilterBank
from .registry import MODELS
from .rotations import ALONE, in_batches

Scans = Float32[torch.Tensor, "n w"]
Scores = Float32[torch.Tensor, " n"]
Windows = Bool[np.ndarray, "n w"]  # the rotations of each view that a scan chooses from
Learned = dict[str, torch.Tensor]
Shapes = dict[str, tuple[int | None, ...]]
Self = TypeVar("Self", bound="Model")
T = TypeVar("T")


@runtime_checkable
class FamiliarityModel(Protocol):
    """Learns the views of a route and scores other views by how familiar they are at every rotation.

    Views are feature images (n, h, w) as an `Encoding` makes them; for training they face along the route. Views of several routes
    are learned one route after the other. A model may also have `memory_bytes` and `score`; see the functions of these names.
    """

    def fit(self, views: Images) -> Any:
        """Learn the views, forgetting earlier ones."""
        ...

    def scan(self, views: Images) -> Scans:
        """Familiarity, higher is more familiar, of each view turned left by 0, 1, .. w - 1 columns."""
        ...


@runtime_checkable
class SnapshotModel(FamiliarityModel, Protocol):
    """A model that keeps views and so can tell which of them it recognised."""

    def match(self, views: Images, windows: Windows | None = None) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and the index of the learned view that each rotation resembles most. windows: Those that are chosen from; None: all."""
        ...


@runtime_checkable
class Following(Protocol):
    """One walk along what a `SequenceModel` learned. Where it has `resume(progress)`, it is told where it was put back."""

    @property
    def progress(self) -> float | None:
        """Share of the learned sequence, 0 to 1, that it believes to have walked; None while it does not know."""
        ...

    def look(
        self, view: Float32[torch.Tensor, "h w"], allowed: Bool[np.ndarray, " w"]
    ) -> tuple[Float32[torch.Tensor, " w"], Int64[torch.Tensor, " w"]]:
        """Compare a view with what was learned near the present progress, and move the progress to the best match.

        Args:
            allowed: (w,) Rotations whose best match the progress may move to.

        Returns:
            Familiarity (w,) of each rotation, and the index (w,) of the learned view that each resembles most.
        """
        ...


@runtime_checkable
class SequenceModel(SnapshotModel, Protocol):
    """A model whose familiarity depends on the progress of a walk along the route."""

    def follow(self) -> Following:
        """Begin a walk, with unknown progress."""
        ...


def memory_bytes(model: FamiliarityModel) -> int | None:
    """Size of what any model has learned; None where the model does not report it."""
    size = getattr(model, "memory_bytes", None)
    size = size() if callable(size) else size
    return None if size is None else int(size)


def score(model: FamiliarityModel, views: Images) -> Scores:
    """Familiarity of each view at its present heading, on the CPU: by `score(views)` of the model where it has one, else by its scan."""
    score = getattr(model, "score", None)
    return (model.scan(views)[:, 0] if score is None else score(views)).cpu()


def recognises(model: FamiliarityModel) -> bool:
    """Whether the familiarity of any model depends on the learned views; True where the model does not say."""
    return bool(getattr(model, "recognises", True))


@dataclass_transform(kw_only_default=True, eq_default=False, field_specifiers=(attrs.field,))
def model(cls: type[T]) -> type[T]:
    """Class decorator: a model whose parameters are fields (see `tussock.world.settings`), checked when made and when changed."""
    return attrs.define(kw_only=True, eq=False, slots=False)(cls)


@model
class Model(ABC):
    """A familiarity model whose fields are its parameters, and that keeps in `learned` all that training leaves behind.

    Attributes:
        device: Where it learns and scans, as torch names devices ("cpu", "cuda").
        seed: Of everything it draws.
        shape: (h, w) of the views it learned; None before training.
        mask: What it sees of views; None means everything (see `see`).
        name: Its name in messages; for the models of tussock, that in the registry.
        paper: Where it comes from.
        renamed: Former names of parameters, which specs and files may still use, with the present ones.
        dtypes: Of learned tensors that are not float32; None means any.
        takes_mask: Whether the class minds `mask`, as those of tussock do.
        takes_partial: Whether views may be unknown in part (`FeatureMask.partial`): nan in views, and in what is learned.
        recognises: Whether familiarity depends on the learned views; see the function of this name.
    """

    name = "model"
    paper = ""
    renamed: ClassVar[Mapping[str, str]] = {}
    dtypes: ClassVar[Mapping[str, torch.dtype | None]] = {}
    takes_mask: ClassVar[bool] = False
    takes_partial: ClassVar[bool] = False
    recognises: ClassVar[bool] = True

    device: str = instance_of(str, "cpu", "the name of a device")
    seed: int = whole(0, low=0)
    _learned: Learned = attrs.field(init=False, repr=False, factory=dict)
    _lent: bool = attrs.field(init=False, repr=False, default=True)
    shape: tuple[int, int] | None = attrs.field(init=False, repr=False, default=None)
    mask: FeatureMask | None = attrs.field(init=False, repr=False, default=None)

    def __init_subclass__(cls) -> None:
        cls.name = vars(cls).get("name", cls.__name__)

    def __copy__(self: Self) -> Self:
        copied = object.__new__(type(self))
        self._lent = True
        vars(copied).update(vars(self))
        return copied

    def __str__(self) -> str:
        """Its spec: the name, and the parameters that are not the defaults."""
        defaults = own_parameters(type(self))
        changed = {key: self.parameters[key] for key in defaults if self.parameters[key] != defaults[key]}
        return format_spec(MODELS.name_of(type(self)), changed)

    def see(self: Self, mask: FeatureMask | None) -> Self:
        """Say, before training, what the eye sees: `Encoding.for_eye(eye).mask`. Raises SettingError later, and where it is not minded."""
        if self.shape is not None and mask != self.mask:
            raise SettingError(f"{self.name} has learned through another mask; make a new model")
        if mask is not None and not self.takes_mask:
            raise SettingError(f"{self.name} does not mind what the eye cannot see; {WITH_MASK}")
        check_takes_partial(self, mask)
        self.mask = mask
        return self

    def fit(self: Self, views: Images) -> Self:
        """Learn the views, forgetting earlier ones. Raises SettingError for no views and for values that are not finite."""
        check_device(self.device)
        check_training(views, is_partial(self.mask))
        if self.mask is not None:
            self.mask.check(views.shape[1:])
        views = self._on_device(views)
        self.restore((views.shape[1], views.shape[2]), self._learn(views))
        return self

    def scan(self, views: Images) -> Scans:
        """Familiarity of each rotation, higher is more familiar.

        Args:
            views: (n, h, w)

        Raises:
            SettingError: Before `fit`, and for views of another shape than the learned ones.
        """
        check_scan(views, self.shape, is_partial(self.mask))
        return torch.empty(0, views.shape[2]) if len(views) == 0 else self._of_batches(self._scan, in_batches(views))

    def score(self, views: Images) -> Scores:
        """Familiarity of each view at its present heading: `scan(views)[:, 0]` but for rounding, at less cost. Refuses what `scan` does."""
        check_scan(views, self.shape, is_partial(self.mask))
        if len(views) == 0:
            return torch.empty(0)
        return self._of_batches(self._score, views.split(1) if views[0].numel() >= ALONE else in_batches(views))

    def restore(self, shape: tuple[int, int], learned: Learned) -> None:
        """Take over what was learned, by training or from a file; where that fails, the model stays as it was.

        Args:
            shape: (h, w) of the views.
            learned: As `self.learned`.

        Raises:
            SettingError: For tensors that this model cannot have learned.
        """
        self.check_learned(shape, learned)
        restored = copy.copy(self)
        restored._learned, restored.shape = {key: self._on_device(tensor) for key, tensor in learned.items()}, shape
        restored._prepare()
        vars(self).update(vars(restored))

    @property
    def learned(self) -> Learned:
        """Named tensors. Together with the parameters they are what a model file holds. They stay as they are when it learns more."""
        self._lent = True
        return self._learned

    @property
    def memory_bytes(self) -> int:
        """Size of what it has learned."""
        return sum(tensor.nbytes for tensor in self._learned.values())

    @property
    def parameters(self) -> dict[str, Any]:
        """Its parameters, seed and device included."""
        return {each.name: getattr(self, each.name) for each in attrs.fields(type(self)) if each.init}

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """Refuse what a model with these parameters cannot have learned from views of a shape. Raises SettingError."""
        self._check_form(shape, learned)
        check_bounded(self.name, learned, is_partial(self.mask))

    def _check_form(self, shape: tuple[int, int], learned: Learned) -> None:
        """Refuse tensors of other names, shapes and types."""
        if self.mask is not None:
            self.mask.check(shape)
        if shape[1] > MAX_COLUMNS:
            raise SettingError(f"{self.name}: views of {shape[1]} columns; give at most {MAX_COLUMNS}")
        check_form(self.name, learned, self._shapes(*shape), self.dtypes)

    def _of_batches(self, familiarity: Callable[[Images], torch.Tensor], batches: Iterable[Images]) -> torch.Tensor:
        """Familiarity of views, batch by batch. Raises SettingError where it is not finite."""
        results = torch.cat([familiarity(self._on_device(batch)) for batch in batches])
        check_familiarity(self.name, results)
        return results

    def _on_device(self, tensor: torch.Tensor) -> torch.Tensor:
        return tensor.to(self.device)

    def _seen(self, views: Images) -> Images:
        """Views as the eye sees them at their present heading."""
        return views if self.mask is None else self.mask.images(views)

    def _pixels(self, views: Images) -> Float32[torch.Tensor, "n pixels"]:
        """What the eye sees of views at their present heading, in rows."""
        return views.flatten(start_dim=1) if self.mask is None else self.mask.pixels(views)

    def _size(self, height: int, width: int) -> int:
        """How many pixels of a view the eye sees."""
        return height * width if self.mask is None else self.mask.count

    def _as_filters(self, rows: Float32[torch.Tensor, "m pixels"], shape: torch.Size) -> Float32[torch.Tensor, "m h w"]:
        """Weights of such rows as filters of a shape (h, w), 0 where nothing is seen."""
        return rows.reshape(-1, *shape) if self.mask is None else self.mask.spread(rows)

    def _bank(
        self, filters: Float[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"] | None = None
    ) -> FilterBank:
        """Filters that meet what the eye sees."""
        return FilterBank(filters, biases, self.mask)

    def _random(self) -> torch.Generator:
        """A generator at the beginning of this model's draws. On the CPU, so that every device draws the same."""
        return torch.Generator().manual_seed(self.seed)

    @abstractmethod
    def _learn(self, views: Images) -> Learned:
        """What remains of the views."""

    @abstractmethod
    def _shapes(self, height: int, width: int) -> Shapes:
        """Names and shapes of what it learns from views of height x width; None where the size varies."""

    @abstractmethod
    def _scan(self, views: Images) -> Scans:
        """Familiarity of each rotation of views that were checked."""

    def _score(self, views: Images) -> Scores:
        """Familiarity of views that were checked, at their present heading. Most models have a quicker way."""
        return self._scan(views)[:, 0]

    def _prepare(self) -> None:  # noqa: B027  # most models need nothing
        """Derive from `learned` what scanning needs. Attributes are replaced, never changed in place (see `restore`)."""
