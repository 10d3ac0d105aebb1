"""Stone et al. 2017: path integration by the central complex, on 1,000 random flights at five levels of noise."""

import math

import numpy as np
import pandas as pd
from jaxtyping import Float

from tussock.world.progress import Progress, no_progress

from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...sense_models import COMPARED, as_senses
from ...steering.ring_circuit import CentralComplex
from ..outbound_paths import Flight, HomeVectorErrors, errors_of, fly_home, home_vectors, random_flights
from ..sensed_paths import errors_of_senses
from .protocol import Item, Parameter
from .stone2017_figures import draw_errors, draw_flights, draw_home, draw_search, draw_senses
from .worldless import WorldlessProtocol

PATHS, QUICK_PATHS = 1000, 100
NOISES, QUICK_NOISES = (0.0, 0.1, 0.2, 0.3, 0.4), (0.0, 0.1, 0.3)  # standard deviation of the noise on every rate
PAPER_NOISE = 0.1
STEPS = (100, 250, 500, 1000, 1500)  # out
HOME_STEPS, QUICK_HOME_STEPS = 1500, 750
HOME = 20.0  # units from the nest: a bee has come home
SEARCH = 1 / 3  # last share of the flight home, in which bees search
SHOWN_BEES, SHOWN_EVERY = 6, 10  # in the figures of flights
SEARCHING_BEES, SEARCHING_EVERY = 100, 20  # in the figure of the search
UNIT = 0.5  # of the circuit: distances are in the paper's unit
TENTH, MOST = 0.1, 0.95
# Bee-Nav (2026): 240 steps of 0.5 s at 2.5 m/s
SENSED_STEPS, SENSED_STEP, SENSED_SPEED = (30, 60, 120, 240), 1.25, 2.5


def measure(seed: int = 0, quick: bool = False, progress: Progress = no_progress) -> StudyResults:
    """Errors of home vectors, flights home, and the search about the nest, by noise; and errors of vectors by senses."""
    paths, noises = (QUICK_PATHS, QUICK_NOISES) if quick else (PATHS, NOISES)
    flight = random_flights(paths, STEPS[-1], np.random.default_rng([seed, 0]))
    steps, parts = np.array(STEPS), len(noises) + 1
    errors, homes, tables = [], [], {"flights": [], "home": [], "search": []}
    for number, noise in enumerate(noises):
        progress(number, parts)
        circuit, random = CentralComplex(noise=noise, unit=UNIT), np.random.default_rng([seed, 1, number])
        vectors, activity = home_vectors(circuit, flight, steps, random)
        errors += _error_rows("noise", noise, errors_of(vectors, flight, steps))
        way = fly_home(circuit, activity, flight, QUICK_HOME_STEPS if quick else HOME_STEPS, random)
        homes.append({"noise": noise, **_of_home(way), "saturated memories": float(activity.is_saturated.mean())})
        for name, table in (("home", _distances(way)), ("search", _searched(way)), ("flights", _shown(flight, way))):
            tables[name].append(table.assign(noise=noise))
    progress(len(noises), parts)
    by_senses = pd.DataFrame(_of_senses(paths, seed))
    progress(parts, parts)
    return StudyResults(
        tables={
            "errors": pd.DataFrame(errors),
            "homing": pd.DataFrame(homes),
            "senses": by_senses,
            **{name: pd.concat(each, ignore_index=True) for name, each in tables.items()},
        },
        numbers={"flights": paths, "levels of noise": len(noises), "steps home": way.shape[1]},
    )


def _error_rows(by: str, value: object, errors: HomeVectorErrors) -> list[dict[str, object]]:
    """A row for each number of steps: medians over the ways, and the quartiles of the error as a share of the end distance."""
    share = errors.distance / errors.end_distance
    low, middle, high = np.percentile(share, (25, 50, 75), axis=0)
    columns = {
        "steps out": errors.steps,
        "path length": np.median(errors.path_length, axis=0),
        "end distance": np.median(errors.end_distance, axis=0),
        "angle (deg)": np.degrees(np.median(np.abs(errors.angle), axis=0)),
        "error": np.median(errors.distance, axis=0),
        "error / end distance": middle,
        "low quartile": low,
        "high quartile": high,
        "error / path length": np.median(errors.distance / errors.path_length, axis=0),
        "under 10 % of the end distance": (share < TENTH).mean(axis=0),
    }
    return [{by: value, **{name: each[k] for name, each in columns.items()}} for k in range(len(errors.steps))]


