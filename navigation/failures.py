"""Why a walk failed: what is measured at its poor and failed steps, and the cause that follows from it (docs/failures.md)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tussock.render.occlusion import covered_within
from tussock.render.renderer import Renderer
from tussock.world.geometry import Pose, Route, columns_of_turn, wrap_angle

from .encoding import Encoding
from .evaluation import RECOVERED_DEG
from .models.perfect_memory import PerfectMemory
from .training import AHEAD, training_views
from .walk import Step

# Of several that apply, the first is the cause.
OCCLUSION, OFF_CATCHMENT, ALIASING, UNLEARNED, CORNER, UNEXPLAINED = CAUSES = (
    "occlusion",
    "off the catchment",
    "aliasing",
    "unlearned direction",
    "corner",
    "unexplained",
)

POOR = np.radians(RECOVERED_DEG)  # a heading more than this off the route's, and off the way back to it, is poor
OCCLUDER = 0.05  # m; what is nearer than this to the eye ..
COVERED = 0.25  # .. and covers more than this share of the view, occludes it
CATCHMENT = 0.25  # m; a learned view tells the heading within this distance
FAR = 2 * CATCHMENT  # m; catchments whose centres are farther apart do not touch
REVERSE = np.pi - POOR  # a heading more than this off the route's leads back along it
REACH = 0.3  # m; turning at a place is the change of direction from so far before to so far after
TURNING = POOR  # where a route turns more than this, a view learned a little before or after gives a poor heading
SOUND = 0.5  # m; who gets so much farther along the route without a poor step is out of trouble


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What is measured at a poor or failed step.

    covered: share of the view, 0 to 1, in which an object is nearer than OCCLUDER. nearest: distance (m) from the nearest pose
    that a view was learned at. recognised: distance (m) from the pose of the learned view that was recognised at the chosen
    heading. error: how far that heading is from the route's (rad, -pi..pi). turning: how much the route turns within REACH before
    and after (rad, 0..pi). nearest and recognised are None where it is not known where views were learned.
    """

    covered: float
    nearest: float | None
    recognised: float | None
    error: float
    turning: float


def cause(evidence: Evidence) -> str:
    """The one of CAUSES that the evidence speaks for: first what makes the view useless, last what only misleads."""
    if evidence.covered > COVERED:
        return OCCLUSION
    if evidence.nearest is not None and evidence.nearest > CATCHMENT:
        return OFF_CATCHMENT
    if abs(evidence.error) <= POOR:  # the step failed for what came before it
        return UNEXPLAINED
    if evidence.recognised is not None and evidence.recognised > FAR:
        return ALIASING
    if abs(evidence.error) > REVERSE:
        return UNLEARNED
    return CORNER if evidence.turning > TURNING else UNEXPLAINED


def in_words(evidence: Evidence) -> str:
    """The cause, and the evidence for it."""
    found = cause(evidence)
    said = {
        OCCLUSION: f"what is within {100 * OCCLUDER:g} cm covers {evidence.covered:.0%} of the view",
        OFF_CATCHMENT: f"the nearest learned view is {evidence.nearest or 0:.2f} m away",
        ALIASING: f"the view it recognises was learned {evidence.recognised or 0:.2f} m away",
        UNLEARNED: f"the heading is {abs(np.degrees(evidence.error)):.0f} degrees off the route's",
        CORNER: f"the route turns {np.degrees(evidence.turning):.0f} degrees here",
        UNEXPLAINED: f"the heading is {abs(np.degrees(evidence.error)):.0f} degrees off the route's",
    }
    return f"{found}, {said[found]}"


class Witness:
    """Looks into what went wrong at the poor and failed steps of an agent's walks.

    renderer, encoding, route: the agent's. training_poses: of the views the model learned, in their order; where they are None it is not
    known where views were learned, and the evidence says nothing of that.
    """

    def __init__(
        self,
        renderer: Renderer,
        encoding: Encoding,
        route: Route,
        training_poses: Float[np.ndarray, "n 3"] | None = None,
    ):
        self._renderer, self._encoding, self._route = renderer, encoding, route
        self._training_poses = training_poses

    def evidence(self, step: Step) -> Evidence | None:
        """What is measured at a poor or failed step; None for a good one, which costs nothing.

        A step is poor where its heading is more than POOR off the route's, and off the way back to the route as well: an agent
        beside it that heads for the route a little ahead does well.
        """
        if step.failure is None and (abs(step.error) <= POOR or abs(self._off_the_way_back(step)) <= POOR):
            return None
        world, eye = self._renderer.world, self._renderer.eye
        return Evidence(
            covered=covered_within(world, eye, step.pose, OCCLUDER), nearest=self._nearest(step.pose),
            recognised=self._recognised(step), error=step.error, turning=float(self._route.turning(step.along, REACH)[0]),
        )  # fmt: skip

    def _off_the_way_back(self, step: Step) -> float:
        """Angle between the chosen heading and the point of the route AHEAD of the nearest (rad)."""
        x, y, _ = self._route.at(step.along + AHEAD)[0]
        return float(wrap_angle(step.pose.heading + step.turn - np.arctan2(y - step.pose.y, x - step.pose.x)))

    def _nearest(self, pose: Pose) -> float | None:
        if self._training_poses is None:
            return None
        return float(np.hypot(*(self._training_poses[:, :2] - pose[:2]).T).min())

    def _recognised(self, step: Step) -> float | None:
        if self._training_poses is None:
            return None
        poses, match = self._training_poses, step.match
        if match is None:  # the model keeps no views: which one is it that the view resembles most?
            memory, poses = self._memory
            _, index = memory.match(self._encoding(step.view[None]))
            width = index.shape[1]
            match = int(index[0, int(np.rint(columns_of_turn(step.aim, width))) % width])
        return float(np.hypot(*(poses[match, :2] - step.pose[:2])))

    @cached_property
    def _memory(self) -> tuple[PerfectMemory, Float[np.ndarray, "m 3"]]:
        """A memory of all learned views, and their poses."""
        assert self._training_poses is not None
        views, poses = training_views(self._encoding, self._renderer, self._training_poses)
        return PerfectMemory().fit(views), poses


def walk_cause(along: Sequence[float], causes: Sequence[str], failed: Sequence[bool]) -> str | None:
    """The commonest cause of a walk's failures, the first of equally common ones; None where nothing failed or nothing is known.

    A value a step: how far along the route the agent is (m), its cause, empty where it is good, and whether it failed there. The cause of a
    failure is the commonest since its trouble began: since the agent last got SOUND farther along the route without a poor step,
    or was put back. What leads off a route leads out of the catchment in the end: that is the cause only where trouble began there.
    """
    found, start = [], 0
    for end in np.flatnonzero(failed).tolist():
        labels = _trouble(along[start : end + 1], causes[start : end + 1])
        explained = [label for label in labels if label != UNEXPLAINED] or labels
        others = [label for label in explained if label != OFF_CATCHMENT]
        if others and explained[0] != OFF_CATCHMENT:
            explained = others
        found += [label for label, _ in Counter(explained).most_common(1)]
        start = end + 1
    return Counter(found).most_common(1)[0][0] if found else None


def _trouble(along: Sequence[float], causes: Sequence[str]) -> list[str]:
    """The causes of the poor steps, of some before a failure, between which the agent never got SOUND farther along the route."""
    furthest = np.maximum.accumulate(along)
    poor = [place for place, label in enumerate(causes) if label]
    sound = np.flatnonzero(np.diff(furthest[poor]) > SOUND)
    return [causes[place] for place in poor[sound[-1] + 1 if len(sound) else 0 :]]
