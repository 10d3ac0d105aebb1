"""Catchments: from where does descending the image difference lead to a view, or a model find the right heading?

- The *landscape* is the difference of the view at each grid position from the reference: minus the familiarity that a model gives it,
  at its best rotation or at the reference's heading. For perfect memory that is the RMS image difference (from the most similar of
  several references).
- *Catchment by descent* (Zeil, Hofmann and Chahl 2003): the positions from which steps to the neighbour (of eight) in whose direction
  the difference falls most steeply lead home. Home are the positions within half the diagonal of a cell of the reference, or of the
  route; at least the nearest one. Its *area* is the number of these positions times the area of a cell. Its *volume* is the space between
  the landscape and the level of its rim: the sum over them of (greatest difference in the catchment - difference) times the area of a cell.
  Positions have one height, so it is not a volume in space, as Murray and Zeil (2017) measure it.
- *Catchment by heading*: the positions at which the model's best heading is within 45 (or 90) degrees of the right one, which is that
  of the nearest reference view.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from tussock.render.images.source import DatabaseViews
from tussock.render.renderer import Renderer
from tussock.render.tilted_eye import check_level
from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds, Pose, Route, columns_of_turn, wrap_angle
from tussock.world.progress import Progress, printed

from ..encoding import Encoding
from ..evaluation import MAX_POSITIONS, encoded_views, facing_east
from ..models.base import FamiliarityModel
from ..scan import best_turn

NEIGHBOURS = 1.01 * np.sqrt(2)  # spacings: the eight neighbours in a lattice, and no others


@dataclass(frozen=True, kw_only=True)
class Landscape:
    """What a model finds at positions around its references.

    Attributes:
        poses: (n, 3) Where the views were taken (m, m, rad).
        spacing: Distance between neighbours (m).
        difference: (n,) Minus the familiarity.
        headings: (n,) The most familiar heading (rad).
        right: (n,) The heading of the nearest reference view (rad).
        distance: (n,) From the reference, or the route (m).
        homeward: (n,) Direction to its nearest point (rad).
    """

    poses: Float[np.ndarray, "n 3"]
    spacing: float
    difference: Float[np.ndarray, " n"]
    headings: Float[np.ndarray, " n"]
    right: Float[np.ndarray, " n"]
    distance: Float[np.ndarray, " n"]
    homeward: Float[np.ndarray, " n"]

    @property
    def cell(self) -> float:
        """Area of a cell (m2)."""
        return self.spacing**2

    @property
    def errors(self) -> Float[np.ndarray, " n"]:
        """Of the headings (rad, 0..pi)."""
        return np.abs(wrap_angle(self.headings - self.right))

    @property
    def home(self) -> Bool[np.ndarray, " n"]:
        """Which positions are home."""
        near = self.distance <= self.spacing * np.sqrt(0.5) * (1 + 1e-6)
        near[self.distance.argmin()] = True
        return near


@dataclass(frozen=True, kw_only=True)
class Catchment:
    """The catchment by descent.

    Attributes:
        inside: (n,) Which positions belong to it.
        area: m2.
        volume: m2 times the unit of the difference.
        reach: Greatest distance from the reference of a position in it (m).
        downhill: (n,) Direction of the steepest descent (rad); nan where no neighbour is lower.
    """

    inside: Bool[np.ndarray, " n"]
    area: float
    volume: float
    reach: float
    downhill: Float[np.ndarray, " n"]


def positions_around(
    renderer: Renderer, around: Route | Pose, *, grid: float, within: float
) -> tuple[Float[np.ndarray, "n 3"], float]:
    """Poses in a lattice around a route or a pose, and their spacing (m).

    In a world they are the multiples of `grid`, facing east; of an image database, the poses of its entries.

    Raises:
        SettingError: Where there are too few or too many.
    """
    check_level(renderer)
    low, high = _extent(around, within)
    if isinstance(renderer, DatabaseViews):
        poses, spacing = renderer.poses, float(renderer.reach * np.sqrt(2))
    else:
        if not (np.isfinite(grid) and grid > 0 and np.isfinite(within) and within > 0):
            raise SettingError(f"a grid of {grid:g} m within {within:g} m; give numbers over 0")
        first, last = np.ceil(low / grid - 1e-9), np.floor(high / grid + 1e-9)
        if (last - first + 1).clip(0).prod() > MAX_POSITIONS:
            raise SettingError(f"a grid of {grid:g} m has over a million positions here; give a wider one")
        x, y = np.meshgrid(*(np.arange(a, b + 1) * grid for a, b in zip(first.tolist(), last.tolist(), strict=True)))
        poses, spacing = facing_east(np.column_stack([x.ravel(), y.ravel()])), grid
        poses = poses[renderer.world.field.contains(poses[:, 0], poses[:, 1])]
    poses = poses[distance_and_direction(around, poses[:, :2])[0] <= within] if len(poses) else poses
    if len(poses) < 2:
        raise SettingError(f"fewer than two views lie within {within:g} m of the reference; give a greater --within-m")
    return poses, spacing


def _extent(around: Route | Pose, within: float) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    xy = around.xy if isinstance(around, Route) else np.array([around[:2]])
    low, high = xy.min(axis=0), xy.max(axis=0)
    widened = Bounds(*low.tolist(), *high.tolist()).widened(within)
    return np.array(widened[:2]), np.array(widened[2:])


def distance_and_direction(
    around: Route | Pose, xy: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """How far positions are from a pose, or from the nearest point of a route (m), and the direction to it (rad)."""
    to = around.at(around.nearest(xy)[1])[:, :2] - xy if isinstance(around, Route) else np.array(around[:2]) - xy
    return np.hypot(*to.T), np.arctan2(to[:, 1], to[:, 0])


def landscape(
    renderer: Renderer,
    encoding: Encoding,
    model: FamiliarityModel,
    around: Route | Pose,
    poses: Float[np.ndarray, "n 3"],
    spacing: float,
    *,
    best: bool = True,
    progress: Progress | None = None,
) -> Landscape:
    """What a trained model finds at poses around a route, or around one pose.

    Args:
        renderer: Draws the views.
        encoding: That of the views that the model learned.
        model: The model.
        around: The reference; of a route, its points are the reference views.
        poses: See `positions_around`.
        spacing: Their spacing (m).
        best: Take the familiarity of the best rotation; else that at the heading of the nearest reference view.
        progress: Called with how many views are compared, of how many; None prints a line where it takes long, `no_progress` none.
    """
    progress = printed(progress, "comparing", "views")
    references = around.poses if isinstance(around, Route) else np.array([around])
    right = references[KDTree(references[:, :2]).query(poses[:, :2])[1], 2]
    scans = [np.empty((0, 0))]
    for batch in encoded_views(encoding, renderer, poses):
        scans = [each for each in scans if len(each)] + [model.scan(batch).cpu().numpy().astype(float)]
        progress(sum(map(len, scans)), len(poses))
    familiarity = np.concatenate(scans)
    width = familiarity.shape[1]
    turned = np.rint(columns_of_turn(right - poses[:, 2], width)).astype(int) % width
    at_right = familiarity[np.arange(len(poses)), turned]
    distance, homeward = distance_and_direction(around, poses[:, :2])
    return Landscape(
        poses=poses,
        spacing=spacing,
        difference=-(familiarity.max(axis=1) if best else at_right),
        headings=wrap_angle(poses[:, 2] + best_turn(familiarity)),
        right=right,
        distance=distance,
        homeward=homeward,
    )


def catchment(ground: Landscape) -> Catchment:
    """The positions from which the steepest descent leads home."""
    xy, home = ground.poses[:, :2], ground.home
    lower = np.arange(len(xy))  # the neighbour that is next on the way down; itself where there is none
    for k, near in enumerate(KDTree(xy).query_ball_point(xy, NEIGHBOURS * ground.spacing)):
        others = np.array([each for each in near if each != k], dtype=int)
        if len(others):
            slope = (ground.difference[k] - ground.difference[others]) / np.hypot(*(xy[others] - xy[k]).T).clip(1e-9)
            lower[k] = others[slope.argmax()] if slope.max() > 0 else k
    steps = xy[lower] - xy
    downhill = np.where(lower == np.arange(len(xy)), np.nan, np.arctan2(steps[:, 1], steps[:, 0]))
    end = np.where(home, np.arange(len(xy)), lower)
    for _ in range(int(np.ceil(np.log2(len(xy)))) + 1):  # each time, twice as far down
        end = end[end]
    inside = home[end]
    rim = ground.difference[inside].max()
    return Catchment(
        inside=inside,
        area=float(inside.sum() * ground.cell),
        volume=float((rim - ground.difference[inside]).sum() * ground.cell),
        reach=float(ground.distance[inside].max()),
        downhill=downhill,
    )
