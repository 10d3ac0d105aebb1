"""The report of a sweep: success and error by axis, models in pairs, causes of failures, and the worst walks."""

import dataclasses
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.errors import FileError
from tussock.world.progress import Progress, no_progress

from ..experiment_settings import TYPES, default_settings
from ..failures import Cause
from ..reports.page import format_value
from ..reports.report import REPORT, Block, Cell, Command, Drawing, Report, Section, Table, Text, write_report
from ..reports.report import RESULTS as REPLICATION_RESULTS
from ..reports.results import plain_json
from .figures import along_axis
from .statistics import (
    MAX_CHOICES,
    MEASURES,
    Interval,
    axes_of,
    by_axis,
    choice_label,
    means,
    pairings,
    ranges_of,
    setting_label,
)
from .store import TABLE, Store, read_steps, read_title
from .sweep import worst_of
from .worst import walk_section

RESULTS = "report.json"
MAX_ERRORS = 100  # on the page
MAX_IN_HEADLINE = 8  # choices
LEAD = "Success and errors of all runs, and why the worst of them failed."
INTERVALS = (
    "Numbers in parentheses are 95 % bootstrap confidence intervals of the mean. Runs in one world are not independent, so whole worlds "
    "are drawn, with all of their runs; in a world from a file, whole routes. Where there is only one of these, single runs are drawn. "
    "For more than 2,000 of them, the intervals are those of a normal distribution."
)
PAIRS = (
    "Pairs, compared on the runs that are equal in everything else. A difference is the first minus the second; it is bold where its "
    "interval does not contain 0."
)
IN_RANGES = f"There are more than {MAX_CHOICES} choices. Each value is of a range of successive ones; the single runs are in {TABLE}."
FAILED = "Walks that did not arrive or were put back, by the cause that the evidence of their poor steps supports."
WALKS = (
    "From above: the route in blue to its goal, the walk in red, poor steps as dots, and a ring around the step that is shown. Views are "
    "360 degrees wide, ahead in the middle."
)
FOOTER = "All numbers are in report.json, every run is in runs.parquet. docs/failures.md explains the causes and their limits."


def write_sweep_report(folder: Path, *, worst: int = 5, progress: Progress = no_progress) -> dict[str, Any]:
    """Write report.html, report.json and the figures of a sweep into its folder. The sweep may still run.

    Args:
        folder: Folder of the sweep.
        worst: Number of worst walks to show.
        progress: Called with the numbers of figures drawn and of all figures.

    Returns:
        The content of report.json.

    Raises:
        FileError: The folder holds no finished run, or a replication.
    """
    if (folder / REPLICATION_RESULTS).exists():
        raise FileError(f"{folder} holds a replication, with its own {REPORT}; give the folder of a sweep")
    with Store(folder, read_only=True) as store:
        table = store.table()
        if table.empty:
            raise FileError(f"{folder} holds no finished run yet; try again later")
        shown = worst_of(table, worst)
        walks = [
            walk_section(number, key, store.row(key), read_steps(store.steps(key)), folder)
            for number, key in enumerate(shown, 1)
        ]
    completed = table[table["error"].isna()].reset_index(drop=True)
    if completed.empty:
        raise FileError(f"no run in {folder} could be completed; the first: {table['error'].iloc[0]}")
    axes = axes_of(completed, list(TYPES))
    completed = completed.assign(**_ranges(completed, axes))
    measures = [name for name in MEASURES if name != "resets" or completed["resets"].to_numpy().any()]
    results = plain_json(_results(table, completed, axes, measures, shown))
    report = Report(
        title=read_title(folder) or f"Sweep {folder.resolve().name}",
        lead=LEAD,
        about=_about(table, completed, axes),
        blocks=_blocks(completed, axes, measures, results, walks),
        footer=FOOTER,
        results=results,
        results_file=RESULTS,
        headline=f"{arrivals(completed, _compared(completed, axes))}.",
    )
    return write_report(report, folder, progress)


