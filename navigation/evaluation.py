"""How well a model recovers headings at positions near a route."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from tussock.render.renderer import Renderer
from tussock.render.tilted_eye import check_level
from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds, Route, wrap_angle
from tussock.world.progress import Progress, no_progress, printed

from .encoding import Encoding
from .models.base import FamiliarityModel, Images, SnapshotModel
from .scan import best_turn, scan_window

BATCH = 64  # views rendered, encoded and compared at once
RECOVERED_DEG = 45.0  # a heading less than this off counts as recovered
MAX_POSITIONS = 10**6
BAND = 0.05  # m; width of a band of distances from the route


@dataclass(frozen=True, kw_only=True)
class HeadingErrors:
    """Recovered headings at positions near a route, and their errors (equations 2 and 3 of the thesis).

    Attributes:
        positions: (n, 2) m.
        headings: (n,) Recovered (rad).
        nearest: (n,) Index of the nearest route view, whose heading is the right one (place recognition, section 4.3.2).
        errors: (n,) Absolute difference between the two (rad, 0..pi).
        distances: (n,) From the line through the route views (m).
    """

    positions: Float[np.ndarray, "n 2"]
    headings: Float[np.ndarray, " n"]
    nearest: np.ndarray
    errors: Float[np.ndarray, " n"]
    distances: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.errors)

    def among(self, chosen: Bool[np.ndarray, " n"]) -> "HeadingErrors":
        """Those at the chosen positions."""
        return replace(self, **{name: values[chosen] for name, values in vars(self).items()})

    @property
    def median_error_deg(self) -> float:
        return float(np.median(np.degrees(self.errors)))

    @property
    def mean_error_deg(self) -> float:
        return float(np.mean(np.degrees(self.errors)))

    @property
    def share_over_45(self) -> float:
        return float(np.mean(np.degrees(self.errors) > RECOVERED_DEG))

    def summary(self) -> dict[str, float]:
        """How many positions there are, and their errors, by the names of these numbers. There must be at least one position."""
        names = ("median_error_deg", "mean_error_deg", "share_over_45")
        return {"n_positions": len(self), **{name: getattr(self, name) for name in names}}

    def by_distance(self) -> dict[str, "HeadingErrors"]:
        """Those in each band of distances from the route: "0 to 5 cm", .. A band without positions is left out.

        A distance between two bands belongs to the nearer one.
        """
        band = np.ceil(self.distances / BAND - 1e-9).clip(min=1).astype(int)
        width = round(100 * BAND)
        return {f"{width * (k - 1)} to {width * k} cm": self.among(band == k) for k in np.unique(band).tolist()}


def grid_positions(route: Route, *, grid: float, within: float, field: Bounds) -> Float[np.ndarray, "n 2"]:
    """Grid positions near a route.

    Args:
        route: The route.
        grid: Positions are the multiples of this in x and y (m).
        within: Greatest distance from the route (m).
        field: Positions outside of it are left out.

    Raises:
        SettingError: Where there are none, or over a million.
    """
    if not (np.isfinite(grid) and grid > 0):
        raise SettingError(f"a grid of {grid} m; give a spacing over 0")
    if not (np.isfinite(within) and within >= 0):
        raise SettingError(f"positions within {within} m of the route; give a finite distance")
    low = np.ceil((route.xy.min(axis=0) - within) / grid).astype(int)
    high = np.floor((route.xy.max(axis=0) + within) / grid).astype(int)
    if (high - low + 1).prod() > MAX_POSITIONS:
        raise SettingError(f"a grid of {grid:g} m has over a million positions around this route; give a wider one")
    x, y = np.meshgrid(np.arange(low[0], high[0] + 1) * grid, np.arange(low[1], high[1] + 1) * grid)
    xy = np.column_stack([x.ravel(), y.ravel()])
    distance, _ = route.nearest(xy) if len(xy) else (np.empty(0), None)
    xy = xy[(distance <= within) & field.contains(xy[:, 0], xy[:, 1])]
    if len(xy) == 0:
        raise SettingError(
            f"no multiple of {grid:g} m lies within {within:g} m of the route; give a finer grid or a greater distance"
        )
    return xy


def nearest_view(route: Route, positions: Float[np.ndarray, "n 2"]) -> np.ndarray:
    """Index of the route view nearest to each position: the thesis's place recognition (4.3.2)."""
    return np.hypot(*(positions[:, None] - route.xy).transpose(2, 0, 1)).argmin(axis=1)


