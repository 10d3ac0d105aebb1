"""Ardin et al. 2016: errors along a route by perfect memory, a mushroom body, Infomax and chance."""

import pandas as pd

from ...reports.findings import Claim, Findings
from .figures import boxes, curves
from .protocol import Exhibit, Parameter, Protocol, by_model

DISPLACEMENTS = (0.05, 0.10, 0.15, 0.20, 0.25)  # m, to either side
PERFECT, BODY, INFOMAX, RANDOM = "perfect-memory", "mushroom-body", "infomax", "random"
MODELS = (PERFECT, f"{BODY} inputs=10 cells=20000", f"{INFOMAX} rate=unit-range", RANDOM)


def measures(walks: pd.DataFrame) -> Findings:
    """Errors of each model: how often a walk was put back on the route."""
    walks = walks.assign(errors=walks["resets"], displacement_cm=(100 * walks["offset_m"].abs()).round().astype(int))
    by_displacement = _mean_errors(walks, "displacement_cm").rename(columns=lambda name: _cm(name))
    by_route = _mean_errors(walks, "place")
    grouped = walks.groupby("model", sort=False)
    overall = grouped["errors"].agg(["mean", "median", "min", "max"]).add_suffix(" errors a walk")
    overall["walks"] = grouped.size()
    overall["arrived"] = grouped["arrived"].mean()
    mean = grouped["errors"].mean()
    tables = {
        "by_displacement": by_displacement.reset_index(), "by_route": by_route.reset_index(), "by_model": overall.reset_index(),
        "walks": walks[["model", "place", "displacement_cm", "offset_m", "errors", "arrived", "steps", "mean_deviation_m"]],
    }  # fmt: skip
    return Findings(
        tables=tables, numbers={f"errors, {name}": float(mean[name]) for name in by_model(walks)}, claims=_claims(mean)
    )


def _mean_errors(walks: pd.DataFrame, column: str) -> pd.DataFrame:
    """Mean errors a walk: a row a model, a column for each value of a column, and for all walks."""
    table = walks.pivot_table(index="model", columns=column, values="errors", aggfunc="mean", sort=False).astype(float)
    table = table[sorted(table.columns)]
    return table.assign(all=walks.groupby("model")["errors"].mean()).loc[by_model(walks)]


def _cm(name: object) -> str:
    return f"{name} cm" if isinstance(name, int) else str(name)


def _claims(mean: pd.Series) -> list[Claim]:
    """What the paper says of its figure 4D. mean: errors a walk by model."""
    others = mean.drop(RANDOM)
    published = "Published as box plots only (figure 4D)."
    return [
        Claim(
            key="random-worst", statement="All three memories make fewer errors than a random choice of direction.",
            figure="by-displacement", published={},
            obtained={f"errors a walk, {name}": float(value) for name, value in mean.to_dict().items()},
            test="each of the others makes fewer errors a walk than random", holds=bool(others.max() < mean[RANDOM]),
            note=published,
        ),
        Claim(
            key="perfect-best", statement="Perfect memory, which keeps every view, makes the fewest errors.", figure="by-model",
            published={}, obtained={f"errors a walk, {name}": float(value) for name, value in others.to_dict().items()},
            test="no other model makes fewer errors a walk", holds=bool(mean[PERFECT] <= mean.min()), note=published,
        ),
        Claim(
            key="body-close", statement="The mushroom body follows routes nearly as well as perfect memory.", figure="by-model",
            published={}, obtained={"share of the way from perfect memory to random": _share(mean, BODY)},
            test="its errors lie in the first tenth of the way from perfect memory's to random's",
            holds=_share(mean, BODY) <= 0.1, note=published,
        ),
    ]  # fmt: skip


def _share(mean: pd.Series, model: str) -> float:
    """Where a model's errors lie between perfect memory's, 0, and random's, 1."""
    return float((mean[model] - mean[PERFECT]) / (mean[RANDOM] - mean[PERFECT]))


