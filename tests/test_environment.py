"""The Gymnasium environment: Gymnasium's own checks, the same walks as the agent's, the same alone and side by side."""

import copy
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import example, given
from hypothesis import strategies as some
from scenes import random_world

from tussock.navigation.encoding import Encoding
from tussock.navigation.models import PerfectMemory
from tussock.navigation.rl.environment import ID, ROUNDING, RouteFollowing, RouteFollowingVector
from tussock.navigation.rl.task import ARRIVAL
from tussock.navigation.scan import best_turn, scan_window
from tussock.navigation.training import learn, training_poses
from tussock.navigation.walk import ARRIVED, LOST, OUT_OF_STEPS, OUT_OF_WORLD, STUCK, Agent
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError
from tussock.world.files import write_world
from tussock.world.geometry import Route
from tussock.world.route_files import write_route
from tussock.world.routes import generate_route
from tussock.world.scene import World

SMALL = Eye(width=24, height=6)
WORLD = World.generate("tiny", 2)
STRAIGHT = Route.through(np.column_stack([np.linspace(0.5, 2.5, 51), np.full(51, 1.5)]))
AHEAD, LEFT, STAY = (0.0, 1.0), (0.5, 1.0), (0.0, 0.0)


@pytest.fixture
def made():
    """Makes environments, which are closed afterwards."""
    opened = []

    def make(kind=RouteFollowing, *args, **settings):
        opened.append(kind(*args, **({"world": WORLD, "eye": SMALL} | settings)))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


@pytest.mark.parametrize("encoding", [None, "edges", "grey", "sky-mask | blur 1 | resize 2"])
def test_gymnasium_finds_nothing_wrong(encoding):
    env = gymnasium.make(ID, world="tiny", eye=SMALL, encoding=encoding, render_mode="rgb_array")
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("encoding", [None, "edges"])
def test_the_name_leads_here(encoding):
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
    code = "import sys; sys.modules['gymnasium'] = None; from tussock import Agent; print('here'); import tussock.navigation.rl.environment"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "here\n"
    assert done.stderr.splitlines()[-1].startswith("ImportError: the environment needs Gymnasium; install it with")


def test_a_familiarity_model_walks_here_as_its_agent_does(made):
    eye, encoding, route = Eye(width=120, height=20), Encoding.named("edges"), generate_route(WORLD, 2)
    env = made(route=route, eye=eye, encoding=encoding)
    start = route.start.moved(0.0, 0.1)
    observation, info = env.reset(options={"start": start})
    views, poses = env.training_views(learning_walk=0.2)
    model, again = PerfectMemory().fit(torch.from_numpy(views)), PerfectMemory()
    with open_renderer(WORLD, eye) as renderer:
        there = training_poses(route.resampled(0.04), learning_walk=0.2, field=WORLD.field)
        assert np.array_equal(learn(again, encoding, renderer, there), poses)
        steps = list(Agent(renderer=renderer, encoding=encoding, model=again, route=route).walk(start))
    assert len(steps) > 20
    for step in steps:
        assert np.array_equal(encoding(step.view[None])[0].numpy(), observation)
        assert np.allclose(
            info["pose"], step.pose, rtol=0, atol=1e-12
        )  # a turn comes as a share of half a turn: rounding
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
@pytest.mark.parametrize(
    "settings", [{}, {"encoding": "edges"}, {"world": "tiny", "worlds": 3}, {"heading_noise": 0.3}]
)
def test_side_by_side_they_walk_as_alone(made, mode, settings):
    """Held, to the last bit, against Gymnasium's own vector environment, which steps one after the other."""
    settings = {"lost": 0.15, "max_steps": 9} | settings
    many = made(RouteFollowingVector, 4, autoreset_mode=mode, **settings)
    alone = SyncVectorEnv([lambda: made(**settings)] * 4, autoreset_mode=mode)
    assert many.metadata == alone.metadata
    assert many.observation_space == alone.observation_space
    assert many.action_space == alone.action_space

    def reset(**how):  # Gymnasium's takes reset_mask out of the options it is given
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
    assert endings == {LOST, OUT_OF_STEPS}
    reset(seed=[3, 1, None, 3])


def test_the_views_of_one_world_are_drawn_in_one_call(made):
    many = made(RouteFollowingVector, 5)
    many.reset(seed=1)
    renderer = many.task.course(0).renderer
    drawn, render = [], renderer.render
    renderer.render = lambda poses: drawn.append(len(poses)) or render(poses)
    many.step(np.tile(AHEAD, (5, 1)))
    assert drawn == [5]


