"""What a world looks like from the ground, in numbers: skyline, contrast, distances, image differences, and places that look alike.

Each number is measured at sampled positions. They are for comparing worlds, with one another and with measurements outdoors:

- *skyline*: the elevation up to which things cover the sky, in each direction (up to the upper edge of the view, 60 degrees); its mean,
  its standard deviation around the circle, and the power of its variation by frequency (cycles around the circle).
- *contrast*: the standard deviation of brightness over its mean, from 5 degrees below the horizon to 30 above it, and its power by
  frequency along the horizon.
- *distance* of what is seen above the horizon: quartiles over the pixels, by solid angle; and the share of the view there that is not
  sky.
- *rotation*: depth and width of the valley of the rotational image difference, between views APART from each other (Zeil, Hofmann and
  Chahl 2003).
- *catchment*: how far from a place the image difference at its heading keeps on growing, or to the edge of
  the world, on average over four directions.
- *aliased*: the share of places that are taken for another one: the view APART beside it is more similar to that of another place,
  each at its best rotation.
"""

from dataclasses import dataclass, field
from typing import Any

import attrs
import numpy as np
from jaxtyping import Float

from tussock.render.eye import Eye
from tussock.render.renderer import Renderer
from tussock.render.scanline import ScanlineRenderer
from tussock.world.errors import SettingError
from tussock.world.obstacles import clearance
from tussock.world.progress import Progress, printed
from tussock.world.scene import World

from ..encoding import Encoding
from ..eye_encoding import EyeEncoding
from ..models.base import Images
from .image_difference import differences, displaced
from .valley import valley_of_rotations

APART = 0.1  # m between two views that are compared
STEP, REACH = 0.1, 2.0  # m of the displacements that are tried for the catchment
ROOM = 0.02  # m around a position
BAND = (30.0, -5.0)  # deg of elevation over which contrast is measured
FITTED = (2, 40)  # cycles around the circle between which spectra are fitted
EYE = Eye(width=360, height=75, samples=1)  # whose views are measured
GREY = Encoding.named("grey", resize=3)
STACKS = ("skylines", "skyline_power", "contrast_power", "rotation", "growth")  # arrays of a description
MEASURES = {  # of a description, with their labels
    "skyline_deg": "skyline: mean elevation (deg)",
    "skyline_roughness_deg": "skyline: standard deviation around the circle (deg)",
    "covered": "share of the view above the horizon that is not sky",
    "distance_25_m": "distance above the horizon: lower quartile (m)",
    "distance_m": "distance above the horizon: median (m)",
    "distance_75_m": "distance above the horizon: upper quartile (m)",
    "contrast": "contrast (standard deviation / mean)",
    "rotation_depth": "image difference: depth of the valley of turns",
    "rotation_width_deg": "image difference: width of that valley (deg)",
    "catchment_m": "image difference: how far it keeps growing (m)",
    "aliased": "places taken for another one (share)",
}
ROUND = 24  # positions that are tried for each that is wanted


@dataclass(frozen=True, kw_only=True)
class Description:
    """What was measured at each position.

    Attributes:
        poses: (n, 3) Where (m, m, rad).
        values: By the name of a measure, its number at each position; nan where it has none.
        skylines: (n, columns) Elevation up to which things cover the sky (deg), from behind over the left and ahead to behind.
        skyline_power: (n, frequencies) Power of the skyline (deg^2) at 1, 2, .. cycles around the circle.
        contrast_power: (n, frequencies) Power of contrast likewise.
        rotation: (n, w) The rotational image difference between views APART from each other.
        growth: (n, k) The image difference at displacements of STEP, 2 STEP, .. up to REACH, mean over directions.
    """

    poses: Float[np.ndarray, "n 3"]
    values: dict[str, Float[np.ndarray, " n"]] = field(repr=False)
    skylines: Float[np.ndarray, "n columns"] = field(repr=False)
    skyline_power: Float[np.ndarray, "n f"] = field(repr=False)
    contrast_power: Float[np.ndarray, "n f"] = field(repr=False)
    rotation: Float[np.ndarray, "n w"] = field(repr=False)
    growth: Float[np.ndarray, "n k"] = field(repr=False)

    def table(self) -> dict[str, dict[str, float | None]]:
        """Each measure over the positions: its mean, standard deviation, and 5th and 95th percentile; None where no position has it."""
        return {name: _summary(values) for name, values in self.values.items()}

    def slopes(self) -> dict[str, float]:
        """How the mean power falls with frequency: the exponent, fitted over FITTED."""
        return {
            name: _slope(power) for name, power in (("skyline", self.skyline_power), ("contrast", self.contrast_power))
        }


