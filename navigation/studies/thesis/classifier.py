"""Study 5: a network as a classifier of views, on few views and on the whole route (sections 4.4.1 to 4.4.6)."""

from typing import Any

import numpy as np
import pandas as pd
from scipy.special import expit
from sklearn.metrics import classification_report

from tussock.world.geometry import turn_of_columns

from ...models import MLP, make_model
from ...models.base import Images
from ...reports.findings import Claim, Findings
from . import published
from .grid_search import best_tuning, same_score, search, share_of, tunings
from .headings import errors_of, headings
from .material import Material
from .settings import ENCODING, EVERY, Settings

FIRST = 20  # training views of the small part (4.4.5)


def study(material: Material, settings: Settings, progress=lambda done, total: None) -> Findings:
    """Tune, train and test the classifier on the first views and on the whole route; perfect memory beside it."""
    views, places = ENCODING(material.route_views), ENCODING(material.place_views)
    tables: dict[str, pd.DataFrame] = {
        "training": _training(material),
        "one_place": _one_place(material, views, places),
    }
    numbers: dict[str, Any] = {"one_place_error_deg": float(tables["one_place"]["error_deg"].iloc[0])}
    before, total = 0, sum(tunings(part, settings) for part in PARTS)
    for part in PARTS:
        learned, rows = _part(material, part)
        tuned = search(part, views[learned], settings, lambda done, _, before=before: progress(before + done, total))
        before += len(tuned)
        tuning = best_tuning(tuned)
        networks, shown, _ = train_and_test(material, views, places, learned, rows, tuning, settings)
        tables |= {f"search_{part}": tuned, f"networks_{part}": networks} | {
            f"{name}_{part}": table for name, table in shown.items()
        }
        memory = make_model("perfect-memory").fit(views[learned])
        tables[f"perfect_memory_{part}"] = headings(material, memory, places, rows)
        numbers |= {
            f"tuning_{part}": tuning, f"tunings_with_the_best_score_{part}": same_score(tuned),
            f"validation_score_{part}": float(tuned["mean_test_score"].iloc[0]),
            f"accuracy_{part}": float(networks["accuracy"].median()),
            f"median_error_deg_{part}": float(networks["median_error_deg"].median()),
            f"share_over_45_{part}": float(networks["share_over_45"].median()), f"learned_{part}": len(learned),
            f"perfect_memory_median_error_deg_{part}": errors_of(tables[f"perfect_memory_{part}"])["median_error_deg"],
        }  # fmt: skip
    return Findings(tables=tables, numbers=numbers, claims=_claims(tables, numbers))


PARTS = ("first_20", "whole_route")


def learned_views(material: Material) -> np.ndarray:
    """Indices of the route views that are learned: one in `every` (4.3.3)."""
    return np.arange(0, len(material.route.poses), EVERY)


