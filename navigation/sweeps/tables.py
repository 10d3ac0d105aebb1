"""Tables of runs with their confidence intervals, and of models in pairs; and the same in numbers."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from ..experiment_settings import TYPES
from ..intervals import MIN_WORLDS
from ..reports.page import format_value
from ..reports.report import Block, Cell, Table, Text
from ..reports.results import plain_json
from .statistics import MEASURES, Pairing, Summary, axes_of, by_axis, measures_of, pairings

INTERVALS = (
    "Numbers in parentheses are 95 % confidence intervals. Runs in one world are not independent, so intervals are over worlds (in a world "
    f"from a file, over its routes); from fewer than {MIN_WORLDS} there is none. docs/statistics.md explains all intervals and tests."
)
PAIRS = (
    "Pairs of runs that are equal in everything else. A difference is the first minus the second. p is that of the hypothesis that the two "
    "are alike, corrected for all pairs in this table (Holm); where it is under 0.05, the difference is bold. The effect is the share of "
    "the pairs of runs in which the first is better, less that in which it is worse."
)
LEVEL = 0.05  # of tests
OF_DIFFERENCE = ("better", "worse", "effect", "p", "corrected_p")


def summary_numbers(summary: Summary) -> dict[str, Any]:
    """A summary as report.json has it."""
    intervals = {measure: dataclasses.asdict(interval) for measure, interval in summary.intervals.items()}
    return {"runs": summary.runs, "worlds": summary.worlds, **intervals}


def pairing_numbers(pairing: Pairing) -> dict[str, Any]:
    """A pairing as report.json has it: its numbers by measure."""
    found = pairing.differences.items()
    numbers = {name: {measure: getattr(each, name) for measure, each in found} for name in OF_DIFFERENCE}
    numbers["difference"] = {measure: dataclasses.asdict(each.interval) for measure, each in found}
    return {name: getattr(pairing, name) for name in ("first", "second", "pairs", "worlds")} | numbers


def summary_table(
    rows: Mapping[tuple[str, ...], Mapping[str, Any]], labels: Sequence[str], measures: list[str]
) -> Table:
    """A table of summaries.

    Args:
        rows: Numbers of summaries, by what each is of: as many labels as there are columns for them.
        labels: Headings of these columns.
        measures: Shown of each.
    """
    return Table(
        columns=[*labels, "runs", "worlds", *(MEASURES[measure] for measure in measures)],
        rows=[
            [*names, str(each["runs"]), _worlds(each["worlds"]), *(_interval(each[measure]) for measure in measures)]
            for names, each in rows.items()
        ],
    )


def pair_table(pairs: Sequence[Mapping[str, Any]], measures: list[str]) -> Table:
    """A table of the numbers of pairings."""
    columns = ["first", "second", "pairs", "worlds"]
    for measure in measures:
        columns += [MEASURES[measure], "p", "better, worse"]
    rows: list[list[str | Cell]] = []
    for pair in pairs:
        cells: list[str | Cell] = [pair["first"], pair["second"], str(pair["pairs"]), _worlds(pair["worlds"])]
        for measure in measures:
            p, better, worse, effect = (pair[name][measure] for name in ("corrected_p", "better", "worse", "effect"))
            difference = _interval(pair["difference"][measure], bold=p is not None and p < LEVEL)
            cells += [difference, format_p(p), Cell(text=f"{better}, {worse}", note=f"(effect {format_value(effect)})")]
        rows.append(cells)
    return Table(columns=columns, rows=rows)


def format_p(p: float | None) -> str:
    """A p value as text; a dash where there was no test."""
    return "–" if p is None or p != p else "under 0.001" if p < 0.001 else f"{p:.2g}"


def _worlds(number: int) -> str | Cell:
    return str(number) if number >= MIN_WORLDS else Cell(text=str(number), note="no interval")


def _interval(interval: Mapping[str, float | None], *, bold: bool = False) -> Cell:
    """A mean with its interval."""
    low, high = interval["low"], interval["high"]
    note = "" if low is None else f"({format_value(low)} to {format_value(high)})"
    return Cell(text=format_value(interval["value"]), note=note, bold=bold)


def compared_models(walks: pd.DataFrame, by: str = "model") -> dict[str, Any]:
    """The models of a table of walks in numbers: `models`, each alone, and `pairs` of them.

    Args:
        walks: One per row, with the specs of their models in the column "spec".
        by: "model"; or "navigator", whose names and pairs then take the place of the models': `navigators`.
    """
    walks = walks.assign(model=walks["spec"])
    measures = measures_of(walks)
    axis = next((names for names in axes_of(walks, list(TYPES)).values() if by in names), [by])
    found = by_axis(walks, axis, measures)
    return plain_json(
        {
            f"{by}s": {choice: summary_numbers(each) for choice, each in found.items()},
            "pairs": [pairing_numbers(pair) for pair in pairings(walks, list(TYPES), measures, axis)],
        }
    )


def comparison_blocks(compared: Mapping[str, Any], by: str = "model") -> list[Block]:
    """What a page shows of `compared_models`."""
    models, pairs = compared[f"{by}s"], compared["pairs"]
    measures = [name for name in MEASURES if all(name in each for each in models.values())]
    rows = {(name,): each for name, each in models.items()}
    blocks: list[Block] = [Text(INTERVALS, style="soft"), summary_table(rows, [by], measures)]
    return [*blocks, Text(PAIRS, style="soft"), pair_table(pairs, measures)] if pairs else blocks
