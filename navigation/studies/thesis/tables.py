"""The tables of the report, from findings."""

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from ...reports.findings import Findings
from . import published

TOP = 12  # rows of a search that are shown; all are in results.json


@dataclass(frozen=True, kw_only=True)
class Listing:
    """A table of the report. number: the thesis's figure or appendix, or a word. rows: what it shows; columns are headings."""

    number: str
    study: str
    title: str
    caption: str
    rows: Callable[[Findings], pd.DataFrame]


def _resizing(found: Findings) -> pd.DataFrame:
    table = found.tables["by_factor"]
    columns = {}
    for smoothed, name in ((False, "without smoothing"), (True, "with smoothing")):
        rows = table[(table["resizing"] == "sampled") & (table["smoothed"] == smoothed)].set_index("factor")
        for number, word in (("median_error_deg", "median"), ("mean_error_deg", "mean")):
            columns[f"{word}, {name}: thesis"] = rows[f"published_{number}"]
            columns["here" + " " * len(columns)] = rows[number]  # headings of one word, each its own
    return pd.DataFrame(columns).reset_index()


def _search(name: str) -> Callable[[Findings], pd.DataFrame]:
    def rows(found: Findings) -> pd.DataFrame:
        table = found.tables[name].head(TOP).copy()
        return table.rename(columns=lambda column: column.removeprefix("param_").replace("_", " "))

    return rows


def _networks(found: Findings) -> pd.DataFrame:
    tables = [
        found.tables[f"networks_{part}"].assign(part=part.replace("_", " ")) for part in ("first_20", "whole_route")
    ]
    table = pd.concat(tables)[["part", "seed", "accuracy", "median_error_deg", "mean_error_deg", "share_over_45"]]
    return _plain(table)


def _whole(name: str) -> Callable[[Findings], pd.DataFrame]:
    return lambda found: _plain(found.tables[name])


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """Headings as people read them; degrees named."""
    return table.rename(columns=lambda column: column.replace("_deg", " (°)").replace("_", " "))


def _scans(found: Findings) -> pd.DataFrame:
    middle = found.tables["networks"].groupby(["iterations", "scan_deg"], as_index=False).median(numeric_only=True)
    chance = found.tables["chance"].set_index("scan_deg")["median_error_deg"]
    middle["a random heading's median error (°)"] = middle["scan_deg"].map(chance)
    return _plain(
        middle.drop(columns=["seed", "places"]).sort_values(["iterations", "scan_deg"], ascending=[True, False])
    )


def _note(part: str) -> str:
    score, training, tuning = published.BEST_TUNINGS[part]
    words = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in tuning.items())
    return f"The thesis's best: validation score {score}, training score {training}, with {words}."


LISTINGS = [
    Listing(
        number="7.3 numbers",
        study="resolution",
        title="The twenty numbers of appendix 7.3, twice",
        caption="Errors (degrees) at each resize factor: the thesis's, and views sampled as its were.",
        rows=_resizing,
    ),
    Listing(
        number="24",
        study="classifier",
        title="Classification report, first 20 views",
        caption="On held-out views. The thesis: precision, recall and f1 of 1.00 for both classes, 10 views each.",
        rows=_whole("report_first_20"),
    ),
    Listing(
        number="7.4",
        study="classifier",
        title="Grid search, first 20 views",
        caption=f"The best tunings of the thesis's grid by scikit-learn's GridSearchCV, three folds. {_note('first_20')}",
        rows=_search("search_first_20"),
    ),
    Listing(
        number="26",
        study="classifier",
        title="Classification report, whole route",
        caption="On held-out views. The thesis: precision 0.96 and 0.94, recall 0.93 and 0.96, 46 views each.",
        rows=_whole("report_whole_route"),
    ),
    Listing(
        number="7.5",
        study="classifier",
        title="Grid search, whole route",
        caption=f"As above. {_note('whole_route')}",
        rows=_search("search_whole_route"),
    ),
    Listing(
        number="starts",
        study="classifier",
        title="Networks from different random starts",
        caption="Each with the best tuning of its search; the medians of these rows are the numbers above.",
        rows=_networks,
    ),
    Listing(
        number="selections",
        study="corners",
        title="Which views are learned, and what it does",
        caption="The thesis's two choices; as many views as its second, spread evenly; as many as its first, chosen so that "
        "successive ones differ equally. All with the best tuning for the whole route but for the last row.",
        rows=_whole("by_selection"),
    ),
    Listing(
        number="7.6",
        study="corners",
        title="Grid search, more views in the corners",
        caption=f"As above. {_note('more_in_corners')}",
        rows=_search("search"),
    ),
    Listing(
        number="scans",
        study="confidence",
        title="Training time and the width of the scan",
        caption="Medians over random starts. A random heading in the same scan has the error in the last column: part of what a "
        "narrow scan gains.",
        rows=_scans,
    ),
    Listing(
        number="beyond numbers",
        study="beyond",
        title="Models, features and choices of views",
        caption="Errors over the full circle, of one random start each.",
        rows=_whole("by_model"),
    ),
]
