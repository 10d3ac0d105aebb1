"""The Gymnasium environment: Gymnasium's checks, the same walks as an agent's, and the same alone and side by side."""

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import example, given
from hypothesis import settings as of_hypothesis
from hypothesis import strategies as some
from scenes import random_world

from tussock.navigation.agent import Agent
from tussock.navigation.encoding import Encoding
from tussock.navigation.encoding_steps import Grey, VerticalEdges
from tussock.navigation.experiment import Experiment
from tussock.navigation.models import PerfectMemory
from tussock.navigation.rl.environment import ID, RouteFollowing, RouteFollowingVector
from tussock.navigation.rl.task import ARRIVAL_REWARD, Courses, RouteTask
from tussock.navigation.scan import best_turn, scan_window
from tussock.navigation.stopping import StopReason
from tussock.navigation.training import train, training_poses
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError
from tussock.world.files import write_world
from tussock.world.geometry import Bounds, Route
from tussock.world.route_files import write_route
from tussock.world.routes import generate_route
from tussock.world.scene import World

SMALL = Eye(width=24, height=6)
WORLD = World.generate("tiny", 2)
STRAIGHT = Route.through(np.column_stack([np.linspace(0.5, 2.5, 51), np.full(51, 1.5)]))
AHEAD, LEFT, STAY = (0.0, 1.0), (0.5, 1.0), (0.0, 0.0)


@pytest.fixture
def make_env():
    """A function that makes environments, which are closed after the test."""
    opened = []

    def make(kind=RouteFollowing, *args, **settings):
        opened.append(kind(*args, **({"world": WORLD, "eye": SMALL} | settings)))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


@pytest.mark.parametrize("encoding", [None, "edges", "grey | scale 0.5 | invert | resize 2"])
def test_gymnasium_finds_nothing_wrong(encoding):
    env = gymnasium.make(ID, world="tiny", eye=SMALL, encoding=encoding, render_mode="rgb_array")
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("encoding", [None, "edges"])
def test_the_registered_name_makes_the_environment(encoding):
    env = gymnasium.make(f"tussock.navigation.rl.environment:{ID}", world="tiny", eye=SMALL, encoding=encoding)
    assert isinstance(env.unwrapped, RouteFollowing)
    env.close()
    many = gymnasium.make_vec(ID, num_envs=3, world="tiny", eye=SMALL, encoding=encoding)
    assert isinstance(many, RouteFollowingVector)
    observations, _ = many.reset(seed=0)
    assert observations in many.observation_space
    assert many.single_observation_space == env.observation_space
    many.close()


def test_only_the_environment_needs_gymnasium():
    code = "import sys; sys.modules['gymnasium'] = None; from tussock import Agent; print('imported'); "
    code += "import tussock.navigation.rl.environment"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "imported\n"
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ImportError")
    assert "pip install 'gymnasium" in last


