"""Times whole jobs, those of this checkout and of another one alternately: make bench-jobs BASE=CHECKOUT BASE_PYTHON=its/python."""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import job_report
from job_process import JobError, measure
from job_results import compare
from stages.sitecustomize import FOLDER, STAGES

HERE = Path(__file__).parents[1]
BIG = "tussock-field field_width=40 field_depth=40"
README_SWEEP = (HERE / "README.md").read_text().split("```toml\n")[1].split("```")[0]
MODELS_SWEEP = """
[fixed]
world = "tussock-field"
size = "120x25"

[axes]
model = ["perfect-memory", "infomax"]
seed = { from = 0, to = 1 }
offset-m = [-0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25]
"""
ROUTE = "x_m,y_m,heading_deg\n" + "".join(f"{10 + each / 10:g},20,0\n" for each in range(81))  # 8 m to the east
SMALL_ROUTE = "x_m,y_m,heading_deg\n" + "".join(f"{1 + each / 10:g},2,0\n" for each in range(11))
SMALL_SWEEP = '[fixed]\nworld = "tiny"\nsize = "90x19"\n[axes]\nmodel = ["perfect-memory", "{model}"]\n'


@dataclass(frozen=True)
class Job:
    """A job of the command line.

    Attributes:
        title: In the table.
        arguments: Of tussock. It writes to the folder out.
        quick: The same, of a small job that goes through the same code, to try the benchmark out.
        rounds: How often it is done on each side; the best counts.
        files: Texts of files that the arguments name.
        quick_files: Likewise.
    """

    title: str
    arguments: list[str]
    quick: list[str]
    rounds: int = 1
    files: dict[str, str] = field(default_factory=dict, kw_only=True)
    quick_files: dict[str, str] = field(default_factory=dict, kw_only=True)


OUT = ["--out", "out"]
POOR = [
    "--route",
    "route.csv",
    "--scan-about-deg",
    "180",
    "--scan-deg",
    "60",
    "--on-lost",
    "reset",
    "--max-steps",
    "300",
]  # it walks back
SMALL = ["--world", "tiny", "--size", "90x19"]
PROTOCOL = ["--quick", "--worlds", "1"]
JOBS = {
    "run": Job("a walk, recorded", ["run", *OUT], ["run", *SMALL, *OUT], 3),
    "poor": Job(
        "a recorded walk in a world of 40 m x 40 m, every step poor",
        ["run", "--world", BIG, *POOR, *OUT],
        ["run", *SMALL, *POOR, *OUT],
        2,
        files={"route.csv": ROUTE},
        quick_files={"route.csv": SMALL_ROUTE},
    ),
    "sweep": Job(
        "the sweep of README",
        ["sweep", "sweep.toml", "--record", "worst:1", *OUT],
        ["sweep", "sweep.toml", "--record", "worst:1", *OUT],
        2,
        files={"sweep.toml": README_SWEEP},
        quick_files={"sweep.toml": SMALL_SWEEP.format(model="random")},
    ),
    "models": Job(
        "a sweep of 2 models x 2 worlds x 10 starts",
        ["sweep", "sweep.toml", *OUT],
        ["sweep", "sweep.toml", *OUT],
        2,
        files={"sweep.toml": MODELS_SWEEP},
        quick_files={"sweep.toml": SMALL_SWEEP.format(model="infomax")},
    ),
    "testbed": Job(
        "the test bed, perfect memory, 108 runs",
        ["benchmark", "--model", "perfect-memory", *OUT],
        ["benchmark", "--model", "perfect-memory", "--quick", *OUT],
    ),
    "azevedo2025": Job(
        "azevedo2025, one world, 45 starts",
        ["replicate", "azevedo2025", "--worlds", "1", *OUT],
        ["replicate", "azevedo2025", *PROTOCOL, *OUT],
    ),
    "ardin2016": Job(
        "ardin2016 --quick", ["replicate", "ardin2016", "--quick", *OUT], ["replicate", "ardin2016", *PROTOCOL, *OUT]
    ),
    "baddeley2012": Job(
        "baddeley2012, one world",
        ["replicate", "baddeley2012", "--worlds", "1", *OUT],
        ["replicate", "baddeley2012", *PROTOCOL, *OUT],
    ),
    "kagioulis2024": Job(
        "kagioulis2024, one world",
        ["replicate", "kagioulis2024", "--worlds", "1", *OUT],
        ["replicate", "kagioulis2024", *PROTOCOL, *OUT],
    ),
    "thesis": Job(
        "thesis --quick",
        ["replicate", "thesis", "--quick", *OUT],
        ["study", "setting", "--quick", "--size", "180x38", *OUT],
    ),
}
UNSET = (
    "PYTHONDONTWRITEBYTECODE",
    "OMP_NUM_THREADS",
)  # of the environment, so that jobs run as they do for most people
WARM = ("run", "sweep", "models")  # small ones are done first, so that all is compiled


