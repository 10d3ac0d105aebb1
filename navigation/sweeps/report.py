"""The report of a sweep: one page with success and error by each axis, models in pairs, and the worst walks with why they failed."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tussock.render.renderer import open_renderer
from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from ..failures import CAUSES, Evidence, in_words
from ..reports.findings import plain
from ..reports.page import page, picture
from ..studies.thesis.report import RESULTS as REPLICATED
from ..training import training_views
from .figures import along_axis, seen, walked
from .spec import SETTINGS
from .statistics import MEASURES, Interval, axes_of, by_axis, means, pairings, spoken, words
from .store import Store, read_steps, table_of
from .sweep import WORST, worst_of
from .work import options_of

REPORT, RESULTS, FIGURES = "report.html", "report.json", "figures"


def write_sweep_report(
    folder: Path, *, worst: int = 5, progress: Callable[[int, int], object] = lambda done, total: None
) -> dict[str, Any]:
    """Write report.html, report.json and the figures of a sweep into its folder; return report.json's content.

    worst: how many of the worst walks are shown. A sweep may go on meanwhile. Raises InputError where the folder holds no
    finished run, or a replication.
    """
    if (folder / REPLICATED).exists():
        raise InputError(f"{folder} holds a replication, with its own {REPORT}; give the folder of a sweep")
    with Store(folder, read_only=True) as store:
        rows = store.rows()
        if not rows:
            raise InputError(f"{folder} holds no finished run yet; give tussock sweep some time")
        shown = worst_of(rows, worst)
        steps = {key: read_steps(store.steps(key)) for key in shown}
    table = table_of(rows)
    ran = table[table["error"].isna()].reset_index(drop=True)
    if ran.empty:
        raise InputError(f"no run in {folder} could be done; the first: {table['error'].iloc[0]}")
    settings = list(SETTINGS)
    axes = axes_of(ran, settings)
    reset = bool(ran["resets"].to_numpy().any())
    measures = [name for name in MEASURES if name != "resets" or reset]
    (folder / FIGURES).mkdir(exist_ok=True)
    results = _results(table, ran, axes, settings, measures, shown)
    by = axes.get(_models(axes), [])
    exhibits = []
    for number, (name, names) in enumerate(axes.items()):
        progress(number, len(axes) + len(shown))
        lines = [] if names == by else by
        drawn = picture(along_axis(ran, names, measures, lines), folder / FIGURES, f"by-{'-'.join(names)}")
        exhibits.append({"id": f"by-{'-'.join(names)}", "name": name, "rows": _rows(results["by"][name]), **drawn})
    cases = []
    for number, key in enumerate(shown, len(axes)):
        progress(number, len(axes) + len(shown))
        cases.append(_case(key, rows[key], steps[key], folder))
    html = page(
        "sweep.html", title=_title(folder), lead="What its runs say together, and why the worst of them failed.",
        about=_about(table, ran, axes), measures=MEASURES, used=measures, exhibits=exhibits, pairs=results["pairs"], cases=cases,
        causes=results["causes"], labels=CAUSES, not_run=results["could_not_run"],
    )  # fmt: skip
    with replacing(folder / RESULTS) as partial:
        partial.write_text(json.dumps(results, indent=1) + "\n")
    with replacing(folder / REPORT) as partial:
        partial.write_text(html, encoding="utf-8")
    return results


def _results(
    table: pd.DataFrame,
    ran: pd.DataFrame,
    axes: dict[str, list[str]],
    settings: list[str],
    measures: list[str],
    shown: list[str],
) -> dict[str, Any]:
    """Everything in numbers; docs/sweeps.md explains it."""
    by = axes.get(_models(axes), [])
    failed = ran[~ran["arrived"].astype(bool) | (ran["resets"] > 0)]
    groups = failed.groupby(by, dropna=False) if by else [("all", failed)]
    not_run = table[table["error"].notna()]
    return plain({
        "version": 1, "runs": len(table), "measures": _numbers(means(ran, measures)),
        "by": {
            name: {choice: {"runs": count, **_numbers(found)} for choice, (count, found) in by_axis(ran, names, measures).items()}
            for name, names in axes.items()
        },
        "pairs": [dataclasses.asdict(pair) for pair in (pairings(ran, settings, measures, by) if by else [])],
        "causes": {
            words(key): {label: int((part["cause"] == label).sum()) for label in CAUSES} for key, part in groups
        },
        "worst": shown,
        "could_not_run": [{"command": row.command, "error": row.error} for row in not_run.itertuples()],
    })  # fmt: skip


def _models(axes: dict[str, list[str]]) -> str:
    """The axis whose choices are compared in pairs: that of models, or that of encodings where there is none."""
    return next((name for wanted in ("model", "encoding") for name, names in axes.items() if wanted in names), "")


def _numbers(found: dict[str, Interval]) -> dict[str, Any]:
    return {measure: dataclasses.asdict(interval) for measure, interval in found.items()}


def _rows(choices: dict[str, dict[str, Any]]) -> list[tuple[str, int, list[tuple]]]:
    """A row a choice: its name, how many runs, and value, low, high of each measure."""
    return [
        (name, found["runs"], [tuple(interval.values()) for measure, interval in found.items() if measure != "runs"])
        for name, found in choices.items()
    ]  # fmt: skip


def _about(table: pd.DataFrame, ran: pd.DataFrame, axes: dict[str, list[str]]) -> dict[str, Any]:
    """What was swept, in words."""
    fixed = {name: ran[name].iloc[0] for name in SETTINGS if not any(name in names for names in axes.values())}
    said = [
        f"{spoken(name)} {value}"
        for name, value in fixed.items()
        if not pd.isna(value) and value != SETTINGS[name].default
    ]
    varied = [f"{name}: {ran.groupby(names, dropna=False).ngroups}" for name, names in axes.items()]
    return {
        "Runs": f"{len(table)}, of which {len(ran)} could be done; {int(ran['arrived'].sum())} arrived",
        "Varied": "; ".join(varied) or "nothing",
        "The same in all": "; ".join(said) or "everything as by default",
    }  # fmt: skip


def _case(key: str, row: dict[str, Any], steps: pd.DataFrame, folder: Path) -> dict[str, Any]:
    """What the page shows of a walk: why it failed, the walk from above, and what was seen where it went wrong."""
    run = options_of(row)
    at = _turning_point(row, steps)
    here = np.column_stack([steps["x_m"], steps["y_m"], np.radians(steps["heading_deg"])])[[at]]
    shown = {
        "key": key, "command": row["command"], "settings": row, "words": _outcome(row), "step": at,
        "evidence": evidence_words(steps.iloc[at]),
        "recording": f"{WORST}/{key}/recording.rrd" if (folder / WORST / key / "summary.json").exists() else None,
    }  # fmt: skip
    try:
        world, route = run.open_route()
        lesson = run.prepare((world, route))
        with open_renderer(world, run.eye(), run.renderer) as renderer:
            view = renderer.render(here)[0]
            recognised = None
            if lesson.saved is None and not pd.isna(match := steps["match"].iloc[at]):
                _, learned = training_views(lesson.encoding, renderer, lesson.poses)
                recognised = renderer.render(learned[[int(match)]])[0]
    except InputError as error:
        return shown | {"nothing": str(error)}
    drawn = {
        "above": picture(walked(world, route, steps, at), folder / FIGURES, f"walk-{key}"),
        "seen": picture(seen(view, recognised), folder / FIGURES, f"view-{key}"),
    }
    return shown | drawn | {"nothing": None}


def _turning_point(row: dict[str, Any], steps: pd.DataFrame) -> int:
    """The step to look at: the last that failed for the walk's cause, else the one farthest off the route."""
    same = steps.index[steps["cause"] == row["cause"]] if row["cause"] else []
    return int(same[-1]) if len(same) else int(steps["deviation_m"].idxmax())


def evidence_words(step: pd.Series) -> str | None:
    """Why a step of a trajectory was poor, with its evidence; None for a good one."""
    known = step.dropna().to_dict()
    if "cause" not in known:
        return None
    error, turning = (float(np.radians(known[name])) for name in ("error_deg", "turning_deg"))
    nearest, recognised = known.get("nearest_view_m"), known.get("recognised_view_m")
    return in_words(
        Evidence(covered=known["covered"], nearest=nearest, recognised=recognised, error=error, turning=turning)
    )


def _outcome(row: dict[str, Any]) -> str:
    """What became of a walk."""
    end = f"{row['reason']} after {row['steps']} steps, {100 * row['mean_deviation_m']:.1f} cm off the route on average"
    return end + (f", put back {row['resets']} times" if row["resets"] else "")


def _title(folder: Path) -> str:
    return f"Sweep {folder.resolve().name}"
