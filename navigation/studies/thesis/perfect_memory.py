"""Studies 3 and 4: perfect memory, by the number and the resolution of its training views (section 4.3)."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from ...encoding import Encoding
from ...models import make_model
from ...reports.claims import Decision, Numbers, claim
from ...reports.effects import Effect, effect_size
from ...reports.results import StudyResults
from . import published
from .effects import over_columns
from .headings import box_of, errors_of, headings
from .parameters import ENCODING, QUICK_FACTORS, SMOOTHING, Progress, StudySettings
from .study_data import StudyData

FREQUENCIES = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 25, 30)
RESIZING = {"sampled": "sample", "averaged": "resize"}  # encoding steps: as in the thesis, and without aliasing
FINE, MIDDLE, COARSE = range(1, 5), range(3, 9), range(8, 11)  # resize factors


def frequency(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """Headings along the route when every N-th view is remembered (figures 12 to 15, appendix 7.2)."""
    encoding = ENCODING if settings.quick else Encoding.parse("grey")
    route_images, grid_images = encoding(data.route_views), encoding(data.grid_views)
    frequencies = [every for every in FREQUENCIES if every < len(route_images) / 4]
    tables, boxes = {}, []
    for done, every in enumerate(frequencies):
        learned = route_images[::every]
        tables[every] = headings(data, make_model("perfect-memory").fit(learned), grid_images)
        boxes.append({"every": every, "views": len(learned)} | box_of(tables[every]["error_deg"]))
        progress(done + 1, len(frequencies))
    errors = [table[["place", "error_deg"]].assign(every=every) for every, table in tables.items()]
    return StudyResults(
        tables={
            "headings": tables[1],
            "errors": pd.concat(errors, ignore_index=True),
            "by_frequency": pd.DataFrame(boxes),
        },
        numbers=errors_of(tables[1]) | {"encoding": str(encoding)},
    )


def resolution(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """Headings when views are resized, with and without Gaussian smoothing before (figure 16, appendix 7.3).

    The thesis's twenty numbers are next to those of views that are sampled, as cv2.resize does by default.
    """
    factors = published.FACTORS[::3] if settings.quick else published.FACTORS
    runs = [(way, smoothed, factor) for way in RESIZING for smoothed in (False, True) for factor in factors]
    errors, boxes, unresized = [], [], {}
    for done, (way, smoothed, factor) in enumerate(runs):
        blur = f"blur {SMOOTHING:g} | " if smoothed else ""
        encoding = Encoding.parse(f"grey | {blur}{RESIZING[way]} {factor}")
        table = unresized.get(smoothed) if factor == 1 else None  # factor 1 does not change views, whichever way
        if table is None:
            model = make_model("perfect-memory").fit(encoding(data.route_views))
            table = headings(data, model, encoding(data.grid_views))
        if factor == 1:
            unresized[smoothed] = table
        run = {"resizing": way, "smoothed": smoothed, "factor": factor}
        errors.append(table[["place", "error_deg"]].assign(**run))
        boxes.append(run | box_of(table["error_deg"]))
        progress(done + 1, len(runs))
    return StudyResults(
        tables={"errors": pd.concat(errors, ignore_index=True), "by_factor": _with_published(pd.DataFrame(boxes))},
        numbers={"smoothing_px": SMOOTHING},
    )


def _with_published(boxes: pd.DataFrame) -> pd.DataFrame:
    """The rows with the thesis's numbers, which are for sampled views."""
    for number in ("median_error_deg", "mean_error_deg"):
        boxes[f"published_{number}"] = [
            (published.RESIZED_SMOOTHED if row.smoothed else published.RESIZED)[number][row.factor - 1]
            if row.resizing == "sampled"
            else np.nan
            for row in boxes.itertuples()
        ]
    return boxes


@claim(
    "mean-biased-by-outliers",
    "12",
    "the median is under 45 degrees, and the mean at least twice the median",
    published={
        "median error (deg)": published.RESIZED["median_error_deg"][0],
        "mean error (deg)": published.RESIZED["mean_error_deg"][0],
    },
    note="Published: appendix 7.3 at resize factor 1.",
)
def _outliers(results: StudyResults) -> Decision:
    """Perfect memory recovers most headings; a few are completely wrong and raise the mean."""
    errors = errors_of(results.tables["headings"])
    median, mean = errors["median_error_deg"], errors["mean_error_deg"]
    each = results.tables["headings"]["error_deg"].to_numpy()
    effect = effect_size(
        "mean minus median (deg)",
        len(each),
        lambda rows: float(each[rows].mean() - np.median(each[rows])),
        of="positions",
    )
    obtained = {"median error (deg)": median, "mean error (deg)": mean}
    return Decision(obtained, median < 45 and mean >= 2 * median, effect)


@claim(
    "error-grows-with-frequency",
    "14",
    "the rank correlation of the median error and the spacing of the remembered views is positive (p < 0.01)",
)
def _error_and_frequency(results: StudyResults) -> Decision:
    """The fewer views of the route are remembered, the larger the median error."""
    boxes = results.tables["by_frequency"]
    rank = spearmanr(boxes["every"], boxes["median_error_deg"])
    medians = boxes.set_index("every")["median_error_deg"]
    shown = [every for every in (1, 6, 10, 20, 30) if every in medians]
    obtained = {f"median error, every {every} (deg)": float(medians[every]) for every in shown}
    obtained["rank correlation"] = float(rank.statistic)
    effect = over_columns(
        "rank correlation",
        results.tables["errors"],
        "every",
        lambda errors: spearmanr(boxes["every"], errors).statistic,
    )
    return Decision(obtained, bool(rank.statistic > 0 and rank.pvalue < 0.01), effect)


