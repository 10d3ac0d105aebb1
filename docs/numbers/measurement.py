"""A measurement: something that is run for the numbers that README and docs print; and what measurements run."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

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


def tussock(folder: Path, *arguments: object, environment: Mapping[str, str] | None = None) -> Values:
    """What a command of tussock reports, with further variables of the environment."""
    command = [sys.executable, "-m", "tussock", *map(str, arguments), "--json"]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, env=os.environ | (environment or {}))
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


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table between line breaks, so that it may stand between marks."""
    head = list(head)
    lines = [head, ["---"] * len(head), *rows]
    return "\n\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n\n"


def sussex(*names: str) -> list[str]:
    """Paths of files of the Sussex world. Raises NeedsSussex where it is not on this machine."""
    if not SUSSEX.is_dir():
        raise NeedsSussex("the Sussex world is not on this machine (a folder shared/sussex next to the project)")
    return [str(SUSSEX / name) for name in names]


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
