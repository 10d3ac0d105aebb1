"""The report of a replication: figures, results.json, and one HTML page that holds everything."""

import json
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from ...reports.findings import Claim, Findings, plain
from ...reports.page import cell, page, picture
from . import published
from .figures import PICTURES, Picture
from .material import Material
from .tables import LISTINGS, Listing
from .thesis import STUDIES

REPORT, RESULTS, FIGURES = "report.html", "results.json", "figures"
Runs = dict[int, dict[str, Findings]]  # findings of each study, by seed


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """A claim over all seeds. obtained: median, lowest and highest of each number. holds: for each seed."""

    claim: Claim
    obtained: dict[str, tuple[float, float, float]]
    holds: list[bool | None]

    @property
    def words(self) -> str:
        """Whether it holds, as people say it."""
        tested = [each for each in self.holds if each is not None]
        held, of = sum(tested), len(tested)
        if of == 0:
            return "not tested"
        if len(self.holds) == 1:
            return "holds" if held else "does not hold"
        return f"holds in {held or 'none'} of {of}"

    @property
    def colour(self) -> str:
        tested = [each for each in self.holds if each is not None]
        return "untested" if not tested else "yes" if all(tested) else "partly" if any(tested) else "no"


def verdicts(runs: Runs) -> list[Verdict]:
    """The claims of all studies, over all seeds."""
    first, *_ = runs.values()
    found = []
    for name, findings in first.items():
        for k, claim in enumerate(findings.claims):
            claims = [run[name].claims[k] for run in runs.values()]
            obtained = {label: _spread([each.obtained.get(label) for each in claims]) for label in claim.obtained}
            found.append(Verdict(claim=claim, obtained=obtained, holds=[each.holds for each in claims]))
    return found


def _spread(values: list[float | None]) -> tuple[float, float, float]:
    """Median, lowest and highest of the numbers there are."""
    numbers = [value for value in values if value is not None]
    return (median(numbers), min(numbers), max(numbers)) if numbers else (float("nan"),) * 3


def check_report_folder(out: Path, about: dict[str, Any], *, overwrite: bool = False) -> None:
    """Refuse, before long work, a folder that holds a report of something else. Raises InputError."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder for the report")
    results = out / RESULTS
    if overwrite or not (results.exists() or (out / REPORT).exists()):
        return
    try:
        before = json.loads(results.read_text(encoding="utf-8"))["about"]
    except (OSError, ValueError, KeyError, TypeError):
        before = {}
    different = [key for key in {**before, **about} if before.get(key) != plain(about.get(key))]
    if different:
        raise InputError(
            f"{out} holds a report of something else ({', '.join(different)}); give another --out, or --overwrite to replace it"
        )


def write_report(
    out: Path, runs: Runs, material: Material, *, about: dict[str, Any], command: str, title: str,
    only: str | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Write figures (PNG and SVG), results.json and report.html; figures and tables are of the first seed.

    material: of the first seed. about: what was studied, for the head of the report. command: how a study is done alone, with {study}
    and {figure} in it. only: number of the one figure or table to make. Returns results.json's content.
    """
    first, *_ = runs.values()
    exhibits = exhibits_of(first, only)
    (out / FIGURES).mkdir(parents=True, exist_ok=True)
    judged = verdicts(runs)
    results = _results(runs, judged, about)
    parts = [
        {"name": name, "title": STUDIES[name].title, "exhibits": [
            _exhibit(each, first[name], material, out / FIGURES, judged, command) for each in exhibits if each.study == name
        ]} for name in first
    ]  # fmt: skip
    page = _page(parts, judged if only is None else [], runs, about, title)
    with replacing(out / RESULTS) as partial:
        partial.write_text(json.dumps(results, indent=1) + "\n")
    with replacing(out / REPORT) as partial:  # last: a folder with a report holds everything
        partial.write_text(page, encoding="utf-8")
    return results


def exhibits_of(studies: Collection[str], only: str | None = None) -> list[Picture | Listing]:
    """The figures and tables of studies, or the one that is called `only`. Raises InputError where there is none."""
    every = [each for each in (*PICTURES, *LISTINGS) if each.study in studies]
    chosen = [each for each in every if only in (None, *_numbers(each))]
    if not chosen:
        known = ", ".join(number for each in every for number in each.number.split(", "))
        raise InputError(f"there is no figure {only!r} in this study; it has {known}")
    return chosen


def _numbers(exhibit: Picture | Listing) -> list[str]:
    """The numbers that a person may call a figure by: 7, 8 or both."""
    return [exhibit.number, *exhibit.number.split(", ")]


