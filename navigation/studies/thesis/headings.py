"""Headings recovered at grid positions, as tables: the core of most studies."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from tussock.world.geometry import turn_of_columns, wrap_angle

from ...evaluation import BATCH, RECOVERED_DEG, errors_of_views
from ...models.base import FamiliarityModel, Images
from .study_data import StudyData

CHANCE_MEDIAN_DEG, CHANCE_RECOVERED = 90.0, RECOVERED_DEG / 180  # of random headings over the full circle


def headings(
    data: StudyData,
    model: FamiliarityModel,
    images: Images,
    rows: Sequence[int] | np.ndarray | None = None,
    *,
    scan_deg: float = 360.0,
) -> pd.DataFrame:
    """Let a trained model recover the heading at grid poses.

    Args:
        data: The views.
        model: The trained model.
        images: All grid views, encoded.
        rows: Indices of the grid poses to use; None means those near the route.
        scan_deg: Width of the scan (degrees), about the general direction of the route (4.4.7.2).

    Returns:
        One row per pose: its position, set heading, recovered heading and error.
    """
    rows = data.near if rows is None else np.asarray(rows)
    poses = data.poses[rows]
    about = np.full(len(rows), data.general_direction)
    errors = errors_of_views(
        model, images[rows].split(BATCH), data.route, poses, scan=np.radians(scan_deg), about=about
    )
    columns = {
        "place": rows,
        "x_m": poses[:, 0],
        "y_m": poses[:, 1],
        "nearest_view": errors.nearest,
        "set_heading_deg": np.degrees(data.set_headings[rows]),
        "heading_deg": np.degrees(errors.headings),
        "error_deg": np.degrees(errors.errors),
    }
    return pd.DataFrame(columns)


def relative_to_set_heading(values: np.ndarray, facing: float, set_heading: float, *, name: str) -> pd.DataFrame:
    """A scan's values over the rotations of a view, by degrees to the left of the set heading.

    Args:
        values: One value per rotation.
        facing: Heading of the view (rad).
        set_heading: The set heading (rad).
        name: Column for the values.

    Returns:
        A table with the columns "degrees_off" and `name`.
    """
    off = np.degrees(wrap_angle(turn_of_columns(np.arange(len(values)), len(values)) + (facing - set_heading)))
    return pd.DataFrame({"degrees_off": off, name: values}).sort_values("degrees_off", kind="stable", ignore_index=True)


def errors_of(table: pd.DataFrame) -> dict[str, float]:
    """Median and mean error (degrees), share of errors over 45 degrees, and number of positions."""
    errors = table["error_deg"]
    return {
        "median_error_deg": float(errors.median()),
        "mean_error_deg": float(errors.mean()),
        "share_over_45": float((errors > RECOVERED_DEG).mean()),
        "places": len(errors),
    }


def box_of(errors: pd.Series) -> dict[str, float]:
    """The numbers of a box plot (degrees): quartiles, whiskers of at most 1.5 box lengths, median and mean."""
    low, median, high = errors.quantile([0.25, 0.5, 0.75])
    reach = 1.5 * (high - low)
    within = errors[(errors >= low - reach) & (errors <= high + reach)]
    return {
        "median_error_deg": median,
        "mean_error_deg": errors.mean(),
        "lower_quartile_deg": low,
        "upper_quartile_deg": high,
        "lower_whisker_deg": min(low, within.min()),
        "upper_whisker_deg": max(high, within.max()),
        "places": len(errors),
    }


def median_of_medians(tables: Sequence[pd.DataFrame], where: np.ndarray) -> float:
    """Median over tables (random starts) of the median error in some of their rows (degrees); nan for no rows."""
    return float(np.median([table.loc[where, "error_deg"].median() for table in tables]))