def test_the_same_seed_is_the_same_walk_and_another_is_not(made):
    def seen(seed):
        env = made(world="tiny", worlds=4)
        env.action_space.seed(1)
        first, info = env.reset(seed=seed)
        looks = [first.tobytes(), *(env.step(env.action_space.sample())[0].tobytes() for _ in range(5))]
        return looks, [info["world"], *(env.reset()[1]["world"] for _ in range(12))]

    assert seen(3) == seen(3)
    assert seen(3)[0] != seen(4)[0]
    assert set(seen(3)[1]) == {0, 1, 2, 3}


def test_walks_start_on_either_side_of_the_routes_start(made):
    env = made(route=STRAIGHT, offset=0.2)
    starts = np.array([env.reset(seed=seed)[1]["pose"] for seed in range(30)]) - STRAIGHT.poses[0]
    assert np.array_equal(starts[:, [0, 2]], np.zeros((30, 2)))
    assert -0.2 <= starts[:, 1].min() < -0.1
    assert 0.1 < starts[:, 1].max() <= 0.2


@given(encoding=some.sampled_from([None, "grey", "sky", "edges"]), seed=some.integers(0, 50))
def test_what_is_seen_lies_in_the_space_of_what_can_be_seen(encoding, seed):
    route = Route.through(np.array([[-2.0, 0.0], [2.0, 0.5]]))
    env = RouteFollowing(world=random_world(seed), route=route, eye=SMALL, encoding=encoding)
    observation, _ = env.reset(seed=seed)
    env.action_space.seed(seed)
    for _ in range(5):
        assert observation in env.observation_space
        observation = env.step(env.action_space.sample())[0]
    env.close()


DOT = np.eye(32).reshape(32, 4, 8, 1).repeat(4, axis=3) * 255  # one white pixel, at every place
FILTERS = ["blur 0.7", "resize 2", "resize 1.5", "sample 2", "vertical-edges", "normalise"]


@given(
    views=some.sampled_from([np.zeros((1, 4, 8, 4)), np.full((1, 4, 8, 4), 255), DOT, 255 - DOT]),
    source=some.sampled_from(["grey", "sky-mask"]),
    filters=some.lists(some.sampled_from(FILTERS), max_size=4),
)
@example(views=DOT, source="grey", filters=["normalise", "vertical-edges"])
def test_no_view_leaves_the_bounds_of_its_encoding(views, source, filters):
    encoding = Encoding.parse(" | ".join([source, *filters]))
    shape, low, high = encoding.bounds(4, 8)
    images = encoding(views.astype(np.uint8)).numpy()
    assert images.shape[1:] == shape
    assert low * (1 + ROUNDING) <= images.min()
    assert images.max() <= high * (1 + ROUNDING)


@pytest.mark.parametrize("chain", ["grey", "grey | normalise", "grey | vertical-edges", "grey | resize 2 | normalise"])
def test_the_bounds_of_an_encoding_are_reached(chain):
    encoding = Encoding.parse(chain)
    images = encoding(np.concatenate([DOT, 255 - DOT]).astype(np.uint8))
    _, low, high = encoding.bounds(4, 8)
    assert np.allclose([images.min(), images.max()], [low, high], rtol=1e-5)


@pytest.mark.parametrize(
    ("action", "settings", "reason", "steps"),
    [
        (AHEAD, {}, ARRIVED, 37),
        (LEFT, {"step_length": 0.3, "lost": 0.29}, LOST, 1),
        # A quarter turn at every step is a square: it gets no farther along than in its first four steps.
        (LEFT, {"step_length": 0.3, "patience": 2.1}, STUCK, 7),
        (LEFT, {"step_length": 0.3, "max_steps": 5}, OUT_OF_STEPS, 5),
        (STAY, {}, OUT_OF_STEPS, 120),
        (AHEAD, {"arrive": 0.001, "step_length": 0.07, "lost": 1.0}, OUT_OF_WORLD, 36),
    ],
)
def test_walks_end_for_the_reason_they_should(made, action, settings, reason, steps):
    env = made(route=STRAIGHT, offset=0.0, **settings)
    env.reset(seed=0)
    total, walked, ended = 0.0, 0, False
    while not ended:
        _, reward, terminated, truncated, info = env.step(np.array(action))
        total, walked, ended = total + reward, walked + 1, terminated or truncated
    assert info["reason"] == reason
    assert walked == steps
    assert (terminated, truncated) == (reason != OUT_OF_STEPS, reason == OUT_OF_STEPS)
    assert info["is_success"] == (reason == ARRIVED)
    assert np.isclose(total, info["along_m"] + ARRIVAL * info["is_success"])
    with pytest.raises(InputError, match="reset the environment"):
        env.step(np.array(action))


