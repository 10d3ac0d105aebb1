"""What came of an entry: a line a run, the numbers that follow from them, and its file."""

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from ..cli.run_options import RunOptions
from ..stopping import NUMBER
from ..sweeps.statistics import mean_interval
from .definition import BENCHMARKS, Benchmark

Kinds = Mapping[str, Any]  # what values may be, by their names
HEAD: Kinds = {
    "benchmark": str, "entry": str, "encoding": str, "tussock": str, "runs": list, "memory_bytes": int | None, "times": dict,
}  # fmt: skip
# Of a run: what was asked, which tells the runs of an entry apart, and what was found.
ASKED: Kinds = {"world": str, "seed": int, "heading_noise_deg": NUMBER, "offset_m": NUMBER}
FOUND: Kinds = {
    "arrived": bool, "reason": str | None, "steps": int | None, "mean_deviation_m": NUMBER | None,
    "max_deviation_m": NUMBER | None, "poor_steps": int | None, "cause": str | None, "error": str | None,
}  # fmt: skip
TIMES = ("learn_seconds", "walk_seconds")
RESULTS = "results"  # the folder of the results, beside the runs, which are a sweep's with files of its own
LARGEST = 2**63  # numbers of a result are smaller

Line = dict[str, Any]  # of a run: ASKED and FOUND by name; None for what is not known


@dataclass(frozen=True, kw_only=True)
class Result:
    """What came of an entry.

    entry: its name; for a model of this project its spelling. encoding: of what it saw. runs: a line each. memory_bytes: the most that it
    had learned in a world, None where that is not known. tussock: the version that walked. times: the means of TIMES, which no two
    results have alike.
    """

    benchmark: str
    entry: str
    encoding: str
    tussock: str
    runs: Sequence[Line]
    memory_bytes: int | None
    times: Mapping[str, float]

    def scores(self) -> dict[str, Any]:
        """The numbers of all runs, and of those of each displacement, noise and preset."""
        totals = score(self.runs)
        totals["arrived_share_95"] = interval_over_worlds(self.runs)
        failed = [run for run in self.runs if not run["arrived"]]
        poor = [run["poor_steps"] for run in self.runs if run["poor_steps"] is not None]
        totals |= {
            "reasons": _counted(run["reason"] for run in failed), "causes": _counted(run["cause"] for run in failed),
            "could_not_run": sum(run["error"] is not None for run in self.runs), "poor_steps": sum(poor) if poor else None,
        }  # fmt: skip
        parts = {"by_displacement_m": "offset_m", "by_noise_deg": "heading_noise_deg", "by_preset": "world"}
        return {"totals": totals} | {name: self._by(key) for name, key in parts.items()}

    def _by(self, key: str) -> dict[str, Any]:
        values = dict.fromkeys(run[key] for run in self.runs)
        return {
            value if isinstance(value, str) else f"{value:g}": score([run for run in self.runs if run[key] == value])
            for value in values
        }

    def to_json(self) -> str:
        """As its file has it: a line a run, at the end."""
        said = {"benchmark": self.benchmark, "entry": self.entry, "encoding": self.encoding, "tussock": self.tussock}
        said |= self.scores() | {"memory_bytes": self.memory_bytes, "times": dict(self.times)}
        lines = ",\n".join(f"  {json.dumps(run)}" for run in self.runs)
        return f'{json.dumps(said, indent=1)[:-2]},\n "runs": [\n{lines}\n ]\n}}\n'


def score(runs: Sequence[Line]) -> dict[str, Any]:
    """How many runs there are and how many arrive, and how far off the route those are on average (m; None where none arrives)."""
    arrived = [run for run in runs if run["arrived"]]
    deviation = float(np.mean([run["mean_deviation_m"] for run in arrived])) if arrived else None
    return {
        "runs": len(runs),
        "arrived": len(arrived),
        "arrived_share": len(arrived) / len(runs),
        "mean_deviation_m": deviation,
    }


def interval_over_worlds(runs: Sequence[Line]) -> list[float]:
    """Between which shares of arrivals 95 of 100 sets of as many worlds would lie, drawn with replacement from these."""
    worlds = {world: number for number, world in enumerate(dict.fromkeys((run["world"], run["seed"]) for run in runs))}
    groups = np.array([worlds[run["world"], run["seed"]] for run in runs])
    found = mean_interval(np.array([float(run["arrived"]) for run in runs]), groups)
    return [round(found.low, 9), round(found.high, 9)]


def line_of(run: RunOptions, found: Mapping[str, Any]) -> Line:
    """The line of a run, of what was found by name. Who could not run has not arrived."""
    line = {name: getattr(run, name) for name in ASKED} | {name: found.get(name) for name in FOUND}
    return line | {"arrived": bool(found.get("arrived"))}


