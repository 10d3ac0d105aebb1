"""Recordings of the worst runs of a sweep, in its folder."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.errors import FileError
from tussock.world.progress import no_progress

from ..experiment import Experiment
from ..recording.run_folder import record_run

WORST = "worst"  # folder of the recordings
MAX_NAME = 80  # characters of a model in the name of a folder


def worst_of(table: pd.DataFrame, count: int) -> list[str]:
    """Keys of the worst runs: those that did not arrive, then those put back most often, then those with the greatest deviation."""
    walked = table[table["error"].isna()]
    if walked.empty:
        return []
    badness = ["arrived", "resets", "mean_deviation_m"]
    return walked.sort_values(badness, ascending=[True, False, False], kind="stable")["key"].head(count).tolist()


def recording_folder(key: str, model: str) -> str:
    """Where the recording of a run is in the folder of its sweep: a folder that names the model, and ends with the run's key."""
    return f"{WORST}/{re.sub(r'[^A-Za-z0-9.]+', '-', model).strip('-')[:MAX_NAME]}-{key}"


def recordings_in(out: Path) -> dict[str, str]:
    """Where the recordings in the folder of a sweep are, by the keys of their runs."""
    folders = [path.parent.name for path in out.glob(f"{WORST}/*/summary.json")]
    return {name.rpartition("-")[2]: f"{WORST}/{name}/recording.rrd" for name in folders}


def record_again(experiment: Experiment, row: dict[str, Any], out: Path) -> None:
    """Repeat a finished run with a recording, unless there is one. Raises InputError where its result differs."""
    names, summary = ("arrived", "steps", "mean_deviation_m", "resets"), out / "summary.json"
    recorded = json.loads(summary.read_text(encoding="utf-8")) if summary.exists() else {}
    if all(recorded.get(name) == row[name] for name in names):
        return
    recorded = record_run(experiment, out, overwrite=True, learning=no_progress, walking=no_progress)
    different = [name for name in names if recorded[name] != row[name]]
    if different:
        shutil.rmtree(out)
        raise FileError(
            f"{out}: repeated on this machine, the run had another result ({', '.join(different)}); its worker computes differently"
        )
