"""The measurements of docs/steering.md and of docs/benchmark.md's figure of looks: walks of every navigator."""

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from measurement import Measurement, Values, markdown, of, sweep
from pictures import keep

from tussock.navigation.benchmark.definition import BENCHMARK
from tussock.navigation.experiment import Experiment, steps_of
from tussock.navigation.experiment_settings import experiment_of
from tussock.navigation.reports.drawing import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR, SOFT_COLOUR, STYLE, save_picture
from tussock.navigation.reports.maps import draw_map, draw_route
from tussock.navigation.steering import NAVIGATORS
from tussock.navigation.trajectory import Trajectory
from tussock.navigation.walker import Step

ALONG = {"offset_m": 0.2, "heading_noise_deg": 5.0}  # along a route
HOME = {
    "offset_m": 0.0,
    "goal_walk_m": 2.0,
    "release_m": 0.8,
    "release_deg": 140.0,
    "lost_m": 30.0,
    "patience_m": 30.0,
    "max_steps": 200,
}  # to a place
NAMED = {  # what the walks of the pictures have that is not as for ALONG, and which signals are drawn
    "oscillator": {"encoding": "foreground-mask | blur 1", "size": "72x15"},
    "stepped-scan": {"navigator": "stepped-scan width_deg=120 step_deg=10"},
    "homing": HOME | {"goal_only": True},
    "average-landmark-vector": HOME,
    "image-gradient": HOME,
    "home-vector": HOME | {"goal_views": 100},
    "path-integration": HOME | {"senses": "stankiewicz-webb"},
    "central-complex": HOME,
    "blend": {
        "navigator": "blend one=lateral other=path-integration weight=0.3",
        "senses": "stankiewicz-webb",
        "lost_m": 3.0,
    },
    "loop-breaker": {"navigator": "loop-breaker navigator=(scan width_deg=360)"},
}
BASE = {"world": "tussock-field", "seed": 101, "route_length_m": 5.0, "size": "360x75", "threads": 1}
MODELS = ("perfect-memory", "infomax", "mushroom-body")
STEERING = (  # navigators that follow a route by any familiarity model
    "scan", "scan every=5", "scan coarse_deg=20", "stepped-scan width_deg=120 step_deg=10", "lateral", "opponent", "oscillator",
    "familiarity-modulated", "cast-and-surge", "blend one=lateral other=path-integration weight=0.3",
)  # fmt: skip
NOISE = 20.0  # degrees


def measure_pictures(folder: Path) -> Values:
    """One walk of each navigator, drawn into assets."""
    walks, digests = {}, {}
    for name in NAVIGATORS.builtin:
        experiment = experiment_of(BASE | ALONG | {"navigator": name} | NAMED.get(name, {}))
        with experiment.opened() as trained:
            steps, trajectory = [], Trajectory()
            for (step,) in steps_of([experiment], trained):
                if step is not None:
                    trajectory.add(*step)
                    steps.append(step[0])
            draw(folder / f"{name}.png", experiment, trained, steps)
        summary = trajectory.summary()
        walks[name] = {key: summary[key] for key in ("reason", "steps", "mean_deviation_m", "looks_per_m", "goal_m")}
        digests[f"steering/{name}.png"] = keep(folder / f"{name}.png", f"steering/{name}.png")
    return {"walks": walks, "pictures": digests}


def draw(path: Path, experiment: Experiment, trained, steps: Sequence[Step]) -> None:
    """Draw a walk from above, and beside it what it was steered by."""
    xy = np.array([step.pose[:2] for step in steps])
    with matplotlib.rc_context(STYLE | {"font.size": 10}):
        figure = matplotlib.figure.Figure(figsize=(9, 3.6), layout="constrained")
        from_above, over_time = figure.subplots(1, 2, width_ratios=[1, 1.25])
        draw_map(from_above, trained.renderer.world, np.concatenate([xy, trained.route.xy]))
        draw_route(from_above, trained.route)
        from_above.plot(*xy.T, color=PATH_COLOUR, lw=1.4)
        from_above.plot(*xy[0], "o", color=PATH_COLOUR, ms=6, mec="white")
        from_above.set_title(f"{experiment.navigator}: {steps[-1].reason}")
        for colour, (name, values) in zip(
            (PATH_COLOUR, ROUTE_COLOUR, CURVE_COLOUR, SOFT_COLOUR), lines_of(steps).items(), strict=False
        ):
            over_time.plot(values, color=colour, lw=1.3, label=name)
        over_time.set(xlabel="step", title="what it steers by")
        over_time.legend(loc="best", framealpha=0.9)
        save_picture(figure, path)


