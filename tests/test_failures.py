"""Why walks fail: rooms built so that exactly one cause applies, and laws that hold for every diagnosis."""

import dataclasses
import re
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scenes import full_poses, random_poses, random_world, world_of

from tussock.navigation import failures
from tussock.navigation.agent import Agent
from tussock.navigation.body import Body
from tussock.navigation.encoding import Encoding
from tussock.navigation.failures import CATCHMENT, FAR, POOR, Cause, Diagnosis, Diagnostics, walk_cause
from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.learned_views import LearnedViews
from tussock.navigation.models import make_model
from tussock.navigation.models.base import recognises
from tussock.navigation.models.files import TrainedModel
from tussock.navigation.recording.log import Recording
from tussock.navigation.stopping import StoppingRules, StopReason
from tussock.navigation.training import train, training_views
from tussock.navigation.trajectory import COLUMNS, Trajectory
from tussock.navigation.walker import Step
from tussock.render.eye import Eye
from tussock.render.occlusion import covered_within
from tussock.render.renderer import open_renderer
from tussock.render.triangle_tree import tree_of
from tussock.world.errors import InputError
from tussock.world.geometry import Pose, Route

EYE = Eye(width=72, height=15, samples=2)
GREY = Encoding.parse("grey")
MIDDLES = (-2.0, 2.0)  # x of two rooms that are the same (m)


def quad(a, b, low: float, high: float) -> list:
    """An upright rectangle over the ground from a to b, as two triangles."""
    (x0, y0), (x1, y1) = a, b
    corners = [(x0, y0, low), (x1, y1, low), (x1, y1, high), (x0, y0, high)]
    return [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]


def ring(radius: float, heights, x: float, y: float, low: float = -0.02) -> list:
    """Upright panels around (x, y), one for each height, which make a closed ring."""
    angle = np.linspace(0, 2 * np.pi, len(heights) + 1)
    at = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
    return [each for k, high in enumerate(heights) for each in quad(at[k], at[k + 1], low, high)]


def rooms(tube: tuple[float, float] | None = None):
    """Two equal rooms, which also look the same after a quarter of a turn. Their walls hide everything else.

    tube: position of a tube. Its inside is 3 cm away and fills the lower 45 of 75 degrees of a view.
    """
    rng = np.random.default_rng(0)
    heights, tones = np.tile(rng.uniform(0.45, 0.9, 9), 4), np.tile(rng.integers(0, 200, 9), 4).repeat(2)
    triangles, grey = [], []
    for x in MIDDLES:
        triangles += ring(0.6, heights, x, 0.0)
        grey += list(tones)
    if tube:
        around = ring(0.03, [EYE.z + 0.03 * np.tan(np.radians(30))] * 36, *tube)
        triangles, grey = triangles + around, grey + [90] * len(around)
    return world_of(np.array(triangles), np.repeat(np.array(grey)[:, None], 3, axis=1))


def straight(y: float) -> Route:
    return Route.through(np.column_stack([np.linspace(-2.9, 2.9, 291), np.full(291, y)]))


def bent(corner: tuple[float, float]) -> Route:
    """A route that goes east until 4 cm past a position, then north."""
    (x, y), leg = corner, np.linspace(0.02, 1, 50)
    before = np.column_stack([x + 0.04 - leg[::-1], np.full(50, y)])
    return Route.through(np.vstack([before, [(x + 0.04, y)], np.column_stack([np.full(50, x + 0.04), y + leg])]))


@dataclasses.dataclass(frozen=True)
class Case:
    """Where an agent stands in the first room, what it has learned, and along which route.

    Its view equals the learned one, which was taken `turn` further around the middle of the room, when it turns by `turn`.

    Attributes:
        off: Position of the agent, from the middle of the first room (m).
        turn: Turn at which its view equals the learned one (rad).
        corner: The route turns here.
        tube: A tube stands around the agent.
        other_room: The view that is equal was learned in the other room, and a different one next to the agent.
    """

    off: tuple[float, float]
    turn: float = np.pi / 2
    corner: bool = False
    tube: bool = False
    other_room: bool = False

    @property
    def start(self) -> Pose:
        return Pose(MIDDLES[0] + self.off[0], self.off[1], 0.0)

    @property
    def route(self) -> Route:
        return bent(self.start[:2]) if self.corner else straight(self.start.y)

    @property
    def learned(self) -> np.ndarray:
        if self.other_room:
            x, y = self.off
            return np.array([(self.start.x + 0.2, self.start.y, 0.0), (MIDDLES[1] + x, y, -self.turn)])
        c, s = np.cos(self.turn), np.sin(self.turn)
        x, y = self.off
        return np.array([(MIDDLES[0] + c * x - s * y, s * x + c * y, 0.0)])


