"""What a navigator is: it gets what agents perceive, and decides how they move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int

from tussock.world.errors import SettingError

Images = Float32[torch.Tensor, "n h w"]
SIDES = {"left": 1.0, "right": -1.0}  # choices of a navigator's parameter `first`, and the signs of turns


@dataclass(frozen=True, kw_only=True)
class Look:
    """What n agents perceive at one moment, and all that a navigator gets to know.

    Attributes:
        views: (n, h, w) Encoded views, ahead in the middle.
        compass: (n,) Heading as the agent's compass reads it (rad).
        odometry: (n,) Distance walked since the look before, as the agent measures it (m); 0 at the first look. None where an agent
            has no odometry, as a hand-held camera.
        touch: (n,) Whether the agent was stopped by an obstacle, or slid along one, since the look before. None: it cannot feel.
    """

    views: Images
    compass: Float[np.ndarray, " n"]
    odometry: Float[np.ndarray, " n"] | None = None
    touch: Bool[np.ndarray, " n"] | None = None

    def __len__(self) -> int:
        return len(self.views)


@dataclass(frozen=True, kw_only=True)
class ScanRecord:
    """What a scan compared, kept for recordings and diagnostics.

    Attributes:
        familiarity: (n, w) Of every rotation of each view, turned left by 0, 1, .. columns.
        window: (n, w) Which rotations were compared; none of a row: that agent did not scan.
        match: (n,) Index of the learned view that was recognised; None where the model keeps no views.
        progress: For each agent the share of the learned sequence, 0 to 1, that it believes to have walked; None where it does not know.
    """

    familiarity: Float32[np.ndarray, "n w"]
    window: Bool[np.ndarray, "n w"]
    match: Int[np.ndarray, " n"] | None
    progress: Sequence[float | None]


@dataclass(frozen=True, kw_only=True)
class Journey:
    """A way that an agent has walked, as its compass and odometer read it.

    Attributes:
        compass: (k,) Heading of each part of the way (rad).
        odometry: (k,) Length of each part (m).
    """

    compass: Float[np.ndarray, " k"]
    odometry: Float[np.ndarray, " k"]

    @property
    def vector(self) -> Float[np.ndarray, "2"]:
        """From its beginning to its end (m, east and north)."""
        return np.array([self.odometry @ np.cos(self.compass), self.odometry @ np.sin(self.compass)])


@dataclass(frozen=True, kw_only=True)
class Motion:
    """How n agents are to move: turn, then step ahead.

    Attributes:
        turn: (n,) To the left (rad).
        step: (n,) Share of the body's step length, 0 to 1; None means whole steps.
        scan: What the decision was made from, where it was a scan.
        certainty: (n,) How certain the decision is, 0 to 1, as `blend` weighs it; None means 1.
        looks: (n,) Headings that were looked at for the decision; None means one, or those of the scan.
        signals: (n,) or (n, k) What the decision was made from, by names of the navigator's own; for recordings and tables.
    """

    turn: Float[np.ndarray, " n"]
    step: Float[np.ndarray, " n"] | None = None
    scan: ScanRecord | None = None
    certainty: Float[np.ndarray, " n"] | None = None
    looks: Int[np.ndarray, " n"] | None = None
    signals: Mapping[str, np.ndarray] = field(default_factory=dict)

    def spread(self, rows: Sequence[int], n: int) -> "Motion":
        """A scan of k of n agents as the motion of all; the others do not look, and walk straight on."""
        assert self.scan is not None
        scan, turn = self.scan, np.zeros(n)
        turn[rows] = self.turn
        parts = [np.zeros((n, scan.window.shape[1]), dtype) for dtype in (np.float32, bool)]
        parts[0][rows], parts[1][rows] = scan.familiarity, scan.window
        match = None
        if scan.match is not None:
            match = np.zeros(n, dtype=np.int64)
            match[rows] = scan.match
        progress: list[float | None] = [None] * n
        for row, value in zip(rows, scan.progress, strict=True):
            progress[row] = value
        certainty = np.zeros(n)
        certainty[rows] = 1.0 if self.certainty is None else self.certainty
        record = ScanRecord(familiarity=parts[0], window=parts[1], match=match, progress=progress)
        return Motion(turn=turn, scan=record, certainty=certainty)

    def looks_of(self, row: int) -> int:
        """Headings that an agent looked at."""
        if self.looks is not None:
            return int(self.looks[row])
        return 1 if self.scan is None else int(self.scan.window[row].sum())


@runtime_checkable
class Navigator(Protocol):
    """Decides how agents move, from what they perceive and what it has learned. It never sees where they are.

    One navigator steers any number of agents side by side. A class is registered (docs/extending.md), and made with an untrained
    familiarity model as `model`. One that must learn the views itself, and so cannot use a model from a file, says `takes_trained = False`.
    One that makes no use of compass and odometer says `reads_senses = False`, so that a person who gives them noise is told.
    """

    def learn(self, views: Images) -> None:
        """Learn the views (n, h, w) of a route, in their order, each facing along the route or back to it."""
        ...

    def begin(self) -> Any:
        """What one agent remembers at the start of a walk; None where it remembers nothing."""
        ...

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """How the agents move after a look.

        Args:
            look: What they perceive.
            memories: What each of them remembers, as `begin` made it; changed in place.
        """
        ...


@runtime_checkable
class PathIntegrating(Navigator, Protocol):
    """A navigator whose agents remember the way from the goal to where their walk begins."""

    def travel(self, memory: Any, journey: Journey) -> None:
        """Take in the way from the goal to where a walk begins, before its first look.

        Args:
            memory: What the agent remembers, as `begin` made it; changed in place.
            journey: The way, as the agent measured it.
        """
        ...


@runtime_checkable
class LearningPlaces(Navigator, Protocol):
    """A navigator that learns where views were seen, by the agent's own path integration; its `learn_at` takes the place of `learn`."""

    def learn_at(self, views: Images, places: Float[np.ndarray, "n 3"]) -> None:
        """Learn the views of a route or a learning flight.

        Args:
            views: (n, h, w) In their order.
            places: (n, 3) Where they were seen, from the goal (m, east and north), and the heading (rad), as the agent measured them.
        """
        ...


