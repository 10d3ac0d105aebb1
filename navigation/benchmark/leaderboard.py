"""The leaderboard: a table of all results in a folder, the best first."""

from collections.abc import Sequence
from pathlib import Path

from tussock.world.errors import FileError

from .definition import BENCHMARKS
from .results import RESULTS, Result, read_result


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
    """A table in Markdown: most arrivals first, then the least deviation, then by name."""
    ranked = sorted(((result.scores(), result) for result in results), key=_rank)
    noises, presets = (list(ranked[0][0][part]) for part in ("by_noise_deg", "by_preset"))
    header = ["entry", "arrived", "95 %", "off the route", *(f"noise {noise}" for noise in noises), *presets, "memory"]
    rows = [
        [
            _name(result),
            _percent(scores["totals"]["arrived_share"]),
            " to ".join(_percent(end) for end in scores["totals"]["arrived_share_95"]),
            _cm(scores["totals"]["mean_deviation_m"]),
            *(_percent(scores["by_noise_deg"][noise]["arrived_share"]) for noise in noises),
            *(_percent(scores["by_preset"][preset]["arrived_share"]) for preset in presets),
            _size(result.memory_bytes),
        ]
        for scores, result in ranked
    ]
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


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
