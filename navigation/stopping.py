"""The limits at which a walk along a route ends, and the reasons; `walk.py` checks them."""

import math
from enum import StrEnum

from tussock.world.errors import SettingError
from tussock.world.settings import choice, number, settings, switch, whole


class StopReason(StrEnum):
    """Why a walk ends. The first is success; the last but one is of walks over an image database, too far from all its views."""

    ARRIVED = "arrived"
    LOST = "lost"
    STUCK = "stuck in a loop"
    OUT_OF_WORLD = "out of the world"
    OFF_GROUND = "off the ground"
    TOO_STEEP = "too steep"
    OFF_GRID = "off the grid"
    OUT_OF_STEPS = "out of steps"


@settings
class StoppingRules:
    """When a walk ends, or when a lost agent is put back on the route.

    Attributes:
        arrival_radius: The walk has arrived within this distance of the route's end (m). Where the route ends as near to its start,
            the agent must have been farther away before.
        max_deviation: The agent is lost farther than this from the route (m).
        patience: The agent is stuck after this distance without getting farther along the route (m).
        max_steps: Limit of steps; None means as many as three times the route's length needs.
        put_back: Instead of ending the walk, put an agent that is lost, stuck, out of the world, stopped by the ground or off the grid
            back on the route, facing along the route. This is how Ardin et al. (2016) count errors.
        put_back_at: Where: "next-waypoint" is the waypoint after the furthest one that it reached, "nearest-point" the nearest point of
            the route.
        waypoint_spacing: Distance between waypoints along the route (m).
        put_back_ahead: Put back this far ahead of the point of the route nearest to the agent (m), in place of a waypoint; None means
            a waypoint. This is how Kagioulis et al. (2024) count failures.
    """

    arrival_radius: float = number(0.15, above=0, unit="m")
    max_deviation: float = number(0.5, above=0, unit="m")
    patience: float = number(3.0, above=0, unit="m")
    max_steps: int | None = whole(None, optional=True)
    put_back: bool = switch(False)
    put_back_at: str = choice("next-waypoint", ("next-waypoint", "nearest-point"))
    waypoint_spacing: float = number(0.1, above=0, unit="m")
    put_back_ahead: float | None = number(None, low=0, unit="m", optional=True)

    def __attrs_post_init__(self) -> None:
        if self.put_back_at == "nearest-point" and self.put_back_ahead is not None:
            raise SettingError(
                "an agent is put back at the nearest point, or ahead of it: give --on-lost reset with --put-back-ahead-m"
            )

    def step_limit(self, route_length: float, step_length: float) -> int:
        """The number of steps after which a walk along a route of some length (m) ends."""
        return self.max_steps or math.ceil(3 * route_length / step_length)
