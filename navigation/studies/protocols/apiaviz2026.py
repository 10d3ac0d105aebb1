"""ApiaViz 2026: six ways to preprocess what an ant sees, before the same spiking mushroom body."""

import dataclasses
import math

import numpy as np
import pandas as pd

from tussock.render.eye import Eye
from tussock.world.scene import Ground, World

from ...body import Body
from ...encoding import Encoding
from ...experiment import Experiment
from ...intervals import MIN_WORLDS
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...significance import holm, sign_flip_p
from ...stopping import StoppingRules
from ...training_setup import TrainingSetup
from .crossed import crossed_interval
from .figures_published import beside
from .protocol import Item, Parameter, Protocol

APIA, ARDIN = "ApiaViz", "Ardin-style"
INPUTS = {
    APIA: "green-blue | apia-planes 2",
    "grey": "green-blue | grey-planes",
    "raw colour": "green-blue | colour-planes",
    "opponency": "green-blue | opponent-planes",
    "Sobel + colour": "green-blue | sobel-planes 2",
    ARDIN: "green-blue | luminance | invert | clahe 2.56 10 | ardin-planes",
}
TRIALS = 40
PUBLISHED = {  # completed of TRIALS, mean deviation (cm)
    APIA: (29, 55.22), "grey": (25, 63.38), "raw colour": (26, 38.00), "opponency": (27, 69.88), "Sobel + colour": (29, 50.39),
    ARDIN: (6, 104.72),
}  # fmt: skip
PUBLISHED_DIFFERENCES = {  # from ApiaViz (cm): mean, ends of the crossed interval, p after Holm's correction
    "grey": (8.16, -28.48, 43.87, 1.0), "raw colour": (-17.22, -77.92, 23.77, 1.0), "opponency": (14.66, -31.37, 83.21, 1.0),
    "Sobel + colour": (-4.83, -58.19, 56.16, 1.0), ARDIN: (49.50, -21.18, 104.30, 0.1953),
}  # fmt: skip
ANTS, SEEDS = (4, 6, 7, 9, 10, 12, 13, 15), (19, 31, 43, 59, 71)
SKY, GROUND = (135, 206, 235), (80, 140, 60)
TINTED, CHROMA = 0.5, 60.0  # share of the triangles with a tint, and its strength
EDGE = 75 / 17 / 2  # degrees: its rows lie at 60, .. -15 degrees, so half a row is above and below
COMPLETED, DEVIATION = "completed", "mean deviation (cm)"


def coloured(world: World) -> World:
    """The original's colours, of a world that has none of its own: tints of the same brightness on half of the triangles.

    A tinted triangle is either greener and less blue, or bluer and less green. Worlds with colours stay as they are.
    """
    rgb = world.rgb
    if world.texturing is not None or not ((rgb[:, [0, 2]] == 0).all() or (rgb == rgb[:, :1]).all()):
        return world
    random = np.random.default_rng(99)  # the original's seed, of another generator
    shade = rgb.max(axis=1).astype(float)
    light = 255 * (shade - shade.min()) / max(1.0, np.ptp(shade))
    tinted, sign = random.random(len(light)) < TINTED, random.choice((-1.0, 1.0), len(light))
    tint = np.where(tinted, CHROMA * sign, 0.0)
    painted = np.column_stack([light, light + tint, light - tint]).clip(0, 255).round().astype(np.uint8)
    ground = None if world.ground is None else Ground(GROUND, world.ground.bounds)
    return dataclasses.replace(world, rgb=painted, ground=ground, sky_rgb=SKY)


def measure(walks: pd.DataFrame) -> StudyResults:
    """Completed walks and deviation of each input, and differences from ApiaViz."""
    names = {str(Encoding.parse(chain)): name for name, chain in INPUTS.items()}
    walks = walks.assign(input=walks["encoding"].map(names), deviation_cm=100 * walks["mean_deviation_m"])
    walks["completed"] = walks["arrived"].astype(float)
    inputs = [name for name in INPUTS if name in set(walks["input"])]
    by_input = pd.DataFrame([_row_of(name, walks) for name in inputs])
    differences = _differences(walks, inputs)
    by_route = walks.pivot_table(index="place", columns="input", values="deviation_cm", aggfunc="mean", sort=False)
    kept = ["input", "place", "seed", "arrived", "deviation_cm", "steps"]
    return StudyResults(
        tables={
            "by_input": by_input,
            "differences": differences,
            "by_route": by_route[inputs].reset_index(),
            "walks": walks[kept],
        },
        numbers={
            f"{name}, {row['input']}": row[name] for _, row in by_input.iterrows() for name in (COMPLETED, DEVIATION)
        }
        | {"routes": walks["place"].nunique(), "seeds": walks["seed"].nunique()}
        | {f"p, {row['input']}": row["p (Holm)"] for _, row in differences.iterrows()},
    )