def test_a_familiarity_model_walks_here_as_its_agent_does(make_env):
    eye, encoding, route = Eye(width=120, height=20), Encoding.named("edges"), generate_route(WORLD, 2)
    env = make_env(route=route, eye=eye, encoding=encoding)
    start = route.start.moved(0.0, 0.1)
    observation, info = env.reset(options={"start": start})
    views, poses = env.training_views(learning_walk=0.2)
    model = PerfectMemory().fit(torch.from_numpy(views))
    with open_renderer(WORLD, eye) as renderer:
        learned = training_poses(route, 0.04, learning_walk=0.2, field=WORLD.field)
        trained = train(PerfectMemory(), encoding, renderer, learned)
        assert np.array_equal(trained.poses, poses)
        steps = list(Agent(renderer=renderer, trained=trained, route=route).walk(start))
    assert len(steps) > 20
    for step in steps:
        assert np.array_equal(encoding(step.view[None])[0].numpy(), observation)
        # A turn is given as a share of half a turn, which rounds it.
        assert np.allclose(info["pose"], step.pose, rtol=0, atol=1e-12)
        assert np.allclose([info["deviation_m"], info["along_m"]], [step.deviation, step.along], rtol=0, atol=1e-12)
        assert info["reason"] == step.reason
        if step.reason is None:
            familiarity = model.scan(torch.from_numpy(observation)[None]).numpy()
            turn = best_turn(familiarity, scan_window(eye.width, np.pi))[0]
            observation, _, terminated, truncated, info = env.step(np.array([turn / np.pi, 1.0]))
    assert terminated
    assert not truncated
    assert info["is_success"]


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("settings", [{}, {"encoding": "edges", "world": "tiny", "worlds": 2, "heading_noise": 0.3}])
def test_side_by_side_they_walk_as_alone(make_env, mode, settings):
    """Equal, to the last bit, to Gymnasium's own vector environment, which steps one after the other."""
    settings = {"lost": 0.15, "max_steps": 9} | settings
    many = make_env(RouteFollowingVector, 4, autoreset_mode=mode, **settings)
    alone = SyncVectorEnv([lambda: make_env(**settings)] * 4, autoreset_mode=mode)
    assert many.metadata == alone.metadata
    assert many.observation_space == alone.observation_space
    assert many.action_space == alone.action_space

    def reset(**how):  # Gymnasium's environment removes reset_mask from the options
        assert data_equivalence(many.reset(**copy.deepcopy(how)), alone.reset(**how), exact=True)

    reset(seed=5)
    many.action_space.seed(0)
    endings = set()
    for _ in range(40):
        actions = many.action_space.sample()
        results = many.step(actions)
        assert data_equivalence(results, alone.step(actions), exact=True)
        _, _, terminations, truncations, infos = results
        ended = terminations | truncations
        endings.update(infos.get("final_info", infos)["reason"][ended])
        if mode == AutoresetMode.DISABLED and ended.any():
            reset(seed=[7, None, 8, None], options={"reset_mask": ended})
        elif ended.any() and len(endings) == 1:
            reset()
    assert endings == {StopReason.LOST, StopReason.OUT_OF_STEPS}
    reset(seed=[3, 1, None, 3])


def test_the_views_of_one_world_are_drawn_in_one_call(make_env):
    many = make_env(RouteFollowingVector, 5)
    many.reset(seed=1)
    renderer = many._courses[0].renderer
    drawn, render = [], renderer.render
    renderer.render = lambda poses: drawn.append(len(poses)) or render(poses)
    many.step(np.tile(AHEAD, (5, 1)))
    assert drawn == [5]


def test_the_same_seed_is_the_same_walk_and_another_is_not(make_env):
    def seen(seed):
        env = make_env(world="tiny", worlds=4)
        env.action_space.seed(1)
        first, info = env.reset(seed=seed)
        looks = [first.tobytes(), *(env.step(env.action_space.sample())[0].tobytes() for _ in range(5))]
        return looks, [info["world"], *(env.reset()[1]["world"] for _ in range(12))]

    assert seen(3) == seen(3)
    assert seen(3)[0] != seen(4)[0]
    assert set(seen(3)[1]) == {0, 1, 2, 3}


def test_episodes_start_on_both_sides_of_the_start_of_the_route(make_env):
    env = make_env(route=STRAIGHT, offset=0.2)
    starts = np.array([env.reset(seed=seed)[1]["pose"] for seed in range(30)]) - STRAIGHT.poses[0]
    assert np.array_equal(starts[:, [0, 2]], np.zeros((30, 2)))
    assert -0.2 <= starts[:, 1].min() < -0.1
    assert 0.1 < starts[:, 1].max() <= 0.2


SOURCES = ["grey", "foreground-mask"]
FILTERS = [
    *("blur 0.7", "resize 2", "resize 1.5", "sample 2", "widen 3", "scale 0.5", "scale 0.00001"),
    *("invert", "clahe 2 4", "vertical-edges", "normalise"),
]
DOT = np.eye(32).reshape(32, 4, 8, 1).repeat(4, axis=3) * 255  # one white pixel, at every position


