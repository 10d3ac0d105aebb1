"""Statistics of a sweep's runs: means with bootstrap confidence intervals, by axis, and differences between models."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from statistics import NormalDist
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from tussock.world.params import is_generated

SAMPLES = 4000  # of a bootstrap
CONFIDENCE = 0.95
MEASURES = {  # columns of the table of runs, with their labels
    "arrived": "share that arrived",
    "mean_deviation_m": "mean deviation from the route (m)",
    "mean_error_deg": "mean heading error (°)",
    "resets": "times put back on the route",
}
HIGHER_IS_BETTER = ("arrived",)
UNITS = {"m": "m", "deg": "°"}
AXIS_ORDER = {"model": 0, "world_seed": 2, "route_seed": 2, "seed": 2}  # other axes are 1
MAX_GROUPS = 2000  # of a bootstrap; with more, it differs from a normal distribution about as much as from itself with another seed
MAX_CHOICES = 200  # of an axis in a report; more are put together
RANGES = 20  # that choices are put together in


@dataclass(frozen=True)
class Interval:
    """A mean, and the ends of its confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Pairing:
    """Two choices of an axis, two models for example, compared on pairs of runs that are equal in everything else.

    Attributes:
        first: Label of the first choice.
        second: Label of the second choice.
        pairs: Number of pairs.
        difference: Mean of the first minus the second, by measure.
        better: Number of pairs in which the first is better, by measure.
        worse: Number of pairs in which the first is worse, by measure.
    """

    first: str
    second: str
    pairs: int
    difference: dict[str, Interval]
    better: dict[str, int]
    worse: dict[str, int]