def sampled_poses(world: World, places: int, seed: int = 0) -> Float[np.ndarray, "n 3"]:
    """Random positions in a world with ROOM around them, at random headings.

    Raises:
        SettingError: Where too few can be found.
    """
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = world.field
    tried = rng.uniform((x0, y0), (x1, y1), (ROUND * places, 2))
    tried = tried[world.stands(tried)]
    free = tried[clearance(world, tried) >= ROOM][:places]
    if len(free) < places:
        raise SettingError(
            f"only {len(free)} of {ROUND * places} random positions have {100 * ROOM:g} cm of room; give fewer places"
        )
    return np.column_stack([free, rng.uniform(-np.pi, np.pi, places)])


def describe(
    world: World, poses: Float[np.ndarray, "n 3"], *, z: float = EYE.z, progress: Progress | None = None
) -> Description:
    """Measure a world at some poses.

    Args:
        world: The world.
        poses: See `sampled_poses`.
        z: Height of the eye (m).
        progress: Called with how many are done, of how many; None prints a line where it takes long, `no_progress` none.
    """
    progress, eye = printed(progress, "describing", "places"), attrs.evolve(EYE, z=z)
    encoded, rows = GREY.for_eye(eye), []
    with ScanlineRenderer(world, eye) as renderer:
        beside = encoded(renderer.render(_inside(world, displaced(poses, 0.0, APART), poses)))
        here = encoded(renderer.render(poses))
        alike = differences(beside, here).min(axis=2)
        for k, pose in enumerate(poses[:, None]):
            rows.append(_measure(renderer, pose, encoded, here[k : k + 1]))
            rows[-1]["rotation"] = differences(beside[k : k + 1], here[k : k + 1])[0, 0]
            progress(k + 1, len(poses))
    valleys = [valley_of_rotations(row["rotation"]) for row in rows]
    for k, (row, each) in enumerate(zip(rows, valleys, strict=True)):
        row["rotation_depth"] = each.depth
        row["rotation_width_deg"] = np.nan if each.width is None else np.degrees(each.width)
        row["aliased"] = float(alike[k].argmin() != k)
    values = {name: np.array([row[name] for row in rows]) for name in MEASURES}
    stacks = {name: np.array([row[name] for row in rows]) for name in STACKS}
    return Description(poses=poses, values=values, **stacks)


