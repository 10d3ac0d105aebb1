"""Azevedo Amin et al. 2025: how far from a route agents walk that start up to 5.5 m to the side of it, by how they steer."""

import dataclasses
from typing import Any

import numpy as np
import pandas as pd

from tussock.render.eye import Eye

from ...body import Body
from ...experiment import Experiment
from ...intervals import mean_interval
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...significance import holm, sign_flip_p
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import lines_by_model
from .intervals import INTERVALS, intervals
from .protocol import Item, Parameter, Protocol, models_in

MAX_START, STARTS = 5.5, 45  # m to either side of the route; number of starts from one side to the other
SECOND_START, SECOND_WORLDS = 2.0, 10  # of the second set of starts: m to either side, and worlds
LENGTH, STEP = 20.0, 0.2  # m
STEPS = 200  # twice the route's length
LAST_PART = 0.05  # share of the route
MIN_RANK, LEVEL = 0.9, 0.05  # rank correlation; p
START = "start beside the route (m)"
MEASURES = {
    "displacement_m": "mean displacement (m)",
    "last_displacement_m": "mean displacement, last 5 % (m)",
    "reached": "share that got to the last 5 %",
}
BY_VIEW, MODULATED, CAST, LATERAL = (
    "view-based orientation", "familiarity-based modulation", "cast and surge", "lateral"
)  # fmt: skip
STRATEGIES = {  # their navigators; by their first word
    "scan": BY_VIEW, "familiarity-modulated": MODULATED, "cast-and-surge": CAST, "lateral": LATERAL,
}  # fmt: skip
NAVIGATORS = ["scan width_deg=160", "familiarity-modulated slowing=0", "cast-and-surge", "lateral"]
ALL, SECOND = "all starts", f"starts within {SECOND_START:g} m, first {SECOND_WORLDS} worlds"


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
    """Mean displacement by strategy and by the displacement of the start, and how strategies differ from view-based orientation."""
    strategy = walks["navigator"].astype(str).str.split().str[0].map(lambda name: STRATEGIES.get(name, name))
    walks = walks.assign(
        model=strategy, start_m=walks["offset_m"].abs(), reached=walks["last_displacement_m"].notna()
    )  # the figures and intervals have a line for each model
    walks = walks.iloc[walks["model"].map(_order).argsort(kind="stable")]
    second = walks[walks["place"].isin(_first(walks["place"])) & (walks["start_m"] <= SECOND_START)]
    differences = [_differences(each, name) for name, each in ((ALL, walks), (SECOND, second))]
    means = walks.groupby("model", sort=False)[list(MEASURES)].mean()
    kept = ["model", "place", "start_m", *MEASURES, "offset_m", "steps", "arrived"]
    return StudyResults(
        tables={
            "by_start": _by_start(walks),
            "intervals": intervals(walks, MEASURES),
            "differences": pd.concat(differences),
            "second": intervals(second, MEASURES),
            "walks": walks[kept],
        },
        numbers={
            f"{label}, {name}": float(means.loc[name, column])
            for name in models_in(walks)
            for column, label in MEASURES.items()
        },
    )


def _order(strategy: str) -> int:
    known = list(STRATEGIES.values())
    return known.index(strategy) if strategy in known else len(known)


def _first(places: pd.Series) -> list[str]:
    """The worlds with the lowest seeds, which stand at the end of their names."""
    return sorted(places.unique(), key=lambda place: (len(place), place))[:SECOND_WORLDS]


def _by_start(walks: pd.DataFrame) -> pd.DataFrame:
    grouped = walks.groupby(["model", "start_m"], sort=False)
    columns = {"walks": grouped.size()} | {label: grouped[column].mean() for column, label in MEASURES.items()}
    table = pd.DataFrame(columns).reset_index().rename(columns={"model": "strategy", "start_m": START})
    return table.sort_values(
        ["strategy", START], key=lambda each: each if each.name == START else each.map(_order), ignore_index=True
    )