@some.composite
def chains(draw) -> str:
    """Any chain of steps that fits together."""
    chain = [draw(some.sampled_from(SOURCES))]
    for step in draw(some.lists(some.sampled_from(FILTERS), max_size=5)):
        unit_range = "normalise" not in chain or step.split()[0] not in ("invert", "clahe")
        tiled = not step.startswith("clahe") or not any(each.startswith(("resize", "sample")) for each in chain)
        chain += [step] * (unit_range and tiled)
    return " | ".join(chain)


@given(encoding=some.none() | chains(), seed=some.integers(0, 50))
@of_hypothesis(max_examples=30)
@example(encoding="grey | scale 0.5 | invert", seed=0)
def test_observations_are_in_the_space_of_observations(encoding, seed):
    route = Route.through(np.array([[-2.0, 0.0], [2.0, 0.5]]))
    env = RouteFollowing(world=random_world(seed), route=route, eye=SMALL, encoding=encoding)
    observation, _ = env.reset(seed=seed)
    env.action_space.seed(seed)
    for _ in range(3):
        assert observation in env.observation_space
        observation = env.step(env.action_space.sample())[0]
    env.close()


@given(views=some.sampled_from([np.zeros((1, 4, 8, 4)), np.full((1, 4, 8, 4), 255), DOT, 255 - DOT]), encoding=chains())
@example(views=DOT, encoding="grey | normalise | vertical-edges")
@example(views=DOT, encoding="grey | scale 0.5 | invert")
@example(views=255 - DOT, encoding="grey | scale 0.00001 | invert | normalise")
def test_the_encoded_views_of_any_scene_are_in_the_space(views, encoding):
    env = RouteFollowing(world=WORLD, eye=Eye(width=8, height=4), encoding=encoding)
    for observation in env.task.encoded(views.astype(np.uint8)):
        assert observation in env.observation_space


class Double:
    """An encoding step from outside, which has no bounds."""

    name = "double"

    def __call__(self, images):
        return 2 * images


def test_the_space_of_a_step_without_bounds_is_open(make_env):
    steps = Grey(), Double()
    for encoding, low in ((Encoding(steps), -np.inf), (Encoding((*steps, VerticalEdges())), -1e-4)):
        env = make_env(encoding=encoding)
        assert np.allclose(env.observation_space.low, low)
        assert np.isinf(env.observation_space.high).all()
        assert env.reset(seed=0)[0] in env.observation_space


@pytest.mark.parametrize(
    "chain",
    [
        *("grey", "grey | scale 0.5 | invert", "grey | normalise", "grey | vertical-edges"),
        *("grey | resize 2 | normalise", "grey | normalise | scale 0.5"),
    ],
)
def test_the_bounds_of_an_encoding_are_reached_and_the_space_is_hardly_wider(chain):
    encoding = Encoding.parse(chain)
    images = encoding(np.concatenate([DOT, 255 - DOT]).astype(np.uint8))
    _, low, high = encoding.bounds(4, 8)
    assert np.allclose([images.min(), images.max()], [low, high], rtol=1e-5)
    space = RouteFollowing(world=WORLD, eye=Eye(width=8, height=4), encoding=chain).observation_space
    assert np.allclose([space.low.min(), space.high.max()], [low, high], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    ("action", "settings", "reason", "steps"),
    [
        (AHEAD, {}, StopReason.ARRIVED, 37),
        (LEFT, {"step_length": 0.3, "lost": 0.29}, StopReason.LOST, 1),
        # A quarter of a turn at every step is a square: it gets no farther along than in its first four steps.
        (LEFT, {"step_length": 0.3, "patience": 2.1}, StopReason.STUCK, 7),
        (LEFT, {"step_length": 0.3, "max_steps": 5}, StopReason.OUT_OF_STEPS, 5),
        (STAY, {}, StopReason.OUT_OF_STEPS, 120),
        (AHEAD, {"arrive": 0.001, "step_length": 0.07, "lost": 1.0}, StopReason.OUT_OF_WORLD, 36),
    ],
)
def test_episodes_end_for_the_right_reason(make_env, action, settings, reason, steps):
    env = make_env(route=STRAIGHT, offset=0.0, **settings)
    env.reset(seed=0)
    total, walked, ended = 0.0, 0, False
    while not ended:
        _, reward, terminated, truncated, info = env.step(np.array(action))
        total, walked, ended = total + reward, walked + 1, terminated or truncated
    assert info["reason"] == reason
    assert walked == steps
    assert (terminated, truncated) == (reason != StopReason.OUT_OF_STEPS, reason == StopReason.OUT_OF_STEPS)
    assert info["is_success"] == (reason == StopReason.ARRIVED)
    assert np.isclose(total, info["along_m"] + ARRIVAL_REWARD * info["is_success"])
    with pytest.raises(InputError, match="reset the environment"):
        env.step(np.array(action))