def _of_home(way: Float[np.ndarray, "n steps 2"]) -> dict[str, float]:
    """How near bees come to the nest, after how many steps, and how far from it they search."""
    distance = np.linalg.norm(way, axis=2)
    within = distance < HOME
    arrived = within.any(axis=1)
    searching = distance[:, round((1 - SEARCH) * distance.shape[1]) :]
    return {
        f"came within {HOME:g} units": float(arrived.mean()),
        "smallest distance": float(np.median(distance.min(axis=1))),
        "steps until there": float(np.median(within[arrived].argmax(axis=1))) if arrived.any() else math.nan,
        "distance in the search": float(np.median(searching)),
    }


def _distances(way: Float[np.ndarray, "n steps 2"]) -> pd.DataFrame:
    """Distance from the nest in the flight home: quartiles over the bees, every few steps."""
    low, middle, high = np.percentile(np.linalg.norm(way[:, ::SHOWN_EVERY], axis=2), (25, 50, 75), axis=0)
    steps = np.arange(0, way.shape[1], SHOWN_EVERY) + 1
    return pd.DataFrame({"steps home": steps, "low quartile": low, "median": middle, "high quartile": high})


def _searched(way: Float[np.ndarray, "n steps 2"]) -> pd.DataFrame:
    """Positions of some bees in the search."""
    some = way[:SEARCHING_BEES, round((1 - SEARCH) * way.shape[1]) :: SEARCHING_EVERY].reshape(-1, 2)
    return pd.DataFrame(some.round(2), columns=["x", "y"])


def _shown(flight: Flight, way: Float[np.ndarray, "n steps 2"]) -> pd.DataFrame:
    """Some flights out and home."""
    tables = []
    for bee in range(min(SHOWN_BEES, len(way))):
        for part, xy in (("out", flight.position[bee]), ("home", way[bee])):
            table = pd.DataFrame(xy[::SHOWN_EVERY].round(2), columns=["x", "y"])
            tables.append(table.assign(bee=bee, part=part))
    return pd.concat(tables, ignore_index=True)


def _of_senses(paths: int, seed: int) -> list[dict[str, object]]:
    headings = random_flights(paths, SENSED_STEPS[-1], np.random.default_rng([seed, 2])).heading
    rows = []
    for number, name in enumerate(COMPARED):
        senses, random = as_senses(f"{name} speed={SENSED_SPEED}").make(), np.random.default_rng([seed, 3, number])
        rows += _error_rows(
            "senses", name, errors_of_senses(senses, headings, SENSED_STEP, np.array(SENSED_STEPS), random)
        )
    return rows


@claim(
    "within-a-tenth",
    "errors",
    f"at noise {PAPER_NOISE:g} the median error is under 10 % of the end distance after each number of steps out",
    note="Published as curves only.",
)
def _within_a_tenth(results: StudyResults) -> Decision:
    """The circuit integrates paths well in spite of noise on all its neurons."""
    table = results.tables["errors"]
    shares = table[table["noise"] == PAPER_NOISE].set_index("steps out")["error / end distance"]
    obtained = {f"error / end distance after {steps} steps": float(share) for steps, share in shares.items()}
    return Decision(obtained, bool((shares < TENTH).all()))


@claim("grows-with-noise", "errors", "the median error of the longest flights is larger at each higher level of noise")
def _grows_with_noise(results: StudyResults) -> Decision:
    """The home vector becomes less exact with noise."""
    table = results.tables["errors"]
    errors = table[table["steps out"] == STEPS[-1]].set_index("noise")["error"]
    obtained = {f"error at noise {noise:g}": float(error) for noise, error in errors.items()}
    return Decision(obtained, bool((errors.diff().dropna() > 0).all()))


