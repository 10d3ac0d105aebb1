"""Gattaux et al. 2025: routes followed out and home by two mushroom bodies, of views that face left and right of the way."""

from typing import Any

import numpy as np
import pandas as pd

from tussock.render.eye import Eye

from ...body import Body
from ...experiment import Experiment
from ...intervals import MIN_WORLDS
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import boxes
from .intervals import INTERVALS, intervals
from .protocol import HOME, Item, Parameter, Protocol

BODY = "mushroom-body"
CELLS, WINNERS = 15_000, 0.01
MODELS = (
    f"{BODY} cells={CELLS} active={WINNERS} inputs=40 outputs=1 learning=depression depression=0.1 traversals=1 columns=32 rows=32 "
    "overlap_deg=0 smoothing_deg=0",
    "infomax",
    "perfect-memory",
)
LANE = (
    1.0  # m: a walk is lost half of it from the route. The original's lane is wider; only shares of a lane are compared
)
OUT = "out"
PUBLISHED_ERROR = 0.15  # lane widths, median
MOSTLY = 0.8  # of the walks
MEASURES = {"arrived": "arrived", "error_lanes": "lateral error (lane widths)"}


def of_walk(row: dict[str, Any], steps: pd.DataFrame) -> dict[str, float]:
    """Median distance of a walk from the route (lane widths), and its step as a share of a whole one."""
    moved = np.hypot(np.diff(steps["x_m"]), np.diff(steps["y_m"]))
    return {
        "error_lanes": float(steps["deviation_m"].median()) / LANE,
        "step_m": float(moved.mean()) if len(moved) else float("nan"),
    }


def measure(walks: pd.DataFrame) -> StudyResults:
    """Arrivals and lateral error of each model, on the way out and on the way home."""
    home = walks["place"].str.endswith(HOME)
    walks = walks.assign(
        way=home.map({False: OUT, True: "home"}),
        place=walks["place"].str.removesuffix(HOME),
        arrived=walks["arrived"].astype(float),
    )
    grouped = walks.groupby(["model", "way"], sort=False)
    columns = {
        "walks": grouped.size(),
        "arrived": grouped["arrived"].mean(),
        "median lateral error (lane widths)": grouped["error_lanes"].median(),
        "mean deviation (m)": grouped["mean_deviation_m"].mean(),
        "mean step (m)": grouped["step_m"].mean(),
    }
    by_model = pd.DataFrame(columns).reset_index()
    means = walks.groupby("model", sort=False)
    kept = ["model", "way", "place", "offset_m", "arrived", "error_lanes", "mean_deviation_m", "steps"]
    return StudyResults(
        tables={"by_model": by_model, "intervals": intervals(walks, MEASURES), "walks": walks[kept]},
        numbers={f"arrived, {model}": float(part["arrived"].mean()) for model, part in means}
        | {f"lateral error, {model}": float(part["error_lanes"].median()) for model, part in means},
    )


@claim(
    "follows",
    "by-model",
    f"at least {100 * MOSTLY:g} % of the walks with the mushroom body arrive",
    published={f"arrived, {BODY}": 1.0},
)
def _follows(results: StudyResults) -> Decision:
    """Two mushroom bodies, each of views to one side of the way, follow routes (11 of 11)."""
    share = float(results.numbers[f"arrived, {BODY}"])
    effect = over_routes("walks that arrive", results.tables["walks"], "arrived", lambda mean: mean[BODY])
    return Decision({f"arrived, {BODY}": share}, share >= MOSTLY, effect)


@claim(
    "lateral-error", "lateral-error", f"the median over the walks is at most {PUBLISHED_ERROR:g} lane widths",
    published={f"lateral error, {BODY}": PUBLISHED_ERROR}, note=f"A lane is {LANE:g} m wide here: a choice of ours.",
)  # fmt: skip
def _lateral_error(results: StudyResults) -> Decision:
    """They stay within a small part of the lane."""
    error = float(results.numbers[f"lateral error, {BODY}"])
    enough = len(set(results.tables["walks"]["place"])) >= MIN_WORLDS
    return Decision({f"lateral error, {BODY}": error}, error <= PUBLISHED_ERROR if enough else None)


CLAIMS = (_follows, _lateral_error)

PARAMETERS = (
    Parameter(
        "View", "32 x 32, blurred, edges", "32 x 32, vertical edges of the skyline and of what stands in front of it"
    ),
    Parameter("Kenyon cells", "15,000, of which 1 % fire", "the same, of 40 inputs each"),
    Parameter("Memory", "about 20 kB", "two outputs: 30 kB with a byte for each synapse (120 kB as we hold them)"),
    Parameter(
        "Learned",
        "views turned in silico, to the left and to the right of the way",
        "the same, by 15, 30, .. 90 degrees",
    ),
    Parameter(
        "Steering", "difference of both outputs", "1 rad for a difference of 1 in unfamiliarity; 69 degrees at most"
    ),
    Parameter("Speed", "falls with familiarity", "the step is 1 - 0.5 x the lower unfamiliarity"),
    Parameter("Routes", "about 50 m; 1.6 km in all", "8 m, out and home"),
)

DIFFERENCES = (
    "A walking agent with steps of at most 5 cm and an eye 1 cm above the ground takes the place of a car.",
    "Routes are shorter: generated worlds are 10 m wide.",
    "On the way home an agent has learned the same positions facing back, in memories of their own, as the original has one pair of "
    "outputs for each way.",
    "Chosen by us: a view every 8 cm with a learning walk of 0.2 m; 5 degrees of noise on every turn; gain, angles and depression, on "
    "worlds of seeds from 100 on. Infomax and perfect memory are controls of ours.",
)

ITEMS = (
    Item("by-model", "Routes followed", "by_model", "Over all routes and starts; shares are of 1."),
    boxes("lateral-error", "Lateral error", "error_lanes", "median distance (lane widths)"),
    INTERVALS,
)

GATTAUX2025 = Protocol(
    name="gattaux2025",
    title="A mushroom body for each side of the way",
    paper="Gattaux G, Wystrach A, Serres JR, Ruffier F (2025). Route-centric ant-inspired memories enable panoramic route-following in a "
    "car-like robot. Nature Communications 16 (doi 10.1038/s41467-025-62327-3).",
    question="Can routes be followed out and home by one look a step, with two memories of views that face left and right of the way?",
    experiment=Experiment(
        eye=Eye(width=160, height=160),
        encoding="foreground-mask | vertical-edges | resize 5 | normalise",
        navigator="lateral gain=1 slowing=0.5",
        route_length=8.0,
        training=TrainingSetup(spacing=0.08, learning_walk=0.2),
        body=Body(heading_noise=float(np.radians(5))),
    ),
    axes={"model": MODELS, "start_offset": [-0.1, 0.0, 0.1]},
    worlds=10,
    quick_worlds=1,
    quick_axes={"start_offset": [0.0]},
    both_ways=True,
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
    of_walk=of_walk,
)