def test_a_step_back_costs_what_the_step_ahead_earned(make_env):
    env = make_env(route=STRAIGHT, offset=0.0)
    env.reset(options={"start": (1.0, 1.5, 0.0)})
    assert np.isclose(env.step(np.array(AHEAD))[1], 0.05)
    assert np.isclose(env.step(np.array([1.0, 1.0]))[1], -0.05)


def test_an_agent_that_turns_on_the_spot_is_not_stuck(make_env):
    env = make_env(route=STRAIGHT, patience=0.2)
    env.reset(seed=0)
    assert all(env.step(np.array([0.3, 0.0]))[4]["reason"] is None for _ in range(20))


def test_a_walk_goes_on_after_pickling_and_closing(make_env):
    env = make_env(encoding="edges")
    env.reset(seed=2)
    env.step(np.array(AHEAD))
    other = pickle.loads(pickle.dumps(env))
    env.close()
    env.close()
    for _ in range(3):
        assert data_equivalence(env.step(np.array(LEFT)), other.step(np.array(LEFT)), exact=True)
    assert data_equivalence(env.reset(), other.reset(), exact=True)
    other.close()


def test_worlds_and_routes_come_from_files_as_well(make_env, tmp_path):
    write_world(WORLD, tmp_path / "world.glb")
    write_route(STRAIGHT, tmp_path / "route.csv")
    env = make_env(world=tmp_path / "world.glb", route=str(tmp_path / "route.csv"))
    assert np.array_equal(env.reset(seed=1)[0], make_env(route=STRAIGHT).reset(seed=1)[0])


def test_training_views_are_the_observations_at_their_poses(make_env):
    env = make_env(route=STRAIGHT)
    env.reset(seed=0)
    views, poses = env.training_views(learning_walk=0.1, spacing=0.5)
    assert len(views) == len(poses) == 5 * 7
    for view, pose in zip(views[:3], poses[:3], strict=True):
        assert np.array_equal(env.reset(options={"start": pose})[0], view)
    many = make_env(RouteFollowingVector, 2, route=STRAIGHT)
    assert np.array_equal(many.training_views(1, learning_walk=0.1, spacing=0.5)[0], views)


def test_training_views_are_those_of_the_route_of_their_seed():
    courses = Courses(RouteTask(world="tiny", eye=SMALL, length=1.0))
    poses = {seed: courses.training_views(seed, learning_walk=0.0, spacing=0.5)[1] for seed in (0, 5)}
    for seed in poses:
        assert np.array_equal(poses[seed], training_poses(courses[seed].route, 0.5, field=Bounds(0, 0, 3, 3)))
    courses.close()


