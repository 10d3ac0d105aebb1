"""Claims of publications: what was published, what is obtained here, and whether the claim holds by a stated test."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import Any, NamedTuple

from .effects import MIN_UNITS, Effect
from .results import StudyResults, plain_json

Numbers = dict[str, float]  # by label; a label has the unit in parentheses


class Decision(NamedTuple):
    """The result of a claim's test on one run of a study.

    Attributes:
        obtained: The numbers that the test compares, by label.
        holds: Whether the claim holds; None where there is nothing to test, as corners on a straight route.
        effect: How large what the claim is about is, where that is a number with an interval.
        reason: Why it was not tested, as a sentence without its full stop.
    """

    obtained: Numbers
    holds: bool | None
    effect: Effect | None = None
    reason: str = ""


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
        not_quick: Why a quick run of the study cannot test it, as a sentence without its full stop; empty where it can.
    """

    key: str
    statement: str
    figure: str
    test: str
    decide: Callable[[StudyResults], Decision]
    published: Numbers | Callable[[StudyResults], Numbers] = field(default_factory=dict)
    note: str = ""
    not_quick: str = ""

    def published_for(self, results: StudyResults) -> Numbers:
        """The published numbers for what a study ran, by label."""
        return self.published(results) if callable(self.published) else self.published


def claim(key: str, figure: str, test: str, **others: Any) -> Callable[[Callable[[StudyResults], Decision]], Claim]:
    """Decorator: turns a function that does a claim's test into the claim. The function's docstring is the statement.

    Args:
        key: See `Claim`.
        figure: See `Claim`.
        test: See `Claim`.
        others: `published`, `note` and `not_quick`, where there are any.
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
        effects: The effect in each run; None where it has none.
        reasons: Why each run could not test it; empty where it could.
    """

    claim: Claim
    published: Numbers
    obtained: list[Numbers]
    holds: list[bool | None]
    effects: list[Effect | None]
    reasons: list[str]

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
    def reason(self) -> str:
        """Why it was not tested; empty where it was."""
        return (
            "" if any(each is not None for each in self.holds) else "; ".join(dict.fromkeys(filter(None, self.reasons)))
        )

    @property
    def known_effects(self) -> list[Effect]:
        """The effects in the runs that have one."""
        return [each for each in self.effects if each is not None]

    @property
    def evidence(self) -> dict[str, Any]:
        """The effects, and why it was not tested, as results.json holds them."""
        return {"effects": [each and asdict(each) for each in self.effects], "reason": self.reason}

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


def check_claims(
    claims: Sequence[Claim], runs: Sequence[StudyResults], *, quick: bool = False, few_units: bool = True
) -> list[Outcome]:
    """Test claims on the results of a study's runs.

    Args:
        claims: The claims.
        runs: The results of each run. The published numbers are those for the first one.
        quick: These are quick runs. Claims that these cannot test are not tested.
        few_units: Also test claims with an effect on fewer than MIN_UNITS units.

    Returns:
        The outcome of each claim.
    """
    return [_check(claim, runs, quick=quick, few_units=few_units) for claim in claims]


def _check(claim: Claim, runs: Sequence[StudyResults], *, quick: bool, few_units: bool) -> Outcome:
    decisions = [claim.decide(results) for results in runs]
    if not few_units:
        decisions = [_without_few_units(each) for each in decisions]
    if quick and claim.not_quick:
        decisions = [Decision(each.obtained, None, reason=claim.not_quick) for each in decisions]
    return Outcome(
        claim=claim,
        published=claim.published_for(runs[0]),
        obtained=[each.obtained for each in decisions],
        holds=[plain_json(each.holds) for each in decisions],
        effects=[each.effect for each in decisions],
        reasons=[each.reason for each in decisions],
    )


def _without_few_units(decision: Decision) -> Decision:
    """A decision that is not made where its effect was measured on too few units."""
    effect = decision.effect
    if effect is None or effect.units >= MIN_UNITS or decision.holds is None:
        return decision
    return decision._replace(holds=None, reason=f"{effect.units} {effect.of}; the test needs {MIN_UNITS}")


def count_outcomes(outcomes: Sequence[Outcome]) -> str:
    """How many claims hold, as in "16 of 22 claims hold, 4 do not, 2 not tested"; over several runs, in how many of them."""
    styles, runs = Counter(each.style for each in outcomes), max(len(each.holds) for each in outcomes)
    if styles["untested"] == len(outcomes):
        return f"none of {len(outcomes)} claims was tested"
    verb = "holds" if styles["yes"] == 1 else "hold"
    if runs > 1:
        ends = {"yes": f" of {len(outcomes)} claims {verb} in all {runs} runs", "partly": " in some", "no": " in none"}
    else:
        ends = {"yes": f" of {len(outcomes)} claims {verb}", "no": " does not" if styles["no"] == 1 else " do not"}
    ends["untested"] = " not tested"
    return ", ".join(f"{styles[style]}{end}" for style, end in ends.items() if styles[style] or style == "yes")


def _spread(values: list[float]) -> Spread:
    numbers = [float(value) for value in values if math.isfinite(value)]
    return Spread(median(numbers), min(numbers), max(numbers)) if numbers else Spread(math.nan, math.nan, math.nan)