def result_of(
    benchmark: Benchmark, entry: str, encoding: str, runs: Sequence[Line], *, memory_bytes: Sequence[int | None],
    learn_seconds: Sequence[float], walk_seconds: Sequence[float],
) -> Result:  # fmt: skip
    """What came of an entry, from what came of its runs."""
    known = [size for size in memory_bytes if size is not None]
    times = {
        name: float(np.mean(given))
        for name, given in zip(TIMES, (learn_seconds, walk_seconds), strict=True)
        if len(given)
    }
    return Result(
        benchmark=benchmark.name, entry=entry, encoding=encoding, tussock=version("tussock"), runs=runs,
        memory_bytes=max(known, default=None), times=times,
    )  # fmt: skip


def file_of(out: Path, benchmark: Benchmark, entry: str, encoding: str) -> Path:
    """Where the result of an entry is kept. Raises InputError for a name of which no file can be named."""
    words = [entry] if encoding == benchmark.chain() else [entry, encoding]
    parts = [re.sub(r"[^a-z0-9.]+", "-", word.lower()).strip("-.") for word in words]
    if not (all(parts) and entry.isprintable()):
        raise InputError(f"entry {entry!r}: give a name of one line with letters in it")
    return out / RESULTS / f"{'-'.join(parts)}.json"


def check_free(out: Path, benchmark: Benchmark, entry: str, encoding: str) -> Path:
    """Where a result may be written: nowhere yet, or over one of the same entry. Makes the folder.

    Raises InputError for another's, and where there are results that this one would not compare with.
    """
    path = file_of(out, benchmark, entry, encoding)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path.parent} cannot be written ({error.strerror}); give another --out") from error
    for other in sorted(path.parent.glob("*.json")):
        there = read_result(other)
        mine = (there.entry, there.encoding) == (entry, encoding)
        if there.benchmark != benchmark.name or (other == path and not mine):
            raise InputError(
                f"{other} holds a result of {there.benchmark} ({there.entry}, {there.encoding}), and this would be one of "
                f"{benchmark.name} ({entry}, {encoding}); give another --out"
            )
    return path


def write_result(result: Result, out: Path, benchmark: Benchmark) -> Path:
    """Write the file of a result, replacing one of the same entry; returns its path."""
    path = check_free(out, benchmark, result.entry, result.encoding)
    with replacing(path) as partial:
        partial.write_text(result.to_json(), encoding="utf-8", newline="")
    return path


def read_result(path: Path, known: Mapping[str, Benchmark] = BENCHMARKS) -> Result:
    """Read a result. Raises InputError for what is none, and for one whose runs are not those of its benchmark, where it is known."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        _check_kinds(said, HEAD)
        _check_kinds(said["times"], dict.fromkeys(said["times"], NUMBER))
        for run in said["runs"]:
            _check_kinds(run, {**ASKED, **FOUND})
        if not said["runs"]:
            raise ValueError("no runs")
        result = Result(**{name: said[name] for name in Result.__dataclass_fields__})
        scores = json.loads(json.dumps(result.scores()))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} is no result of tussock benchmark ({error!r}); make it again") from error
    if any(scores[name] != said.get(name) for name in scores):
        raise InputError(f"{path}: its totals do not follow from its runs; make it again")
    if (benchmark := known.get(result.benchmark)) is not None:
        _check_runs(path, result, benchmark)
    return result


def _check_kinds(values: Mapping[str, Any], kinds: Kinds) -> None:
    """Raises ValueError where a value is not of its kind, LookupError where it is not there."""
    for name, kind in kinds.items():
        value = values[name]
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise ValueError(f"{name} is {value!r}")
        if isinstance(value, NUMBER) and not abs(value) < LARGEST:  # nor is nan
            raise ValueError(f"{name} is {value}" if isinstance(value, float) else f"{name} is too large")
        if isinstance(value, str) and kind is str and not value.isprintable():
            raise ValueError(f"{name} {value!r} cannot be printed")


def _check_runs(path: Path, result: Result, benchmark: Benchmark) -> None:
    asked = [tuple(getattr(run, name) for name in ASKED) for runs in benchmark.by_world() for run in runs]
    if [tuple(run[name] for name in ASKED) for run in result.runs] != asked:
        raise InputError(f"{path}: its runs are not the {len(asked)} of {benchmark.name}; make it again")


def _counted(values: Iterable[str | None]) -> dict[str, int]:
    """How often each value occurs, None left out, the commonest first."""
    counts = Counter(value for value in values if value is not None)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))
