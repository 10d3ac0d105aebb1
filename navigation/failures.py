"""Why a walk failed: what is measured at its poor and failed steps, and the cause that follows (docs/failures.md)."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tussock.render.changed_views import ChangedViews
from tussock.render.images.source import DatabaseViews
from tussock.render.mounted_eye import mounted
from tussock.render.occlusion import covered_within
from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Route, wrap_angle

from .encoding import Encoding
from .evaluation import RECOVERED_DEG
from .feature_mask import FeatureMask, is_partial
from .learned_views import Images, LearnedViews
from .models.base import recognises
from .models.files import TrainedModel
from .training import AHEAD, training_views
from .walker import Step


class Cause(StrEnum):
    """Why a step is poor. Of several that apply, the first is taken."""

    OCCLUSION = "occlusion"
    OFF_CATCHMENT = "off the catchment"
    ALIASING = "aliasing"
    UNLEARNED = "unlearned direction"
    CORNER = "corner"
    UNEXPLAINED = "unexplained"


POOR = np.radians(
    RECOVERED_DEG
)  # a heading is poor if it is more than this from the route's and from the way back to it
OCCLUDER_DISTANCE = 0.05  # m; an object nearer than this to the eye ..
MAX_COVERED = 0.25  # .. occludes the view where it covers more than this share of it
CATCHMENT = 0.25  # m; a learned view gives the heading within this distance
FAR = 2 * CATCHMENT  # m; catchments whose centres are farther apart do not touch
REVERSE = np.pi - POOR  # a heading more than this off the route's leads back along it
CHORD = 0.3  # m; how much the route turns is measured from so far before to so far after
CORNER_ANGLE = POOR  # where a route turns more than this, a view learned a little before or after gives a poor heading
TOGETHER = 16  # steps that are examined together ..
AHEAD_S = 0.25  # s; .. unless they take longer than this
RECOVERY = 0.5  # m; an agent that gets this much farther along the route without a poor step is out of trouble


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """What is measured at a poor or failed step.

    Attributes:
        covered: Share of the view, 0 to 1, in which an object is nearer than OCCLUDER_DISTANCE; None where views are images, which do
            not show how near things are.
        nearest: Distance from the nearest pose at which a view was learned (m); None where these are not known.
        recognised: Distance from the pose of the learned view that was recognised at the chosen heading (m); None likewise.
        error: Angle between the chosen heading and the route's (rad, -pi..pi).
        turning: How much the route turns within CHORD before and after (rad, 0..pi).
        recognises: Whether what steers depends on the learned views. A control that does not has no cause but chance.
    """

    covered: float | None
    nearest: float | None
    recognised: float | None
    error: float
    turning: float
    recognises: bool = True

    @property
    def cause(self) -> Cause:
        """The cause that the measurements point to: first what makes a view useless, last what only misleads."""
        if not self.recognises:
            return Cause.UNEXPLAINED
        if self.covered is not None and self.covered > MAX_COVERED:
            return Cause.OCCLUSION
        if self.nearest is not None and self.nearest > CATCHMENT:
            return Cause.OFF_CATCHMENT
        if abs(self.error) <= POOR:  # the step failed because of earlier ones
            return Cause.UNEXPLAINED
        if self.recognised is not None and self.recognised > FAR:
            return Cause.ALIASING
        if abs(self.error) > REVERSE:
            return Cause.UNLEARNED
        return Cause.CORNER if self.turning > CORNER_ANGLE else Cause.UNEXPLAINED

    def __str__(self) -> str:
        """The cause, and the measurement that points to it."""
        off = f"the heading is {abs(np.degrees(self.error)):.0f} degrees off the route's"
        measured = {
            Cause.OCCLUSION: f"objects within {100 * OCCLUDER_DISTANCE:g} cm cover {self.covered or 0:.0%} of the view",
            Cause.OFF_CATCHMENT: f"the nearest learned view is {self.nearest or 0:.2f} m away",
            Cause.ALIASING: f"the view it recognises was learned {self.recognised or 0:.2f} m away",
            Cause.UNLEARNED: off,
            Cause.CORNER: f"the route turns {np.degrees(self.turning):.0f} degrees here",
            Cause.UNEXPLAINED: off,
        }
        return f"{self.cause}, {measured[self.cause]}"


class Diagnostics:
    """Measures why the steps of a walk are poor."""

    def __init__(
        self,
        renderer: Renderer,
        trained: TrainedModel | None,
        route: Route,
        views: Images | None = None,
        *,
        learned: tuple[Encoding, Float[np.ndarray, "m 3"]] | None = None,
    ):
        """Prepare for walks along a route.

        Args:
            renderer: The one that the walk uses.
            trained: What the walk follows. Where it is None, or the poses of its views are unknown, nothing about learned views is
                measured.
            route: The route that the walk is to follow.
            views: (m, h, w) The encoded views that it learned at these poses; they are kept, not copied. None: they are drawn again when
                they are first needed.
            learned: The encoding and the poses of the views, where what the walk follows is more than one model.

        Raises:
            SettingError: For a model that has learned nothing or through another eye, and for views that are not those at its poses.
        """
        if trained is not None:
            trained.check()
            trained.check_eye(renderer.eye)
        self._renderer, self._route, self._views = renderer, route, views
        self._recognises = trained is None or recognises(trained.model)
        self._learned = learned
        if trained is not None and trained.poses is not None and trained.encoding is not None:
            self._learned = trained.encoding, trained.poses
            if views is not None and len(views) != len(trained.poses):
                raise SettingError(
                    f"{len(trained.poses)} poses for {len(views)} views; give the views at these poses, or none"
                )

    def examine(self, steps: Sequence[Step | None]) -> list[Diagnosis | None]:
        """What is measured at the poor and failed steps of agents side by side; None for a good one, which costs nothing.

        A heading towards the route a little ahead is good too: it is the way back for an agent that is off the route.

        Args:
            steps: One for each agent; None for an agent whose walk has ended, which gives None. A walk alone is a list of one.
        """
        diagnoses: list[Diagnosis | None] = [None] * len(steps)
        places = self._poor(steps)
        poor = [step for place in places if (step := steps[place]) is not None]
        if not poor:
            return diagnoses
        turning = self._route.turning([step.along for step in poor], CHORD).tolist()
        measured = zip(
            places, poor, self._covered(poor), self._nearest(poor), self._recognised(poor), turning, strict=True
        )
        for place, step, covered, nearest, recognised, turns in measured:
            diagnoses[place] = Diagnosis(
                covered=covered,
                nearest=nearest,
                recognised=recognised,
                error=step.error,
                turning=turns,
                recognises=self._recognises,
            )
        return diagnoses

    def along(self, walk: Iterator[list[Step | None]]) -> Iterator[list[tuple[Step, Diagnosis | None] | None]]:
        """A walk with diagnoses: each time, a list with the step of each agent and what is measured there, or None if its walk has ended.

        The walk is up to TOGETHER steps ahead, or those of AHEAD_S, because what is measured at many together takes a fraction of the time.

        Args:
            walk: The steps of agents side by side, as `Walk.steps` gives them.
        """
        ended = False
        while not ended:
            moments: list[list[Step | None]] = []
            try:
                began = time.monotonic()
                for steps in walk:
                    moments.append(steps)
                    if sum(map(len, moments)) >= TOGETHER or time.monotonic() - began > AHEAD_S:
                        break
                else:
                    ended = True
            except BaseException:  # what was walked before is not lost
                yield from self._examined(moments)
                raise
            yield from self._examined(moments)

    def _examined(self, moments: list[list[Step | None]]) -> Iterator[list[tuple[Step, Diagnosis | None] | None]]:
        diagnoses = iter(self.examine([step for steps in moments for step in steps]))
        for steps in moments:
            yield [
                None if step is None else (step, diagnosis) for step, diagnosis in zip(steps, diagnoses, strict=False)
            ]

    def _poor(self, steps: Sequence[Step | None]) -> list[int]:
        """Which of some steps are poor or failed."""
        wrong = [
            (k, step) for k, step in enumerate(steps) if step is not None and (step.failure or abs(step.error) > POOR)
        ]
        if all(step.failure for _, step in wrong):
            return [k for k, _ in wrong]
        ahead = self._route.at([step.along + AHEAD for _, step in wrong])
        x, y, heading = np.array([step.pose for _, step in wrong]).T
        turn = [step.turn for _, step in wrong]
        off_the_way_back = wrap_angle(heading + turn - np.arctan2(ahead[:, 1] - y, ahead[:, 0] - x))
        astray = (np.abs(off_the_way_back) > POOR).tolist()
        return [k for (k, step), off in zip(wrong, astray, strict=True) if step.failure or off]

    def _covered(self, steps: Sequence[Step]) -> list[float] | list[None]:
        if isinstance(self._renderer, DatabaseViews):
            return [None] * len(steps)
        world, eye = self._renderer.world, self._renderer.eye
        poses = np.array([(*step.pose, step.height + eye.z, *(step.tilt or (0.0, 0.0))) for step in steps])
        if isinstance(self._renderer, ChangedViews):
            poses = mounted(poses, self._renderer.mount)
        return covered_within(world, eye, poses, OCCLUDER_DISTANCE).tolist()

    def _nearest(self, steps: Sequence[Step]) -> list[float] | list[None]:
        if self._learned is None:
            return [None] * len(steps)
        _, poses = self._learned
        x, y, _ = np.array([step.pose for step in steps]).T[..., None]
        return np.hypot(poses[:, 0] - x, poses[:, 1] - y).min(axis=1).tolist()

    def _recognised(self, steps: Sequence[Step]) -> list[float | None]:
        if self._learned is None or not self._recognises:
            return [None] * len(steps)
        _, poses = self._learned
        away: list[float | None] = [None] * len(steps)
        unmatched = []  # the model keeps no views: take the learned view that looks most like what the agent saw
        for k, step in enumerate(steps):
            if step.match is not None:
                away[k] = _distance(poses[step.match], step)
            elif step.encoded is not None:
                unmatched.append(k)
        if unmatched and not is_partial(self._mask):  # images that are partly unknown are compared by their own means
            memory, poses = self._memory
            looks = [(steps[k].encoded, steps[k].aim) for k in unmatched]
            for k, match in zip(unmatched, memory.nearest(looks), strict=True):
                away[k] = _distance(poses[match], steps[k])
        return away

    @cached_property
    def _memory(self) -> tuple[LearnedViews, Float[np.ndarray, "m 3"]]:
        """All learned views, and their poses."""
        assert self._learned is not None
        (encoding, poses), views = self._learned, self._views
        if views is None:
            views, poses = training_views(encoding, self._renderer, poses, warn=False)
        return LearnedViews(views, self._mask), poses

    @property
    def _mask(self) -> FeatureMask | None:
        """What a model sees of the views."""
        assert self._learned is not None
        return self._learned[0].for_eye(self._renderer.eye).mask


def _distance(pose: Float[np.ndarray, "3"], step: Step) -> float:
    """Distance from a pose to where an agent made a step (m)."""
    return float(np.hypot(pose[0] - step.pose.x, pose[1] - step.pose.y))


def walk_cause(along: Sequence[float], causes: Sequence[str], failed: Sequence[bool]) -> str | None:
    """The most frequent cause of a walk's failures, the first of equally frequent ones; None where nothing failed.

    The cause of a failure is the most frequent one since its trouble began: since the agent last got RECOVERY farther along the route
    without a poor step, or was put back. Every lost agent ends up off the catchment, so that cause
    counts only where the trouble began with it.

    Args:
        along: Distance along the route at each step (m).
        causes: Cause of each step; empty for a good one.
        failed: Whether the agent failed at each step.
    """
    found, start = [], 0
    for end in np.flatnonzero(failed).tolist():
        labels = _trouble(along[start : end + 1], causes[start : end + 1])
        explained = [label for label in labels if label != Cause.UNEXPLAINED] or labels
        others = [label for label in explained if label != Cause.OFF_CATCHMENT]
        if others and explained[0] != Cause.OFF_CATCHMENT:
            explained = others
        found += [label for label, _ in Counter(explained).most_common(1)]
        start = end + 1
    return Counter(found).most_common(1)[0][0] if found else None


def _trouble(along: Sequence[float], causes: Sequence[str]) -> list[str]:
    """The causes of the poor steps before a failure, since the agent last got RECOVERY farther along the route between two of them."""
    furthest = np.maximum.accumulate(along)
    poor = [step for step, label in enumerate(causes) if label]
    recovered = np.flatnonzero(np.diff(furthest[poor]) > RECOVERY)
    return [causes[step] for step in poor[recovered[-1] + 1 if len(recovered) else 0 :]]