@claim(
    "comes-home",
    "home",
    f"at noise {PAPER_NOISE:g} at least 95 % of the bees come within {HOME:g} units of the nest",
    note="The threshold is ours.",
)
def _comes_home(results: StudyResults) -> Decision:
    """The memory steers bees back to the nest."""
    homing = results.tables["homing"].set_index("noise")
    share = float(homing.loc[PAPER_NOISE, f"came within {HOME:g} units"])
    return Decision({f"came within {HOME:g} units": share}, share >= MOST)


@claim(
    "searches",
    "search",
    f"at noise {PAPER_NOISE:g} the median distance in the last third of the flight home is under {HOME:g} units",
    note="The threshold is ours. The circuit has no part that makes it search.",
)
def _searches(results: StudyResults) -> Decision:
    """Bees that have come back search about the nest."""
    homing = results.tables["homing"].set_index("noise")
    distance = float(homing.loc[PAPER_NOISE, "distance in the search"])
    return Decision({"distance in the search": distance}, distance < HOME)


PARAMETERS = (
    Parameter("Circuit", "16 TL2, 16 CL1, 8 TB1, 2 TN2, 16 CPU4, 16 pontine and 16 CPU1 neurons", "the same"),
    Parameter("Noise", "standard deviation 0.1 on every rate", "0, 0.1, 0.2, 0.3 and 0.4"),
    Parameter("Memory", "gain 0.0025, loss 0.125", "the same"),
    Parameter("Turns out", "von Mises, concentration 100, filtered", "the same"),
    Parameter("Acceleration", "0 to 0.15 out, 0.1 home; drag 0.15", "the same"),
    Parameter("Flights", "1,000", "1,000; up to 1,500 steps out, 1,500 steps home"),
    Parameter("Senses", "Bee-Nav (2026): 240 steps of 0.5 s at 2.5 m/s, 1,000 runs", "the same, with our turns"),
)

DIFFERENCES = (
    "The paper shows its results as curves; the thresholds of the claims are ours.",
    "The home vector is the first Fourier component of the memory, scaled by what a step of time adds at this noise, the mean over all "
    "headings. No neuron computes it.",
    "All levels of noise have the same flights out.",
    "The noise of senses belongs to another study (Bee-Nav 2026), whose ways out are not known: turns are those of the flights here.",
)

ITEMS = (
    Item(
        "errors",
        "Error of the home vector",
        "errors",
        "Medians over the flights, by noise. Distances are in the paper's unit. The dotted line is a tenth of the end distance.",
        draw_errors,
    ),
    Item(
        "errors-table",
        "Errors in numbers",
        "errors",
        "Medians over the flights, and quartiles of the error as a share of the end distance.",
    ),
    Item(
        "flights",
        "Some flights",
        "flights",
        "Out (grey) and home (red), of the same bees. The cross is the nest.",
        draw_flights,
    ),
    Item(
        "home",
        "Flights home",
        "home",
        "Distance from the nest: median and quartiles over the bees, by noise.",
        draw_home,
    ),
    Item("homing", "Homing in numbers", "homing", "Medians over the bees, and shares of them."),
    Item(
        "search",
        "The search",
        "search",
        f"Positions of {SEARCHING_BEES} bees in the last third of the flight home. The circle has a radius of {HOME:g} units.",
        draw_search,
    ),
    Item(
        "senses",
        "Home vectors by noisy senses",
        "senses",
        "The navigator `path-integration` sums up steps by compass and odometry, with the published noise of each model of senses.",
        draw_senses,
    ),
    Item("senses-table", "Senses in numbers", "senses", "As above; distances in metres."),
)

STONE2017 = WorldlessProtocol(
    name="stone2017",
    title="Path integration by a model of the central complex",
    paper="Stone T, Webb B, Adden A, Weddig NB, Honkanen A, Templin R, Wcislo W, Scimeca L, Warrant E, Heinze S (2017). An anatomically "
    "constrained model for path integration in the bee brain. Current Biology 27(20), 3069-3085.",
    question="How well does a ring circuit with noise on all its neurons know the way home, and does it steer bees there?",
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    claims=(_within_a_tenth, _grows_with_noise, _comes_home, _searches),
    items=ITEMS,
    measure=measure,
)
