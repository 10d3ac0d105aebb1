"""How well a model recovers headings: pure functions from worlds and models to numbers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32

from tussock.render.renderer import Renderer
from tussock.world.errors import InputError
from tussock.world.geometry import Bounds, Route, wrap_angle

from .encoding import Encoding
from .models.base import FamiliarityModel, Images
from .scan import best_turn, scan_window

BATCH = 64  # views rendered, encoded and scored at once
RECOVERED_DEG = 45.0  # a heading less than this off counts as recovered


@dataclass(frozen=True, kw_only=True)
class HeadingErrors:
    """Recovered headings at positions beside a route, and how far off they are (equations 2 and 3 of the thesis).

    positions: (n, 2) m. headings: recovered (rad). nearest: index of the nearest route view (place recognition, 4.3.2), whose
    heading is the set one. errors: absolute difference between the two (rad, 0..pi).
    """

    positions: Float[np.ndarray, "n 2"]
    headings: Float[np.ndarray, " n"]
    nearest: np.ndarray
    errors: Float[np.ndarray, " n"]

    @property
    def median_error_deg(self) -> float:
        return float(np.median(np.degrees(self.errors)))

    @property
    def mean_error_deg(self) -> float:
        return float(np.mean(np.degrees(self.errors)))

    @property
    def share_over_45(self) -> float:
        return float(np.mean(np.degrees(self.errors) > RECOVERED_DEG))


def grid_positions(route: Route, *, grid: float, within: float, field: Bounds) -> Float[np.ndarray, "n 2"]:
    """The multiples of `grid` (m) in both axes that lie within `within` (m) of the route and inside the field."""
    if not (np.isfinite(grid) and grid > 0):
        raise InputError(f"a grid of {grid} m; give a spacing over 0")
    if not (np.isfinite(within) and within >= 0):
        raise InputError(f"positions within {within} m of the route; give a finite distance")
    low = np.ceil((route.xy.min(axis=0) - within) / grid).astype(int)
    high = np.floor((route.xy.max(axis=0) + within) / grid).astype(int)
    if (high - low + 1).prod() > 10**6:
        raise InputError(f"a grid of {grid:g} m has over a million positions around this route; give a wider one")
    x, y = np.meshgrid(np.arange(low[0], high[0] + 1) * grid, np.arange(low[1], high[1] + 1) * grid)
    xy = np.column_stack([x.ravel(), y.ravel()])
    distance, _ = route.nearest(xy) if len(xy) else (np.empty(0), None)
    xy = xy[(distance <= within) & field.contains(xy[:, 0], xy[:, 1])]
    if len(xy) == 0:
        raise InputError(
            f"no multiple of {grid:g} m lies within {within:g} m of the route; give a finer grid or more room"
        )
    return xy


def nearest_view(route: Route, positions: Float[np.ndarray, "n 2"]) -> np.ndarray:
    """Index of the route view nearest to each position: the thesis's place recognition (4.3.2)."""
    return np.hypot(*(positions[:, None] - route.xy).transpose(2, 0, 1)).argmin(axis=1)


def views_east(
    encoding: Encoding, renderer: Renderer, positions: Float[np.ndarray, "n 2"]
) -> Iterator[Float32[torch.Tensor, "m h w"]]:
    """What is seen at the positions, encoded, in batches.

    All views face east, so that the answer is not on the grid of rotations by construction.
    """
    for start in range(0, len(positions), BATCH):
        part = positions[start : start + BATCH]
        yield encoding(renderer.render(np.column_stack([part, np.zeros(len(part))])))


def recovered_headings(
    model: FamiliarityModel, views: Images, facing: Float[np.ndarray, " n"], *, scan: float = 2 * np.pi,
    about: Float[np.ndarray, " n"] | None = None,
) -> Float[np.ndarray, " n"]:  # fmt: skip
    """The most familiar headings (rad) at places whose views were taken facing `facing`.

    scan: width of the scan (rad), centred on the headings `about`, which a full one does not need.
    """
    if len(views) == 0:
        return np.empty(0)
    familiarity = model.scan(views).cpu().numpy()
    turns = np.zeros(len(facing)) if about is None else wrap_angle(about - facing)
    windows = np.stack([scan_window(familiarity.shape[1], scan, turn) for turn in turns])
    return wrap_angle(facing + best_turn(familiarity, windows))


def heading_errors(
    model: FamiliarityModel, encoding: Encoding, renderer: Renderer, route: Route, positions: Float[np.ndarray, "n 2"],
    *, scan: float = 2 * np.pi, progress=lambda done, total: None,
) -> HeadingErrors:  # fmt: skip
    """Let a trained model recover the heading at each position and compare it with the nearest route view's.

    scan: width of the scan (rad), about the set heading where it is not full. progress(done, total) is called now and then.
    """
    poses = np.column_stack([positions, np.zeros(len(positions))])
    wanted = route.poses[nearest_view(route, positions), 2]
    views = views_east(encoding, renderer, positions)
    return errors_on(model, views, route, poses, scan=scan, about=wanted, progress=progress)


def errors_on(
    model: FamiliarityModel, views: Iterable[Images], route: Route, poses: Float[np.ndarray, "n 3"],
    *, scan: float = 2 * np.pi, about: Float[np.ndarray, " n"] | None = None, progress=lambda done, total: None,
) -> HeadingErrors:  # fmt: skip
    """`heading_errors` from encoded views, in batches, that were taken at poses; see `recovered_headings` for the scan."""
    found, done = [np.empty(0)], 0
    for batch in views:
        part = slice(done, done + len(batch))
        about_here = None if about is None else about[part]
        found.append(recovered_headings(model, batch, poses[part, 2], scan=scan, about=about_here))
        done = part.stop
        progress(done, len(poses))
    headings, nearest = np.concatenate(found), nearest_view(route, poses[:, :2])
    errors = np.abs(wrap_angle(headings - route.poses[nearest, 2]))
    return HeadingErrors(positions=poses[:, :2], headings=headings, nearest=nearest, errors=errors)
