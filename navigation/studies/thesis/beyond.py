"""Study 8: the thesis's three open problems, the full scan, the corners and the choice of features, with what the project has now."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from ...encoding import Encoding
from ...models import make_model
from ...models.base import Model
from ...reports.findings import Claim, Findings
from . import published
from .classifier import learned_views
from .corners import corner_views, differences, equally_different
from .headings import errors_of, headings
from .material import Material
from .settings import ENCODING, Settings

EDGES = Encoding.named("edges", resize=6)


def study(material: Material, settings: Settings, progress=lambda done, total: None) -> Findings:
    """Heading errors over the full circle of other networks, features and choices of views, step by step from the thesis's own."""
    learned = learned_views(material)
    choices = {
        "every 6th": learned,
        "equally different": equally_different(differences(material, 1), len(learned)),
        "every 2nd": np.arange(0, len(material.route.poses), 2),
    }
    encodings = {"grey": ENCODING, "edges": EDGES}
    images = {
        name: (encoding(material.route_views), encoding(material.place_views)) for name, encoding in encodings.items()
    }
    in_corner = np.isin(material.nearest[material.near], corner_views(material.route))
    rows, tables = [], {}
    runs = _runs(settings)
    for done, (problem, name, make, encoding, choice) in enumerate(runs):
        views, places = images[encoding]
        table = headings(material, make(settings.seeds[0]).fit(views[choices[choice]]), places)
        rows.append(
            {
                "problem": problem,
                "model": name,
                "encoding": encoding,
                "views": choice,
                "number_of_views": len(choices[choice]),
            }
            | errors_of(table)
            | {
                f"median_error_deg_{part}": float(table.loc[where, "error_deg"].median())
                for part, where in (("corners", in_corner), ("straights", ~in_corner))
            }
        )
        tables[f"headings, {name}, {encoding}, {choice}"] = table
        progress(done + 1, len(runs))
    by_model = pd.DataFrame(rows)
    return Findings(tables={"by_model": by_model} | tables, numbers={}, claims=_claims(by_model))


Run = tuple[str, str, Callable[[int], Model], str, str]


def _runs(settings: Settings) -> list[Run]:
    """What is tried: the open problem, the model's name, how to make one from a seed, its encoding, and which views it learns."""

    def thesis(seed: int) -> Model:
        return make_model("mlp", **published.BEST_TUNINGS["whole_route"][2], max_iter=settings.iterations[1], seed=seed)

    def model(name: str, **parameters) -> Callable[[int], Model]:
        return lambda seed: make_model(name, seed=seed, **parameters)

    steps = {"steps": 200} if settings.quick else {}
    rotation, network = model("mlp-rotation", **steps), "mlp-rotation"
    return [
        ("the thesis", "mlp", thesis, "grey", "every 6th"),
        ("full scans", network, rotation, "grey", "every 6th"),
        ("feature selection", "mlp", thesis, "edges", "every 6th"),
        ("feature selection", "adaboost", model("adaboost"), "grey", "every 6th"),
        ("feature selection", network, rotation, "edges", "every 6th"),
        ("corners", network, rotation, "edges", "equally different"),
        ("several networks", "mlp-mixture", model("mlp-mixture", **steps), "edges", "every 6th"),
        ("all together", network, rotation, "edges", "every 2nd"),
        ("all together", "perfect-memory", model("perfect-memory"), "edges", "every 2nd"),
    ]


def _claims(by_model: pd.DataFrame) -> list[Claim]:
    like_it = (
        (by_model["model"] == "mlp-rotation") & (by_model["encoding"] == "edges") & (by_model["views"] == "every 6th")
    )
    first, last = by_model.iloc[0], by_model[like_it].iloc[0]
    return [
        Claim(
            key="full-scan-solved",
            figure="beyond",
            statement="Beyond the thesis: a network as large, taught all rotations of the edges in the same views, recovers headings "
            "over the full circle.",
            published={"median error of its classifier (deg)": published.SCAN_MEDIAN_DEG[360]},
            obtained={
                "median error of its classifier (deg)": float(first["median_error_deg"]),
                "of mlp-rotation (deg)": float(last["median_error_deg"]),
                "in corners, classifier (deg)": float(first["median_error_deg_corners"]),
                "in corners, mlp-rotation (deg)": float(last["median_error_deg_corners"]),
            },
            test="its median error over 360 degrees is under 10, and lower than the classifier's",
            holds=bool(last["median_error_deg"] < 10 and last["median_error_deg"] < first["median_error_deg"]),
        ),
    ]
