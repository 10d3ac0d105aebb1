"""Study 5: a network as a classifier of views, trained on a few views and on the whole route (sections 4.4.1 to 4.4.6)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import expit
from sklearn.metrics import classification_report

from tussock.world.geometry import turn_of_columns

from ...models import MLP, make_model
from ...reports.claims import Decision, claim
from ...reports.effects import effect_size
from ...reports.results import StudyResults
from . import published
from .effects import fall_of_median, median_error
from .grid_search import best_tuning, count_best, count_tunings, search, share_of
from .headings import CHANCE_MEDIAN_DEG, errors_of, headings
from .parameters import EVERY, QUICK_NETWORKS, QUICK_SEARCHES, Progress, StudySettings
from .study_data import StudyData

FIRST = 20  # training views of the first part of the route (4.4.5)
PARTS = {"first_20": "first 20 views", "whole_route": "whole route"}
CLASSES = {"0": "0, off the route", "1": "1, on the route", "weighted avg": "average"}
MEDIANS_DEG = published.CLASSIFIER_MEDIAN_DEG


@dataclass(frozen=True, kw_only=True)
class TrainedNetworks:
    """Networks trained from different random starts.

    Attributes:
        table: One row per network: seed, accuracy on held-out views, heading errors.
        report: Classification report of the network with the middle median error.
        headings: The headings that this network recovered.
        all_headings: The headings that each network recovered.
    """

    table: pd.DataFrame
    report: pd.DataFrame
    headings: pd.DataFrame
    all_headings: list[pd.DataFrame]


def study(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """Tune, train and test the classifier on the first views and on the whole route; compare with perfect memory."""
    one = _one_view(data)
    tables: dict[str, pd.DataFrame] = {"training": _uses_of_views(data), "one_place": one}
    numbers: dict[str, Any] = {"one_place_error_deg": float(one["error_deg"].iloc[0])}
    total, before = sum(count_tunings(part, settings) for part in PARTS), 0
    for part in PARTS:
        learned, rows = _views_of_part(data, part)
        tuned = search(
            part, data.route_images[learned], settings, lambda done, _, before=before: progress(before + done, total)
        )
        before += len(tuned)
        networks = train_networks(data, learned, rows, best_tuning(tuned), settings)
        memory = headings(data, make_model("perfect-memory").fit(data.route_images[learned]), data.grid_images, rows)
        results = _results_of_part(len(learned), tuned, networks, memory)
        tables |= {f"{name}_{part}": table for name, table in results.tables.items()}
        numbers |= {f"{name}_{part}": number for name, number in results.numbers.items()}
    return StudyResults(tables=tables, numbers=numbers)


def _results_of_part(
    learned: int, tuned: pd.DataFrame, networks: TrainedNetworks, memory: pd.DataFrame
) -> StudyResults:
    medians = networks.table.median(numeric_only=True)
    return StudyResults(
        tables={
            "search": tuned,
            "networks": networks.table,
            "report": networks.report,
            "headings": networks.headings,
            "perfect_memory": memory,
        },
        numbers={
            "tuning": best_tuning(tuned),
            "tunings_with_the_best_score": count_best(tuned),
            "validation_score": float(tuned["mean_test_score"].iloc[0]),
            "accuracy": float(medians["accuracy"]),
            "median_error_deg": float(medians["median_error_deg"]),
            "share_over_45": float(medians["share_over_45"]),
            "learned": learned,
            "perfect_memory_median_error_deg": errors_of(memory)["median_error_deg"],
        },
    )


def learned_views(data: StudyData) -> np.ndarray:
    """Indices of the route views that are learned: every EVERY-th (4.3.3)."""
    return np.arange(0, len(data.route.poses), EVERY)


def held_out_views(learned: np.ndarray) -> np.ndarray:
    """Indices half-way between every second pair of learned views (figure 23, which counts half as many as learned ones)."""
    return ((learned[:-1] + learned[1:]) // 2)[::2]


def _views_of_part(data: StudyData, part: str) -> tuple[np.ndarray, np.ndarray]:
    """The learned views of a part of the route, and the near grid poses whose nearest route view is on that part."""
    learned = learned_views(data)
    if part == "whole_route":
        return learned, data.near
    learned = learned[:FIRST]
    return learned, data.near[data.nearest[data.near] <= learned[-1] + EVERY // 2]


def train_networks(
    data: StudyData, learned: np.ndarray, rows: np.ndarray, tuning: dict[str, Any], settings: StudySettings
) -> TrainedNetworks:
    """Train networks from different random starts, and test each on held-out views and on headings.

    Args:
        data: The views.
        learned: Indices of the route views to learn.
        rows: Indices of the grid poses where headings are recovered.
        tuning: Parameters of the network.
        settings: How many starts and iterations.

    Returns:
        The networks' results.
    """
    held_out = held_out_views(learned)
    rows_of_table, reports, tables = [], [], []
    for seed in settings.seeds:
        network = MLP(**tuning, max_iter=settings.iterations[1], seed=seed).fit(data.route_images[learned])
        images, labels = network.training_data(data.route_images[held_out])
        truth, guess = labels.numpy().astype(int), network.predict(images)
        tables.append(headings(data, network, data.grid_images, rows))
        reports.append(_report(truth, guess))
        rows_of_table.append({"seed": seed, "accuracy": float((guess == truth).mean())} | errors_of(tables[-1]))
    table = pd.DataFrame(rows_of_table)
    order = table["median_error_deg"].argsort(kind="stable")
    middle = int(order.iloc[(len(order) - 1) // 2])
    return TrainedNetworks(table=table, report=reports[middle], headings=tables[middle], all_headings=tables)


def _report(truth: np.ndarray, guess: np.ndarray) -> pd.DataFrame:
    """scikit-learn's classification report, one row per class."""
    rows = classification_report(truth, guess, output_dict=True, zero_division=0.0)
    assert isinstance(rows, dict)
    return pd.DataFrame([{"class": label} | rows[key] for key, label in CLASSES.items()])


