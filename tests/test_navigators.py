"""One set of laws for all navigators, those of the registry: whatever joins it is tested here."""

import dataclasses
from collections.abc import Iterator, Sequence
from math import pi, radians
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pandas as pd
import pytest
import torch
from commands import printed
from quick_cases import quick
from small_models import SMALL

from tussock.navigation.body import Body
from tussock.navigation.comparison import compare_models
from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment, steps_of
from tussock.navigation.models import MODELS
from tussock.navigation.models.files import save_model
from tussock.navigation.models.random import RandomHeadings
from tussock.navigation.steering import NAVIGATORS
from tussock.navigation.steering.navigator import Journey, Look, Motion, Navigator, PathIntegrating
from tussock.navigation.stopping import StoppingRules
from tussock.navigation.sweeps.sweep import run_sweep
from tussock.navigation.sweeps.sweep_file import Sweep
from tussock.navigation.training_setup import TrainingSetup
from tussock.navigation.walk import Walk
from tussock.navigation.walker import Step
from tussock.render.eye import Eye
from tussock.render.images import Grid, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds, Pose, Route
from tussock.world.routes import generate_route
from tussock.world.scene import World
from tussock.world.specs import Spec, format_spec, takes

# What is not as by default: of a navigator that cannot do without or learns for long, and, for the mirrored world, of one that draws
# random numbers.
PARAMETERS: dict[str, dict[str, Any]] = {"home-vector": {"passes": 2, "memory_kb": 3.4}}
WITHOUT_NOISE: dict[str, dict[str, Any]] = {"central-complex": {"noise": 0.0}}
NOT_MIRRORED: dict[str, str] = {}  # names, and why a mirrored world does not mirror their walks

NAMES = list(NAVIGATORS.builtin)
EYE = Eye(width=36, height=8, samples=2)
TINY = World.generate("tiny", 2)
WORLD = dataclasses.replace(TINY, field=Bounds(-9.0, -9.0, 9.0, 9.0))  # which no walk leaves
ROUTE = Route(generate_route(TINY, 2, 1.6).poses)
ENCODING = Encoding.named(
    "grey | normalise", resize=1
)  # of whose mirrored views the features are mirrored, to the last bit
STARTS = (0.0, 0.1, -0.15)  # m to the left of the route
STEPS = 16
OF_STEERING = ["steps", "mean_deviation_m", "looks_per_m", "touches", "inward", "outward", "goal_m", "recovered"]


class Plain:
    """A model as a user writes it: with fit and scan only."""

    def fit(self, views):
        self.mean = views.mean(dim=0)

    def scan(self, views):
        turned = [views.roll(k, dims=2) for k in range(views.shape[2])]
        return -torch.stack([(each - self.mean).abs().mean(dim=(1, 2)) for each in turned], dim=1)


PLAIN = f"{__name__}:Plain"
ANY_MODELS = ["perfect-memory", "infomax", "mushroom-body", PLAIN, "random"]


def spec(name: str, **parameters: Any) -> Spec:
    """A navigator with the parameters that it must have."""
    return dataclasses.replace(NAVIGATORS.spec(name), parameters=PARAMETERS.get(name, {}) | parameters)


def experiment(name: str, **changes: Any) -> Experiment:
    """A short walk in a tiny world by a navigator."""
    base = Experiment(
        world=WORLD,
        route=ROUTE,
        eye=EYE,
        encoding=ENCODING,
        navigator=spec(name),
        training=TrainingSetup(spacing=0.1),
        body=Body(heading_noise=radians(5)),
        stopping=StoppingRules(max_steps=STEPS, max_deviation=5.0, patience=50.0),
        renderer="cpu",
        threads=1,
    )
    return base.replace(**changes)


def model_of(name: str) -> str:
    """The spec of a model that learns in a moment."""
    return format_spec(name, SMALL.get(name, {}))


def walks(*experiments: Experiment) -> list[list[Step]]:
    """The steps of walks side by side, after the first has learned."""
    with experiments[0].opened() as trained:
        rows = [[step and step[0] for step in steps] for steps in steps_of(experiments, trained)]
    return [[step for step in of_agent if step is not None] for of_agent in zip(*rows, strict=True)]


