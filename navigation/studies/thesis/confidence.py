"""Study 7: confidence against training time, reversed headings, and limited scans (sections 4.4.7.1 and 4.4.7.2)."""

import numpy as np
import pandas as pd
from scipy.special import expit

from tussock.world.geometry import wrap_angle

from ...evaluation import RECOVERED_DEG
from ...models import MLP
from ...models.base import Images
from ...reports.findings import Claim, Findings
from . import published
from .classifier import learned_views
from .corners import corner_views
from .headings import around_set_heading, errors_of, headings
from .material import Material
from .settings import ENCODING, Settings

SCANS_DEG = (360, 180, 90)
REVERSED_DEG = 135.0  # farther off than this is nearer to the reverse than to a side
HIGH = 0.9  # of the range between a scan's lowest and highest confidence


def study(material: Material, settings: Settings, progress=lambda done, total: None) -> Findings:
    """The thesis's network of the whole route, trained for a short and a long time, scanned in full and about one direction."""
    views, places = ENCODING(material.route_views), ENCODING(material.place_views)
    learned = learned_views(material)
    tuning = published.BEST_TUNINGS["whole_route"][2]
    rows, trained, tables = [], {}, {}
    runs = [(iterations, seed) for iterations in settings.iterations for seed in settings.seeds]
    for done, (iterations, seed) in enumerate(runs):
        network = MLP(**tuning, max_iter=iterations, seed=seed).fit(views[learned])
        for scan in SCANS_DEG:
            table = headings(material, network, places, scan_deg=scan)
            more = {"high_share": _high_share(network, places, material.near), "reversed_share": _reversed_share(table)}
            rows.append({"iterations": iterations, "seed": seed, "scan_deg": scan} | errors_of(table) | more)
            tables[iterations, seed, scan] = table
        trained[iterations, seed] = network
        progress(done + 1, len(runs))
    results, chance = pd.DataFrame(rows), _chance(material)
    short, long = settings.iterations
    seed = _middle_seed(results, long)
    recovered, reversed_ = _examples(material, tables[long, seed, 360])
    curves = [
        _curve(trained[iterations, seed], places, material, place).assign(iterations=iterations, place=name)
        for iterations in settings.iterations
        for name, place in (("recovered", recovered), ("reversed", reversed_))
    ]
    names = {"short": (short, 360), "long": (long, 360), "scan_180": (long, 180), "scan_90": (long, 90)}
    return Findings(
        tables={"networks": results, "curves": pd.concat(curves, ignore_index=True), "chance": chance}
        | {f"headings_{name}": tables[iterations, seed, scan] for name, (iterations, scan) in names.items()},
        numbers={
            "iterations": [short, long], "general_direction_deg": float(np.degrees(material.general_direction)),
            "place_recovered": recovered, "place_reversed": reversed_, "seed_shown": seed,
        },
        claims=_claims(results, chance, settings),
    )  # fmt: skip


def _curve(network: MLP, places: Images, material: Material, row: int) -> pd.DataFrame:
    """Confidence at every rotation of a place's view."""
    confidence = expit(network.scan(places[row : row + 1]).double().cpu().numpy()[0])
    return around_set_heading(confidence, material.places[row, 2], material.wanted[row], name="confidence")


def _high_share(network: MLP, places: Images, rows: np.ndarray) -> float:
    """Median share of rotations whose confidence is close to the highest of their scan: how broad its top is."""
    confidence = expit(network.scan(places[rows]).double().cpu().numpy())
    low, high = confidence.min(axis=1, keepdims=True), confidence.max(axis=1, keepdims=True)
    return float(np.median((confidence >= low + HIGH * (high - low)).mean(axis=1)))


def _reversed_share(table: pd.DataFrame) -> float:
    """Of the headings over 45 degrees off, the share nearer to the reverse than to a side: a third if they were spread evenly."""
    failed = table.loc[table["error_deg"] > RECOVERED_DEG, "error_deg"]
    return float((failed > REVERSED_DEG).mean()) if len(failed) else float("nan")


