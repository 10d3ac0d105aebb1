"""The measurement of docs/light.md: pictures of lights and of the sky, and how well a compass in the sky reads."""

import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from measurement import Measurement, Values, markdown
from pictures import keep

from tussock import Eye, Light, World, draw_panorama, lit, open_renderer
from tussock.navigation.reports.drawing import STYLE, save_picture
from tussock.navigation.sky_compass import DorsalRim
from tussock.world.geometry import wrap_angle
from tussock.world.light import polarisation, sky_luminance

POSE, SEED = (4.3, 5.1, 0.3), 3
LIGHTS = {  # by the titles of their panoramas
    "without a light": None,
    "sun azimuth_deg=-60 elevation_deg=45": Light(),
    "sun azimuth_deg=143 elevation_deg=12": Light(azimuth=math.radians(143), elevation=math.radians(12)),
    "sun azimuth_deg=143 elevation_deg=12 clouds=0.6": Light(
        azimuth=math.radians(143), elevation=math.radians(12), clouds=0.6
    ),
    "overcast": Light(clouds=1.0),
}
READINGS = 500


def measure(folder: Path) -> Values:
    """Pictures, and errors of the compass."""
    draw_lights(folder / "lights.png")
    draw_sky(folder / "sky.png")
    names = ("light/lights.png", "light/sky.png")
    errors = {
        f"{clouds:g}": {f"{tilt}": compass_error(clouds, math.radians(tilt)) for tilt in (0, 10, 20)}
        for clouds in (0.0, 0.5, 0.9)
    }
    return {"pictures": {name: keep(folder / Path(name).name, name) for name in names}, "errors_deg": errors}


def draw_lights(path: Path) -> None:
    """One place in several lights."""
    world = World.generate("tussock-field", seed=SEED)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 10.5), layout="constrained")
        for axes, (title, light) in zip(figure.subplots(len(LIGHTS)), LIGHTS.items(), strict=True):
            with open_renderer(world if light is None else lit(world, light), Eye(z=0.05)) as renderer:
                draw_panorama(axes, renderer.render([POSE])[0])
            axes.set_title(title, fontsize=9, loc="left")
        save_picture(figure, path)


def draw_sky(path: Path) -> None:
    """The sky as on a map, north at the top: brightness and polarisation, for a low sun."""
    light = Light(azimuth=math.radians(143), elevation=math.radians(20))
    azimuth, zenith = np.meshgrid(np.linspace(0, 2 * np.pi, 361), np.linspace(0, np.pi / 2, 91))
    level = np.sin(zenith)
    directions = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.cos(zenith)], axis=-1)
    flat = directions.reshape(-1, 3)
    degree, _ = polarisation(light, flat)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 3.9), layout="constrained")
        shown = {
            "brightness, as a multiple of that overhead": np.minimum(sky_luminance(light, flat), 8),
            "degree of polarisation, and e-vectors": degree,
        }
        for axes, (title, values) in zip(
            figure.subplots(1, 2, subplot_kw={"projection": "polar"}), shown.items(), strict=True
        ):
            colours = axes.pcolormesh(
                azimuth, np.degrees(zenith), values.reshape(zenith.shape), cmap="cividis", rasterized=True
            )
            figure.colorbar(colours, ax=axes, shrink=0.75, pad=0.1)
            axes.set_title(title, fontsize=9)
            axes.set_xticks(np.radians([0, 90, 180, 270]), ["east", "north", "west", "south"])
            axes.set_yticks([30, 60, 90], ["", "", ""])
            axes.grid(alpha=0.4)
            axes.plot(light.azimuth, 90 - math.degrees(light.elevation), "o", color="#d95f02", ms=7, mec="white")
        _draw_vectors(axes, light)
        save_picture(figure, path)


def _draw_vectors(axes, light: Light) -> None:
    """Short lines along e-vectors."""
    for zenith in np.radians([15, 30, 45, 60, 75]):
        for azimuth in np.linspace(0, 2 * np.pi, round(24 * math.sin(zenith)) + 4, endpoint=False):
            level = math.sin(zenith)
            at = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.cos(zenith)])
            _, (vector,) = polarisation(light, at[None])
            ends = [(at + sign * 0.06 * vector) for sign in (-1, 1)]
            axes.plot(
                [math.atan2(end[1], end[0]) for end in ends],
                [math.degrees(math.acos(end[2] / np.linalg.norm(end))) for end in ends],
                color="white",
                lw=1,
            )


def compass_error(clouds: float, tilt: float) -> float:
    """Median error of readings at random headings, with the head pitched in a random direction by so much (degrees)."""
    random, rim = np.random.default_rng(0), DorsalRim(unit_noise=0.05)
    light = Light(azimuth=math.radians(143), elevation=math.radians(30), clouds=clouds)
    errors = []
    for _ in range(READINGS):
        heading, side = random.uniform(-np.pi, np.pi, 2).tolist()
        posture = tilt * math.cos(side), tilt * math.sin(side)
        errors.append(abs(float(wrap_angle(rim.heading(light, heading, posture, random, None) - heading))))
    return math.degrees(float(np.median(errors)))


def table(values: Values) -> str:
    """One line for each cover of clouds."""
    return markdown(
        ["clouds", "level head", "tilted by 10 degrees", "by 20 degrees"],
        [[clouds, *(f"{error:.1f}" for error in errors.values())] for clouds, errors in values["errors_deg"].items()],
    )


MEASUREMENTS = {"light": Measurement("`lit` and `DorsalRim` in a tussock-field of seed 3", measure, {"errors": table})}