def facing_east(positions: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n 3"]:
    """Poses at positions that all face east, so that the right turns do not fall on whole columns by construction; poses as they are."""
    return positions if positions.shape[1] == 3 else np.column_stack([positions, np.zeros(len(positions))])


def encoded_views(
    encoding: Encoding, renderer: Renderer, poses: Float[np.ndarray, "n 3"]
) -> Iterator[Float32[torch.Tensor, "m h w"]]:
    """The encoded views at poses, in batches; of the full circle, whatever the eye sees of it (see `Encoding.for_eye`)."""
    encoded = encoding.for_eye(renderer.eye)
    for start in range(0, len(poses), BATCH):
        yield encoded.at(renderer, poses[start : start + BATCH])


def recovered_headings(
    model: FamiliarityModel,
    views: Images,
    facing: Float[np.ndarray, " n"],
    *,
    scan: float = 2 * np.pi,
    about: Float[np.ndarray, " n"] | None = None,
) -> Float[np.ndarray, " n"]:
    """The most familiar headings (rad) of views.

    Args:
        model: A trained model.
        views: (n, h, w) Encoded views.
        facing: (n,) Heading at which each was taken (rad).
        scan: Full width of the scan (rad).
        about: (n,) Heading in the middle of each scan (rad); a full scan does not need it.
    """
    if len(views) == 0:
        return np.empty(0)
    turns = np.zeros(len(facing)) if about is None else wrap_angle(about - facing)
    windows = np.stack([scan_window(views.shape[2], scan, turn) for turn in turns])
    scans = model.match(views, windows)[0] if isinstance(model, SnapshotModel) else model.scan(views)
    return wrap_angle(facing + best_turn(scans.cpu().numpy(), windows))


def heading_field(
    model: FamiliarityModel,
    encoding: Encoding,
    renderer: Renderer,
    positions: Float[np.ndarray, "n 2"],
    *,
    progress: Progress | None = None,
) -> Float[np.ndarray, "n 3"]:
    """The most familiar heading at each of some positions, among all headings.

    Args:
        model: A trained model.
        encoding: That of the views that it learned.
        renderer: Draws the views.
        positions: (n, 2) Where to look around (m).
        progress: Called with how many positions are done, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        (n, 3) The positions (m) with these headings (rad).
    """
    progress = printed(progress, "looking around", "positions")
    check_level(renderer)
    poses, headings = facing_east(positions), np.empty(0)
    for views in encoded_views(encoding, renderer, poses):
        headings = np.concatenate([headings, recovered_headings(model, views, np.zeros(len(views)))])
        progress(len(headings), len(poses))
    return np.column_stack([poses[:, :2], headings])


def heading_errors(
    model: FamiliarityModel,
    encoding: Encoding,
    renderer: Renderer,
    route: Route,
    positions: Float[np.ndarray, "n k"],
    *,
    scan: float = 2 * np.pi,
    progress: Progress | None = None,
) -> HeadingErrors:
    """Let a trained model recover the heading at each position, and compare it with the nearest route view's.

    Args:
        model: The trained model.
        encoding: That of the views it learned.
        renderer: Draws the views at the positions.
        route: Its points are the route views.
        positions: (n, 2) m, where views face east; or (n, 3) poses.
        scan: Full width of the scan (rad), about the right heading where it is not full.
        progress: Called with how many positions are done, of how many; None prints a line where it takes long, `no_progress` none.
    """
    progress = printed(progress, "recovering headings", "positions")
    check_level(renderer)
    poses = facing_east(positions)
    views = encoded_views(encoding, renderer, poses)
    about = route.poses[nearest_view(route, poses[:, :2]), 2]
    return errors_of_views(model, views, route, poses, scan=scan, about=about, progress=progress)


def errors_of_views(
    model: FamiliarityModel,
    views: Iterable[Float32[torch.Tensor, "_ h w"]],
    route: Route,
    poses: Float[np.ndarray, "m 3"],
    *,
    scan: float = 2 * np.pi,
    about: Float[np.ndarray, " m"] | None = None,
    progress: Progress = no_progress,
) -> HeadingErrors:
    """`heading_errors` from encoded views, in batches, that were taken at poses; see `recovered_headings` for the scan."""
    headings, done = [np.empty(0)], 0
    for batch in views:
        part = slice(done, done + len(batch))
        middle = None if about is None else about[part]
        headings.append(recovered_headings(model, batch, poses[part, 2], scan=scan, about=middle))
        done = part.stop
        progress(done, len(poses))
    recovered, nearest = np.concatenate(headings), nearest_view(route, poses[:, :2])
    errors = np.abs(wrap_angle(recovered - route.poses[nearest, 2]))
    distances, _ = route.nearest(poses[:, :2])
    return HeadingErrors(
        positions=poses[:, :2], headings=recovered, nearest=nearest, errors=errors, distances=distances
    )