def _middle_seed(results: pd.DataFrame, iterations: int) -> int:
    chosen = results[(results["iterations"] == iterations) & (results["scan_deg"] == 360)]
    return int(chosen.sort_values("median_error_deg", kind="stable")["seed"].iloc[(len(chosen) - 1) // 2])


def _examples(material: Material, table: pd.DataFrame) -> tuple[int, int]:
    """Two places beside straights: one whose heading is recovered, one whose heading is reversed the most (figure 35)."""
    straight = table[~table["nearest_view"].isin(corner_views(material.route))]
    straight = straight if len(straight) else table
    order = straight.sort_values("error_deg", kind="stable")["place"]
    return int(order.iloc[0]), int(order.iloc[-1])


def _chance(material: Material) -> pd.DataFrame:
    """Median error of a heading drawn at random from each scan about the general direction: what a narrow scan gives away."""
    rows = []
    for scan in SCANS_DEG:
        headings_ = material.general_direction + np.radians(np.linspace(-scan / 2, scan / 2, 721))
        errors = np.abs(wrap_angle(headings_ - material.wanted[material.near][:, None]))
        rows.append({"scan_deg": scan, "median_error_deg": float(np.degrees(np.median(errors)))})
    return pd.DataFrame(rows)


def _claims(results: pd.DataFrame, chance: pd.DataFrame, settings: Settings) -> list[Claim]:
    middle = results.groupby(["iterations", "scan_deg"]).median(numeric_only=True)
    short, long = settings.iterations
    median, broad = middle["median_error_deg"], middle["high_share"]
    backward = float(
        results.loc[(results["iterations"] == long) & (results["scan_deg"] == 360), "reversed_share"].median()
    )
    by_chance = chance.set_index("scan_deg")["median_error_deg"]
    wide, half, quarter = (float(median[long, scan]) for scan in SCANS_DEG)
    return [
        Claim(
            key="longer-training-helps",
            figure="34",
            statement="3,000 iterations recover more headings than 600.",
            published={
                f"median error, {n:,} iterations (deg)": published.ITERATIONS_MEDIAN_DEG[n] for n in (600, 3000)
            },
            obtained={f"median error, {n:,} iterations (deg)": float(median[n, 360]) for n in (short, long)},
            test="the median error is lower after the longer training",
            holds=bool(median[long, 360] < median[short, 360]),
        ),
        Claim(
            key="longer-training-broadens",
            figure="33",
            statement="Longer training spreads high confidence over more rotations.",
            published={},
            obtained={
                f"share of rotations near the top, {n:,} iterations": float(broad[n, 360]) for n in (short, long)
            },
            test="the share of rotations in the upper tenth of a scan's range is larger after the longer training",
            holds=bool(broad[long, 360] > broad[short, 360]),
        ),
        Claim(
            key="failures-point-backwards",
            figure="36",
            statement="Headings that fail point backwards, where the network was never taught.",
            published={},
            obtained={"share of failures over 135 degrees off": backward},
            test="of the headings over 45 degrees off, more than a third are over 135 degrees off",
            holds=backward > 1 / 3 if backward == backward else None,
            note="Evenly spread failures would give a third.",
        ),
        Claim(
            key="narrower-scans-help",
            figure="38",
            statement="Scanning 180, then 90 degrees about the general direction lowers the error.",
            published={f"median error, {scan} degrees (deg)": published.SCAN_MEDIAN_DEG[scan] for scan in SCANS_DEG}
            | {"180 degrees, in the conclusion (deg)": published.SCAN_180_IN_CONCLUSION_DEG},
            obtained={
                f"median error, {scan} degrees (deg)": value
                for scan, value in zip(SCANS_DEG, (wide, half, quarter), strict=True)
            }
            | {f"a random heading in {scan} degrees (deg)": float(by_chance[scan]) for scan in SCANS_DEG},
            test="the median error falls from 360 to 180 to 90 degrees",
            holds=wide > half > quarter,
            note="The thesis gives 15 degrees for the 180 degree scan in section 4.4.7.2 and 17 in its conclusion. A narrow scan about the "
            "right direction lowers the error of a random heading as well.",
        ),
    ]
