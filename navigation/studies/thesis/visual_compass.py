"""Study 2: one snapshot as a compass (section 4.2, figures 6 to 11)."""

import numpy as np
import pandas as pd
from scipy.signal import find_peaks
from scipy.stats import spearmanr

from tussock.world.geometry import wrap_angle

from ...encoding import Encoding
from ...evaluation import RECOVERED_DEG
from ...models import make_model
from ...models.base import Images
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...scan import best_turn
from .effects import over_parts
from .headings import relative_to_set_heading
from .parameters import Progress, StudySettings
from .study_data import StudyData

RAW = Encoding.parse("grey")
REFERENCES = 12  # route views, evenly spaced
MAX_DISTANCE = 0.5  # m, as in the thesis
RING = 0.1  # m, width of the rings over which errors are summarised
DEPTH = 0.2  # a minimum of the IDF counts where its depth is at least this share of the curve's range
LEVELS = 255  # grey levels, the unit of differences
Curves = dict[int, dict[int, np.ndarray]]  # IDFs in grey levels, by reference view and grid pose


def study(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """Recover headings around single route views with the image difference function (IDF, equation 1)."""
    images = RAW(data.grid_views)
    references = np.linspace(0, len(data.route.poses) - 1, REFERENCES + 2).round().astype(int)[1:-1]
    tables, curves = [], {}
    for done, reference in enumerate(references):
        table, curves[int(reference)] = _around(data, int(reference), images)
        tables.append(table)
        progress(done + 1, len(references))
    around = pd.concat(tables, ignore_index=True)
    return StudyResults(
        tables={
            "around": around,
            "by_distance": _by_distance(around),
            "idf": pd.concat([_three_curves(data, reference, images) for reference in curves], ignore_index=True),
            "ambiguous": _ambiguous(around, curves),
            "occluded": _occluded(data, around, curves),
        },
        numbers={"reference_shown": _typical_reference(around)} | _shares(around),
    )


def _around(data: StudyData, reference: int, images: Images) -> tuple[pd.DataFrame, dict[int, np.ndarray]]:
    """Headings recovered within MAX_DISTANCE of a route view, and the IDF of each grid pose there."""
    x, y, heading = data.route.poses[reference]
    distance = np.hypot(*(data.poses[:, :2] - (x, y)).T)
    rows = np.flatnonzero(distance <= MAX_DISTANCE)
    compass = make_model("visual-compass").fit(RAW(data.route_views[reference : reference + 1]))
    scans = compass.scan(images[rows]).numpy()
    headings = wrap_angle(data.poses[rows, 2] + best_turn(scans))
    curves = {int(row): -LEVELS * scan for row, scan in zip(rows, scans, strict=True)}
    columns = {
        "reference": reference,
        "reference_x_m": x,
        "reference_y_m": y,
        "set_heading_deg": np.degrees(heading),
        "place": rows,
        "x_m": data.poses[rows, 0],
        "y_m": data.poses[rows, 1],
        "facing_deg": np.degrees(data.poses[rows, 2]),
        "distance_m": distance[rows],
        "heading_deg": np.degrees(headings),
        "error_deg": np.degrees(np.abs(wrap_angle(headings - heading))),
        "rms": -LEVELS * scans.max(axis=1),
        "minima": [count_minima(curve) for curve in curves.values()],
    }
    return pd.DataFrame(columns), curves


def count_minima(curve: np.ndarray) -> int:
    """Number of distinct minima of an IDF over the full circle."""
    start = int(curve.argmax())  # the circle is cut where the curve is highest, so that no minimum is cut in two
    ring = np.roll(curve, -start)
    return len(find_peaks(-np.r_[ring, ring[0]], prominence=DEPTH * np.ptp(curve))[0])


def _typical_reference(around: pd.DataFrame) -> int:
    """The reference view with the middle share of recovered headings."""
    share = (around["error_deg"] < RECOVERED_DEG).groupby(around["reference"]).mean()
    return int(share.sort_values(kind="stable").index[len(share) // 2])


def _three_curves(data: StudyData, reference: int, images: Images) -> pd.DataFrame:
    """IDFs of a route view against itself and against the nearest and the farthest grid view (figure 6)."""
    pose = data.route.poses[reference]
    distance = np.hypot(*(data.poses[:, :2] - pose[:2]).T)
    snapshot = RAW(data.route_views[reference : reference + 1])
    compass = make_model("visual-compass").fit(snapshot)
    compared = {"same": (snapshot, pose, 0.0)}
    for name, row in (("near", distance.argmin()), ("far", distance.argmax())):
        compared[name] = (images[row : row + 1], data.poses[row], float(distance[row]))
    curves = []
    for name, (image, at, away) in compared.items():
        idf = -LEVELS * compass.scan(image).numpy()[0]
        curve = relative_to_set_heading(idf, at[2], pose[2], name="rms")
        curves.append(curve.assign(reference=reference, view=name, distance_m=away))
    return pd.concat(curves, ignore_index=True)


def _curve(around: pd.DataFrame, curves: Curves, index: int, view: str) -> pd.DataFrame:
    """The IDF of one row of `around`, with the columns that describe its pose."""
    row = around.loc[index]
    idf = curves[int(row["reference"])][int(row["place"])]
    curve = relative_to_set_heading(idf, np.radians(row["facing_deg"]), np.radians(row["set_heading_deg"]), name="rms")
    pose = {name: row[name] for name in ("reference", "place", "x_m", "y_m", "distance_m", "error_deg", "minima")}
    return curve.assign(view=view, **pose)


def _ambiguous(around: pd.DataFrame, curves: Curves) -> pd.DataFrame:
    """The failure with the most minima, nearest first, and the success nearest to it around the same view (figure 9)."""
    wrong = around[(around["error_deg"] > RECOVERED_DEG) & (around["minima"] > 1)]
    for index in wrong.sort_values(["minima", "distance_m"], ascending=[False, True], kind="stable").index:
        bad = around.loc[index]
        good = around[(around["reference"] == bad["reference"]) & (around["error_deg"] < 10) & (around["minima"] == 1)]
        if len(good):
            nearest = np.hypot(good["x_m"] - bad["x_m"], good["y_m"] - bad["y_m"]).idxmin()
            pair = [_curve(around, curves, nearest, "recovered"), _curve(around, curves, index, "ambiguous")]
            return pd.concat(pair, ignore_index=True)
    return pd.DataFrame()


def _occluded(data: StudyData, around: pd.DataFrame, curves: Curves) -> pd.DataFrame:
    """The failure whose view is covered more than its reference by the largest share of the view (figure 10)."""
    foreground = Encoding.parse("sky-mask")
    wrong = around[around["error_deg"] > RECOVERED_DEG]
    if not len(wrong):
        return pd.DataFrame()
    covered = foreground(data.grid_views[wrong["place"]]).mean(dim=(1, 2)).numpy()
    reference = foreground(data.route_views[wrong["reference"]]).mean(dim=(1, 2)).numpy()
    worst = int(np.argmax(covered - reference))
    curve = _curve(around, curves, wrong.index[worst], "occluded")
    return curve.assign(covered=float(covered[worst]), reference_covered=float(reference[worst]))


def _by_distance(around: pd.DataFrame) -> pd.DataFrame:
    """Errors in rings around the reference views."""
    ring = (around["distance_m"] / RING).clip(upper=MAX_DISTANCE / RING - 1e-9).astype(int)
    errors = around.groupby(ring)["error_deg"]
    columns = {
        "from_m": np.sort(ring.unique()) * RING,
        "median_error_deg": errors.median().to_numpy(),
        "mean_error_deg": errors.mean().to_numpy(),
        "places": errors.size().to_numpy(),
    }
    return pd.DataFrame(columns)


def _shares(around: pd.DataFrame) -> dict[str, float]:
    """Shares of recovered headings, near a reference view and farther away."""
    good, near = around["error_deg"] < RECOVERED_DEG, around["distance_m"] <= MAX_DISTANCE / 2
    failed = around[~good]
    return {
        "share_recovered_within_0.25_m": float(good[near].mean()),
        "share_recovered_beyond_0.25_m": float(good[~near].mean()),
        "share_of_failures_with_several_minima": float((failed["minima"] > 1).mean()) if len(failed) else 0.0,
    }


@claim(
    "idf-minimum",
    "6",
    (
        "the lowest RMS difference (grey levels, median over twelve route views) is 0 at the same position for all of them, "
        "and lower nearby than far away for eleven or more"
    ),
    published={"lowest RMS at the same place": 0.0},
)
def _lowest_differences(results: StudyResults) -> Decision:
    """The image difference has a minimum of zero at the same position, a higher minimum nearby, and a still higher one far away."""
    curves = results.tables["idf"].astype({"rms": "float32"})  # as scans are
    lowest = curves.groupby(["reference", "view"])["rms"].min().unstack()
    medians = lowest.median()
    obtained = {
        "lowest RMS at the same place": float(medians["same"]),
        "nearby": float(medians["near"]),
        "far away": float(medians["far"]),
    }
    holds = bool((lowest["same"] < 1e-3).all() and (lowest["near"] >= lowest["far"]).sum() <= 1)
    rise = np.split((lowest["far"] - lowest["near"]).to_numpy(), len(lowest))
    return Decision(obtained, holds, over_parts("far away minus nearby (grey levels)", rise, np.median))


@claim("visual-compass-near", "8", "over half of the headings within 0.25 m are less than 45 degrees off")
def _recovered_nearby(results: StudyResults) -> Decision:
    """One snapshot recovers the heading at most positions close to it."""
    near = results.numbers["share_recovered_within_0.25_m"]
    obtained = {
        "share recovered within 0.25 m": near,
        "at 0.25 to 0.5 m": results.numbers["share_recovered_beyond_0.25_m"],
    }
    around = results.tables["around"]
    recovered = _by_reference(around[around["distance_m"] <= MAX_DISTANCE / 2], "error_deg")
    effect = over_parts(
        "share recovered within 0.25 m",
        recovered,
        lambda errors: np.mean(errors < RECOVERED_DEG) if len(errors) else np.nan,
    )
    return Decision(obtained, near > 0.5, effect)


@claim("error-grows-with-distance", "11", "the rank correlation of error and distance is positive (p < 0.01)")
def _error_and_distance(results: StudyResults) -> Decision:
    """The heading error grows with the distance from the snapshot."""
    around, rings = results.tables["around"], results.tables["by_distance"]
    rank = spearmanr(around["distance_m"], around["error_deg"])
    obtained = {
        f"median error at {ring['from_m']:.1f} to {ring['from_m'] + RING:.1f} m (deg)": float(ring["median_error_deg"])
        for ring in (rings.iloc[0], rings.iloc[-1])
    }
    obtained["rank correlation"] = float(rank.statistic)
    effect = over_parts(
        "rank correlation",
        _by_reference(around, ["distance_m", "error_deg"]),
        lambda pairs: spearmanr(*pairs.T).statistic,
    )
    return Decision(obtained, bool(rank.statistic > 0 and rank.pvalue < 0.01), effect)


def _by_reference(around: pd.DataFrame, columns: str | list[str]) -> list[np.ndarray]:
    """Columns of the positions around each reference view."""
    return [part[columns].to_numpy() for _, part in around.groupby("reference")]


CLAIMS = (_lowest_differences, _recovered_nearby, _error_and_distance)
