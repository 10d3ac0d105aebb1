"""Scan: compare all rotations of the view with what was learned, and turn to the most familiar."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
import torch
from jaxtyping import Bool

from tussock.world.geometry import columns_of_turn, wrap_angle
from tussock.world.settings import number, settings, switch

from ..models.base import FamiliarityModel, Following, SequenceModel, SnapshotModel
from ..scan import best_turn, scan_window
from .navigator import Images, Look, Motion, ScanRecord


@settings
class Scan:
    """Turns to the most familiar heading within a window, then takes a whole step.

    The visual compass along a route of Baddeley et al. (2012), and of the thesis.

    Attributes:
        model: What tells how familiar a view is at each rotation.
        width: Full width of the window (rad).
        about: Direction of the world in the middle of the window (rad); None means the present heading.
        refine: Turn to the peak of a parabola through the most familiar rotation and its neighbours, not to that rotation itself.
    """

    model: FamiliarityModel = attrs.field()
    width: float = number(np.pi, above=0, high=2 * np.pi, unit="rad")
    about: float | None = number(None, optional=True, unit="rad")
    refine: bool = switch(True)

    def learn(self, views: Images) -> None:
        """Train the model on the views."""
        self.model.fit(views)

    def begin(self) -> Following | None:
        """Where an agent is along a learned sequence, for models that keep one."""
        return self.model.follow() if isinstance(self.model, SequenceModel) else None

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent to its most familiar heading."""
        width = look.views.shape[2]
        windows = self._windows(width, look)
        familiarity, matches = self._compare(look.views, windows, memories)
        turn = best_turn(familiarity, windows, interpolate=self.refine)
        columns = np.rint(columns_of_turn(turn, width)).astype(int) % width
        match = None if matches is None else matches[np.arange(len(look)), columns]
        progress = [None if memory is None else memory.progress for memory in memories]
        record = ScanRecord(familiarity=familiarity, window=windows, match=match, progress=progress)
        return Motion(turn=turn, scan=record)

    def _windows(self, width: int, look: Look) -> Bool[np.ndarray, "n w"]:
        """Which rotations each agent compares."""
        if self.about is None:
            return np.tile(scan_window(width, self.width), (len(look), 1))
        turns = wrap_angle(self.about - look.compass)
        return np.stack([scan_window(width, self.width, float(turn)) for turn in turns])

    def _compare(
        self, views: Images, windows: Bool[np.ndarray, "n w"], memories: Sequence[Any]
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Familiarity (n, w) of every rotation, and the learned view that each resembles (n, w), where the model keeps views."""
        if memories and memories[0] is not None:
            rows = zip(memories, views, windows, strict=True)
            familiarity, matches = zip(*(memory.look(view, window) for memory, view, window in rows), strict=True)
            return torch.stack(familiarity).cpu().numpy(), torch.stack(matches).cpu().numpy()
        if isinstance(self.model, SnapshotModel):
            familiarity, matches = self.model.match(views, windows)
            return familiarity.cpu().numpy(), matches.cpu().numpy()
        return self.model.scan(views).cpu().numpy(), None