def test_frames_are_enlarged_views(make_env):
    env = make_env(render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    assert env.render().shape == (180, 720, 3)
    assert np.array_equal(env.render()[::30, ::30], observation)
    many = make_env(RouteFollowingVector, 2, render_mode="rgb_array")
    observations, _ = many.reset(seed=0)
    assert np.array_equal(np.stack(many.render())[:, ::30, ::30], observations)
    assert make_env().render() is None


def test_an_episode_is_by_default_what_an_experiment_is_by_default():
    task = RouteTask()
    assert task.experiment == Experiment(eye=task.eye)


@pytest.mark.parametrize(
    ("settings", "parts"),
    [
        ({"world": "tundra"}, ["'tundra'", "tussock-field"]),
        ({"world": 5}, ["world", "5", "a World"]),
        ({"world": "tiny", "world_seed": -1}, ["world_seed", "-1", "from 0"]),
        ({"world_seed": 1.5}, ["world_seed", "1.5", "whole number"]),
        ({"worlds": 0}, ["worlds", "0", "from 1"]),
        ({"worlds": 2.5}, ["worlds", "2.5", "whole number"]),
        ({"worlds": True}, ["worlds", "True", "whole number"]),
        ({"worlds": 2}, ["2 worlds", "from a preset", "give one"]),
        ({"world": "tiny", "worlds": 2, "route": STRAIGHT}, ["2 worlds", "no route"]),
        ({"route": 5}, ["route", "5", "a Route or its file"]),
        ({"route": STRAIGHT, "offset": 1.6, "lost": 2.0}, ["(0.5, -0.1) m", "outside the world", "choose another"]),
        ({"route": Route.through(np.array([[1.0, 1.0], [9.0, 1.0]]))}, ["(9, 1) m", "leaves the world"]),
        ({"length": "long"}, ["length", "'long'", "(m)"]),
        ({"length": 0.05}, ["RouteTask", "length", "0.05", "from 0.1 (m)"]),
        ({"eye": None}, ["eye", "None", "an Eye"]),
        ({"encoding": "colour"}, ["encoding", "'colour'", "grey"]),
        ({"encoding": 5}, ["encoding", "5", "name"]),
        ({"renderer": "metal"}, ["renderer", "'metal'", "cpu"]),
        ({"offset": 0.5}, ["offset", "0.5 m", "less than 0.5 m"]),
        ({"offset": "far"}, ["offset", "'far'", "(m)"]),
        ({"lost": "far"}, ["lost", "'far'", "(m)"]),
        ({"step_length": 0.0}, ["step_length", "0.0", "over 0 (m)"]),
        ({"heading_noise": -0.1}, ["heading_noise", "-0.1", "degrees", "from 0"]),
        ({"heading_noise": None}, ["heading_noise", "None", "a number"]),
        ({"max_steps": 0}, ["max_steps", "0", "from 1"]),
        ({"max_steps": 1.5}, ["max_steps", "1.5", "whole number"]),
        ({"render_mode": "human"}, ["'human'", "rgb_array"]),
    ],
)
def test_invalid_settings_are_refused(make_env, settings, parts):
    check_refused(lambda: make_env(**settings).reset(seed=0), parts)


def check_refused(act: Callable[[], object], parts: Sequence[str]) -> None:
    """The error is one line that contains all parts: the value, where it was given, and what to do."""
    with pytest.raises(InputError) as refused:
        act()
    message = str(refused.value)
    assert "\n" not in message
    assert [part for part in parts if part not in message] == [], message


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({"wrld": 3}, ["'wrld'", "world, start"]),
        ({"world": 3}, ["world 3", "from 0 to 0"]),
        ({"world": 0.0}, ["world 0.0", "a seed"]),
        ({"world": np.zeros(2, int)}, ["array([0, 0])", "from 0 to 0"]),
        ({"start": (1.0, 2.0)}, ["[1.0, 2.0]", "heading (rad)"]),
        ({"start": (9.0, 2.0, 0.0)}, ["(9, 2) m", "outside the world", "choose another"]),
        ({"start": (1.0, 2.9, 0.0)}, ["(1.0, 2.9, 0.0)", "lost at once", "choose another"]),
        ({"start": 5}, ["start 5.0", "heading (rad)"]),
        ({"start": "abc"}, ["start", "'abc'", "heading (rad)"]),
        ({"start": (None, 0, 0)}, ["start [nan, 0.0, 0.0]", "heading (rad)"]),
        ({"start": (1.0, 1.5, np.nan)}, ["start [1.0, 1.5, nan]", "heading (rad)"]),
        ({"start": (10**400, 0, 0)}, ["start", "too large", "heading (rad)"]),
    ],
)
def test_invalid_options_are_refused(make_env, options, parts):
    check_refused(lambda: make_env(route=STRAIGHT).reset(options=options), parts)


