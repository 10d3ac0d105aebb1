"""Headings recovered at grid places, as tables: what most studies come down to."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from tussock.world.geometry import turn_of_columns, wrap_angle

from ...evaluation import BATCH, RECOVERED_DEG, errors_of_views
from ...models.base import FamiliarityModel, Images
from .material import Material


def headings(
    material: Material, model: FamiliarityModel, images: Images, rows: Sequence[int] | np.ndarray | None = None,
    *, scan_deg: float = 360.0,
) -> pd.DataFrame:  # fmt: skip
    """A row a place: where it is, the set heading, the recovered one, and how far off it is.

    images: all place views, encoded. rows: the places to look at; None is those near the route. scan_deg: width of the scan, about
    the general direction of the route where it is not full (4.4.7.2).
    """
    rows = material.near if rows is None else np.asarray(rows)
    poses = material.places[rows]
    about = np.full(len(rows), material.general_direction)
    found = errors_of_views(
        model, images[rows].split(BATCH), material.route, poses, scan=np.radians(scan_deg), about=about
    )
    return pd.DataFrame({
        "place": rows, "x_m": poses[:, 0], "y_m": poses[:, 1], "nearest_view": found.nearest,
        "set_heading_deg": np.degrees(material.wanted[rows]), "heading_deg": np.degrees(found.headings),
        "error_deg": np.degrees(found.errors),
    })  # fmt: skip


def around_set_heading(values: np.ndarray, facing: float, set_heading: float, *, name: str) -> pd.DataFrame:
    """What a scan gave at every rotation of a view, in degrees to the left of the set heading. facing, set_heading: rad."""
    off = np.degrees(wrap_angle(turn_of_columns(np.arange(len(values)), len(values)) + (facing - set_heading)))
    return pd.DataFrame({"degrees_off": off, name: values}).sort_values("degrees_off", kind="stable", ignore_index=True)


def errors_of(table: pd.DataFrame) -> dict[str, float]:
    """Median and mean error (degrees), the share over 45 degrees, and on how many places they rest."""
    errors = table["error_deg"]
    return {
        "median_error_deg": float(errors.median()), "mean_error_deg": float(errors.mean()),
        "share_over_45": float((errors > RECOVERED_DEG).mean()), "places": len(errors),
    }  # fmt: skip


def box_of(errors: pd.Series) -> dict[str, float]:
    """What a box plot draws: quartiles, whiskers at most 1.5 boxes long, median and mean (degrees)."""
    low, middle, high = errors.quantile([0.25, 0.5, 0.75])
    reach = 1.5 * (high - low)
    within = errors[(errors >= low - reach) & (errors <= high + reach)]
    return {
        "median_error_deg": middle, "mean_error_deg": errors.mean(), "lower_quartile_deg": low, "upper_quartile_deg": high,
        "lower_whisker_deg": min(low, within.min()), "upper_whisker_deg": max(high, within.max()), "places": len(errors),
    }  # fmt: skip


def middle(tables: Sequence[pd.DataFrame], where: np.ndarray) -> float:
    """Median over tables (random starts) of the median error at some of their rows (degrees); nan where there are none."""
    return float(np.median([table.loc[where, "error_deg"].median() for table in tables]))
