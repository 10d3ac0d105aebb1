"""The closed loop: look, decide, move, stop. The only place where an agent moves.

    walk = Walk(renderer=renderer, encoding=encoding, route=route, starts=[route.start])
    for (step,) in walk.steps(navigator):
        print(step.pose, step.deviation, step.reason)

The walk knows where its agents are, and so measures how far off the route they are; the navigator gets only what they perceive.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from tussock.render.changed_views import at_step
from tussock.render.images.source import DatabaseViews
from tussock.render.renderer import Renderer
from tussock.render.tilted_eye import TiltedEye
from tussock.world.collisions import slid, stopped
from tussock.world.errors import SettingError
from tussock.world.geometry import Pose, Route

from .body import Body
from .displacement import Displacement
from .encoding import Encoding
from .sense_models import Senses
from .steering.navigator import Images, Look, Motion, Navigator, PathIntegrating, check_motion, tell_put_back
from .stopping import StoppingRules, StopReason
from .threads import one_torch_thread
from .walker import Step, Walker


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
        displacement: Displacement | Sequence[Displacement] | None = None,
        senses: Senses | Sequence[Senses] | None = None,
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
            displacement: Where they are carried to the side: likewise.
            senses: How well they measure their heading and the distance that they walk: likewise.
            noise: What the noise on the turns is drawn from: a generator for each agent, or a seed (agent k takes seed + k).

        Raises:
            SettingError: For a start outside of the world, off its ground, or off the grid of an image database.
        """
        self.renderer, self.encoding, self.route = renderer, encoding.for_eye(renderer.eye), route
        self.world = renderer.world
        count = len(starts)
        bodies, rules = _each(body or Body(), count), _each(stopping or StoppingRules(), count)
        carried, measuring = _each(displacement or Displacement(), count), _each(senses or Senses(), count)
        generators = (
            [np.random.default_rng(noise + k) for k in range(count)] if isinstance(noise, int | np.integer) else noise
        )
        each = zip(range(count), starts, bodies, rules, carried, measuring, generators, strict=True)
        self.agents = [Walker(self, *of_agent) for of_agent in each]
        self.reach = renderer.reach if isinstance(renderer, DatabaseViews) else np.inf
        self._seen: tuple[UInt8[np.ndarray, "n height width channels"], Images] | None = None  # views, and as encoded
        self._measure(self.agents)
        if off := [agent.pose for agent in self.agents if agent.reason is StopReason.OFF_GRID]:
            raise SettingError(
                f"the image database has no view near the start ({off[0].x:g}, {off[0].y:g}) m; choose another start, or --offset-m"
            )

    @property
    def walking(self) -> list[Walker]:
        """The agents whose walk goes on."""
        return [agent for agent in self.agents if not agent.ended]

    def steps(self, navigator: Navigator) -> Iterator[list[Step | None]]:
        """Walk until all have arrived or failed. Each time, a list with the `Step` of each agent, or None if its walk has ended."""
        memories = [navigator.begin() for _ in self.agents]
        if isinstance(navigator, PathIntegrating):
            for agent, memory in zip(self.agents, memories, strict=True):
                navigator.travel(memory, agent.way_out())
        while walking := self.walking:
            for agent in walking:
                memory = memories[agent.number]
                if agent.reset is not None:
                    tell_put_back(memory, agent.along / self.route.length)
            look = self.look()
            with one_torch_thread():
                motion = navigator.decide(look, [memories[agent.number] for agent in walking])
            check_motion(motion, len(walking), navigator)
            yield self.move(motion)

    def look(self) -> Look:
        """What the agents whose walk goes on perceive."""
        walking = self.walking
        poses = np.array([agent.pose for agent in walking])
        renderer = at_step(self.renderer, walking[0].index)
        if isinstance(renderer, TiltedEye):
            poses = renderer.full_poses(poses)
            for agent, (pitch, roll) in zip(walking, poses[:, 4:].tolist(), strict=True):
                agent.tilt = pitch, roll
        views = renderer.render(poses)
        known = self.renderer.known(poses) if isinstance(self.renderer, DatabaseViews) else None
        self._seen = views, self.encoding(views, known)
        compass, odometry = np.array([agent.sense() for agent in walking]).T
        return Look(
            views=self._seen[1],
            compass=compass,
            odometry=odometry,
            touch=np.array([agent.touched for agent in walking]),
        )

    def move(self, motion: Motion) -> list[Step | None]:
        """Let the agents whose walk goes on move, and measure where they come to; a row of the motion for each of them."""
        walking = self.walking
        steps: list[Step | None] = [None] * len(self.agents)
        for row, agent in enumerate(walking):
            seen = (None, None) if self._seen is None else (self._seen[0][row], self._seen[1][row])
            steps[agent.number] = agent.step(motion, row, *seen)
        self._seen = None
        self._collide([agent for agent in walking if agent.walked and agent.body.collisions != "pass"])
        self._measure([agent for agent in walking if not agent.ended])
        return steps

    def _measure(self, agents: Sequence[Walker]) -> None:
        """Find where agents have come to, and whether their walks end there."""
        if agents:
            heights = self.world.ground_height(np.array([agent.pose[:2] for agent in agents]))
            for agent, height in zip(agents, heights.tolist(), strict=True):
                agent.stand_on(height)
            deviation, along = self.route.nearest(np.array([agent.pose[:2] for agent in agents]))
            nearest = [Pose(*pose) for pose in self.route.at(along).tolist()]
            for agent, far, distance, pose in zip(agents, deviation.tolist(), along.tolist(), nearest, strict=True):
                if isinstance(self.renderer, DatabaseViews):
                    agent.view_distance = float(self.renderer.nearest([agent.pose])[1][0])
                agent.measure(far, distance, pose)
            self._measure([agent for agent in agents if agent.carry()])

    def _collide(self, agents: Sequence[Walker]) -> None:
        """Let obstacles stop the steps that agents have just made, or turn them aside."""
        for collisions, move in (("stop", stopped), ("slide", slid)):
            those = [agent for agent in agents if agent.body.collisions == collisions]
            if not those:
                continue
            starts, ends = (
                np.array([pose[:2] for pose in poses]) for poses in zip(*map(_last_step, those), strict=True)
            )
            contact = move(self.world, starts, ends, np.array([agent.body.radius for agent in those]))
            for agent, (x, y), touched in zip(those, contact.positions.tolist(), contact.touched.tolist(), strict=True):
                if touched:
                    agent.block(x, y)


def _last_step(agent: Walker) -> tuple[Pose, Pose]:
    """Where an agent stood before its step, and where it stands now."""
    assert agent.before_step is not None
    return agent.before_step[0], agent.pose


def _each(setting: Any, count: int) -> Sequence[Any]:
    """A setting of each of some agents, from one that all share or from those of each."""
    return setting if isinstance(setting, Sequence) else [setting] * count
