"""Whether two versions get the same results from a job: the runs of walks and sweeps, and the numbers of the thesis."""

import io
import json
import math
import sqlite3
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

NEAR = 1e-6  # m of positions; and the same share of any number
RESULTS = ("arrived", "steps", "mean_deviation_m")
SHOWN = 3  # differences that are named

Run = tuple[dict[str, Any], str]  # its results, and its trajectory as CSV
Table = list[tuple[dict[str, Any], dict[str, Any], str]]  # settings, results and trajectory of each run of a sweep


@dataclass
class Comparison:
    """How the results of two versions compare.

    Attributes:
        of: What is compared: "runs" or "numbers".
        compared: How many of both versions.
        unmatched: How many only one of them has.
        differences: What differs, one text for each.
        apart: The farthest that two agents are apart at the same step of equal runs (m); None where nothing walks.
    """

    of: str
    compared: int = 0
    unmatched: int = 0
    differences: list[str] = field(default_factory=list)
    apart: float | None = None

    def __str__(self) -> str:
        text = f"{self.compared - len(self.differences)} of {self.compared} {self.of} equal"
        if self.apart is not None:
            text += f", positions to {self.apart:.0e} m" if self.apart else ", positions to the last bit"
        if self.unmatched:
            text += f"; {self.unmatched} without a counterpart"
        return "; ".join([text, *self.differences[:SHOWN]])


def compare(base: Path, new: Path) -> Comparison:
    """Compare the folders that a command wrote. Raises ValueError for folders of no known kind."""
    if (base / "finished.sqlite").exists():
        return compare_sweeps(base, new)
    if (base / "trajectory.csv").exists():
        return _compare_runs({"the walk": _run(base)}, {"the walk": _run(new)})
    if (base / "results.json").exists():
        return compare_numbers(*(json.loads((folder / "results.json").read_text()) for folder in (base, new)))
    raise ValueError(f"{base} has neither runs nor results.json")


def compare_sweeps(base: Path, new: Path) -> Comparison:
    """Compare the runs of two sweeps. A run is known by the settings that have the same values in both.

    Raises ValueError where these do not tell the runs apart.
    """
    tables = [_read(folder) for folder in (base, new)]
    forms = {name: form for name in tables[0][0][0] if (form := _common_form(name, tables)) is not None}
    runs = [
        {
            ", ".join(f"{name} {form(settings[name])}" for name, form in forms.items()): (row, steps)
            for settings, row, steps in table
        }
        for table in tables
    ]
    for of_runs, table in zip(runs, tables, strict=True):
        if len(of_runs) != len(table):
            raise ValueError(f"{len(table)} runs have {len(of_runs)} different settings in {', '.join(forms)}")
    return _compare_runs(*runs)


def _common_form(name: str, tables: list[Table]) -> Callable[[Any], str] | None:
    """The form in which a setting that varies has the same values in two sweeps: as text or, where versions write defaults
    differently, its first word. None where it does not vary, or has other values.
    """
    if any(name not in settings for table in tables for settings, *_ in table):
        return None
    written = [{str(settings[name]) for settings, *_ in table} for table in tables]
    for form in (str, _first_word):
        one, other = ({form(text) for text in texts} for texts in written)
        if one == other and 1 < len(one) == len(written[0]) == len(written[1]):
            return form
    return None


def _first_word(value: Any) -> str:
    return str(value).split(" ")[0]


def _compare_runs(base: dict[str, Run], new: dict[str, Run]) -> Comparison:
    found = Comparison("runs", unmatched=len(base.keys() ^ new.keys()))
    for name in sorted(base.keys() & new.keys()):
        (row, steps), (other_row, other_steps) = base[name], new[name]
        found.compared += 1
        differs = [
            f"{key} {row.get(key)} and {other_row.get(key)}"
            for key in RESULTS
            if not _equal(row.get(key), other_row.get(key))
        ]
        apart = _apart(steps, other_steps)
        far = np.flatnonzero(apart > NEAR)
        if len(far):
            differs.insert(0, f"{apart[far[0]]:.0e} m apart at step {far[0]}")
        if differs:
            found.differences.append(f"{name}: {', '.join(differs)}")
        else:
            found.apart = max(found.apart or 0.0, *apart, 0.0)
    return found


def _apart(base: str, new: str) -> np.ndarray:
    """(n,) How far two agents are apart at each of the steps that both make (m)."""
    if not base or not new:  # one of them could not start
        return np.zeros(0)
    one, other = (pd.read_csv(io.StringIO(text))[["x_m", "y_m"]].to_numpy(float) for text in (base, new))
    n = min(len(one), len(other))
    return np.abs(one[:n] - other[:n]).max(axis=1, initial=0.0)


def _run(folder: Path) -> Run:
    return json.loads((folder / "summary.json").read_text()), (folder / "trajectory.csv").read_text()


def _read(folder: Path) -> Table:
    database = sqlite3.connect(folder / "finished.sqlite")
    found = database.execute("SELECT settings, row, steps FROM runs").fetchall()
    database.close()
    return [(json.loads(settings), json.loads(row), zlib.decompress(steps).decode()) for settings, row, steps in found]


def compare_numbers(base: Any, new: Any) -> Comparison:
    """Compare all numbers that stand at the same place of two results, times aside."""
    one, other = dict(_numbers(base)), dict(_numbers(new))
    found = Comparison("numbers", unmatched=len(one.keys() ^ other.keys()))
    for place in sorted(one.keys() & other.keys()):
        found.compared += 1
        if not _equal(one[place], other[place]):
            found.differences.append(f"{place}: {one[place]} and {other[place]}")
    return found


def _numbers(value: Any, place: str = "") -> Iterator[tuple[str, float]]:
    if isinstance(value, dict):
        for key, each in value.items():
            if "seconds" not in key:
                yield from _numbers(each, f"{place}/{key}")
    elif isinstance(value, list):
        for index, each in enumerate(value):
            yield from _numbers(each, f"{place}/{index}")
    elif isinstance(value, int | float):
        yield place, value


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=NEAR, abs_tol=NEAR) or (math.isnan(one) and math.isnan(other))
    return one == other
