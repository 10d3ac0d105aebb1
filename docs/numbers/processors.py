"""How far another processor changes the test bed: the same runs with the libraries restricted to older instructions."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from measurement import RESULTS, Measurement, Values, markdown, of, tussock

from tussock.navigation.sweeps.store import Store, read_steps

# Each makes one library compute as on an older processor.
SETTINGS = {
    "torch": {"ATEN_CPU_CAPABILITY": "default"},
    "onednn": {"ONEDNN_MAX_CPU_ISA": "SSE41"},
    "mkl": {"MKL_ENABLE_INSTRUCTIONS": "SSE4_2"},
    "numpy": {"NPY_DISABLE_CPU_FEATURES": " ".join(np._core._multiarray_umath.__cpu_dispatch__)},  # type: ignore[attr-defined]
    "opencv": {"OPENCV_CPU_DISABLE": "SSE4.1,SSE4.2,AVX,FP16,AVX2,FMA3,AVX_512F,AVX512_SKX"},
    "numba": {"NUMBA_CPU_NAME": "generic"},
}
LIBRARIES = {name: value for key, settings in SETTINGS.items() if key != "numba" for name, value in settings.items()}
OLDER = LIBRARIES | SETTINGS["numba"]
MATCHING = ("torch", "onednn", "mkl")  # what compares views; the others draw and encode
RUN = ("world", "seed", "heading_noise_deg", "offset_m")  # what tells the runs of a model apart
POSE = ["x_m", "y_m", "heading_deg"]
NETWORKS = ("infomax",)

Walks = dict[tuple, tuple[str, str]]  # for each run how it ended, and its steps


def walks(bed: Path) -> Walks:
    """The runs in a folder of the test bed, with the poses of their steps."""
    with Store(bed, read_only=True) as store:
        return {
            tuple(row[name] for name in RUN): (row["reason"], read_steps(store.steps(key))[POSE].to_csv())
            for key, row in store.rows().items()
        }


def under(folder: Path, model: str, setting: str, environment: Mapping[str, str]) -> Walks:
    """The runs of a model under a setting."""
    bed = folder / f"{model} {setting}"
    tussock(folder, "benchmark", "--model", model, "--out", bed, environment=environment)
    return walks(bed)


def compared(usual: Walks, other: Walks) -> Values:
    """In how many runs both differ."""
    assert usual.keys() == other.keys()
    return {
        "arrived": [sum(reason == "arrived" for reason, _ in other.values()), len(other)],
        "other steps": sum(usual[run][1] != other[run][1] for run in usual),
        "end otherwise": sum(usual[run][0] != other[run][0] for run in usual),
    }


def measure_exact(folder: Path) -> Values:
    """Perfect memory with older instructions, against its usual steps."""
    model = "perfect-memory"
    usual = under(folder, model, "usual", {})
    settings = {f"only {name}": SETTINGS[name] for name in MATCHING} | {"all": OLDER}
    return {name: compared(usual, under(folder, model, name, each)) for name, each in settings.items()}


def measure_learned(folder: Path) -> Values:
    """Learned networks under all settings together, against the results of the leaderboard."""
    values = {}
    for model in NETWORKS:
        under(folder, model, "older", OLDER)
        usual, other = (results(path / f"{model}.json") for path in (RESULTS, folder / f"{model} older" / "results"))
        values[model] = {"usually": compared(usual, usual)["arrived"], **compared(usual, other)}
    return values


def results(path: Path) -> Walks:
    """The runs of a result."""
    runs = json.loads(path.read_text())["runs"]
    measured = ("steps", "mean_deviation_m", "max_deviation_m", "poor_steps")
    return {
        tuple(run[name] for name in RUN): (run["reason"], json.dumps([run[name] for name in measured])) for run in runs
    }


def exact_table(values: Values) -> str:
    """One line for each setting."""
    rows = ([setting, of(each["arrived"]), str(each["other steps"])] for setting, each in values.items())
    return markdown(["`perfect-memory`, older instructions of", "arrived", "other steps"], rows)


def learned_table(values: Values) -> str:
    """One line for each model."""
    rows = (
        [f"`{model}`", of(each["usually"]), of(each["arrived"]), str(each["other steps"]), str(each["end otherwise"])]
        for model, each in values.items()
    )
    return markdown(["entry", "arrived", "arrived with older instructions", "other steps", "end otherwise"], rows)


COMMAND = "`tussock benchmark --model NAME`, with variables of the environment"
MEASUREMENTS: dict[str, Measurement] = {
    "processors-exact": Measurement(COMMAND, measure_exact, {"table": exact_table}, slow=True),
    "processors-learned": Measurement(COMMAND, measure_learned, {"table": learned_table}, slow=True),
}
