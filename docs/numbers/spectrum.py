"""The measurement of ultraviolet in docs/eyes.md: one place as people and as insects see it, and walks in another light."""

import math
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure
from measurement import Measurement, Values, arrivals, markdown, of, sweep
from pictures import keep

from tussock import Encoding, Eye, Light, World, draw_panorama, lit, open_renderer
from tussock.navigation.reports.drawing import STYLE, save_picture
from tussock.world.change import Change

POSE, SEED = (4.3, 5.1, 0.3), 3
LIGHT = Light(azimuth=math.radians(143), elevation=math.radians(30))
CHANGES = {"the same light": "sun amount=0", "4 hours later": "sun amount=1 hours=4", "overcast": "clouds amount=1"}
ENCODINGS, SPECTRA = ("grey", "uv", "uv-green"), ("human", "insect")
FIXED = {
    "light": "sun azimuth_deg=-20 elevation_deg=35", "model": "perfect-memory", "size": "360x75", "route-length-m": 4.0,
    "offset-m": 0.1, "heading-noise-deg": 10.0,
}  # fmt: skip
WORLDS, SEEDS = ["tussock-field", "meadow", "scrub"], list(range(10))


def measure(folder: Path) -> Values:
    """The picture, and how many walks arrive, by encoding, spectrum and light."""
    draw(folder / "insect.png")
    axes = {"encoding": list(ENCODINGS), "spectrum": list(SPECTRA), "test-change": list(CHANGES.values())}
    walks = sweep(folder, "walks", FIXED, axes | {"world": WORLDS, "seed": SEEDS})
    arrived = {
        f"{encoding}, {spectrum}": arrivals(some, "test_change")
        for (encoding, spectrum), some in walks.groupby(["encoding", "spectrum"], sort=False)
    }
    return {"pictures": {"eyes/insect.png": keep(folder / "insect.png", "eyes/insect.png")}, "arrived": arrived}


def draw(path: Path) -> None:
    """One place in the light of a sun, as people see it, in false colours, and in two encodings."""
    world = lit(World.generate("tussock-field", seed=SEED), LIGHT)
    people, insect = Eye(z=0.05), Eye(z=0.05, spectrum="insect")
    views = []
    for eye in (people, insect):
        with open_renderer(world, eye) as renderer:
            views.append(renderer.render([POSE]))
    shown = [("people", views[0][0]), ("insects, ultraviolet shown as red", views[1][0])]
    for name, low, high in (("uv", 0.0, 1.0), ("uv-green", -0.6, 0.6)):
        image = Encoding.named(name).for_eye(insect)(views[1])[0].numpy()
        grey = (255 * (image - low) / (high - low)).round().clip(0, 255).astype("uint8")
        shown.append((f"the encoding {name}, {low:g} to {high:g}", grey[..., None].repeat(3, axis=2)))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 7.2), layout="constrained")
        for axes, (title, view) in zip(figure.subplots(len(shown), sharex=True), shown, strict=True):
            draw_panorama(axes, view)
            axes.set_title(title, fontsize=9, loc="left")
            axes.label_outer()
        save_picture(figure, path)


def table(values: Values) -> str:
    """One line for each encoding and spectrum."""
    rows = [
        [
            f"`{name.split(', ')[0]}`",
            name.split(", ")[1],
            *(of(arrived[str(Change.parse(change))]) for change in CHANGES.values()),
        ]
        for name, arrived in values["arrived"].items()
    ]
    return markdown(["encoding", "spectrum", *CHANGES], rows)


MEASUREMENTS = {
    "spectrum": Measurement("a sweep of `encoding`, `spectrum` and `test-change`", measure, {"table": table}, slow=True)
}
