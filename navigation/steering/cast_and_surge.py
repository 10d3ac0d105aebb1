"""Cast and surge: ahead while the view is familiar, else to alternate sides, farther each time, until it is familiar again."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians
from typing import ClassVar

import attrs
import numpy as np

from tussock.world.errors import SettingError
from tussock.world.geometry import wrap_angle
from tussock.world.settings import choice, number, settings

from ..models.base import FamiliarityModel, Following, SequenceModel
from ..scan import scan_window
from .memories import Memory, learned_before
from .navigator import SIDES, Images, Look, Motion, tell_put_back
from .scan import best_familiarity, scan_motion

TOLERANCE = 1e-6  # m; so that legs have the same number of steps whatever their sum rounds to


@settings
class CastAndSurge:
    """Surges along the way that a familiar view shows; where no view is familiar, casts across it to alternate sides.

        surge, where the best view of a scan has an unfamiliarity under known x greatest: the way is its heading; walk along it
        cast, elsewhere: walk at way + side x angle, for a leg of some metres; then the other side, and a leg `growth` times as long

    A cast goes on past its leg while familiarity rises, which is while unfamiliarity is lower by `rise` than its running mean: so it
    climbs towards familiar views. A surge ends the search, and the next one begins with a short leg. Scans are centred on the way, as
    the agent's compass keeps it, because a cast leads away from it. `greatest` is the greatest unfamiliarity that the agent has met in
    this walk, at least 1: how unfamiliar views are off the route differs from world to world.

    Azevedo Amin et al. (2025) take from olfactory navigation that casts are a zig-zag in space in search of familiar views, and that
    surges follow familiarity. The rules, the compass and all numbers here but the width of the scan are chosen by us.

    Attributes:
        model: What tells how familiar a view is at each rotation.
        width: Full width of the scan (rad).
        known: Unfamiliarity under which a view shows the way, in the greatest one; 0 as of learned views.
        angle: Between the way and a cast (rad).
        leg: Length of the first cast (m).
        growth: Length of each further cast, in those of the one before.
        smoothing: Weight of the newest look in the running mean of unfamiliarity.
        rise: How far below this mean unfamiliarity is while familiarity rises.
        first: To which side an agent casts first.
    """

    takes_trained: ClassVar[bool] = False

    model: FamiliarityModel = attrs.field()
    width: float = number(radians(160.0), above=0, high=2 * np.pi, unit="rad")
    known: float = number(0.75, above=0, high=1)
    angle: float = number(radians(80.0), above=0, high=np.pi, unit="rad")
    leg: float = number(0.5, above=0, unit="m")
    growth: float = number(2.0, low=1)
    smoothing: float = number(0.3, above=0, high=1)
    rise: float = number(0.03, low=0)
    first: str = choice("left", tuple(SIDES))
    memory: Memory | None = attrs.field(init=False, default=None)

    def learn(self, views: Images) -> None:
        """Train the model on views (n, h, w), and learn how familiar it finds them."""
        self.model.fit(views)
        object.__setattr__(self, "memory", Memory.from_trained(self.model, views))

    def begin(self) -> "Casting":
        """What an agent remembers: it begins with a surge, the way ahead."""
        following = self.model.follow() if isinstance(self.model, SequenceModel) else None
        return Casting(following=following, side=SIDES[self.first], leg=self.leg)

    def decide(self, look: Look, memories: Sequence["Casting"]) -> Motion:
        """Let each agent surge or cast."""
        if look.odometry is None:
            raise SettingError("cast-and-surge measures its casts with an odometer; give the look its odometry")
        trained, width = learned_before(self.memory, self), look.views.shape[2]
        for memory, compass in zip(memories, look.compass.tolist(), strict=True):
            memory.way = compass if memory.way is None else memory.way
        ways = np.array([memory.way for memory in memories])
        aside = wrap_angle(ways - look.compass)
        windows = np.stack([scan_window(width, self.width, turn) for turn in aside.tolist()])
        motion = scan_motion(self.model, look.views, windows, [memory.following for memory in memories])
        unfamiliarity = trained.unfamiliarity_of(best_familiarity(motion))
        headings = [
            self._heading(*each)
            for each in zip(
                memories,
                (look.compass + motion.turn).tolist(),
                unfamiliarity.tolist(),
                look.odometry.tolist(),
                strict=True,
            )
        ]
        signals = {
            "unfamiliarity": unfamiliarity,
            "casting": np.array([float(memory.casting) for memory in memories]),
            "cast_side": np.array([memory.side * memory.casting for memory in memories]),
            "leg_m": np.array([memory.leg for memory in memories]),
            "way": np.array([memory.way for memory in memories]),
        }
        return replace(motion, turn=wrap_angle(np.array(headings) - look.compass), signals=signals)

    def _heading(self, memory: "Casting", read: float, unfamiliarity: float, walked: float) -> float:
        """Where an agent goes (rad, by its compass).

        Args:
            memory: What it remembers; changed in place.
            read: The heading of the most familiar view (rad).
            unfamiliarity: Of that view.
            walked: Since the look before (m).
        """
        rising = memory.take_in(unfamiliarity, self.smoothing) > self.rise
        if unfamiliarity < self.known * memory.greatest:
            memory.way, memory.casting, memory.leg = float(wrap_angle(read)), False, self.leg
            return memory.way
        assert memory.way is not None
        memory.walked = memory.walked + walked if memory.casting else 0.0
        if memory.casting and not rising and memory.walked >= memory.leg - TOLERANCE:
            memory.side, memory.leg, memory.walked = -memory.side, self.growth * memory.leg, 0.0
        memory.casting = True
        return memory.way + memory.side * self.angle


@dataclass
class Casting:
    """What an agent that casts and surges remembers.

    Attributes:
        following: Where it is along a learned sequence.
        side: Of its present or next cast: 1 left, -1 right.
        leg: Length of this cast (m).
        way: Heading of the last familiar view (rad, by its compass); None before its first look.
        casting: Whether it casts.
        walked: Of the present cast (m).
        mean_unfamiliarity: Running mean of unfamiliarity; None before its first look.
        greatest: The greatest unfamiliarity so far, at least 1.
    """

    following: Following | None
    side: float
    leg: float
    way: float | None = None
    casting: bool = False
    walked: float = 0.0
    mean_unfamiliarity: float | None = None
    greatest: float = 1.0

    def take_in(self, unfamiliarity: float, weight: float) -> float:
        """Add a look to the running mean and the greatest; how far its unfamiliarity is below what was usual before it."""
        self.greatest = max(self.greatest, unfamiliarity)
        before = unfamiliarity if self.mean_unfamiliarity is None else self.mean_unfamiliarity
        self.mean_unfamiliarity = before + weight * (unfamiliarity - before)
        return before - unfamiliarity

    def resume(self, progress: float) -> None:
        """Begin again where it was put back, after this share (0 to 1) of the learned sequence, the way ahead."""
        tell_put_back(self.following, progress)
        self.way, self.casting, self.mean_unfamiliarity, self.walked = None, False, None, 0.0