def _crossed(walks: pd.DataFrame, name: str, column: str) -> np.ndarray:
    """A column of the walks with an input: one row per route, one column per seed; without routes that lack a walk."""
    part = walks[walks["input"] == name]
    return part.pivot_table(index="place", columns="seed", values=column).dropna().to_numpy(float)


def _row_of(name: str, walks: pd.DataFrame) -> dict[str, object]:
    completed, deviation = (_crossed(walks, name, column) for column in ("completed", "deviation_cm"))
    published, of_deviation = PUBLISHED[name]
    ends = [*crossed_interval(completed), *crossed_interval(deviation)]
    return {
        "input": name,
        f"completed of {TRIALS}, published": published,
        "completed walks": int(completed.sum()),
        "walks": completed.size,
        "completed, published": published / TRIALS,
        COMPLETED: float(completed.mean()),
        "completed, low": ends[0],
        "completed, high": ends[1],
        f"{DEVIATION}, published": of_deviation,
        DEVIATION: float(deviation.mean()),
        f"{DEVIATION}, low": ends[2],
        f"{DEVIATION}, high": ends[3],
    }


def _differences(walks: pd.DataFrame, inputs: list[str]) -> pd.DataFrame:
    """Deviation less that of ApiaViz, paired by route and seed."""
    rows, apia = [], _crossed(walks, APIA, "deviation_cm")
    for name in inputs:
        other = _crossed(walks, name, "deviation_cm")
        if name == APIA or other.shape != apia.shape:
            continue
        paired = other - apia
        mean, low, high, p = PUBLISHED_DIFFERENCES[name]
        ours = crossed_interval(paired)
        numbers = (
            mean,
            low,
            high,
            float(paired.mean()),
            *ours,
            p,
            sign_flip_p(paired.mean(axis=1), np.arange(len(paired))),
        )
        rows.append([name, *numbers])
    columns = [
        "input",
        "published (cm)",
        "low",
        "high",
        "obtained (cm)",
        "low ",
        "high ",
        "p (Holm), published",
        "p (Holm)",
    ]
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(**{"p (Holm)": holm(table["p (Holm)"].tolist())})


def _enough(results: StudyResults) -> bool:
    return results.numbers["routes"] >= MIN_WORLDS


@claim(
    "counts-repeat",
    "completed",
    "each input's published share lies in the 95 % interval obtained",
    published={f"completed, {name}": count / TRIALS for name, (count, _) in PUBLISHED.items()},
)
def _counts_repeat(results: StudyResults) -> Decision:
    """The six inputs complete 29, 25, 26, 27, 29 and 6 of 40 walks."""
    table = results.tables["by_input"]
    inside = table["completed, published"].between(table["completed, low"], table["completed, high"]).all()
    obtained = {f"completed, {row['input']}": row[COMPLETED] for _, row in table.iterrows()}
    return Decision(obtained, bool(inside) if _enough(results) else None)


@claim(
    "ardin-least",
    "completed",
    "it completes less than each of the others",
    published={f"completed, {ARDIN}": 6 / TRIALS, "completed, least of the others": 25 / TRIALS},
)
def _ardin_least(results: StudyResults) -> Decision:
    """Input in the style of Ardin et al. completes the fewest walks."""
    shares = results.tables["by_input"].set_index("input")[COMPLETED]
    others = float(shares.drop(ARDIN).min())
    obtained = {f"completed, {ARDIN}": float(shares[ARDIN]), "completed, least of the others": others}
    return Decision(obtained, bool(shares[ARDIN] < others) if _enough(results) else None)


@claim(
    "no-input-differs",
    "differences",
    "no p after Holm's correction is under 0.05",
    published={f"p, {name}": each[-1] for name, each in PUBLISHED_DIFFERENCES.items()},
    note=f"Exact sign-flip tests over routes; with fewer than {MIN_WORLDS} routes they can find nothing.",
)
def _no_input_differs(results: StudyResults) -> Decision:
    """No input's mean deviation differs significantly from that of ApiaViz."""
    table = results.tables["differences"]
    obtained = {f"p, {row['input']}": row["p (Holm)"] for _, row in table.iterrows()}
    return Decision(obtained, bool((table["p (Holm)"] >= 0.05).all()) if _enough(results) else None)


CLAIMS = (_counts_repeat, _ardin_least, _no_input_differs)

