"""The figures of docs/changes.md: the same place before and after each change, at the height of an eye."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from measurement import Measurement, Values
from pictures import keep

from tussock import Experiment, Eye, Route, World, draw_panorama, generate_route
from tussock.navigation.changed_world import changed_views
from tussock.navigation.reports.drawing import STYLE, save_picture

WORLD, SEED = "tussock-field", 7
SHOWN = {  # a change, and how much of it the figure shows
    "removed": "removed amount=0.5",
    "moved": "moved amount=0.5",
    "added": "added amount=0.5",
    "grown": "grown amount=0.5",
    "mown": "mown amount=0.7",
    "wind": "wind amount=0.7 direction_deg=180",
    "object": "object amount=0.6",
    "eye-raised": "eye-raised amount=1",
    "eye-turned": "eye-turned amount=1",
}


def measure_changes(folder: Path) -> Values:
    """Draw the figures, and count plants."""
    world = World.generate(WORLD, seed=SEED)
    whole, drawn = generate_route(world, seed=SEED, length=4.0), {}
    route = Route(whole.at(np.arange(2.9, 4.0, 0.1)))  # next to whose middle a new object stands
    pose = whole.at([3.2])[0]  # near a tussock
    for name, text in SHOWN.items():
        experiment = Experiment(world=world, eye=Eye(), test_change=text, change_seed=SEED)
        with experiment.open_renderer(world) as before, changed_views(experiment, before, route) as after:
            views = [renderer.render(np.array([pose]))[0] for renderer in (before, after)]
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(8, 3.9), layout="constrained")
            rows = figure.subplots(2)
            for axes, view, title in zip(rows, views, ("before", text), strict=True):
                draw_panorama(axes, view, title=title)
            rows[0].set_xlabel("")
            save_picture(figure, folder / f"{name}.png")
        drawn[f"changes/{name}.png"] = keep(folder / f"{name}.png", f"changes/{name}.png")
    plants = [len(each.plants or ()) for each in (world, world.changed(SHOWN["removed"], SEED))]
    return {"plants": plants, "pictures": drawn}


MEASUREMENTS: dict[str, Measurement] = {
    "changes": Measurement(
        f"the figures of {WORLD} with seed {SEED}",
        measure_changes,
        {
            "before": lambda values: f"{values['plants'][0]:,}",
            "after": lambda values: f"{values['plants'][1]:,}",
        },
    ),
}
