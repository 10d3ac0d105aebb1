"""Le Moel and Wystrach 2020: how near the nest agents stay that steer by attractive and repulsive memories of a learning walk."""

import math
from typing import Any

import numpy as np
import pandas as pd

from tussock.render.eye import Eye
from tussock.world.geometry import Route

from ...body import Body
from ...experiment import Experiment
from ...experiment_fields import as_navigator
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import distances_over_steps, heat_maps
from .protocol import Item, Parameter, Protocol

LEARNING_WALKS = (0.5, 2.0, 8.0)  # m
BASELINES, GAINS = (0, 45, 90, 135, 180), (0, 10, 100, 1_000, 10_000, 100_000)  # degrees
DISTANCES = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # m
WORLDS, RELEASES = 6, 6  # the paper's 36 releases at each distance
AT_NEST = 0.001  # m, for a distance of 0: a release needs a direction
STEPS, RING_STEPS, RING, AGENTS = 320, 150, 5.0, 10
EVERY = 10  # steps of a curve
LAST_PART = 0.2  # share of the steps at the end of a walk
NEST, WAY = 50.0, 10.0  # m: x and y of the nest, in the middle of the world; length of the way to it
MEMORIES = {  # with one memory alone, baselines that let an agent walk straight on in a familiar direction
    str(as_navigator(f"opponent {more}")): name
    for name, more in {
        "both": "",
        "attractive": "memories=attractive baseline_deg=0",
        "repulsive": "memories=repulsive baseline_deg=180",
    }.items()
}
GRID = {
    str(as_navigator(f"opponent baseline_deg={baseline} gain_deg={gain}")): (baseline, gain)
    for baseline in BASELINES
    for gain in GAINS
}
SPREADS = (0, 135)  # degrees
LEARNED, BASELINE, GAIN, RELEASED = "learning walk (m)", "baseline (degrees)", "gain (degrees)", "released at (m)"
FINAL, MEAN = "distance at the end (m)", "mean distance (m)"
MEANS: Any = {"walks": ("final_m", "size"), FINAL: ("final_m", "mean"), MEAN: ("mean_m", "mean")}
CHOSEN_BASELINE = 90


def of_walk(row: dict[str, Any], steps: pd.DataFrame) -> dict[str, float]:
    """Distance of a walk from the nest (m): over its last part, over all of it, and, of the release test, every few steps.

    A walk that has left the world stays where it left it.
    """
    distance = steps["goal_m"].to_numpy()
    whole = np.pad(distance, (0, max(0, row["max_steps"] + 1 - len(distance))), mode="edge")
    last = whole[-round(LAST_PART * row["max_steps"]) :]
    curve = whole[::EVERY] if row["max_steps"] == RING_STEPS else []
    return {"final_m": float(last.mean()), "mean_m": float(whole.mean())} | {
        f"at_{EVERY * k}": float(each) for k, each in enumerate(curve)
    }


def measure(walks: pd.DataFrame) -> StudyResults:
    """Distances of the grid, and of the release test over its steps."""
    ring = walks[walks["max_steps"] == RING_STEPS]
    ring = ring.assign(
        memories=[MEMORIES[each] for each in ring["navigator"]], spread=ring["goal_spread_deg"].round().astype(int)
    )
    grid = walks[walks["max_steps"] == STEPS]
    settings = np.array([GRID[each] for each in grid["navigator"]])
    grid = grid.assign(
        **{
            LEARNED: grid["goal_walk_m"].astype(float),
            BASELINE: settings[:, 0],
            GAIN: settings[:, 1],
            RELEASED: grid["release_m"].astype(float).round(2),
        }
    )
    cells = grid.groupby([LEARNED, BASELINE, GAIN, RELEASED]).agg(**MEANS).reset_index()
    release = ring.groupby(["memories", "spread"]).agg(**MEANS).reset_index()
    curves = ring.melt(
        ["memories", "spread"], [name for name in ring if name.startswith("at_")], "step", "distance (m)"
    ).assign(step=lambda table: table["step"].str.removeprefix("at_").astype(int))
    return StudyResults(
        tables={
            "grid": cells,
            "gains": grid[(grid[BASELINE] == CHOSEN_BASELINE) & (grid[RELEASED] <= grid[LEARNED])]
            .groupby(["place", GAIN])["final_m"]
            .mean()
            .reset_index(),
            "curves": curves.groupby(["memories", "spread", "step"])["distance (m)"].mean().reset_index(),
            "release": release,
            "walks": ring[["place", "memories", "spread", "release_deg", "final_m", "mean_m"]],
        },
        numbers={
            f"distance at the end, {row['memories']}, gaze within {row['spread']} degrees (m)": row[FINAL]
            for _, row in release.iterrows()
        },
    )


