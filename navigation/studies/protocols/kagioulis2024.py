"""Kagioulis et al. 2024: whether knowing the order of the learned views helps to follow a route."""

import math

import attrs
import pandas as pd

from tussock.render.eye import Eye

from ...body import Body
from ...experiment import Experiment
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import boxes, means_by_model
from .intervals import INTERVALS, intervals
from .protocol import Item, Parameter, Protocol

PERFECT, CHAIN, WINDOW = "perfect-memory", "chain", "window-memory"
ADAPTIVE = "adaptive window"
FIXED = (20, 50, 100)  # views
SPACING = 0.05  # m, between learned views
ANGULAR_ERROR, FAIL_COUNT = "mean absolute angular error", "trial-fail count"
MEASURES = {"mean_error_deg": f"{ANGULAR_ERROR} (°)", "failures": FAIL_COUNT, "deviation_cm": "mean deviation (cm)"}
NOTE = "We have no numbers of the original."
CLEARLY = ", and the 95 % interval of the difference does not contain 0"


def measure_windows(walks: pd.DataFrame) -> StudyResults:
    """`measure`, where the model is a window of some size."""
    labels = {_fixed(size): f"window of {size}" for size in FIXED} | {WINDOW: ADAPTIVE}
    return measure(walks.assign(model=[labels.get(spec, spec) for spec in walks["spec"]]))


def _fixed(size: int) -> str:
    """The spec of a window of one size, as a table of walks has it."""
    return f"{WINDOW} adaptive=false" if size == 20 else f"{WINDOW} window={size} adaptive=false"


def measure(walks: pd.DataFrame) -> StudyResults:
    """Mean absolute angular error and trial-fail count of each model."""
    walks = walks.assign(failures=walks["resets"], deviation_cm=100 * walks["mean_deviation_m"])
    grouped = walks.groupby("model", sort=False)
    columns = {
        "walks": grouped.size(),
        f"{ANGULAR_ERROR} (°)": grouped["mean_error_deg"].mean(),
        FAIL_COUNT: grouped["failures"].mean(),
        "walks without a failure": grouped["failures"].agg(lambda each: float((each == 0).mean())),
        "arrived": grouped["arrived"].mean(),
        "mean deviation (cm)": grouped["deviation_cm"].mean(),
    }
    by_model = pd.DataFrame(columns)
    labels = {"mean_error_deg": "error (°)", "failures": "failures"}
    by_route = walks.pivot_table(index="place", columns="model", values=list(labels), aggfunc="mean", sort=False)
    by_route.columns = [f"{labels[value]}, {model}" for value, model in by_route.columns]
    return StudyResults(
        tables={
            "by_model": by_model.reset_index(),
            "by_route": by_route.reset_index(),
            "intervals": intervals(walks, MEASURES),
            "walks": walks[["model", "place", "mean_error_deg", "failures", "arrived", "deviation_cm"]],
        },
        numbers={f"{name}, {model}": value for name in by_model for model, value in by_model[name].items()},
    )


def _lower(results: StudyResults, number: str, label: str, column: str, model: str = CHAIN) -> Decision:
    """Whether a number is lower for a model than for perfect memory, by more than chance explains."""
    perfect, other = (float(results.numbers[f"{number}, {each}"]) for each in (PERFECT, model))
    obtained = {f"{label}, {PERFECT}": perfect, f"{label}, {model}": other}
    effect = over_routes(
        f"{label}, {PERFECT} minus {model}", results.tables["walks"], column, lambda mean: mean[PERFECT] - mean[model]
    )
    clearly = (
        math.isnan(effect.low) or effect.low > 0
    )  # few routes give no interval, and reports do not test their claims
    return Decision(obtained, None if perfect == other else other < perfect and clearly, effect)


@claim(
    "sequence-lowers-error",
    "by-model",
    f"the chain's mean absolute angular error is lower than perfect memory's{CLEARLY}",
    note=NOTE,
)
def _sequence_lowers_error(results: StudyResults) -> Decision:
    """Headings are more accurate when the view is compared only with views that are near in the sequence."""
    return _lower(results, f"{ANGULAR_ERROR} (°)", f"{ANGULAR_ERROR} (deg)", "mean_error_deg")


@claim(
    "sequence-fails-less",
    "by-model",
    f"the chain has fewer failures per route than perfect memory{CLEARLY}",
    note=NOTE,
)
def _sequence_fails_less(results: StudyResults) -> Decision:
    """There are fewer failures."""
    return _lower(results, FAIL_COUNT, "failures a route", "failures")


CLAIMS = (_sequence_lowers_error, _sequence_fails_less)

PARAMETERS = (
    Parameter("Routes", "20", "those given, or 20 generated ones of 8 m"),
    Parameter(
        "View",
        "180 x 40, blurred",
        "pixels of 2 degrees, as of 180 x 40, blurred by one of them, and sampled every degree: 360 x 80",
    ),
    Parameter("Scan", "180 degrees to both sides in steps of 1", "the same, refined between steps"),
    Parameter("Step", "5 cm", "5 cm"),
    Parameter("Failure", "more than 0.3 m off, or no progress in 10 steps", "the same"),
    Parameter(
        "After a failure", "put back 5 views ahead", "put back at the next of the waypoints, which are 5 views apart"
    ),
    Parameter("Measured", "mean absolute angular error, trial-fail count", "the same; and the distance from the route"),
)