def content(value: Any) -> Any:
    """A value as bytes, or as something else that is equal where the value is the same to the last bit."""
    if isinstance(value, np.ndarray | np.generic | torch.Tensor):
        array = np.asarray(value)
        return array.dtype.str, array.shape, array.tobytes()
    return value


def decided(step: Step) -> dict[str, Any]:
    """What an agent decided, from what, and where it was; its views aside."""
    names = ("pose", "aim", "turn", "looks", "familiarity", "match", "progress", "reason")
    return {name: content(getattr(step, name)) for name in names} | {
        name: content(value) for name, value in step.signals.items()
    }


def assert_same(one: Sequence[Step], other: Sequence[Step]) -> None:
    """The same walk, to the last bit."""
    assert [decided(step) for step in one] == [decided(step) for step in other]


@pytest.fixture(scope="module", params=NAMES)
def name(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def learned(name) -> Iterator[tuple[Navigator, Experiment, Any]]:
    """A navigator that has learned the route, its experiment, and the renderer."""
    given = experiment(name)
    with given.opened() as trained:
        yield trained.navigator, given, trained.renderer


def looks_at_random(n: int, count: int) -> list[Look]:
    """Successive looks of n agents at something."""
    rng = np.random.default_rng(7)
    return [
        Look(
            views=torch.from_numpy(rng.normal(size=(n, EYE.height, EYE.width)).astype(np.float32)),
            compass=rng.uniform(-pi, pi, n),
            odometry=rng.uniform(0, 0.05, n) * (index > 0),
            touch=(rng.random(n) < 0.2) & (index > 0),
        )
        for index in range(count)
    ]


def part_of(look: Look, rows: slice) -> Look:
    """What some of the agents perceive."""
    assert look.odometry is not None
    assert look.touch is not None
    return Look(
        views=look.views[rows], compass=look.compass[rows], odometry=look.odometry[rows], touch=look.touch[rows]
    )


def memories_of(navigator: Navigator, n: int) -> list[Any]:
    """What n agents remember, who have come from the goal by different ways."""
    memories = [navigator.begin() for _ in range(n)]
    if isinstance(navigator, PathIntegrating):
        for number, memory in enumerate(memories):
            rng = np.random.default_rng(number)
            navigator.travel(memory, Journey(compass=rng.uniform(-1, 1, 20), odometry=rng.uniform(0, 0.1, 20)))
    return memories


def rows_of(motion: Motion, rows: slice) -> dict[str, Any]:
    """What a motion says of some agents."""
    values = {"turn": motion.turn, "step": motion.step, "looks": motion.looks, **motion.signals}
    return {key: None if value is None else content(np.asarray(value)[rows]) for key, value in values.items()}


def test_agents_decide_among_others_as_alone(learned):
    navigator, *_ = learned
    n = 5
    together, alone, halves = (memories_of(navigator, n) for _ in range(3))
    for look in looks_at_random(n, 6):
        motion = navigator.decide(look, together)
        assert np.isfinite(motion.turn).all()
        for k in range(n):
            row = slice(k, k + 1)
            assert rows_of(navigator.decide(part_of(look, row), alone[row]), slice(None)) == rows_of(motion, row)
        for row in (slice(0, 2), slice(2, n)):
            assert rows_of(navigator.decide(part_of(look, row), halves[row]), slice(None)) == rows_of(motion, row)


def test_walks_side_by_side_are_those_that_each_agent_makes_alone(name):
    given = [
        experiment(name, start_offset=offset, seed=seed, stopping__max_steps=STEPS - 5 * seed)
        for seed, offset in enumerate(STARTS)
    ]
    # One navigator, which does not learn again: what it learns depends on the seed.
    with given[0].opened() as trained:
        together = list(zip(*steps_of(given, trained), strict=True))
        for each, steps in zip(given, together, strict=True):
            alone = [step for (step,) in steps_of([each], trained)]
            assert_same([step[0] for step in steps if step], [step[0] for step in alone if step])
    assert [sum(step is not None for step in steps) for steps in together] == [STEPS + 1 - 5 * k for k in range(3)]


def test_the_same_seed_walks_the_same_and_another_does_not(name):
    first, again, other = (walks(experiment(name, seed=seed))[0] for seed in (3, 3, 4))
    assert_same(first, again)
    assert [step.pose for step in first] != [step.pose for step in other]


class Mirrored(np.random.Generator):
    """Noise of the other sign."""

    def standard_normal(self, *args, **kwargs):
        return -super().standard_normal(*args, **kwargs)


def mirrored_poses(poses: np.ndarray) -> np.ndarray:
    """Poses (n, 3) on the other side of the x axis."""
    return poses * np.array([1.0, -1.0, -1.0])


def mirrored_world(world: World) -> World:
    """A world on the other side of the x axis."""
    assert world.ground is not None
    x0, y0, x1, y1 = world.field
    a0, b0, a1, b1 = world.ground.bounds
    return dataclasses.replace(
        world,
        triangles=world.triangles * np.array([1, -1, 1], dtype=np.float32),
        field=Bounds(x0, -y1, x1, -y0),
        ground=dataclasses.replace(world.ground, bounds=Bounds(a0, -b1, a1, -b0)),
    )


def steps_in(walk: Walk, navigator: Navigator) -> list[list[Step]]:
    """The steps of each agent of a walk."""
    return [[step for step in steps if step] for steps in zip(*walk.steps(navigator), strict=True)]


def walks_in_mirror(name: str, *, mirrored: bool) -> list[list[Step]]:
    """Walks in the world, or in its mirror image. What is learned is mirrored as it is, in the same order."""
    parameters = WITHOUT_NOISE.get(name, {})
    if takes(NAVIGATORS.find(name), "first"):
        parameters = parameters | {"first": "right" if mirrored else "left"}
    here = experiment(name, navigator=spec(name, **parameters))
    with here.open_renderer(WORLD) as renderer:
        views, poses = here.training_views(renderer, ROUTE)
    sign, world, route, noise = 1, WORLD, ROUTE, np.random.Generator
    if mirrored:
        sign, world, route, noise = -1, mirrored_world(WORLD), Route(mirrored_poses(ROUTE.poses)), Mirrored
        views, poses = views.flip(2), mirrored_poses(poses)
    given = here.replace(world=world, route=route)
    with given.open_renderer(world) as renderer:
        trained = given.train(renderer, route, views=(views, poses))
        walk = Walk(
            renderer=renderer,
            encoding=given.encoding,
            route=route,
            starts=[route.start.moved(0.0, sign * left) for left in STARTS],
            body=given.body,
            stopping=given.stopping,
            noise=[noise(np.random.PCG64(seed)) for seed in range(len(STARTS))],
        )
        return steps_in(walk, trained.navigator)


def test_a_mirrored_world_mirrors_the_walk(name):
    if name in NOT_MIRRORED:
        pytest.skip(NOT_MIRRORED[name])
    for steps, others in zip(*(walks_in_mirror(name, mirrored=each) for each in (False, True)), strict=True):
        poses, mirror_image = (np.array([step.pose for step in each]) for each in (steps, others))
        turns, others_turns = (np.array([step.aim for step in each]) for each in (steps, others))
        assert np.allclose(poses, mirrored_poses(mirror_image), rtol=0, atol=1e-6)
        assert np.allclose(turns, -others_turns, rtol=0, atol=1e-6)
        assert np.ptp(turns) > 0.01  # it did turn


PERCEIVED = {each.name for each in dataclasses.fields(Look)}


class OnlyPerceived(Look):
    """A look of which nothing can be had but what agents perceive."""

    def __getattribute__(self, name: str) -> Any:
        if name not in PERCEIVED and not name.startswith("__"):
            raise AssertionError(f"a navigator asked a look for {name}")
        return super().__getattribute__(name)


def test_a_look_without_a_walk_is_enough(learned):
    navigator, given, renderer = learned
    poses = ROUTE.at(np.linspace(0, 1, 8))
    memories, poison = memories_of(navigator, 2), object()
    for start in range(0, 8, 2):
        look = OnlyPerceived(
            views=given.encoding(renderer.render(poses[start : start + 2])),
            compass=poses[start : start + 2, 2],
            odometry=np.full(2, 0.05),
            touch=np.zeros(2, dtype=bool),
        )
        for field in ("pose", "poses", "x", "y", "walk", "route", "world", "deviation", "along", "error", "goal"):
            object.__setattr__(look, field, poison)
        assert np.shape(navigator.decide(look, memories).turn) == (2,)


class Recorded(Walk):
    """A walk that keeps what its agents perceive."""

    looks: list[Look]

    def look(self) -> Look:
        look = super().look()
        self.looks = [*getattr(self, "looks", []), look]
        return look


class Replayed(Walk):
    """A walk whose agents perceive what others perceived elsewhere."""

    looks: Iterator[Look]

    def look(self) -> Look:
        return next(self.looks)


def test_agents_that_perceive_the_same_elsewhere_decide_the_same(learned):
    """A navigator that learns in any way where its agents are would decide otherwise."""
    navigator, given, renderer = learned
    there = Route(ROUTE.poses[::-1] * np.array([-1, 1, 0]) + [0.3, 0.2, 1.0])
    settings = {"renderer": renderer, "encoding": given.encoding, "stopping": given.stopping, "noise": 0}
    here = Recorded(route=ROUTE, starts=[ROUTE.start.moved(0.0, left) for left in STARTS], **settings)
    journeys = [agent.way_out() for agent in here.agents]
    steps = steps_in(here, navigator)
    elsewhere = Replayed(route=there, starts=[Pose(0.5, 0.5 + k / 2, k - 1.0) for k in range(len(STARTS))], **settings)
    elsewhere.looks = iter(here.looks)
    for agent, journey in zip(elsewhere.agents, journeys, strict=True):
        agent.way_out = lambda journey=journey: journey
    others = steps_in(elsewhere, navigator)
    assert len(steps) == len(others) == len(STARTS)
    for of_agent, of_other in zip(steps, others, strict=True):
        assert len(of_agent) == len(of_other) > 10
        for step, other in zip(of_agent, of_other, strict=True):
            assert content(step.aim) == content(other.aim)
            assert {key: content(value) for key, value in step.signals.items()} == {
                key: content(value) for key, value in other.signals.items()
            }
            assert step.pose != other.pose


@pytest.mark.parametrize("model", quick(ANY_MODELS, "perfect-memory", PLAIN))
def test_it_steers_by_any_model(name, model):
    (steps,) = walks(experiment(name, model=model_of(model), training__spacing=0.25, stopping__max_steps=4))
    assert len(steps) == 5
    assert all(np.isfinite(step.aim) and step.looks >= 0 for step in steps)
    for step in steps:
        assert all(np.isfinite(value).all() for value in step.signals.values()), step.signals


def test_it_steers_by_an_eye_that_sees_a_part_of_the_circle_if_it_takes_a_model(name):
    eye = attrs.evolve(EYE, field=radians(200))
    if not takes(NAVIGATORS.find(name), "model"):
        with pytest.raises(SettingError, match=f"{name}.*takes no model"):
            experiment(name, eye=eye)
        return
    given = experiment(name, eye=eye)
    with given.opened() as trained:
        mask = given.encoding.for_eye(eye).mask
        assert mask is not None
        navigator, memories, others = trained.navigator, *(memories_of(trained.navigator, 3) for _ in range(2))
        for look in looks_at_random(3, 4):
            motion = navigator.decide(look, memories)
            assert np.isfinite(motion.turn).all()
            behind = torch.where(torch.as_tensor(mask.visible), look.views, 3.0)
            if all(motion.looks_of(row) == 1 for row in range(3)):  # who turns to look sees more than the field
                same = navigator.decide(dataclasses.replace(look, views=behind), others)
                assert rows_of(same, slice(None)) == rows_of(motion, slice(None))
    assert len(walks(attrs.evolve(given, stopping=StoppingRules(max_steps=3)))[0]) == 4


def test_one_that_says_so_reads_neither_compass_nor_odometer(name):
    ideal, noisy = (walks(experiment(name, senses=senses))[0] for senses in ("ideal", "ant compass_deg=60 speed=0.9"))
    navigator = spec(name).make(model=RandomHeadings())
    same = [decided(step) for step in ideal] == [decided(step) for step in noisy]
    assert same or getattr(navigator, "reads_senses", True)


@pytest.fixture(scope="module")
def model_file(tmp_path_factory) -> Path:
    """A model that has learned the route."""
    path = tmp_path_factory.mktemp("model") / "model.safetensors"
    with experiment("scan").opened() as trained:
        assert trained.model is not None
        save_model(trained.model, path)
    return path


def test_a_model_from_a_file_steers_or_is_refused_in_one_line(name, model_file):
    target = NAVIGATORS.find(name)
    if not (takes(target, "model") and getattr(spec(name).make(model=RandomHeadings()), "takes_trained", True)):
        with pytest.raises(SettingError) as refused:
            experiment(name, model=model_file)
        assert all(word in str(refused.value) for word in (f"'{name}", str(model_file)))
        assert "\n" not in str(refused.value)
        return
    (steps,) = walks(experiment(name, model=model_file, stopping__max_steps=3))
    (own,) = walks(experiment(name, stopping__max_steps=3))
    assert_same(steps, own)


def test_it_walks_home_when_models_are_compared(name):
    given = experiment(name)
    with given.open_renderer(WORLD) as renderer:
        positions = ROUTE.poses[::20, :2]
        (row,) = compare_models([MODELS.spec("perfect-memory")], given, renderer, ROUTE, positions)
    (last, *_) = reversed(walks(given)[0])
    assert row.arrived == (last.reason == "arrived")
    assert row.median_error_deg < 45


def test_the_command_that_compares_models_takes_any_navigator(name, capfd):
    walk = ["--world", "tiny", "--seed", 2, "--route-length-m", 1.6, "--size", "36x8", "--encoding", "grey"]
    result = printed(capfd, "compare", *walk, "--models", "random", "--navigator", spec(name))
    assert set(result["models"]) == {"random"}


def test_a_sweep_over_all_navigators_has_the_results_of_each_run_alone(tmp_path, cluster):
    base = Experiment(world="tiny", route_length=1.6, eye=EYE, stopping=StoppingRules(max_steps=STEPS), threads=1)
    specs = [spec(name) for name in NAMES]
    result = run_sweep(Sweep.over("", base, {"navigator": specs}), tmp_path, workers=cluster)
    table = pd.read_parquet(result["table"]).set_index("navigator")
    assert result["could_not_run"] == 0, table["error"].dropna().tolist()
    for each in specs:
        summary, row = base.replace(navigator=each).run().summary(), table.loc[str(each)]
        assert {name: None if pd.isna(row[name]) else row[name] for name in OF_STEERING} == {
            name: summary[name] for name in OF_STEERING
        }


@pytest.fixture(scope="module")
def databases(tmp_path_factory) -> tuple[Path, Path]:
    """Image databases of the route, and of the views around it."""
    folder = tmp_path_factory.mktemp("databases")
    low, high = ROUTE.xy.min(axis=0) - 0.4, ROUTE.xy.max(axis=0) + 0.4
    with open_renderer(WORLD, EYE, "cpu") as renderer:
        write_database(folder / "route", renderer, ROUTE.resampled(0.1).poses)
        write_database(folder / "grid", renderer, Grid.over(Bounds(*low.tolist(), *high.tolist()), 0.1))
    return folder / "route", folder / "grid"


def test_it_walks_over_image_databases(name, databases):
    route, grid = databases
    stopping = StoppingRules(max_steps=STEPS)
    given = Experiment(
        route_database=route, grid_database=grid, encoding="grey", navigator=spec(name), stopping=stopping, threads=1
    )
    (steps,) = walks(given)
    assert len(steps) > 3
    assert all(np.isfinite(step.aim) and step.view_distance is not None for step in steps)
    again, *_ = walks(given)
    assert_same(steps, again)
