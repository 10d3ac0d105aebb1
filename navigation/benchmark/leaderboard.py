"""The leaderboard: a table of all results in a folder, the best first, and whether each is better than the next."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from jaxtyping import Int

from tussock.world.errors import FileError

from ..intervals import share_difference_interval
from ..significance import holm, sign_flip_p
from ..sweeps.tables import LEVEL, format_p
from .definition import BENCHMARKS
from .results import RESULTS, Result, arrivals, read_result


def read_results(folder: Path) -> list[Result]:
    """All results in a folder; it may be the one that tussock benchmark wrote, with the runs next to the results.

    Raises FileError where there are none, where a file is not a result, and for results that do not compare.
    """
    if (folder / RESULTS).is_dir():
        folder = folder / RESULTS
    results = [read_result(path) for path in sorted(folder.glob("*.json"))]
    if not results:
        raise FileError(f"{folder} holds no results (*.json); give the folder that tussock benchmark wrote")
    names = sorted({result.benchmark for result in results})
    if len(names) > 1:
        raise FileError(
            f"{folder} holds results of {' and '.join(names)}, which do not compare; keep each in a folder of its own"
        )
    if len({tuple(run.asked for run in result.runs) for result in results}) > 1:
        raise FileError(f"{folder} holds results of {names[0]} whose runs are not the same; make them again")
    return results


def leaderboard(results: Sequence[Result]) -> str:
    """Two tables in Markdown: the entries, most arrivals first, then the least deviation, then by name; and each against the next.

    The second has the difference of the shares that arrive with its interval over worlds, the p value of "the two are alike", and which
    entries each is better than. p values have Holm's correction for all pairs of entries.
    """
    ranked = sorted(((result.scores(), result) for result in results), key=_rank)
    tables = [_entries(ranked)]
    if len(ranked) > 1:
        tables.append(_differences([result for _, result in ranked]))
    return "\n".join(tables)


def _entries(ranked: Sequence[tuple[dict, Result]]) -> str:
    """The entries, in their order."""
    noises, presets = (list(ranked[0][0][part]) for part in ("by_noise_deg", "by_preset"))
    conditions = [name for name in ranked[0][0].get("by_condition", {}) if name]
    _, worlds = arrivals(ranked[0][1].runs)
    header = [
        "entry",
        "arrived",
        _interval_heading(worlds),
        "off the route",
        *(f"noise {noise}" for noise in noises),
        *presets,
        *conditions,
        "memory",
    ]
    rows = [
        [
            _name(result),
            _percent(scores["totals"]["arrived_share"]),
            _interval(scores["totals"]["arrived_share_95"]),
            _cm(scores["totals"]["mean_deviation_m"]),
            *(_percent(scores["by_noise_deg"][noise]["arrived_share"]) for noise in noises),
            *(_percent(scores["by_preset"][preset]["arrived_share"]) for preset in presets),
            *(_percent(scores["by_condition"][name]["arrived_share"]) for name in conditions),
            _size(result.memory_bytes),
        ]
        for scores, result in ranked
    ]
    return _table(header, rows)


def _differences(ranked: Sequence[Result]) -> str:
    """Each entry against the next one, and which others it is better than."""
    arrived = [arrivals(result.runs)[0] for result in ranked]
    _, worlds = arrivals(ranked[0].runs)
    pairs = list(combinations(range(len(ranked)), 2))
    p_values = holm([sign_flip_p(arrived[one] - arrived[other], worlds) for one, other in pairs])
    corrected = dict(zip(pairs, p_values, strict=True))
    rows = []
    for k in range(len(ranked) - 1):
        first, second = arrived[k], arrived[k + 1]
        difference = share_difference_interval(first, second, worlds)
        ends = None if np.isnan(difference.low) else [difference.low, difference.high]
        row = [_name(ranked[k]), _name(ranked[k + 1]), _percent(difference.value), _interval(ends)]
        row += [f"{int((first > second).sum())}, {int((first < second).sum())}", format_p(corrected[k, k + 1])]
        below = [_name(ranked[other]) for other in range(k + 1, len(ranked)) if corrected[k, other] < LEVEL]
        rows.append([*row, ", ".join(below)])
    columns = ["entry", "next", "difference", _interval_heading(worlds), "better, worse", "p"]
    return _table([*columns, f"better than (p under {LEVEL:g})"], rows)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _interval_heading(worlds: Int[np.ndarray, " n"]) -> str:
    """The heading of intervals, with the sample that they are from."""
    number = len(np.unique(worlds))
    return f"95 % ({len(worlds)} runs, {number} world{'s' * (number != 1)})"


def _interval(ends: Sequence[float] | None) -> str:
    return "no interval" if ends is None else " to ".join(map(_percent, ends))


def _rank(scored: tuple[dict, Result]) -> tuple:
    scores, result = scored
    deviation = scores["totals"]["mean_deviation_m"]
    return (
        -scores["totals"]["arrived_share"],
        float("inf") if deviation is None else deviation,
        result.entry,
        result.encoding,
    )


def _name(result: Result) -> str:
    """The entry, and its encoding where that is its own choice."""
    benchmark = BENCHMARKS.get(result.benchmark)
    usual = benchmark is not None and result.encoding == benchmark.chain()
    return _cell(f"`{result.entry}`" if usual else f"`{result.entry}`, `{result.encoding}`")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _cm(metres: float | None) -> str:
    return "" if metres is None else f"{100 * metres:.1f} cm"


def _size(size: int | None) -> str:
    if size is None:
        return ""
    return f"{size / 1e6:.3g} MB" if size >= 1e5 else f"{size / 1e3:.3g} kB"