def held_out_views(learned: np.ndarray) -> np.ndarray:
    """Indices half-way between every second pair of learned views (figure 23; its counts are half of the learned ones')."""
    return ((learned[:-1] + learned[1:]) // 2)[::2]


def _part(material: Material, part: str) -> tuple[np.ndarray, np.ndarray]:
    """The learned views of a part of the route, and the near places whose nearest view lies on it."""
    learned = learned_views(material)
    learned = learned[:FIRST] if part == "first_20" else learned
    on_it = material.nearest[material.near] <= learned[-1] + EVERY // 2
    return learned, material.near if part == "whole_route" else material.near[on_it]


def train_and_test(
    material: Material, views: Images, places: Images, learned: np.ndarray, rows: np.ndarray, tuning: dict[str, Any],
    settings: Settings,
) -> tuple[pd.DataFrame, dict[str, pd.DataFrame], list[pd.DataFrame]]:  # fmt: skip
    """Networks from different starts: accuracy on held-out views and heading errors of each, a row a start.

    Also, of the one whose median error is the middle one: its classification report and its recovered headings, to be shown; and
    the recovered headings of all.
    """
    held_out = held_out_views(learned)
    found = []
    for seed in settings.seeds:
        network = MLP(**tuning, max_iter=settings.iterations[1], seed=seed).fit(views[learned])
        images, labels = network.training_data(views[held_out])
        truth, guess = labels.numpy().astype(int), network.predict(images)
        table = headings(material, network, places, rows)
        row = {"seed": seed, "accuracy": float((guess == truth).mean())} | errors_of(table)
        found.append((row, {"report": _report(truth, guess), "headings": table}))
    networks = pd.DataFrame([row for row, _ in found])
    order = networks["median_error_deg"].argsort(kind="stable")
    shown = found[int(order.iloc[(len(order) - 1) // 2])][1]
    return networks, shown, [tables["headings"] for _, tables in found]


def _report(truth: np.ndarray, guess: np.ndarray) -> pd.DataFrame:
    """scikit-learn's classification report as rows."""
    rows = classification_report(truth, guess, output_dict=True, zero_division=0.0)
    assert isinstance(rows, dict)
    names = {"0": "0, off the route", "1": "1, on the route", "weighted avg": "average"}
    return pd.DataFrame([{"class": label} | rows[key] for key, label in names.items()])


def _training(material: Material) -> pd.DataFrame:
    """Every route view and what it is used for (figures 17 and 23)."""
    learned = learned_views(material)
    use = np.full(len(material.route.poses), "not used", dtype=object)
    use[held_out_views(learned)] = "held out"
    use[learned] = "learned"
    x, y, heading = material.route.poses.T
    return pd.DataFrame({"x_m": x, "y_m": y, "heading_deg": np.degrees(heading), "use": use})


def _one_place(material: Material, views: Images, places: Images) -> pd.DataFrame:
    """Confidence at every rotation of the near place nearest to a route view, having learned that view alone (figures 21, 22)."""
    away = np.hypot(*(material.places[:, :2] - material.route.xy[material.nearest]).T)
    row = int(away.argmin())
    network = MLP(max_iter=600).fit(views[material.nearest[row]][None])
    confidence = expit(network.scan(places[row : row + 1]).double().numpy()[0])
    turns = np.degrees(turn_of_columns(np.arange(len(confidence)), len(confidence))) % 360
    found = headings(material, network, places, [row]).iloc[0]
    return pd.DataFrame({"turn_deg": turns, "confidence": confidence}).assign(**found)


def _claims(tables: dict[str, pd.DataFrame], numbers: dict[str, Any]) -> list[Claim]:
    few, whole = (numbers[f"median_error_deg_{part}"] for part in PARTS)
    accuracies = {part: numbers[f"accuracy_{part}"] for part in PARTS}
    memory = errors_of(tables["perfect_memory_whole_route"])
    labels = {"first_20": "first 20 views", "whole_route": "whole route"}
    lbfgs, adam = share_of("lbfgs", tables["search_first_20"], 5), share_of("adam", tables["search_whole_route"], 1)
    return [
        Claim(
            key="classifier-accurate",
            figure="24",
            statement="The classifier is nearly perfect on held-out views, of a small part and of the whole route.",
            published={f"accuracy, {labels[part]}": published.HELD_OUT_ACCURACY[part] for part in PARTS},
            obtained={f"accuracy, {labels[part]}": accuracies[part] for part in PARTS},
            test="both accuracies are 0.9 or more",
            holds=min(accuracies.values()) >= 0.9,
        ),
        Claim(
            key="few-views-work",
            figure="25",
            statement="Having learned 20 views, the classifier recovers headings.",
            published={"median error (deg)": published.CLASSIFIER_MEDIAN_DEG["first_20"]},
            obtained={"median error (deg)": few},
            test="the median error is under 10 degrees",
            holds=few < 10,
        ),
        Claim(
            key="whole-route-fails",
            figure="27",
            statement="Having learned the whole route, it does not, for all its accuracy on held-out views.",
            published={
                "median error, whole route (deg)": published.CLASSIFIER_MEDIAN_DEG["whole_route"],
                "over that of the first 20 views": published.CLASSIFIER_MEDIAN_DEG["whole_route"]
                / published.CLASSIFIER_MEDIAN_DEG["first_20"],
            },
            obtained={"median error, whole route (deg)": whole, "over that of the first 20 views": whole / few},
            test="the median error is over 20 degrees, and twice that of the first 20 views or more",
            holds=whole > 20 and whole >= 2 * few if numbers["learned_whole_route"] >= 2 * FIRST else None,
        ),
        Claim(
            key="perfect-memory-beside",
            figure="28",
            statement="Perfect memory of the same views recovers the headings that the classifier misses.",
            published={},
            obtained={
                "median error, perfect memory (deg)": memory["median_error_deg"],
                "classifier (deg)": whole,
                "share over 45 degrees, perfect memory": memory["share_over_45"],
                "classifier": numbers["share_over_45_whole_route"],
            },
            test="its median error is under half of the classifier's, and it fails less often",
            holds=memory["median_error_deg"] < whole / 2
            and memory["share_over_45"] < numbers["share_over_45_whole_route"],
        ),
        Claim(
            key="lbfgs-for-few",
            figure="7.4",
            statement="With few views, lbfgs is the best solver.",
            published={"share of lbfgs in the best five": 1.0},
            obtained={
                "share of lbfgs in the best five": lbfgs,
                "tunings with the best score": float(same_score(tables["search_first_20"])),
            },
            test="it has four in five of the tunings that score no less than the fifth does",
            holds=lbfgs >= 0.8,
        ),
        Claim(
            key="adam-for-the-route",
            figure="7.5",
            statement="With the whole route, the best tuning uses adam.",
            published={
                "best validation score": published.BEST_TUNINGS["whole_route"][0],
                "share of adam in the best": 1.0,
            },
            obtained={
                "best validation score": numbers["validation_score_whole_route"],
                "share of adam in the best": adam,
                "tunings with the best score": float(same_score(tables["search_whole_route"])),
            },
            test="half or more of the tunings with the best score use it",
            holds=adam >= 0.5,
        ),
    ]


def tuning_of(findings: Findings) -> dict[str, Any]:
    """The best tuning for the whole route, as `study` found it."""
    tuning = findings.numbers["tuning_whole_route"]
    return tuning | {"hidden_layer_sizes": tuple(tuning["hidden_layer_sizes"])}
