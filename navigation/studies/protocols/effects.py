"""Sizes of effects between models, with intervals from a bootstrap over routes: walks along one route are not independent."""

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

from ...reports.effects import Effect, effect_size


def over_routes(
    label: str, walks: pd.DataFrame, column: str, statistic: Callable[[pd.Series], float], *, by: str = "model"
) -> Effect:
    """A number computed from the means of a column; whole routes are drawn, with all of their walks.

    Args:
        label: See `Effect`.
        walks: One walk per row, with its route in the column "place".
        column: The column; walks without a value in it do not count.
        statistic: Computes the number from the means, by the values of `by`.
        by: Column of the walks that the means are told apart by.

    Returns:
        The effect.
    """
    grouped = walks.astype({column: float}).groupby(["place", by])[column]
    sums, counts = (each.unstack(fill_value=0) for each in (grouped.sum(), grouped.count()))
    total, number = sums.to_numpy(float), counts.to_numpy(float)

    def of_routes(routes: np.ndarray) -> float:
        with np.errstate(invalid="ignore"):  # nan, where no walk has a value
            means = total[routes].sum(axis=0) / number[routes].sum(axis=0)
        return float(statistic(pd.Series(means, index=sums.columns)))

    return effect_size(label, len(sums), of_routes, of="routes")


def least_over_routes(
    label: str, tables: Mapping[str, pd.DataFrame], column: str, statistic: Callable[[pd.Series], float]
) -> Effect:
    """The least of such effects in several tables of walks, for a claim that is about all of them; its label names the table."""
    effects = (over_routes(f"{label}, {name}", walks, column, statistic) for name, walks in tables.items())
    return min(effects, key=lambda effect: effect.value)