def mean_interval(values: Float[np.ndarray, " n"], groups: Int[np.ndarray, " n"]) -> Interval:
    """Mean of values and its percentile bootstrap interval. Whole groups are drawn, as runs in one world are not independent.

    For more than MAX_GROUPS groups, it is the interval of a normal distribution.

    Args:
        values: The values.
        groups: Number of each value's group. For a single group, single values are drawn.

    Returns:
        The interval; nan for what is undetermined: the mean of no values, and the interval of fewer than two.
    """
    if len(values) < 2:
        return Interval(float(values.sum()) if len(values) else np.nan, np.nan, np.nan)
    if len(np.unique(groups)) == 1:
        groups = np.arange(len(values))
    _, number = np.unique(groups, return_inverse=True)
    sums, counts, value = np.bincount(number, weights=values), np.bincount(number), float(values.mean())
    if len(sums) > MAX_GROUPS:
        error = np.linalg.norm(sums - value * counts) / len(values)
        ends = value + error * NormalDist().inv_cdf((1 + CONFIDENCE) / 2) * np.array([-1, 1])
        low, high = ends.clip(values.min(), values.max())  # as those of samples
    else:
        drawn = _draws(len(sums))
        low, high = np.quantile((drawn @ sums) / (drawn @ counts), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Interval(value, float(low), float(high))


@lru_cache(maxsize=2)  # of 64 MB at most; measures and choices have the same
def _draws(groups: int) -> Float[np.ndarray, "samples groups"]:
    """How often each group is in each sample of a bootstrap."""
    rng = np.random.default_rng(0)
    return rng.multinomial(groups, np.full(groups, 1 / groups), size=SAMPLES).astype(float)


def worlds_of(table: pd.DataFrame) -> Int[np.ndarray, " n"]:
    """Number of each run's group: its world; in a world from a file its route; or its image database of a route."""
    world, route = table["world"].astype(object), table["route"].astype(object)
    if "route_database" in table:  # which takes the place of both
        route = route.where(route.notna(), table["route_database"].astype(object))
    generated = world.map(lambda name: not pd.isna(name) and is_generated(name)).astype(bool)
    given = table[["world_seed", "route_seed"]].astype(object)
    seeds = given.where(given.notna(), table[["seed", "seed"]].to_numpy(dtype=object))
    columns = {
        "world": world,
        "world_seed": seeds["world_seed"].where(generated),
        "route": route.mask(generated),
        "route_seed": seeds["route_seed"].mask(generated | route.notna()),
    }
    groups = pd.DataFrame(columns).groupby(list(columns), dropna=False, sort=False)
    return groups.ngroup().to_numpy()


def axes_of(table: pd.DataFrame, settings: Sequence[str]) -> dict[str, list[str]]:
    """The axes of a table of runs: by label, the settings that vary. Settings that always vary together are one axis."""
    axes: dict[bytes, list[str]] = {}
    for name in table.columns.intersection(settings, sort=False):
        partition, values = pd.factorize(table[name].astype("object"), use_na_sentinel=False)
        if len(values) > 1:
            axes.setdefault(partition.tobytes(), []).append(name)
    ordered = sorted(axes.values(), key=lambda names: AXIS_ORDER.get(names[0], 1))
    return {axis_label(names): names for names in ordered}


def axis_label(settings: Sequence[str]) -> str:
    """The label of an axis: the names of its settings, with units in parentheses."""
    return " and ".join(map(setting_label, settings))


def setting_label(setting: str) -> str:
    """A setting's name as a label, with its unit in parentheses."""
    name, _, unit = setting.rpartition("_")
    return f"{name.replace('_', ' ')} ({UNITS[unit]})" if unit in UNITS else setting.replace("_", " ")


def choice_label(key: object) -> str:
    """A choice of an axis as a label: its value, or its values with commas between them."""
    values: tuple[Any, ...] = key if isinstance(key, tuple) else (key,)
    return ", ".join(
        "by default" if pd.isna(value) else repr(value).removesuffix(".0") if isinstance(value, float) else str(value)
        for value in values
    )


def means(table: pd.DataFrame, measures: Sequence[str]) -> dict[str, Interval]:
    """Mean and interval of each measure over runs."""
    return _means(table, measures, worlds_of(table))


def _means(table: pd.DataFrame, measures: Sequence[str], groups: Int[np.ndarray, " n"]) -> dict[str, Interval]:
    return {measure: mean_interval(table[measure].to_numpy(dtype=float), groups) for measure in measures}


def by_axis(
    table: pd.DataFrame, names: list[str], measures: Sequence[str]
) -> dict[str, tuple[int, dict[str, Interval]]]:
    """Number of runs, and `means`, for each choice of an axis, in order."""
    groups, results = worlds_of(table), {}
    for key, part in table.reset_index(drop=True).groupby(names, dropna=False, sort=True, observed=True):
        of_choice, _ = pd.factorize(groups[part.index])  # in the order in which they appear there
        results[choice_label(key)] = len(part), _means(part, measures, of_choice)
    return results


def ranges_of(table: pd.DataFrame, names: list[str]) -> pd.Categorical | None:
    """For each run, in which range of successive choices of an axis it is, where the axis has more than MAX_CHOICES."""
    number = table.groupby(names, dropna=False, sort=True, observed=True).ngroup().to_numpy()
    _, first = np.unique(number, return_index=True)
    if len(first) <= MAX_CHOICES:
        return None
    parts = np.array_split(np.arange(len(first)), RANGES)
    ends = [table[names].iloc[first[part[[0, -1]]]].itertuples(index=False, name=None) for part in parts]
    labels = [" to ".join(map(choice_label, each)) for each in ends]
    return pd.Categorical.from_codes(np.repeat(np.arange(RANGES), list(map(len, parts)))[number], labels, ordered=True)


def pairings(table: pd.DataFrame, settings: Sequence[str], measures: Sequence[str], axis: list[str]) -> list[Pairing]:
    """Every two choices of an axis, compared on the runs for which all other settings are equal."""
    others = [name for name in table.columns.intersection(settings, sort=False) if name not in axis]
    rest = [name for name in others if len(table[name].unique()) > 1] or others
    parts = {choice_label(key): part for key, part in table.groupby(axis, dropna=False, sort=True)}
    results = []
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
        pairing = Pairing(
            first=first, second=second, pairs=len(both), difference=difference, better=better, worse=worse
        )
        results.append(pairing)
    return results