def test_turning_on_the_spot_is_not_being_stuck(made):
    env = made(route=STRAIGHT, patience=0.2)
    env.reset(seed=0)
    assert all(env.step(np.array([0.3, 0.0]))[4]["reason"] is None for _ in range(20))


def test_a_walk_goes_on_after_pickling_and_closing(made):
    env = made(encoding="edges")
    env.reset(seed=2)
    env.step(np.array(AHEAD))
    other = pickle.loads(pickle.dumps(env))
    env.close()
    env.close()
    for _ in range(3):
        assert data_equivalence(env.step(np.array(LEFT)), other.step(np.array(LEFT)), exact=True)
    assert data_equivalence(env.reset(), other.reset(), exact=True)
    other.close()


def test_worlds_and_routes_come_from_files_as_well(made, tmp_path):
    write_world(WORLD, tmp_path / "world.glb")
    write_route(STRAIGHT, tmp_path / "route.csv")
    env = made(world=tmp_path / "world.glb", route=str(tmp_path / "route.csv"))
    assert np.array_equal(env.reset(seed=1)[0], made(route=STRAIGHT).reset(seed=1)[0])


def test_a_learner_is_shown_the_route_as_it_will_see_it(made):
    env = made(route=STRAIGHT)
    env.reset(seed=0)
    views, poses = env.training_views(learning_walk=0.1, spacing=0.5)
    assert len(views) == len(poses) == 5 * 7
    for view, pose in zip(views[:3], poses[:3], strict=True):
        assert np.array_equal(env.reset(options={"start": pose})[0], view)
    many = made(RouteFollowingVector, 2, route=STRAIGHT)
    assert np.array_equal(many.training_views(1, learning_walk=0.1, spacing=0.5)[0], views)


def test_frames_are_what_is_seen_enlarged(made):
    env = made(render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    assert env.render().shape == (180, 720, 3)
    assert np.array_equal(env.render()[::30, ::30], observation)
    many = made(RouteFollowingVector, 2, render_mode="rgb_array")
    observations, _ = many.reset(seed=0)
    assert np.array_equal(np.stack(many.render())[:, ::30, ::30], observations)
    assert made().render() is None


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"world": "tundra"}, "there is no world 'tundra'"),
        ({"world": "tiny", "world_seed": -1}, "whole number"),
        ({"worlds": 0}, "0 worlds; give at least 1"),
        ({"worlds": 2}, "grown from a preset"),
        ({"world": "tiny", "worlds": 2, "route": STRAIGHT}, "grown from a preset"),
        ({"encoding": "colour"}, "unknown encoding"),
        ({"offset": 0.5}, "less than 0.5 m"),
        ({"route": STRAIGHT, "offset": 1.6, "lost": 2.0}, "outside the world"),
        ({"route": Route.through(np.array([[1.0, 1.0], [9.0, 1.0]]))}, "leaves the world"),
        ({"step_length": 0.0}, "step length 0.0 m"),
        ({"heading_noise": -0.1}, "heading noise"),
        ({"max_steps": 0}, "at least 1"),
        ({"render_mode": "human"}, "render mode 'human'"),
    ],
)
def test_settings_that_make_no_sense_are_refused(made, settings, match):
    with pytest.raises(InputError, match=match) as refused:
        made(**settings).reset(seed=0)
    assert "\n" not in str(refused.value)


# Settings of the wrong type, which the tests' own type checker would refuse first: elsewhere there is none.
ILL_TYPED = {
    "max_steps=1.5": "1.5 steps; give a whole number",
    "worlds=2.5": "2.5 worlds; give a whole number",
    "worlds=True": "True worlds; give a whole number",
    "world_seed=1.5": "the seed is 1.5; give a whole number >= 0",
    "world=5": "the world is 5; give a preset's name, a file or a World",
    "route=5": "the route is 5; give a Route or its file",
    "eye=None": "the eye is None; give an Eye",
    "encoding=5": "the encoding is 5; give its name or its steps",
    "offset='far'": "an offset of far m; give 0 or more, and less than 0.5 m, which is lost",
    "lost='far'": "lost far m; give a finite distance over 0",
    "length='long'": "length long m; give a finite distance over 0",
    "heading_noise=None": "heading noise None; give a number",
}


