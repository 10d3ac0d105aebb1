"""The measurements whose numbers README and docs print: what is run, and how its numbers read."""

from collections.abc import Callable
from pathlib import Path

import changes
import comparison
import descriptions
import eyes
import light
import ommatidia
import pictures
import processors
import protocols
import spectrum
import steering
from measurement import RESULTS, Measurement, Values, arrivals, of, seeds, sussex, sweep, tussock

from tussock.navigation.benchmark.leaderboard import leaderboard, read_results
from tussock.navigation.models import MODELS as REGISTRY


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


def measure_test_bed_3(folder: Path) -> Values:
    """All models on tussock-3, and perfect memory with other encodings; the results are in docs/benchmark/tussock-3."""
    for model, encoding in (("perfect-memory", "grey"), ("perfect-memory", "uv"), ("all", "edges")):
        tussock(
            folder, "benchmark", "--test-bed", "tussock-3", "--model", model, "--encoding", encoding, "--out", "bed"
        )
    for path in (folder / "bed" / "results").glob("*.json"):
        (RESULTS_3 / path.name).write_bytes(path.read_bytes())
    results = read_results(RESULTS_3)
    seconds = sum(len(result.runs) * result.times["walk_seconds"] for result in results)
    return {"seconds": seconds} | {
        f"{result.entry}, {result.encoding}": {
            name: score["arrived_share"] for name, score in result.scores()["by_condition"].items()
        }
        for result in results
    }


def with_and_without(noise: str) -> dict[str, Callable[[Values], str]]:
    """The two cells of a line of the table of learning walks."""
    return {
        f"route-{noise}": lambda values: of(values[f"{noise}.0"]["0.0"]),
        f"both-{noise}": lambda values: of(values[f"{noise}.0"]["0.2"]),
    }


RESULTS_3 = RESULTS / "tussock-3"
NOT_ENTERED = {"window-memory", "spiking-mushroom-body", "spike-overlap"}  # in the test bed, so far
MODELS = [name for name in REGISTRY.builtin if name not in NOT_ENTERED]
MEASUREMENTS = (
    changes.MEASUREMENTS
    | comparison.MEASUREMENTS
    | descriptions.MEASUREMENTS
    | eyes.MEASUREMENTS
    | light.MEASUREMENTS
    | ommatidia.MEASUREMENTS
    | pictures.MEASUREMENTS
    | processors.MEASUREMENTS
    | protocols.MEASUREMENTS
    | spectrum.MEASUREMENTS
    | steering.MEASUREMENTS
    | {
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
            {
                model: lambda values, model=model: f"{values['arrived'][model]:.0%}".replace("%", " %")
                for model in MODELS
            }
            | {"leaderboard": lambda values: "\n" + leaderboard(read_results(RESULTS))},
            slow=True,
        ),
        "test-bed-3": Measurement(
            "`tussock benchmark --test-bed tussock-3 --model all`; perfect memory with `--encoding grey` and `uv`, too",
            measure_test_bed_3,
            {"leaderboard": lambda values: "\n" + leaderboard(read_results(RESULTS_3))},
            slow=True,
        ),
    }
)
