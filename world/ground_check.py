"""A remark where a world from a file seems to have a ground of its own, and agents do not stand on it."""

import logging

import numpy as np

from .errors import InputError
from .scene import World

log = logging.getLogger(__name__)

SAMPLES = 32  # positions along each side of the field at which the ground is looked for
MIN_COVERED = 0.5  # of the field: what covers less is not taken for the ground
MAX_MISFIT = 0.05  # of the ground; more than noise and a few stones
TOLERANCE = 0.02  # m; how far the ground may lie under z = 0
FAR = 0.5  # m from z = 0, of a world whose ground is not recognised
_looked_at: set[str] = set()  # worlds in this process, so that a sweep looks once


def remark_on_ground(world: World, name: str, eye_z: float) -> None:
    """Warn, once for each world, where an eye this far (m) above z = 0 would not stand on the ground of a world from a file."""
    if name in _looked_at:
        return
    _looked_at.add(name)
    low, high = world.triangles[..., 2].min(), world.triangles[..., 2].max()
    ground = None if world.ground is not None else _ground_off_zero(world, abs(eye_z))
    if ground is not None:
        what = f"its ground runs from z = {ground[0]:.2f} to {ground[1]:.2f} m"
    elif low > FAR or high < 0 or (low < -FAR and world.ground is None):
        what = f"its surfaces run from z = {low:.2f} to {high:.2f} m"
    else:
        return
    log.warning(
        f"{name}: {what}, and agents stand at z = 0 (--ground flat); --ground mesh lets them stand on its surface"
    )


def _ground_off_zero(world: World, eye_z: float) -> tuple[float, float] | None:
    """The lowest and the highest z of what looks like a ground, where an eye this far (m) above z = 0 is in it or far above it."""
    try:
        world = world.on_mesh()
    except InputError:  # it has none
        return None
    (x0, y0, x1, y1), share = world.field, (np.arange(SAMPLES) + 0.5) / SAMPLES
    x, y = np.meshgrid(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
    height = world.ground_height(np.column_stack([x.ravel(), y.ravel()]))
    covered = height[~np.isnan(height)]
    if len(covered) < MIN_COVERED * SAMPLES**2:
        return None
    misfit = (covered > eye_z) | (covered < -max(TOLERANCE, eye_z))
    return (float(covered.min()), float(covered.max())) if misfit.mean() > MAX_MISFIT else None