def test_settings_of_the_wrong_type_are_refused():
    cases = "\n".join(
        f"try: RouteFollowing({case}).reset()\nexcept InputError as error: print(error)" for case in ILL_TYPED
    )
    code = f"from tussock.navigation.rl.environment import RouteFollowing\nfrom tussock.world.errors import InputError\n{cases}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines() == list(ILL_TYPED.values()), done.stderr


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"wrld": 3}, "unknown option 'wrld'"),
        ({"world": 3}, "world 3; give a seed from 0 to 0"),
        ({"start": (1.0, 2.0)}, "heading"),
        ({"start": (9.0, 2.0, 0.0)}, "outside the world"),
        ({"start": (1.0, 2.9, 0.0)}, "lost at once"),
        ({"start": 5}, "start 5.0; give x"),
        ({"start": "abc"}, "start: .*'abc'; give x"),
        ({"start": (None, 0, 0)}, "outside the world"),
        ({"start": (10**400, 0, 0)}, "start: .*give x"),
        ({"world": np.zeros(2, int)}, "give a seed from 0 to 0"),
        ({"world": 0.0}, "world 0.0; give a seed"),
    ],
)
def test_options_that_make_no_sense_are_refused(made, options, match):
    with pytest.raises(InputError, match=match) as refused:
        made(route=STRAIGHT).reset(options=options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "action",
    [(1.1, 0.5), (0.0, -0.1), (np.nan, 1.0), (0.5,), "ab", None, ("a", "b"), np.array([0.5, [1.0]], dtype=object)],
)
def test_actions_that_make_no_sense_are_refused(made, action):
    env, many = made(), made(RouteFollowingVector, 2)
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
def test_a_refused_step_changes_nothing(made, mode, bad):
    """Nor is an action refused that is not used, of a walk that has ended and is to begin another one."""
    many, other = (made(RouteFollowingVector, 2, autoreset_mode=mode, max_steps=2) for _ in range(2))
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
        before = [walk.pose for walk in many._walks]
        with pytest.raises(InputError, match="reset the environment"):
            many.step(np.array([AHEAD, AHEAD]))
        assert [walk.pose for walk in many._walks] == before


def test_seeds_may_be_numpys(made):
    env, many = made(), made(RouteFollowingVector, 2)
    for seed in (np.int64(3), np.uint8(3)):
        assert data_equivalence(env.reset(seed=seed), env.reset(seed=3), exact=True)
        assert data_equivalence(many.reset(seed=seed), many.reset(seed=[3, 4]), exact=True)
        assert data_equivalence(many.reset(seed=[seed, seed]), many.reset(seed=[3, 3]), exact=True)
    for each in (env, many):
        with pytest.raises(InputError, match="the seed is -1; give a whole number"):
            each.reset(seed=-1)


def test_only_the_noise_of_a_walk_is_left_to_chance_where_world_and_start_are_given(made):
    """It is drawn as an agent draws it, which draws nothing else."""
    env = made(world="tiny", worlds=3, heading_noise=0.3)
    start = env.task.course(1).rules.route.start
    for seed in (5, 6):
        _, info = env.reset(seed=seed, options={"world": 1, "start": start})
        assert (info["world"], *info["pose"]) == (1, *start)
        turned = env.step(np.array(STAY))[4]["pose"][2] - start.heading
        assert np.isclose(np.cos(turned - 0.3 * np.random.default_rng(seed).standard_normal()), 1.0)


def test_vectors_that_make_no_sense_are_refused(made):
    many = made(RouteFollowingVector, 2)
    with pytest.raises(InputError, match="3 seeds for 2 environments"):
        many.reset(seed=[1, 2, 3])
    for mask in (np.zeros(2, bool), np.ones(3, bool), np.ones(2)):
        with pytest.raises(InputError, match="reset_mask"):
            many.reset(options={"reset_mask": mask})
    with pytest.raises(InputError, match="0 environments"):
        RouteFollowingVector(0, world="tiny")