def _uses_of_views(data: StudyData) -> pd.DataFrame:
    """Every route view and its use (figures 17 and 23)."""
    learned = learned_views(data)
    use = np.full(len(data.route.poses), "not used", dtype=object)
    use[held_out_views(learned)] = "held out"
    use[learned] = "learned"
    x, y, heading = data.route.poses.T
    return pd.DataFrame({"x_m": x, "y_m": y, "heading_deg": np.degrees(heading), "use": use})


def _one_view(data: StudyData) -> pd.DataFrame:
    """Confidence at every rotation of the grid view nearest to a route view, when only that route view is learned (figures 21, 22)."""
    distance = np.hypot(*(data.poses[:, :2] - data.route.xy[data.nearest]).T)
    row = int(distance.argmin())
    network = MLP(max_iter=600).fit(data.route_images[data.nearest[row]][None])
    confidence = expit(network.scan(data.grid_images[row : row + 1]).double().numpy()[0])
    turns = np.degrees(turn_of_columns(np.arange(len(confidence)), len(confidence))) % 360
    recovered = headings(data, network, data.grid_images, [row]).iloc[0]
    return pd.DataFrame({"turn_deg": turns, "confidence": confidence}).assign(**recovered)


def best_tuning_of(results: StudyResults) -> dict[str, Any]:
    """The best tuning for the whole route in this study's results."""
    tuning = results.numbers["tuning_whole_route"]
    return tuning | {"hidden_layer_sizes": tuple(tuning["hidden_layer_sizes"])}


@claim(
    "classifier-accurate",
    "24",
    "both accuracies are 0.9 or more",
    published={f"accuracy, {label}": published.HELD_OUT_ACCURACY[part] for part, label in PARTS.items()},
    not_quick=QUICK_NETWORKS,
)
def _accuracies(results: StudyResults) -> Decision:
    """The classifier is nearly perfect on held-out views, both of the first part and of the whole route."""
    accuracies = {f"accuracy, {label}": results.numbers[f"accuracy_{part}"] for part, label in PARTS.items()}
    views = int(results.tables["report_whole_route"]["support"].iloc[-1])
    right = np.arange(views) < round(results.numbers["accuracy_whole_route"] * views)
    effect = effect_size(
        f"accuracy, {PARTS['whole_route']}", views, lambda drawn: float(right[drawn].mean()), of="held-out views"
    )
    return Decision(accuracies, min(accuracies.values()) >= 0.9, effect)


