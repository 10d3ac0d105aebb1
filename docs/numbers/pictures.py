"""The measurements of the pictures in assets: the walks that they show, and the models' familiarity."""

import hashlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import matplotlib
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from measurement import ROOT, Measurement, Values, tussock

from tussock import Pose, World, draw_panorama, draw_world, generate_route, open_renderer
from tussock.navigation.reports.drawing import PATH_COLOUR, STYLE, save_picture
from tussock.world.params import WORLDS

ASSETS = ROOT / "assets"
BLOCK = 16  # pixels; a picture looks different where the mean of such a block differs by more than TOLERANCE
TOLERANCE = 8  # grey levels
TIMELINE = 40  # rows at the bottom of the viewer, whose marks depend on how quickly the recording was written
DRAWN_AT = 58  # step of the walk at which the panorama is taken

WORLD_SEED = 7
SHOWN = {name: name for name in WORLDS.builtin} | {
    "relief": "tussock-field hill_height=0.6 rut_depth=0.08 mound_density=0.2"
}  # figures of docs/worlds.md
WALK = ("--seed", 9, "--offset-m", 0.1)
LOST = ("--offset-m", 0.1, "--learning-walk-m", 0)
CAUSE = ("--seed", 3, "--size", "360x75", "--resize", 3, *LOST, "--scan-deg", 360)


def keep(drawn: Path, name: str, below: int = 0) -> str:
    """Put a picture into assets, unless the one there looks the same, or none was drawn.

    Args:
        drawn: The new picture.
        name: Of the picture in assets.
        below: Rows at the bottom that do not count.

    Returns:
        A digest of the pixels of the picture in assets.
    """
    if not drawn.exists():
        print(f"{name}: left as it is; it could not be drawn on this machine", file=sys.stderr)
        return digest(ASSETS / name)
    old, new = cv2.imread(str(ASSETS / name)), cv2.imread(str(drawn))
    same = slice(len(new) - below)
    if old is None or old.shape != new.shape or np.abs(blocks(old[same]) - blocks(new[same])).max() > TOLERANCE:
        (ASSETS / name).write_bytes(drawn.read_bytes())
    return digest(ASSETS / name)


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means of the blocks of a picture."""
    height, width = picture.shape[:2]
    return cv2.resize(picture.astype(np.float32), (width // BLOCK, height // BLOCK), interpolation=cv2.INTER_AREA)


def digest(path: Path) -> str:
    """Of the pixels of a picture."""
    return hashlib.sha256(cv2.imread(str(path)).tobytes()).hexdigest()


def walked(folder: Path, flags: tuple, picture: str) -> tuple[Values, pd.DataFrame]:
    """The summary and the steps of a walk; its recording is drawn into a picture."""
    summary = tussock(folder, "run", *flags, "--out", "run")
    screenshot = [sys.executable, "-m", "tussock", "play", "run", "--screenshot", "viewer.png"]
    subprocess.run(screenshot, cwd=folder, stdout=subprocess.DEVNULL)  # which fails without Vulkan
    names = ("reason", "steps", "mean_deviation_m", "max_deviation_m", "mean_error_deg", "cause", "causes")
    values = {name: summary[name] for name in names}
    return values | {"pictures": {picture: keep(folder / "viewer.png", picture, below=TIMELINE)}}, pd.read_csv(
        folder / "run" / "trajectory.csv"
    )


def measure_walk(folder: Path) -> Values:
    """The walk of README's picture, and what the agent sees at one of its steps."""
    values, steps = walked(folder, WALK, "recording.png")
    pose = steps.iloc[DRAWN_AT]
    at = f"{pose['x_m']},{pose['y_m']},{pose['heading_deg']}"
    tussock(folder, "view", "--seed", 9, "--at", at, "--out", "view.png")
    values["pictures"]["panorama.png"] = keep(folder / "view.png", "panorama.png")
    tussock(folder, "play", "run", "--video", "walk.gif", "--steps-per-second", 15)
    values["pictures"]["walk.gif"] = keep(folder / "walk.gif", "walk.gif")  # compared by its first frame
    return values


