"""Claims of publications: what was published, what is obtained here, and whether the claim holds by a stated test."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any, NamedTuple

from .results import StudyResults, plain_json

Numbers = dict[str, float]  # by label; a label has the unit in parentheses


class Decision(NamedTuple):
    """The result of a claim's test on one run of a study.

    Attributes:
        obtained: The numbers that the test compares, by label.
        holds: Whether the claim holds; None where there is nothing to test, as corners on a straight route.
    """

    obtained: Numbers
    holds: bool | None


class Spread(NamedTuple):
    """Median, lowest and highest of a number over several runs; nan where no run has the number."""

    median: float
    lowest: float
    highest: float


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of a publication.

    Attributes:
        key: Stable name, as in results.json.
        statement: The claim in a sentence.
        figure: Number or name of the figure or table that shows it.
        test: When the claim holds, in words.
        decide: Does this test on the results of a study.
        published: The published numbers by label; or a function that gives them, where they depend on what the study ran.
        note: What else a reader must know.
    """

    key: str
    statement: str
    figure: str
    test: str
    decide: Callable[[StudyResults], Decision]
    published: Numbers | Callable[[StudyResults], Numbers] = field(default_factory=dict)
    note: str = ""


def claim(key: str, figure: str, test: str, **others: Any) -> Callable[[Callable[[StudyResults], Decision]], Claim]:
    """Decorator: turns a function that does a claim's test into the claim. The function's docstring is the statement.

    Args:
        key: See `Claim`.
        figure: See `Claim`.
        test: See `Claim`.
        others: `published` and `note`, where there are any.
    """

    def made(decide: Callable[[StudyResults], Decision]) -> Claim:
        statement = " ".join((decide.__doc__ or "").split())
        return Claim(key=key, statement=statement, figure=figure, test=test, decide=decide, **others)

    return made


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A claim and the results of its test, one for each run of the study. Runs differ in their seeds.

    Attributes:
        claim: The claim.
        published: Its published numbers, by label.
        obtained: The numbers of each run, by label.
        holds: Whether the claim holds in each run; None where it was not tested.
    """

    claim: Claim
    published: Numbers
    obtained: list[Numbers]
    holds: list[bool | None]

    @property
    def label(self) -> str:
        """Whether the claim holds, as a report shows it."""
        tested = [each for each in self.holds if each is not None]
        if not tested:
            return "not tested"
        if len(self.holds) == 1:
            return "holds" if tested[0] else "does not hold"
        return f"holds in {sum(tested) or 'none'} of {len(tested)}"

    @property
    def style(self) -> str:
        """Name of the page's style for the label."""
        tested = [each for each in self.holds if each is not None]
        return "untested" if not tested else "yes" if all(tested) else "partly" if any(tested) else "no"

    @property
    def spreads(self) -> dict[str, Spread]:
        """Each obtained number over all runs, by label."""
        return {label: _spread([run.get(label, math.nan) for run in self.obtained]) for label in self.obtained[0]}

    @property
    def rows(self) -> list[tuple[str, float | None, Spread | None]]:
        """Label, published number and obtained numbers, a row for each label."""
        spreads = self.spreads
        return [
            (label, self.published.get(label), spreads.get(label))
            for label in dict.fromkeys([*spreads, *self.published])
        ]

    @property
    def description(self) -> dict[str, Any]:
        """The claim itself, as results.json holds it."""
        texts = {name: getattr(self.claim, name) for name in ("statement", "figure", "test", "note")}
        return texts | {"published": self.published}


def check_claims(claims: Sequence[Claim], runs: Sequence[StudyResults]) -> list[Outcome]:
    """Test claims on the results of a study's runs. The published numbers are those for the first run."""
    return [_check(claim, runs) for claim in claims]


def _check(claim: Claim, runs: Sequence[StudyResults]) -> Outcome:
    decisions = [claim.decide(results) for results in runs]
    return Outcome(
        claim=claim,
        published=claim.published(runs[0]) if callable(claim.published) else claim.published,
        obtained=[each.obtained for each in decisions],
        holds=[plain_json(each.holds) for each in decisions],
    )


def _spread(values: list[float]) -> Spread:
    numbers = [float(value) for value in values if math.isfinite(value)]
    return Spread(median(numbers), min(numbers), max(numbers)) if numbers else Spread(math.nan, math.nan, math.nan)
