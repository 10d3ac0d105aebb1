"""Ardin et al. 2016 in the details that are known: the spiking circuit, the field of view and the preparation of the images."""

import math

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tussock.render.eye import Eye
from tussock.world.geometry import Route
from tussock.world.routes import in_equal_steps

from ...body import Body
from ...experiment import Experiment
from ...reports.claims import Decision, claim
from ...reports.effects import Effect, bootstrap
from ...reports.results import StudyResults
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .effects import least_over_routes
from .figures import boxes_by_model, lines_by_model
from .protocol import Item, Parameter, Protocol

PERFECT, BODY, INFOMAX, RANDOM = "perfect-memory", "spiking-mushroom-body", "infomax", "random"
NOTE = "Published as box plots only (figure 4D)."
PUT_BACK = {"reset": "at the next waypoint", "reset-nearest": "at the nearest point"}  # by the setting on_lost
SAMPLES = 4000  # of a bootstrap
SHARE = "share of the way from perfect memory to random"
MEMORIES = [PERFECT, BODY, INFOMAX]


def _layout(route: Route) -> Route:
    return in_equal_steps(route, 0.1, math.radians(2))


def _rules(put_back_at: str) -> StoppingRules:
    return StoppingRules(
        arrival_radius=0.2,
        max_deviation=0.2,
        max_steps=1000,
        put_back=True,
        put_back_at=put_back_at,
        waypoint_spacing=0.1,
    )


def measure(walks: pd.DataFrame) -> StudyResults:
    """Errors of each model: how often a walk was put back on the route, by where it was put back."""
    displacement_cm = (100 * walks["offset_m"].abs()).round().astype(int)
    put_back = walks["on_lost"].map(PUT_BACK)
    walks = walks.assign(errors=walks["resets"].astype(float), displacement_cm=displacement_cm, put_back=put_back)
    settings, measured = (
        ["model", "put_back", "place", "displacement_cm", "offset_m"],
        ["arrived", "steps", "mean_deviation_m"],
    )
    columns = [*settings, "errors", *measured]
    tables, numbers = {"walks": walks[columns]}, {}
    for name, some in walks[columns].groupby("put_back", sort=False):
        tables[f"walks {name}"] = some
        for model, errors in some.groupby("model", sort=False)["errors"]:
            numbers[f"errors, {model}, {name}"] = float(errors.mean())
        value, low, high = share_of_the_way(some)
        numbers |= {f"{SHARE}, {name}": value, f"{SHARE}, {name}, low": low, f"{SHARE}, {name}, high": high}
    tables["by_model"] = _by(walks, ["model", "put_back"])
    tables["by_displacement"] = _by(walks, ["model", "put_back", "displacement_cm"])
    tables["by_route"] = _by(walks, ["model", "put_back", "place"])
    return StudyResults(tables=tables, numbers=numbers)