def _memories(results: StudyResults, spread: int = 0) -> pd.DataFrame:
    walks = results.tables["walks"]
    return walks[walks["spread"] == spread]


@claim(
    "stays",
    "release",
    f"the mean distance over the last {LAST_PART:.0%} of the steps is under the learning walk's reach of 2 m",
    note="Published as a figure only.",
)
def _stays(results: StudyResults) -> Decision:
    """Agents with both memories, released 5 m from the nest, come to it and stay about it."""
    effect = over_routes("distance (m)", _memories(results), "final_m", lambda means: means["both"], by="memories")
    return Decision({"distance at the end (m)": effect.value}, effect.value < 2.0, effect)


@claim(
    "repulsive-helps",
    "release",
    "agents with the attractive memory alone end farther from the nest",
    note="Published as a figure only.",
)
def _repulsive_helps(results: StudyResults) -> Decision:
    """Without the repulsive memory agents stay less near the nest."""
    walks = _memories(results)
    means = walks.groupby("memories")["final_m"].mean()
    effect = over_routes(
        "distance with the attractive memory alone minus that with both (m)",
        walks,
        "final_m",
        lambda means: means["attractive"] - means["both"],
        by="memories",
    )
    return Decision({f"{name} (m)": float(each) for name, each in means.items()}, effect.value > 0, effect)


@claim(
    "spread-gaze",
    "release",
    "with both memories they end within 2 m of the nest when they have looked up to 135 degrees off it",
    note="Published as a figure only.",
)
def _spread_gaze(results: StudyResults) -> Decision:
    """The views of the learning walk need not face the nest exactly."""
    effect = over_routes("distance (m)", _memories(results, 135), "final_m", lambda means: means["both"], by="memories")
    return Decision({"distance at the end (m)": effect.value}, effect.value < 2.0, effect)


@claim(
    "gain-in-the-middle",
    "gains",
    f"at a baseline of {CHOSEN_BASELINE} degrees the gain whose walks end nearest is neither the smallest nor the largest",
    note="Published as a figure only. Releases within the reach of the learning walk, over all learning walks.",
)
def _gain_in_the_middle(results: StudyResults) -> Decision:
    """Gains in the middle of the range keep agents nearest to the nest."""
    table = results.tables["gains"]
    means = table.groupby(GAIN)["final_m"].mean()
    effect = over_routes(
        "distance at the better end of the gains minus that at the best gain between (m)",
        table,
        "final_m",
        lambda means: min(means.iloc[0], means.iloc[-1]) - means.iloc[1:-1].min(),
        by=GAIN,
    )
    return Decision({f"gain {gain} (m)": float(each) for gain, each in means.items()}, effect.value > 0, effect)


CLAIMS = (_stays, _repulsive_helps, _spread_gaze, _gain_in_the_middle)

PARAMETERS = (
    Parameter(
        "View", "72 or 36 pixels around, eye 2 cm high", "72 pixels around, 15 rows from -15 to 60 degrees, 2 cm"
    ),
    Parameter("Learning walk", "25 views on a spiral of two turns, from 0.1 m to 0.5, 2 or 8 m", "the same"),
    Parameter("Gaze", "to the nest, with noise of up to 135 degrees", "to the nest; and within 135 degrees of it"),
    Parameter("Repulsive views", "the same, turned by 180 degrees", "the same"),
    Parameter("Turn", "alternating; baseline + gain (attractive - repulsive), 0 to 180 degrees", "the same"),
    Parameter(
        "Unfamiliarity", "difference of images, divided by 0.2", "1 is that of learned views that face the other way"
    ),
    Parameter("Noise", "10 degrees", "10 degrees"),
    Parameter("Steps", "320 of 0.2 m", "the same"),
    Parameter("Baseline", "0, 45, 90, 135, 180 degrees", "the same"),
    Parameter("Gain", "0, 10, 100, .. 100,000 degrees", "the same"),
    Parameter("Released at", "0, 1, 2, 4, 8, 16, 32 m, 36 times", "the same: in 6 directions in each of 6 worlds"),
    Parameter("Release test", "10 agents on a ring of 5 m, 150 steps", "the same, in each world"),
)

