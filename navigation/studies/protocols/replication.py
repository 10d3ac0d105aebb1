"""Doing a protocol: its runs as a sweep in the folder of its report, and the report of them."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from ...reports.findings import Claim, Findings, plain
from ...reports.page import cell, page, picture
from ...sweeps.spec import Sweep
from ...sweeps.store import Store, read_steps, table_of
from ...sweeps.sweep import run_sweep
from ...sweeps.work import run_key
from ..thesis.report import FIGURES, REPORT, RESULTS
from .protocol import Exhibit, Protocol, check_walked, place_names


def replicate(
    protocol: Protocol, sweep: Sweep, out: Path, *, about: dict[str, Any], command: str, scheduler: str | None = None,
    workers: int | None = None, progress: Callable[[int, int], object] = lambda done, total: None,
) -> dict[str, Any]:  # fmt: skip
    """Do the runs that the folder lacks and write its report; return what `tussock replicate` says.

    about: what it was done with, for the head of the report. command: that repeats it. Raises InputError as `run_sweep` does, and where a
    model did not walk at all.
    """
    done = run_sweep(sweep, out, scheduler=scheduler, workers=workers, progress=progress)
    walks, left_out = walks_of(protocol, sweep, out)
    found = protocol.measures(walks)
    write_report(protocol, found, out, about=about, left_out=left_out, command=command)
    return {
        "report": str(out / REPORT), "results": str(out / RESULTS), "runs": done["runs"], "done_before": done["done_before"],
        "could_not_run": done["could_not_run"], "claims": {each.key: {"holds": words(each)} for each in found.claims},
        "seconds": done["seconds"],
    }  # fmt: skip


def walks_of(protocol: Protocol, sweep: Sweep, out: Path) -> tuple[pd.DataFrame, dict[str, int]]:
    """The walks of a sweep in a folder, a row each with the protocol's own numbers; and why others could not be made, how often."""
    wanted = {run_key(run) for run in sweep.runs()}
    with Store(out, read_only=True) as store:
        rows = {key: row for key, row in store.rows().items() if key in wanted}
        for (key, row), place in zip(rows.items(), place_names(rows.values()), strict=True):
            row["place"] = place
            if row["error"] is None:
                row |= protocol.of_walk(row, read_steps(store.steps(key)))
    errors = [_kind(row["error"]) for row in rows.values() if row["error"] is not None]
    if len(errors) == len(rows):
        raise InputError(f"none of {len(rows)} runs could be made; the first: {errors[0]}")
    table = table_of({key: row for key, row in rows.items() if row["error"] is None})
    models = [choice["model"] for choice in sweep.axes["model"]]
    check_walked(table, models)
    order = table["model"].map({model: k for k, model in enumerate(models)})
    table = table.iloc[order.argsort(kind="stable")].assign(model=lambda each: each["model"].str.split().str[0])
    return table.reset_index(drop=True), {why: errors.count(why) for why in dict.fromkeys(errors)}


def _kind(error: str) -> str:
    """An error without what tells it from others of its kind: what stands in parentheses."""
    return re.sub(r" \([^()]*\)", "", error).replace(" m is", " is")


def write_report(
    protocol: Protocol, found: Findings, out: Path, *, about: dict[str, Any], left_out: dict[str, int], command: str
) -> None:
    """Write figures (PNG and SVG), results.json and report.html."""
    (out / FIGURES).mkdir(parents=True, exist_ok=True)
    results = {
        "version": 1, "protocol": protocol.name, "paper": protocol.paper, "about": about,
        "parameters": {each.name: {"published": each.published, "here": each.here} for each in protocol.parameters},
        "differences": protocol.differences, "could_not_run": left_out, "numbers": found.numbers,
        "claims": {
            claim.key: {key: getattr(claim, key) for key in ("statement", "test", "note", "published", "obtained", "holds")}
            for claim in found.claims
        },
        "tables": found.to_json()["tables"],
    }  # fmt: skip
    text = page(
        "protocol.html", title=protocol.title, lead=protocol.question, about=about, paper=protocol.paper,
        claims=[_shown(claim) for claim in found.claims], exhibits=[_exhibit(each, found, out / FIGURES) for each in protocol.exhibits],
        parameters=protocol.parameters, differences=protocol.differences, left_out=left_out, command=command,
    )  # fmt: skip
    with replacing(out / RESULTS) as partial:
        partial.write_text(json.dumps(plain(results), indent=1) + "\n", encoding="utf-8")
    with replacing(out / REPORT) as partial:  # last: a folder with a report holds everything
        partial.write_text(text, encoding="utf-8")


def words(claim: Claim) -> str:
    """Whether a claim holds, as people say it."""
    return {None: "not tested", True: "holds", False: "does not hold"}[claim.holds]


def _shown(claim: Claim) -> dict[str, Any]:
    """What the page shows of a claim."""
    labels = dict.fromkeys([*claim.published, *claim.obtained])
    return {
        "claim": claim, "numbers": [(label, claim.published.get(label), claim.obtained.get(label)) for label in labels],
        "words": words(claim), "colour": {None: "untested", True: "yes", False: "no"}[claim.holds],
    }  # fmt: skip


def _exhibit(each: Exhibit, found: Findings, folder: Path) -> dict[str, Any]:
    """What the page shows of a table or figure."""
    table = found.tables[each.table]
    shown = {"name": each.name, "title": each.title, "caption": each.caption}
    if each.draw is not None:
        return shown | picture(each.draw(table), folder, each.name)
    rows = [[cell(plain(value)) for value in row] for row in table.to_numpy(dtype=object)]
    return shown | {"columns": list(table.columns), "rows": rows}
