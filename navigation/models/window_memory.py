"""Perfect memory of a window of the route: only the views around the one that was matched last are compared."""

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64

from tussock.world.settings import switch, whole

from .base import model
from .checks import check_scan
from .perfect_memory import PerfectMemory


@model
class WindowMemory(PerfectMemory):
    """Perfect memory with progress: a walk compares a window of the sequence, whose size follows how well views match.

    The window lies about the view that was matched last, half of it ahead. Where a view matches worse than the one before it, the
    window grows by n / size of n views, else it shrinks by as many. A walk begins at the beginning of the sequence. `scan` knows of
    no walk and compares all views. Memory grows with the number of views.

    Attributes:
        window: Number of views in the window at the beginning of a walk.
        adaptive: Whether its size changes.
        smallest: Number of views under which an adaptive window does not shrink.
    """

    name = "window-memory"
    paper = "Kagioulis et al. 2024"
    takes_partial = False

    window: int = whole(20, low=3)
    adaptive: bool = switch(True)
    smallest: int = whole(10, low=3)

    def follow(self) -> "WindowWalk":
        """Begin a walk, at the beginning of the sequence."""
        return WindowWalk(self)


class WindowWalk:
    """One walk along the sequence.

    Attributes:
        memory: The trained model.
        size: Number of views in the window, but at the ends of the sequence.
        window: The views that are compared next.
        matched: Index of the view that was matched last; None before the first look.
    """

    def __init__(self, memory: WindowMemory):
        self.memory = memory
        self.size = min(memory.window, len(memory.snapshots))
        self.window = slice(0, self.size)
        self.matched: int | None = None
        self._difference = 0.0  # at the look before; so the first one lets the window grow

    @property
    def progress(self) -> float | None:
        """Share of the sequence, 0 to 1, that it believes to have walked; None before the first look."""
        return None if self.matched is None else self.matched / max(1, len(self.memory.snapshots) - 1)

    def look(
        self, view: Float32[torch.Tensor, "h w"], allowed: Bool[np.ndarray, " w"]
    ) -> tuple[Float32[torch.Tensor, " w"], Int64[torch.Tensor, " w"]]:
        """Compare a view with those in the window, then move and resize the window; see `Following`."""
        memory = self.memory
        check_scan(view[None], memory.shape)
        view, allowed_ = memory._on_device(view), memory._on_device(torch.as_tensor(allowed))
        (familiarity,), (index,) = memory._nearest(view[None], allowed[None], self.window)
        best = int(torch.where(allowed_, familiarity, -torch.inf).argmax())
        if memory.adaptive:
            self._resize(-float(familiarity[best]))
        self._move(int(index[best]))
        return familiarity, index

    def resume(self, progress: float) -> None:
        """Go on after this share (0 to 1) of the sequence, where the walk was put back on the route; the size stays."""
        self._move(round(progress * (len(self.memory.snapshots) - 1)))

    def _resize(self, difference: float) -> None:
        count = len(self.memory.snapshots)
        change = round(count / self.size)
        if difference > self._difference:
            self.size = min(self.size + change, count)
        else:
            self.size = min(max(self.size - change, self.memory.smallest), count)
        self._difference = difference

    def _move(self, matched: int) -> None:
        """Take the window around a view; at the ends of the sequence it keeps its size."""
        count, ahead = len(self.memory.snapshots), round(self.size / 2)
        first = max(0, min(matched - (self.size - ahead), count - self.size))
        self.window = slice(first, min(count, max(matched + ahead, self.size)))
        self.matched = matched
