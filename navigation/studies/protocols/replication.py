"""Doing a protocol: its runs are a sweep in the folder of its report."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.progress import Progress, printed

from ...reports.claims import Outcome, check_claims, count_outcomes
from ...reports.report import (
    REPORT,
    RESULTS,
    Block,
    Bullets,
    ClaimTable,
    Command,
    Drawing,
    Report,
    Section,
    Table,
    Text,
    write_report,
)
from ...reports.results import StudyResults
from ...sweeps.report import arrivals
from ...sweeps.spec import Sweep
from ...sweeps.sweep import run_sweep
from ...sweeps.tables import compared_models, comparison_blocks
from .finished_walks import walks_of
from .protocol import DatabaseProtocol, Item, Protocol
from .worldless import WorldlessProtocol

AnyProtocol = Protocol | DatabaseProtocol | WorldlessProtocol

SUMMARY = (
    "What the paper claims, the numbers that it gives where it gives any, the numbers obtained here, and whether the claim holds by the "
    "test named. No parameter was tuned to make a claim hold."
)


def replicate(
    protocol: Protocol,
    sweep: Sweep,
    out: Path,
    *,
    about: dict[str, Any],
    command: str,
    workers: str | int | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Do the runs that a folder does not have yet, and write the report.

    Args:
        protocol: The experiment.
        sweep: Its runs.
        out: The folder.
        about: The choices made, for the head of the report.
        command: Command line that repeats all of it.
        workers: What does the runs; see `run_sweep`.
        progress: Called with the numbers of finished and of all runs; None prints a line where it takes long, `no_progress` none.

    Returns:
        The result of `tussock replicate`.

    Raises:
        SettingError: A model has no walk at all.
        InputError: For the same reasons as `run_sweep`.
    """
    progress = printed(progress, "walking", "runs")
    done = run_sweep(sweep, out, workers=workers, progress=progress)
    walks, left_out = walks_of(protocol, sweep, out)
    results = protocol.measure(walks)
    outcomes = check_claims(protocol.claims, [results], few_units=False)
    compared = compared_models(walks, _compared(protocol))
    headline = _headline(outcomes, arrivals(walks.assign(model=walks["spec"]), ["model"]))
    report = _report(
        protocol, results, outcomes, compared, about=about, left_out=left_out, command=command, headline=headline
    )
    write_report(report, out)
    return {
        "report": str(out / REPORT),
        "results": str(out / RESULTS),
        "runs": done["runs"],
        "done_before": done["done_before"],
        "could_not_run": done["could_not_run"],
        "claims": {each.claim.key: {"holds": each.label} for each in outcomes},
        "seconds": done["seconds"],
    }


