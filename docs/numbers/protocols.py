"""The measurements of docs/protocols.md and docs/report.md: published experiments at full size, with what was published."""

import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from measurement import Measurement, Values, sussex, tussock
from protocol_tables import (
    apiaviz,
    by_distance,
    claims_table,
    completed,
    counted,
    distances_by_gain,
    distances_by_memory,
    errors_by_start,
    in_a_line,
    means,
    number,
    shares_by_release,
    strategies,
    thesis_count,
    thesis_table,
)

Texts = Mapping[str, Callable[[Values], str]]


def replication(name: str, arguments: str, *, tables: Sequence[str], texts: Texts) -> Measurement:
    """A protocol at full size.

    Args:
        name: Of the measurement, and of its folder.
        arguments: Of `tussock replicate`; S is the folder of the Sussex world.
        tables: Tables of its results that are kept.
        texts: As of a measurement; "claims", "holds" and "line" are added.
    """

    def measure(folder: Path) -> Values:
        done = replicated(folder, name, *map(in_sussex, arguments.split()))
        results = json.loads((folder / name / "results.json").read_text())
        kept = ("test", "published", "note", "obtained", "holds", "effects", "reason")
        return {
            "seconds": done["seconds"],
            "walks": done["runs"],
            "could_not_run": results["could_not_run"],
            "claims": {key: {part: claim[part] for part in kept} for key, claim in results["claims"].items()},
            "numbers": results["numbers"],
            "models": results.get("models", {}),
            "tables": {each: results["tables"][each] for each in tables},
        }

    texts = {"claims": claims_table, "holds": counted, "line": in_a_line, **texts}
    return Measurement(f"`tussock replicate {arguments}`", measure, texts, slow=True)


def in_sussex(argument: str) -> str:
    """An argument with the folder of the Sussex world for S. Raises NeedsSussex where it is not on this machine."""
    return re.sub(r"\bS(?=/|$)", lambda _: sussex("")[0].rstrip("/"), argument)


def replicated(folder: Path, name: str, *arguments: str) -> Values:
    """What `tussock replicate` reports, with the seconds of all times that it was begun in the folder."""
    began = time.monotonic()
    done = tussock(folder, "replicate", *arguments, "--out", name, "--overwrite")
    if done.get("done_before", 0) < done.get("runs", 1):  # otherwise it only wrote its report again
        with (folder / f"{name}.seconds").open("a") as file:
            file.write(f"{time.monotonic() - began:.1f}\n")
    return done | {"seconds": sum(map(float, (folder / f"{name}.seconds").read_text().split()))}


def measure_thesis(folder: Path) -> Values:
    """The studies of the thesis in three generated worlds."""
    done = replicated(folder, "thesis", "thesis")
    claims = json.loads((folder / "thesis" / "results.json").read_text())["claims"]
    kept = ("test", "published", "obtained", "holds", "effects", "reason")
    return {
        "seconds": done["seconds"],
        "claims": {key: {part: claim[part] for part in kept} for key, claim in claims.items()},
    }


AZEVEDO_WORLDS = 75  # all of the paper
SUSSEX_WORLD = "--world S/world5000_gray.bin --route S"
FULL_SIZE: dict[str, tuple[str, Sequence[str], Texts]] = {  # arguments, tables that are kept, texts
    "ardin2016": ("ardin2016", ["by_displacement"], {"errors": errors_by_start}),
    "ardin2016-sussex": (
        "ardin2016 --world S/world5000_gray.bin --route S/ant1_route1.bin,S/ant4_route1.bin --cull-back-faces",
        ["by_displacement"],
        {
            "errors": errors_by_start,
            "share": lambda values: number(values["claims"]["body-close"]["effects"][0]["value"]),
        },
    ),
    "baddeley2012": ("baddeley2012", ["intervals"], {"means": means}),
    "kagioulis2024": ("kagioulis2024", ["intervals"], {"means": means}),
    "kagioulis2024-as-published": ("kagioulis2024 --as-published", ["intervals"], {"means": means}),
    "apiaviz2026": (
        f"apiaviz2026 {SUSSEX_WORLD}",
        ["by_input", "differences"],
        {"inputs": apiaviz, "counts": completed},
    ),
    "lemoel2020": (
        "lemoel2020",
        ["gains", "release"],
        {"gains": distances_by_gain, "release": distances_by_memory},
    ),
    "azevedo2025": (
        f"azevedo2025 --worlds {AZEVEDO_WORLDS}",
        ["by_start", "differences"],
        {"strategies": strategies, "by-distance": by_distance},
    ),
    "beenav2026": ("beenav2026", ["by_distance"], {"shares": shares_by_release}),
}
MEASUREMENTS: dict[str, Measurement] = {
    name: replication(name, arguments, tables=tables, texts=texts)
    for name, (arguments, tables, texts) in FULL_SIZE.items()
}
MEASUREMENTS["thesis"] = Measurement(
    "`tussock replicate thesis`", measure_thesis, {"claims": thesis_table, "count": thesis_count}, slow=True
)