# A quarter of a turn around the middle is 0.2 m from NEAR, and 0.36 m from AWAY.
NEAR, AWAY = (0.1, 0.1), (0.18, 0.18)
CASES = {
    "unexplained": (Case(NEAR), Cause.UNEXPLAINED),
    "unexplained, elsewhere": (Case((-0.05, 0.13), -np.pi / 2), Cause.UNEXPLAINED),
    "occlusion": (Case(NEAR, tube=True), Cause.OCCLUSION),
    "occlusion, elsewhere": (Case((-0.05, 0.13), -np.pi / 2, tube=True), Cause.OCCLUSION),
    "off": (Case(AWAY), Cause.OFF_CATCHMENT),
    "off, to the other side": (Case((-0.1, 0.25), -np.pi / 2), Cause.OFF_CATCHMENT),
    "aliasing": (Case(NEAR, other_room=True), Cause.ALIASING),
    "aliasing, the other way": (Case((0.0, -0.2), -np.pi / 2, other_room=True), Cause.ALIASING),
    "unlearned": (Case((0.08, 0.06), np.pi), Cause.UNLEARNED),
    "unlearned, elsewhere": (Case((-0.1, 0.02), np.pi), Cause.UNLEARNED),
    "corner": (Case(NEAR, corner=True), Cause.CORNER),
    "corner, elsewhere": (Case((0.02, 0.12), corner=True), Cause.CORNER),
}
MODELS = ("perfect-memory", "chain", "opponent-perfect-memory", "rbm units=40 epochs=20")


@cache
def first_step(case: Case, model: str = "perfect-memory", mirror: bool = False) -> tuple[Step, Diagnosis | None]:
    """The first step of an agent in a case, and its diagnosis. mirror: everything is mirrored, the world too."""

    def seen(poses):
        return poses * np.array([1, -1, -1]) if mirror else poses

    world = rooms(case.start[:2] if case.tube else None)
    if mirror:
        world = dataclasses.replace(world, triangles=world.triangles * np.float32([1, -1, 1]))
    # The views were learned without the tube.
    bare = dataclasses.replace(rooms(), triangles=world.triangles[: len(rooms().triangles)])
    with open_renderer(bare, EYE, "cpu") as renderer:
        trained = train(make_model(model), GREY, renderer, seen(case.learned))
    with open_renderer(world, EYE, "cpu") as renderer:
        route = Route(seen(case.route.poses))
        agent = Agent(renderer=renderer, trained=trained, route=route, scan_width=2 * np.pi)
        step = next(agent.walk(Pose(*seen(np.array(case.start)).tolist())))
        return step, Diagnostics(renderer, trained, route).examine([step])[0]


class WithoutMatch:
    """A perfect memory that does not tell which view it recognises."""

    def __init__(self):
        self.memory = make_model("perfect-memory")

    def fit(self, views):
        self.memory.fit(views)
        return self

    def scan(self, views):
        return self.memory.scan(views)


