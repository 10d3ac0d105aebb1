"""Study 6: corners (section 4.4.7, figures 29 to 32, appendix 7.6), and views chosen by how much they differ."""

import math
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.stats import spearmanr

from tussock.world.geometry import Route

from ...encoding import Encoding
from ...evaluation import RECOVERED_DEG
from ...failures import CHORD
from ...reports.claims import Decision, claim
from ...reports.effects import effect_size
from ...reports.results import StudyResults
from . import published
from .classifier import TrainedNetworks, learned_views, train_networks
from .effects import difference_of_medians
from .grid_search import best_tuning, search
from .headings import CHANCE_MEDIAN_DEG, CHANCE_RECOVERED, median_of_medians
from .parameters import EVERY, QUICK_NETWORKS, Progress, StudySettings
from .study_data import StudyData

SHARE = 0.2  # at most this share of the route is corners: the part that turns the most ..
MIN_TURNING = math.radians(10)  # .. where it turns at least this much
MARGIN = 0.4  # m of route on both sides of the corners in the section
RAW = Encoding.parse("grey")
NO_CORNERS = "the route has no corners"
EVERY_6TH, MORE_IN_CORNERS = "every 6th view", "twice as many in corners"


def turning(route: Route) -> Float[np.ndarray, " n"]:
    """Change of direction at each point of a route (rad, 0 to pi), from the chord of CHORD before it to the one after it."""
    return route.turning(route.arc, CHORD)


def corner_views(route: Route) -> Int[np.ndarray, " k"]:
    """Indices of the route views in corners: the SHARE of the route that turns the most, by at least MIN_TURNING. May be empty."""
    turned = turning(route)
    most = np.argsort(-turned, kind="stable")[: round(SHARE * len(turned))]
    return np.sort(most[turned[most] >= MIN_TURNING])


def corner_section(route: Route) -> tuple[int, int]:
    """First and last view of the section with the two neighbouring corners that turn the most, and MARGIN around them.

    On a route without corners, the section around the point that turns the most.
    """
    turned, views = turning(route), corner_views(route)
    if len(views) == 0:
        views = turned.argmax(keepdims=True)
    corners = np.split(views, np.flatnonzero(np.diff(views) > 1) + 1)
    weight = [turned[corner].sum() for corner in corners]
    first = int(np.argmax(np.add(weight[:-1], weight[1:]))) if len(corners) > 1 else 0
    last = min(first + 1, len(corners) - 1)
    low, high = route.arc[corners[first][0]] - MARGIN, route.arc[corners[last][-1]] + MARGIN
    inside = np.flatnonzero((route.arc >= low) & (route.arc <= high))
    return int(inside[0]), int(inside[-1])


def study(data: StudyData, settings: StudySettings, progress: Progress, *, tuning: dict[str, Any]) -> StudyResults:
    """How fast views change, and how much more views in corners help. tuning: the best one for the whole route."""
    section = corner_section(data.route)
    selections = _selections(data, section)
    near = data.nearest[data.near]
    where = {"in_corner": np.isin(near, corner_views(data.route)), "in_section": _between(near, section)}
    tuned = search("more_in_corners", data.route_images[selections[MORE_IN_CORNERS]], settings, progress)
    runs = [(name, learned, tuning) for name, learned in selections.items()]
    runs.append((f"{MORE_IN_CORNERS}, tuned anew", selections[MORE_IN_CORNERS], best_tuning(tuned)))
    tables: dict[str, pd.DataFrame] = {"change": _change(data), "search": tuned}
    rows = []
    for name, learned, parameters in runs:
        networks = train_networks(data, learned, data.near, parameters, settings)
        tables[f"headings, {name}"] = networks.headings.assign(**where)
        rows.append({"selection": name, "views": len(learned)} | _numbers_of(networks, **where))
    tables |= {"by_selection": pd.DataFrame(rows), "selections": _table_of_selections(data, selections)}
    numbers = {"section_first_view": section[0], "section_last_view": section[1], "corner_share": SHARE}
    return StudyResults(tables=tables, numbers=numbers)


def _numbers_of(networks: TrainedNetworks, in_corner: np.ndarray, in_section: np.ndarray) -> dict[str, float]:
    tables = networks.all_headings
    recovered = [int((table.loc[in_section, "error_deg"] < RECOVERED_DEG).sum()) for table in tables]
    return {
        "accuracy": networks.table["accuracy"].median(),
        "median_error_deg": networks.table["median_error_deg"].median(),
        "median_error_deg_corners": median_of_medians(tables, in_corner),
        "median_error_deg_straights": median_of_medians(tables, ~in_corner),
        "median_error_deg_section": median_of_medians(tables, in_section),
        "places_in_section": int(in_section.sum()),
        "recovered_in_section": float(np.median(recovered)),
    }


def _between(index: np.ndarray, section: tuple[int, int]) -> np.ndarray:
    return (index >= section[0]) & (index <= section[1])