def test_the_heading_of_a_given_start_is_wrapped(make_env):
    env = make_env(route=STRAIGHT)
    straight_on, _ = env.reset(options={"start": (1.0, 1.5, 0.5)})
    for turns in (-3, 1, 5):
        observation, info = env.reset(options={"start": (1.0, 1.5, 0.5 + 2 * np.pi * turns)})
        assert np.isclose(info["pose"][2], 0.5)
        assert np.abs(observation.astype(int) - straight_on).max() <= 1


@pytest.mark.parametrize(
    "action",
    [(1.1, 0.5), (0.0, -0.1), (np.nan, 1.0), (0.5,), "ab", None, ("a", "b"), np.array([0.5, [1.0]], dtype=object)],
)
def test_invalid_actions_are_refused(make_env, action):
    env, many = make_env(), make_env(RouteFollowingVector, 2)
    with pytest.raises(InputError, match="not begun"):
        env.step(np.array(AHEAD))
    env.reset(seed=0)
    many.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        env.step(np.array(action))
    with pytest.raises(InputError, match="action"):
        many.step(np.array([action, action]))


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("bad", [(0.0, 2.0), ("a", "b")])
def test_a_refused_step_changes_nothing(make_env, mode, bad):
    """An action that is not used is not refused: that of a walk that has ended, where the step begins another one."""
    many, other = (make_env(RouteFollowingVector, 2, autoreset_mode=mode, max_steps=2) for _ in range(2))
    for each in (many, other):
        each.reset(seed=1)
        each.step(np.array([AHEAD, AHEAD]))
    actions = np.array([AHEAD, bad], dtype=object)
    for action in (actions, actions[:, :1]):
        with pytest.raises(InputError, match="action"):
            many.step(action)
    assert data_equivalence(many.step(np.array([AHEAD, LEFT])), other.step(np.array([AHEAD, LEFT])), exact=True)
    if mode == AutoresetMode.NEXT_STEP:
        assert not many.step(np.array([bad, bad], dtype=object))[3].any()
    elif mode == AutoresetMode.DISABLED:
        many.reset(options={"reset_mask": np.array([True, False])})
        before = [episode.pose for episode in many._episodes]
        with pytest.raises(InputError, match="reset the environment"):
            many.step(np.array([AHEAD, AHEAD]))
        assert [episode.pose for episode in many._episodes] == before


def test_seeds_may_be_numbers_of_numpy(make_env):
    env, many = make_env(), make_env(RouteFollowingVector, 2)
    for seed in (np.int64(3), np.uint8(3)):
        assert data_equivalence(env.reset(seed=seed), env.reset(seed=3), exact=True)
        assert data_equivalence(many.reset(seed=seed), many.reset(seed=[3, 4]), exact=True)
        assert data_equivalence(many.reset(seed=[seed, seed]), many.reset(seed=[3, 3]), exact=True)
    for each in (env, many):
        with pytest.raises(InputError, match=r"seed is -1.*whole number"):
            each.reset(seed=-1)


def test_with_world_and_start_given_only_the_noise_is_random(make_env):
    """It is drawn as an agent draws it."""
    env = make_env(world="tiny", worlds=3, heading_noise=0.3)
    start = env._courses[1].route.start
    for seed in (5, 6):
        _, info = env.reset(seed=seed, options={"world": 1, "start": start})
        assert (info["world"], *info["pose"]) == (1, *start)
        turned = env.step(np.array(STAY))[4]["pose"][2] - start.heading
        assert np.isclose(np.cos(turned - 0.3 * np.random.default_rng(seed).standard_normal()), 1.0)


def test_invalid_vectors_are_refused(make_env):
    many = make_env(RouteFollowingVector, 2)
    with pytest.raises(InputError, match="3 seeds for 2 environments"):
        many.reset(seed=[1, 2, 3])
    for mask in (np.zeros(2, bool), np.ones(3, bool), np.ones(2)):
        with pytest.raises(InputError, match="reset_mask"):
            many.reset(options={"reset_mask": mask})
    with pytest.raises(InputError, match="0 environments"):
        RouteFollowingVector(0, world="tiny")
