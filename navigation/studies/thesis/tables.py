"""All tables of the thesis's report."""

from collections.abc import Callable

import pandas as pd

from ...reports.results import StudyResults
from . import published
from .classifier import PARTS
from .items import Item

TOP = 12  # rows of a search that are shown; results.json has all


def _resizing(results: StudyResults) -> pd.DataFrame:
    table = results.tables["by_factor"]
    columns = {}
    for smoothed, name in ((False, "without smoothing"), (True, "with smoothing")):
        rows = table[(table["resizing"] == "sampled") & (table["smoothed"] == smoothed)].set_index("factor")
        for number, label in (("median_error_deg", "median"), ("mean_error_deg", "mean")):
            columns[f"{label}, {name}: thesis"] = rows[f"published_{number}"]
            columns["here" + " " * len(columns)] = rows[number]  # spaces make the names unique; the page shows none
    return pd.DataFrame(columns).reset_index()


def _search(name: str) -> Callable[[StudyResults], pd.DataFrame]:
    def rows(results: StudyResults) -> pd.DataFrame:
        table = results.tables[name].head(TOP)
        return table.rename(columns=lambda column: column.removeprefix("param_").replace("_", " "))

    return rows


def _networks(results: StudyResults) -> pd.DataFrame:
    tables = [results.tables[f"networks_{part}"].assign(part=part.replace("_", " ")) for part in PARTS]
    table = pd.concat(tables)[["part", "seed", "accuracy", "median_error_deg", "mean_error_deg", "share_over_45"]]
    return _with_headings(table)


def _whole(name: str) -> Callable[[StudyResults], pd.DataFrame]:
    return lambda results: _with_headings(results.tables[name])


def _with_headings(table: pd.DataFrame) -> pd.DataFrame:
    """The table with headings in place of column names."""
    return table.rename(columns=lambda column: column.replace("_deg", " (°)").replace("_", " "))


def _scans(results: StudyResults) -> pd.DataFrame:
    keys = ["iterations", "scan_deg"]
    medians = results.tables["networks"].groupby(keys, as_index=False).median(numeric_only=True)
    chance = results.tables["chance"].set_index("scan_deg")["median_error_deg"]
    medians["a random heading's median error (°)"] = medians["scan_deg"].map(chance)
    table = medians.drop(columns=["seed", "places"]).sort_values(keys, ascending=[True, False])
    return _with_headings(table)


def _thesis_best(part: str) -> str:
    score, training, tuning = published.BEST_TUNINGS[part]
    parameters = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in tuning.items())
    return f"The thesis's best: validation score {score}, training score {training}, with {parameters}."


TABLES = (
    Item(
        number="7.3 numbers",
        study="resolution",
        title="The numbers of appendix 7.3, published and obtained",
        caption="Errors (degrees) at each resize factor: the thesis's, and those of views that are sampled as in the thesis.",
        rows=_resizing,
    ),
    Item(
        number="24",
        study="classifier",
        title="Classification report, first 20 views",
        caption="On held-out views. The thesis: precision, recall and f1 of 1.00 for both classes, 10 views each.",
        rows=_whole("report_first_20"),
    ),
    Item(
        number="7.4",
        study="classifier",
        title="Grid search, first 20 views",
        caption="The best tunings of the thesis's grid by scikit-learn's GridSearchCV, with three folds. "
        + _thesis_best("first_20"),
        rows=_search("search_first_20"),
    ),
    Item(
        number="26",
        study="classifier",
        title="Classification report, whole route",
        caption="On held-out views. The thesis: precision 0.96 and 0.94, recall 0.93 and 0.96, 46 views each.",
        rows=_whole("report_whole_route"),
    ),
    Item(
        number="7.5",
        study="classifier",
        title="Grid search, whole route",
        caption=f"As above. {_thesis_best('whole_route')}",
        rows=_search("search_whole_route"),
    ),
    Item(
        number="starts",
        study="classifier",
        title="Networks from different random starts",
        caption="Each has the best tuning of its search; the numbers above are the medians of these rows.",
        rows=_networks,
    ),
    Item(
        number="selections",
        study="corners",
        title="Which views are learned, and the results",
        caption="The thesis's two selections; as many views as in the second, evenly spaced; and as many as in the first, chosen so that "
        "successive views differ equally. All have the best tuning for the whole route, except for the last row.",
        rows=_whole("by_selection"),
    ),
    Item(
        number="7.6",
        study="corners",
        title="Grid search, more views in the corners",
        caption=f"As above. {_thesis_best('more_in_corners')}",
        rows=_search("search"),
    ),
    Item(
        number="scans",
        study="confidence",
        title="Training time and the width of the scan",
        caption="Medians over random starts. The last column has the error of a random heading within the same scan: part of the gain of a "
        "narrow scan.",
        rows=_scans,
    ),
    Item(
        number="beyond numbers",
        study="beyond",
        title="Models, features and selections of views",
        caption="Errors over the full circle, of one random start each.",
        rows=_whole("by_model"),
    ),
)
