"""Kagioulis et al. 2024: whether knowing the order of the learned views helps to follow a route."""

import pandas as pd

from ...reports.findings import Claim, Findings
from .figures import boxes
from .protocol import Exhibit, Parameter, Protocol

PERFECT, CHAIN = "perfect-memory", "chain"
SPACING = 0.05  # m, between learned views


def measures(walks: pd.DataFrame) -> Findings:
    """Mean absolute angular error and trial-fail count of each model."""
    walks = walks.assign(failures=walks["resets"], deviation_cm=100 * walks["mean_deviation_m"])
    grouped = walks.groupby("model", sort=False)
    by_model = pd.DataFrame({
        "routes": grouped.size(), "mean absolute angular error (°)": grouped["mean_error_deg"].mean(),
        "trial-fail count": grouped["failures"].mean(),
        "routes without a failure": grouped["failures"].agg(lambda each: float((each == 0).mean())), "arrived": grouped["arrived"].mean(),
        "mean deviation (cm)": grouped["deviation_cm"].mean(),
    })  # fmt: skip
    by_route = walks.pivot_table(
        index="place", columns="model", values=["mean_error_deg", "failures"], aggfunc="mean", sort=False
    )
    words = {"mean_error_deg": "error (°)", "failures": "failures"}
    by_route.columns = [f"{words[value]}, {model}" for value, model in by_route.columns]
    tables = {
        "by_model": by_model.reset_index(), "by_route": by_route.reset_index(),
        "walks": walks[["model", "place", "mean_error_deg", "failures", "arrived", "deviation_cm"]],
    }  # fmt: skip
    numbers = {f"{name}, {model}": value for name in by_model for model, value in by_model[name].items()}
    error, failures = by_model["mean absolute angular error (°)"], by_model["trial-fail count"]
    claims = [
        Claim(
            key=key, statement=statement, figure="by-model", published={},
            obtained={f"{label}, {model}": float(number[model]) for model in (PERFECT, CHAIN)}, test=test,
            holds=bool(number[CHAIN] < number[PERFECT]), note="No number of the original is at hand.",
        )
        for key, statement, label, number, test in (
            ("sequence-lowers-error", "Comparing only with views near in the sequence makes headings more accurate.",
             "mean absolute angular error (deg)", error, "the chain's mean absolute angular error is lower than perfect memory's"),
            ("sequence-fails-less", "It makes failures fewer.", "failures a route", failures,
            "the chain fails less often a route than perfect memory"),
        )
    ]  # fmt: skip
    return Findings(tables=tables, numbers=numbers, claims=claims)


KAGIOULIS2024 = Protocol(
    name="kagioulis2024",
    title="Views in their order: a window of memories against all of them",
    paper="Kagioulis E, Knight JC, Graham P, Nowotny T, Philippides A (2024). Adaptive route memory sequences for insect-inspired "
        "visual route "
    "navigation. Biomimetics 9(12), 731.",
    question="Does it help an agent to compare what it sees only with the views that come next along its route?",
    settings={
        "size": "360x80", "encoding": "grey | widen 2 | blur 2", "spacing_m": SPACING, "learning_walk_m": 0.0, "step_m": 0.05,
        "scan_deg": 360.0, "on_lost": "reset", "lost_m": 0.3, "patience_m": 10 * 0.05, "waypoint_m": 5 * SPACING, "route_length_m": 8.0,
    },
    axes={"model": [{"model": PERFECT}, {"model": CHAIN}]},
    worlds=20,
    quick_worlds=3,
    quick_axes={},
    parameters=(
        Parameter(name="Routes", published="20", here="those given, or 20 generated ones of 8 m"),
        Parameter(
            name="View", published="180 x 40, blurred",
            here="pixels of 2 degrees, as of 180 x 40, blurred by one of them, and sampled every degree: 360 x 80",
        ),
        Parameter(name="Scan", published="180 degrees to both sides in steps of 1", here="the same, refined between steps"),
        Parameter(name="Step", published="5 cm", here="5 cm"),
        Parameter(name="Failure", published="more than 0.3 m off, or no progress in 10 steps", here="the same"),
        Parameter(
            name="After a failure", published="put back 5 views ahead",
            here="put back at the next of the waypoints, which are 5 views apart",
        ),
        Parameter(name="Measured", published="mean absolute angular error, trial-fail count", here="the same; and how far off the route"),
    ),
    differences=(
        "After a failure the agent stands 1 to 5 views ahead of the furthest place that it had reached, at the next multiple of 5 "
        "views, where the original puts it 5 views ahead: failures can repeat more often.",
        "The sequence is kept by `chain` (docs/models.md): a window of 5 % of the views ahead and half as many behind, doubled where "
        "nothing in it matches. The original compares windows of several fixed lengths with one that adapts itself.",
        "Columns stand every degree, so that rotations by 1 degree need no interpolated image; blurring makes this as coarse as 180 x 40.",
        "Not known to us, and chosen: the width of the blur (one pixel of 2 degrees), a view every 5 cm, elevations from -15 to 60 "
        "degrees, the length of the routes, and no noise.",
    ),
    measures=measures,
    exhibits=(
        Exhibit(
            name="by-model", title="Errors and failures", table="by_model",
            caption="Over all routes. Angular error: between the heading chosen and the route's at the nearest place, mean over "
                "the steps of a "
            "walk. Trial-fail count: how often a walk was put back.",
        ),
        Exhibit(
            name="angular-error", title="Mean absolute angular error", table="walks",
            caption="Median, quartiles, least and most of all routes.",
            draw=lambda walks: boxes(walks, "mean_error_deg", "mean absolute error (degrees)"),
        ),
        Exhibit(
            name="failures", title="Failures", table="walks", caption="Median, quartiles, least and most of all routes.",
            draw=lambda walks: boxes(walks, "failures", "failures a route"),
        ),
        Exhibit(name="by-route", title="Route by route", table="by_route", caption="One walk a model and route."),
    ),
)  # fmt: skip