PARAMETERS = (
    Parameter(
        "Routes", "route 2 of ants 4, 6, 7, 9, 10, 12, 13 and 15 of the Sussex world", "those of them that are given"
    ),
    Parameter("Wiring", "seeds 19, 31, 43, 59, 71", "the same numbers, of another generator"),
    Parameter("View", "74 x 18 points over 296 x 75 degrees", "every second of 180 columns, 74 of them; 18 rows"),
    Parameter("Views learned", "every 10 cm, 9 from -0.2 to 0.2 m to the side, all along the route", "the same"),
    Parameter("Fields", "8 x 64 for each of 5 planes, standardised in two streams", "the same"),
    Parameter("Kenyon cells", "8,000, of 10 signed inputs; race of spikes in bins of 1 ms", "the same"),
    Parameter("Memory", "the cells that fired at each view; overlap with the most similar", "the same"),
    Parameter("Scan", "13 headings over 120 degrees", "the same"),
    Parameter("Steps", "10 cm, 200 at most; never put back", "the same"),
    Parameter("Arrival", "within 20 cm", "the same"),
)

DIFFERENCES = (
    "Pixels are 4 degrees apart, in the original 4.05. Filters see the whole circle; the original mirrors views at the edge of the field.",
    "Sussex's world has no colours. As the original does, we tint half of its triangles green or blue at the same brightness; which ones "
    "depends on the generator, and is not the same half. Worlds with colours keep theirs.",
    "Tussocks are drawn by our renderer, from both sides; the original sorts triangles by distance, and draws the farther ones first.",
    "CLAHE of Ardin's style is that of OpenCV (clip limit 2.56, which is the original's 0.01 of a tile; 10 tiles around the circle), and "
    "pixels of 8 degrees are means, where the original takes bicubic samples.",
    "A walk that leaves the world ends there; the original's goes on up to 200 steps.",
    "The deviation is the distance from the route's line, in the original that from the nearest learned position.",
    "Of equally familiar headings the first from ahead to the left is taken, in the original the smallest turn.",
)

ITEMS = (
    Item(
        "completed-table",
        "Completed walks and deviation",
        "by_input",
        "Published and obtained. The ends low and high are of the 95 % interval of a crossed bootstrap over routes and seeds; fewer than "
        f"{MIN_WORLDS} routes have none.",
    ),
    Item(
        "completed",
        "Published and obtained",
        "by_input",
        "Share of walks that were completed, and mean distance from the route; bars are crossed 95 % intervals.",
        lambda table: beside(table, "input", ((COMPLETED, "share completed"), (DEVIATION, DEVIATION))),
    ),
    Item(
        "differences",
        "Differences from ApiaViz",
        "differences",
        "Mean deviation less that of ApiaViz, paired by route and seed, with crossed 95 % intervals. p: exact sign-flip test over routes, "
        "with Holm's correction.",
    ),
    Item("by-route", "Deviation by route", "by_route", "Mean over the seeds (cm)."),
)

APIAVIZ2026 = Protocol(
    name="apiaviz2026",
    title="Six inputs of a mushroom body: ApiaViz and its controls",
    paper="ApiaViz (2026). Visual preprocessing, sparse codes and navigation accuracy: the mechanism study of the ApiaViz project "
    "(AdamDHines/ApiaViz on GitHub, docs/mechanism-study).",
    question="Which preprocessing of colour views lets the same spiking mushroom body follow routes best?",
    experiment=Experiment(
        eye=Eye(width=180, height=18, samples=1, top=math.radians(60 + EDGE), bottom=math.radians(-15 - EDGE)),
        encoding=INPUTS[APIA],
        model="spike-overlap planes=3,2 field_deg=296 pixel=2",
        navigator="stepped-scan width_deg=120 step_deg=10",
        route_length=8.0,
        training=TrainingSetup(spacing=0.1, learning_walk=0.2, parallel_views=9),
        body=Body(step_length=0.1),
        stopping=StoppingRules(arrival_radius=0.2, max_deviation=100.0, patience=100.0, max_steps=200),
    ),
    axes={
        "model": ["spike-overlap planes=3,2 field_deg=296 pixel=2"],
        "encoding": list(INPUTS.values()),
        "seed": list(SEEDS),
    },
    worlds=len(ANTS),
    quick_worlds=1,
    quick_axes={"seed": list(SEEDS[:1])},
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    measure=measure,
    claims=CLAIMS,
    items=ITEMS,
    prepare_world=coloured,
    route_names=tuple(f"ant{ant}_route2" for ant in ANTS),
)
