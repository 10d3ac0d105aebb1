"""Familiarity-modulated: how far an agent scans, and how fast it walks, follow how well it knows the view."""

from collections.abc import Sequence
from dataclasses import replace
from math import radians
from typing import Any, ClassVar

import attrs
import numpy as np

from tussock.world.settings import number, settings

from ..models.base import FamiliarityModel, Following, SequenceModel
from ..scan import scan_window
from .memories import Memory, learned_before
from .navigator import Images, Look, Motion
from .scan import best_familiarity, scan_motion


@settings
class FamiliarityModulated:
    """Scans narrowly and walks fast where the view ahead is familiar, widely and slowly where it is not.

        width = narrow + (wide - narrow) unfamiliarity ahead
        step = 1 - slowing x unfamiliarity at the new heading, at least slowest

    Both unfamiliarities count from 0 to 1. Azevedo Amin et al. (2025) let the familiarity of a view modulate the scans that an agent
    makes on the spot, of at most 160 degrees. The two equations, their other numbers and the speed are chosen here.

    Attributes:
        model: What tells how familiar a view is at each rotation.
        narrow: Full width of the scan where the view ahead is one that was learned (rad).
        wide: Full width where it is as unfamiliar as a view that faces the other way (rad).
        slowing: How much slower the agent walks at an unfamiliarity of 1, as a share of a whole step.
        slowest: The shortest step, as a share of a whole one.
    """

    takes_trained: ClassVar[bool] = False
    reads_senses: ClassVar[bool] = False

    model: FamiliarityModel = attrs.field()
    narrow: float = number(radians(40.0), above=0, high=2 * np.pi, unit="rad")
    wide: float = number(radians(160.0), above=0, high=2 * np.pi, unit="rad")
    slowing: float = number(0.5, low=0, high=1)
    slowest: float = number(0.2, above=0, high=1)
    memory: Memory | None = attrs.field(init=False, default=None)

    def learn(self, views: Images) -> None:
        """Train the model on views (n, h, w), and learn how familiar it finds them."""
        self.model.fit(views)
        object.__setattr__(self, "memory", Memory.from_trained(self.model, views))

    def begin(self) -> Following | None:
        """Where an agent is along a learned sequence, for models that keep one."""
        return self.model.follow() if isinstance(self.model, SequenceModel) else None

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent to its most familiar heading within the width that the view ahead sets."""
        memory = learned_before(self.memory, self)
        ahead = memory.unfamiliarity(look.views).clip(0, 1)
        widths = self.narrow + (self.wide - self.narrow) * ahead
        windows = np.stack([scan_window(look.views.shape[2], width) for width in widths.tolist()])
        motion = scan_motion(self.model, look.views, windows, memories)
        unfamiliarity = memory.unfamiliarity_of(best_familiarity(motion))
        step = (1 - self.slowing * unfamiliarity.clip(0, 1)).clip(self.slowest, 1.0)
        signals = {"unfamiliarity": unfamiliarity, "unfamiliarity_ahead": ahead, "scan_width": widths}
        return replace(motion, step=step, signals=signals)