def lines_of(steps: Sequence[Step]) -> dict[str, np.ndarray]:
    """What is drawn over the steps: numbers that the navigator reports, the length of its vectors, and else its turns."""
    lines: dict[str, list[float]] = {}
    for name in steps[0].signals:
        values = [np.asarray(step.signals[name]) for step in steps]
        if values[0].ndim == 0:
            lines[name.replace("_", " ")] = [float(value) for value in values]
        elif values[0].shape == (2,):
            lines[f"length of the {name.replace('_', ' ')}"] = [float(np.hypot(*value)) for value in values]
    if not lines:
        lines["turn (degrees)"] = [math.degrees(step.aim) for step in steps]
    return {name: np.array(values) for name, values in lines.items()}


def measure_looks(folder: Path) -> Values:
    """Walks in the first two worlds of each preset in the test bed by navigators and models: arrivals, and looks a metre."""
    base = {"size": "360x75", "spacing-m": 0.4, "route-length-m": 8.0, "heading-noise-deg": NOISE, "threads": 1}
    axes = {
        "navigator": list(STEERING),
        "model": list(MODELS),
        "place": [{"world": world, "seed": seed} for world, seed in BENCHMARK.worlds if seed % 100 < 2],
        "offset-m": list(BENCHMARK.displacements),
    }
    table = sweep(folder, "looks", base, axes)
    groups = table.groupby(["navigator", "model"], sort=False)
    written = {str(NAVIGATORS.spec(name)): name for name in STEERING}  # as above, with angles in degrees
    rows = {
        f"{written[navigator]} | {model}": {
            "arrived": [int(group["arrived"].sum()), len(group)],
            "looks_per_m": round(float(group["looks_per_m"].median()), 1),
        }
        for (navigator, model), group in groups
    }
    draw_looks(folder / "looks.png", rows)
    return {"rows": rows, "pictures": {"steering/looks.png": keep(folder / "looks.png", "steering/looks.png")}}


def draw_looks(path: Path, rows: Values) -> None:
    """Draw the share of walks that arrived over the looks that each took for a metre."""
    colours = dict(zip(MODELS, (PATH_COLOUR, ROUTE_COLOUR, "#2b8a6f"), strict=True))
    with matplotlib.rc_context(STYLE | {"font.size": 10}):
        figure = matplotlib.figure.Figure(figsize=(8, 4.6), layout="constrained")
        axes = figure.subplots()
        for name, row in rows.items():
            navigator, _, model = name.partition(" | ")
            arrived, walks = row["arrived"]
            axes.plot(row["looks_per_m"], arrived / walks, "o", color=colours[model], ms=6)
            if model == MODELS[0]:
                axes.annotate(
                    navigator.partition(" one=")[0].partition(" width")[0],
                    (row["looks_per_m"], arrived / walks),
                    xytext=(5, 4 if navigator != "oscillator" else -11),
                    textcoords="offset points",
                    fontsize=8,
                )
        for model, colour in colours.items():
            axes.plot([], [], "o", color=colour, label=model)
        axes.set(xscale="log", xlabel="looks a metre", ylabel="share of walks that arrived", ylim=(-0.03, 1.08))
        axes.legend(loc="upper left")
        axes.set_xlim(12, 6000)
        save_picture(figure, path)


def table_of_looks(values: Values) -> str:
    """One line for each navigator."""
    names = list(dict.fromkeys(name.partition(" | ")[0] for name in values["rows"]))
    rows = [
        [f"`{name}`", f"{values['rows'][f'{name} | {MODELS[0]}']['looks_per_m']:g}"]
        + [of(values["rows"][f"{name} | {model}"]["arrived"]) for model in MODELS]
        for name in names
    ]
    return markdown(["navigator", "looks a metre", *(f"{model}: arrived" for model in MODELS)], rows)


def table_of_walks(values: Values) -> str:
    """One line for the walk of each picture."""
    rows = [
        [f"`{name}`", walk["reason"], str(walk["steps"]), f"{walk['looks_per_m']:.0f}", f"{walk['goal_m']:.2f} m"]
        for name, walk in values["walks"].items()
    ]
    return markdown(["navigator", "end of the walk", "steps", "looks a metre", "from the goal in the end"], rows)


MEASUREMENTS: dict[str, Measurement] = {
    "steering": Measurement("`docs/numbers/steering.py`", measure_pictures, {"walks": table_of_walks}, slow=True),
    "looks": Measurement(
        "a sweep of `navigator`, `model` and `offset-m` in the test bed's worlds",
        measure_looks,
        {"table": table_of_looks},
        slow=True,
    ),
}
