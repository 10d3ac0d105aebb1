"""The measurements of README's and docs/models.md's tables: models compared."""

import json
import subprocess
import sys
from pathlib import Path

from measurement import ROOT, Measurement, Values, markdown, sussex, tussock

from tussock.navigation.models import MODELS as REGISTRY

ROUTES = ("ant1_route1", "ant4_route1")
OTHER_VIEWS = ("spiking-mushroom-body", "spike-overlap")  # their published encodings are others; docs/protocols.md
MODELS = [name for name in REGISTRY.builtin if name not in OTHER_VIEWS]
SETTINGS = {  # what the models learn, and which of them
    "`edges`, resize 6, every view": (MODELS, ("--encoding", "edges", "--resize", 6)),
    "`edges`, resize 3, every view": (["perfect-memory"], ("--encoding", "edges", "--resize", 3)),
    "`grey`, resize 6, every 6th view": (
        ["perfect-memory", "mlp"],
        ("--encoding", "grey", "--resize", 6, "--every", 6),
    ),
}
EDGES, FINE, THESIS = SETTINGS
README = [
    ("perfect-memory", THESIS, " (the thesis's choice)"),
    ("perfect-memory", FINE, ""),
    ("mlp", THESIS, ""),
    *((model, EDGES, "") for model in ("mlp-rotation", "autoencoder", "rbm", "infomax", "adaboost", "mushroom-body")),
]
NUMBERS = ("median_error_deg", "mean_error_deg", "arrived", "memory_bytes")
ORACLE_ROWS = {
    "perfect-memory": "`perfect-memory`",
    "mlp-rotation": "`mlp-rotation`",
    "autoencoder": "`autoencoder`",
    "dense memory": "oracle: dense memory",
    "known position": "oracle: known position",
}


def measure_sussex(folder: Path) -> Values:
    """Each model along the two routes of the Sussex world."""
    (world,) = sussex("world5000_gray.bin")
    return {
        setting: {
            route: {
                model: {name: results[name] for name in NUMBERS}
                for model, results in tussock(
                    folder, "compare", "--world", world, "--route", path, "--models", ",".join(models), *flags
                )["models"].items()
            }
            for route, path in zip(ROUTES, sussex(*(f"{route}.bin" for route in ROUTES)), strict=True)
        }
        for setting, (models, flags) in SETTINGS.items()
    }


def measure_oracle(folder: Path) -> Values:
    """The errors of models, and of oracles that have seen everything."""
    files = sussex("world5000_gray.bin", *(f"{route}.bin" for route in ROUTES))

    def errors(*options: str) -> Values:
        command = [sys.executable, str(ROOT / "benchmarks" / "heading_oracle.py"), *files, *options, "--json"]
        return json.loads(subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout)

    return {"dense": errors(), "sparse": errors("--models", "perfect-memory", "--dense-m", "0.1")}


def errors_of(values: Values, setting: str, model: str) -> list[str]:
    """The cells of a model's errors along each route."""
    results = [values[setting][route][model] for route in ROUTES]
    return [f"{each['median_error_deg']:.1f}, {each['mean_error_deg']:.1f}" for each in results]


def readme_table(values: Values) -> str:
    """A choice of models and settings."""
    lines = ([f"`{model}`, {setting}{note}", *errors_of(values, setting, model)] for model, setting, note in README)
    return markdown(["model and encoding", *(f"{route}: median, mean" for route in ROUTES)], lines)


def models_table(values: Values) -> str:
    """All models with one encoding."""

    def line(model: str) -> list[str]:
        results = [values[EDGES][route][model] for route in ROUTES]
        arrived = ", ".join("yes" if each["arrived"] else "no" for each in results)
        return [f"`{model}`", *errors_of(values, EDGES, model), arrived, f"{results[0]['memory_bytes'] / 1e6:.2g}"]

    head = ["model", "ant1: median, mean error (degrees)", "ant4", "arrived on ant1, ant4", "memory, MB"]
    return markdown(head, map(line, MODELS))


def oracle_table(values: Values) -> str:
    """Errors by distance from the route."""
    bands = values["dense"]["all positions"]["known position"]
    head = ["", *bands, "all, with 2 cm of room"]

    def line(name: str, title: str) -> list[str]:
        everywhere, room = (values["dense"][where][name] for where in ("all positions", "with 2 cm of room"))
        return [title, *(pair(everywhere[band]) for band in bands), pair(room["all"])]

    return markdown(head, (line(name, title) for name, title in ORACLE_ROWS.items()))


def pair(band: Values) -> str:
    """The median and the mean of errors."""
    return f"{band['median_error_deg']:.1f}, {band['mean_error_deg']:.1f}"


def sparse_mean(values: Values, where: str) -> str:
    """The mean error of the oracle that knows the position, where views are few."""
    return f"{values['sparse'][where]['known position']['all']['mean_error_deg']:.1f}"


MEASUREMENTS: dict[str, Measurement] = {
    "sussex": Measurement(
        "`tussock compare --models ..` along both routes",
        measure_sussex,
        {"readme": readme_table, "models": models_table},
        slow=True,
    ),
    "oracle": Measurement(
        "`python benchmarks/heading_oracle.py ..`",
        measure_oracle,
        {
            "table": oracle_table,
            "sparse": lambda values: sparse_mean(values, "all positions"),
            "sparse-room": lambda values: sparse_mean(values, "with 2 cm of room"),
        },
        slow=True,
    ),
}
