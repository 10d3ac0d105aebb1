"""What the runs of a sweep say together: means with bootstrap confidence intervals, by each axis and between models."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from tussock.world.params import is_generated

SAMPLES = 4000  # of a bootstrap
CONFIDENCE = 0.95
MEASURES = {  # what is compared: column of the table -> words
    "arrived": "share that arrived",
    "mean_deviation_m": "mean deviation from the route (m)",
    "mean_error_deg": "mean heading error (°)",
    "resets": "times put back on the route",
}
HIGHER_IS_BETTER = ("arrived",)
_RANK = {"model": 0, "world_seed": 2, "route_seed": 2, "seed": 2}  # what is asked first, and last
AT_ONCE = 2**22  # numbers that are drawn


@dataclass(frozen=True)
class Interval:
    """A mean, and the ends of its confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Pairing:
    """Two models compared over pairs of runs that are alike in all else. difference: of the first less the second, by measure.

    better, worse: pairs in which the first did better, or worse, than the second.
    """

    first: str
    second: str
    pairs: int
    difference: dict[str, Interval]
    better: dict[str, int]
    worse: dict[str, int]


def mean_interval(values: Float[np.ndarray, " n"], groups: Int[np.ndarray, " n"], seed: int = 0) -> Interval:
    """Mean of values and its percentile bootstrap interval. Whole groups are drawn, as runs in one world are not independent.

    groups: number of the group of each value. Where there is but one group, single values are drawn. nan where nothing can be said:
    of the mean of no values, and of the interval of one.
    """
    if len(values) < 2:
        return Interval(float(values.sum()) if len(values) else np.nan, np.nan, np.nan)
    if len(np.unique(groups)) == 1:
        groups = np.arange(len(values))
    _, number = np.unique(groups, return_inverse=True)
    sums, counts = np.bincount(number, weights=values), np.bincount(number)
    rng, part = np.random.default_rng(seed), min(SAMPLES, max(1, AT_ONCE // len(sums)))
    means = np.empty(SAMPLES)
    for begin in range(0, SAMPLES, part):
        here = means[begin : begin + part]
        drawn = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), size=len(here))
        here[:] = (drawn @ sums) / (drawn @ counts)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Interval(float(values.mean()), float(low), float(high))


def worlds_of(table: pd.DataFrame) -> Int[np.ndarray, " n"]:
    """Number of the world of each run; in a world from a file, of the route through it."""
    generated = table["world"].map(is_generated).astype(bool)
    given = table[["world_seed", "route_seed"]].astype(object)
    seeds = given.where(given.notna(), table[["seed", "seed"]].to_numpy(dtype=object))
    where = pd.DataFrame({
        "world": table["world"], "world_seed": seeds["world_seed"].where(generated),
        "route": table["route"].mask(generated), "route_seed": seeds["route_seed"].mask(generated | table["route"].notna()),
    })  # fmt: skip
    return where.groupby(list(where), dropna=False, sort=False).ngroup().to_numpy()


def axes_of(table: pd.DataFrame, settings: Sequence[str]) -> dict[str, list[str]]:
    """What varies between runs: by the name of an axis, the settings that make it. Those that vary together are one axis."""
    axes: dict[bytes, list[str]] = {}
    for name in settings:
        partition, values = pd.factorize(table[name].astype("object"), use_na_sentinel=False)
        if len(values) > 1:
            axes.setdefault(partition.tobytes(), []).append(name)
    inorder = sorted(axes.values(), key=lambda names: _RANK.get(names[0], 1))
    return {" and ".join(map(spoken, names)): names for names in inorder}


def spoken(setting: str) -> str:
    """A setting's name as people say it, its unit in parentheses."""
    name, _, unit = setting.rpartition("_")
    units = {"m": "m", "deg": "°"}
    return f"{name.replace('_', ' ')} ({units[unit]})" if unit in units else setting.replace("_", " ")


def means(table: pd.DataFrame, measures: Sequence[str]) -> dict[str, Interval]:
    """Mean and interval of each measure over runs."""
    groups = worlds_of(table)
    return {measure: mean_interval(table[measure].to_numpy(dtype=float), groups) for measure in measures}


def by_axis(
    table: pd.DataFrame, names: list[str], measures: Sequence[str]
) -> dict[str, tuple[int, dict[str, Interval]]]:
    """Number of runs, and `means`, for each choice of an axis, in order."""
    parts = table.groupby(names, dropna=False, sort=True)
    return {words(key): (len(part), means(part, measures)) for key, part in parts}


def words(key: object) -> str:
    """A choice of an axis as people read it."""
    values: tuple[Any, ...] = key if isinstance(key, tuple) else (key,)
    return ", ".join(
        "by default" if pd.isna(value) else repr(value).removesuffix(".0") if isinstance(value, float) else str(value)
        for value in values
    )


def pairings(table: pd.DataFrame, settings: Sequence[str], measures: Sequence[str], axis: list[str]) -> list[Pairing]:
    """Every two choices of an axis, of models for example, compared over the runs for which all other settings are alike."""
    rest = [name for name in settings if name not in axis]
    parts = {words(key): part for key, part in table.groupby(axis, dropna=False, sort=True)}
    found = []
    for first, second in combinations(parts, 2):
        both = parts[first].merge(parts[second], on=rest, suffixes=("", "_other"), validate="one_to_one")
        if both.empty:
            continue
        groups, difference, better, worse = worlds_of(both), {}, {}, {}
        for measure in measures:
            values = both[measure].to_numpy(dtype=float) - both[f"{measure}_other"].to_numpy(dtype=float)
            gain = values if measure in HIGHER_IS_BETTER else -values
            difference[measure] = mean_interval(values, groups)
            better[measure], worse[measure] = int((gain > 0).sum()), int((gain < 0).sum())
        found.append(
            Pairing(first=first, second=second, pairs=len(both), difference=difference, better=better, worse=worse)
        )
    return found