def _results(
    table: pd.DataFrame, completed: pd.DataFrame, axes: dict[str, list[str]], measures: list[str], worst: list[str]
) -> dict[str, Any]:
    """Everything in numbers; docs/sweeps.md explains it."""
    by = _compared(completed, axes)
    failed = completed[~completed["arrived"].astype(bool) | (completed["resets"] > 0)]
    groups = failed.groupby(by, dropna=False) if by else [("all", failed)]
    not_run = table[table["error"].notna()]
    return {
        "version": 1,
        "runs": len(table),
        "measures": _numbers(means(completed, measures)),
        "by": {
            label: {
                choice: {"runs": count, **_numbers(intervals)}
                for choice, (count, intervals) in by_axis(completed, _columns(completed, axes, label), measures).items()
            }
            for label in axes
        },
        "pairs": [dataclasses.asdict(pair) for pair in (pairings(completed, list(TYPES), measures, by) if by else [])],
        "causes": {
            choice_label(key): {cause: int((part["cause"] == cause).sum()) for cause in Cause} for key, part in groups
        },
        "worst": worst,
        "could_not_run": [{"command": row.command, "error": row.error} for row in not_run.itertuples()],
    }


def _ranges(completed: pd.DataFrame, axes: dict[str, list[str]]) -> dict[str, pd.Categorical]:
    """Columns with the ranges of the axes that have too many choices to show each."""
    ranges = {f"ranges of {label}": ranges_of(completed, names) for label, names in axes.items()}
    return {name: values for name, values in ranges.items() if values is not None}


def _columns(completed: pd.DataFrame, axes: dict[str, list[str]], label: str) -> list[str]:
    """The columns by which runs are put together along an axis."""
    return [name] if (name := f"ranges of {label}") in completed else axes[label]


def _compared(completed: pd.DataFrame, axes: dict[str, list[str]]) -> list[str]:
    """The settings of the axis whose choices are compared in pairs: that of models, or else that of encodings, or none.

    An axis with too many choices to show each is not compared.
    """
    few = [names for label, names in axes.items() if _columns(completed, axes, label) == names]
    return next((names for wanted in ("model", "encoding") for names in few if wanted in names), [])


def arrivals(completed: pd.DataFrame, by: list[str]) -> str:
    """How many runs arrived, as in "15 of 30 arrived: perfect-memory 15 of 15, random 0 of 15".

    Args:
        completed: The runs.
        by: Settings whose choices are told apart, unless there are too many of them; empty for none. Their parameters are left out where
            the names alone differ.

    Returns:
        The sentence, without its full stop.
    """
    count = _arrived(completed)
    groups = {choice_label(key): part for key, part in completed.groupby(by, dropna=False, sort=False)} if by else {}
    if not 1 < len(groups) <= MAX_IN_HEADLINE:
        return f"{count} arrived"
    short = {label: label.split()[0] for label in groups}
    names = short if len(set(short.values())) == len(short) else dict(zip(short, short, strict=True))
    return f"{count} arrived: {', '.join(f'{names[label]} {_arrived(part)}' for label, part in groups.items())}"


def _arrived(runs: pd.DataFrame) -> str:
    return f"{int(runs['arrived'].sum())} of {len(runs)}"


def _numbers(intervals: dict[str, Interval]) -> dict[str, Any]:
    return {measure: dataclasses.asdict(interval) for measure, interval in intervals.items()}


def _about(table: pd.DataFrame, completed: pd.DataFrame, axes: dict[str, list[str]]) -> dict[str, Any]:
    """What was swept, for the head of the report."""
    varied = {name for names in axes.values() for name in names}
    fixed = {name: completed[name].iloc[0] for name in TYPES if name in completed and name not in varied}
    defaults = default_settings()
    equal = [
        f"{setting_label(name)} {value}"
        for name, value in fixed.items()
        if not pd.isna(value) and value != defaults[name]
    ]
    choices = [f"{label}: {completed.groupby(names, dropna=False).ngroups}" for label, names in axes.items()]
    count = "all" if len(completed) == len(table) else str(len(completed))
    return {
        "Runs": f"{len(table)} runs, {count} completed",
        "Varied": "; ".join(choices) or "nothing",
        "Equal in all runs": "; ".join(equal) or "everything has its default",
    }