def _differences(walks: pd.DataFrame, starts: str) -> pd.DataFrame:
    """Means less those of view-based orientation, paired over worlds; Holm's correction is over the strategies of a measure."""
    rows = []
    for column, label in MEASURES.items():
        means = walks.astype({column: float}).pivot_table(index="place", columns="model", values=column, aggfunc="mean")
        others = [name for name in STRATEGIES.values() if name in means and name != BY_VIEW and BY_VIEW in means]
        paired = [(means[name] - means[BY_VIEW]).dropna().to_numpy(float) for name in others]
        corrected = holm([sign_flip_p(each, np.arange(len(each))) for each in paired])
        for name, each, p in zip(others, paired, corrected, strict=True):
            mean = mean_interval(each, np.arange(len(each)))
            rows.append((starts, label, name, len(each), mean.value, mean.low, mean.high, p))
    columns = ["starts", "measure", "strategy", "worlds", f"less {BY_VIEW}", "low", "high", "p (Holm)"]
    return pd.DataFrame(rows, columns=columns)


@claim(
    "no-approach",
    "displacement",
    f"the rank correlation of mean displacement with that of the start is at least {MIN_RANK:g}",
    note="Published as curves only (figure 2, A and D: view based orientation).",
)
def _no_approach(results: StudyResults) -> Decision:
    """Turning to the most familiar view does not by itself lead back to the route: the farther from the route an agent starts, the
    farther from it the agent walks."""
    table, walks = (results.tables[name] for name in ("by_start", "walks"))
    table, walks = table[table["strategy"] == BY_VIEW], walks[walks["model"] == BY_VIEW]
    ranks = table[[START, MEASURES["displacement_m"]]].rank()
    rank = float(ranks.corr().iloc[0, 1]) if len(ranks) > 1 else np.nan
    obtained = {"rank correlation of displacement and that of the start": rank}
    if np.isnan(rank):
        return Decision(obtained, None, reason="all walks start at the same distance from the route")
    effect = over_routes("rank correlation", walks, "displacement_m", _rank_correlation, by="start_m")
    return Decision(obtained, rank >= MIN_RANK, effect)


@claim(
    "cast-and-surge-converges",
    "displacement",
    f"the mean displacement with {CAST} is lower, with p under {LEVEL:g} after Holm's correction for all strategies",
    note="Published as curves only. In the paper, cast and surge is the best strategy for routes that are learned as here.",
)
def _converges(results: StudyResults) -> Decision:
    """Cast and surge brings agents closer to the route than view-based orientation does."""
    return _closer(results, "displacement_m")


@claim(
    "cast-and-surge-ends-closer",
    "last",
    f"the mean displacement over the last 5 % with {CAST} is lower, with p under {LEVEL:g} after Holm's correction; only walks that "
    "get there count, so the shares that do are given as well",
    note="Published as curves only.",
)
def _ends_closer(results: StudyResults) -> Decision:
    """At the end of the route, too, agents are closer to it with cast and surge."""
    return _closer(results, "last_displacement_m")


def _closer(results: StudyResults, column: str) -> Decision:
    """Whether cast and surge has a lower mean than view-based orientation."""
    label = MEASURES[column]
    names = (label,) if column == "displacement_m" else (label, MEASURES["reached"])
    obtained = {
        f"{name}, {each}": results.numbers.get(f"{name}, {each}", np.nan) for name in names for each in (BY_VIEW, CAST)
    }
    table = results.tables["differences"]
    row = table[(table["starts"] == ALL) & (table["measure"] == label) & (table["strategy"] == CAST)]
    if row.empty:
        return Decision(obtained, None, reason=f"walks with {BY_VIEW}, or with {CAST}, are missing")
    difference, p = (float(row[name].iloc[0]) for name in (f"less {BY_VIEW}", "p (Holm)"))
    effect = over_routes(
        f"{label}, {BY_VIEW} minus {CAST}", results.tables["walks"], column, lambda means: means[BY_VIEW] - means[CAST]
    )
    return Decision(obtained | {"p (Holm)": p}, difference < 0 and p < LEVEL, effect)


