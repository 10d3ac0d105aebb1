"""The result of an entry: a line for each run, the numbers that follow from these, and its file."""

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import attrs
import llvmlite.binding
import numpy as np
from jaxtyping import Float, Int

from tussock.world.atomic import replacing
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.settings import number, settings, switch, text, whole

from ..encoding import Encoding
from ..intervals import share_interval
from .definition import BENCHMARKS, Asked, Benchmark

PANORAMA = "panorama"  # the encoding of entries that get the view as it is
TIMES = {
    "learn_seconds": "learn_seconds",
    "walk_seconds": "seconds",
}  # of a result, and of a run in the table of a sweep
RESULTS = "results"  # the folder of the results, next to the runs, which are a sweep's with files of its own
LIMIT = 2**63  # numbers of a result are smaller
RUN_FIELDS = Asked._fields  # of a line: what distinguishes the runs of an entry


@settings
class Line:
    """A run: what was asked, and its results; None for what is not known.

    Attributes:
        condition: Name of the condition; empty for none.
        world: Preset of the world, and its parameters.
        seed: Of the world, the route, the model and the noise.
        heading_noise_deg: Of the noise on every turn (standard deviation, degrees).
        offset_m: Displacement of the start (m, to the left).
        arrived: Whether the agent arrived; one that could not run did not.
        reason: Why the walk ended.
        steps: Number of steps.
        mean_deviation_m: Mean distance from the route (m).
        max_deviation_m: Greatest distance from the route (m).
        poor_steps: Number of poor steps.
        cause: Why it failed.
        error: Why the run could not be done.
    """

    condition: str = text("")
    world: str = text()
    seed: int = whole(low=0)
    heading_noise_deg: float = number(low=-LIMIT, high=LIMIT)
    offset_m: float = number(low=-LIMIT, high=LIMIT)
    arrived: bool = switch(False)
    reason: str | None = text(None, optional=True)
    steps: int | None = whole(None, low=0, optional=True)
    mean_deviation_m: float | None = number(None, low=-LIMIT, high=LIMIT, optional=True)
    max_deviation_m: float | None = number(None, low=-LIMIT, high=LIMIT, optional=True)
    poor_steps: int | None = whole(None, low=0, optional=True)
    cause: str | None = text(None, optional=True)
    error: str | None = text(None, optional=True)

    @property
    def asked(self) -> Asked:
        """What was asked."""
        return Asked(*(getattr(self, name) for name in RUN_FIELDS))

    @property
    def preset(self) -> str:
        """Preset of the world."""
        return self.world.split()[0]

    def to_json(self) -> dict[str, Any]:
        """Its values by name; without a condition, where there is none."""
        return {name: value for name, value in attrs.asdict(self).items() if name != "condition" or value}


@settings
class Result:
    """The result of an entry.

    Attributes:
        benchmark: Name of what was asked.
        entry: Its name; for a model with a name its spec.
        encoding: Of the views that it got.
        tussock: The version that walked.
        processor: On which it walked, as LLVM names it. On another, learned networks may take other steps.
        runs: A line for each.
        memory_bytes: The most that it had learned in a world; None where that is not known.
        times: The means of TIMES, which differ from result to result.
    """

    benchmark: str = text()
    entry: str = text()
    encoding: str = text()
    tussock: str = text()
    processor: str = text()
    runs: Sequence[Line] = attrs.field()
    memory_bytes: int | None = whole(None, low=0, optional=True)
    times: Mapping[str, float] = attrs.field()

    def scores(self) -> dict[str, Any]:
        """The numbers of all runs, and of those of each displacement, noise, preset and condition.

        Displacements, noises and presets are compared over the runs without a condition.
        """
        totals = score(self.runs)
        totals["arrived_share_95"] = interval_over_worlds(self.runs)
        failed = [run for run in self.runs if not run.arrived]
        poor = [run.poor_steps for run in self.runs if run.poor_steps is not None]
        totals |= {
            "reasons": _counts(run.reason for run in failed),
            "causes": _counts(run.cause for run in failed),
            "could_not_run": sum(run.error is not None for run in self.runs),
            "poor_steps": sum(poor) if poor else None,
        }
        parts = {"by_displacement_m": "offset_m", "by_noise_deg": "heading_noise_deg", "by_preset": "preset"}
        usual = [run for run in self.runs if not run.condition]
        scores = {"totals": totals} | {name: _by(key, usual) for name, key in parts.items()}
        return scores | ({} if len(usual) == len(self.runs) else {"by_condition": _by("condition", self.runs)})

    def to_json(self) -> str:
        """The text of its file: the runs at the end, one in each line."""
        head = {name: getattr(self, name) for name in ("benchmark", "entry", "encoding", "tussock", "processor")}
        head |= self.scores() | {"memory_bytes": self.memory_bytes, "times": dict(self.times)}
        lines = ",\n".join(f"  {json.dumps(run.to_json())}" for run in self.runs)
        return f'{json.dumps(head, indent=1)[:-2]},\n "runs": [\n{lines}\n ]\n}}\n'


def _by(key: str, runs: Sequence[Line]) -> dict[str, Any]:
    """The numbers of runs by the values of a field."""
    values = dict.fromkeys(getattr(run, key) for run in runs)
    return {
        value if isinstance(value, str) else f"{value:g}": score([run for run in runs if getattr(run, key) == value])
        for value in values
    }


