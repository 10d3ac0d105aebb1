"""The measurement of docs/worlds.md: the presets in numbers, next to the Sussex world."""

from pathlib import Path

from measurement import SUSSEX, Measurement, NeedsSussex, Values, markdown, tussock

from tussock.navigation.measures.description import MEASURES
from tussock.world.params import WORLDS

PLACES, SEEDS = 60, (1, 2, 3)
SHOWN = {
    "skyline_deg": 1, "skyline_roughness_deg": 1, "covered": 2, "distance_m": 1, "contrast": 2, "rotation_depth": 3,
    "rotation_width_deg": 0, "catchment_m": 2, "aliased": 2,
}  # fmt: skip


def measure(folder: Path) -> Values:
    """What `tussock describe` finds in three worlds of each preset, and in the Sussex world."""
    file = SUSSEX / "world5000_gray.bin"
    if not file.exists():
        raise NeedsSussex
    found = {name: [described(folder, name, seed) for seed in SEEDS] for name in WORLDS.builtin if name != "tiny"}
    return found | {"Sussex": [described(folder, str(file), seed) for seed in SEEDS]}


def described(folder: Path, world: str, seed: int) -> Values:
    """Means over places, and the slopes of the spectra."""
    result = tussock(folder, "describe", world, "--seed", seed, "--places", PLACES)
    slopes = {f"{name}_slope": result[f"{name}_spectrum"]["slope"] for name in ("skyline", "contrast")}
    return {name: row["mean"] for name, row in result["measures"].items()} | slopes


def table(values: Values) -> str:
    """One line for each measure: the mean over seeds, and its range."""

    def cell(name: str, rows: list[Values], digits: int) -> str:
        numbers = [row[name] for row in rows if row[name] is not None]
        low, high, mean = min(numbers), max(numbers), sum(numbers) / len(numbers)
        return f"{mean:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"

    rows = [[MEASURES[name], *(cell(name, each, digits) for each in values.values())] for name, digits in SHOWN.items()]
    slopes = {"skyline_slope": "skyline: exponent of its power", "contrast_slope": "contrast: exponent of its power"}
    rows += [[label, *(cell(name, each, 1) for each in values.values())] for name, label in slopes.items()]
    return markdown(["mean over places (range over seeds)", *values], rows)


MEASUREMENTS: dict[str, Measurement] = {
    "descriptions": Measurement("`tussock describe WORLD --places 60`", measure, {"table": table}, slow=True),
}
