"""Scan: compare all rotations of the view with what was learned, and turn to the most familiar."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import attrs
import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from tussock.world.geometry import columns_of_turn, wrap_angle
from tussock.world.settings import number, settings, switch, whole

from ..models.base import FamiliarityModel, Following, SequenceModel, SnapshotModel
from ..scan import best_turn, coarse_to_fine, scan_window
from .navigator import Images, Look, Motion, ScanRecord, tell_put_back


@settings
class Scan:
    """Turns to the most familiar heading within a window, then takes a whole step.

    The visual compass along a route of Baddeley et al. (2012), and of the thesis.

    Attributes:
        model: What tells how familiar a view is at each rotation.
        width: Full width of the window (rad).
        about: Direction of the world in the middle of the window (rad); None means the present heading.
        refine: Turn to the peak of a parabola through the most familiar rotation and its neighbours, not to that rotation itself.
        every: Scan at every N-th look, and walk straight on at those between.
        coarse: Look first at headings that are this far apart, and then at all between the neighbours of the most familiar of these
            (rad). 0: look at all headings of the window.
    """

    model: FamiliarityModel = attrs.field()
    width: float = number(np.pi, above=0, high=2 * np.pi, unit="rad")
    about: float | None = number(None, optional=True, unit="rad")
    refine: bool = switch(True)
    every: int = whole(1)
    coarse: float = number(0.0, low=0, high=np.pi, unit="rad")

    @property
    def reads_senses(self) -> bool:
        """Whether the compass matters: for the direction in the middle of the window."""
        return self.about is not None

    def learn(self, views: Images) -> None:
        """Train the model on the views."""
        self.model.fit(views)

    def begin(self) -> "Following | Between | None":
        """Where an agent is along a learned sequence, for models that keep one, and how long ago it scanned, where it does not always."""
        following = self.model.follow() if isinstance(self.model, SequenceModel) else None
        return following if self.every == 1 else Between(following)

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent to its most familiar heading, where its scan is due."""
        if self.every == 1:
            return self._scanned(look, memories)
        due = np.flatnonzero([memory.next_look() % self.every == 0 for memory in memories]).tolist()
        if len(due) == 0:
            nothing = np.zeros(len(look))
            return Motion(turn=nothing, certainty=nothing, looks=nothing.astype(np.int64))
        some = Look(views=look.views[due], compass=look.compass[due])
        return self._scanned(some, [memories[row].following for row in due]).spread(due, len(look))

    def _scanned(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent to its most familiar heading."""
        windows = self._windows(look.views.shape[2], look)
        return scan_motion(self.model, look.views, windows, memories, refine=self.refine, coarse=self.coarse)

    def _windows(self, width: int, look: Look) -> Bool[np.ndarray, "n w"]:
        """Which rotations each agent compares."""
        if self.about is None:
            return np.tile(scan_window(width, self.width), (len(look), 1))
        turns = wrap_angle(self.about - look.compass)
        return np.stack([scan_window(width, self.width, float(turn)) for turn in turns])


def scan_motion(
    model: FamiliarityModel,
    views: Images,
    windows: Bool[np.ndarray, "n w"],
    memories: Sequence[Any],
    *,
    refine: bool = True,
    coarse: float = 0.0,
) -> Motion:
    """A turn to the most familiar rotation of each view.

    Args:
        model: What tells how familiar a view is at each rotation.
        views: (n, h, w) Of the agents.
        windows: (n, w) The rotations that each of them chooses from.
        memories: Where each is along a learned sequence; None where the model keeps none.
        refine: As of `Scan`.
        coarse: As of `Scan` (rad).
    """
    width = views.shape[2]
    familiarity, matches = _compare(model, views, windows, memories)
    if coarse:
        windows = coarse_to_fine(familiarity, windows, max(1, round(float(columns_of_turn(coarse, width)))))
    turn = best_turn(familiarity, windows, interpolate=refine)
    columns = np.rint(columns_of_turn(turn, width)).astype(int) % width
    match = None if matches is None else matches[np.arange(len(views)), columns]
    progress = [None if memory is None else memory.progress for memory in memories]
    record = ScanRecord(familiarity=familiarity, window=windows, match=match, progress=progress)
    return Motion(turn=turn, scan=record, certainty=_peaked(familiarity))


def best_familiarity(motion: Motion) -> Float[np.ndarray, " n"]:
    """Familiarity of the rotation that each agent's scan chose."""
    assert motion.scan is not None
    return np.where(motion.scan.window, motion.scan.familiarity, -np.inf).max(axis=1).astype(float)


def _compare(
    model: FamiliarityModel, views: Images, windows: Bool[np.ndarray, "n w"], memories: Sequence[Any]
) -> tuple[np.ndarray, np.ndarray | None]:
    """Familiarity (n, w) of every rotation, and the learned view that each resembles (n, w), where the model keeps views."""
    if memories and memories[0] is not None:
        rows = zip(memories, views, windows, strict=True)
        familiarity, matches = zip(*(memory.look(view, window) for memory, view, window in rows), strict=True)
        return torch.stack(familiarity).cpu().numpy(), torch.stack(matches).cpu().numpy()
    if isinstance(model, SnapshotModel):
        familiarity, matches = model.match(views, windows)
        return familiarity.cpu().numpy(), matches.cpu().numpy()
    return model.scan(views).cpu().numpy(), None


def _peaked(familiarity: Float32[np.ndarray, "n w"]) -> Float[np.ndarray, " n"]:
    """How far the best rotation of each view stands out: 1 where all others are as unfamiliar as the worst, 0 where all are alike."""
    best, worst = familiarity.max(axis=1), familiarity.min(axis=1)
    span = np.maximum(best - worst, np.finfo(np.float32).tiny)
    return ((best - familiarity.mean(axis=1)) / span).clip(0, 1).astype(float)


@dataclass
class Between:
    """What an agent remembers that does not scan at every look.

    Attributes:
        following: Where it is along a learned sequence.
        looks: That it has had.
    """

    following: Following | None
    looks: int = 0

    def next_look(self) -> int:
        """The number of this look, from 0."""
        self.looks += 1
        return self.looks - 1

    def resume(self, progress: float) -> None:
        """Go on after this share (0 to 1) of the learned sequence."""
        tell_put_back(self.following, progress)
