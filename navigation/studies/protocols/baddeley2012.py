"""Baddeley et al. 2012: a route held in an Infomax network that saw each view once, against perfect memory."""

import math

import pandas as pd

from tussock.render.eye import Eye

from ...body import Body
from ...experiment import Experiment
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import boxes, boxes_by_model
from .intervals import INTERVALS, intervals
from .protocol import Item, Parameter, Protocol

PERFECT, INFOMAX, RANDOM = "perfect-memory", "infomax", "random"
MODELS = (PERFECT, f"{INFOMAX} rate=baddeley", RANDOM)
MOSTLY = 0.9  # of the walks
FOLLOWS = f"at least {100 * MOSTLY:g} % of its walks arrive without an error"
MEASURES = {"flawless": "arrived without an error", "errors": "errors a walk", "deviation_cm": "mean deviation (cm)"}
NOTE = "Published as figures of paths."


def measure(walks: pd.DataFrame) -> StudyResults:
    """How many walks of each model arrive without an error, how often they are put back, and how far from the route they are."""
    walks = walks.assign(errors=walks["resets"], deviation_cm=100 * walks["mean_deviation_m"])
    walks["flawless"] = walks["arrived"].astype(bool) & (walks["errors"] == 0)
    grouped = walks.groupby("model", sort=False)
    columns = {
        "walks": grouped.size(),
        "arrived without an error": grouped["flawless"].mean(),
        "arrived": grouped["arrived"].mean(),
        "errors a walk": grouped["errors"].mean(),
        "mean deviation (cm)": grouped["deviation_cm"].mean(),
        "mean heading error (°)": grouped["mean_error_deg"].mean(),
    }
    by_model = pd.DataFrame(columns)
    by_route = walks.pivot_table(index="place", columns="model", values="errors", aggfunc="mean", sort=False)
    kept = ["model", "place", "offset_m", "flawless", "arrived", "errors", "deviation_cm", "mean_error_deg"]
    return StudyResults(
        tables={
            "by_model": by_model.reset_index(),
            "by_route": by_route[list(by_model.index)].reset_index(),
            "intervals": intervals(walks, MEASURES),
            "walks": walks[kept],
        },
        numbers={f"{name}, {model}": value for name in by_model for model, value in by_model[name].items()},
    )


def _follows(results: StudyResults, model: str) -> Decision:
    share = float(results.numbers[f"arrived without an error, {model}"])
    effect = over_routes(
        f"walks that arrive without an error, {model}", results.tables["walks"], "flawless", lambda mean: mean[model]
    )
    return Decision({f"walks that arrive without an error, {model}": share}, share >= MOSTLY, effect)


@claim(
    "infomax-better-than-chance",
    "by-model",
    "Infomax makes less than half as many errors as random headings",
    note="Random headings are a control of ours.",
)
def _better_than_chance(results: StudyResults) -> Decision:
    """The network has learned the route: it does much better than chance."""
    infomax, random = (float(results.numbers[f"errors a walk, {model}"]) for model in (INFOMAX, RANDOM))
    obtained = {f"errors a walk, {INFOMAX}": infomax, f"errors a walk, {RANDOM}": random}
    effect = over_routes(
        "random's errors minus Infomax's",
        results.tables["walks"],
        "errors",
        lambda mean: mean[RANDOM] - mean[INFOMAX],
    )
    return Decision(obtained, infomax < random / 2, effect)


@claim("perfect-memory-follows", "by-model", FOLLOWS, note=NOTE)
def _perfect_memory_follows(results: StudyResults) -> Decision:
    """Routes can be followed by comparing the view with all views of the route."""
    return _follows(results, PERFECT)


@claim("infomax-follows", "by-model", FOLLOWS, note=NOTE)
def _infomax_follows(results: StudyResults) -> Decision:
    """They can be followed as well by a network that has seen each view once and stores none."""
    return _follows(results, INFOMAX)


CLAIMS = (_perfect_memory_follows, _infomax_follows, _better_than_chance)

PARAMETERS = (
    Parameter(
        "View", "360 x 68, reduced to 90 x 17: 4 degrees a pixel", "360 x 68, reduced to 90 x 17: 4 degrees a pixel"
    ),
    Parameter("Seen", "objects as silhouettes against the sky", "share of each pixel that is not sky"),
    Parameter("Infomax", "as many units as inputs", "1,530 units of 1,530 inputs"),
    Parameter("Learning rate", "0.01", "0.01 (0.01 / units an update)"),
    Parameter("Learning", "one pass", "one pass"),
)

DIFFERENCES = (
    "How the original scales its views is unknown to us, and the learning rate has no meaning without it. On silhouettes of 0 and 1, and "
    "on views of variance 1, a rate of 0.01 made the weights grow without bound. Here views have mean 0 and a standard deviation of 0.25: "
    "a view is then learned about once (0.01 times its squared length is 0.96).",
    "Unknown, and chosen by us: a view every 4 cm, steps of 4 cm, a scan of 180 degrees about the present heading, elevations from -8 to "
    "60 degrees, starts on the route and 10 cm to both sides.",
    "An agent more than 0.5 m off the route, or without progress for 3 m, is put back on it at the next of its waypoints, every 10 cm, "
    "and that is counted as an error, so that all of a route is tested.",
    "The most familiar rotation is refined between the 4 degrees of a column by a parabola through its neighbours.",
    "The original also learns a route several times, and several routes; this is its simplest experiment, one route learned in one pass.",
)

ITEMS = (
    Item("by-model", "Routes followed", "by_model", "Over all routes and starts; shares are of 1."),
    boxes("errors", "Errors of each model", "errors", "errors per walk"),
    Item(
        "deviation",
        "Distance from the route",
        "walks",
        "Mean over each walk; median, quartiles, lowest and highest of all walks.",
        lambda walks: boxes_by_model(walks, "deviation_cm", "mean deviation (cm)"),
    ),
    INTERVALS,
    Item("by-route", "Errors by route", "by_route", "Mean errors per walk, over all starts."),
)

BADDELEY2012 = Protocol(
    name="baddeley2012",
    title="A route held in a network: Infomax against perfect memory",
    paper="Baddeley B, Graham P, Husbands P, Philippides A (2012). A model of ant route navigation driven by scene familiarity. "
    "PLoS Computational Biology 8(1), e1002336.",
    question="Can a route be followed with a network that has seen each of its views once, as it can with all of them stored?",
    experiment=Experiment(
        eye=Eye(width=360, height=68, top=math.radians(60.0), bottom=math.radians(-8.0)),
        encoding="foreground-mask | resize 4 | normalise | scale 0.25",
        navigator="scan width_deg=180",
        route_length=8.0,
        training=TrainingSetup(spacing=0.04, learning_walk=0.0),
        body=Body(step_length=0.04),
        stopping=StoppingRules(max_deviation=0.5, put_back=True, waypoint_spacing=0.1),
    ),
    axes={"model": MODELS, "start_offset": [-0.1, 0.0, 0.1]},
    worlds=10,
    quick_worlds=2,
    quick_axes={"start_offset": [0.0]},
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
)
