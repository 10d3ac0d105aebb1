"""Study 8: the thesis's three open problems (the full scan, corners, the choice of features) with today's models."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from ...encoding import Encoding
from ...models import make_model
from ...models.base import Model
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from . import published
from .classifier import learned_views
from .corners import corner_views, differences, equally_different
from .effects import fall_of_median
from .headings import errors_of, headings
from .parameters import ENCODING, QUICK_NETWORKS, Progress, StudySettings
from .study_data import StudyData

ENCODINGS = {"grey": ENCODING, "edges": Encoding.named("edges", resize=6)}


class Variant(NamedTuple):
    """A model to test.

    Attributes:
        problem: The open problem that it addresses.
        model: Name of the model.
        make: Makes the model from a seed.
        encoding: Key of ENCODINGS.
        views: Name of the selection of views that it learns.
    """

    problem: str
    model: str
    make: Callable[[int], Model]
    encoding: str
    views: str


def study(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """Heading errors over the full circle with other networks, features and selections of views, in steps from the thesis's own."""
    learned = learned_views(data)
    selections = {
        "every 6th": learned,
        "equally different": equally_different(differences(data, 1), len(learned)),
        "every 2nd": np.arange(0, len(data.route.poses), 2),
    }
    images = {name: (encoding(data.route_views), encoding(data.grid_views)) for name, encoding in ENCODINGS.items()}
    in_corner = np.isin(data.nearest[data.near], corner_views(data.route))
    rows, tables, variants = [], {}, _variants(settings)
    for done, variant in enumerate(variants):
        route_images, grid_images = images[variant.encoding]
        selected = selections[variant.views]
        table = headings(data, variant.make(settings.seeds[0]).fit(route_images[selected]), grid_images)
        row = {name: value for name, value in variant._asdict().items() if name != "make"}
        row |= {"number_of_views": len(selected)} | errors_of(table)
        for name, where in (("corners", in_corner), ("straights", ~in_corner)):
            row[f"median_error_deg_{name}"] = float(table.loc[where, "error_deg"].median())
        rows.append(row)
        tables[f"headings, {variant.model}, {variant.encoding}, {variant.views}"] = table
        progress(done + 1, len(variants))
    return StudyResults(tables={"by_model": pd.DataFrame(rows)} | tables, numbers={})


def _variants(settings: StudySettings) -> list[Variant]:
    """The models to test, from the thesis's own to all changes together."""

    def model(name: str, **parameters) -> Callable[[int], Model]:
        return lambda seed: make_model(name, seed=seed, **parameters)

    thesis = model("mlp", **published.BEST_TUNINGS["whole_route"][2], max_iter=settings.iterations[1])
    steps = {"steps": 200} if settings.quick else {}
    rotation, mixture = model("mlp-rotation", **steps), model("mlp-mixture", **steps)
    return [
        Variant("the thesis", "mlp", thesis, "grey", "every 6th"),
        Variant("full scans", "mlp-rotation", rotation, "grey", "every 6th"),
        Variant("feature selection", "mlp", thesis, "edges", "every 6th"),
        Variant("feature selection", "adaboost", model("adaboost"), "grey", "every 6th"),
        Variant("feature selection", "mlp-rotation", rotation, "edges", "every 6th"),
        Variant("corners", "mlp-rotation", rotation, "edges", "equally different"),
        Variant("several networks", "mlp-mixture", mixture, "edges", "every 6th"),
        Variant("all together", "mlp-rotation", rotation, "edges", "every 2nd"),
        Variant("all together", "perfect-memory", model("perfect-memory"), "edges", "every 2nd"),
    ]


@claim(
    "full-scan-solved",
    "beyond",
    "its median error over 360 degrees is under 10, and lower than the classifier's",
    published={"median error of its classifier (deg)": published.SCAN_MEDIAN_DEG[360]},
    not_quick=QUICK_NETWORKS,
)
def _full_scan(results: StudyResults) -> Decision:
    """Beyond the thesis: a network of the same size that is trained on all rotations of the edges in the same views recovers
    headings over the full circle."""
    rows = results.tables["by_model"].set_index(["model", "encoding", "views"])
    classifier, rotation = rows.loc["mlp", "grey", "every 6th"], rows.loc["mlp-rotation", "edges", "every 6th"]
    obtained = {
        "median error of its classifier (deg)": float(classifier["median_error_deg"]),
        "of mlp-rotation (deg)": float(rotation["median_error_deg"]),
        "in corners, classifier (deg)": float(classifier["median_error_deg_corners"]),
        "in corners, mlp-rotation (deg)": float(rotation["median_error_deg_corners"]),
    }
    median = rotation["median_error_deg"]
    tables = (results.tables[f"headings, {name}, every 6th"] for name in ("mlp, grey", "mlp-rotation, edges"))
    effect = fall_of_median("the classifier's median error minus mlp-rotation's (deg)", *tables)
    return Decision(obtained, bool(median < 10 and median < classifier["median_error_deg"]), effect)


CLAIMS = (_full_scan,)
