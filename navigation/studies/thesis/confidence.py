"""Study 7: confidence by training time, reversed headings, and narrow scans (sections 4.4.7.1 and 4.4.7.2)."""

import math

import numpy as np
import pandas as pd
from scipy.special import expit

from tussock.world.geometry import wrap_angle

from ...evaluation import RECOVERED_DEG
from ...models import MLP
from ...reports.claims import Decision, claim
from ...reports.effects import Effect, effect_size
from ...reports.results import StudyResults
from . import published
from .classifier import learned_views
from .corners import corner_views
from .effects import fall_of_median
from .headings import CHANCE_MEDIAN_DEG, errors_of, headings, relative_to_set_heading
from .parameters import QUICK_NETWORKS, Progress, StudySettings
from .study_data import StudyData

SCANS_DEG = (360, 180, 90)
REVERSED_DEG = 135.0  # a heading with a larger error is nearer to the reverse than to a side
HIGH = 0.9  # of the range between a scan's lowest and highest confidence


def study(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """The thesis's network of the whole route after a short and a long training, with full and narrow scans."""
    learned, tuning = learned_views(data), published.BEST_TUNINGS["whole_route"][2]
    rows, networks, tables = [], {}, {}
    runs = [(iterations, seed) for iterations in settings.iterations for seed in settings.seeds]
    for done, (iterations, seed) in enumerate(runs):
        network = MLP(**tuning, max_iter=iterations, seed=seed).fit(data.route_images[learned])
        for scan in SCANS_DEG:
            table = headings(data, network, data.grid_images, scan_deg=scan)
            rows.append(
                {"iterations": iterations, "seed": seed, "scan_deg": scan}
                | errors_of(table)
                | {"high_share": _high_share(network, data), "reversed_share": _reversed_share(table)}
            )
            tables[iterations, seed, scan] = table
        networks[iterations, seed] = network
        progress(done + 1, len(runs))
    results = pd.DataFrame(rows)
    short, long = settings.iterations
    seed = _middle_seed(results, long)
    recovered, reversed_ = _examples(data, tables[long, seed, 360])
    curves = [
        _curve(networks[iterations, seed], data, row).assign(iterations=iterations, place=name)
        for iterations in settings.iterations
        for name, row in (("recovered", recovered), ("reversed", reversed_))
    ]
    shown = {"short": (short, 360), "long": (long, 360), "scan_180": (long, 180), "scan_90": (long, 90)}
    return StudyResults(
        tables={"networks": results, "curves": pd.concat(curves, ignore_index=True), "chance": random_errors(data)}
        | {f"headings_{name}": tables[iterations, seed, scan] for name, (iterations, scan) in shown.items()},
        numbers={
            "iterations": [short, long],
            "general_direction_deg": float(np.degrees(data.general_direction)),
            "place_recovered": recovered,
            "place_reversed": reversed_,
            "seed_shown": seed,
        },
    )


def _curve(network: MLP, data: StudyData, row: int) -> pd.DataFrame:
    """Confidence at every rotation of a grid view."""
    confidence = expit(network.scan(data.grid_images[row : row + 1]).double().cpu().numpy()[0])
    return relative_to_set_heading(confidence, data.poses[row, 2], data.set_headings[row], name="confidence")


def _high_share(network: MLP, data: StudyData) -> float:
    """Median share of rotations with a confidence close to the highest of their scan: how broad its top is."""
    confidence = expit(network.scan(data.grid_images[data.near]).double().cpu().numpy())
    low, high = confidence.min(axis=1, keepdims=True), confidence.max(axis=1, keepdims=True)
    return float(np.median((confidence >= low + HIGH * (high - low)).mean(axis=1)))


def _reversed_share(table: pd.DataFrame) -> float:
    """Share of the headings over 45 degrees off that are nearer to the reverse than to a side: a third for random headings."""
    failed = table.loc[table["error_deg"] > RECOVERED_DEG, "error_deg"]
    return float((failed > REVERSED_DEG).mean()) if len(failed) else math.nan


def _middle_seed(results: pd.DataFrame, iterations: int) -> int:
    """Seed of the network with the middle median error."""
    rows = results[(results["iterations"] == iterations) & (results["scan_deg"] == 360)]
    return int(rows.sort_values("median_error_deg", kind="stable")["seed"].iloc[(len(rows) - 1) // 2])


def _examples(data: StudyData, table: pd.DataFrame) -> tuple[int, int]:
    """Two grid poses near straights: the one with the smallest error, and the one with the largest (figure 35)."""
    straight = table[~table["nearest_view"].isin(corner_views(data.route))]
    straight = straight if len(straight) else table
    order = straight.sort_values("error_deg", kind="stable")["place"]
    return int(order.iloc[0]), int(order.iloc[-1])


def random_errors(data: StudyData) -> pd.DataFrame:
    """Median error of random headings within each scan about the general direction: what a narrow scan alone gains."""
    rows = []
    for scan in SCANS_DEG:
        random = data.general_direction + np.radians(np.linspace(-scan / 2, scan / 2, 721))
        errors = np.abs(wrap_angle(random - data.set_headings[data.near][:, None]))
        rows.append({"scan_deg": scan, "median_error_deg": float(np.degrees(np.median(errors)))})
    return pd.DataFrame(rows)


def _medians(results: StudyResults, column: str) -> dict[tuple[int, int], float]:
    """Median over random starts of a column, by iterations and width of the scan."""
    medians = results.tables["networks"].groupby(["iterations", "scan_deg"])[column].median()
    return {key: float(value) for key, value in medians.items()}  # type: ignore[misc]


@claim(
    "longer-training-helps",
    "34",
    "the median error is lower after the longer training, and then under that of random headings (90)",
    published={f"median error, {n:,} iterations (deg)": published.ITERATIONS_MEDIAN_DEG[n] for n in (600, 3000)},
    not_quick=QUICK_NETWORKS,
)
def _longer_helps(results: StudyResults) -> Decision:
    """3,000 iterations recover more headings than 600."""
    median, (short, long) = _medians(results, "median_error_deg"), results.numbers["iterations"]
    obtained = {f"median error, {n:,} iterations (deg)": median[n, 360] for n in (short, long)}
    tables = (results.tables[f"headings_{name}"] for name in ("short", "long"))
    effect = fall_of_median("fall of the median error, one network (deg)", *tables)
    return Decision(obtained, median[long, 360] < min(median[short, 360], CHANCE_MEDIAN_DEG), effect)


@claim(
    "longer-training-broadens",
    "33",
    "the share of rotations in the upper tenth of a scan's range is larger after the longer training, and then the median error is under "
    "that of random headings (90)",
    not_quick=QUICK_NETWORKS,
)
def _longer_broadens(results: StudyResults) -> Decision:
    """Longer training spreads high confidence over more rotations."""
    broad, (short, long) = _medians(results, "high_share"), results.numbers["iterations"]
    obtained = {f"share of rotations near the top, {n:,} iterations": broad[n, 360] for n in (short, long)}
    better_than_chance = _medians(results, "median_error_deg")[long, 360] < CHANCE_MEDIAN_DEG
    return Decision(obtained, broad[long, 360] > broad[short, 360] and better_than_chance, _broadening(results))


def _broadening(results: StudyResults) -> Effect:
    """How much larger the share of rotations near the top is after the longer training. Units are pairs of networks."""
    networks = results.tables["networks"]
    by_start = networks[networks["scan_deg"] == 360].pivot_table(
        index="seed", columns="iterations", values="high_share"
    )
    growth = by_start.to_numpy() @ (-1, 1)
    label = "growth of the share of rotations near the top"
    return effect_size(label, len(growth), lambda starts: float(np.median(growth[starts])), of="starts")


@claim(
    "failures-point-backwards",
    "36",
    "of the headings over 45 degrees off, more than a third are over 135 degrees off",
    note="Of random headings, a third would be.",
    not_quick=QUICK_NETWORKS,
)
def _backwards(results: StudyResults) -> Decision:
    """Wrong headings point backwards, where the network was not trained."""
    share = _medians(results, "reversed_share")[results.numbers["iterations"][1], 360]
    obtained = {"share of failures over 135 degrees off": share}
    if math.isnan(share):
        return Decision(obtained, None, reason="no heading is over 45 degrees off")
    errors = results.tables["headings_long"]["error_deg"]
    backwards = (errors[errors > RECOVERED_DEG] > REVERSED_DEG).to_numpy(float)
    label = "share of failures over 135 degrees off, one network"
    effect = effect_size(label, len(backwards), lambda failed: float(backwards[failed].mean()), of="failures")
    return Decision(obtained, share > 1 / 3, effect)


@claim(
    "narrower-scans-help",
    "38",
    "the median error falls from 360 to 180 to 90 degrees, and is under that of random headings within each of these scans",
    published={f"median error, {scan} degrees (deg)": published.SCAN_MEDIAN_DEG[scan] for scan in SCANS_DEG}
    | {"180 degrees, in the conclusion (deg)": published.SCAN_180_IN_CONCLUSION_DEG},
    note=(
        "The thesis gives 15 degrees for the scan of 180 degrees in section 4.4.7.2 and 17 in its conclusion. A narrow scan about "
        "the right direction lowers the error of a random heading as well."
    ),
    not_quick=QUICK_NETWORKS,
)
def _narrower_helps(results: StudyResults) -> Decision:
    """Scans of 180, then 90 degrees about the general direction lower the error."""
    median, long = _medians(results, "median_error_deg"), results.numbers["iterations"][1]
    by_chance = results.tables["chance"].set_index("scan_deg")["median_error_deg"]
    obtained = {f"median error, {scan} degrees (deg)": median[long, scan] for scan in SCANS_DEG}
    obtained |= {f"a random heading in {scan} degrees (deg)": float(by_chance[scan]) for scan in SCANS_DEG}
    full, half, quarter = (median[long, scan] for scan in SCANS_DEG)
    better_than_chance = all(median[long, scan] < by_chance[scan] for scan in SCANS_DEG)
    tables = (results.tables[f"headings_{name}"] for name in ("long", "scan_90"))
    effect = fall_of_median("fall of the median error from 360 to 90 degrees, one network (deg)", *tables)
    return Decision(obtained, bool(full > half > quarter and better_than_chance), effect)


CLAIMS = (_longer_helps, _longer_broadens, _backwards, _narrower_helps)