def test_noise_does_not_change_what_was_recognised():
    """The recognised view is the one at the heading that was aimed at, not at the heading after noise, for every model."""
    world = random_world(np.random.default_rng(3))
    route = straight(0.0)
    diagnoses = []
    with open_renderer(world, EYE, "cpu") as renderer:
        for memory in (make_model("perfect-memory"), WithoutMatch()):
            trained = train(memory, GREY, renderer, route.resampled(0.1).poses)
            agent = Agent(
                renderer=renderer,
                trained=trained,
                route=route,
                body=Body(heading_noise=2.0),
                stopping=StoppingRules(max_steps=30),
            )
            diagnostics = Diagnostics(renderer, trained, route)
            diagnoses.append([diagnostics.examine([step])[0] for step in agent.walk(agent.start())])
    assert diagnoses[0] == diagnoses[1]
    assert sum(each is not None for each in diagnoses[0]) > 5


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", CASES)
def test_the_cause_is_the_one_that_applies(name, model):
    case, cause = CASES[name]
    step, diagnosis = first_step(case, model)
    assert (step.match is None) == (model not in ("perfect-memory", "chain"))
    assert diagnosis is not None
    assert diagnosis.cause == cause
    assert str(diagnosis).startswith(cause)
    # Exactly one threshold is passed, that of the cause.
    passed = {
        Cause.OCCLUSION: diagnosis.covered > failures.MAX_COVERED,
        Cause.OFF_CATCHMENT: diagnosis.nearest > CATCHMENT,
        Cause.ALIASING: diagnosis.recognised > FAR,
        Cause.UNLEARNED: abs(diagnosis.error) > failures.REVERSE,
        Cause.CORNER: diagnosis.turning > failures.CORNER_ANGLE,
    }
    assert [each for each, true in passed.items() if true] == [cause] * (cause != Cause.UNEXPLAINED)