def _by(walks: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Mean errors per walk, with an interval over routes where there are enough, and the share that arrived."""
    rows = []
    for values, some in walks.groupby(columns, sort=False):
        of_routes = some.groupby("place")["errors"].mean().to_numpy()
        low, high = bootstrap(len(of_routes), lambda rows, errors=of_routes: float(errors[rows].mean()), SAMPLES)
        row = dict(zip(columns, values, strict=True))
        row |= {"errors a walk": some["errors"].mean(), "low": low, "high": high, "arrived": some["arrived"].mean()}
        rows.append(row | {"routes": len(of_routes), "walks": len(some)})
    return pd.DataFrame(rows)


def share_of_the_way(walks: pd.DataFrame, body: str = BODY) -> tuple[float, float, float]:
    """How far the errors of the mushroom body lie on the way from perfect memory's (0) to random's (1).

    Args:
        walks: With the columns model, place and errors.
        body: The model in question.

    Returns:
        The share, and the ends of its interval over routes: nan for fewer than MIN_UNITS.
    """
    means = walks.pivot_table(index="place", columns="model", values="errors", aggfunc="mean")
    of_routes = means[[PERFECT, body, RANDOM]].to_numpy(float)
    ends = bootstrap(len(of_routes), lambda rows: share_of(of_routes[rows].mean(axis=0)), SAMPLES)
    return share_of(of_routes.mean(axis=0)), *ends


def share_of(errors: np.ndarray) -> float:
    """The share of errors (perfect memory, mushroom body, random); nan where random makes as many as perfect memory."""
    perfect, body, random = errors
    return float((body - perfect) / (random - perfect)) if random != perfect else math.nan


def _errors(results: StudyResults, model: str) -> dict[str, float]:
    """Errors per walk of a model, by where it is put back."""
    labels = {f"errors, {model}, {name}": f"errors a walk, {model}, {name}" for name in PUT_BACK.values()}
    return {label: results.numbers[key] for key, label in labels.items() if key in results.numbers}


def _tables(results: StudyResults) -> dict[str, pd.DataFrame]:
    """The walks by where agents are put back."""
    tables = {name: results.tables.get(f"walks {name}") for name in PUT_BACK.values()}
    return {name: table for name, table in tables.items() if table is not None}


@claim(
    "random-worst",
    "by-model",
    "each of the others makes fewer errors per walk than random, with both ways of putting back",
    note=NOTE,
)
def _random_worst(results: StudyResults) -> Decision:
    """All three memories make fewer errors than a random choice of direction."""
    random = _errors(results, RANDOM)
    others = [_errors(results, model) for model in MEMORIES]
    obtained = {label: value for each in (*others, random) for label, value in each.items()}
    worst = zip(*(each.values() for each in others), strict=True)
    effect = least_over_routes(
        "random's errors minus those of the worst other",
        _tables(results),
        "errors",
        lambda mean: mean[RANDOM] - mean[MEMORIES].max(),
    )
    return Decision(obtained, all(max(some) < most for some, most in zip(worst, random.values(), strict=True)), effect)


@claim(
    "perfect-best", "by-model", "no other model makes fewer errors per walk, with both ways of putting back", note=NOTE
)
def _perfect_best(results: StudyResults) -> Decision:
    """Perfect memory, which stores every view, makes the fewest errors."""
    perfect = _errors(results, PERFECT)
    others = [_errors(results, model) for model in (BODY, INFOMAX, RANDOM)]
    obtained = {label: value for each in (perfect, *others) for label, value in each.items()}
    best = zip(*(each.values() for each in others), strict=True)
    effect = least_over_routes(
        "errors of the best other minus perfect memory's",
        _tables(results),
        "errors",
        lambda mean: mean[[BODY, INFOMAX, RANDOM]].min() - mean[PERFECT],
    )
    return Decision(
        obtained, all(least <= min(some) for some, least in zip(best, perfect.values(), strict=True)), effect
    )


@claim(
    "body-close",
    "by-model",
    "its errors lie in the first tenth of the way from perfect memory's to random's, with both ways of putting back",
    note=NOTE,
)
def _body_close(results: StudyResults) -> Decision:
    """The mushroom body follows routes nearly as well as perfect memory."""
    obtained = {
        name: value for name, value in results.numbers.items() if name.startswith(SHARE) and not math.isnan(value)
    }
    shares = {
        name: results.numbers[f"{SHARE}, {name}"] for name in PUT_BACK.values() if f"{SHARE}, {name}" in results.numbers
    }
    if any(map(math.isnan, shares.values())):
        return Decision(obtained, None)
    worst = max(shares, key=shares.__getitem__)
    low, high = (results.numbers[f"{SHARE}, {worst}, {end}"] for end in ("low", "high"))
    routes = results.tables["walks"]["place"].nunique()
    effect = Effect(label=f"{SHARE}, {worst}", value=shares[worst], low=low, high=high, units=routes, of="routes")
    return Decision(obtained, shares[worst] <= 0.1, effect)


CLAIMS = (_random_worst, _perfect_best, _body_close)

PARAMETERS = (
    Parameter("Routes", "15 of about 8 m in the Sussex world", "those given, or 15 generated ones of 8 m"),
    Parameter(
        "Layout of a route",
        "straight steps of 10 cm in multiples of 2 degrees (code): an agent that never errs stands where it has learned",
        "the same",
    ),
    Parameter("Views learned", "every 10 cm of the route", "every 10 cm of the route"),
    Parameter("Field of view", "296 degrees", "296 degrees, -15 to 60 degrees of elevation"),
    Parameter(
        "View",
        "green channel, means of the central half of blocks of 8 x 8 pixels: 74 x 19 at 4 degrees; inverted; CLAHE, clip 40, 8 x 8 "
        "tiles; bicubic to 36 x 10; anew at each heading",
        "the same",
    ),
    Parameter("Step", "10 cm", "10 cm"),
    Parameter("Scan", "120 degrees in steps of 2", "120 degrees in steps of 2"),
    Parameter("Error", "more than 20 cm off the route", "the same"),
    Parameter(
        "After an error",
        "text: put back at the nearest point of the route; code: at the waypoint after the furthest one reached",
        "both; waypoints every 10 cm",
    ),
    Parameter("Arrival", "within 20 cm", "within 20 cm"),
    Parameter("Steps", "1,000 at most", "1,000 at most"),
    Parameter(
        "Starts", "on the route, and displaced by 5 to 25 cm", "on the route, and 5, 10, 15, 20 and 25 cm to both sides"
    ),
    Parameter(
        "Mushroom body", "360 projection neurons, 20,000 Kenyon cells of 10 inputs, one output; spiking", "the same"
    ),
    Parameter(
        "Spikes", "Izhikevich's neurons (paper); leaky integrate-and-fire (public code)", "leaky integrate-and-fire"
    ),
    Parameter(
        "Ties of the output", "the first heading of the scan", "the heading with less input to the output neuron"
    ),
)

DIFFERENCES = (
    "The constants of the circuit are those of its public reimplementation (BoB robotics, projects/ardin_mb). Each view starts with a "
    "circuit at rest; there, tags and dopamine of one learned view reach into the next, 80 ms later.",
    "An agent that walks 3 m without progress along the route, or leaves the world, is put back as well, and that is an error.",
    "A start at 25 cm is put back at once, which is one error of every model.",
    "Unknown, and chosen by us: perfect memory compares by the RMS difference; the learning rate of Infomax.",
    "The control draws a random heading for each different view; it draws the same one where it meets the same view again.",
)


def _boxes(put_back: str) -> Item:
    def draw(walks: pd.DataFrame) -> Figure:
        return boxes_by_model(walks, "errors", "errors per walk")

    return Item(
        f"boxes-{put_back.split()[-2]}",
        f"Errors of each model, put back {put_back}",
        f"walks {put_back}",
        "Median, quartiles, lowest and highest of all walks, as in figure 4D of the paper.",
        draw,
    )


ITEMS = (
    Item(
        "by-model",
        "Errors of all walks",
        "by_model",
        "Mean errors per walk over all routes and displacements; low and high: 95 % interval over routes, where there are at least five. "
        "Arrived: share of the walks that arrived within 1,000 steps.",
    ),
    *map(_boxes, PUT_BACK.values()),
    Item(
        "errors",
        "Errors against displacement, put back at the next waypoint",
        f"walks {PUT_BACK['reset']}",
        "Mean errors per walk; bars are standard errors of the mean.",
        lambda walks: lines_by_model(
            walks, "displacement_cm", "errors", "displacement of the start (cm)", "errors per walk"
        ),
    ),
    Item(
        "by-displacement",
        "Errors by displacement",
        "by_displacement",
        "Mean errors per walk, over all routes and both sides.",
    ),
    Item("by-route", "Errors by route", "by_route", "Mean errors per walk, over all displacements."),
)

ARDIN2016_AS_PUBLISHED = Protocol(
    name="ardin2016-as-published",
    title="Errors along a route: perfect memory, a spiking mushroom body, Infomax, chance",
    paper="Ardin P, Peng F, Mangan M, Lagogiannis K, Webb B (2016). Using an insect mushroom body circuit to encode route memory in "
    "complex natural environments. PLoS Computational Biology 12(2), e1004683.",
    question="Does a spiking mushroom body follow routes nearly as well as perfect memory?",
    experiment=Experiment(
        eye=Eye(width=720, height=152, samples=1, field=math.radians(296)),
        encoding="green 1 | centre-means 8 4 | invert | head-views 74 2 40 8 36 10",
        navigator="scan width_deg=120 refine=false",
        route_length=8.0,
        training=TrainingSetup(spacing=0.1, learning_walk=0.0),
        body=Body(step_length=0.1),
        stopping=_rules("next-waypoint"),
    ),
    axes={
        "model": (PERFECT, BODY, f"{INFOMAX} rate={20 / 360**2:.3g}", RANDOM),  # docs/protocols.md: how it was chosen
        "stopping": (_rules("next-waypoint"), _rules("nearest-point")),
        "start_offset": (0.0, *(side * each for each in (0.05, 0.10, 0.15, 0.20, 0.25) for side in (1, -1))),
    },
    worlds=15,
    quick_worlds=2,
    quick_axes={"start_offset": (0.0, 0.1, -0.1)},
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
    layout=_layout,
)
