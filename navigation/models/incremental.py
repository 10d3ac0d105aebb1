"""Models that learn view by view."""

from abc import abstractmethod
from typing import TypeVar

from ..feature_mask import is_partial
from .base import Learned, Model
from .checks import Images, check_scan, check_training

Incremental = TypeVar("Incremental", bound="IncrementalModel")


class IncrementalModel(Model):
    """A model that learns view by view, and goes on learning at any time."""

    def partial_fit(self: Incremental, views: Images) -> Incremental:
        """Learn further views of the same shape on top of what it knows; where that fails, the model stays as it was."""
        if self.shape is None:
            return self.fit(views)
        check_training(views, is_partial(self.mask))
        check_scan(views, self.shape, is_partial(self.mask))
        self._learn_more(self.shape, self._on_device(views))
        return self

    def _learn_more(self, shape: tuple[int, int], views: Images) -> None:
        """Learn further views of that shape; where that fails, stay as it was. For models that can do so at less cost than `restore`."""
        self.restore(shape, self._add(self._learned, views))

    def _learn(self, views: Images) -> Learned:
        return self._add(self._begin(views.shape[1], views.shape[2]), views)

    @abstractmethod
    def _begin(self, height: int, width: int) -> Learned:
        """What it knows before the first view."""

    @abstractmethod
    def _add(self, learned: Learned, views: Images) -> Learned:
        """`learned`, which stays as it is, with views added one after the other."""
