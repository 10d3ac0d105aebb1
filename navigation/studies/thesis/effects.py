"""Sizes of effects on heading errors, with intervals from a bootstrap over grid positions or route views."""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from jaxtyping import Float

from ...reports.effects import Effect, effect_size

POSITIONS = "positions"
Errors = Float[np.ndarray, " n"]


def median_error(label: str, table: pd.DataFrame) -> Effect:
    """The median error in a table of `headings` (degrees)."""
    errors = table["error_deg"].to_numpy()
    return effect_size(label, len(errors), lambda rows: float(np.median(errors[rows])), of=POSITIONS)


def fall_of_median(label: str, before: pd.DataFrame, after: pd.DataFrame) -> Effect:
    """By how much the median error is lower in the second of two tables of `headings` with the same positions (degrees)."""
    first, second = before["error_deg"].to_numpy(), after["error_deg"].to_numpy()

    def fall(rows: np.ndarray) -> float:
        return float(np.median(first[rows]) - np.median(second[rows]))

    return effect_size(label, len(first), fall, of=POSITIONS)


def difference_of_medians(label: str, table: pd.DataFrame, where: np.ndarray) -> Effect:
    """The median error at some positions of a table of `headings` minus that at the others (degrees)."""
    errors = table["error_deg"].to_numpy()

    def difference(rows: np.ndarray) -> float:
        chosen, inside = errors[rows], where[rows]
        if inside.all() or not inside.any():
            return np.nan
        return float(np.median(chosen[inside]) - np.median(chosen[~inside]))

    return effect_size(label, len(errors), difference, of=POSITIONS)


def over_columns(
    label: str, errors: pd.DataFrame, column: str | list[str], statistic: Callable[[Errors], float]
) -> Effect:
    """A number computed from the median errors by a column: a frequency or a resolution.

    Args:
        label: See `Effect`.
        errors: One row for each position and value of the column, with its error (degrees).
        column: The column, or several.
        statistic: Computes the number from the medians, which are in the order of the column's values.

    Returns:
        The effect.
    """
    by_position = errors.pivot_table(index="place", columns=column, values="error_deg").to_numpy()
    return effect_size(
        label, len(by_position), lambda rows: float(statistic(np.median(by_position[rows], axis=0))), of=POSITIONS
    )


def over_parts(label: str, parts: Sequence[np.ndarray], statistic: Callable[[np.ndarray], float]) -> Effect:
    """A number computed from what was measured around several route views; whole parts are drawn, as what is around one view belongs
    together."""
    return effect_size(
        label, len(parts), lambda chosen: float(statistic(np.concatenate([parts[k] for k in chosen]))), of="route views"
    )
