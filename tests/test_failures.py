"""Why walks fail: rooms built so that exactly one cause applies, and what holds of every label."""

import dataclasses
import re
from itertools import pairwise
from pathlib import Path

import attrs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import random_poses, random_world, world_of

from tussock.navigation import failures
from tussock.navigation.encoding import Encoding
from tussock.navigation.failures import (
    ALIASING,
    CATCHMENT,
    CAUSES,
    CORNER,
    COVERED,
    FAR,
    OCCLUDER,
    OCCLUSION,
    OFF_CATCHMENT,
    POOR,
    REVERSE,
    TURNING,
    UNEXPLAINED,
    UNLEARNED,
    Evidence,
    Witness,
    cause,
    in_words,
    walk_cause,
)
from tussock.navigation.models import make_model
from tussock.navigation.recording.log import Recording
from tussock.navigation.training import learn
from tussock.navigation.trajectory import COLUMNS, Trajectory
from tussock.navigation.walk import ARRIVED, LOST, Agent
from tussock.render.eye import Eye
from tussock.render.occlusion import covered_within
from tussock.render.renderer import open_renderer
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
    """Upright panels around a place, of as many heights; the ring they make is closed."""
    angle = np.linspace(0, 2 * np.pi, len(heights) + 1)
    at = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
    return [each for k, high in enumerate(heights) for each in quad(at[k], at[k + 1], low, high)]