DIFFERENCES = (
    "The paper shows its results as figures, without numbers; tests of claims and their thresholds are ours.",
    "The world of the original is not public. Ours are generated: 100 m x 100 m, tussocks, bushes and a skyline of trees, without grass.",
    "Views are silhouettes against the sky, blurred by a pixel, with elevations of our choice. As differences between such images are of "
    "another size, they are not divided by 0.2, but by that between learned views and the same views turned about. Encoding, unit and "
    "plants were chosen in the worlds of seeds 100 to 104, by how near the nest agents stay at the published baseline and gain.",
    "Learning walks are all that is learned here; the original also walks a route of 10 m to the nest.",
    "In the grid all views face the nest. A walk that leaves the world counts as where it left it.",
    "For one memory alone we take a baseline of 0 (attractive) or 180 degrees (repulsive), with the same gain. Then an agent walks "
    "straight on in a familiar direction; where the attractive memory knows nothing it turns about at each step, and stays where it is.",
    "All walks of a world draw the same noise on their turns.",
)


def _heat_map(reach: float) -> Item:
    return Item(
        f"grid-{reach:g}-m",
        f"Distance from the nest, learning walk of {reach:g} m",
        "grid",
        f"Mean over the last {LAST_PART:.0%} of {STEPS} steps, by gain, release and baseline.",
        lambda table: heat_maps(table[table[LEARNED] == reach], GAIN, RELEASED, FINAL, by=BASELINE),
    )


ITEMS = (
    Item(
        "release",
        "Release test",
        "curves",
        f"Mean distance from the nest over the steps of agents that were released {RING:g} m from it. Dashed: they learned views within "
        "135 degrees of the nest.",
        lambda table: distances_over_steps(table, "memories", "spread"),
    ),
    Item("release-table", "Release test in numbers", "release", "Gaze: within how many degrees of the nest."),
    *map(_heat_map, LEARNING_WALKS),
    Item(
        "gains",
        "Gains in each world",
        "gains",
        f"Baseline of {CHOSEN_BASELINE} degrees, released within the learning walk.",
    ),
    Item("grid", "The grid in numbers", "grid", "Means over worlds and directions."),
)

LEMOEL2020 = Protocol(
    name="lemoel2020",
    title="Opponent memories: staying near the nest",
    paper="Le Moel F, Wystrach A (2020). Towards a multi-level understanding in insect navigation. Current Opinion in Insect Science 42, "
    "110-117.",
    question="Do attractive and repulsive memories of a learning walk, compared at one look a step, bring agents to the nest?",
    world="tussock-field field_width=100 field_depth=100 grass_density=0 leaf_density=0 stone_density=0 tussock_density=0.05 "
    "tussock_blades=8 bush_density=0.01 bush_height=1.5 bush_leaves=20 tree_height=8 tree_leaves=30",
    experiment=Experiment(
        route=Route.through(np.array([[NEST - WAY, NEST], [NEST, NEST]])),
        eye=Eye(width=72, height=15, z=0.02, samples=2),
        encoding="foreground-mask | blur 1",
        navigator="opponent",
        training=TrainingSetup(goal_walk=2.0, goal_only=True),
        body=Body(step_length=0.2, heading_noise=math.radians(10)),
        stopping=StoppingRules(arrival_radius=1e-6, max_deviation=1e4, patience=1e4, max_steps=STEPS),
    ),
    axes={
        "model": ["perfect-memory"],
        "training__goal_walk": list(LEARNING_WALKS),
        "navigator": list(GRID),
        "release": [distance or AT_NEST for distance in DISTANCES],
        "release_direction": np.linspace(0, 2 * np.pi, RELEASES, endpoint=False).tolist(),
    },
    more_axes={
        "model": ["perfect-memory"],
        "training__goal_spread": np.radians(SPREADS).tolist(),
        "navigator": list(MEMORIES),
        "release": [RING],
        "release_direction": np.linspace(0, 2 * np.pi, AGENTS, endpoint=False).tolist(),
        "stopping__max_steps": [RING_STEPS],
    },
    worlds=WORLDS,
    quick_worlds=1,
    quick_axes={
        "training__goal_walk": [2.0],
        "navigator": [text for text, (baseline, _) in GRID.items() if baseline == CHOSEN_BASELINE],
        "release": [2.0, 8.0],
    },
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
    of_walk=of_walk,
    columns=("goal_m",),
    layout=lambda route: route,  # into a file, whose name tells the worlds apart
)
