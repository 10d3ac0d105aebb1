"""Azevedo Amin et al. 2025: how far from a route agents walk that start up to 5.5 m to the side of it."""

from typing import Any

import numpy as np
import pandas as pd

from tussock.render.eye import Eye

from ...body import Body
from ...experiment import Experiment
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import lines_by_model
from .intervals import INTERVALS, intervals
from .protocol import Item, Parameter, Protocol

MAX_START, STARTS = 5.5, 45  # m to either side of the route; number of starts from one side to the other
LENGTH, STEP = 20.0, 0.1  # m
LAST_PART = 0.05  # share of the route
MIN_RANK = 0.9  # rank correlation
MEASURES = {
    "displacement_m": "mean displacement (m)",
    "last_displacement_m": "mean displacement, last 5 % (m)",
    "reached": "share that got to the last 5 %",
}


def of_walk(row: dict[str, Any], steps: pd.DataFrame) -> dict[str, float]:
    """Mean displacement (m) of a walk from the whole route, and over its last part (nan for a walk that does not get there).

    Steps count until the walk has passed the route's end.
    """
    length = row["route_m"]
    past = np.flatnonzero(steps["along_m"] >= length - STEP / 2)
    counted = steps.iloc[: past[0] + 1] if len(past) else steps
    last = counted[counted["along_m"] >= (1 - LAST_PART) * length]
    return {
        "displacement_m": float(counted["deviation_m"].mean()),
        "last_displacement_m": float(last["deviation_m"].mean()),
    }


def measure(walks: pd.DataFrame) -> StudyResults:
    """Mean displacement by the displacement of the start."""
    walks = walks.assign(start_m=walks["offset_m"].abs(), reached=walks["last_displacement_m"].notna())
    grouped = walks.groupby("start_m")
    columns = {
        "walks": grouped.size(),
        "mean displacement (m)": grouped["displacement_m"].mean(),
        "mean displacement, last 5 % (m)": grouped["last_displacement_m"].mean(),
        "got to the last 5 %": grouped["last_displacement_m"].agg(lambda each: float(each.notna().mean())),
    }
    by_start = pd.DataFrame(columns).reset_index().rename(columns={"start_m": "start beside the route (m)"})
    kept = ["model", "place", "start_m", "offset_m", "displacement_m", "last_displacement_m", "steps", "arrived"]
    return StudyResults(
        tables={"by_start": by_start, "intervals": intervals(walks, MEASURES), "walks": walks[kept]},
        numbers={
            "mean displacement (m)": float(walks["displacement_m"].mean()),
            "mean displacement, last 5 % (m)": float(walks["last_displacement_m"].mean()),
            "share that got to the last 5 %": float(walks["last_displacement_m"].notna().mean()),
        },
    )


@claim(
    "no-approach",
    "displacement",
    f"the rank correlation of mean displacement with that of the start is at least {MIN_RANK:g}",
    note="Published as curves only (figure 2, A and D: view based orientation).",
)
def _no_approach(results: StudyResults) -> Decision:
    """Turning to the most familiar view does not by itself lead back to the route: the farther from the route an agent starts, the
    farther from it the agent walks."""
    ranks = results.tables["by_start"][["start beside the route (m)", "mean displacement (m)"]].rank()
    rank = float(ranks.corr().iloc[0, 1]) if len(ranks) > 1 else np.nan
    obtained = {"rank correlation of displacement and that of the start": rank} | results.numbers
    if np.isnan(rank):
        return Decision(obtained, None, reason="all walks start at the same distance from the route")
    effect = over_routes("rank correlation", results.tables["walks"], "displacement_m", _rank_correlation, by="start_m")
    return Decision(obtained, rank >= MIN_RANK, effect)


def _rank_correlation(means: pd.Series) -> float:
    """The rank correlation of means with what they are told apart by."""
    known = means.dropna()
    return float(known.rank().corr(pd.Series(known.index, index=known.index).rank())) if len(known) > 1 else np.nan


def _starts(count: int) -> list[float]:
    """Starts from one side to the other, evenly spaced."""
    return [round(each, 6) for each in np.linspace(-MAX_START, MAX_START, count).tolist()]


CLAIMS = (_no_approach,)

PARAMETERS = (
    Parameter("Route", "20 m", "20 m"),
    Parameter("Environments", "75, generated", "75, generated, of 40 m x 40 m"),
    Parameter(
        "Starts", "45, up to 5.5 m to both sides", "45, every 0.25 m from 5.5 m on one side to 5.5 m on the other"
    ),
    Parameter("Scan", "160 degrees at most", "160 degrees"),
    Parameter(
        "Measured",
        "mean displacement from the whole route and over its last 5 %",
        "the same; and how many walks get there",
    ),
)

DIFFERENCES = (
    "Of the three strategies of the original, only the first is here, view based orientation; its scan always has the largest width.",
    "Unknown, and chosen by us: perfect memory as the familiarity; vertical edges of skylines, 90 x 19 pixels, as views; a view every "
    "10 cm of the route; steps of 10 cm; at most 255 steps, which is the length of the route and the largest displacement together.",
    "A walk is never lost, and counts until it is level with the route's end. Over the last 5 %, only the walks that get there count.",
    "Worlds are tussocks, grass, stones and bushes with a skyline of trees. Starts outside of a world are left out; their number is given "
    "below the tables.",
)


def _displacements(walks: pd.DataFrame, column: str) -> Any:
    labels = ("displacement of the start (m)", "mean displacement (m)")
    return lines_by_model(walks, "start_m", column, *labels, diagonal=True)


ITEMS = (
    Item(
        "displacement",
        "Displacement against that of the start",
        "walks",
        "Mean distance from the route, over all worlds and both sides; bars are 95 % intervals over routes, from five routes on.",
        lambda walks: _displacements(walks, "displacement_m"),
    ),
    Item(
        "last",
        "Displacement over the last 5 % of the route",
        "walks",
        "As above, of the walks that got there.",
        lambda walks: _displacements(walks, "last_displacement_m"),
    ),
    Item("by-start", "Displacement by start", "by_start", "Over all worlds and both sides."),
    INTERVALS,
)

AZEVEDO2025 = Protocol(
    name="azevedo2025",
    title="Starts far from a route: how far from it agents walk",
    paper="Azevedo Amin A, Philippides A, Graham P (2025). Ant visual route navigation: how the fine details of behaviour promote "
    "successful route performance and convergence. PLoS Computational Biology 21(9), e1012798.",
    question="Do agents that start metres to the side of a route that they have learned come back to it by familiarity alone?",
    world="tussock-field field_width=40 field_depth=40",
    experiment=Experiment(
        eye=Eye(width=360, height=75),
        encoding="foreground-mask | vertical-edges | resize 4 | normalise",
        navigator="scan width_deg=160",
        route_length=LENGTH,
        training=TrainingSetup(spacing=0.1, learning_walk=0.0),
        body=Body(step_length=STEP),
        stopping=StoppingRules(max_deviation=100.0, patience=100.0, max_steps=round((LENGTH + MAX_START) / STEP)),
    ),
    axes={"model": ["perfect-memory"], "start_offset": _starts(STARTS)},
    worlds=75,
    quick_worlds=2,
    quick_axes={"start_offset": _starts(12)},
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
    of_walk=of_walk,
)
