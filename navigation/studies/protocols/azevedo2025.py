"""Azevedo Amin et al. 2025: how far from a route agents walk that begin up to 5.5 m beside it."""

from typing import Any

import numpy as np
import pandas as pd

from ...reports.findings import Claim, Findings
from .figures import curves
from .protocol import Exhibit, Parameter, Protocol

FARTHEST, STARTS = 5.5, 45  # m to either side; starts from one side to the other
LENGTH, STEP = 20.0, 0.1  # m
LAST = 0.05  # share of the route
GROWS = 0.9  # rank correlation


def of_walk(row: dict[str, Any], steps: pd.DataFrame) -> dict[str, float]:
    """Mean displacement (m) of a walk from the whole route and over its last part (nan where it did not get there).

    A walk counts until it has passed the route's end.
    """
    length = row["route_m"]
    past = np.flatnonzero(steps["along_m"] >= length - STEP / 2)
    counted = steps.iloc[: past[0] + 1] if len(past) else steps
    last = counted[counted["along_m"] >= (1 - LAST) * length]
    return {
        "displacement_m": float(counted["deviation_m"].mean()),
        "last_displacement_m": float(last["deviation_m"].mean()),
    }


def measures(walks: pd.DataFrame) -> Findings:
    """Mean displacement by that of the start."""
    walks = walks.assign(start_m=walks["offset_m"].abs())
    grouped = walks.groupby("start_m")
    by_start = pd.DataFrame({
        "walks": grouped.size(), "mean displacement (m)": grouped["displacement_m"].mean(),
        "mean displacement, last 5 % (m)": grouped["last_displacement_m"].mean(),
        "got to the last 5 %": grouped["last_displacement_m"].agg(lambda each: float(each.notna().mean())),
    })  # fmt: skip
    numbers = {
        "mean displacement (m)": float(walks["displacement_m"].mean()),
        "mean displacement, last 5 % (m)": float(walks["last_displacement_m"].mean()),
        "share that got to the last 5 %": float(walks["last_displacement_m"].notna().mean()),
    }  # fmt: skip
    ranks = by_start.reset_index()[["start_m", "mean displacement (m)"]].rank()
    rank = float(ranks["start_m"].corr(ranks["mean displacement (m)"])) if len(ranks) > 1 else np.nan
    claims = [
        Claim(
            key="no-approach", statement="Turning to the most familiar view does not by itself lead back to the route: the "
                "farther beside it an "
            "agent begins, the farther from it it walks.", figure="displacement", published={},
            obtained={"rank correlation of displacement and that of the start": rank} | numbers,
            test=f"the rank correlation of mean displacement with that of the start is at least {GROWS:g}",
            holds=None if np.isnan(rank) else rank >= GROWS, note="Published as curves only (figure 2, A and D: view based orientation).",
        ),
    ]  # fmt: skip
    tables = {
        "by_start": by_start.reset_index().rename(columns={"start_m": "start beside the route (m)"}),
        "walks": walks[["model", "place", "start_m", "offset_m", "displacement_m", "last_displacement_m", "steps", "arrived"]],
    }  # fmt: skip
    return Findings(tables=tables, numbers=numbers, claims=claims)


def _starts(count: int) -> list[dict[str, Any]]:
    """Starts from one side to the other, evenly spaced."""
    return [{"offset_m": round(each, 6)} for each in np.linspace(-FARTHEST, FARTHEST, count).tolist()]


AZEVEDO2025 = Protocol(
    name="azevedo2025",
    title="Starts far beside a route: how far from it agents walk",
    paper="Azevedo Amin A, Philippides A, Graham P (2025). Ant visual route navigation: how the fine details of behaviour promote "
        "successful route "
    "performance and convergence. PLoS Computational Biology 21(9), e1012798.",
    question="Do agents that begin metres beside a route they have learned come back to it by familiarity alone?",
    world="tussock-field field_width=40 field_depth=40",
    settings={
        "size": "360x75", "encoding": "sky-mask | vertical-edges | resize 4 | normalise", "spacing_m": 0.1, "learning_walk_m": 0.0,
        "step_m": STEP, "scan_deg": 160.0, "lost_m": 100.0, "patience_m": 100.0, "max_steps": round((LENGTH + FARTHEST) / STEP),
        "route_length_m": LENGTH,
    },
    axes={"model": [{"model": "perfect-memory"}], "offset_m": _starts(STARTS)},
    worlds=75,
    quick_worlds=2,
    quick_axes={"offset_m": _starts(12)},
    parameters=(
        Parameter(name="Route", published="20 m", here="20 m"),
        Parameter(name="Environments", published="75, generated", here="75, generated, of 40 m x 40 m"),
        Parameter(
            name="Starts", published="45, up to 5.5 m to both sides",
            here="45, every 0.25 m from 5.5 m on one side to 5.5 m on the other",
        ),
        Parameter(name="Scan", published="160 degrees at most", here="160 degrees"),
        Parameter(
            name="Measured", published="mean displacement from the whole route and over its last 5 %",
            here="the same; and how many get there",
        ),
    ),
    differences=(
        "Of the three strategies of the original only the first, view based orientation, is here; its scan is always as wide as it may be.",
        "Not known to us, and chosen: perfect memory as the familiarity; skylines' vertical edges, 90 x 19 pixels, as views; a view "
        "every 10 cm of the route; steps of 10 cm; 255 of them at most, what the route and the farthest displacement take together.",
        "A walk is never lost, and counts until it is level with the route's end. Over the last 5 % only the walks that get there count.",
        "Worlds are tussocks, grass, stones and bushes with a skyline of trees. Starts that would stand outside of them are left out; "
        "how many is said below the tables.",
    ),
    of_walk=of_walk,
    measures=measures,
    exhibits=(
        Exhibit(
            name="displacement", title="Displacement against that of the start", table="walks",
            caption="Mean distance from the route, over all worlds and both sides; bars are standard errors of the mean.",
            draw=lambda walks: curves(walks, "start_m", "displacement_m", "start beside the route (m)", "mean displacement (m)",
            equal=True),
        ),
        Exhibit(
            name="last", title="Displacement over the last 5 % of the route", table="walks",
            caption="As above, of the walks alone that got there.",
            draw=lambda walks: curves(walks, "start_m", "last_displacement_m", "start beside the route (m)",
            "mean displacement (m)", equal=True),
        ),
        Exhibit(name="by-start", title="Displacement by start", table="by_start", caption="Over all worlds and both sides."),
    ),
)  # fmt: skip
