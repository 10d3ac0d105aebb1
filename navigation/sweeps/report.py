"""The report of a sweep: success and error by axis, models in pairs, causes of failures, and the worst walks."""

from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.errors import FileError
from tussock.world.progress import Progress, printed

from ..experiment_settings import TYPES, default_settings
from ..failures import Cause
from ..reports.report import REPORT, Block, Command, Drawing, Report, Section, Table, Text, write_report
from ..reports.report import RESULTS as REPLICATION_RESULTS
from ..reports.results import plain_json
from .figures import along_axis
from .recordings import worst_of
from .statistics import (
    IN_TABLES,
    MAX_CHOICES,
    axes_of,
    axis_label,
    by_axis,
    choice_label,
    measures_of,
    pairings,
    ranges_of,
    setting_label,
    summary,
    worlds_of,
)
from .store import TABLE, Store, read_steps, read_title
from .tables import INTERVALS, PAIRS, pair_table, pairing_numbers, summary_numbers, summary_table
from .worst import walk_section

RESULTS = "report.json"
MAX_ERRORS = 100  # on the page
MAX_IN_HEADLINE = 8  # choices
LEAD = "Success and errors of all runs, and why the worst of them failed."
IN_RANGES = f"There are more than {MAX_CHOICES} choices. Each value is of a range of successive ones; the single runs are in {TABLE}."
FAILED = "Walks that did not arrive or were put back, by the cause that the evidence of their poor steps supports."
WALKS = (
    "From above: the route in blue to its goal, the walk in red, poor steps as dots, and a ring around the step that is shown. Views are "
    "360 degrees wide, ahead in the middle."
)
FOOTER = "All numbers are in report.json, every run is in runs.parquet. docs/failures.md explains the causes and their limits."


def write_sweep_report(folder: Path, *, worst: int = 5, progress: Progress | None = None) -> dict[str, Any]:
    """Write report.html, report.json and the figures of a sweep into its folder. The sweep may still run.

    Args:
        folder: Folder of the sweep.
        worst: Number of worst walks to show.
        progress: Called with the numbers of figures drawn and of all figures; None prints a line where it takes long, `no_progress` none.

    Returns:
        The content of report.json.

    Raises:
        FileError: The folder holds no finished run, or a replication.
    """
    progress = printed(progress, "drawing", "figures")
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
    measures = measures_of(completed)
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
    overall = summary_numbers(summary(completed, measures))
    return {
        "version": 1,
        "runs": len(table),
        "worlds": overall["worlds"],
        "measures": {measure: overall[measure] for measure in measures},
        "by": {
            label: _along(completed, _columns(completed, axes, label), [] if axes[label] == by else by, measures)
            for label in axes
        },
        "pairs": [pairing_numbers(pair) for pair in (pairings(completed, list(TYPES), measures, by) if by else [])],
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
    """The settings of the axis whose choices are compared in pairs: that of models, or else of navigators or of encodings, or none.

    An axis with too many choices to show each is not compared.
    """
    few = [names for label, names in axes.items() if _columns(completed, axes, label) == names]
    return next((names for wanted in ("model", "navigator", "encoding") for names in few if wanted in names), [])


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


def _along(completed: pd.DataFrame, axis: list[str], by: list[str], measures: list[str]) -> dict[str, Any]:
    """The runs of each choice of an axis in numbers; where `by` has settings, also split by their choices, as the figure is."""
    numbers = {choice: summary_numbers(each) for choice, each in by_axis(completed, axis, measures).items()}
    for key, part in completed.groupby(by, dropna=False, sort=True) if by else ():
        for choice, each in by_axis(part, axis, measures).items():
            numbers[choice].setdefault("split", {})[choice_label(key)] = summary_numbers(each)
    return numbers


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
        "Worlds": str(len(set(worlds_of(completed)))),
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
        pairs = [Text(PAIRS, style="soft"), pair_table(results["pairs"], _main(measures))]
        blocks.append(Section(title="In pairs", anchor="pairs", blocks=pairs))
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


def _main(measures: list[str]) -> list[str]:
    """The measures that are drawn, and compared in pairs."""
    return [name for name in measures if name not in IN_TABLES]


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
        names=(anchor,), draw=lambda: [along_axis(completed, columns, _main(measures), lines)], alt=f"Means by {label}"
    )
    rows = {
        (choice, line): numbers for choice, each in choices.items() for line, numbers in each.get("split", {}).items()
    } or {(choice,): each for choice, each in choices.items()}
    table = summary_table(rows, [label, axis_label(by)] if lines else [label], measures)
    return Section(title=f"By {label}", anchor=anchor, blocks=[drawing, *[note] * (columns != names), table])