def _medians(results: StudyResults, column: str, resizing: str, smoothed: bool, factors: range) -> np.ndarray:
    """A column of the table by resize factor, at some factors."""
    boxes = results.tables["by_factor"]
    rows = (boxes["resizing"] == resizing) & (boxes["smoothed"] == smoothed) & boxes["factor"].isin(factors)
    return boxes.loc[rows, column].to_numpy()


def _by_resolution(results: StudyResults, column: str) -> Numbers:
    fine, coarse = (_medians(results, column, "sampled", False, factors) for factors in (FINE, COARSE))
    return {
        "median error, factors 1 to 4 (deg)": float(np.mean(fine)),
        "factors 8 to 10 (deg)": float(np.mean(coarse)),
        "highest by lowest, factors 1 to 4": float(fine.max() / fine.min()),
    }


@claim(
    "flat-then-rises-with-resize",
    "16",
    "at factors 1 to 4 no median is over 1.5 times another; at factors 8 to 10 their mean is at least a quarter higher",
    published=lambda results: _by_resolution(results, "published_median_error_deg"),
    note="Tested on views that are sampled, as cv2.resize does by default. Where views are averaged instead, no detail aliases.",
    not_quick=QUICK_FACTORS,
)
def _flat_then_rises(results: StudyResults) -> Decision:
    """The median error is flat at small resize factors, then rises."""
    sampled = _by_resolution(results, "median_error_deg")
    fine, coarse, ratio = sampled.values()
    averaged = {
        f"averaged, factors {factors[0]} to {factors[-1]} (deg)": float(
            np.mean(_medians(results, "median_error_deg", "averaged", False, factors))
        )
        for factors in (FINE, COARSE)
    }
    effect = _over_factors(
        results,
        "factors 8 to 10 over factors 1 to 4",
        [False],
        lambda errors, factors: errors[np.isin(factors, COARSE)].mean() / errors[np.isin(factors, FINE)].mean(),
    )
    return Decision(sampled | averaged, bool(ratio <= 1.5 and coarse / fine >= 1.25), effect)


def _by_smoothing(results: StudyResults, column: str) -> Numbers:
    without, smoothed = (_medians(results, column, "sampled", smoothed, MIDDLE) for smoothed in (False, True))
    return {
        "median error without smoothing (deg)": float(np.mean(without)),
        "with smoothing (deg)": float(np.mean(smoothed)),
        "share of factors where it helps": float(np.mean(smoothed < without)),
    }


@claim(
    "smoothing-helps",
    "7.3",
    "over factors 3 to 8 the mean of the medians is lower with smoothing, and the median at more than half of the factors",
    published=lambda results: _by_smoothing(results, "published_median_error_deg"),
    not_quick=QUICK_FACTORS,
)
def _smoothing_helps(results: StudyResults) -> Decision:
    """Gaussian smoothing lowers the error at middle resolutions."""
    obtained = _by_smoothing(results, "median_error_deg")
    without, smoothed, share = obtained.values()

    def gain(errors: np.ndarray, factors: np.ndarray) -> float:
        first, second = errors.reshape(2, -1)[:, np.isin(factors[: len(factors) // 2], MIDDLE)]
        return float(np.mean(first - second))

    effect = _over_factors(results, "error without smoothing minus that with it (deg)", [False, True], gain)
    return Decision(obtained, smoothed < without and share > 0.5, effect)


@claim(
    "middle-resolution-best",
    "16",
    "the lowest median error with smoothing is at neither the first nor the last factor",
    published={
        "best factor, text of 4.3.4": 6.0,
        "best factor, table of 7.3": float(1 + np.argmin(published.RESIZED_SMOOTHED["median_error_deg"])),
    },
    note="The thesis's text gives factor 6 as the best; its own table has the lowest error at factor 3.",
    not_quick=QUICK_FACTORS,
)
def _best_factor(results: StudyResults) -> Decision:
    """A middle resolution is better than the original one."""
    boxes = results.tables["by_factor"]
    smoothed = boxes[(boxes["resizing"] == "sampled") & boxes["smoothed"]]
    best = float(smoothed.loc[smoothed["median_error_deg"].idxmin(), "factor"])
    effect = _over_factors(results, "best factor", [True], lambda errors, factors: factors[errors.argmin()])
    return Decision({"best factor": best}, 1 < best < max(published.FACTORS), effect)


def _over_factors(
    results: StudyResults,
    label: str,
    smoothed: list[bool],
    statistic: Callable[[np.ndarray, np.ndarray], float],
) -> Effect:
    """A number computed from the median errors of sampled views and their resize factors: first those without smoothing, then those
    with it, as far as they are asked for."""
    errors = results.tables["errors"]
    errors = errors[(errors["resizing"] == "sampled") & errors["smoothed"].isin(smoothed)]
    factors = np.tile(np.sort(errors["factor"].unique()), len(smoothed))
    return over_columns(label, errors, ["smoothed", "factor"], lambda medians: float(statistic(medians, factors)))


FREQUENCY_CLAIMS = (_outliers, _error_and_frequency)

RESOLUTION_CLAIMS = (_flat_then_rises, _smoothing_helps, _best_factor)