def _blocks(
    completed: pd.DataFrame,
    axes: dict[str, list[str]],
    measures: list[str],
    results: dict[str, Any],
    walks: list[Section],
) -> list[Block]:
    """The content of the page."""
    blocks: list[Block] = [Text(INTERVALS, style="soft")]
    blocks += [_axis(completed, label, axes, measures, results["by"][label]) for label in axes]
    if results["pairs"]:
        blocks.append(_pairs(results["pairs"], measures))
    causes = Table(
        columns=["", *Cause],
        rows=[[label, *map(str, counts.values())] for label, counts in results["causes"].items()]
        or [["No walk failed.", *[""] * len(Cause)]],
    )
    blocks.append(Section(title="Why walks failed", anchor="causes", blocks=[Text(FAILED), causes]))
    blocks.append(Section(title="The worst walks", anchor="worst", blocks=[Text(WALKS, style="soft"), *walks]))
    if not_run := results["could_not_run"]:
        errors: list[Block] = []
        for each in not_run[:MAX_ERRORS]:
            errors += [Text(each["error"]), Command(each["command"])]
        if len(not_run) > MAX_ERRORS:
            errors.append(Text(f"{len(not_run) - MAX_ERRORS} more are in {RESULTS}."))
        blocks.append(Section(title="Runs that could not be completed", anchor="not-run", blocks=errors))
    return blocks


def _axis(
    completed: pd.DataFrame, label: str, axes: dict[str, list[str]], measures: list[str], choices: dict[str, Any]
) -> Section:
    """The measures along an axis, as a figure and as a table."""
    names, by = axes[label], _compared(completed, axes)
    anchor = f"by-{'-'.join(names)}"
    lines = [] if names == by else by
    columns = _columns(completed, axes, label)
    note = Text(IN_RANGES, style="soft")
    drawing = Drawing(
        names=(anchor,), draw=lambda: [along_axis(completed, columns, measures, lines)], alt=f"Means by {label}"
    )
    table = Table(
        columns=[label, "runs", *(MEASURES[measure] for measure in measures)],
        rows=[
            [choice, str(numbers["runs"]), *(_cell(numbers[measure]) for measure in measures)]
            for choice, numbers in choices.items()
        ],
    )
    return Section(title=f"By {label}", anchor=anchor, blocks=[drawing, *[note] * (columns != names), table])


def _pairs(pairs: list[dict[str, Any]], measures: list[str]) -> Section:
    """The choices of an axis in pairs."""
    columns = ["first", "second", "pairs"]
    for measure in measures:
        columns += [MEASURES[measure], "better, worse"]
    rows = []
    for pair in pairs:
        cells: list[str | Cell] = [pair["first"], pair["second"], str(pair["pairs"])]
        for measure in measures:
            difference = pair["difference"][measure]
            apart = difference["low"] is not None and (difference["low"] > 0 or difference["high"] < 0)
            cells += [_cell(difference, bold=apart), f"{pair['better'][measure]}, {pair['worse'][measure]}"]
        rows.append(cells)
    return Section(title="In pairs", anchor="pairs", blocks=[Text(PAIRS), Table(columns=columns, rows=rows)])


def _cell(interval: dict[str, float | None], *, bold: bool = False) -> Cell:
    """A mean with its interval."""
    low, high = interval["low"], interval["high"]
    note = "" if low is None else f"({format_value(low)} to {format_value(high)})"
    return Cell(text=format_value(interval["value"]), note=note, bold=bold)