def measure_images(
    protocol: DatabaseProtocol,
    folder: Path,
    out: Path,
    *,
    seed: int,
    about: dict[str, Any],
    command: str,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Measure what a protocol measures on published images, and write the report.

    Args:
        protocol: The experiment.
        folder: Of the images.
        out: Folder of the report.
        seed: Of everything random.
        about: The choices made, for the head of the report.
        command: Command line that repeats all of it.
        progress: Called with how much is done, of how much; None prints a line where it takes long, `no_progress` none.

    Returns:
        The result of `tussock replicate`.

    Raises:
        FileError: The images are missing or damaged.
    """
    progress = printed(progress, "comparing", "sets")
    return _compute(protocol, lambda: protocol.measure(folder, seed, progress), out, about=about, command=command)


def compute(
    protocol: WorldlessProtocol,
    out: Path,
    *,
    seed: int,
    quick: bool,
    about: dict[str, Any],
    command: str,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Do a protocol that needs neither a world nor images, and write the report.

    Args:
        protocol: The experiment.
        out: Folder of the report.
        seed: Of everything random.
        quick: A first look.
        about: The choices made, for the head of the report.
        command: Command line that repeats all of it.
        progress: Called with how much is done, of how much; None prints a line where it takes long, `no_progress` none.

    Returns:
        The result of `tussock replicate`.
    """
    progress = printed(progress, "computing", "parts")
    return _compute(protocol, lambda: protocol.measure(seed, quick, progress), out, about=about, command=command)


def _compute(
    protocol: DatabaseProtocol | WorldlessProtocol,
    measure: Callable[[], StudyResults],
    out: Path,
    *,
    about: dict[str, Any],
    command: str,
) -> dict[str, Any]:
    began = time.perf_counter()
    results = measure()
    outcomes = check_claims(protocol.claims, [results], few_units=False)
    headline = _headline(outcomes)
    report = _report(protocol, results, outcomes, {}, about=about, left_out={}, command=command, headline=headline)
    write_report(report, out)
    return {
        "report": str(out / REPORT),
        "results": str(out / RESULTS),
        "claims": {each.claim.key: {"holds": each.label} for each in outcomes},
        "seconds": time.perf_counter() - began,
    }


def _headline(outcomes: list[Outcome], *others: str) -> str:
    """The main results in a sentence: how many claims hold, where there are any, and other parts."""
    parts = [*([count_outcomes(outcomes)] if outcomes else []), *others]
    return "; ".join(parts) + "." if parts else ""


def _compared(protocol: AnyProtocol) -> str:
    """What a protocol compares: "navigator" where there are several, or else "model"."""
    return "navigator" if isinstance(protocol, Protocol) and len(protocol.axes.get("navigator", ())) > 1 else "model"


def _report(
    protocol: AnyProtocol,
    results: StudyResults,
    outcomes: list[Outcome],
    compared: dict[str, Any],
    *,
    about: dict[str, Any],
    left_out: dict[str, int],
    command: str,
    headline: str,
) -> Report:
    links = {each.claim.key: (each.claim.figure, each.claim.figure.replace("-", " ")) for each in outcomes}
    summary = [Text(SUMMARY), ClaimTable(outcomes=outcomes, links=links)]
    shown: list[Block] = [_section(item, results.tables[item.table]) for item in protocol.items]
    if left_out:
        shown.append(Text("Runs that could not be made, and are in no number above:", anchor="could-not-run"))
        shown.append(Bullets([f"{count}: {reason}" for reason, count in left_out.items()]))
    parameters = Table(
        columns=["Parameter", "Published", "Here"],
        rows=[(each.name, each.published, each.here) for each in protocol.parameters],
    )
    walked, by = isinstance(protocol, Protocol), _compared(protocol)
    blocks = comparison_blocks(compared, by) if compared else []
    beside = [Section(title=f"{by.capitalize()}s compared", anchor=f"{by}s", blocks=blocks)] if compared else []
    again = "Finished runs are in the folder and are not done again. " if walked else ""
    again += "The same command gives the same numbers."
    return Report(
        title=protocol.title,
        lead=protocol.question,
        about=about,
        blocks=[
            Section(title="Does it hold?", anchor="summary", blocks=summary),
            Section(title="Results", anchor="results", blocks=shown),
            *beside,
            Section(
                title="Differences from the original",
                anchor="differences",
                blocks=[parameters, Bullets(protocol.differences)],
            ),
            Section(
                title="To do it again",
                anchor="again",
                blocks=[Text(again), Command(command)],
            ),
        ],
        footer=f"After {protocol.paper} All numbers are in results.json"
        + (", every walk is in runs.parquet." if walked else "."),
        results=_results(protocol, results, outcomes, about=about, left_out=left_out) | compared,
        headline=headline,
    )


def _section(item: Item, table: pd.DataFrame) -> Section:
    if (draw := item.draw) is None:
        return Section(title=item.title, anchor=item.name, blocks=[Table.of(table, item.caption)])
    drawing = Drawing(names=(item.name,), draw=lambda: [draw(table)], alt=item.title, caption=item.caption)
    return Section(title=item.title, anchor=item.name, blocks=[drawing])


def _results(
    protocol: AnyProtocol,
    results: StudyResults,
    outcomes: list[Outcome],
    *,
    about: dict[str, Any],
    left_out: dict[str, int],
) -> dict[str, Any]:
    """Everything in numbers; docs/protocols.md explains it."""
    return {
        "version": 1,
        "protocol": protocol.name,
        "paper": protocol.paper,
        "about": about,
        "parameters": {each.name: {"published": each.published, "here": each.here} for each in protocol.parameters},
        "differences": protocol.differences,
        "could_not_run": left_out,
        "numbers": results.numbers,
        "claims": {
            each.claim.key: each.description | {"obtained": each.obtained[0], "holds": each.holds[0]} | each.evidence
            for each in outcomes
        },
        "tables": results.to_json()["tables"],
    }
