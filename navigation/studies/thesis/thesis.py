"""The studies of the thesis in their order, each kept as soon as it is done."""

import hashlib
import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from ...cli.terminal import message as say
from ...reports.findings import Findings, plain, read_findings, write_findings
from . import beyond, classifier, confidence, corners, perfect_memory, visual_compass, world_and_views
from .material import Material
from .settings import Settings

VERSION = 4  # of the studies: a change that alters what they find counts it up, and what was kept is done again
Progress = Callable[[int, int], object]


@dataclass(frozen=True, kw_only=True)
class Study:
    """A part of the thesis. run: the function. needs: studies whose findings it goes on from. random: whether seeds matter."""

    title: str
    run: Callable[..., Findings]
    needs: tuple[str, ...] = ()
    random: bool = False


STUDIES = {
    "setting": Study(title="The world and its views", run=world_and_views.study),
    "visual-compass": Study(title="One snapshot as a compass", run=visual_compass.study),
    "frequency": Study(title="Perfect memory, and how many views it needs", run=perfect_memory.frequency),
    "resolution": Study(title="Resolution and smoothing", run=perfect_memory.resolution),
    "classifier": Study(title="A network as a classifier", run=classifier.study, random=True),
    "corners": Study(title="Corners", run=corners.study, needs=("classifier",), random=True),
    "confidence": Study(title="Confidence, training time and the width of the scan", run=confidence.study, random=True),
    "beyond": Study(title="Beyond the thesis", run=beyond.study, random=True),
}


def run_studies(
    material: Material, settings: Settings, folder: Path, names: Iterable[str] = tuple(STUDIES),
    progress: Callable[[str, int, int], object] = lambda name, done, total: None,
) -> dict[str, Findings]:  # fmt: skip
    """The findings of studies, in the thesis's order; those in `folder` that were found in the same are not found again.

    progress(name, done, total) is called as a study goes on.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = set(names)
    wanted |= {needed for name in wanted for needed in STUDIES[name].needs}
    found: dict[str, Findings] = {}
    for name in (name for name in STUDIES if name in wanted):
        found[name] = _study(
            name, material, settings, folder, found, lambda done, total, name=name: progress(name, done, total)
        )
    return found


def _study(
    name: str, material: Material, settings: Settings, folder: Path, found: dict[str, Findings], progress: Progress
) -> Findings:
    study, key = STUDIES[name], _key(name, material, settings)
    path = folder / f"{name}-{key[:12]}.json"
    try:
        earlier = read_findings(path, key)
    except ValueError as error:
        say(f"{path} is damaged ({error}); the study is done again")
        earlier = None
    if earlier is not None:
        say(f"{name}: kept from before")
        return earlier
    began = time.perf_counter()
    progress(0, 1)
    given = {"tuning": classifier.tuning_of(found["classifier"])} if "classifier" in study.needs else {}
    findings = study.run(material, settings, progress, **given)
    findings.numbers["seconds"] = round(time.perf_counter() - began, 1)
    write_findings(findings, path, key)
    say(f"{name}: done in {findings.numbers['seconds']:.0f} s")
    return Findings.from_json(findings.to_json())  # the same whether it was kept or not


def _key(name: str, material: Material, settings: Settings) -> str:
    """Of everything that a study's findings follow from."""
    chosen = asdict(settings)
    if not STUDIES[name].random:
        del chosen["seed"]
    whole = json.dumps([VERSION, name, material.digest, plain(chosen)])
    return hashlib.sha256(whole.encode()).hexdigest()
