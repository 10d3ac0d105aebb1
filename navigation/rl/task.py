"""Following a route as a task for a learner: what it sees, what its steps earn, and when an episode ends."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from tussock.render.eye import Eye
from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Pose, Route
from tussock.world.params import is_generated
from tussock.world.scene import World
from tussock.world.settings import choice, instance_of, number, settings, whole

from ..body import Body
from ..encoding import Encoding
from ..experiment import Experiment
from ..steering.navigator import Motion
from ..stopping import StoppingRules, StopReason
from ..surroundings import GROUNDS, Surroundings
from ..training import poses_of_setup, training_views
from ..training_setup import TrainingSetup
from ..walk import Walk
from ..walker import check_inside

SURROUNDINGS, BODY, RULES = Surroundings(), Body(), StoppingRules()  # whose defaults are those of a task
ARRIVAL_REWARD = 1.0  # on top of the metres: a learner that passes the goal to the side has come as far

Observations = np.ndarray  # (n, height, width, 3) uint8, or (n, h, w) float32
Outcome = tuple[float, bool, bool, dict[str, Any]]  # reward, terminated, truncated, info


@dataclass(frozen=True)
class Course:
    """A route in an open world.

    Attributes:
        renderer: Draws what is seen there.
        route: The route to follow.
    """

    renderer: Renderer
    route: Route


@settings
class RouteTask:
    """Which routes are to be followed, and how.

    Attributes:
        world: A preset's name, a file, or a `World`.
        world_seed: Of the world and the route, where they are generated.
        ground: "flat": the learner moves at z = 0. "mesh": it stands on the surface of the world's mesh beneath it.
        worlds: How many worlds there are, of the seeds from `world_seed` on; each episode is in one of them, at random.
        route: A `Route`, its file, or None to generate one.
        length: Of a generated route (m).
        eye: Through which the learner sees.
        encoding: What it gets of a view: a preset's name, a chain or an `Encoding`; None is the panorama itself.
        renderer: "auto", "cpu", "cuda", "egl" or "osmesa".
        offset: Episodes start up to this far to either side of the route's start (m).
        heading_noise: Standard deviation of the normal noise on every turn (rad).
        step_length: Length of the longest step (m).
        arrive: The episode has arrived within this distance of the route's end (m).
        lost: It is lost farther than this from the route (m).
        patience: It is stuck after this distance without getting farther along the route (m).
        max_steps: Limit of steps; None means as many as three times the route's length needs.
    """

    world: Any = instance_of(str | os.PathLike | World, SURROUNDINGS.world, "a preset's name, a file or a World")
    world_seed: int = whole(0, low=0)
    ground: str = choice(SURROUNDINGS.ground, GROUNDS)
    worlds: int = whole(1)
    route: Any = instance_of(Route | str | os.PathLike | None, None, "a Route or its file")
    length: float = number(SURROUNDINGS.route_length, low=0.1, unit="m")
    eye: Eye = instance_of(Eye, Eye(width=90, height=25), "an Eye")  # a pixel is 4 degrees wide and 3 high
    encoding: Any = instance_of(Encoding | str | None, None, "its name or its steps")
    renderer: str = SURROUNDINGS.renderer
    offset: float = number(0.1, low=0, unit="m")
    heading_noise: float = number(BODY.heading_noise, low=0, unit="rad")
    step_length: float = number(BODY.step_length, above=0, unit="m")
    arrive: float = number(RULES.arrival_radius, above=0, unit="m")
    lost: float = number(RULES.max_deviation, above=0, unit="m")
    patience: float = number(RULES.patience, above=0, unit="m")
    max_steps: int | None = whole(RULES.max_steps, optional=True)

    def __attrs_post_init__(self):
        generated = isinstance(self.world, str) and is_generated(self.world) and self.route is None
        if self.worlds > 1 and not generated:
            raise SettingError(
                f"{self.worlds} worlds are generated from a preset, with a route each; give one, and no route"
            )
        if self.offset >= self.lost:
            raise SettingError(f"an offset of {self.offset} m; give less than {self.lost} m, which is lost")
        _ = self.experiment, self.chain  # refuses what they refuse
        if self.eye.compound is not None and self.chain is None:
            raise SettingError("what the ommatidia of an eye see is an encoding; give one, such as grey")

    @cached_property
    def experiment(self) -> Experiment:
        """The experiment that an episode is a walk of, in the first world."""
        return Experiment(
            world=self.world,
            ground=self.ground,
            route=self.route,
            route_length=self.length,
            eye=self.eye,
            body=Body(step_length=self.step_length, heading_noise=self.heading_noise),
            stopping=StoppingRules(
                arrival_radius=self.arrive, max_deviation=self.lost, patience=self.patience, max_steps=self.max_steps
            ),
            seed=self.world_seed,
            renderer=self.renderer,
        )

    @cached_property
    def chain(self) -> Encoding | None:
        """The encoding that is asked for."""
        return Encoding.named(self.encoding) if isinstance(self.encoding, str) else self.encoding

    def encoded(self, views: UInt8[np.ndarray, "n height width 4"]) -> Observations:
        """What a learner gets of views."""
        if self.chain is None:
            return self.eye.hide(views)[..., :3].copy()
        return self.chain.for_eye(self.eye).seen(views).numpy()


class Courses:
    """The worlds and routes of a task, each opened when it is first needed."""

    def __init__(self, task: RouteTask):
        self.task = task
        self._open: dict[int, Course] = {}

    def __getitem__(self, seed: int) -> Course:
        """The course of a seed."""
        if seed not in self._open:
            experiment = self.task.experiment.replace(seed=seed)
            world, route = experiment.open_world_and_route()
            for side in (-1, 1):
                check_inside(route.start.moved(0.0, side * self.task.offset), world)
            self._open[seed] = Course(experiment.open_renderer(world), route)
        return self._open[seed]

    def close(self) -> None:
        """Free what the renderers hold."""
        for course in self._open.values():
            course.renderer.close()
        self._open.clear()

    def __reduce__(self):
        """Sent to another process, they are opened anew there."""
        return Courses, (self.task,)

    def observe(self, episodes: "Sequence[Episode]") -> tuple[Observations, UInt8[np.ndarray, "n height width 4"]]:
        """What is seen in episodes, encoded and as it is. The renderer of each world is called once."""
        eye = self.task.eye
        views = np.empty((len(episodes), eye.height, eye.width, 4), np.uint8)
        for seed in {episode.seed for episode in episodes}:
            here = [k for k, episode in enumerate(episodes) if episode.seed == seed]
            views[here] = self[seed].renderer.render([episodes[k].pose for k in here])
        return self.task.encoded(views), eye.hide(views)

    def training_views(self, seed: int, **setup: Any) -> tuple[Observations, Float[np.ndarray, "n 3"]]:
        """What a learner is shown of the route of a seed before it walks, and the poses of these views.

        Args:
            seed: Of the world.
            setup: Fields of a `TrainingSetup`, such as `spacing` (m) or `learning_walk` (m).

        Encoded views without contrast are left out (see `tussock.navigation.training.training_views`).
        """
        course, given = self[seed], TrainingSetup(**setup)
        poses = poses_of_setup(given, course.route, course.renderer.world.field)
        poses = poses[course.renderer.world.stands(poses[:, :2])]
        if self.task.chain is None:
            return self.task.encoded(course.renderer.render(poses)), poses
        views, kept = training_views(self.task.chain, course.renderer, poses)
        mask = self.task.chain.for_eye(self.task.eye).mask
        return (views if mask is None else mask.images(views)).numpy(), kept


class Episode:
    """One walk of a learner along a route."""

    def __init__(self, courses: Courses):
        self.courses, self.task = courses, courses.task
        self.seed, self._walk = self.task.world_seed, None

    @property
    def pose(self) -> Pose:
        """Where the learner is."""
        assert self._walk is not None
        return self._walk.agents[0].pose

    def begin(self, random: np.random.Generator, options: Mapping[str, Any] | None) -> dict[str, Any]:
        """Start an episode, and return its info. What `options` leave open is drawn first, and then the noise of the walk.

        Args:
            random: What is drawn from.
            options: world: the seed of one of the task's worlds; start: x (m), y (m), heading (rad).

        Raises:
            SettingError: For other options, and where the walk would be over before it has begun.
        """
        task, options = self.task, dict(options or {})
        seed, start = options.pop("world", None), options.pop("start", None)
        if options:
            raise SettingError(f"unknown option {next(iter(options))!r}; known: world, start")
        seeds = range(task.world_seed, task.world_seed + task.worlds)
        if seed is None:
            seed = seeds[int(random.integers(len(seeds)))]
        elif not isinstance(seed, Integral) or seed not in seeds:
            raise SettingError(f"world {seed!r}; give a seed from {seeds[0]} to {seeds[-1]}, or ask for more worlds")
        course = self.courses[int(seed)]
        if start is None:
            pose = course.route.start.moved(0.0, random.uniform(-task.offset, task.offset))
        else:
            pose = Pose(*as_numbers("start", start, 3, "x (m), y (m) and heading (rad)"))
        walk = Walk(
            renderer=course.renderer,
            encoding=task.experiment.encoding,
            route=course.route,
            starts=[pose],
            body=task.experiment.body,
            stopping=task.experiment.stopping,
            noise=[random],
        )
        if (reason := walk.agents[0].reason) is not None:
            raise SettingError(f"a walk that starts at {tuple(pose)} is {reason} at once; choose another start")
        self.seed, self._walk = int(seed), walk
        return self._info()

    def check(self, action: Any) -> tuple[float, float]:
        """The turn and step of an action. Raises SettingError for an invalid one, and where the episode is over."""
        reason = "not begun" if self._walk is None else self._walk.agents[0].reason
        if reason is not None:
            raise SettingError(f"this walk is {reason}; reset the environment to begin another one")
        wanted = "a turn from -1 to 1 and a step from 0 to 1"
        turn, share = as_numbers("action", action, 2, wanted)
        if not (-1 <= turn <= 1 and 0 <= share <= 1):
            raise SettingError(f"action {[turn, share]}; give {wanted}")
        return turn, share

    def step(self, action: Any) -> Outcome:
        """Turn and step.

        Args:
            action: (2,) The turn to the left as a share of half a turn, -1 to 1, and the step as a share of the longest, 0 to 1.
        """
        turn, share = self.check(action)
        assert self._walk is not None
        agent = self._walk.agents[0]
        before = agent.along
        self._walk.move(Motion(turn=np.array([turn * np.pi]), step=np.array([share])))
        reward = agent.along - before + ARRIVAL_REWARD * (agent.reason is StopReason.ARRIVED)
        out_of_steps = agent.reason is StopReason.OUT_OF_STEPS
        return reward, agent.reason is not None and not out_of_steps, out_of_steps, self._info()

    def _info(self) -> dict[str, Any]:
        assert self._walk is not None
        agent = self._walk.agents[0]
        return {
            "pose": np.array(agent.pose),
            "deviation_m": agent.deviation,
            "along_m": agent.along,
            "world": self.seed,
            "reason": agent.reason and agent.reason.value,
            "is_success": agent.reason is StopReason.ARRIVED,
        }


def as_numbers(name: str, given: Any, count: int, wanted: str) -> list[float]:
    """What is given, as `count` finite numbers. Raises SettingError."""
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SettingError(f"{name}: {error}; give {wanted}") from error
    if values.shape != (count,) or not np.isfinite(values).all():
        raise SettingError(f"{name} {values.tolist()}; give {wanted}")
    return values.tolist()
