"""The report of a replication of the thesis."""

from collections.abc import Callable, Collection
from itertools import chain
from pathlib import Path
from typing import Any

from tussock.world.errors import SettingError

from ...reports.claims import Outcome, check_claims, count_outcomes
from ...reports.report import Block, ClaimBox, ClaimTable, Command, Drawing, Report, Section, Table, Text, write_report
from ...reports.results import StudyResults
from . import published
from .figures import FIGURES
from .items import Item
from .studies import STUDIES
from .study_data import StudyData
from .tables import TABLES

ITEMS = (*FIGURES, *TABLES)
Runs = dict[int, dict[str, StudyResults]]  # results of each study, by seed

LEAD = "Every figure and table of the thesis, made again, with the published and the obtained numbers."
SUMMARY = (
    "Each claim of the thesis, the published and the obtained numbers, and whether the claim holds by the test named. "
    "No parameter was tuned to make a claim hold."
)
FOOTER = (
    "After S. Athanasoulias, Autonomous Visual Navigation: a biologically inspired approach, University of Sussex. "
    "Figures 1 to 3 are from other authors and figure 20 is a sketch of the loop of tussock run; they are not repeated. "
    "All numbers are in results.json."
)

# Published numbers of the studies that belong to no claim.
TUNED_PARTS = ("first_20", "whole_route")
PUBLISHED: dict[str, dict[str, Any]] = {
    "setting": {"grid_views": published.GRID_VIEWS},
    "resolution": {
        "factors": published.FACTORS,
        "sampled": published.RESIZED,
        "sampled, smoothed": published.RESIZED_SMOOTHED,
    },
    "classifier": {f"tuning_{part}": published.BEST_TUNINGS[part][2] for part in TUNED_PARTS}
    | {f"validation_score_{part}": published.BEST_TUNINGS[part][0] for part in TUNED_PARTS},
    "corners": {"tuning": published.BEST_TUNINGS["more_in_corners"][2]},
}


def outcomes_of(runs: Runs, *, quick: bool) -> dict[str, list[Outcome]]:
    """The outcomes of each study's claims over all seeds."""
    first, *_ = runs.values()
    return {
        name: check_claims(STUDIES[name].claims, [run[name] for run in runs.values()], quick=quick) for name in first
    }


def items_of(studies: Collection[str], only: str | None = None) -> list[Item]:
    """The figures and tables of studies.

    Args:
        studies: Names of the studies.
        only: Number of the one figure or table to take; None means all.

    Returns:
        The items, figures before tables.

    Raises:
        SettingError: There is none with this number.
    """
    items = [item for item in ITEMS if item.study in studies]
    chosen = [item for item in items if only is None or only in item.numbers]
    if not chosen:
        known = ", ".join(number for item in items for number in item.number.split(", "))
        raise SettingError(f"there is no figure {only!r} in this study; it has {known}")
    return chosen


def write_thesis_report(
    folder: Path,
    runs: Runs,
    data: StudyData,
    *,
    about: dict[str, Any],
    command: Callable[[Item], str],
    title: str,
    only: str | None = None,
    quick: bool = False,
) -> dict[str, list[Outcome]]:
    """Write the report of a replication. Its figures and tables are those of the first seed.

    Args:
        folder: Folder to write to.
        runs: The results of the studies.
        data: The views of the first seed.
        about: What was studied, for the head of the report.
        command: Gives the command line that makes one figure or table alone.
        title: Title of the report.
        only: Number of the one figure or table to make.
        quick: The studies were done as a first look, which cannot test all claims.

    Returns:
        The outcomes of each study's claims.
    """
    first, *_ = runs.values()
    outcomes = outcomes_of(runs, quick=quick)
    items = items_of(first, only)
    all_outcomes = list(chain.from_iterable(outcomes.values()))
    blocks: list[Block] = []
    if only is None and all_outcomes:
        blocks.append(_summary(all_outcomes, seeds=len(runs)))
    for name in first:
        sections = [
            _section(item, first[name], data, outcomes[name], command(item)) for item in items if item.study == name
        ]
        blocks.append(Section(title=STUDIES[name].title, anchor=name, blocks=sections))
    report = Report(
        title=title,
        lead=LEAD,
        about=about,
        blocks=blocks,
        footer=FOOTER,
        results=_results(runs, outcomes, about),
        headline=f"{count_outcomes(all_outcomes)}." if all_outcomes else "",
    )
    write_report(report, folder)
    return outcomes


def _summary(outcomes: list[Outcome], seeds: int) -> Section:
    """All claims with their numbers and links to their figures."""
    text = SUMMARY
    if seeds > 1:
        text += f" Obtained numbers are the median over {seeds} seeds, with the lowest and the highest in parentheses."
    links = {}
    for outcome in outcomes:
        item = _item_of(outcome)
        links[outcome.claim.key] = (item.name, item.label.replace(item.number, outcome.claim.figure))
    table = ClaimTable(outcomes=outcomes, links=links)
    return Section(title="Does it hold?", anchor="summary", blocks=[Text(text), table])


def _item_of(outcome: Outcome) -> Item:
    """The figure or table that shows a claim."""
    return next(item for item in ITEMS if outcome.claim.figure in item.numbers)


def _section(item: Item, results: StudyResults, data: StudyData, outcomes: list[Outcome], command: str) -> Section:
    """A figure or table with its claims and its command."""
    if item.draw is not None:
        draw = item.draw
        caption = item.caption.format(**results.numbers)
        shown = Drawing(names=(item.name,), draw=lambda: [draw(results, data)], alt=item.title, caption=caption)
    else:
        assert item.rows is not None
        shown = Table.of(item.rows(results), item.caption)
    claims = [ClaimBox(outcome) for outcome in outcomes if _item_of(outcome) is item]
    return Section(title=f"{item.label}: {item.title}", anchor=item.name, blocks=[shown, *claims, Command(command)])


def _results(runs: Runs, outcomes: dict[str, list[Outcome]], about: dict[str, Any]) -> dict[str, Any]:
    """Everything in numbers; docs/report.md explains it."""
    claims = {}
    for outcome in chain.from_iterable(outcomes.values()):
        spreads = {label: spread._asdict() for label, spread in outcome.spreads.items()}
        judged = {"obtained": spreads, "holds": outcome.holds} | outcome.evidence
        claims[outcome.claim.key] = outcome.description | judged
    seeds = {
        str(seed): {name: _results_of(name, run[name], outcomes[name], k) for name in run}
        for k, (seed, run) in enumerate(runs.items())
    }
    return {"version": 1, "about": about, "claims": claims, "seeds": seeds}


def _results_of(name: str, results: StudyResults, outcomes: list[Outcome], run: int) -> dict[str, Any]:
    """The results of a study with one seed. outcomes: of its claims; run: number of this seed in them."""
    claims = {each.claim.key: each for each in outcomes}
    return {
        "published": {key: each.claim.published_for(results) for key, each in claims.items()} | PUBLISHED.get(name, {}),
        "obtained": {key: each.obtained[run] for key, each in claims.items()} | results.numbers,
        "holds": {key: each.holds[run] for key, each in claims.items()},
        "tables": results.to_json()["tables"],
    }