@pytest.mark.parametrize("name", CASES)
def test_a_diagnosis_measures_what_the_room_was_built_for(name):
    case, _ = CASES[name]
    step, diagnosis = first_step(case)
    assert diagnosis is not None
    away = np.hypot(*(case.learned[:, :2] - case.start[:2]).T)
    assert np.isclose(diagnosis.nearest, away.min())
    assert np.isclose(diagnosis.recognised, away[-1])  # of two, the last is the one that is equal
    assert abs(abs(diagnosis.error) - abs(case.turn)) < np.radians(2 if case.tube else 0.5)
    assert diagnosis.error == step.error
    assert np.isclose(diagnosis.covered, 0.6 if case.tube else 0.0, atol=0.01)
    assert np.isclose(diagnosis.turning, np.arctan2(0.26, 0.04) if case.corner else 0.0, atol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_a_mirrored_world_gives_the_same_cause(name):
    case, cause = CASES[name]
    (_, diagnosis), (_, image) = first_step(case), first_step(case, mirror=True)
    assert diagnosis is not None
    assert image is not None
    assert image.cause == cause
    assert np.isclose(image.covered, diagnosis.covered)
    assert np.isclose(image.nearest, diagnosis.nearest)
    assert np.isclose(image.recognised, diagnosis.recognised)
    assert np.isclose(image.turning, diagnosis.turning)
    assert abs(abs(image.error) - abs(diagnosis.error)) < 1e-3


def test_a_control_that_recognises_nothing_fails_by_chance():
    """In the rooms where others have a cause: its headings do not depend on what it learned."""
    poor = [diagnosis for case, _ in CASES.values() if (diagnosis := first_step(case, "random")[1]) is not None]
    assert len(poor) > len(CASES) / 3
    assert {(each.cause, each.recognised) for each in poor} == {(Cause.UNEXPLAINED, None)}
    assert all("off the route's" in str(each) for each in poor)
    assert any(each.nearest > CATCHMENT for each in poor)
    told = {
        name: recognises(make_model(name))
        for name in ("random", "opponent-random", "hemifields-random", "infomax", "opponent-chain", "hemifields-chain")
    }
    assert told == {
        "random": False,
        "opponent-random": False,
        "hemifields-random": False,
        "infomax": True,
        "opponent-chain": True,
        "hemifields-chain": True,
    }
    assert recognises(WithoutMatch())


def test_a_good_step_has_no_diagnosis():
    assert first_step(Case(NEAR, turn=0.0))[1] is None
    # 60 degrees off the route's heading, but on the way back to it: 0.3 m ahead, from 0.4 m to its side.
    case = Case(NEAR, turn=0.0)
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        back = np.array([(*case.start[:2], np.radians(-60))])
        trained = train(make_model("perfect-memory"), GREY, renderer, back)
        for aside, good in ((0.4, True), (0.0, False), (-0.4, False)):
            route = straight(case.start.y - aside)
            agent = Agent(renderer=renderer, trained=trained, route=route, scan_width=2 * np.pi)
            step = next(agent.walk(case.start))
            assert abs(step.error) > POOR
            assert (Diagnostics(renderer, trained, route).examine([step]) == [None]) == good


def test_without_the_poses_of_views_the_rest_is_measured():
    case, _ = CASES["off"]
    step, _ = first_step(case)
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        model = train(make_model("perfect-memory"), GREY, renderer, case.learned).model
        trained = TrainedModel(model=model, encoding=GREY, eye=EYE, poses=None)
        diagnosis = Diagnostics(renderer, trained, case.route).examine([step])[0]
    assert diagnosis is not None
    assert (diagnosis.nearest, diagnosis.recognised) == (None, None)
    assert diagnosis.cause == Cause.UNEXPLAINED


POSES = np.column_stack([np.linspace(-2.3, -1.7, 4), np.zeros(4), np.zeros(4)])


@pytest.mark.parametrize(
    ("model", "poses"),
    [
        ("perfect-memory", POSES[:3]),
        ("perfect-memory", np.repeat(POSES, 2, axis=0)),
        ("chain", POSES[:3]),
        ("visual-compass", POSES[:3]),  # it keeps the last view
        ("perfect-memory", np.full((4, 3), np.nan)),
    ],
)
def test_the_poses_of_another_training_set_are_refused(model, poses):
    """So a recognised view cannot be looked up at the pose of another one."""
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        learned = train(make_model(model), GREY, renderer, POSES).model
    with pytest.raises(InputError, match="poses"):
        TrainedModel(model=learned, encoding=GREY, eye=EYE, poses=poses)


diagnoses = st.builds(
    Diagnosis,
    covered=st.floats(0, 1),
    nearest=st.none() | st.floats(0, 10),
    recognised=st.none() | st.floats(0, 10),
    error=st.floats(-np.pi, np.pi),
    turning=st.floats(0, np.pi),
)
ORDER = list(Cause)  # of several causes that apply, the first is taken


@given(diagnoses)
def test_left_and_right_have_the_same_cause(diagnosis):
    assert diagnosis.cause == dataclasses.replace(diagnosis, error=-diagnosis.error).cause
    assert str(diagnosis).startswith(diagnosis.cause)


@given(diagnoses, st.data())
def test_a_useless_view_comes_before_a_misleading_one(diagnosis, data):
    worse = dataclasses.replace(diagnosis, nearest=data.draw(st.floats(CATCHMENT * 1.01, 10)))
    assert ORDER.index(worse.cause) <= ORDER.index(diagnosis.cause)
    assert worse.cause in (Cause.OCCLUSION, Cause.OFF_CATCHMENT)
    assert dataclasses.replace(worse, covered=1.0).cause == Cause.OCCLUSION


def test_the_documentation_has_the_thresholds():
    text = (Path(__file__).parents[1] / "docs" / "failures.md").read_text()
    documented = {name: float(number) for name, number in re.findall(r"\| `([A-Z_]+)` \| ([0-9.]+)", text)}
    angles = {name: np.degrees(getattr(failures, name)) for name in ("POOR", "REVERSE", "CORNER_ANGLE")}
    others = ("OCCLUDER_DISTANCE", "MAX_COVERED", "CATCHMENT", "FAR", "CHORD", "RECOVERY")
    assert documented == pytest.approx(angles | {name: getattr(failures, name) for name in others})
    assert all(f"**{cause}**" in text for cause in Cause)


def test_agents_are_examined_side_by_side_as_they_are_alone(monkeypatch):
    """Also with the views that were learned, which then are not drawn again, and where a walk has ended."""
    world, route = random_world(np.random.default_rng(3)), straight(0.0)
    with open_renderer(world, EYE, "cpu") as renderer:
        drawn, render = [], renderer.render
        monkeypatch.setattr(renderer, "render", lambda poses: drawn.append(len(poses)) or render(poses))
        views, poses = training_views(GREY, renderer, route.resampled(0.1).poses)
        trained = TrainedModel(model=WithoutMatch().fit(views), encoding=GREY, eye=EYE, poses=poses)
        rules = StoppingRules(max_steps=12, max_deviation=0.25)
        agent = Agent(renderer=renderer, trained=trained, route=route, body=Body(heading_noise=2.0), stopping=rules)
        walk = list(agent.walk_many([agent.start(offset) for offset in (0.3, 0.0, 0.05)]))
        drawn.clear()
        given = Diagnostics(renderer, trained, route, views)
        together = [given.examine(steps) for steps in walk]
        assert sum(drawn) == 0
        alone = Diagnostics(renderer, trained, route)
        assert together == [[alone.examine([step])[0] for step in steps] for steps in walk]
        assert sum(drawn) == len(views)
        along = [[each and each[1] for each in steps] for steps in given.along(iter(walk))]
        assert along == together
        with pytest.raises(InputError, match="views"):
            Diagnostics(renderer, trained, route, views[1:])
    assert any(None in steps for steps in walk)
    assert len({each.recognised for steps in together for each in steps if each is not None}) > 3


def test_a_walk_that_breaks_off_leaves_what_it_walked():
    def broken():
        yield [step]
        raise InputError("broken")

    case, _ = CASES["off"]
    step, diagnosis = first_step(case)
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        walk = Diagnostics(renderer, None, case.route).along(broken())
        ((same, examined),) = next(walk)
        with pytest.raises(InputError, match="broken"):
            next(walk)
    assert same is step
    assert examined.error == diagnosis.error


@pytest.mark.parametrize("mask", [None, "pixels", "normalised"])
def test_the_nearest_learned_view_is_that_of_perfect_memory(mask):
    random = torch.Generator().manual_seed(1)
    views, looks = torch.randn(40, 5, 12, generator=random), torch.randn(30, 5, 12, generator=random)
    if mask is not None:
        mask = FeatureMask(torch.rand(5, 12, generator=random) < 0.6, normalised=mask == "normalised")
    memory, learned = make_model("perfect-memory").see(mask).fit(views), LearnedViews(views, mask)
    turns = (np.arange(30) - 15) * 2 * np.pi / 12
    _, index = memory.match(looks)
    assert learned.nearest(zip(looks, turns, strict=True)) == [int(index[k, (k - 15) % 12]) for k in range(30)]


def test_rounding_does_not_decide_which_learned_view_is_the_nearest():
    """They differ by less than a product in float32 is exact to. Of equal ones it is the first, whatever is compared at the same time."""
    random = torch.Generator().manual_seed(2)
    views = (100 + 0.01 * torch.randn(50, 3, 8, generator=random)).repeat(3, 1, 1)
    looks = [(view, 0.0) for view in views[:40] + 1e-4 * torch.randn(40, 3, 8, generator=random)]
    learned = LearnedViews(views, None)
    assert learned.nearest(looks) == [learned.nearest([look])[0] for look in looks] == list(range(40))


@pytest.mark.parametrize("n", [0, 1, 31, 33, 9000])
def test_the_tree_finds_the_triangles_in_a_box(n):
    rng = np.random.default_rng(n)
    corners = rng.uniform(0, 2, (n, 1, 3)) + rng.uniform(-0.1, 0.1, (n, 3, 3))
    world = world_of(corners, np.zeros((n, 3)))
    triangles = world.surfaces()[0]
    middle = rng.uniform(-0.1, 2.1, (40, 3))
    low, high = middle - rng.uniform(0, 0.2, (40, 1)), middle + 0.1
    overlap = (triangles.min(axis=1) < high[:, None]) & (triangles.max(axis=1) > low[:, None])
    which, found = tree_of(world).within(low, high)
    assert list(zip(which, found, strict=True)) == list(zip(*np.nonzero(overlap.all(axis=2)), strict=True))
    assert tree_of(world) is tree_of(world)


class FixedTurn:
    """A model that keeps no views and always turns by the same number of columns."""

    def __init__(self, columns: int):
        self.columns = columns

    def fit(self, views):
        return self

    def scan(self, views):
        scan = GREY(np.zeros((len(views), 1, views.shape[-1], 4), dtype=np.uint8))[:, 0]
        scan[:, self.columns] = 1
        return scan


def walked(start: Pose, *, columns: int = 0, noise: float = 0.0, **stopping) -> tuple[list[Step], Trajectory]:
    """Steps and trajectory of a walk in the first room. Its route, where views were learned, is straight through the middle."""
    route = Route.through(np.column_stack([np.linspace(-2.5, -1.5, 51), np.zeros(51)]))
    steps, trajectory = [], Trajectory()
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        trained = TrainedModel(model=FixedTurn(columns), encoding=GREY, eye=EYE, poses=route.poses)
        agent = Agent(
            renderer=renderer,
            trained=trained,
            route=route,
            scan_width=2 * np.pi,
            body=Body(heading_noise=noise),
            stopping=StoppingRules(**stopping),
        )
        diagnostics = Diagnostics(renderer, trained, route)
        for step in agent.walk(start):
            steps.append(step)
            trajectory.add(step, diagnostics.examine([step])[0])
    return steps, trajectory


def test_a_failed_step_has_a_diagnosis_even_with_a_good_heading():
    steps, trajectory = walked(Pose(-2.5, 0.28, 0.1), max_deviation=0.3)  # walks away from the route, a little
    assert steps[-1].reason == steps[-1].failure == StopReason.LOST
    assert not any(step.failure for step in steps[:-1])
    assert abs(steps[-1].error) < POOR
    assert trajectory.column("cause") == [""] * (len(steps) - 1) + [Cause.OFF_CATCHMENT]
    summary = trajectory.summary()
    assert summary["cause"] == Cause.OFF_CATCHMENT
    assert (summary["poor_steps"], summary["causes"]) == (1, {Cause.OFF_CATCHMENT: 1})


def test_an_arrived_walk_has_no_cause_and_one_that_was_put_back_has():
    steps, trajectory = walked(Pose(-2.5, 0.0, 0.0))
    assert steps[-1].reason == StopReason.ARRIVED
    assert steps[-1].failure is None
    assert trajectory.summary()["cause"] is None
    assert trajectory.summary()["causes"] == {}
    steps, trajectory = walked(Pose(-2.5, 0.28, 0.1), max_deviation=0.3, put_back=True)
    assert steps[-1].reason == StopReason.ARRIVED
    failed = [step.index for step in steps if step.failure]
    assert failed == [step.index - 1 for step in steps if step.reset]
    assert len(failed) == 1
    assert all(step.reason is None for step in steps[:-1])
    assert trajectory.summary()["cause"] == Cause.OFF_CATCHMENT


A, C, OFF, X, U = Cause.ALIASING, Cause.CORNER, Cause.OFF_CATCHMENT, Cause.UNEXPLAINED, Cause.UNLEARNED


@pytest.mark.parametrize(
    ("along", "causes", "failed", "expected"),
    [
        ([0, 1, 2], ["", "", ""], [0, 0, 0], None),
        ([0, 1, 2], ["", C, ""], [0, 0, 0], None),  # it arrived in spite of a poor step
        ([0, 1, 1], ["", "", C], [0, 0, 1], C),
        # What came before half a metre of good steps does not count.
        ([0, 0.1, 0.2, 0.9, 1], [A, A, "", "", C], [0, 0, 0, 0, 1], C),
        ([0, 0.1, 0.2, 0.3, 0.4], [A, A, "", "", C], [0, 0, 0, 0, 1], A),
        # Going back and forth is not progress.
        ([1, 1.1, 0.2, 0.9, 1], [A, A, "", "", C], [0, 0, 0, 0, 1], A),
        # Led off by something else, and off from the beginning.
        ([0, 0.1, 0.1, 0.1], [C, OFF, OFF, OFF], [0, 0, 0, 1], C),
        ([0, 0.1, 0.1, 0.1], [OFF, OFF, OFF, C], [0, 0, 0, 1], OFF),
        ([0, 0, 0], [X, X, U], [0, 0, 1], U),
        ([0, 0, 0], [X, "", X], [0, 0, 1], X),
        # One cause for each failure.
        ([0, 0, 0, 0, 0], [A, A, A, C, C], [0, 0, 1, 1, 1], C),
        ([0, 0, 0], ["", "", ""], [0, 0, 1], None),  # nothing was measured
    ],
)
def test_the_cause_of_a_walk(along, causes, failed, expected):
    assert walk_cause(along, causes, [bool(each) for each in failed]) == expected


def test_equal_walks_leave_equal_bytes(tmp_path):
    for name in ("a.csv", "b.csv"):
        _, trajectory = walked(Pose(-2.3, 0.0, 0.0), columns=9, max_deviation=0.3, patience=1.0, noise=0.1)
        trajectory.write(tmp_path / name)
        assert trajectory.summary()["poor_steps"] > 3
    written = (tmp_path / "a.csv").read_bytes()
    assert written == (tmp_path / "b.csv").read_bytes()
    for line in written.decode().splitlines()[1:]:
        row = dict(zip(COLUMNS, line.split(","), strict=True))
        measured = [row[name] for name in ("covered", "nearest_view_m", "recognised_view_m", "turning_deg", "cause")]
        assert all(measured) or not any(measured)


def test_a_recording_shows_the_cause_where_it_happens(tmp_path):
    from test_recording import rerun

    case, _ = CASES["aliasing"]
    step, diagnosis = first_step(case)
    with (
        open_renderer(rooms(), EYE, "cpu") as renderer,
        Recording(tmp_path / "r.rrd", renderer, case.route) as recording,
    ):
        recording.log(step, diagnosis)
    rerun("rrd", "verify", tmp_path / "r.rrd")
    printed = rerun("rrd", "print", "-vvv", tmp_path / "r.rrd")
    assert "step 0: aliasing, the view it recognises was learned 4.00 m away" in printed
    assert "/world/causes/aliasing" in printed


@pytest.mark.parametrize("double_sided", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_the_share_covered_is_what_a_renderer_draws(seed, double_sided):
    """Where the whole world is near, its share of a view is the alpha that the scanlines draw."""
    world = random_world(seed, n=400, ground=False, double_sided=double_sided)
    eye = Eye(width=72, height=15, samples=1)
    within = 10.0  # all of it
    with open_renderer(world, eye, "cpu") as renderer:
        for x, y, _ in random_poses(4, seed):
            drawn = renderer.render([(x, y, 0.0)])[0, ..., 3] > 127
            assert covered_within(world, eye, [Pose(x, y, 0.0)], within) == drawn.mean()
        for pose in full_poses(world.field, 4):
            drawn = renderer.render(pose[None])[0, ..., 3] > 127
            assert covered_within(world, eye, pose[None], within) == drawn.mean()


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_wall_covers_what_is_within_the_distance(double_sided):
    eye = Eye(width=72, height=1, samples=2, top=np.radians(2.5), bottom=np.radians(-2.5))
    wall = np.array(quad((-3.0, 0.03), (3.0, 0.03), -1, 1))  # its front towards the south
    world = world_of(wall, np.zeros((2, 3)), double_sided=double_sided)
    share = 2 * np.arccos(0.03 / 0.05) / (2 * np.pi)
    assert abs(covered_within(world, eye, [Pose(0.0, 0.0, 1.0)], 0.05) - share) <= 1 / 72
    assert abs(covered_within(world, eye, [Pose(0.0, 0.06, 1.0)], 0.05) - share * double_sided) <= 1 / 72
    assert covered_within(world, eye, [Pose(0.0, -0.03, 1.0)], 0.05) == 0
    # How the wall is cut into triangles does not matter.
    corners = [(x, 0.03) for x in np.linspace(-3, 3, 200)]
    cut = [each for a, b in pairwise(corners) for each in quad(a, b, -1, 1)]
    finer = world_of(np.array(cut), np.zeros((len(cut), 3)), double_sided=double_sided)
    covered, again = (covered_within(each, eye, [Pose(0.0, 0.0, 1.0)], 0.05) for each in (world, finer))
    assert covered == again


def test_the_ground_does_not_occlude():
    world = world_of(np.empty((0, 3, 3)), np.empty((0, 3)))
    assert len(world.surfaces()[0])  # there is ground, nearer than that
    assert covered_within(world, EYE, [Pose(0.0, 0.0, 0.0)], 1.0) == 0