def _measure(
    renderer: ScanlineRenderer, pose: Float[np.ndarray, "1 3"], encoded: EyeEncoding, here: Images
) -> dict[str, Any]:
    """The measures at one pose that need no other one."""
    view, eye = renderer.render(pose)[0], renderer.eye
    elevations = np.degrees(eye.elevations())
    covered = view[..., 3] >= 128
    highest = np.where(covered.any(axis=0), elevations[covered.argmax(axis=0)], np.degrees(eye.bottom))
    skyline = np.maximum(highest, 0.0)
    band = (elevations <= BAND[0]) & (elevations >= BAND[1])
    grey = Encoding.parse("grey | scale 1")(view[None]).numpy()[0][band]
    contrast = grey / max(float(grey.mean()), 1e-9) - 1
    away = renderer.hits(pose)[0][0][elevations > 0]
    weights = np.broadcast_to(np.cos(np.radians(elevations[elevations > 0]))[:, None], away.shape)
    seen = np.isfinite(away)
    quartiles = _weighted(away[seen], weights[seen], (0.25, 0.5, 0.75))
    growth = _growth(renderer, pose, encoded, here)
    return {
        "skyline_deg": skyline.mean(),
        "skyline_roughness_deg": skyline.std(),
        "contrast": float(contrast.std()),
        "distance_25_m": quartiles[0],
        "distance_m": quartiles[1],
        "distance_75_m": quartiles[2],
        "covered": float(weights[seen].sum() / weights.sum()),
        "catchment_m": np.mean([_climb(curve) for curve in growth]),
        "skylines": skyline,
        "skyline_power": _power(skyline[None]),
        "contrast_power": _power(contrast),
        "growth": np.ma.masked_invalid(growth).mean(axis=0).filled(np.nan),
    }


def _growth(
    renderer: Renderer, pose: Float[np.ndarray, "1 3"], encoded: EyeEncoding, here: Images
) -> Float[np.ndarray, "4 k"]:
    """The image difference from a view at its heading, at STEP, 2 STEP, .. in four directions; nan beyond the world."""
    steps = np.arange(STEP, REACH + STEP / 2, STEP)
    curves = np.full((4, len(steps)), np.nan)
    for curve, (forward, left) in zip(curves, ((1, 0), (-1, 0), (0, 1), (0, -1)), strict=True):
        moved = np.concatenate([displaced(pose, forward * step, left * step) for step in steps])
        usable = renderer.world.field.contains(*moved[:, :2].T) & renderer.world.stands(moved[:, :2])
        if usable.any():
            off = (encoded(renderer.render(moved[usable])) - here).square().mean(dim=(1, 2)).sqrt()
            curve[usable] = off.numpy()
    return curves


def _climb(curve: Float[np.ndarray, " k"]) -> float:
    """How far a difference keeps on growing (m)."""
    rises = np.diff(np.r_[0.0, curve]) > 0  # False for nan
    return STEP * (len(curve) if rises.all() else int(rises.argmin()))


def _inside(world: World, moved: Float[np.ndarray, "n 3"], poses: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Poses beside others; on the other side of those at the edge of the world."""
    usable = world.field.contains(*moved[:, :2].T) & world.stands(moved[:, :2])
    return np.where(usable[:, None], moved, displaced(poses, 0.0, -APART))


def _power(rows: Float[np.ndarray, "r w"]) -> Float[np.ndarray, " f"]:
    """Mean power at 1, 2, .. cycles around the circle: together the variance around it."""
    width = rows.shape[1]
    power = np.square(np.abs(np.fft.rfft(rows) / width)).mean(axis=0)[1:]
    power[: (width - 1) // 2] *= 2
    return power


def _slope(power: Float[np.ndarray, "n f"]) -> float:
    frequency = np.arange(FITTED[0], FITTED[1] + 1)
    mean = np.maximum(power.mean(axis=0)[frequency - 1], 1e-30)
    return float(np.polyfit(np.log(frequency), np.log(mean), 1)[0])


def _weighted(
    values: Float[np.ndarray, " n"], weights: Float[np.ndarray, " n"], shares: tuple[float, ...]
) -> Float[np.ndarray, " k"]:
    """Quantiles of values with weights; nan where there are none."""
    if len(values) == 0:
        return np.full(len(shares), np.nan)
    order = values.argsort()
    below = (weights[order].cumsum() - weights[order] / 2) / weights.sum()
    return np.interp(shares, below, values[order])


def _summary(values: Float[np.ndarray, " n"]) -> dict[str, float | None]:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return dict.fromkeys(("mean", "sd", "p5", "p95"))
    low, high = np.percentile(known, [5, 95]).tolist()
    return {"mean": float(known.mean()), "sd": float(known.std()), "p5": low, "p95": high}