def score(runs: Sequence[Line]) -> dict[str, Any]:
    """How many runs there are, how many arrive, and the mean deviation of those (m; None where none arrives)."""
    deviations = [run.mean_deviation_m or 0.0 for run in runs if run.arrived]
    return {
        "runs": len(runs),
        "arrived": len(deviations),
        "arrived_share": len(deviations) / len(runs),
        "mean_deviation_m": float(np.mean(deviations)) if deviations else None,
    }


def interval_over_worlds(runs: Sequence[Line]) -> list[float] | None:
    """The 95 % interval of the share that arrives, over worlds; None where there are too few of these."""
    interval = share_interval(*arrivals(runs))
    return None if np.isnan(interval.low) else [round(interval.low, 9), round(interval.high, 9)]


def arrivals(runs: Sequence[Line]) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Which runs arrived (1, else 0), and the number of each run's world."""
    worlds = {world: k for k, world in enumerate(dict.fromkeys((run.preset, run.seed) for run in runs))}
    return np.array([float(run.arrived) for run in runs]), np.array([worlds[run.preset, run.seed] for run in runs])


def line_of(asked: Asked, results: Mapping[str, Any]) -> Line:
    """The line of a run, from its results by name."""
    values: dict[str, Any] = asked._asdict()
    values |= {each.name: results.get(each.name) for each in attrs.fields(Line) if each.name not in RUN_FIELDS}
    values["arrived"] = bool(values["arrived"])
    return Line(**values)


def result_of(
    benchmark: Benchmark,
    entry: str,
    encoding: str,
    results: Sequence[Mapping[str, Any]],
) -> Result:
    """The result of an entry, from its runs and the results of each by the names of a sweep's table."""
    done = [each for each in results if each.get("error") is None]
    sizes = [each["memory_bytes"] for each in done if each.get("memory_bytes") is not None]
    return Result(
        benchmark=benchmark.name,
        entry=entry,
        encoding=encoding,
        tussock=version("tussock"),
        processor=llvmlite.binding.get_host_cpu_name(),
        runs=list(map(line_of, benchmark.asked(), results)),
        memory_bytes=max(sizes, default=None),
        times={name: float(np.mean([each[column] for each in done])) for name, column in TIMES.items() if done},
    )


def file_of(out: Path, benchmark: Benchmark, entry: str, encoding: str) -> Path:
    """Where the result of an entry is kept. Raises SettingError for a name from which no file name follows."""
    words = [entry] if encoding == benchmark.chain() else [entry, encoding]
    parts = [re.sub(r"[^a-z0-9.]+", "-", word.lower()).strip("-.") for word in words]
    if not (all(parts) and entry.isprintable()):
        raise SettingError(f"entry {entry!r}: give a name of one line with letters in it")
    return out / RESULTS / f"{'-'.join(parts)}.json"


def check_free(out: Path, benchmark: Benchmark, entry: str, encoding: str) -> Path:
    """Where a result may be written: to a new file, or over one of the same entry. Makes the folder.

    Raises InputError for another entry's file, and where there are results that this one would not compare with.
    """
    path = file_of(out, benchmark, entry, encoding)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path.parent} cannot be written ({error.strerror}); give another --out") from error
    for other in sorted(path.parent.glob("*.json")):
        there = read_result(other)
        mine = (there.entry, there.encoding) == (entry, encoding)
        if there.benchmark != benchmark.name or (other == path and not mine):
            raise FileError(
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
    """Read a result. Raises FileError for an invalid one, and where its runs are not those of its benchmark, if that is known."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        lines = [
            Line(
                **{
                    each.name: run[each.name]
                    for each in attrs.fields(Line)
                    if each.name in run or each.name != "condition"
                }
            )
            for run in content["runs"]
        ]
        if not lines:
            raise ValueError("no runs")
        times = {name: float(seconds) for name, seconds in content["times"].items()}
        rest: dict[str, Any] = {
            name: content[name] for name in ("benchmark", "entry", "encoding", "tussock", "processor", "memory_bytes")
        }
        rest["encoding"] = current_encoding(rest["encoding"])
        result = Result(**rest, runs=lines, times=times)
        scores = json.loads(json.dumps(result.scores()))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        problem = str(error) if isinstance(error, InputError) else repr(error)
        raise FileError(f"{path} is not a result of tussock benchmark ({problem}); make it again") from error
    if any(scores[name] != content.get(name) for name in scores):
        raise FileError(f"{path}: its totals do not follow from its runs; make it again")
    if (benchmark := known.get(result.benchmark)) is not None:
        _check_runs(path, result, benchmark)
    return result


def current_encoding(encoding: str) -> str:
    """An encoding with the names that its steps have today."""
    try:
        return encoding if encoding == PANORAMA else str(Encoding.parse(encoding, importing=False))
    except InputError:  # with a step that is not known here
        return encoding


def _check_runs(path: Path, result: Result, benchmark: Benchmark) -> None:
    asked = benchmark.asked()
    if [run.asked for run in result.runs] != asked:
        raise FileError(f"{path}: its runs are not the {len(asked)} of {benchmark.name}; make it again")


def _counts(values: Iterable[str | None]) -> dict[str, int]:
    """How often each value occurs, None left out, the most frequent first."""
    counts = Counter(value for value in values if value is not None)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))
