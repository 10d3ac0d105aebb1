"""Study 2: one snapshot as a compass (section 4.2, figures 6 to 11)."""

import numpy as np
import pandas as pd
from scipy.signal import find_peaks
from scipy.stats import spearmanr

from tussock.world.geometry import wrap_angle

from ...encoding import Encoding
from ...evaluation import RECOVERED_DEG
from ...models import make_model
from ...reports.findings import Claim, Findings
from ...scan import best_turn
from .headings import around_set_heading
from .material import Material
from .settings import Settings

RAW = Encoding.parse("grey")
REFERENCES = 12  # route views, evenly spread
AROUND = 0.5  # m, as far as the thesis looks
RING = 0.1  # m, width of the rings in which errors are summed up
DEPTH = 0.2  # a minimum of the IDF counts when it is this share of the curve's range deep
LEVELS = 255  # grey levels, in which differences are given


def study(material: Material, settings: Settings, progress=lambda done, total: None) -> Findings:
    """Recover headings around single route views with the image difference function (IDF, equation 1)."""
    places = RAW(material.place_views)
    references = np.linspace(0, len(material.route.poses) - 1, REFERENCES + 2).round().astype(int)[1:-1]
    rows, curves = [], {}
    for done, reference in enumerate(references):
        table, idf = _around(material, int(reference), places)
        rows.append(table)
        curves[int(reference)] = idf
        progress(done + 1, len(references))
    around = pd.concat(rows, ignore_index=True)
    three = pd.concat([_three_curves(material, reference, places) for reference in curves], ignore_index=True)
    return Findings(
        tables={
            "around": around,
            "by_distance": _by_distance(around),
            "idf": three,
            "ambiguous": _ambiguous(around, curves),
            "occluded": _occluded(material, around, curves),
        },
        numbers={"reference_shown": _typical(around)} | _examples(around),
        claims=_claims(around, three),
    )


def _around(material: Material, reference: int, places) -> tuple[pd.DataFrame, dict[int, np.ndarray]]:
    """Headings recovered within AROUND of a route view, and each place's IDF (grey levels) from the reference's heading on."""
    x, y, heading = material.route.poses[reference]
    distance = np.hypot(*(material.places[:, :2] - (x, y)).T)
    rows = np.flatnonzero(distance <= AROUND)
    compass = make_model("visual-compass").fit(RAW(material.route_views[reference : reference + 1]))
    scans = compass.scan(places[rows]).numpy()
    headings = wrap_angle(material.places[rows, 2] + best_turn(scans))
    idf = {int(row): -LEVELS * scan for row, scan in zip(rows, scans, strict=True)}
    table = pd.DataFrame({
        "reference": reference, "reference_x_m": x, "reference_y_m": y, "set_heading_deg": np.degrees(heading), "place": rows,
        "x_m": material.places[rows, 0], "y_m": material.places[rows, 1], "facing_deg": np.degrees(material.places[rows, 2]),
        "distance_m": distance[rows], "heading_deg": np.degrees(headings),
        "error_deg": np.degrees(np.abs(wrap_angle(headings - heading))), "rms": -LEVELS * scans.max(axis=1),
        "minima": [_minima(curve) for curve in idf.values()],
    })  # fmt: skip
    return table, idf


def _minima(curve: np.ndarray) -> int:
    """How many distinct minima an IDF has around the ring."""
    start = int(curve.argmax())  # a ring is cut where it is highest, so that no minimum is cut in two
    ring = np.roll(curve, -start)
    return len(find_peaks(-np.r_[ring, ring[0]], prominence=DEPTH * np.ptp(curve))[0])


