"""The closed loop, learning, and starting up."""

import subprocess
import sys

import numpy as np
import pytest
import worlds

from tussock.navigation import Agent, Encoding, PerfectMemory, Recording, learn, make_model, training_poses
from tussock.navigation.training import training_views
from tussock.render import Eye, open_renderer
from tussock.world.routes import generate_route

SNAPSHOTS, STEPS, AGENTS = 200, 200, 32


@pytest.fixture(scope="module")
def walker():
    """An agent at 120 x 25 that knows a route by SNAPSHOTS views, and where these were taken."""
    _, world = worlds.everyday()
    route = generate_route(world, 1)
    encoding, memory = Encoding.named("edges"), PerfectMemory()
    with open_renderer(world, Eye(width=120, height=25), "cpu") as renderer:
        poses = learn(memory, encoding, renderer, training_poses(route.resampled(route.length / (SNAPSHOTS - 1))))
        agent = Agent(
            renderer=renderer, encoding=encoding, model=memory, route=route, max_steps=STEPS, arrive=0.01, lost=9.0, patience=99.0
        )  # fmt: skip
        yield agent, poses


def test_walk(measure, walker):
    agent, _ = walker
    steps = sum(1 for _ in agent.walk(agent.start()))
    measure(
        f"a step at 120 x 25, {SNAPSHOTS} snapshots",
        lambda: list(agent.walk(agent.start())),
        items=steps,
        unit="steps a second",
        rounds=7,
    )


def test_recorded_walk(measure, walker, tmp_path):
    agent, poses = walker

    def recorded() -> int:
        with Recording(
            tmp_path / "a.rrd", agent.renderer.world, agent.route, renderer=agent.renderer, training_poses=poses
        ) as recording:
            for count, step in enumerate(agent.walk(agent.start()), start=1):  # noqa: B007
                recording.log(step)
        return count

    measure("the same, recorded", recorded, items=recorded(), unit="steps a second", rounds=7)


def test_walks_side_by_side(measure, walker):
    agent, _ = walker
    starts = [agent.start(offset) for offset in np.linspace(-0.2, 0.2, AGENTS)]

    def walks() -> int:
        return sum(step is not None for steps in agent.walk_many(starts) for step in steps)

    measure(f"the same, {AGENTS} agents side by side", walks, items=walks(), unit="steps a second", rounds=3)


def test_training(measure, walker):
    agent, poses = walker
    views, _ = training_views(agent.encoding, agent.renderer, poses)
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
