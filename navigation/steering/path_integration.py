"""Path integration: sum up the way by compass and odometry, walk back along the sum, and search where the goal should be."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError
from tussock.world.geometry import wrap_angle
from tussock.world.settings import number, settings

from .navigator import Images, Journey, Look, Motion

GOLDEN_ANGLE = np.pi * (3 - 5**0.5)  # rad, between the directions of two loops: any number of them spreads evenly


@dataclass(kw_only=True)
class Search:
    """A search in loops: circles through one point, each wider than the last, each in another direction.

    Attributes:
        direction: Of the first loop (rad).
        side: 1 where the agent turns left in the loops, -1 where it turns right.
        walked: Distance since the search began (m).
    """

    direction: float
    side: int
    walked: float = 0.0

    def position(self, ahead: float, growth: float) -> Float[np.ndarray, "2"]:
        """Where the search will be after some metres more, from its point (m).

        Args:
            ahead: These metres.
            growth: Diameter of the first loop, and what each is wider than the last (m).
        """
        walked = max(self.walked + ahead, 0.0)  # what a bad odometer reads may be negative
        turns = walked / (np.pi * growth)  # loop k is k such units long
        before = int((np.sqrt(8 * turns + 1) - 1) / 2)
        loop = before + 1
        radius, arc = growth * loop / 2, 2 * np.pi * (turns - before * loop / 2) / loop
        outward = self.direction + self.side * GOLDEN_ANGLE * before
        return radius * (_ahead(outward) - _ahead(outward + self.side * arc))


@dataclass(kw_only=True)
class IntegratedPath:
    """What one agent remembers.

    Attributes:
        home: (2,) Way to its goal, in the directions of the compass (m).
        side: 1 where its first turn was to the left, else -1: to which it turns in its search; None before that turn.
        search: Its search; None before it has come to where the goal should be.
    """

    home: Float[np.ndarray, "2"]
    side: int | None = None
    search: Search | None = None


@settings
class PathIntegration:
    """Walks along its home vector, and searches at its end in growing loops.

    The vector is the sum of all steps by compass and odometry. Errors of both add up, so that the goal is seldom exactly at its end.
    There the agent searches, as desert ants do: Wehner and Srinivasan (1981), "Searching behaviour of desert ants, genus
    Cataglyphis", Journal of Comparative Physiology 142, 315-338. Its loops are circles through the end of the vector, in directions
    that are a golden angle apart: chosen here. An agent that has not been on a way out begins with the search.

    Attributes:
        arrival: The search begins within this distance of the end of the vector (m).
        growth: Diameter of the first loop, and what each is wider than the last (m).
        reach: Length of the vector at which an agent is half certain of it (m), where `blend` asks.
    """

    reads_views: ClassVar[bool] = False

    arrival: float = number(0.05, above=0, unit="m")
    growth: float = number(0.3, above=0, unit="m")
    reach: float = number(1.0, above=0, unit="m")

    def learn(self, views: Images) -> None:
        """Learn nothing: it steers without views."""

    def begin(self) -> IntegratedPath:
        """A vector of no length."""
        return IntegratedPath(home=np.zeros(2))

    def travel(self, memory: IntegratedPath, journey: Journey) -> None:
        """Take in the way from the goal to where the walk begins."""
        memory.home = memory.home - journey.vector

    def decide(self, look: Look, memories: Sequence[IntegratedPath]) -> Motion:
        """Turn each agent towards its goal, or along its search."""
        walked = distance_walked(look, "path-integration")
        homes = np.array([memory.home for memory in memories]) - walked[:, None] * _ahead(look.compass)
        targets = homes.copy()
        for memory, home, target, heading, distance in zip(memories, homes, targets, look.compass, walked, strict=True):
            memory.home = home
            if memory.search is not None:
                memory.search.walked += float(distance)
            elif np.hypot(*home) <= self.arrival:
                memory.search = Search(direction=float(heading), side=memory.side or 1)
            if memory.search is not None:
                target += memory.search.position(2 * self.arrival, self.growth)
        turn = wrap_angle(np.arctan2(targets[:, 1], targets[:, 0]) - look.compass)
        for memory, first in zip(memories, turn, strict=True):
            if memory.side is None:
                memory.side = 1 if first > -1e-9 else -1
        length = np.hypot(*homes.T)
        looks = np.zeros(len(look), dtype=np.int64)
        certainty = length / (length + self.reach)
        return Motion(turn=turn, certainty=certainty, looks=looks, signals={"home_vector": homes})


def distance_walked(look: Look, navigator: str) -> Float[np.ndarray, " n"]:
    """What the agents walked since the look before (m). Raises SettingError for agents that cannot measure it."""
    if look.odometry is None:
        raise SettingError(
            f"the navigator {navigator!r} needs odometry, which this agent does not have; name another navigator"
        )
    return look.odometry


def _ahead(heading) -> Float[np.ndarray, "*n 2"]:
    """Directions ahead of one or more headings (rad), of length 1."""
    return np.stack([np.cos(heading), np.sin(heading)], axis=-1)
