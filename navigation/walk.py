"""The closed loop: look, decide, move, stop. The only place where an agent moves.

    walk = Walk(renderer=renderer, encoding=encoding, route=route, starts=[route.start])
    for (step,) in walk.steps(navigator):
        print(step.pose, step.deviation, step.reason)

The walk knows where its agents are, and so measures how far off the route they are; the navigator gets only what they perceive.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float32, UInt8

from tussock.render.images.source import DatabaseViews
from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Pose, Route, place_text, wrap_angle
from tussock.world.scene import World
from tussock.world.terrain import Terrain

from .body import Body
from .encoding import Encoding
from .steering.navigator import Images, Look, Motion, Navigator, check_motion
from .stop_check import StopCheck
from .stopping import StoppingRules, StopReason
from .threads import one_torch_thread

RECOVERABLE = (
    StopReason.LOST,
    StopReason.STUCK,
    StopReason.OUT_OF_WORLD,
    StopReason.OFF_GROUND,
    StopReason.TOO_STEEP,
    StopReason.OFF_GRID,
)  # from where an agent can be put back on the route


@dataclass(frozen=True, kw_only=True)
class Step:
    """One look of an agent, and what it did then.

    Attributes:
        index: 0 for the first look.
        pose: Where the agent stands and faces as it looks.
        height: Of the ground beneath it (m).
        view: (height, width, 4) What it sees, RGBA (RGB where it comes from images without alpha); None where it was not drawn.
        encoded: (h, w) The feature image that the navigator gets of it; None likewise.
        familiarity: (w,) Of every rotation, turned left by 0, 1, .. columns; None where the navigator does not scan.
        scanned: (w,) Which of these rotations the navigator compared; None likewise.
        aim: Turn that the navigator decided on (rad, left positive).
        turn: Turn that the body made: the aim and noise (rad), to a heading that is a multiple of 0.01 degrees.
        match: Index of the learned view that was recognised; None where the model keeps none.
        progress: Share of the learned sequence, 0 to 1, that the navigator believes to have walked; None where it does not know.
        view_distance: Distance from the entry of the image database whose view it sees (m); None in a world.
        deviation: Distance from the route (m).
        along: Distance along the route of the point nearest to the agent (m).
        error: Angle from the route's heading there to the agent's new heading (rad, -pi..pi).
        reason: Why the walk ends here; None while it goes on.
        reset: Why the agent was put back on the route before this look; None where it was not.
        failure: Why it fails here, whether the walk ends or the agent is put back after this look; None where it does not fail.
    """

    index: int
    pose: Pose
    height: float
    view: UInt8[np.ndarray, "height width channels"] | None
    encoded: Float32[torch.Tensor, "h w"] | None
    familiarity: Float32[np.ndarray, " w"] | None
    scanned: Bool[np.ndarray, " w"] | None
    aim: float
    turn: float
    match: int | None
    progress: float | None
    view_distance: float | None
    deviation: float
    along: float
    error: float
    reason: StopReason | None
    reset: StopReason | None
    failure: StopReason | None


class Walk:
    """Agents that follow one route side by side.

    What they see is drawn, encoded and compared together, which takes a fraction of the time; each takes the steps that it takes
    alone.
    """

    def __init__(
        self,
        *,
        renderer: Renderer,
        encoding: Encoding,
        route: Route,
        starts: Sequence[Pose],
        body: Body | Sequence[Body] | None = None,
        stopping: StoppingRules | Sequence[StoppingRules] | None = None,
        noise: int | Sequence[np.random.Generator] = 0,
    ):
        """Put agents at the start of a walk.

        Args:
            renderer: Draws what they see.
            encoding: What is kept of a view.
            route: The route that they are to follow.
            starts: Where each of them begins.
            body: How they move: all of them, or one for each.
            stopping: When their walks end: likewise.
            noise: What the noise on the turns is drawn from: a generator for each agent, or a seed (agent k takes seed + k).

        Raises:
            SettingError: For a start outside of the world, off its ground, or off the grid of an image database.
        """
        self.renderer, self.encoding, self.route = renderer, encoding.for_eye(renderer.eye), route
        self.world = renderer.world
        bodies = body if isinstance(body, Sequence) else [body or Body()] * len(starts)
        rules = stopping if isinstance(stopping, Sequence) else [stopping or StoppingRules()] * len(starts)
        generators = (
            [np.random.default_rng(noise + k) for k in range(len(starts))]
            if isinstance(noise, int | np.integer)
            else noise
        )
        each = zip(range(len(starts)), starts, bodies, rules, generators, strict=True)
        self.agents = [Walker(self, *of_agent) for of_agent in each]
        self.reach = renderer.reach if isinstance(renderer, DatabaseViews) else np.inf
        self._seen: tuple[UInt8[np.ndarray, "n height width channels"], Images] | None = None  # views, and as encoded
        self._measure(self.agents)
        if off := [agent.pose for agent in self.agents if agent.reason is StopReason.OFF_GRID]:
            raise SettingError(
                f"the image database has no view near the start ({off[0].x:g}, {off[0].y:g}) m; choose another start, or --offset-m"
            )

    @property
    def walking(self) -> list["Walker"]:
        """The agents whose walk goes on."""
        return [agent for agent in self.agents if not agent.ended]

    def steps(self, navigator: Navigator) -> Iterator[list[Step | None]]:
        """Walk until all have arrived or failed. Each time, a list with the `Step` of each agent, or None if its walk has ended."""
        memories = [navigator.begin() for _ in self.agents]
        while walking := self.walking:
            for agent in walking:
                memory = memories[agent.number]
                if agent.reset is not None and hasattr(memory, "resume"):  # it is told where it was put back
                    memory.resume(agent.along / self.route.length)
            look = self.look()
            with one_torch_thread():
                motion = navigator.decide(look, [memories[agent.number] for agent in walking])
            check_motion(motion, len(walking), navigator)
            yield self.move(motion)

    def look(self) -> Look:
        """What the agents whose walk goes on perceive."""
        poses = np.array([agent.pose for agent in self.walking])
        views = self.renderer.render(poses)
        known = self.renderer.known(poses) if isinstance(self.renderer, DatabaseViews) else None
        self._seen = views, self.encoding(views, known)
        return Look(views=self._seen[1], compass=poses[:, 2])

    def move(self, motion: Motion) -> list[Step | None]:
        """Let the agents whose walk goes on move, and measure where they come to; a row of the motion for each of them."""
        walking = self.walking
        steps: list[Step | None] = [None] * len(self.agents)
        for row, agent in enumerate(walking):
            seen = (None, None) if self._seen is None else (self._seen[0][row], self._seen[1][row])
            steps[agent.number] = agent.step(motion, row, *seen)
        self._seen = None
        self._measure([agent for agent in walking if not agent.ended])
        return steps

    def _measure(self, agents: Sequence["Walker"]) -> None:
        """Find where agents have come to, and whether their walks end there."""
        if agents:
            heights = self.world.ground_height(np.array([agent.pose[:2] for agent in agents]))
            for agent, height in zip(agents, heights.tolist(), strict=True):
                agent.tread(height)
            deviation, along = self.route.nearest(np.array([agent.pose[:2] for agent in agents]))
            headings = self.route.at(along)[:, 2]
            for agent, *measured in zip(agents, deviation.tolist(), along.tolist(), headings.tolist(), strict=True):
                if isinstance(self.renderer, DatabaseViews):
                    agent.view_distance = float(self.renderer.nearest([agent.pose])[1][0])
                agent.measure(*measured)


class Walker:
    """Where one agent of a walk is, and what it has done so far."""

    def __init__(
        self, walk: Walk, number: int, start: Pose, body: Body, stopping: StoppingRules, random: np.random.Generator
    ):
        check_inside(start, walk.world)
        self.walk, self.number, self.body, self.stopping, self.random = walk, number, body, stopping, random
        self.pose = Pose(start.x, start.y, float(wrap_angle(start.heading)))
        self.step_limit = stopping.step_limit(walk.route.length, body.step_length)
        self.stop_check = StopCheck(stopping, walk.route, walk.world.field, body.step_length)
        self.index, self.ended = 0, False
        self.reset: StopReason | None = None
        self.view_distance: float | None = None  # of the entry of an image database whose view it sees (m)
        self.trodden: tuple[Pose, float] | None = (
            None  # where it stood before its step, and how high; None after being put back
        )
        self.stopped: StopReason | None = None  # by the ground

    def tread(self, height: float) -> None:
        """Take in the height of the ground at its pose (m). It does not make a step that the ground does not allow."""
        terrain = self.walk.world.terrain
        self.stopped = None
        if terrain is not None and self.trodden is not None:
            before, height_before = self.trodden
            self.stopped = self._obstacle(terrain, before, height - height_before)
            if self.stopped is not None:
                self.pose, height = Pose(before.x, before.y, self.pose.heading), height_before
        self.height = height

    def _obstacle(self, terrain: Terrain, before: Pose, rise: float) -> StopReason | None:
        """Why the step from a pose to the present one, which rises by some metres, cannot be made; None where it can."""
        x, y, _ = self.pose
        if not self.walk.world.field.contains(x, y):
            return StopReason.OUT_OF_WORLD
        if np.isnan(rise):
            return StopReason.TOO_STEEP if terrain.is_steep(x, y) else StopReason.OFF_GROUND
        return StopReason.TOO_STEEP if terrain.is_too_steep(np.hypot(x - before.x, y - before.y), rise) else None

    def measure(self, deviation: float, along: float, route_heading: float) -> None:
        """Take in how far it is from the route (m) and along it (m), and the route's heading there (rad)."""
        self.deviation, self.along, self.route_heading = deviation, along, route_heading
        self.reason = self.stop_check.check(self.pose, deviation, along) or self.stopped
        if self.reason is not StopReason.ARRIVED and (self.view_distance or 0.0) > self.walk.reach:
            self.reason = StopReason.OFF_GRID
        if self.reason is None and self.index >= self.step_limit:
            self.reason = StopReason.OUT_OF_STEPS

    def step(self, motion: Motion, row: int, view: np.ndarray | None, encoded: torch.Tensor | None) -> Step:
        """Do as a row of a motion says."""
        stopping, body, pose, scan = self.stopping, self.body, self.pose, motion.scan
        aim, share = float(motion.turn[row]), 1.0 if motion.step is None else float(motion.step[row])
        noise = body.heading_noise * self.random.standard_normal() if body.heading_noise else 0.0
        facing = pose.turned(aim + noise).rounded()
        turn = float(wrap_angle(facing.heading - pose.heading))
        put_back = stopping.put_back and self.reason in RECOVERABLE and self.index < self.step_limit
        step = Step(
            index=self.index,
            pose=pose,
            height=self.height,
            view=view,
            encoded=encoded,
            familiarity=None if scan is None else scan.familiarity[row],
            scanned=None if scan is None else scan.window[row],
            aim=aim,
            turn=turn,
            match=None if scan is None or scan.match is None else int(scan.match[row]),
            progress=None if scan is None else scan.progress[row],
            view_distance=self.view_distance,
            deviation=self.deviation,
            along=self.along,
            error=float(wrap_angle(facing.heading - self.route_heading)),
            reason=None if put_back else self.reason,
            reset=self.reset,
            failure=None if self.reason is StopReason.ARRIVED else self.reason,
        )
        self.reset = self.reason if put_back else None
        self.ended = step.reason is not None
        self.trodden = None if put_back else (pose, self.height)
        if put_back:
            self.pose = self.stop_check.put_back()
        elif not self.ended:
            self.pose = facing.moved(share * body.step_length).rounded()
            self.stop_check.walked(share)
        self.index += 1
        return step


def check_inside(pose: Pose, world: World) -> None:
    """Refuse a start that is outside of the world, or off its ground. Raises SettingError."""
    if not np.isfinite(pose).all() or not world.field.contains(pose.x, pose.y):
        raise SettingError(
            f"the start {place_text(pose.x, pose.y)} is outside the world ({world.field}); choose another route or offset"
        )
    if world.terrain is not None and not world.stands(np.array([pose[:2]]))[0]:
        raise SettingError(
            f"a walk cannot start there: {world.terrain.problem(pose.x, pose.y)}; choose another route or offset"
        )
