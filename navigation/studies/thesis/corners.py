"""Study 6: corners (section 4.4.7, figures 29 to 32, appendix 7.6), and choosing views by how much they differ."""

import math
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.stats import spearmanr

from tussock.world.geometry import Route

from ...encoding import Encoding
from ...evaluation import RECOVERED_DEG
from ...failures import REACH
from ...reports.findings import Claim, Findings
from . import published
from .classifier import learned_views, train_and_test
from .grid_search import best_tuning, search
from .headings import middle
from .material import Material
from .settings import ENCODING, EVERY, Settings

SHARE = 0.2  # of the route at most: the part of it that turns the most is its corners ..
LEAST = math.radians(10)  # .. where it turns this much
MARGIN = 0.4  # m of straight route shown on both sides of the corners looked at
RAW = Encoding.parse("grey")


def turning(route: Route) -> Float[np.ndarray, " n"]:
    """Change of direction at each point of a route (rad, 0 to pi), from the chord of REACH before it to the one after it."""
    return route.turning(route.arc, REACH)


def corner_views(route: Route) -> Int[np.ndarray, " k"]:
    """Indices of the route views in corners: the share of them where the route turns the most, and by no less than
    LEAST; there may be none.
    """
    turned = turning(route)
    most = np.argsort(-turned, kind="stable")[: round(SHARE * len(turned))]
    return np.sort(most[turned[most] >= LEAST])


def corner_section(route: Route) -> tuple[int, int]:
    """First and last view of the part with the two neighbouring corners that turn the most, and MARGIN of straight around.

    On a route without corners, the part around where it turns the most.
    """
    views = corner_views(route)
    if len(views) == 0:
        views = turning(route).argmax(keepdims=True)
    runs = np.split(views, np.flatnonzero(np.diff(views) > 1) + 1)
    turned = turning(route)
    weight = [turned[run].sum() for run in runs]
    first = int(np.argmax(np.add(weight[:-1], weight[1:]))) if len(runs) > 1 else 0
    arc = route.arc
    low, high = arc[runs[first][0]] - MARGIN, arc[runs[min(first + 1, len(runs) - 1)][-1]] + MARGIN
    inside = np.flatnonzero((arc >= low) & (arc <= high))
    return int(inside[0]), int(inside[-1])


def study(
    material: Material, settings: Settings, progress=lambda done, total: None, *, tuning: dict[str, Any]
) -> Findings:
    """How fast views change, and what more of them in corners do. tuning: what the search on the whole route found best."""
    views, places = ENCODING(material.route_views), ENCODING(material.place_views)
    section = corner_section(material.route)
    selections = _selections(material, section)
    in_corner = np.isin(material.nearest[material.near], corner_views(material.route))
    in_section = _between(material.nearest[material.near], section)
    tuned = search("more_in_corners", views[selections["twice as many in corners"]], settings, progress)
    tables: dict[str, pd.DataFrame] = {"change": _change(material), "search": tuned}
    rows, runs = [], [(name, learned, tuning) for name, learned in selections.items()]
    runs.append(("twice as many in corners, tuned anew", selections["twice as many in corners"], best_tuning(tuned)))
    for name, learned, parameters in runs:
        networks, shown, every_start = train_and_test(
            material, views, places, learned, material.near, parameters, settings
        )
        tables[f"headings, {name}"] = shown["headings"].assign(in_corner=in_corner, in_section=in_section)
        parts = {"corners": in_corner, "straights": ~in_corner, "section": in_section}
        medians = {f"median_error_deg_{part}": middle(every_start, where) for part, where in parts.items()}
        recovered = [int((table.loc[in_section, "error_deg"] < RECOVERED_DEG).sum()) for table in every_start]
        rows.append({
            "selection": name, "views": len(learned), "accuracy": networks["accuracy"].median(),
            "median_error_deg": networks["median_error_deg"].median(), **medians, "places_in_section": int(in_section.sum()),
            "recovered_in_section": float(np.median(recovered)),
        })  # fmt: skip
    tables |= {"by_selection": pd.DataFrame(rows), "selections": _table_of(material, selections)}
    numbers = {"section_first_view": section[0], "section_last_view": section[1], "corner_share": SHARE}
    return Findings(tables=tables, numbers=numbers, claims=_claims(tables))


def _between(index: np.ndarray, section: tuple[int, int]) -> np.ndarray:
    return (index >= section[0]) & (index <= section[1])