@dataclass(frozen=True)
class Side:
    """A checkout and the Python that runs it."""

    name: str
    checkout: Path
    python: str

    @property
    def is_package(self) -> bool:
        """Whether the checkout is a package tussock; earlier ones hold packages side by side."""
        return (self.checkout / "__init__.py").exists()

    def command(self, arguments: list[str]) -> list[str]:
        """A command of tussock."""
        module = "tussock.navigation.cli.main" if self.is_package else "navigation.cli"
        return [self.python, "-c", f"from {module} import main; main()", *arguments]

    def environment(self, folder: Path, work: Path) -> dict[str, str]:
        """That it runs in: the checkout is what is imported, whatever is installed; `folder` gets a link, `work` the stages of ours."""
        path = self.checkout
        if self.is_package:
            (path := folder / self.name).mkdir(exist_ok=True)
            if not (path / "tussock").is_symlink():
                (path / "tussock").symlink_to(self.checkout)
        kept = {name: value for name, value in os.environ.items() if name not in UNSET}
        (stages := work / "stages").mkdir()
        if self.checkout != HERE:  # functions of other versions have other names
            return kept | {"PYTHONPATH": str(path)}
        return kept | {"PYTHONPATH": f"{HERE / 'benchmarks' / 'stages'}{os.pathsep}{path}", FOLDER: str(stages)}


def main() -> None:
    """Time the jobs, print each as it is done, and write the docs if asked to."""
    options = _options()
    sides = [Side("new", HERE, sys.executable)]
    if options.base is not None:
        sides.insert(0, Side("base", options.base.resolve(), options.python))
    if not options.quick:
        with folder_of(None) as folder:
            for key in WARM:
                time_job(key, sides, folder, 1, quick=True)
    failed = []
    for key in options.only or JOBS:
        rounds = 1 if options.quick else options.rounds or JOBS[key].rounds
        try:
            with folder_of(options.keep) as folder:
                measured = time_job(key, sides, folder, rounds, quick=options.quick)
        except JobError as error:  # the other jobs are still worth their time
            print(f"{JOBS[key].title}: {error}", flush=True)
            failed.append(key)
            continue
        print(job_report.line(measured), flush=True)
        if options.results and not options.quick:
            kept = json.loads(options.results.read_text()) if options.results.exists() else {}
            options.results.write_text(json.dumps(kept | {key: measured}, indent=1) + "\n")
    if options.docs and not options.quick:
        kept = json.loads(options.results.read_text())
        job_report.write([kept[key] for key in JOBS if key in kept])
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


def time_job(key: str, sides: list[Side], folder: Path, rounds: int, *, quick: bool) -> dict[str, Any]:
    """What a job takes on each side, one side after the other in each round, and whether the results are equal."""
    job = JOBS[key]
    taken: dict[str, list[dict[str, Any]]] = {side.name: [] for side in sides}
    for number in range(rounds):
        for side in sides:
            work = folder / f"{key}-{side.name}-{number}"
            work.mkdir(parents=True)
            for name, text in (job.quick_files if quick else job.files).items():
                (work / name).write_text(text)
            command = side.command(job.quick if quick else job.arguments)
            measured = measure(command, work, side.environment(folder, work))
            taken[side.name].append(asdict(measured) | {"stages": stages_of(work)})
    found = {"title": job.title, "machine": machine(), "at": datetime.now().isoformat(timespec="minutes")}
    if len(sides) > 1:
        commit = ["git", "-C", str(sides[0].checkout), "rev-parse", "--short", "HEAD"]
        found["before"] = subprocess.run(commit, capture_output=True, text=True).stdout.strip()
        try:
            found["results"] = str(compare(*(folder / f"{key}-{side.name}-0" / "out" for side in sides)))
        except ValueError as error:  # the times are worth keeping
            found["results"] = f"not compared: {error}"
    return found | taken


def stages_of(work: Path) -> dict[str, float]:
    """The seconds of each stage that the processes of a job wrote (see stages/sitecustomize.py); none where they wrote nothing."""
    files = [array("d", path.read_bytes()) for path in (work / "stages").iterdir()]
    return {name: sum(each[k] for each in files) for k, name in enumerate(STAGES)} if files else {}


def machine() -> str:
    """The processor, and how many cores this process may use."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = [each.partition(":")[2].strip() for each in lines if each.startswith("model name")]
    return f"{names[0] if names else platform.machine()}, {len(os.sched_getaffinity(0))} cores"


@contextmanager
def folder_of(keep: Path | None) -> Iterator[Path]:
    """A folder for what jobs write: one that is kept, or one that is deleted."""
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        yield keep.resolve()
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare with")
    parser.add_argument("--python", default=sys.executable, help="the Python that runs it")
    parser.add_argument("--only", type=lambda text: text.split(","), help=f"some of {','.join(JOBS)}")
    parser.add_argument("--quick", action="store_true", help="small jobs, to try this out; their numbers are not kept")
    parser.add_argument("--rounds", type=int, help="in place of each job's own number")
    parser.add_argument("--results", type=Path, help="add the numbers to this JSON file")
    parser.add_argument("--docs", action="store_true", help="write the table and the picture of --results into docs")
    parser.add_argument("--keep", type=Path, help="keep what the jobs write in this new folder")
    return parser.parse_args()


if __name__ == "__main__":
    main()