def _rank_correlation(means: pd.Series) -> float:
    """The rank correlation of means with what they are told apart by."""
    known = means.dropna()
    return float(known.rank().corr(pd.Series(known.index, index=known.index).rank())) if len(known) > 1 else np.nan


def _starts(count: int) -> list[float]:
    """Starts from one side to the other, evenly spaced."""
    return [round(each, 6) for each in np.linspace(-MAX_START, MAX_START, count).tolist()]


CLAIMS = (_no_approach, _converges, _ends_closer)

PARAMETERS = (
    Parameter("Route", "20 m", "20 m"),
    Parameter("Environments", "75, generated", "75, generated, of 40 m x 40 m"),
    Parameter(
        "Starts", "45, up to 5.5 m to both sides", "45, every 0.25 m from 5.5 m on one side to 5.5 m on the other"
    ),
    Parameter("Strategies", f"{BY_VIEW}, {MODULATED}, {CAST}", f"the same, and {LATERAL}, which is not of the paper"),
    Parameter("Scan", "160 degrees at most", "160 degrees; with familiarity-based modulation from 40 to 160"),
    Parameter(
        "Second set",
        f"starts up to {SECOND_START:g} m to both sides, {SECOND_WORLDS} seeds",
        f"those of the starts that lie within {SECOND_START:g} m, in the first {SECOND_WORLDS} worlds",
    ),
    Parameter(
        "Measured",
        "mean displacement from the whole route and over its last 5 %",
        "the same; and how many walks get there",
    ),
)

DIFFERENCES = (
    "Of the original we know the strategies by what its summary says of them: scans that familiarity modulates; casts that form a zig-zag "
    "in search of familiar views, and surges that follow familiarity. Their equations and numbers are ours, but for the widest scan "
    "(docs/steering.md). They were chosen in other worlds, with the seeds 100 to 106.",
    "The original also changes how the route is learned: on an oscillating path, and with loops about the goal. Here it is not.",
    "Unknown, and chosen by us: perfect memory as the familiarity; vertical edges of skylines, 90 x 19 pixels, as views; a view every "
    f"10 cm of the route; steps of {100 * STEP:g} cm; at most {STEPS} steps, which together are twice as long as the route.",
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
    Item(
        "differences",
        f"Strategies against {BY_VIEW}",
        "differences",
        "Differences of the means of each world, with 95 % intervals over worlds; p is corrected for the strategies of a measure (Holm).",
    ),
    dataclasses.replace(INTERVALS, title="Means by strategy, with their intervals"),
    dataclasses.replace(INTERVALS, name="second", title=f"The same, {SECOND}", table="second"),
    Item("by-start", "Displacement by start", "by_start", "Over all worlds and both sides."),
)

AZEVEDO2025 = Protocol(
    name="azevedo2025",
    title="Starts far from a route: how far from it agents walk",
    paper="Azevedo Amin A, Philippides A, Graham P (2025). Ant visual route navigation: how the fine details of behaviour promote "
    "successful route performance and convergence. PLoS Computational Biology 21(9), e1012798.",
    question="Do agents that start metres to the side of a route that they have learned come back to it by familiarity alone, and does it "
    "matter how they move?",
    world="tussock-field field_width=40 field_depth=40",
    experiment=Experiment(
        eye=Eye(width=360, height=75),
        encoding="foreground-mask | vertical-edges | resize 4 | normalise",
        navigator=NAVIGATORS[0],
        route_length=LENGTH,
        training=TrainingSetup(spacing=0.1, learning_walk=0.0),
        body=Body(step_length=STEP),
        stopping=StoppingRules(max_deviation=100.0, patience=100.0, max_steps=STEPS),
    ),
    axes={"model": ["perfect-memory"], "navigator": NAVIGATORS, "start_offset": _starts(STARTS)},
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