def _name(exhibit: Picture | Listing) -> str:
    """Stable, as files and anchors are called."""
    kind = "figure" if isinstance(exhibit, Picture) else "table"
    return f"{kind}-{exhibit.number.replace(', ', '-').replace('.', '-').replace(' ', '-')}"


def _exhibit(
    each: Picture | Listing, findings: Findings, material: Material, folder: Path, judged: list[Verdict], command: str,
) -> dict[str, Any]:  # fmt: skip
    """What the page shows of a figure or table."""
    thesis = each.number[0].isdigit()
    shown = {
        "name": _name(each), "title": each.title, "command": command.format(study=each.study, figure=f"'{each.number}'", name=_name(each)),
        "heading": ("Figure " if isinstance(each, Picture) else "Table ") + each.number if thesis else "Beyond the figures",
        "claims": [_shown(verdict) for verdict in judged if _exhibit_of(verdict) is each],
    }  # fmt: skip
    if isinstance(each, Picture):
        return shown | {"caption": each.caption.format(**findings.numbers)} | _draw(each, findings, material, folder)
    rows = each.rows(findings)
    columns = [column.rstrip() for column in rows.columns]
    return shown | {
        "caption": each.caption,
        "columns": columns,
        "rows": [[cell(plain(value)) for value in row] for row in rows.to_numpy(dtype=object)],
    }


def _exhibit_of(verdict: Verdict) -> Picture | Listing:
    return next(each for each in (*PICTURES, *LISTINGS) if verdict.claim.figure in _numbers(each))


def _draw(each: Picture, findings: Findings, material: Material, folder: Path) -> dict[str, Any]:
    """Draw a figure into its files; give the PNG for the page."""
    return picture(each.draw(findings, material), folder, _name(each))


def _shown(verdict: Verdict) -> dict[str, Any]:
    """What the page shows of a claim: a row of numbers for each label, published and obtained."""
    claim = verdict.claim
    labels = list(dict.fromkeys([*claim.obtained, *claim.published]))
    numbers = [(label, claim.published.get(label), verdict.obtained.get(label)) for label in labels]
    return {
        "claim": claim,
        "numbers": numbers,
        "words": verdict.words,
        "colour": verdict.colour,
        "link": _name(_exhibit_of(verdict)),
    }


def _results(runs: Runs, judged: list[Verdict], about: dict[str, Any]) -> dict[str, Any]:
    """Everything in numbers; docs/report.md explains it."""
    claims = {}
    for verdict in judged:
        kept = {key: getattr(verdict.claim, key) for key in ("statement", "figure", "test", "note", "published")}
        spreads = {
            label: {"median": middle, "lowest": low, "highest": high}
            for label, (middle, low, high) in verdict.obtained.items()
        }
        claims[verdict.claim.key] = kept | {"obtained": spreads, "holds": verdict.holds}
    seeds = {
        str(seed): {name: _results_of(name, findings) for name, findings in run.items()} for seed, run in runs.items()
    }
    return plain({"version": 1, "about": about, "claims": claims, "seeds": seeds})


def _results_of(name: str, findings: Findings) -> dict[str, Any]:
    return {
        "published": {claim.key: claim.published for claim in findings.claims} | PUBLISHED.get(name, {}),
        "obtained": {claim.key: claim.obtained for claim in findings.claims} | findings.numbers,
        "holds": {claim.key: claim.holds for claim in findings.claims},
        "tables": findings.to_json()["tables"],
    }


PUBLISHED: dict[str, dict[str, Any]] = {  # what the thesis gives beside its claims
    "setting": {"grid_views": published.GRID_VIEWS},
    "resolution": {"factors": published.FACTORS, "sampled": published.RESIZED, "sampled, smoothed": published.RESIZED_SMOOTHED},
    "classifier": {
        f"tuning_{part}": published.BEST_TUNINGS[part][2] for part in ("first_20", "whole_route")
    } | {f"validation_score_{part}": published.BEST_TUNINGS[part][0] for part in ("first_20", "whole_route")},
    "corners": {"tuning": published.BEST_TUNINGS["more_in_corners"][2]},
}  # fmt: skip


def _page(parts: list[dict], judged: list[Verdict], runs: Runs, about: dict[str, Any], title: str) -> str:
    lead = (
        "Every figure and table of the study, done again: the published number, the one found here, and what follows."
    )
    claims = [_shown(verdict) for verdict in judged]
    return page("thesis.html", title=title, lead=lead, about=about, claims=claims, parts=parts, seeds=list(runs))