DIFFERENCES = (
    "After a failure the agent is put back 1 to 5 views ahead of the furthest position that it had reached, at the next multiple of 5 "
    "views; in the original it is 5 views ahead. So failures can repeat more often.",
    "The model `chain` keeps the sequence (docs/models.md): a window of 5 % of the views ahead and half as many behind, doubled where no "
    "view in it matches. The original compares windows of several fixed lengths with one that adapts itself.",
    "Columns are one degree apart, so that rotations by 1 degree need no interpolated image; blurring makes this as coarse as 180 x 40.",
    "Unknown, and chosen by us: the width of the blur (one pixel of 2 degrees), a view every 5 cm, elevations from -15 to 60 degrees, the "
    "length of the routes, and no noise.",
)

ITEMS = (
    Item(
        "by-model",
        "Errors and failures",
        "by_model",
        "Over all walks. Angular error: between the chosen heading and the route's heading at the nearest position, mean over the "
        "steps of a walk. Trial-fail count: how often a walk was put back.",
    ),
    boxes("angular-error", "Mean absolute angular error", "mean_error_deg", "mean absolute error (degrees)"),
    Item(
        "failures",
        "Failures",
        "intervals",
        "Mean number of failures of a walk, with its 95 % interval over routes.",
        lambda intervals: means_by_model(intervals, FAIL_COUNT, "failures a walk"),
    ),
    INTERVALS,
    Item("by-route", "Route by route", "by_route", "Mean over the walks along each route."),
)

_PLAIN = Protocol(
    name="kagioulis2024",
    title="Views in their order: a window of memories against all of them",
    paper="Kagioulis E, Knight JC, Graham P, Nowotny T, Philippides A (2024). Adaptive route memory sequences for insect-inspired visual "
    "route navigation. Biomimetics 9(12), 731.",
    question="Does it help an agent to compare its view only with the views that come next along its route?",
    experiment=Experiment(
        eye=Eye(width=360, height=80),
        encoding="grey | widen 2 | blur 2",
        navigator="scan width_deg=360",
        route_length=8.0,
        training=TrainingSetup(spacing=SPACING, learning_walk=0.0),
        body=Body(step_length=0.05),
        stopping=StoppingRules(max_deviation=0.3, patience=10 * 0.05, put_back=True, waypoint_spacing=5 * SPACING),
    ),
    axes={"model": [PERFECT, CHAIN]},
    worlds=20,
    quick_worlds=3,
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
)


@claim(
    "window-lowers-error",
    "by-model",
    f"the adaptive window's mean absolute angular error is lower than perfect memory's{CLEARLY}",
    note=NOTE,
)
def _window_lowers_error(results: StudyResults) -> Decision:
    """Headings are more accurate when the view is compared only with a window of the sequence that adapts its size."""
    return _lower(results, f"{ANGULAR_ERROR} (°)", f"{ANGULAR_ERROR} (deg)", "mean_error_deg", ADAPTIVE)


@claim(
    "window-fails-less",
    "by-model",
    f"the adaptive window has fewer failures per route than perfect memory{CLEARLY}",
    note=NOTE,
)
def _window_fails_less(results: StudyResults) -> Decision:
    """There are fewer failures with an adaptive window than with perfect memory."""
    return _lower(results, FAIL_COUNT, "failures a route", "failures", ADAPTIVE)


PARAMETERS_AS_PUBLISHED = (
    *PARAMETERS[:5],
    Parameter("After a failure", "put back 5 views ahead of the nearest one; the window moves there", "the same"),
    Parameter(
        "Adaptive window",
        "20 views at first; n / size views more where the match is worse than before, else fewer; at least 10",
        "the same",
    ),
    Parameter("Starts", "at random, about 10 cm from the route", "on the route, and 10 cm to both sides"),
    Parameter("Fixed windows", "of many sizes", f"of {', '.join(map(str, FIXED))} views"),
    PARAMETERS[6],
)

DIFFERENCES_AS_PUBLISHED = (
    "The original looks for failures at every tenth step; here they are looked for at every step, so a short excursion counts as well.",
    "How much a match has become worse is judged by the RMS difference; the original's results are with other differences as well.",
    *DIFFERENCES[2:],
    "Starts are 10 cm to either side of the route, or on it. The original's code draws them with a standard deviation of 10 cm, and the "
    "first heading as well; whether the paper's figures have that is not known to us.",
    "The rule of the window is that of the original's public code (efkag/ant_world_alg_bench, source/navs/seqnav.py); which of its rules "
    "the paper's figures are made with is not known to us.",
)

AS_PUBLISHED = attrs.evolve(
    _PLAIN,
    experiment=_PLAIN.experiment.replace(stopping__put_back_ahead=5 * SPACING),
    axes={"model": [PERFECT, WINDOW, *map(_fixed, FIXED)], "start_offset": [-0.1, 0.0, 0.1]},
    quick_axes={"start_offset": [0.1]},
    parameters=PARAMETERS_AS_PUBLISHED,
    differences=DIFFERENCES_AS_PUBLISHED,
    measure=measure_windows,
    claims=(_window_lowers_error, _window_fails_less),
)

KAGIOULIS2024 = attrs.evolve(_PLAIN, as_published=AS_PUBLISHED)
