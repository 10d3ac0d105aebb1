"""Two memories in one model: what opponent memories and memories of both hemifields share."""

import copy
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

import torch

from tussock.world.errors import SettingError

from ..feature_mask import FeatureMask, seeing
from .base import FamiliarityModel, Images, Learned, Model, Scans, Scores, Shapes, memory_bytes, recognises, score
from .incremental import IncrementalModel
from .registry import HEMIFIELDS, OPPONENT

T = TypeVar("T")
Memories = TypeVar("Memories", bound="TwoMemories")
Outside = TypeVar("Outside", bound="OutsideMemories")


class TwoMemories(Model):
    """Any model twice. Both memories keep what they learn under their names, and familiarity is made of that of both.

    Attributes:
        prefix: Before the name of the model, in its spec.
        sides: Names of the two memories, and of the attributes that hold them.
    """

    prefix: ClassVar[str]
    sides: ClassVar[tuple[str, str]]

    def __init__(self, model: Model):
        self.check_model(model)
        super().__init__(device=model.device, seed=model.seed)
        for side in self.sides:
            setattr(self, side, copy.deepcopy(model))
        self.name = self.prefix + model.name

    @classmethod
    def check_model(cls, model: Any) -> None:
        """Refuse a model that these memories cannot be made of. Raises SettingError."""
        inner = model.kind if isinstance(model, OutsideMemories) else type(model)
        if issubclass(inner, TwoMemories) and HEMIFIELDS in (cls.prefix, inner.prefix):
            raise SettingError(
                f"{cls.prefix} of {inner.prefix}: the model has two memories already; give one of {OPPONENT} and {HEMIFIELDS}"
            )

    @classmethod
    @abstractmethod
    def combined(cls, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
        """Familiarity, of that of the first memory and that of the second."""

    @classmethod
    def views_of(cls, side: str, views: Images) -> Images:
        """What a memory learns of views."""
        return views

    @classmethod
    def mask_of(cls, side: str, mask: FeatureMask | None, shape: tuple[int, ...]) -> FeatureMask | None:
        """What a memory sees of views of a shape (h, w), where `mask` is what the eye sees. Raises SettingError where that is nothing."""
        return mask

    @property
    def first(self) -> Any:
        """The first memory."""
        return getattr(self, self.sides[0])

    @property
    def parameters(self) -> dict[str, Any]:
        """Those of the model."""
        return self.first.parameters

    @property
    def dtypes(self) -> Mapping[str, torch.dtype | None]:  # type: ignore[override]
        """Of learned tensors that are not float32."""
        return _joined({side: getattr(self, side).dtypes for side in self.sides})

    @property
    def takes_mask(self) -> bool:  # type: ignore[override]
        """Whether the model minds `mask`."""
        return self.first.takes_mask

    @property
    def recognises(self) -> bool:  # type: ignore[override]
        """Whether the model recognises views."""
        return self.first.recognises

    def __repr__(self) -> str:
        return f"{self.prefix.removesuffix('-').capitalize()}({self.first!r})"

    def __str__(self) -> str:
        return f"{self.prefix}{self.first}"

    def see(self: Memories, mask: FeatureMask | None) -> Memories:
        """Both memories see through this mask, or through their part of it."""
        if mask is not None:
            for side in self.sides:
                self.mask_of(side, mask, mask.visible.shape)
        super().see(mask)
        if self.shape is None:
            for side in self.sides:
                getattr(self, side).see(mask)
        return self

    def _memory(self, side: str, height: int, width: int) -> Any:
        """A memory that sees its part of views of height x width."""
        memory, mask = getattr(self, side), self.mask_of(side, self.mask, (height, width))
        if memory.mask is mask or memory.mask == mask:
            return memory
        untrained = copy.copy(memory)
        untrained.shape = None
        return untrained.see(mask)

    def _learn(self, views: Images) -> Learned:
        memories = {side: self._memory(side, *views.shape[1:]) for side in self.sides}
        return _joined({side: memory._learn(self.views_of(side, views)) for side, memory in memories.items()})

    def _shapes(self, height: int, width: int) -> Shapes:
        return _joined({side: self._memory(side, height, width)._shapes(height, width) for side in self.sides})

    def _prepare(self) -> None:
        assert self.shape is not None
        for side in self.sides:
            model = copy.copy(self._memory(side, *self.shape))
            model.restore(self.shape, _part(self.learned, side))
            setattr(self, side, model)

    def _scan(self, views: Images) -> Scans:
        first, second = (getattr(self, side).scan(views) for side in self.sides)
        return self.combined(first, second)

    def _score(self, views: Images) -> Scores:
        first, second = (getattr(self, side).score(views) for side in self.sides)
        return self.combined(first, second)


class IncrementalTwoMemories(TwoMemories, IncrementalModel):
    """Two memories of a model that learns view by view."""

    def _begin(self, height: int, width: int) -> Learned:
        return _joined({side: self._memory(side, height, width)._begin(height, width) for side in self.sides})

    def _add(self, learned: Learned, views: Images) -> Learned:
        memories = {side: self._memory(side, *views.shape[1:]) for side in self.sides}
        return _joined(
            {side: memory._add(_part(learned, side), self.views_of(side, views)) for side, memory in memories.items()}
        )


class OutsideMemories:
    """Two memories of a model that does not derive from `Model`.

    Attributes:
        kind: What they are.
        mask: What the eye sees.
    """

    kind: ClassVar[type[TwoMemories]]
    mask: FeatureMask | None = None

    def __init__(self, model: Any):
        self.kind.check_model(model)
        for side in self.kind.sides:
            setattr(self, side, copy.deepcopy(model))

    def see(self: Outside, mask: FeatureMask | None) -> Outside:
        """Both memories see through this mask, or through their part of it. Raises SettingError where the model does not mind that."""
        for side in self.kind.sides:
            if mask is not None:
                self.kind.mask_of(side, mask, mask.visible.shape)
            seeing(getattr(self, side), mask)
        self.mask = mask
        return self

    def fit(self: Outside, views: Images) -> Outside:
        """Let both memories learn the views."""
        for side in self.kind.sides:
            memory, mask = getattr(self, side), self.kind.mask_of(side, self.mask, views.shape[1:])
            if mask is not self.mask:
                seeing(memory, mask)
            memory.fit(self.kind.views_of(side, views))
        return self

    def scan(self, views: Images) -> Scans:
        """Familiarity of each rotation, of both memories."""
        first, second = (getattr(self, side).scan(views) for side in self.kind.sides)
        return self.kind.combined(first, second)

    def score(self, views: Images) -> Scores:
        """The same at the present heading."""
        first, second = (score(getattr(self, side), views) for side in self.kind.sides)
        return self.kind.combined(first, second)

    @property
    def recognises(self) -> bool:
        """Whether the model recognises views."""
        return recognises(getattr(self, self.kind.sides[0]))

    @property
    def memory_bytes(self) -> int | None:
        """Size of what both have learned; None where the model does not report it."""
        first, second = (memory_bytes(getattr(self, side)) for side in self.kind.sides)
        return None if first is None or second is None else first + second


def two_memories(
    model: FamiliarityModel,
    kind: type[TwoMemories],
    incremental: type[IncrementalTwoMemories],
    outside: type[OutsideMemories],
) -> Any:
    """Two memories of an untrained model: of the class for models that learn view by view, for others, or for those from outside."""
    if isinstance(model, IncrementalModel):
        return incremental(model)
    return kind(model) if isinstance(model, Model) else outside(model)


def _joined(sides: Mapping[str, Mapping[str, T]]) -> dict[str, T]:
    """What two memories hold by name, in one mapping."""
    return {f"{side}.{key}": value for side, values in sides.items() for key, value in values.items()}


def _part(learned: Learned, side: str) -> Learned:
    """What one memory holds of a mapping that `_joined` made."""
    return {key.removeprefix(f"{side}."): value for key, value in learned.items() if key.startswith(f"{side}.")}