def measure_lost(folder: Path) -> Values:
    """The walk of docs/learning-walks.md, and how far it is from the route's end when it passes that."""
    values, steps = walked(folder, LOST, "lost.png")
    passes = steps["along_m"].idxmax()
    return values | {"deviation_at_the_end_m": float(steps["deviation_m"][passes])}


def measure_cause(folder: Path) -> Values:
    """The walk of docs/failures.md, and its first poor step."""
    values, steps = walked(folder, CAUSE, "cause.png")
    first = steps[steps["cause"].notna()].iloc[0]
    return values | {
        "first": {name: first[name] for name in ("cause", "deviation_m", "recognised_view_m")}
        | {"step": int(first["step"])}
    }


def measure_models(folder: Path) -> Values:
    """The figures of docs/models.md."""
    script = [sys.executable, str(ROOT / "docs" / "draw_models.py"), "--out", str(folder)]
    done = subprocess.run(script, check=True, stdout=subprocess.PIPE, text=True)
    names = sorted(path.name for path in folder.glob("*.png"))
    return {
        "turn_deg": float(done.stdout.split()[-1]),
        "pictures": {f"models/{name}": keep(folder / name, f"models/{name}") for name in names},
    }


def measure_worlds(folder: Path) -> Values:
    """The figures of docs/worlds.md: each preset, and one with hills, from above, and as an eye sees it at the start of a route."""
    drawn, triangles = {}, {}
    for name, text in SHOWN.items():
        world = World.generate(text, seed=WORLD_SEED)
        triangles[name] = len(world.triangles)
        start = Pose(0.0, 0.0, 0.0) if name == "orchard" else generate_route(world, WORLD_SEED, length=2.0).start
        with open_renderer(world) as renderer:
            view = renderer.render([start])[0]
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(8, 8.6), layout="constrained")
            above, seen = figure.subplots(2, height_ratios=[3, 1])
            draw_world(above, world)
            if name == "arena":  # whose wall is around the field
                above.set(xlim=world.ground.bounds[::2], ylim=world.ground.bounds[1::2])
            above.plot(start.x, start.y, "o", color=PATH_COLOUR, ms=6, mec="white")
            draw_panorama(seen, view)
            save_picture(figure, folder / f"{name}.png")
        drawn[f"worlds/{name}.png"] = keep(folder / f"{name}.png", f"worlds/{name}.png")
    return {"triangles": triangles, "pictures": drawn}


def triangles_of(name: str) -> Callable[[Values], str]:
    """How many triangles a world has."""
    return lambda values: f"{values['triangles'][name]:,}"


def centimetres(name: str) -> Callable[[Values], str]:
    """A distance as it is printed."""
    return lambda values: f"{100 * values[name]:.1f} cm"


MEASUREMENTS: dict[str, Measurement] = {
    "walk": Measurement(
        "`tussock run --seed 9 --offset-m 0.1`",
        measure_walk,
        {"deviation": centimetres("mean_deviation_m"), "steps": lambda values: str(values["steps"])},
    ),
    "lost": Measurement(
        "`tussock run --offset-m 0.1 --learning-walk-m 0`",
        measure_lost,
        {
            "error": lambda values: f"{values['mean_error_deg']:.1f} degrees",
            "at-the-end": centimetres("deviation_at_the_end_m"),
            "steps": lambda values: str(values["steps"]),
        },
    ),
    "cause": Measurement(
        "the command above the figure",
        measure_cause,
        {
            "step": lambda values: str(values["first"]["step"]),
            "deviation": lambda values: f"{values['first']['deviation_m']:.2f} m",
            "recognised": lambda values: f"{values['first']['recognised_view_m']:.2f} m",
            "first": lambda values: values["first"]["cause"],
            "cause": lambda values: values["cause"],
            "poor": lambda values: str(sum(values["causes"].values())),
            "off": lambda values: str(values["causes"]["off the catchment"]),
        },
    ),
    "worlds": Measurement(
        f"the presets with seed {WORLD_SEED}", measure_worlds, {name: triangles_of(name) for name in SHOWN}
    ),
    "figures": Measurement(
        "`python docs/draw_models.py`",
        measure_models,
        {"turn": lambda values: f"{values['turn_deg']:.0f} degrees"},
        slow=True,
    ),
}