def rooms(tube: tuple[float, float] | None = None):
    """Two rooms that look the same from within, and the same after a quarter of a turn; so high that nothing else is seen from them.

    tube: where a tube stands whose inside is 3 cm away and fills the lower 45 of 75 degrees of a view.
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


def bent(at: tuple[float, float]) -> Route:
    """A route that goes east until 4 cm past a place, then north."""
    (x, y), leg = at, np.linspace(0.02, 1, 50)
    before = np.column_stack([x + 0.04 - leg[::-1], np.full(50, y)])
    return Route.through(np.vstack([before, [(x + 0.04, y)], np.column_stack([np.full(50, x + 0.04), y + leg])]))


@dataclasses.dataclass(frozen=True)
class Case:
    """Where an agent stands in the first room, what was learned, and along which route.

    The view it has, turned by -turn, is the one that was learned `turn` around the middle of the room: it heads there.
    """

    off: tuple[float, float]  # m, from the middle of the first room
    turn: float = np.pi / 2  # rad
    corner: bool = False
    tube: bool = False
    other_room: bool = (
        False  # the view that is the same was learned in the other room, and another one beside the agent
    )

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

    def mirrored(self) -> "Case":
        return dataclasses.replace(self, off=(self.off[0], -self.off[1]), turn=-self.turn)


NEAR, AWAY = (
    (0.1, 0.1),
    (0.18, 0.18),
)  # a quarter of a turn around the middle is 0.2 m from the one, 0.36 m from the other
CASES = {
    "unexplained": (Case(NEAR), UNEXPLAINED),
    "unexplained, elsewhere": (Case((-0.05, 0.13), -np.pi / 2), UNEXPLAINED),
    "occlusion": (Case(NEAR, tube=True), OCCLUSION),
    "occlusion, elsewhere": (Case((-0.05, 0.13), -np.pi / 2, tube=True), OCCLUSION),
    "off": (Case(AWAY), OFF_CATCHMENT),
    "off, to the other side": (Case((-0.1, 0.25), -np.pi / 2), OFF_CATCHMENT),
    "aliasing": (Case(NEAR, other_room=True), ALIASING),
    "aliasing, the other way": (Case((0.0, -0.2), -np.pi / 2, other_room=True), ALIASING),
    "unlearned": (Case((0.08, 0.06), np.pi), UNLEARNED),
    "unlearned, elsewhere": (Case((-0.1, 0.02), np.pi), UNLEARNED),
    "corner": (Case(NEAR, corner=True), CORNER),
    "corner, elsewhere": (Case((0.02, 0.12), corner=True), CORNER),
}
MODELS = ("perfect-memory", "chain", "opponent-perfect-memory", "rbm")


def looks(case: Case, model: str = "perfect-memory", mirror: bool = False):
    """The first step that an agent takes in a case, and the evidence of it. mirror: everything, the world too, is mirrored."""

    def seen(poses):
        return poses * np.array([1, -1, -1]) if mirror else poses

    world = rooms(case.start[:2] if case.tube else None)
    if mirror:
        world = dataclasses.replace(world, triangles=world.triangles * np.float32([1, -1, 1]))
    learner, poses = make_model(model), seen(case.learned)
    # What was learned was learned without the tube.
    bare = dataclasses.replace(rooms(), triangles=world.triangles[: len(rooms().triangles)])
    with open_renderer(bare, EYE, "cpu") as renderer:
        learn(learner, GREY, renderer, poses)
    with open_renderer(world, EYE, "cpu") as renderer:
        route = Route(seen(case.route.poses))
        agent = Agent(renderer=renderer, encoding=GREY, model=learner, route=route, scan=2 * np.pi)
        step = next(agent.walk(Pose(*seen(np.array(case.start)).tolist())))
        return step, Witness(renderer, GREY, route, poses).evidence(step)


class Unnamed:
    """A perfect memory that does not say which view it recognises."""

    def __init__(self):
        self.memory = make_model("perfect-memory")

    def fit(self, views):
        self.memory.fit(views)
        return self

    def scan(self, views):
        return self.memory.scan(views)


def test_noise_does_not_change_what_was_recognised():
    """The view that an agent aims at is asked for, whoever has to find it, not one at the heading that noise has made of it."""
    world = random_world(np.random.default_rng(3))
    route = straight(0.0)
    found = []
    with open_renderer(world, EYE, "cpu") as renderer:
        for memory in (make_model("perfect-memory"), Unnamed()):
            poses = learn(memory, GREY, renderer, route.resampled(0.1).poses)
            agent = Agent(renderer=renderer, encoding=GREY, model=memory, route=route, heading_noise=2.0, max_steps=30)
            witness = Witness(renderer, GREY, route, poses)
            found.append([witness.evidence(step) for step in agent.walk(agent.start())])
    assert found[0] == found[1]
    assert sum(each is not None for each in found[0]) > 5


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", CASES)
def test_the_label_is_the_one_cause_that_applies(name, model):
    case, label = CASES[name]
    step, evidence = looks(case, model)
    assert (step.match is None) == (model not in ("perfect-memory", "chain"))
    assert evidence is not None
    assert cause(evidence) == label
    assert in_words(evidence).startswith(label)
    # Exactly one of the thresholds is passed, the label's.
    passed = {
        OCCLUSION: evidence.covered > COVERED, OFF_CATCHMENT: evidence.nearest > CATCHMENT, ALIASING: evidence.recognised > FAR,
        UNLEARNED: abs(evidence.error) > REVERSE, CORNER: evidence.turning > TURNING,
    }  # fmt: skip
    assert [each for each, true in passed.items() if true] == [label] * (label != UNEXPLAINED)


@pytest.mark.parametrize("name", CASES)
def test_evidence_is_what_the_room_was_built_for(name):
    case, _ = CASES[name]
    step, evidence = looks(case)
    assert evidence is not None
    away = np.hypot(*(case.learned[:, :2] - case.start[:2]).T)
    assert np.isclose(evidence.nearest, away.min())
    assert np.isclose(evidence.recognised, away[-1])  # of two, the last is the one that is the same
    assert abs(abs(evidence.error) - abs(case.turn)) < np.radians(2 if case.tube else 0.5)
    assert evidence.error == step.error
    assert np.isclose(evidence.covered, 0.6 if case.tube else 0.0, atol=0.01)
    assert np.isclose(evidence.turning, np.arctan2(0.26, 0.04) if case.corner else 0.0, atol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_a_mirrored_world_gives_the_same_label(name):
    case, label = CASES[name]
    (_, evidence), (_, image) = looks(case), looks(case, mirror=True)
    assert evidence is not None
    assert image is not None
    assert cause(image) == label
    assert np.isclose(image.covered, evidence.covered)
    assert np.isclose(image.nearest, evidence.nearest)
    assert np.isclose(image.recognised, evidence.recognised)
    assert np.isclose(image.turning, evidence.turning)
    assert abs(abs(image.error) - abs(evidence.error)) < 1e-3


def test_a_good_step_has_no_evidence():
    assert looks(Case(NEAR, turn=0.0))[1] is None
    # 60 degrees off the route's heading, but on the way back to it: 0.3 m ahead from 0.4 m beside it.
    case = Case(NEAR, turn=0.0)
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        memory, back = make_model("perfect-memory"), np.array([(*case.start[:2], np.radians(-60))])
        learn(memory, GREY, renderer, back)
        for beside, good in ((0.4, True), (0.0, False), (-0.4, False)):
            route = straight(case.start.y - beside)
            agent = Agent(renderer=renderer, encoding=GREY, model=memory, route=route, scan=2 * np.pi)
            step = next(agent.walk(case.start))
            assert abs(step.error) > POOR
            assert (Witness(renderer, GREY, route, back).evidence(step) is None) == good


def test_without_the_places_of_views_the_evidence_is_what_remains():
    case, _ = CASES["off"]
    step, _ = looks(case)
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        evidence = Witness(renderer, GREY, case.route).evidence(step)
    assert evidence is not None
    assert (evidence.nearest, evidence.recognised) == (None, None)
    assert cause(evidence) == UNEXPLAINED


numbers = st.floats(allow_nan=False)
evidences = st.builds(
    Evidence, covered=st.floats(0, 1), nearest=st.none() | st.floats(0, 10), recognised=st.none() | st.floats(0, 10),
    error=st.floats(-np.pi, np.pi), turning=st.floats(0, np.pi),
)  # fmt: skip


@given(evidences)
def test_left_and_right_have_the_same_cause(evidence):
    assert cause(evidence) in CAUSES
    assert cause(evidence) == cause(dataclasses.replace(evidence, error=-evidence.error))
    assert in_words(evidence).startswith(cause(evidence))


@given(evidences, st.data())
def test_what_comes_first_wins(evidence, data):
    """Adding what makes the view useless never gives way to what only misleads."""
    worse = dataclasses.replace(evidence, nearest=data.draw(st.floats(CATCHMENT * 1.01, 10)))
    assert CAUSES.index(cause(worse)) <= CAUSES.index(cause(evidence))
    assert cause(worse) in (OCCLUSION, OFF_CATCHMENT)
    assert cause(dataclasses.replace(worse, covered=1.0)) == OCCLUSION


def test_thresholds_are_what_the_documentation_says():
    text = (Path(__file__).parents[1] / "docs" / "failures.md").read_text()
    said = {name: float(number) for name, number in re.findall(r"\| `([A-Z]+)` \| ([0-9.]+)", text)}
    here = {
        "OCCLUDER": OCCLUDER,
        "COVERED": COVERED,
        "CATCHMENT": CATCHMENT,
        "FAR": FAR,
        "REACH": failures.REACH,
        "SOUND": failures.SOUND,
    }
    here |= {"POOR": np.degrees(POOR), "REVERSE": np.degrees(REVERSE), "TURNING": np.degrees(TURNING)}
    assert said == pytest.approx(here)
    assert all(f"**{label}**" in text for label in CAUSES)


# Of whole walks.


class Ahead:
    """A model that keeps no views and always turns by so many columns."""

    def __init__(self, columns: int):
        self.columns = columns

    def fit(self, views):
        return self

    def scan(self, views):
        scan = GREY(np.zeros((len(views), 1, views.shape[-1], 4), dtype=np.uint8))[:, 0]
        scan[:, self.columns] = 1
        return scan


def walked(start: Pose, *, columns: int = 0, **settings) -> tuple[list, Trajectory]:
    """Steps and trajectory of an agent in the first room, on a straight route through its middle where views were learned."""
    route = Route.through(np.column_stack([np.linspace(-2.5, -1.5, 51), np.zeros(51)]))
    with open_renderer(rooms(), EYE, "cpu") as renderer:
        agent = Agent(renderer=renderer, encoding=GREY, model=Ahead(columns), route=route, scan=2 * np.pi, **settings)
        witness, steps, trajectory = Witness(renderer, GREY, route, route.poses), [], Trajectory()
        for step in agent.walk(start):
            steps.append(step)
            trajectory.add(step, witness.evidence(step))
    return steps, trajectory


def test_a_failed_step_has_evidence_however_good_its_heading():
    steps, trajectory = walked(Pose(-2.5, 0.28, 0.1), lost=0.3)  # walks away from the route, a little
    assert steps[-1].reason == steps[-1].failure == LOST
    assert not any(step.failure for step in steps[:-1])
    assert abs(steps[-1].error) < POOR
    assert trajectory.column("cause") == [""] * (len(steps) - 1) + [OFF_CATCHMENT]
    summary = trajectory.summary()
    assert (summary["cause"], summary["poor_steps"], summary["causes"]) == (OFF_CATCHMENT, 1, {OFF_CATCHMENT: 1})


def test_an_arrived_walk_has_no_cause_and_one_that_was_put_back_has():
    steps, trajectory = walked(Pose(-2.5, 0.0, 0.0))
    assert steps[-1].reason == ARRIVED
    assert steps[-1].failure is None
    assert trajectory.summary()["cause"] is None
    assert trajectory.summary()["causes"] == {}
    steps, trajectory = walked(Pose(-2.5, 0.28, 0.1), lost=0.3, reset_when_lost=True)
    assert steps[-1].reason == ARRIVED
    failed = [step.index for step in steps if step.failure]
    assert failed == [step.index - 1 for step in steps if step.reset]
    assert len(failed) == 1
    assert all(step.reason is None for step in steps[:-1])
    assert trajectory.summary()["cause"] == OFF_CATCHMENT


@pytest.mark.parametrize(
    ("along", "causes", "failed", "expected"),
    [
        ([0, 1, 2], ["", "", ""], [0, 0, 0], None),
        ([0, 1, 2], ["", CORNER, ""], [0, 0, 0], None),  # it arrived in spite of a poor step
        ([0, 1, 1], ["", "", CORNER], [0, 0, 1], CORNER),
        # What came before half a metre of good steps has nothing to do with it.
        ([0, 0.1, 0.2, 0.9, 1], [ALIASING, ALIASING, "", "", CORNER], [0, 0, 0, 0, 1], CORNER),
        ([0, 0.1, 0.2, 0.3, 0.4], [ALIASING, ALIASING, "", "", CORNER], [0, 0, 0, 0, 1], ALIASING),
        # Going back and forth is no progress.
        ([1, 1.1, 0.2, 0.9, 1], [ALIASING, ALIASING, "", "", CORNER], [0, 0, 0, 0, 1], ALIASING),
        # Led off by something else, or off from the beginning.
        ([0, 0.1, 0.1, 0.1], [CORNER, OFF_CATCHMENT, OFF_CATCHMENT, OFF_CATCHMENT], [0, 0, 0, 1], CORNER),
        ([0, 0.1, 0.1, 0.1], [OFF_CATCHMENT, OFF_CATCHMENT, OFF_CATCHMENT, CORNER], [0, 0, 0, 1], OFF_CATCHMENT),
        ([0, 0, 0], [UNEXPLAINED, UNEXPLAINED, UNLEARNED], [0, 0, 1], UNLEARNED),
        ([0, 0, 0], [UNEXPLAINED, "", UNEXPLAINED], [0, 0, 1], UNEXPLAINED),
        # A cause a failure.
        ([0, 0, 0, 0, 0], [ALIASING, ALIASING, ALIASING, CORNER, CORNER], [0, 0, 1, 1, 1], CORNER),
        ([0, 0, 0], ["", "", ""], [0, 0, 1], None),  # nobody looked into it
    ],
)
def test_the_cause_of_a_walk(along, causes, failed, expected):
    assert walk_cause(along, causes, [bool(each) for each in failed]) == expected


def test_equal_walks_leave_equal_bytes(tmp_path):
    for name in ("a.csv", "b.csv"):
        _, trajectory = walked(Pose(-2.3, 0.0, 0.0), columns=9, lost=0.3, patience=1.0, heading_noise=0.1)
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
    step, evidence = looks(case)
    with Recording(tmp_path / "r.rrd", rooms(), case.route) as recording:
        recording.log(step, evidence)
    rerun("rrd", "verify", tmp_path / "r.rrd")
    printed = rerun("rrd", "print", "-vvv", tmp_path / "r.rrd")
    assert "step 0: aliasing, the view it recognises was learned 4.00 m away" in printed
    assert "/world/causes/aliasing" in printed


# What is very near to an eye.


@pytest.mark.parametrize("double_sided", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_near_is_what_a_renderer_draws_of_it(seed, double_sided):
    """Where all of a world is near, its share of a view is what the scanlines draw: alpha."""
    world = random_world(seed, n=400, ground=False, double_sided=double_sided)
    eye = attrs.evolve(EYE, width=72, height=15, samples=1)
    within = 10.0  # all of it
    with open_renderer(world, eye, "cpu") as renderer:
        for x, y, _ in random_poses(4, seed):
            drawn = renderer.render([(x, y, 0.0)])[0, ..., 3] > 127
            assert covered_within(world, eye, Pose(x, y, 0.0), within) == drawn.mean()


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_wall_covers_what_is_within_the_distance(double_sided):
    eye = attrs.evolve(EYE, top=np.radians(2.5), bottom=np.radians(-2.5), height=1)
    wall = np.array(quad((-3.0, 0.03), (3.0, 0.03), -1, 1))  # its front towards the south
    world = world_of(wall, np.zeros((2, 3)), double_sided=double_sided)
    share = 2 * np.arccos(0.03 / 0.05) / (2 * np.pi)
    assert abs(covered_within(world, eye, Pose(0.0, 0.0, 1.0), 0.05) - share) <= 1 / 72
    assert abs(covered_within(world, eye, Pose(0.0, 0.06, 1.0), 0.05) - share * double_sided) <= 1 / 72
    assert covered_within(world, eye, Pose(0.0, -0.03, 1.0), 0.05) == 0
    # How the wall is cut into triangles does not matter.
    corners = [(x, 0.03) for x in np.linspace(-3, 3, 200)]
    cut = [each for a, b in pairwise(corners) for each in quad(a, b, -1, 1)]
    finer = world_of(np.array(cut), np.zeros((len(cut), 3)), double_sided=double_sided)
    assert covered_within(finer, eye, Pose(0.0, 0.0, 1.0), 0.05) == covered_within(
        world, eye, Pose(0.0, 0.0, 1.0), 0.05
    )


def test_the_ground_is_no_occluder():
    world = world_of(np.empty((0, 3, 3)), np.empty((0, 3)))
    assert len(world.surfaces()[0])  # there is ground, nearer than that
    assert covered_within(world, EYE, Pose(0.0, 0.0, 0.0), 1.0) == 0
