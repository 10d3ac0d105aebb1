"""The studies of the thesis in their order; the results of each are saved as soon as it is done."""

import hashlib
import json
import logging
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import attrs

from ...reports.claims import Claim
from ...reports.results import StudyResults, plain_json, read_results, write_results
from . import beyond, classifier, confidence, corners, perfect_memory, setting, visual_compass
from .parameters import Progress, StudySettings
from .study_data import StudyData

VERSION = 4  # of the studies: count it up with a change that alters their results, so that saved ones are not used
LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Study:
    """A part of the thesis.

    Attributes:
        title: Heading in the report.
        run: Computes the results.
        claims: Claims of the thesis that the results test.
        needs_tuning: Whether it needs the best tuning of the study "classifier".
        random: Whether its results depend on the seed.
    """

    title: str
    run: Callable[..., StudyResults]
    claims: tuple[Claim, ...] = ()
    needs_tuning: bool = False
    random: bool = False


STUDIES = {
    "setting": Study("The world and its views", setting.study),
    "visual-compass": Study("One snapshot as a compass", visual_compass.study, visual_compass.CLAIMS),
    "frequency": Study(
        "Perfect memory, and how many views it needs", perfect_memory.frequency, perfect_memory.FREQUENCY_CLAIMS
    ),
    "resolution": Study("Resolution and smoothing", perfect_memory.resolution, perfect_memory.RESOLUTION_CLAIMS),
    "classifier": Study("A network as a classifier", classifier.study, classifier.CLAIMS, random=True),
    "corners": Study("Corners", corners.study, corners.CLAIMS, needs_tuning=True, random=True),
    "confidence": Study(
        "Confidence, training time and the width of the scan", confidence.study, confidence.CLAIMS, random=True
    ),
    "beyond": Study("Beyond the thesis", beyond.study, beyond.CLAIMS, random=True),
}


def run_studies(
    data: StudyData,
    settings: StudySettings,
    folder: Path,
    names: Iterable[str] = tuple(STUDIES),
    progress: Callable[[str, int, int], object] = lambda name, done, total: None,
) -> dict[str, StudyResults]:
    """Run studies in the thesis's order, and those that they need. Results in the folder for the same input are used again.

    Args:
        data: The views to study.
        settings: How deep to go.
        folder: Folder for the results.
        names: Names of the studies.
        progress: Called with a study's name, how many of its steps are done, and how many it has.

    Returns:
        The results by name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = set(names)
    if any(STUDIES[name].needs_tuning for name in wanted):
        wanted.add("classifier")
    results: dict[str, StudyResults] = {}
    for name in (name for name in STUDIES if name in wanted):
        needed = {"tuning": classifier.best_tuning_of(results["classifier"])} if STUDIES[name].needs_tuning else {}

        def report(done: int, total: int, name: str = name) -> object:
            return progress(name, done, total)

        results[name] = _saved(name, data, settings, folder) or _run(name, data, settings, folder, report, **needed)
    return results


def _saved(name: str, data: StudyData, settings: StudySettings, folder: Path) -> StudyResults | None:
    """The results that are in the folder, if there are any."""
    path, key = _path_and_key(name, data, settings, folder)
    try:
        results = read_results(path, key)
    except ValueError as error:
        LOG.info("%s is damaged (%s); the study is done again", path, error)
        return None
    if results is not None:
        LOG.info("%s: kept from before", name)
    return results


def _run(
    name: str, data: StudyData, settings: StudySettings, folder: Path, progress: Progress, **needed
) -> StudyResults:
    """Run a study and save its results."""
    began = time.perf_counter()
    progress(0, 1)
    results = STUDIES[name].run(data, settings, progress, **needed)
    results.numbers["seconds"] = round(time.perf_counter() - began, 1)
    write_results(results, *_path_and_key(name, data, settings, folder))
    LOG.info("%s: done in %.0f s", name, results.numbers["seconds"])
    return StudyResults.from_json(results.to_json())  # the same as when it is read from the folder


def _path_and_key(name: str, data: StudyData, settings: StudySettings, folder: Path) -> tuple[Path, str]:
    """File of a study's results, and a digest of everything that decides them."""
    chosen = attrs.asdict(settings)  # type: ignore[arg-type]
    if not STUDIES[name].random:
        del chosen["seed"]
    text = json.dumps([VERSION, name, data.digest, plain_json(chosen)])
    key = hashlib.sha256(text.encode()).hexdigest()
    return folder / f"{name}-{key[:12]}.json", key