@claim(
    "few-views-work",
    "25",
    "the median error is under 10 degrees",
    published={"median error (deg)": MEDIANS_DEG["first_20"]},
    not_quick=QUICK_NETWORKS,
)
def _few_views(results: StudyResults) -> Decision:
    """After learning 20 views, the classifier recovers headings."""
    median = results.numbers["median_error_deg_first_20"]
    effect = median_error("median error of one network (deg)", results.tables["headings_first_20"])
    return Decision({"median error (deg)": median}, median < 10, effect)


@claim(
    "whole-route-fails",
    "27",
    "the median error is over 20 degrees, and at least twice that of the first 20 views, which is under that of random headings (90)",
    published={
        "median error, whole route (deg)": MEDIANS_DEG["whole_route"],
        "over that of the first 20 views": MEDIANS_DEG["whole_route"] / MEDIANS_DEG["first_20"],
    },
    not_quick=QUICK_NETWORKS,
)
def _whole_route(results: StudyResults) -> Decision:
    """After learning the whole route it does not, although it is accurate on held-out views."""
    few, whole = (results.numbers[f"median_error_deg_{part}"] for part in PARTS)
    obtained = {"median error, whole route (deg)": whole, "over that of the first 20 views": whole / few}
    if results.numbers["learned_whole_route"] < 2 * FIRST:
        return Decision(obtained, None, reason=f"the route has fewer than {2 * FIRST} learned views")
    effect = median_error("median error of one network, whole route (deg)", results.tables["headings_whole_route"])
    return Decision(obtained, whole > 20 and whole >= 2 * few and few < CHANCE_MEDIAN_DEG, effect)


@claim(
    "perfect-memory-beside",
    "28",
    "its median error is under half of the classifier's and under that of random headings (90), and a smaller share of its errors is over "
    "45 degrees",
    not_quick=QUICK_NETWORKS,
)
def _perfect_memory(results: StudyResults) -> Decision:
    """Perfect memory of the same views recovers the headings that the classifier does not."""
    memory = errors_of(results.tables["perfect_memory_whole_route"])
    median, share = (results.numbers[f"{name}_whole_route"] for name in ("median_error_deg", "share_over_45"))
    obtained = {
        "median error, perfect memory (deg)": memory["median_error_deg"],
        "classifier (deg)": median,
        "share over 45 degrees, perfect memory": memory["share_over_45"],
        "classifier": share,
    }
    better = memory["median_error_deg"] < min(median / 2, CHANCE_MEDIAN_DEG) and memory["share_over_45"] < share
    tables = (results.tables[f"{name}_whole_route"] for name in ("headings", "perfect_memory"))
    return Decision(
        obtained, better, fall_of_median("median error of one network minus perfect memory's (deg)", *tables)
    )


@claim(
    "lbfgs-for-few",
    "7.4",
    "at least four in five use it, of the tunings that score no less than the fifth best",
    published={"share of lbfgs in the best five": 1.0},
    not_quick=QUICK_SEARCHES,
)
def _lbfgs(results: StudyResults) -> Decision:
    """With few views, lbfgs is the best solver."""
    searched = results.tables["search_first_20"]
    share = share_of("lbfgs", searched, 5)
    best = float(count_best(searched))
    return Decision({"share of lbfgs in the best five": share, "tunings with the best score": best}, share >= 0.8)


@claim(
    "adam-for-the-route",
    "7.5",
    "half or more of the tunings with the best score use it",
    published={"best validation score": published.BEST_TUNINGS["whole_route"][0], "share of adam in the best": 1.0},
    not_quick=QUICK_SEARCHES,
)
def _adam(results: StudyResults) -> Decision:
    """With the whole route, the best tuning uses adam."""
    searched = results.tables["search_whole_route"]
    share = share_of("adam", searched, 1)
    obtained = {
        "best validation score": results.numbers["validation_score_whole_route"],
        "share of adam in the best": share,
        "tunings with the best score": float(count_best(searched)),
    }
    return Decision(obtained, share >= 0.5)


CLAIMS = (_accuracies, _few_views, _whole_route, _perfect_memory, _lbfgs, _adam)