def _selections(data: StudyData, section: tuple[int, int]) -> dict[str, np.ndarray]:
    """Which route views are learned: the thesis's two selections, and two controls."""
    views, learned = len(data.route.poses), learned_views(data)
    between = np.arange(0, views, max(1, EVERY // 2))
    more = between[np.isin(between, corner_views(data.route)) & _between(between, section)]
    doubled = np.union1d(learned, more)
    return {
        EVERY_6TH: learned,
        MORE_IN_CORNERS: doubled,
        "as many more, evenly": np.unique(np.linspace(0, views - 1, len(doubled)).round().astype(int)),
        "as many, equally different": equally_different(differences(data, 1), len(learned)),
    }


def differences(data: StudyData, every: int) -> Float[np.ndarray, " k"]:
    """RMS difference (grey levels) between successive views when every `every`-th route view is taken."""
    views = RAW(data.route_views[::every]).numpy()
    return 255 * np.sqrt(np.square(np.diff(views, axis=0)).mean(axis=(1, 2)))


def equally_different(steps: Float[np.ndarray, " k"], views: int) -> Int[np.ndarray, " m"]:
    """Choose views such that the sum of the differences from one to the next is about the same everywhere.

    Args:
        steps: Difference from each view to the next.
        views: Largest number of views to choose.

    Returns:
        Indices of the chosen views.
    """
    sums = np.r_[0.0, np.cumsum(steps)]
    return np.unique(np.searchsorted(sums, np.linspace(0, sums[-1], views) - 1e-9).clip(max=len(steps)))


def _change(data: StudyData) -> pd.DataFrame:
    """How much successive learned views differ, where, and how much the route turns there (figure 30)."""
    learned = learned_views(data)
    middle = (learned[:-1] + learned[1:]) // 2
    columns = {
        "view": middle,
        "x_m": data.route.xy[middle, 0],
        "y_m": data.route.xy[middle, 1],
        "along_m": data.route.arc[middle],
        "rms": differences(data, EVERY),
        "turning_deg": np.degrees(turning(data.route)[middle]),
        "in_corner": np.isin(middle, corner_views(data.route)),
        "in_section": _between(middle, corner_section(data.route)),
    }
    return pd.DataFrame(columns)


def _table_of_selections(data: StudyData, selections: dict[str, np.ndarray]) -> pd.DataFrame:
    """Every route view, and whether each selection has it."""
    index = np.arange(len(data.route.poses))
    x, y, heading = data.route.poses.T
    table = pd.DataFrame({"x_m": x, "y_m": y, "heading_deg": np.degrees(heading)})
    for name, selected in selections.items():
        table[name] = np.isin(index, selected)
    return table.assign(in_corner=np.isin(index, corner_views(data.route)))


@claim(
    "corners-change-faster",
    "30",
    "the median difference is larger in corners, and its rank correlation with turning is positive (p < 0.05)",
)
def _views_differ(results: StudyResults) -> Decision:
    """Successive views differ more in corners than on straights."""
    change = results.tables["change"].astype({"rms": "float32"})  # as views are
    rank = spearmanr(change["turning_deg"], change["rms"])
    corner, straight = (float(change.loc[change["in_corner"] == where, "rms"].median()) for where in (True, False))
    obtained = {
        "RMS in corners (grey levels)": corner,
        "on straights": straight,
        "rank correlation with turning": float(rank.statistic),
    }
    if math.isnan(corner):
        return Decision(obtained, None, reason=NO_CORNERS)
    pairs = change[["turning_deg", "rms"]].to_numpy()
    effect = effect_size(
        "rank correlation", len(pairs), lambda rows: float(spearmanr(pairs[rows]).statistic), of="pairs of views"
    )
    return Decision(obtained, bool(corner > straight and rank.statistic > 0 and rank.pvalue < 0.05), effect)


@claim(
    "worse-in-corners",
    "32",
    "the median error is larger at positions near corners, and at the others it is under that of random headings (90)",
    not_quick=QUICK_NETWORKS,
)
def _worse_in_corners(results: StudyResults) -> Decision:
    """The classifier of the whole route fails in corners more than on straights."""
    every_6th = results.tables["by_selection"].iloc[0]
    corner, straight = (float(every_6th[f"median_error_deg_{part}"]) for part in ("corners", "straights"))
    obtained = {"median error in corners (deg)": corner, "on straights": straight}
    if math.isnan(corner):
        return Decision(obtained, None, reason=NO_CORNERS)
    table = results.tables[f"headings, {EVERY_6TH}"]
    label = "in corners minus on straights, one network (deg)"
    effect = difference_of_medians(label, table, table["in_corner"].to_numpy(bool))
    return Decision(obtained, corner > straight and straight < CHANCE_MEDIAN_DEG, effect)


@claim(
    "more-corner-views-help",
    "32",
    "more of the headings in the section are less than 45 degrees off, and more than of random headings (a quarter)",
    published={
        f"share recovered, {EVERY_6TH}": published.RECOVERED_IN_CORNERS[EVERY_6TH],
        MORE_IN_CORNERS: published.RECOVERED_IN_CORNERS[MORE_IN_CORNERS],
    },
    not_quick=QUICK_NETWORKS,
)
def _more_views_help(results: StudyResults) -> Decision:
    """Twice as many views in the corners recover more headings there."""
    rows = results.tables["by_selection"].iloc[:2]
    share = [float(row.recovered_in_section / max(1, row.places_in_section)) for row in rows.itertuples()]
    obtained = {f"share recovered, {EVERY_6TH}": share[0], MORE_IN_CORNERS: share[1]}
    if not (any(results.tables["change"]["in_corner"]) and rows["places_in_section"].iloc[0]):
        return Decision(obtained, None, reason=f"{NO_CORNERS} with grid positions near them")
    tables = (results.tables[f"headings, {name}"] for name in (MORE_IN_CORNERS, EVERY_6TH))
    more, fewer = (
        (table["error_deg"] < RECOVERED_DEG)[table["in_section"].astype(bool)].to_numpy(float) for table in tables
    )
    effect = effect_size(
        "share recovered with more views minus that without, one network each",
        len(more),
        lambda chosen: float((more - fewer)[chosen].mean()),
        of="positions",
    )
    return Decision(obtained, share[1] > max(share[0], CHANCE_RECOVERED), effect)


CLAIMS = (_views_differ, _worse_in_corners, _more_views_help)