def tell_put_back(memory: Any, progress: float) -> None:
    """Tell what an agent remembers that it was put back on the route, after this share (0 to 1) of it; not all minds that."""
    if hasattr(memory, "resume"):
        memory.resume(progress)


def check_motion(motion: Motion, n: int, navigator: Navigator) -> None:
    """Refuse a motion that n agents cannot make. Raises SettingError."""
    step = np.ones(n) if motion.step is None else np.asarray(motion.step)
    if short := [name for name, values in motion.signals.items() if not _numbers_of_each(values, n)]:
        raise SettingError(
            f"{type(navigator).__name__} gave {short[0]!r} as a signal; it must be numbers, a row for each of {n} agents"
        )
    others = [each for each in (motion.looks, motion.certainty) if each is not None]
    valid = (
        np.shape(motion.turn) == step.shape == (n,)
        and np.isfinite(motion.turn).all()
        and (step >= 0).all()
        and (step <= 1).all()
        and all(np.shape(each) == (n,) and np.min(each, initial=0) >= 0 for each in others)
    )
    if not valid:
        raise SettingError(
            f"{type(navigator).__name__} decided to turn by {motion.turn} and to step by {motion.step}; it must return {n} finite turns "
            "(rad) and, if any, as many shares of a step, from 0 to 1, looks and certainties"
        )


def _numbers_of_each(values: Any, n: int) -> bool:
    """Whether a signal is numbers, a row for each of n agents."""
    return np.shape(values)[:1] == (n,) and np.asarray(values).dtype.kind in "fiub"