ARDIN2016 = Protocol(
    name="ardin2016",
    title="Errors along a route: perfect memory, mushroom body, Infomax, chance",
    paper="Ardin P, Peng F, Mangan M, Lagogiannis K, Webb B (2016). Using an insect mushroom body circuit to encode route memory in "
    "complex natural environments. PLoS Computational Biology 12(2), e1004683.",
    question="How often does an agent stray from a route it has learned, by the memory it has learned it with?",
    settings={
        "size": "720x40", "samples": 2, "encoding": "grey | invert | clahe 2 8 | resize 4 | widen 5", "spacing_m": 0.1,
        "learning_walk_m": 0.0,
        "step_m": 0.1, "scan_deg": 120.0, "on_lost": "reset", "lost_m": 0.2, "waypoint_m": 0.1, "arrive_m": 0.2, "max_steps": 1000,
        "route_length_m": 8.0,
    },
    axes={
        "model": [{"model": model} for model in MODELS],
        "offset_m": [{"offset_m": side * each} for each in DISPLACEMENTS for side in (1, -1)],
    },
    worlds=15,
    quick_worlds=2,
    quick_axes={"offset_m": [{"offset_m": side * each} for each in (0.05, 0.15, 0.25) for side in (1, -1)]},
    parameters=(
        Parameter(
            name="Routes", published="15 of about 8 m in the Sussex world",
            here="those given, or 15 generated ones of 8 m",
        ),
        Parameter(name="Views learned", published="every 10 cm of the route", here="every 10 cm of the route"),
        Parameter(name="Step", published="10 cm", here="10 cm"),
        Parameter(name="Scan", published="120 degrees in steps of 2", here="120 degrees in steps of 2, refined between steps"),
        Parameter(
            name="View", published="36 x 10, after inversion and CLAHE",
            here="pixels of a 36 x 10 view, after inversion and CLAHE, one every 2 degrees",
        ),
        Parameter(
            name="Error", published="more than 20 cm off; put back at the waypoint after the furthest",
            here="the same; waypoints every 10 cm",
        ),
        Parameter(name="Arrival", published="within 20 cm", here="within 20 cm"),
        Parameter(name="Steps", published="1,000 at most", here="1,000 at most"),
        Parameter(name="Starts", published="displaced by 5 to 25 cm", here="5, 10, 15, 20 and 25 cm to both sides"),
        Parameter(
            name="Mushroom body", published="360 projection neurons, 20,000 Kenyon cells of 10 inputs, one output",
            here="the same numbers, not spiking",
        ),
    ),
    differences=(
        "The mushroom body has no spikes: a sum and a ranking of its cells take their place (docs/models.md). It adapts to contrast "
        "and averages familiarity over neighbouring rotations, 6 degrees.",
        "Views are as fine as 36 x 10, but there is one such pixel every 2 degrees, so that rotations by 2 degrees need no "
        "interpolated image: perfect memory and Infomax compare 180 x 10 overlapping pixels. The most familiar rotation is refined by "
        "a parabola through its neighbours.",
        "An agent that walks 3 m without getting farther along the route, or leaves the world, is put back as well, and that is an error.",
        "A start 20 or 25 cm beside the route is at or beyond the 20 cm that count as an error: one at 25 cm is put back at once, "
        "which is one error of every model.",
        "Clip limit (2) and tiles (8 x 8) of CLAHE, elevations (-15 to 60 degrees) and the learning rate of Infomax (that for views "
        "in 0..1) are not known to us.",
        "The control draws a random heading for each different view and meets the same one where it sees the same view again.",
    ),
    measures=measures,
    exhibits=(
        Exhibit(
            name="by-displacement", title="Errors by displacement", table="by_displacement",
            caption="Mean errors a walk, over all routes and both sides, by how far beside the route the walk began.",
        ),
        Exhibit(
            name="errors", title="Errors against displacement", table="walks",
            caption="Mean errors a walk; bars are standard errors of the mean.",
            draw=lambda walks: curves(walks, "displacement_cm", "errors", "displacement of the start (cm)", "errors a walk"),
        ),
        Exhibit(
            name="by-model", title="Errors of all walks", table="by_model",
            caption="Over all routes and displacements. Arrived: share of the walks that arrived within 1,000 steps; the others count with "
            "the errors that they had made by then.",
        ),
        Exhibit(
            name="boxes", title="Errors of each model, as in figure 4D of the paper", table="walks",
            caption="Median, quartiles, least and most of all walks.", draw=lambda walks: boxes(walks, "errors", "errors a walk"),
        ),
        Exhibit(
            name="by-route", title="Errors by route", table="by_route", caption="Mean errors a walk, over all displacements.",
        ),
    ),
)  # fmt: skip
