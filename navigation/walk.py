"""The loop: look, scan, turn to the most familiar heading, step."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from tussock.render.renderer import Renderer
from tussock.world.errors import InputError
from tussock.world.geometry import Pose, Route, columns_of_turn, wrap_angle

from .encoding import Encoding
from .models.base import FamiliarityModel, SequenceModel, SnapshotModel
from .scan import best_turn, scan_window
from .stopping import (
    ARRIVED,
    LOST,
    OUT_OF_STEPS,
    OUT_OF_WORLD,
    STUCK,
    Progress,
    Rules,
    check_distance,
    check_limits,
    check_noise,
)
from .threads import OneTorchThread

__all__ = ["ARRIVED", "LOST", "OUT_OF_STEPS", "OUT_OF_WORLD", "STUCK", "Agent", "Step"]


@dataclass(frozen=True, kw_only=True)
class Step:
    """One look around and what came of it.

    index: 0 for the first look. pose: where the agent stands and faces as it looks. view: what it sees, RGBA.
    familiarity: of every rotation, turned left by 0, 1, .. columns. aim: turn to the most familiar heading (rad, left positive).
    turn: the one it makes, which is the aim and noise.
    match: index of the learned view it recognised, None where the model keeps none.
    place: share of the learned sequence, 0 to 1, that the model believes to have walked; None where it does not know.
    deviation: distance from the route (m). along: how far along the route the nearest place is (m).
    error: how far the chosen heading is from the route's there (rad, -pi..pi).
    reason: None while the walk goes on, else why it ends. reset: why the agent was put back on the route before this look, or None.
    failure: why it fails here, whether the walk ends or the agent is put back after this look; None where it does not fail.
    """

    index: int
    pose: Pose
    view: UInt8[np.ndarray, "height width 4"]
    familiarity: Float[np.ndarray, " w"]
    aim: float
    turn: float
    match: int | None
    place: float | None
    deviation: float
    along: float
    error: float
    reason: str | None
    reset: str | None
    failure: str | None


@dataclass(frozen=True, kw_only=True)
class AgentSettings:
    """How an agent walks, and when a walk ends.

    step_length (m). scan: width of the scan (rad), about the present heading, or about the world direction `scan_about` (rad).
    heading_noise: standard deviation of the normal noise on every turn (rad), drawn from `seed`.
    arrive: the walk is done within this distance of the route's end (m); where the route ends as near to its start, once the
    agent has been farther away.
    lost: farther than this from the route is lost (m). patience: metres walked without getting farther along the route before
    the agent counts as stuck. max_steps: None takes as many as walk the route's length three times.
    reset_when_lost: instead of ending the walk, put a lost, stuck or straying agent back on the route at the waypoint after the
    furthest one reached, facing along it, as Ardin et al. (2016) count errors. waypoint_spacing (m).
    Raises InputError for what is no distance, angle or number of steps.
    """

    step_length: float = 0.05
    scan: float = np.pi
    scan_about: float | None = None
    heading_noise: float = 0.0
    arrive: float = 0.15
    lost: float = 0.5
    patience: float = 3.0
    max_steps: int | None = None
    reset_when_lost: bool = False
    seed: int = 0
    waypoint_spacing: float = 0.1

    def __post_init__(self):
        check_distance("waypoint_spacing", self.waypoint_spacing)
        check_limits(self)
        check_noise(self.heading_noise)
        scan_window(4, self.scan)  # refuses what is no angle
        if self.scan_about is not None and not np.isfinite(self.scan_about):
            raise InputError(
                f"a scan about {self.scan_about}; give a finite direction, or None for the present heading"
            )


@dataclass(frozen=True, kw_only=True)
class Agent(AgentSettings):
    """Follows a route by familiarity.

    How far along the route the agent is, is where the route is nearest: a route that crosses itself can be cut short there.
    """

    renderer: Renderer
    encoding: Encoding
    model: FamiliarityModel
    route: Route

    @cached_property
    def rules(self) -> Rules:
        """When its walks end."""
        return Rules(
            route=self.route, field=self.renderer.world.field, step_length=self.step_length, arrive=self.arrive, lost=self.lost,
            patience=self.patience, max_steps=self.max_steps,
        )  # fmt: skip

    @property
    def step_limit(self) -> int:
        """The number of steps after which the walk ends."""
        return self.rules.step_limit

    def start(self, offset: float = 0.0) -> Pose:
        """The route's first pose, moved `offset` metres to its left (negative: right)."""
        pose = self.route.start.moved(0.0, offset)
        self.rules.check_inside(pose)
        return pose

    def walk(self, start: Pose) -> Iterator[Step]:
        """Walk from `start` until arrival or failure, a `Step` at a time; the last one has a `reason`."""
        for (step,) in self.walk_many([start]):
            assert step is not None
            yield step

    def walk_many(self, starts: Sequence[Pose]) -> Iterator[list[Step | None]]:
        """Walk from each start, all side by side: at a time a list of one `Step` a start, None where that walk has ended.

        What they see is drawn, encoded and scanned together, which takes a fraction of the time. Walk k draws its noise from
        `seed` + k and takes the steps that it takes alone with that seed (but for rounding, where the model keeps no views).
        Until the last one ends, torch works on one thread.
        """
        for start in starts:
            self.rules.check_inside(start)
        walks = [_Walk(self, start, self.seed + k) for k, start in enumerate(starts)]
        with OneTorchThread():
            for index in range(self.step_limit + 1):
                going = [k for k, walk in enumerate(walks) if not walk.ended]
                if not going:
                    return
                steps: list[Step | None] = [None] * len(walks)
                for k, step in zip(going, self._steps(index, [walks[k] for k in going]), strict=True):
                    steps[k] = step
                yield steps

    def _steps(self, index: int, walks: "list[_Walk]") -> Iterator[Step]:
        """The next step of each of several walks."""
        poses = np.array([walk.pose for walk in walks])
        views = self.renderer.render(poses)
        features = self.encoding(views)
        width = features.shape[2]
        windows = self._windows(width, poses[:, 2])
        familiarity, match = self._scan(features, windows, walks)
        aims = best_turn(familiarity, windows)
        deviation, along = self.route.nearest(poses[:, :2])
        towards = self.route.at(along)[:, 2]
        columns = np.rint(columns_of_turn(aims, width)).astype(int) % width
        for k, walk in enumerate(walks):
            yield walk.step(
                index, views[k], familiarity[k], aim=float(aims[k]), match=None if match is None else int(match[k, columns[k]]),
                deviation=float(deviation[k]), along=float(along[k]), towards=float(towards[k]),
            )  # fmt: skip

    def _scan(
        self, features: torch.Tensor, windows: np.ndarray, walks: "list[_Walk]"
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Familiarity of every rotation of each view, and which learned view each resembles, if the model knows."""
        followings = [walk.following for walk in walks if walk.following is not None]
        if followings:
            looks = [each.look(view, window) for each, view, window in zip(followings, features, windows, strict=True)]
            familiarity, match = (torch.stack(each) for each in zip(*looks, strict=True))
        elif isinstance(self.model, SnapshotModel):
            familiarity, match = self.model.match(features)
        else:
            return self.model.scan(features).cpu().numpy(), None
        return familiarity.cpu().numpy(), match.cpu().numpy()

    def _windows(self, width: int, headings: Float[np.ndarray, " n"]) -> Bool[np.ndarray, "n w"]:
        """Which rotations agents that face `headings` look at."""
        if self.scan_about is None:
            return np.tile(scan_window(width, self.scan), (len(headings), 1))
        return np.stack([scan_window(width, self.scan, float(wrap_angle(self.scan_about - each))) for each in headings])

    def _waypoint_after(self, along: float) -> float:
        """Distance along the route of the first waypoint beyond `along`."""
        return min((np.floor(along / self.waypoint_spacing + 1e-9) + 1) * self.waypoint_spacing, self.route.length)


class _Walk:
    """Where one walk of an agent has come to."""

    def __init__(self, agent: Agent, start: Pose, seed: int):
        self.agent, self.pose = agent, start
        self.random = np.random.default_rng(seed)
        self.following = agent.model.follow() if isinstance(agent.model, SequenceModel) else None
        self.progress = Progress(agent.rules)
        self.reset: str | None = None
        self.ended = False

    def step(
        self, index: int, view: np.ndarray, familiarity: np.ndarray, *, aim: float, match: int | None, deviation: float, along: float,
        towards: float,
    ) -> Step:  # fmt: skip
        """The step that follows from a look, taken. towards: the route's heading here (rad)."""
        agent, pose = self.agent, self.pose
        turn = float(wrap_angle(aim + agent.heading_noise * self.random.standard_normal()))
        reason = self.progress.look(index, pose, deviation, along)
        recovering = agent.reset_when_lost and reason in (LOST, STUCK, OUT_OF_WORLD) and index < agent.step_limit
        step = Step(
            index=index, pose=pose, view=view, familiarity=familiarity, aim=aim, turn=turn, match=match,
            place=None if self.following is None else self.following.place,
            deviation=deviation, along=along, error=float(wrap_angle(pose.heading + turn - towards)),
            reset=self.reset, reason=None if recovering else reason, failure=None if reason == ARRIVED else reason,
        )  # fmt: skip
        if recovering:
            self.progress.put(agent._waypoint_after(self.progress.furthest))
            self.pose, self.reset = Pose(*agent.route.at(self.progress.furthest)[0].tolist()), reason
        elif reason:
            self.ended = True
        else:
            self.pose, self.reset = pose.turned(turn).moved(agent.step_length), None
            self.progress.step()
        return step
