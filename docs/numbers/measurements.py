"""The measurements whose numbers README and docs print: what is run, and how its numbers read."""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.navigation.benchmark.leaderboard import leaderboard, read_results
from tussock.navigation.models import MODELS as REGISTRY

ROOT = Path(__file__).parents[2]
SUSSEX = ROOT.parent / "shared" / "sussex"  # the world and routes of the study; they are not part of the project
RESULTS = ROOT / "docs" / "benchmark"  # of the test bed

Values = dict[str, Any]


class NeedsSussex(Exception):
    """The Sussex world is not on this machine."""


@dataclass(frozen=True)
class Measurement:
    """Something that is run for its numbers.

    Attributes:
        command: What a reader may type to see the same, in Markdown.
        measure: Runs it in an empty folder, and returns its values.
        texts: How the values read on a page, by the name of the part.
        slow: Whether it takes minutes.
    """

    command: str
    measure: Callable[[Path], Values]
    texts: Mapping[str, Callable[[Values], str]]
    slow: bool = False


def tussock(folder: Path, *arguments: object) -> Values:
    """What a command of tussock reports."""
    command = [sys.executable, "-m", "tussock", *map(str, arguments), "--json"]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise SystemExit(f"failed: {' '.join(command)}")
    return json.loads(done.stdout)


def sweep(folder: Path, name: str, fixed: Mapping[str, Any], axes: Mapping[str, Any]) -> pd.DataFrame:
    """The table of the runs of a sweep, one row a run."""
    lines = [
        f"[{part}]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in table.items())
        for part, table in (("fixed", fixed), ("axes", axes))
    ]
    (folder / f"{name}.toml").write_text("\n".join(lines))
    tussock(folder, "sweep", f"{name}.toml", "--out", name)
    table = pd.read_parquet(folder / name / "runs.parquet")
    if table["error"].notna().any():
        raise SystemExit(f"{name}: {table['error'].dropna().iloc[0]}")
    return table


def toml(value: Any) -> str:
    """A value in a sweep file."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return json.dumps(value)


def arrivals(table: pd.DataFrame, by: str) -> Values:
    """How many walks arrived, of how many, by a column."""
    return {str(key): [int(group["arrived"].sum()), len(group)] for key, group in table.groupby(by, sort=False)}


def of(counts: Sequence[int]) -> str:
    """A count as it is printed."""
    arrived, walks = counts
    return f"{arrived} of {walks}"


def seeds(first: int, last: int) -> dict[str, int]:
    """An axis of seeds."""
    return {"from": first, "to": last}


def measure_walk(folder: Path) -> Values:
    """The walk of README's picture."""
    summary = tussock(folder, "run", "--seed", 9, "--offset-m", 0.1, "--out", "run")
    return {name: summary[name] for name in ("steps", "mean_deviation_m", "reason")}


def measure_learning_walks(folder: Path) -> Values:
    """Walks with and without a learning walk, in generated worlds."""
    axes = {
        "learning-walk-m": [0.0, 0.2],
        "case": [{"offset-m": 0.1, "heading-noise-deg": 0.0}, {"offset-m": -0.2, "heading-noise-deg": 10.0}],
        "seed": seeds(0, 19),
    }
    table = sweep(folder, "walks", {"world": "tussock-field", "model": "perfect-memory"}, axes)
    return {str(noise): arrivals(group, "learning_walk_m") for noise, group in table.groupby("heading_noise_deg")}


def measure_learning_walks_sussex(folder: Path) -> Values:
    """The same along the two routes of the Sussex world."""
    axes = {
        "route": sussex("ant1_route1.bin", "ant4_route1.bin"),
        "learning-walk-m": [0.0, 0.2],
        "heading-noise-deg": [0.0, 10.0],
        "offset-m": [-0.2, -0.1, 0.0, 0.1, 0.2],
    }
    table = sweep(folder, "walks", {"world": sussex("world5000_gray.bin")[0], "model": "perfect-memory"}, axes)
    return {str(noise): arrivals(group, "learning_walk_m") for noise, group in table.groupby("heading_noise_deg")}


def measure_test_bed(folder: Path) -> Values:
    """Every model on the test bed; the results are in docs/benchmark."""
    for model in MODELS:
        tussock(folder, "benchmark", "--model", model, "--out", "bed")
    for path in (folder / "bed" / "results").glob("*.json"):
        (RESULTS / path.name).write_bytes(path.read_bytes())
    return {"arrived": {result.entry: result.scores()["totals"]["arrived_share"] for result in read_results(RESULTS)}}


def sussex(*names: str) -> list[str]:
    """Paths of files of the Sussex world. Raises NeedsSussex where it is not on this machine."""
    if not SUSSEX.is_dir():
        raise NeedsSussex("the Sussex world is not on this machine (a folder shared/sussex next to the project)")
    return [str(SUSSEX / name) for name in names]


def with_and_without(noise: str) -> dict[str, Callable[[Values], str]]:
    """The two cells of a line of the table of learning walks."""
    return {
        f"route-{noise}": lambda values: of(values[f"{noise}.0"]["0.0"]),
        f"both-{noise}": lambda values: of(values[f"{noise}.0"]["0.2"]),
    }


NOT_ENTERED = {"window-memory", "spiking-mushroom-body", "spike-overlap"}  # in the test bed, so far
MODELS = [name for name in REGISTRY.builtin if name not in NOT_ENTERED]
MEASUREMENTS = {
    "walk": Measurement(
        "`tussock run --seed 9 --offset-m 0.1`",
        measure_walk,
        {
            "deviation": lambda values: f"{100 * values['mean_deviation_m']:.1f} cm",
            "steps": lambda values: str(values["steps"]),
        },
    ),
    "learning-walks": Measurement(
        "a sweep of `learning-walk-m`, `offset-m`, `heading-noise-deg` and `seed`",
        measure_learning_walks,
        with_and_without("0") | with_and_without("10"),
        slow=True,
    ),
    "learning-walks-sussex": Measurement(
        "a sweep of `route`, `learning-walk-m`, `offset-m` and `heading-noise-deg`",
        measure_learning_walks_sussex,
        with_and_without("0") | with_and_without("10"),
        slow=True,
    ),
    "test-bed": Measurement(
        "`tussock benchmark --model NAME`",
        measure_test_bed,
        {model: lambda values, model=model: f"{values['arrived'][model]:.0%}".replace("%", " %") for model in MODELS}
        | {"leaderboard": lambda values: "\n" + leaderboard(read_results(RESULTS))},
        slow=True,
    ),
}