def _typical(around: pd.DataFrame) -> int:
    """The reference view that is neither the best nor the worst."""
    share = (around["error_deg"] < RECOVERED_DEG).groupby(around["reference"]).mean()
    return int(share.sort_values(kind="stable").index[len(share) // 2])


def _three_curves(material: Material, reference: int, places) -> pd.DataFrame:
    """IDFs of the same view, of the nearest place's and of the farthest place's (figure 6), against one route view."""
    pose = material.route.poses[reference]
    distance = np.hypot(*(material.places[:, :2] - pose[:2]).T)
    snapshot = RAW(material.route_views[reference : reference + 1])
    compass = make_model("visual-compass").fit(snapshot)
    seen = {"same": (snapshot, pose, 0.0)}
    for name, row in (("near", distance.argmin()), ("far", distance.argmax())):
        seen[name] = (places[row : row + 1], material.places[row], float(distance[row]))
    curves = []
    for name, (image, at, away) in seen.items():
        idf = -LEVELS * compass.scan(image).numpy()[0]
        curve = around_set_heading(idf, at[2], pose[2], name="rms")
        curves.append(curve.assign(reference=reference, view=name, distance_m=away))
    return pd.concat(curves, ignore_index=True)


def _pick(table: pd.DataFrame, curves: dict[int, dict[int, np.ndarray]], index: int, view: str) -> pd.DataFrame:
    """The curve of one row of `around`, with where it is."""
    row = table.loc[index]
    idf = curves[int(row["reference"])][int(row["place"])]
    curve = around_set_heading(idf, np.radians(row["facing_deg"]), np.radians(row["set_heading_deg"]), name="rms")
    where = {name: row[name] for name in ("reference", "place", "x_m", "y_m", "distance_m", "error_deg", "minima")}
    return curve.assign(view=view, **where)


def _ambiguous(around: pd.DataFrame, curves: dict[int, dict[int, np.ndarray]]) -> pd.DataFrame:
    """The failure with the most minima among the near ones, and the success nearest to it around the same view (figure 9)."""
    wrong = around[(around["error_deg"] > RECOVERED_DEG) & (around["minima"] > 1)]
    chosen = []
    for index in wrong.sort_values(["minima", "distance_m"], ascending=[False, True], kind="stable").index:
        bad = around.loc[index]
        good = around[(around["reference"] == bad["reference"]) & (around["error_deg"] < 10) & (around["minima"] == 1)]
        if len(good):
            apart = np.hypot(good["x_m"] - bad["x_m"], good["y_m"] - bad["y_m"])
            chosen = [_pick(around, curves, apart.idxmin(), "recovered"), _pick(around, curves, index, "ambiguous")]
            break
    return pd.concat(chosen, ignore_index=True) if chosen else pd.DataFrame()


def _occluded(material: Material, around: pd.DataFrame, curves: dict[int, dict[int, np.ndarray]]) -> pd.DataFrame:
    """The failure whose view is covered the most beyond what the reference sees covered (figure 10)."""
    covered = Encoding.parse("sky-mask")
    wrong = around[around["error_deg"] > RECOVERED_DEG]
    if not len(wrong):
        return pd.DataFrame()
    seen = covered(material.place_views[wrong["place"]]).mean(dim=(1, 2)).numpy()
    known = covered(material.route_views[wrong["reference"]]).mean(dim=(1, 2)).numpy()
    worst = int(np.argmax(seen - known))
    picked = _pick(around, curves, wrong.index[worst], "occluded")
    return picked.assign(covered=float(seen[worst]), reference_covered=float(known[worst]))


def _by_distance(around: pd.DataFrame) -> pd.DataFrame:
    """Errors in rings around the reference views."""
    ring = (around["distance_m"] / RING).clip(upper=AROUND / RING - 1e-9).astype(int)
    errors = around.groupby(ring)["error_deg"]
    return pd.DataFrame({
        "from_m": np.sort(ring.unique()) * RING, "median_error_deg": errors.median().to_numpy(),
        "mean_error_deg": errors.mean().to_numpy(), "places": errors.size().to_numpy(),
    })  # fmt: skip


def _examples(around: pd.DataFrame) -> dict[str, float]:
    """How many of the recovered headings are good, near and farther off."""
    good, near = around["error_deg"] < RECOVERED_DEG, around["distance_m"] <= AROUND / 2
    failed = around[~good]
    return {
        "share_recovered_within_0.25_m": float(good[near].mean()),
        "share_recovered_beyond_0.25_m": float(good[~near].mean()),
        "share_of_failures_with_several_minima": float((failed["minima"] > 1).mean()) if len(failed) else 0.0,
    }


def _claims(around: pd.DataFrame, curves: pd.DataFrame) -> list[Claim]:
    rank = spearmanr(around["distance_m"], around["error_deg"])
    rings = _by_distance(around)
    shares = _examples(around)
    lowest = curves.groupby(["reference", "view"])["rms"].min().unstack()
    middle = lowest.median()
    return [
        Claim(
            key="idf-minimum",
            figure="6",
            statement="The image difference has a minimum of zero at the same place, a higher one nearby, and a higher one still far away.",
            published={"lowest RMS at the same place": 0.0},
            obtained={
                "lowest RMS at the same place": float(middle["same"]),
                "nearby": float(middle["near"]),
                "far away": float(middle["far"]),
            },
            test="the lowest RMS difference (grey levels, median over twelve route views) is 0 at the same place for all of them, "
            "and lower nearby than far away for eleven or more",
            holds=bool((lowest["same"] < 1e-3).all() and (lowest["near"] >= lowest["far"]).sum() <= 1),
        ),
        Claim(
            key="visual-compass-near",
            figure="8",
            statement="One snapshot recovers the heading at most places close to it.",
            published={},
            obtained={
                "share recovered within 0.25 m": shares["share_recovered_within_0.25_m"],
                "at 0.25 to 0.5 m": shares["share_recovered_beyond_0.25_m"],
            },
            test="over half of the headings within 0.25 m are less than 45 degrees off",
            holds=shares["share_recovered_within_0.25_m"] > 0.5,
        ),
        Claim(
            key="error-grows-with-distance",
            figure="11",
            statement="The heading error grows with the distance from the snapshot.",
            published={},
            obtained={
                f"median error at {rings['from_m'].iloc[k]:.1f} to {rings['from_m'].iloc[k] + RING:.1f} m (deg)": float(
                    rings["median_error_deg"].iloc[k]
                )
                for k in (0, -1)
            }
            | {"rank correlation": float(rank.statistic)},
            test="the rank correlation of error and distance is positive (p < 0.01)",
            holds=bool(rank.statistic > 0 and rank.pvalue < 0.01),
        ),
    ]
