"""Means of walks with their intervals, as the pages of all protocols show them."""

from collections.abc import Mapping

import pandas as pd

from ...intervals import positive_interval, share_interval
from .protocol import Item, models_in


def intervals(walks: pd.DataFrame, measures: Mapping[str, str]) -> pd.DataFrame:
    """Mean and 95 % interval over routes of some columns, for each model.

    Args:
        walks: One walk per row, with the columns "model" and "place".
        measures: Columns, and what they are called; numbers that are never negative, or whether something is so.

    Returns:
        One row per measure and model, with the numbers of routes and walks.
    """
    rows = []
    for column, label in measures.items():
        for model in models_in(walks):
            part = walks[walks["model"] == model].dropna(subset=[column])
            routes, _ = pd.factorize(part["place"])
            interval = share_interval if part[column].dtype == bool else positive_interval
            mean = interval(part[column].to_numpy(dtype=float), routes)
            rows.append((label, model, part["place"].nunique(), len(part), mean.value, mean.low, mean.high))
    return pd.DataFrame(rows, columns=["measure", "model", "routes", "walks", "mean", "low", "high"])


INTERVALS = Item(
    "intervals",
    "Means and their intervals",
    "intervals",
    "95 % intervals over routes, as walks along one route are not independent; none from fewer than five routes.",
)
