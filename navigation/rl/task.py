"""Following a route as a task for a learner: the worlds and routes it is set, what it sees, what its steps earn, when it ends."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from tussock.render.eye import Eye
from tussock.render.renderer import Renderer, open_renderer
from tussock.world.errors import InputError
from tussock.world.files import open_world
from tussock.world.generate import seeded
from tussock.world.geometry import Pose, Route
from tussock.world.params import is_generated
from tussock.world.route_files import read_route
from tussock.world.routes import check_route, generate_route
from tussock.world.scene import World

from ..encoding import Encoding
from ..stopping import (
    ARRIVED,
    NUMBER,
    OUT_OF_STEPS,
    Progress,
    Rules,
    check_count,
    check_distance,
    check_limits,
    check_noise,
)
from ..training import training_poses, training_views

EYE = Eye(width=90, height=25)  # a pixel is 4 degrees wide and 3 high
ARRIVAL = 1.0  # m; what arriving earns on top of the way: who passes the goal to the side has come as far

# What settings may be, and how to say so.
KINDS = {
    "world": (str | os.PathLike | World, "a preset's name, a file or a World"),
    "route": (Route | str | os.PathLike | None, "a Route or its file"),
    "eye": (Eye, "an Eye"),
    "encoding": (Encoding | str | None, "its name or its steps"),
}

Observations = np.ndarray  # (n, height, width, 3) uint8, or (n, h, w) float32
Outcome = tuple[float, bool, bool, dict[str, Any]]  # reward, terminated, truncated, info


@dataclass(frozen=True)
class Course:
    """A world that is open to be seen, and the rules of following a route through it."""

    renderer: Renderer
    rules: Rules


@dataclass(frozen=True, kw_only=True)
class RouteTask:
    """Which routes are to be followed, and how.

    world: a preset's name, a file, or a world. world_seed: of the world and route, where they are generated.
    worlds: how many there are, of the seeds from `world_seed` on; each walk is set one of them at random.
    route: a route, or its file; None generates one of `length` (m). eye: through which the learner sees.
    encoding: of what it sees, a name or a chain (see `Encoding.named`); None leaves the panorama as it is.
    renderer: "auto", "cpu", "egl" or "osmesa". offset: walks start up to this far to either side of the route's start (m).
    heading_noise: standard deviation of the normal noise on every turn (rad), drawn from the walk's generator as an `Agent` draws it.
    step_length: of the longest step (m). arrive, lost, patience, max_steps: when a walk ends; as for an `Agent`.
    """

    world: str | os.PathLike | World = "tussock-field"
    world_seed: int = 0
    worlds: int = 1
    route: Route | str | os.PathLike | None = None
    length: float = 8.0
    eye: Eye = EYE
    encoding: Encoding | str | None = None
    renderer: str = "auto"
    offset: float = 0.1
    heading_noise: float = 0.0
    step_length: float = 0.05
    arrive: float = 0.15
    lost: float = 0.5
    patience: float = 3.0
    max_steps: int | None = None
    _courses: dict[int, Course] = dataclasses.field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self):
        for name, (kinds, wanted) in KINDS.items():
            if not isinstance(getattr(self, name), kinds):
                raise InputError(f"the {name} is {getattr(self, name)!r}; give {wanted}")
        check_count("worlds", self.worlds)
        seeded(self.world_seed)  # refuses what is no seed
        if self.worlds > 1 and not (isinstance(self.world, str) and is_generated(self.world) and self.route is None):
            raise InputError(f"{self.worlds} worlds are grown from a preset, with a route each; give one, and no route")
        check_limits(self)
        check_distance("length", self.length)
        if not (isinstance(self.offset, NUMBER) and 0 <= self.offset < self.lost):
            raise InputError(
                f"an offset of {self.offset} m; give 0 or more, and less than {self.lost} m, which is lost"
            )
        check_noise(self.heading_noise)
        _ = self.chain  # refuses what is no encoding

    @cached_property
    def chain(self) -> Encoding | None:
        """The encoding that was asked for."""
        return Encoding.named(self.encoding) if isinstance(self.encoding, str) else self.encoding

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_courses": {}}  # they are opened again where they are needed

    def course(self, seed: int) -> Course:
        """The world and route of a seed, which are opened when they are first asked for."""
        if seed not in self._courses:
            world = self.world if isinstance(self.world, World) else open_world(os.fspath(self.world), seed)
            route = self.route
            if route is None:
                route = generate_route(world, seed, self.length)
            elif not isinstance(route, Route):
                route = read_route(route)
            check_route(world, route)
            rules = Rules(
                route=route, field=world.field, step_length=self.step_length, arrive=self.arrive, lost=self.lost,
                patience=self.patience, max_steps=self.max_steps,
            )  # fmt: skip
            for side in (-1, 1):
                rules.check_inside(route.start.moved(0.0, side * self.offset))
            self._courses[seed] = Course(open_renderer(world, self.eye, self.renderer), rules)
        return self._courses[seed]

    def close(self) -> None:
        """Free what the renderers hold."""
        for course in self._courses.values():
            course.renderer.close()
        self._courses.clear()

    def encoded(self, views: UInt8[np.ndarray, "n height width 4"]) -> Observations:
        """What a learner gets to see of views."""
        return views[..., :3].copy() if self.chain is None else self.chain(views).numpy()

    def observe(self, walks: "Sequence[Walk]") -> tuple[Observations, UInt8[np.ndarray, "n height width 4"]]:
        """What walks see where they are, encoded and as it is. The renderer of each world is called once."""
        views = np.empty((len(walks), self.eye.height, self.eye.width, 4), np.uint8)
        for seed in {walk.seed for walk in walks}:
            here = [k for k, walk in enumerate(walks) if walk.seed == seed]
            views[here] = self.course(seed).renderer.render([walks[k].pose for k in here])
        return self.encoded(views), views

    def training_views(
        self, seed: int, *, learning_walk: float = 0.2, spacing: float = 0.04
    ) -> tuple[Observations, Float[np.ndarray, "n 3"]]:
        """What a learner is shown of the route of a seed before it walks, and at which poses; see `training_poses`.

        learning_walk: reach to both sides of the route (m); 0 shows it the route only. spacing: of the views along the route (m).
        Encoded views that show nothing are left out (see `navigation.training.training_views`).
        """
        course = self.course(seed)
        views_of = course.rules.route.resampled(spacing)
        poses = training_poses(views_of, learning_walk=learning_walk, field=course.rules.field)
        if self.chain is None:
            return self.encoded(course.renderer.render(poses)), poses
        views, kept = training_views(self.chain, course.renderer, poses)
        return views.numpy(), kept


class Walk:
    """One learner's way along a route."""

    def __init__(self, task: RouteTask):
        self.task, self.seed = task, task.world_seed
        self.reason: str | None = "not begun"

    def begin(self, random: np.random.Generator, options: Mapping[str, Any] | None) -> dict[str, Any]:
        """Set out, and return the info of the first look. What `options` leave open is drawn, and then the noise of the walk.

        options: world: the seed of one of the task's worlds. start: x (m), y (m), heading (rad).
        Raises InputError for others, and where the walk would be over before it has begun.
        """
        task, options = self.task, dict(options or {})
        seed, start = options.pop("world", None), options.pop("start", None)
        if options:
            raise InputError(f"unknown option {next(iter(options))!r}; known: world, start")
        seeds = range(task.world_seed, task.world_seed + task.worlds)
        if seed is None:
            seed = seeds[int(random.integers(len(seeds)))]
        elif not isinstance(seed, Integral) or seed not in seeds:
            raise InputError(f"world {seed!r}; give a seed from {seeds[0]} to {seeds[-1]}, or ask for more worlds")
        rules = task.course(int(seed)).rules
        if start is None:
            pose = rules.route.start.moved(0.0, random.uniform(-task.offset, task.offset))
        else:
            pose = Pose(*_numbers("start", start, 3, "x (m), y (m) and heading (rad)"))
        rules.check_inside(pose)
        self.seed, self.rules, self.pose, self.index, self.progress = int(seed), rules, pose, 0, Progress(rules)
        self.random = random
        info = self._look()
        if self.reason is not None:
            raise InputError(f"a walk that starts at {tuple(self.pose)} is {self.reason} at once; choose another start")
        return info

    def check(self, action: Any) -> tuple[float, float]:
        """The turn and step of an action. Raises InputError for what is none, and where the walk is over."""
        if self.reason is not None:
            raise InputError(f"this walk is {self.reason}; reset the environment to begin another one")
        wanted = "a turn from -1 to 1 and a step from 0 to 1"
        turn, share = _numbers("action", action, 2, wanted)
        if not (-1 <= turn <= 1 and 0 <= share <= 1):
            raise InputError(f"action {[turn, share]}; give {wanted}")
        return turn, share

    def step(self, action: Any) -> Outcome:
        """Turn and step: action (2,) is the turn to the left, as a share of half a turn, -1 to 1, and the step's, 0 to 1."""
        turn, share = self.check(action)
        turn *= np.pi
        if self.task.heading_noise:
            turn += self.task.heading_noise * self.random.standard_normal()
        self.pose = self.pose.turned(turn).moved(share * self.rules.step_length)
        self.progress.step(share)
        self.index += 1
        before = self.along
        info = self._look()
        reward = self.along - before + ARRIVAL * info["is_success"]
        return reward, self.reason not in (None, OUT_OF_STEPS), self.reason == OUT_OF_STEPS, info

    def _look(self) -> dict[str, Any]:
        """Find out where it has come to."""
        (deviation,), (along,) = self.rules.route.nearest(np.array([self.pose[:2]]))
        self.along = float(along)
        self.reason = self.progress.look(self.index, self.pose, float(deviation), self.along)
        return {
            "pose": np.array(self.pose), "deviation_m": float(deviation), "along_m": self.along, "world": self.seed,
            "reason": self.reason, "is_success": self.reason == ARRIVED,
        }  # fmt: skip


def _numbers(what: str, given: Any, count: int, wanted: str) -> list[float]:
    """What is given, as so many numbers. Raises InputError."""
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what}: {error}; give {wanted}") from error
    if values.shape != (count,):
        raise InputError(f"{what} {values.tolist()}; give {wanted}")
    return values.tolist()