def _selections(material: Material, section: tuple[int, int]) -> dict[str, np.ndarray]:
    """Which route views are learned: the thesis's two choices, a control with as many more anywhere, and equal differences."""
    learned = learned_views(material)
    between = np.arange(0, len(material.route.poses), max(1, EVERY // 2))
    corners = corner_views(material.route)
    more = between[np.isin(between, corners) & _between(between, section)]
    doubled = np.union1d(learned, more)
    evenly = np.linspace(0, len(material.route.poses) - 1, len(doubled)).round().astype(int)
    return {
        "every 6th view": learned,
        "twice as many in corners": doubled,
        "as many more, evenly": np.unique(evenly),
        "as many, equally different": equally_different(differences(material, 1), len(learned)),
    }


def differences(material: Material, every: int) -> Float[np.ndarray, " k"]:
    """RMS difference (grey levels) between successive ones of every `every`-th route view."""
    chosen = RAW(material.route_views[::every]).numpy()
    return 255 * np.sqrt(np.square(np.diff(chosen, axis=0)).mean(axis=(1, 2)))


def equally_different(steps: Float[np.ndarray, " k"], views: int) -> Int[np.ndarray, " m"]:
    """Indices of at most `views` views such that the differences summed up between successive ones are about equal.

    steps: difference from each view to the next.
    """
    sums = np.r_[0.0, np.cumsum(steps)]
    return np.unique(np.searchsorted(sums, np.linspace(0, sums[-1], views) - 1e-9).clip(max=len(steps)))


def _change(material: Material) -> pd.DataFrame:
    """How much successive learned views differ, where, and how much the route turns there (figure 30)."""
    learned = learned_views(material)
    middle = (learned[:-1] + learned[1:]) // 2
    x, y = material.route.xy[middle].T
    return pd.DataFrame({
        "view": middle, "x_m": x, "y_m": y, "along_m": material.route.arc[middle], "rms": differences(material, EVERY),
        "turning_deg": np.degrees(turning(material.route)[middle]), "in_corner": np.isin(middle, corner_views(material.route)),
        "in_section": _between(middle, corner_section(material.route)),
    })  # fmt: skip


def _table_of(material: Material, selections: dict[str, np.ndarray]) -> pd.DataFrame:
    """Every route view, and whether each selection has it."""
    x, y, heading = material.route.poses.T
    table = pd.DataFrame({"x_m": x, "y_m": y, "heading_deg": np.degrees(heading)})
    for name, chosen in selections.items():
        table[name] = np.isin(np.arange(len(table)), chosen)
    return table.assign(in_corner=np.isin(np.arange(len(table)), corner_views(material.route)))


def _claims(tables: dict[str, pd.DataFrame]) -> list[Claim]:
    change, by = tables["change"], tables["by_selection"]
    rank = spearmanr(change["turning_deg"], change["rms"])
    corner, straight = (float(change.loc[change["in_corner"] == where, "rms"].median()) for where in (True, False))
    plain, doubled = by.iloc[0], by.iloc[1]
    share = [float(row["recovered_in_section"] / max(1, row["places_in_section"])) for row in (plain, doubled)]
    beside = float(plain["median_error_deg_corners"])  # nan where there is no corner, or no place beside one
    return [
        Claim(
            key="corners-change-faster",
            figure="30",
            statement="Successive views differ more in corners than on straights.",
            published={},
            obtained={
                "RMS in corners (grey levels)": corner,
                "on straights": straight,
                "rank correlation with turning": float(rank.statistic),
            },
            test="the median difference is larger in corners, and its rank correlation with turning is positive (p < 0.05)",
            holds=bool(corner > straight and rank.statistic > 0 and rank.pvalue < 0.05) if corner == corner else None,
        ),
        Claim(
            key="worse-in-corners",
            figure="32",
            statement="The classifier of the whole route fails in corners more than on straights.",
            published={},
            obtained={
                "median error in corners (deg)": beside,
                "on straights": float(plain["median_error_deg_straights"]),
            },
            test="the median error is larger at places beside corners",
            holds=bool(beside > plain["median_error_deg_straights"]) if beside == beside else None,
        ),
        Claim(
            key="more-corner-views-help",
            figure="32",
            statement="Twice as many views in the corners recover more headings there.",
            published={
                "share recovered, every 6th view": published.RECOVERED_IN_CORNERS["every 6th view"],
                "twice as many in corners": published.RECOVERED_IN_CORNERS["twice as many in corners"],
            },
            obtained={"share recovered, every 6th view": share[0], "twice as many in corners": share[1]},
            test="more of the headings in the part looked at are less than 45 degrees off",
            holds=share[1] > share[0] if int(plain["places_in_section"]) and int(change["in_corner"].sum()) else None,
        ),
    ]
