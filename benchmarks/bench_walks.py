"""The closed loop, learning, and starting up."""

import subprocess
import sys

import numpy as np
import pytest
import worlds

from tussock import (
    Agent,
    Encoding,
    Eye,
    PerfectMemory,
    Recording,
    StoppingRules,
    compound_eye,
    generate_route,
    make_model,
    open_renderer,
    train,
    training_poses,
)
from tussock.navigation.training import training_views

SNAPSHOTS, STEPS, AGENTS = 200, 200, 32


@pytest.fixture(scope="module")
def agent():
    """An agent with an eye of 120 x 25 that has learned SNAPSHOTS views of a route."""
    _, world = worlds.everyday()
    route = generate_route(world, 1)
    stopping = StoppingRules(max_steps=STEPS, arrival_radius=0.01, max_deviation=9.0, patience=99.0)
    with open_renderer(world, Eye(width=120, height=25), "cpu") as renderer:
        poses = training_poses(route, route.length / (SNAPSHOTS - 1))
        trained = train(PerfectMemory(), Encoding.named("edges"), renderer, poses)
        yield Agent(renderer=renderer, trained=trained, route=route, stopping=stopping)


def test_walk(measure, agent):
    steps = sum(1 for _ in agent.walk(agent.start()))
    measure(
        f"a step at 120 x 25, {SNAPSHOTS} snapshots",
        lambda: list(agent.walk(agent.start())),
        items=steps,
        unit="steps a second",
        rounds=7,
    )


@pytest.mark.parametrize("name", ["720 x 150", "left half", "ant", "sphere ommatidia=1000"])
def test_walk_with_an_eye(measure, name):
    eyes = {"720 x 150": Eye(), "left half": Eye(side="left")}
    eye, (_, world) = eyes.get(name) or compound_eye(name), worlds.everyday()
    route = generate_route(world, 1)
    stopping = StoppingRules(max_steps=40, arrival_radius=0.01, max_deviation=9.0, patience=99.0)
    with open_renderer(world, eye, "cpu") as renderer:
        poses = training_poses(route, route.length / (SNAPSHOTS - 1))
        encoding = Encoding.named("sky", resize=1 if eye.compound is not None else 6)
        agent = Agent(
            renderer=renderer, trained=train(PerfectMemory(), encoding, renderer, poses), route=route, stopping=stopping
        )
        steps = sum(1 for _ in agent.walk(agent.start()))
        measure(
            f"a step with the eye: {name}, {SNAPSHOTS} snapshots",
            lambda: list(agent.walk(agent.start())),
            items=steps,
            unit="steps a second",
            rounds=3,
        )


def test_recorded_walk(measure, agent, tmp_path):
    path, poses = tmp_path / "a.rrd", agent.trained.poses

    def recorded() -> int:
        with Recording(path, agent.renderer, agent.route, training_poses=poses) as recording:
            for count, step in enumerate(agent.walk(agent.start()), start=1):  # noqa: B007
                recording.log(step)
        return count

    measure("the same, recorded", recorded, items=recorded(), unit="steps a second", rounds=7)


def test_walks_side_by_side(measure, agent):
    starts = [agent.start(offset) for offset in np.linspace(-0.2, 0.2, AGENTS)]

    def walks() -> int:
        return sum(step is not None for steps in agent.walk_many(starts) for step in steps)

    measure(f"the same, {AGENTS} agents side by side", walks, items=walks(), unit="steps a second", rounds=3)


def test_training(measure, agent):
    views, _ = training_views(agent.trained.encoding, agent.renderer, agent.trained.poses)
    measure(
        f"mlp-rotation learns {SNAPSHOTS} views of 120 x 25",
        lambda: make_model("mlp-rotation").fit(views),
        unit="s",
        rounds=3,
    )


@pytest.mark.parametrize("arguments", ["--help", "view --world tiny --out view.png"])
def test_start_up(measure, tmp_path, arguments):
    command = [sys.executable, "-m", "tussock", *arguments.split()]
    measure(
        f"tussock {arguments}",
        lambda: subprocess.run(command, check=True, capture_output=True, cwd=tmp_path),
        unit="s",
        rounds=5,
    )
