"""What a navigator is: it gets what agents perceive, and decides how they move."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int

from tussock.world.errors import SettingError

Images = Float32[torch.Tensor, "n h w"]


@dataclass(frozen=True, kw_only=True)
class Look:
    """What n agents perceive at one moment, and all that a navigator gets to know.

    Attributes:
        views: (n, h, w) Encoded views, ahead in the middle.
        compass: (n,) Heading as the agent's compass reads it (rad).
    """

    views: Images
    compass: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.views)


@dataclass(frozen=True, kw_only=True)
class ScanRecord:
    """What a scan compared, kept for recordings and diagnostics.

    Attributes:
        familiarity: (n, w) Of every rotation of each view, turned left by 0, 1, .. columns.
        window: (n, w) Which rotations were compared.
        match: (n,) Index of the learned view that was recognised; None where the model keeps no views.
        progress: For each agent the share of the learned sequence, 0 to 1, that it believes to have walked; None where it does not know.
    """

    familiarity: Float32[np.ndarray, "n w"]
    window: Bool[np.ndarray, "n w"]
    match: Int[np.ndarray, " n"] | None
    progress: Sequence[float | None]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """How n agents are to move: turn, then step ahead.

    Attributes:
        turn: (n,) To the left (rad).
        step: (n,) Share of the body's step length, 0 to 1; None means whole steps.
        scan: What the decision was made from, where it was a scan.
    """

    turn: Float[np.ndarray, " n"]
    step: Float[np.ndarray, " n"] | None = None
    scan: ScanRecord | None = None


@runtime_checkable
class Navigator(Protocol):
    """Decides how agents move, from what they perceive and what it has learned. It never sees where they are.

    One navigator steers any number of agents side by side. A class is registered (docs/extending.md), and made with an untrained
    familiarity model as `model`.
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


def check_motion(motion: Motion, n: int, navigator: Navigator) -> None:
    """Refuse a motion that n agents cannot make. Raises SettingError."""
    step = np.ones(n) if motion.step is None else np.asarray(motion.step)
    valid = (
        np.shape(motion.turn) == step.shape == (n,)
        and np.isfinite(motion.turn).all()
        and (step >= 0).all()
        and (step <= 1).all()
    )
    if not valid:
        raise SettingError(
            f"{type(navigator).__name__} decided to turn by {motion.turn} and to step by {motion.step}; it must return {n} finite turns "
            "(rad) and, if any, as many shares of a step, from 0 to 1"
        )
