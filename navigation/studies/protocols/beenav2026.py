"""Bee-Nav 2026: how far from home a small network, trained on a learning flight, leads back, with the noise of several path integrators."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tussock.render.eye import Eye
from tussock.world.geometry import Route

from ...body import Body
from ...experiment import Experiment
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...sense_models import COMPARED
from ...stopping import StoppingRules
from ...sweeps.spec import Change
from ...training_setup import TrainingSetup
from .effects import over_routes
from .figures import lines_by_model
from .intervals import INTERVALS, intervals
from .protocol import Item, Parameter, Protocol

NETWORK = "home-vector"
BODY = {"body__step_length": 2.5}  # m, the longest step of the original; a step is 0.1 m and 0.4 / 3 of the home vector
OF_NETWORK = f"{NETWORK} slowest=0.04 whole_step_at=18"
STEP = 0.5  # m, of all others
VECTOR = "path-integration arrival=0.5 growth=2"
FLIGHT = 11.0  # m: how far from home the learning flight leads
DISTANCES, STARTS = (5.0, 10.0, 15.0, 20.0, 25.0), 16  # m from home; number of directions
WITHIN = 10.0  # m: starts that lie within the learning flight
MIN_SUCCESS = 0.9


def starts(distances: tuple[float, ...], count: int) -> list[Change]:
    """Releases on circles about home."""
    directions = 2 * np.pi * np.arange(count) / count
    return [
        {"release": distance, "release_direction": round(direction, 9)}
        for distance in distances
        for direction in directions.tolist()
    ]


def steering() -> list[Change]:
    """What steers, and with which senses: the network and path integration with all, the others with ideal ones."""
    noisy: list[Change] = [
        {"navigator": navigator, "senses": senses} | body
        for navigator, body in ((OF_NETWORK, BODY), (VECTOR, {}))
        for senses in COMPARED
    ]
    return [
        *noisy,
        *({"navigator": name, "senses": "ideal"} for name in ("homing width_deg=360", "average-landmark-vector")),
    ]


def flights(count: int) -> list[Change]:
    """Each steering from each start. Path integration has other noise at each start; a network learns once for all."""
    first = [tuple(start.values()) for start in starts(DISTANCES, STARTS)]
    return [
        steer | start | ({"seed": first.index(tuple(start.values()))} if steer["navigator"] == VECTOR else {})
        for steer in map(dict, steering())
        for start in map(dict, starts(DISTANCES, count))
    ]


def measure(walks: pd.DataFrame) -> StudyResults:
    """Share of walks that come home, by what steers, the senses and the distance of the start."""
    navigators = walks["navigator"].str.split().str[0]
    walks = walks.assign(
        model=navigators + ", " + walks["senses"] + " senses",
        navigator=navigators,
        place=walks["world_seed"],
        home=walks["arrived"].astype(float),
    )
    table = walks.pivot_table("home", ["navigator", "senses"], "release_m", sort=False)
    table.columns = [f"{distance:g} m" for distance in table.columns]
    kept = ["model", "navigator", "senses", "place", "release_m", "release_deg", "arrived", "home", "steps", "goal_m"]
    ideal = walks[(walks["navigator"] == NETWORK) & (walks["senses"] == "ideal")]
    near = ideal[ideal["release_m"] <= WITHIN]
    return StudyResults(
        tables={
            "by_distance": table.reset_index(),
            "walks": walks[kept],
            "intervals": intervals(walks, {"arrived": "share that came home, from all distances"}),
        },
        numbers={
            f"share that came home from up to {WITHIN:g} m": float(near["home"].mean()),
            "share that came home from all distances": float(ideal["home"].mean()),
        },
    )


def _of_network(results: StudyResults) -> pd.DataFrame:
    walks = results.tables["walks"]
    return walks[(walks["navigator"] == NETWORK) & (walks["senses"] == "ideal")]


@claim(
    "home-from-learned-area",
    "success",
    f"at least {MIN_SUCCESS:.0%} of its walks that start up to {WITHIN:g} m from home come home, with ideal senses",
    note="Published for real flights: all of 30 to 110 m end within 0.5 m of home, and 70 % of 200 to 600 m, with path integration before.",
)
def _home_from_learned_area(results: StudyResults) -> Decision:
    """A tiny network that was trained on a learning flight leads home from within the area of this flight."""
    walks = _of_network(results)
    near = walks[walks["release_m"] <= WITHIN].assign(model=NETWORK)
    share = float(near["home"].mean())
    effect = over_routes("share that comes home", near, "home", lambda means: float(means[NETWORK]))
    return Decision({f"share that came home from up to {WITHIN:g} m": share}, share >= MIN_SUCCESS, effect)


@claim(
    "falls-outside",
    "success",
    f"fewer of its walks come home from the farthest starts than from {WITHIN:g} m, and the 95 % interval of the difference excludes 0",
    note="Published as a curve.",
)
def _falls_outside(results: StudyResults) -> Decision:
    """Outside of the area of the learning flight, it leads home less often."""
    walks = _of_network(results)
    farthest, means = walks["release_m"].max(), walks.groupby("release_m")["home"].mean()
    effect = over_routes(
        f"share from {WITHIN:g} m minus share from {farthest:g} m",
        walks,
        "home",
        lambda each: float(each[WITHIN] - each[farthest]),
        by="release_m",
    )
    obtained = {f"share that came home from {distance:g} m": float(share) for distance, share in means.items()}
    if np.isnan(effect.low):
        return Decision(obtained, None, effect, reason="there are too few worlds for an interval")
    return Decision(obtained, effect.low > 0, effect)


PARAMETERS = (
    Parameter("Worlds", "10 forests of 15 or 40 trees within 50 m", "the same (15; 40 by --world 'orchard trees=40')"),
    Parameter("Trees", "at least 5 m apart and from home, at most 3 within 10 m", "the same"),
    Parameter("Learning flight", "147 views on 5 turns, growing to 11 m", "147 views on a spiral of 5 turns to 11 m"),
    Parameter("Starts", "16 on circles of 5, 10, 15, 20 and 25 m", "the same"),
    Parameter("Network's steps", "0.1 m + 0.4 / 3 of the home vector, at most 2.5 m", "the same"),
    Parameter("Steps of others", "0.5 m", "0.5 m"),
    Parameter("End", "within 1.2 m of home, or after 50 steps", "the same"),
    Parameter("Camera", "1.5 m high", "1.5 m high"),
    Parameter("Network", "3.4 or 42 kB in the robot", "3.4 kB"),
)

DIFFERENCES = (
    "Trees are of our generator, 6 m high by the median, on a plain ground under a plain sky. The original has rendered trees.",
    "Views are vertical edges of skylines, 45 x 9 pixels, chosen among four encodings in the orchards of seeds 100 to 103, which are not "
    "those of the page; those of the original are in colour, 1024 x 400.",
    "The network is ours: convolutional around the horizon, so that a turned view turns the home vector. The original trains a "
    "common one on views in all rotations.",
    "The learning flight is a spiral in one direction; that of the original swings back on one side, and so covers the same circles in "
    "alternating directions. Its views face home, which makes no difference for this network.",
    "Agents fly through trees; those of the original are pushed away from them.",
    "Agents start facing home, the original's anywhere. What steers here turns to any direction at its first look.",
    "Noise of the senses is on the places that are learned along the flight, and on path integration, out and back. Path "
    "integration alone flies straight out, and at the end of its vector searches in loops.",
    "One draw of noise for the learning flight with each kind of senses, the same in all worlds; path integration has one for each start.",
    "The snapshot model of the original is not here; the average landmark vector stands for models of one view.",
)


def _success(walks: pd.DataFrame, navigators: tuple[str, ...], senses: str | None) -> Figure:
    shown = walks[walks["navigator"].isin(navigators)]
    shown = shown if senses is None else shown[shown["senses"] == senses]
    column = "senses" if senses is None else "navigator"
    return lines_by_model(
        shown.assign(model=shown[column]), "release_m", "home", "distance of the start (m)", "share that comes home"
    )


ITEMS = (
    Item(
        "success",
        "Coming home, with ideal senses",
        "walks",
        "Share of walks that end within 1.2 m of home, over all worlds and directions; bars are 95 % intervals over worlds, from five on.",
        lambda walks: _success(walks, (NETWORK, "path-integration", "homing", "average-landmark-vector"), "ideal"),
    ),
    Item(
        "noise",
        "The network, by the senses with which it learned",
        "walks",
        "As above.",
        lambda walks: _success(walks, (NETWORK,), None),
    ),
    Item(
        "path-integration",
        "Path integration alone, by the senses",
        "walks",
        "As above.",
        lambda walks: _success(walks, ("path-integration",), None),
    ),
    Item("by-distance", "Share that comes home", "by_distance", "Over all worlds and directions."),
    INTERVALS,
)

BEENAV2026 = Protocol(
    name="beenav2026",
    title="Home by a tiny network, after a learning flight",
    paper="Bee-Nav (2026). Efficient robot navigation inspired by honeybee learning flights. Nature.",
    question="From how far away does a small network that was trained on a learning flight lead home, and how much noise of path "
    "integration does its training stand?",
    world="orchard",
    experiment=Experiment(
        world="orchard",
        route=Route.through(np.array([[0.0, -2.0], [0.0, 0.0]])),  # its end is home
        eye=Eye(width=360, height=75, z=1.5),
        encoding="foreground-mask | vertical-edges | resize 8 | normalise",
        navigator=OF_NETWORK,
        training=TrainingSetup(goal_walk=FLIGHT, goal_turns=5.0, goal_views=147, goal_only=True),
        stopping=StoppingRules(arrival_radius=1.2, max_deviation=1000.0, patience=1000.0, max_steps=50),
        body=Body(step_length=STEP),
    ),
    axes={"flight": flights(STARTS), "model": ["perfect-memory"]},
    worlds=10,
    quick_worlds=2,
    quick_axes={"flight": flights(4)},
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=(_home_from_learned_area, _falls_outside),
    items=ITEMS,
)
