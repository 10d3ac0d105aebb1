"""The measurements of compound eyes in docs/eyes.md: what each sees, and headings by numbers of ommatidia and acceptance angles."""

from itertools import product
from pathlib import Path

import cv2
import matplotlib
import numpy as np
from matplotlib.figure import Figure
from measurement import Measurement, Values, markdown, tussock
from pictures import WORLD_SEED, keep

from tussock import World, compound_eye, draw_ommatidia, draw_panorama, generate_route, open_renderer
from tussock.navigation.reports.drawing import STYLE, save_picture
from tussock.render.receptors import receptors_of

EYES = ("ant", "fly", "sphere", "bee")
NUMBERS, ACCEPTANCES, MODELS, SEEDS = (
    (30, 100, 300, 1000),
    (4, 8, 16, 32),
    ("perfect-memory", "mushroom-body"),
    range(5),
)
FIELDS = (360, 296, 180, 90)
WALK = ("--world", "tussock-field", "--route-length-m", 4, "--spacing-m", 0.05, "--grid-m", 0.1, "--encoding", "sky")


def measure_eyes(folder: Path) -> Values:
    """The pictures: what each eye sees at one place."""
    world = World.generate("tussock-field", seed=WORLD_SEED)
    start = generate_route(world, WORLD_SEED, length=2.0).start
    counts, rows, drawn = {}, {}, {}
    for name in ("panorama", *EYES):
        picture = folder / f"{name}.png"
        if name == "panorama":
            with open_renderer(world) as renderer, matplotlib.rc_context(STYLE):
                figure = Figure(figsize=(9, 2.2), layout="constrained")
                draw_panorama(figure.subplots(), renderer.render([start])[0])
                save_picture(figure, picture)
        else:
            eye = compound_eye(name)
            counts[name], rows[name] = len(receptors_of(eye).row), len(receptors_of(eye).starts) - 1
            with open_renderer(world, eye) as renderer:
                seen = draw_ommatidia(renderer.render([start])[0], eye)
            cv2.imwrite(str(picture), cv2.cvtColor(seen[..., :3], cv2.COLOR_RGB2BGR))
        drawn[f"eyes/{name}.png"] = keep(picture, f"eyes/{name}.png")
    return {"ommatidia": counts, "rows": rows, "pictures": drawn}


def measure_ommatidia(folder: Path) -> Values:
    """Mean errors of headings (deg) beside routes in five worlds, and their figure."""
    grid = {
        model: {
            str(number): {
                str(angle): error(folder, model, f"sphere ommatidia={number} acceptance_deg={angle}")
                for angle in ACCEPTANCES
            }
            for number in NUMBERS
        }
        for model in MODELS
    }
    ant = {
        model: {str(field): error(folder, model, "ant", "--field-deg", field) for field in FIELDS} for model in MODELS
    }
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 3.2), layout="constrained")
        for axes, (model, by_number) in zip(figure.subplots(1, 2, sharey=True), grid.items(), strict=True):
            for number, by_angle in by_number.items():
                axes.plot(
                    ACCEPTANCES, [np.mean(errors) for errors in by_angle.values()], "o-", label=f"{int(number):,}"
                )
            axes.set(
                xscale="log", title=model, xlabel="acceptance angle (deg)", xticks=ACCEPTANCES, xticklabels=ACCEPTANCES
            )
            axes.minorticks_off()
        figure.axes[0].set_ylabel("mean error of headings (deg)")
        figure.axes[0].legend(title="ommatidia")
        save_picture(figure, folder / "acceptance.png")
    return {
        "grid": grid,
        "ant": ant,
        "pictures": {"eyes/acceptance.png": keep(folder / "acceptance.png", "eyes/acceptance.png")},
    }


def error(folder: Path, model: str, eye: str, *flags: object) -> list[float]:
    """The mean error of headings (deg) in each world."""
    return [
        tussock(folder, "evaluate", *WALK, "--seed", seed, "--model", model, "--eye", eye, *flags)["mean_error_deg"]
        for seed in SEEDS
    ]


def table(values: Values) -> str:
    """One line for each model and number of ommatidia."""
    rows = (
        [
            model,
            f"{number:,}",
            *(f"{np.mean(values['grid'][model][str(number)][str(angle)]):.1f}" for angle in ACCEPTANCES),
        ]
        for model, number in product(MODELS, NUMBERS)
    )
    return markdown(["model", "ommatidia", *(f"{angle} degrees" for angle in ACCEPTANCES)], rows)


def table_of_fields(values: Values) -> str:
    """One line for each model."""
    rows = ([model, *(f"{np.mean(values['ant'][model][str(field)]):.1f}" for field in FIELDS)] for model in MODELS)
    return markdown(["model", *(f"{field} degrees" for field in FIELDS)], rows)


MEASUREMENTS: dict[str, Measurement] = {
    "eyes": Measurement(
        f"`compound_eye` in a tussock-field of seed {WORLD_SEED}",
        measure_eyes,
        {f"{name}": lambda values, name=name: f"{values['ommatidia'][name]:,}" for name in EYES}
        | {f"{name}-rows": lambda values, name=name: f"{values['rows'][name]:,}" for name in EYES},
    ),
    "ommatidia": Measurement(
        "`tussock evaluate --eye 'sphere ommatidia=N acceptance_deg=A'`",
        measure_ommatidia,
        {"table": table, "fields": table_of_fields},
        slow=True,
    ),
}
