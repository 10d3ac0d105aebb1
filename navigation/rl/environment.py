"""Following a route as a Gymnasium environment, `tussock/RouteFollowing-v0`, alone and many side by side.

Importing this module registers it. Gymnasium is an extra, which only this module needs.
"""

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from tussock.world.errors import SettingError

from .task import Courses, Episode, RouteTask

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ImportError("the environment needs Gymnasium; install it with: pip install 'gymnasium>=1.2'") from error

from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

ID = "tussock/RouteFollowing-v0"
ROUNDING = 1e-4  # encoded views may leave their bounds by this share of the greatest magnitude, which is 1 or more


class RouteFollowing(gymnasium.Env):
    """See a panorama, turn, step: follow a route home. One walk is an episode.

    Actions are (turn, step): the turn to the left as a share of half a turn, -1 to 1, and the step as a share of the longest, 0 to 1.
    A step earns the metres by which it takes the learner farther along the route (less than 0: back), and ARRIVAL_REWARD where it
    arrives.

    Args:
        render_mode: "rgb_array" or None.
        settings: Those of `RouteTask`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - Gymnasium reads it from the class

    def __init__(self, render_mode: str | None = None, **settings: Any):
        self.task = RouteTask(**settings)
        self.render_mode = _render_mode(render_mode)
        self.observation_space, self.action_space = _spaces(self.task)
        self._courses = Courses(self.task)
        self._episode = Episode(self._courses)

    def reset(self, *, seed: int | np.integer | None = None, options: dict[str, Any] | None = None):
        """Begin another episode; options: world and start, see `Episode.begin`."""
        super().reset(seed=_seed(seed))
        info = self._episode.begin(self.np_random, options)
        return self._look(), info

    def step(self, action: np.ndarray):
        """Turn, step and look."""
        reward, terminated, truncated, info = self._episode.step(action)
        return self._look(), reward, terminated, truncated, info

    def _look(self) -> np.ndarray:
        (observation,), (self._view,) = self._courses.observe([self._episode])
        return observation

    def training_views(self, **setup: Any):
        """Observations of the present route and the poses they were made at, to learn it from; see `Courses.training_views`."""
        return self._courses.training_views(self._episode.seed, **setup)

    def render(self) -> np.ndarray | None:
        """The present panorama, RGB, enlarged."""
        return None if self.render_mode is None else _frame(self._view)

    def close(self) -> None:
        """Free what the renderers hold."""
        self._courses.close()


class RouteFollowingVector(VectorEnv):
    """Many walks side by side, whose views are drawn in one call of the renderer, where they are in one world.

    It takes the steps that as many of `RouteFollowing` take in Gymnasium's `SyncVectorEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        render_mode: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ):
        if isinstance(num_envs, bool) or not isinstance(num_envs, Integral) or num_envs < 1:
            raise SettingError(f"{num_envs!r} environments; give a whole number from 1")
        self.task, self.num_envs = RouteTask(**settings), int(num_envs)
        self.render_mode, self._autoreset = _render_mode(render_mode), AutoresetMode(autoreset_mode)
        self.metadata = RouteFollowing.metadata | {"autoreset_mode": self._autoreset}
        self.single_observation_space, self.single_action_space = _spaces(self.task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._courses = Courses(self.task)
        self._episodes = [Episode(self._courses) for _ in range(num_envs)]
        self._randoms = [np_random()[0] for _ in range(num_envs)]
        self._observations = np.zeros(self.observation_space.shape or (), self.observation_space.dtype)
        self._views = np.zeros((num_envs, self.task.eye.height, self.task.eye.width, 4), np.uint8)
        self._ended = np.zeros(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | np.integer | Sequence[int | np.integer | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin other walks: all, or those where options["reset_mask"] says so. A seed s is s, s + 1, ... for the walks."""
        if isinstance(seed, Sequence):
            seeds = [_seed(each) for each in seed]
        else:
            first = _seed(seed)
            seeds = [None if first is None else first + k for k in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise SettingError(f"{len(seeds)} seeds for {self.num_envs} environments; give one for each")
        options = dict(options or {})
        rows = np.flatnonzero(self._mask(options.pop("reset_mask", np.ones(self.num_envs, bool))))
        infos: dict[str, Any] = {}
        for k in rows.tolist():
            if seeds[k] is not None:
                self._randoms[k] = np_random(seeds[k])[0]
            infos = self._add_info(infos, self._episodes[k].begin(self._randoms[k], options), k)
        self._ended[rows] = False
        self._look(rows)
        return self._observations.copy(), infos

    def step(self, actions: np.ndarray):
        """Turn, step and look, all of them; those that have ended begin another walk, as Gymnasium's autoreset modes have it."""
        begins = self._ended & (self._autoreset == AutoresetMode.NEXT_STEP)
        self._check(actions, np.flatnonzero(~begins))
        rewards, terminations, truncations = np.zeros(self.num_envs), *np.zeros((2, self.num_envs), bool)
        each: list[dict[str, Any]] = []
        for k, episode in enumerate(self._episodes):
            if begins[k]:
                each.append(episode.begin(self._randoms[k], None))
            else:
                rewards[k], terminations[k], truncations[k], info = episode.step(actions[k])
                each.append(info)
        self._look(np.arange(self.num_envs))
        self._ended = terminations | truncations
        infos: dict[str, Any] = {}
        if self._autoreset == AutoresetMode.SAME_STEP and self._ended.any():
            rows = np.flatnonzero(self._ended)
            for k in rows.tolist():
                final = {"final_obs": self._observations[k].copy(), "final_info": each[k]}
                infos = self._add_info(infos, final, k)
                each[k] = self._episodes[k].begin(self._randoms[k], None)
            self._look(rows)
        for k, info in enumerate(each):
            infos = self._add_info(infos, info, k)
        return self._observations.copy(), rewards, terminations, truncations, infos

    def _look(self, rows: np.ndarray) -> None:
        self._observations[rows], self._views[rows] = self._courses.observe([self._episodes[k] for k in rows])

    def _check(self, actions: np.ndarray, rows: np.ndarray) -> None:
        """Refuse actions before any of these walks has moved. Raises SettingError."""
        try:
            shape = np.shape(actions)
        except ValueError as error:
            raise SettingError(f"actions: {error}; give an array of shape {self.action_space.shape}") from error
        if shape != self.action_space.shape:
            raise SettingError(f"actions of shape {shape}; give {self.action_space.shape}")
        for k in rows.tolist():
            self._episodes[k].check(actions[k])

    def _mask(self, mask: np.ndarray) -> np.ndarray:
        if np.shape(mask) != (self.num_envs,) or np.asarray(mask).dtype != bool or not np.any(mask):
            raise SettingError(f"reset_mask {mask}; give {self.num_envs} booleans, at least one of them True")
        return mask

    def training_views(self, k: int = 0, **setup: Any):
        """Observations of the present route of walk `k`, and their poses; see `Courses.training_views`."""
        return self._courses.training_views(self._episodes[k].seed, **setup)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The present panoramas, RGB, enlarged."""
        return None if self.render_mode is None else tuple(map(_frame, self._views))

    def close_extras(self, **kwargs: Any) -> None:
        """Free what the renderers hold."""
        self._courses.close()


def _spaces(task: RouteTask) -> tuple[Box, Box]:
    """Of observations and actions."""
    eye = task.eye
    if task.chain is None:
        seen = Box(0, 255, (eye.height, eye.width, 3), np.uint8)
    else:
        shape, _, _ = task.chain.for_eye(eye).encoding.bounds(eye.height, eye.width)
        _, low, high = task.chain.bounds(eye.height, eye.width)
        if eye.masked or eye.compound is not None:  # 0 where nothing is seen
            low, high = min(low, 0.0), max(high, 0.0)
        margin = ROUNDING * max([1.0, *(abs(end) for end in (low, high) if np.isfinite(end))])
        seen = Box(low - margin, high + margin, shape, np.float32)
    return seen, Box(np.array([-1, 0], np.float32), np.array([1, 1], np.float32))


def _seed(seed: Any) -> int | None:
    """A seed as Gymnasium takes it, which takes only Python integers. Raises SettingError for other values."""
    if seed is None:
        return None
    if not isinstance(seed, Integral) or int(seed) < 0:
        raise SettingError(f"the seed is {seed!r}; give a whole number >= 0")
    return int(seed)


def _render_mode(mode: str | None) -> str | None:
    if mode not in (None, *RouteFollowing.metadata["render_modes"]):
        raise SettingError(f"render mode {mode!r}; give 'rgb_array' or None")
    return mode


def _frame(view: np.ndarray) -> np.ndarray:
    """A view (height, width, 4) as a picture (.., .., 3), at least 720 wide."""
    times = -(-720 // view.shape[1])
    return view[..., :3].repeat(times, axis=0).repeat(times, axis=1)


if ID not in gymnasium.registry:
    gymnasium.register(
        ID,
        entry_point="tussock.navigation.rl.environment:RouteFollowing",
        vector_entry_point="tussock.navigation.rl.environment:RouteFollowingVector",
    )
