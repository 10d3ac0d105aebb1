"""Statistics of a sweep's runs: means with confidence intervals, by axis, and tests of models in pairs (docs/statistics.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from tussock.world.params import is_generated

from ..experiment_settings import default_settings
from ..intervals import Interval, mean_interval, positive_interval, share_difference_interval, share_interval
from ..significance import holm, sign_flip_p

MEASURES = {  # columns of the table of runs, with their labels
    "arrived": "share that arrived",
    "mean_deviation_m": "mean deviation from the route (m)",
    "mean_error_deg": "mean heading error (°)",
    "resets": "times put back on the route",
    "looks_per_m": "headings looked at, for each metre",
    "touches": "steps that obstacles stopped or turned",
    "inward": "share of looks off the route that lead back to it",
    "outward": "share of looks off the route that lead away from it",
    "recovered": "share that came back after being carried aside",
}
SHARES = ("arrived", "recovered")  # of runs
BETTER = (*SHARES, "inward")  # the more the better; of the other measures, the less
OF_STEERING = ("looks_per_m", "inward", "outward")  # shown where not all runs scan
IN_TABLES = ("touches", "inward", "outward")  # measures that are not drawn, and not compared in pairs
UNITS = {"m": "m", "deg": "°"}
AXIS_ORDER = {"model": 0, "world_seed": 2, "route_seed": 2, "seed": 2}  # other axes are 1
MAX_CHOICES = 200  # of an axis in a report; more are put together
RANGES = 20  # that choices are put together in


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Several runs in numbers.

    Attributes:
        runs: Number of runs.
        worlds: Number of worlds that they are in (see `worlds_of`).
        intervals: Mean and interval, by measure.
    """

    runs: int
    worlds: int
    intervals: dict[str, Interval]


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Two choices compared by one measure.

    Attributes:
        interval: Mean of the first minus the second.
        better: Number of pairs in which the first is better.
        worse: Number of pairs in which the first is worse.
        effect: Effect size: share of the pairs in which the first is better, less that in which it is worse (-1 to 1).
        p: p value of "the two are alike" (see `sign_flip_p`); nan with too few worlds.
        corrected_p: The same after Holm's correction for all pairs that are compared.
    """

    interval: Interval
    better: int
    worse: int
    effect: float
    p: float
    corrected_p: float = np.nan


@dataclass(frozen=True, kw_only=True)
class Pairing:
    """Two choices of an axis, two models for example, compared on pairs of runs that are equal in everything else.

    Attributes:
        first: Label of the first choice.
        second: Label of the second choice.
        pairs: Number of pairs.
        worlds: Number of worlds that they are in.
        differences: The results, by measure.
    """

    first: str
    second: str
    pairs: int
    worlds: int
    differences: dict[str, Difference]


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


def measures_of(table: pd.DataFrame) -> list[str]:
    """The measures that a report of runs shows.

    Being put back, touches and recovery are shown where there were any; how agents steer, where not all runs scan.
    """
    scans = "navigator" not in table or bool((table["navigator"] == default_settings()["navigator"]).all())
    shown = {name: name in table and bool((table[name].fillna(0) != 0).any()) for name in ("resets", "touches")}
    shown["recovered"] = "recovered" in table and bool(table["recovered"].notna().any())
    shown |= {name: name in table and not scans for name in OF_STEERING}
    return [name for name in MEASURES if shown.get(name, True)]


def summary(table: pd.DataFrame, measures: Sequence[str]) -> Summary:
    """Runs in numbers, with the mean and interval of each measure."""
    return _summary(table, measures, worlds_of(table))


def _summary(table: pd.DataFrame, measures: Sequence[str], worlds: Int[np.ndarray, " n"]) -> Summary:
    intervals = {measure: _interval(measure, _numbers(table, measure), worlds) for measure in measures}
    return Summary(runs=len(table), worlds=len(np.unique(worlds)), intervals=intervals)


def _interval(measure: str, values: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]) -> Interval:
    known = np.isfinite(values)
    find = share_interval if measure in SHARES else positive_interval
    return find(values[known], worlds[known])


def _numbers(table: pd.DataFrame, column: str) -> Float[np.ndarray, " n"]:
    """A column as numbers; nan where a run has none."""
    return table[column].to_numpy(dtype=float, na_value=np.nan)


def by_axis(table: pd.DataFrame, names: list[str], measures: Sequence[str]) -> dict[str, Summary]:
    """`summary` of the runs of each choice of an axis, in order."""
    worlds, results = worlds_of(table), {}
    for key, part in table.reset_index(drop=True).groupby(names, dropna=False, sort=True, observed=True):
        results[choice_label(key)] = _summary(part, measures, worlds[part.index])
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
        worlds = worlds_of(both)
        differences = {measure: _difference(both, measure, worlds) for measure in measures}
        number = len(np.unique(worlds))
        results.append(Pairing(first=first, second=second, pairs=len(both), worlds=number, differences=differences))
    return _corrected(results, measures)


def _difference(both: pd.DataFrame, measure: str, worlds: Int[np.ndarray, " n"]) -> Difference:
    """The first of two choices less the second, from a table of the pairs."""
    first, second = (_numbers(both, name) for name in (measure, f"{measure}_other"))
    known = np.isfinite(first) & np.isfinite(second)
    first, second, worlds = first[known], second[known], worlds[known]
    gain = first - second if measure in BETTER else second - first
    better, worse = int((gain > 0).sum()), int((gain < 0).sum())
    return Difference(
        interval=share_difference_interval(first, second, worlds)
        if measure in SHARES
        else mean_interval(first - second, worlds),
        better=better,
        worse=worse,
        effect=(better - worse) / max(1, len(gain)),
        p=sign_flip_p(first - second, worlds),
    )


def _corrected(results: list[Pairing], measures: Sequence[str]) -> list[Pairing]:
    """Pairings with Holm's correction over all of them, for each measure."""
    corrected = {measure: holm([each.differences[measure].p for each in results]) for measure in measures}
    return [
        replace(
            each,
            differences={
                name: replace(found, corrected_p=corrected[name][k]) for name, found in each.differences.items()
            },
        )
        for k, each in enumerate(results)
    ]
