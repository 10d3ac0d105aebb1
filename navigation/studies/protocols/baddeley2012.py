"""Baddeley et al. 2012: a route held in a network that has seen each view once, against one that keeps them all."""

import pandas as pd

from ...reports.findings import Claim, Findings
from .figures import boxes
from .protocol import Exhibit, Parameter, Protocol

PERFECT, INFOMAX, RANDOM = "perfect-memory", "infomax", "random"
MODELS = (PERFECT, f"{INFOMAX} rate=baddeley", RANDOM)
MOSTLY = 0.9  # of the walks


def measures(walks: pd.DataFrame) -> Findings:
    """How many walks of each model arrive without an error, how often they are put back, and how far off the route they are."""
    walks = walks.assign(errors=walks["resets"], deviation_cm=100 * walks["mean_deviation_m"])
    walks["flawless"] = walks["arrived"].astype(bool) & (walks["errors"] == 0)
    grouped = walks.groupby("model", sort=False)
    by_model = pd.DataFrame({
        "walks": grouped.size(), "arrived without an error": grouped["flawless"].mean(), "arrived": grouped["arrived"].mean(),
        "errors a walk": grouped["errors"].mean(), "mean deviation (cm)": grouped["deviation_cm"].mean(),
        "mean heading error (°)": grouped["mean_error_deg"].mean(),
    })  # fmt: skip
    by_route = walks.pivot_table(index="place", columns="model", values="errors", aggfunc="mean", sort=False)
    tables = {
        "by_model": by_model.reset_index(), "by_route": by_route[list(by_model.index)].reset_index(),
        "walks": walks[["model", "place", "offset_m", "flawless", "arrived", "errors", "deviation_cm", "mean_error_deg"]],
    }  # fmt: skip
    numbers = {f"{name}, {model}": value for name in by_model for model, value in by_model[name].items()}
    return Findings(tables=tables, numbers=numbers, claims=_claims(by_model))


def _claims(found: pd.DataFrame) -> list[Claim]:
    """What the paper says. found: a row a model."""
    published = "Published as figures of paths."
    flawless, errors = found["arrived without an error"], found["errors a walk"]
    return [
        Claim(
            key=key, statement=statement, figure="by-model", published={},
            obtained={"walks that arrive without an error": float(flawless[model])},
            test=f"at least {100 * MOSTLY:g} % of its walks arrive without an error", holds=bool(flawless[model] >= MOSTLY), note=published,
        )
        for model, key, statement in (
            (PERFECT, "perfect-memory-follows", "Routes can be followed by comparing the view with all those of the route."),
            (INFOMAX, "infomax-follows", "They can be followed as well by a network that has seen each view once and keeps none."),
        )
    ] + [
        Claim(
            key="infomax-better-than-chance", statement="The network knows the way: it does far better than chance.", figure="by-model",
            published={}, obtained={f"errors a walk, {model}": float(errors[model]) for model in (INFOMAX, RANDOM)},
            test="Infomax makes less than half as many errors as random headings", holds=bool(errors[INFOMAX] < errors[RANDOM] / 2),
            note="Random headings are a control of ours.",
        ),
    ]  # fmt: skip


BADDELEY2012 = Protocol(
    name="baddeley2012",
    title="A route held in a network: Infomax against perfect memory",
    paper="Baddeley B, Graham P, Husbands P, Philippides A (2012). A model of ant route navigation driven by scene familiarity. "
    "PLoS Computational Biology 8(1), e1002336.",
    question="Can a route be followed with a network that has seen each of its views once, as it can with all of them at hand?",
    settings={
        "size": "360x68", "top_deg": 60.0, "bottom_deg": -8.0, "encoding": "sky-mask | resize 4 | normalise | scale 0.25",
        "spacing_m": 0.04, "learning_walk_m": 0.0, "step_m": 0.04, "scan_deg": 180.0, "on_lost": "reset", "lost_m": 0.5,
        "waypoint_m": 0.1, "route_length_m": 8.0,
    },
    axes={"model": [{"model": model} for model in MODELS], "offset_m": [{"offset_m": each} for each in (-0.1, 0.0, 0.1)]},
    worlds=10,
    quick_worlds=2,
    quick_axes={"offset_m": [{"offset_m": 0.0}]},
    parameters=(
        Parameter(
            name="View", published="360 x 68, reduced to 90 x 17: 4 degrees a pixel",
            here="360 x 68, reduced to 90 x 17: 4 degrees a pixel",
        ),
        Parameter(name="Seen", published="objects as silhouettes against the sky", here="share of each pixel that is not sky"),
        Parameter(name="Infomax", published="as many units as inputs", here="1,530 units of 1,530 inputs"),
        Parameter(name="Learning rate", published="0.01", here="0.01 (0.01 / units an update)"),
        Parameter(name="Learning", published="one pass", here="one pass"),
    ),
    differences=(
        "How the original scales its views is not known to us, and the learning rate means nothing without it. On silhouettes of 0 "
        "and 1, and on views of variance 1, a rate of 0.01 made the weights grow without bound. Here views have mean 0 and a standard "
        "deviation of 0.25: a view is then learned about once (0.01 times its squared length is 0.96).",
        "Not known to us, and chosen: a view every 4 cm, steps of 4 cm, a scan of 180 degrees about the present heading, elevations "
        "from -8 to 60 degrees, starts on the route and 10 cm to both sides.",
        "An agent more than 0.5 m off the route, or without progress for 3 m, is put back on it at the next of its waypoints, every "
        "10 cm, and that is counted as an error, so that all of a route is tested.",
        "The most familiar rotation is refined between the 4 degrees of a column by a parabola through its neighbours.",
        "The original learns repeated and several routes as well; this is its simplest experiment, one route learned in one pass.",
    ),
    measures=measures,
    exhibits=(
        Exhibit(name="by-model", title="Routes followed", table="by_model", caption="Over all routes and starts; shares are of 1."),
        Exhibit(
            name="errors", title="Errors of each model", table="walks", caption="Median, quartiles, least and most of all walks.",
            draw=lambda walks: boxes(walks, "errors", "errors a walk"),
        ),
        Exhibit(
            name="deviation", title="Distance from the route", table="walks",
            caption="Mean over each walk; median, quartiles, least and most of all walks.",
            draw=lambda walks: boxes(walks, "deviation_cm", "mean deviation (cm)"),
        ),
        Exhibit(name="by-route", title="Errors by route", table="by_route", caption="Mean errors a walk, over all starts."),
    ),
)  # fmt: skip
