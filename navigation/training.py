"""Learning a route: where training views are taken, and giving them to what learns."""

import logging
from functools import cache

import numpy as np
import torch
from jaxtyping import Float, Float32

from tussock.render.changed_views import ChangedViews
from tussock.render.images.source import DatabaseViews
from tussock.render.renderer import Renderer
from tussock.render.tilted_eye import TiltedEye
from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds, Route, rounded, wrap_angle
from tussock.world.progress import Progress, no_progress

from .encoding import Encoding
from .feature_mask import FeatureMask, seeing
from .models.base import FamiliarityModel, Images
from .models.files import TrainedModel
from .threads import one_torch_thread
from .training_setup import TrainingSetup

log = logging.getLogger(__name__)

TrainingViews = tuple[Float32[torch.Tensor, "m h w"], Float[np.ndarray, "m 3"]]  # encoded, and their poses
AHEAD = 0.3  # m; a view next to the route faces the route this far ahead
SIDES = (0.25, 0.5, 1.0)  # shares of the learning walk's reach at which views are taken, on both sides
SPIRAL_START = 0.1  # m from the goal, of a learning walk about it
BATCH = 64  # views rendered and encoded at once
MIN_CONTRAST = 1e-3  # standard deviation of a feature image under which there is nothing to recognise
WEAK_CONTRAST = 0.02  # .. and as a share of the median of all views, under which there is hardly anything


def training_poses(
    route: Route,
    spacing: float,
    *,
    every: int = 1,
    learning_walk: float = 0.0,
    parallel: int = 0,
    field: Bounds | None = None,
) -> Float[np.ndarray, "n 3"]:
    """Poses to learn from: along the route, and, with a learning walk, on both sides of it.

    Views on the route face along it. Views next to it face a point of the route AHEAD of there, so that following them leads back
    to the route. With views on the route alone, the recovered heading is parallel to the route, and displacement adds up.

    Args:
        route: The route.
        spacing: Distance between route views (m).
        every: Learn every N-th of these.
        learning_walk: Reach of the learning walk to both sides (m); 0 is training on the route only, as in the thesis.
        parallel: Number of views at each position that are spread evenly over this reach, the farthest first, and all
            face along it; 0: those of the learning walk.
        field: Poses outside of it are left out.

    Returns:
        (n, 3) Poses in the order of the route; the last one is on the route.
    """
    if every < 1:
        raise SettingError(f"every {every}; give 1 for every view, 6 for every sixth")
    if not (np.isfinite(learning_walk) and learning_walk >= 0):
        raise SettingError(f"a learning walk of {learning_walk} m; give 0 (none) or a reach in metres")
    views = route.resampled(spacing)
    poses = views.poses[::every]
    if learning_walk == 0:
        if parallel > 1:
            _remark_on_parallel_views()
        return rounded(poses)
    left = np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
    if parallel:
        beside = _parallel_poses(poses, left, learning_walk, parallel)
    else:
        beside = _looking_ahead(poses, left, learning_walk, views.at(views.arc[::every] + AHEAD)[:, :2])
    beside = rounded(beside)
    return _inside(beside, field)


def _inside(poses: Float[np.ndarray, "n 3"], field: Bounds | None) -> Float[np.ndarray, "m 3"]:
    """The poses inside a field."""
    return poses if field is None else poses[field.contains(poses[:, 0], poses[:, 1])]


def poses_of_setup(setup: TrainingSetup, route: Route, field: Bounds | None = None) -> Float[np.ndarray, "n 3"]:
    """`training_poses` as a setup says, after those of a learning walk about the goal."""
    planned = goal_walk_poses(setup, route)
    about_goal = _inside(planned, field)
    if len(about_goal) < len(planned):
        out = len(planned) - len(about_goal)
        log.warning(
            "%d of %d views of the walk about the goal are outside of the world, and not learned", out, len(planned)
        )
    if setup.goal_only:
        return about_goal
    along = training_poses(
        route,
        setup.spacing,
        every=setup.every,
        learning_walk=setup.learning_walk,
        parallel=setup.parallel_views,
        field=field,
    )
    return np.concatenate([about_goal, along])


def goal_walk_poses(setup: TrainingSetup, route: Route) -> Float[np.ndarray, "n 3"]:
    """Poses (n, 3) of a learning walk about the route's end: a spiral that faces it (Le Moel and Wystrach 2020)."""
    if not setup.goal_walk:
        return np.empty((0, 3))
    share = np.linspace(0, 1, setup.goal_views)
    radius = min(SPIRAL_START, setup.goal_walk) * (1 - share) + setup.goal_walk * share
    direction = (
        route.goal.heading + np.pi + 2 * np.pi * setup.goal_turns * share
    )  # it begins where the route comes from
    spread = setup.goal_spread * np.random.default_rng(0).uniform(-1, 1, setup.goal_views)
    xy = np.array(route.goal[:2]) + radius[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    return rounded(np.column_stack([xy, wrap_angle(direction + np.pi + spread)]))


def _parallel_poses(
    poses: Float[np.ndarray, "n 3"], left: Float[np.ndarray, "n 2"], reach: float, count: int
) -> Float[np.ndarray, "m 3"]:
    """Poses moved to both sides by up to a reach (m), `count` of each, facing as they did."""
    offsets = np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)
    offsets = offsets[np.argsort(-np.abs(offsets.round(9)), kind="stable")]  # the last view of all is on the route
    moved = np.repeat(poses[:, None], len(offsets), axis=1)
    moved[..., :2] += offsets[:, None] * left[:, None]
    return moved.reshape(-1, 3)


def _looking_ahead(
    poses: Float[np.ndarray, "n 3"], left: Float[np.ndarray, "n 2"], reach: float, ahead: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "m 3"]:
    """Poses moved to both sides by shares of a reach (m), facing points ahead, and then the poses themselves."""
    batches = []
    for share in SIDES:
        for side in (1, -1):
            xy = poses[:, :2] + side * share * reach * left
            aim = ahead - xy
            batches.append(np.column_stack([xy, np.arctan2(aim[:, 1], aim[:, 0])]))
    batches.append(poses)  # last, so that the last view of all is the route's own at its end
    return np.stack(batches, axis=1).reshape(-1, 3)  # in the order of the route


def training_poses_in(
    route: Route, beside: Float[np.ndarray, "k 2"], *, every: int = 1, learning_walk: float = 0.0
) -> Float[np.ndarray, "n 3"]:
    """Poses to learn from where there are views at some poses only, as in image databases.

    As `training_poses`, but on the route at its own points, and next to it at the positions of the other views: all that are within
    the reach of the learning walk. Those face the point of the route AHEAD of their nearest one.

    Args:
        route: The route; its points are where its views are.
        beside: Positions of the other views (m).
        every: Learn every N-th view of the route.
        learning_walk: Reach of the learning walk (m); 0 is training on the route only.

    Returns:
        (n, 3) Poses in the order of the route; the last one is on the route.
    """
    poses, arc = route.poses[::every], route.arc[::every]
    if learning_walk and len(beside) == 0:
        _remark_on_learning_walk()
    if learning_walk == 0 or len(beside) == 0:
        return poses
    distance, along = route.nearest(beside)
    near = (distance <= learning_walk) & (along <= arc[-1])
    aim = route.at(along[near] + AHEAD)[:, :2] - beside[near]
    facing = np.column_stack([beside[near], np.arctan2(aim[:, 1], aim[:, 0])])
    order = np.argsort(np.concatenate([along[near], arc]), kind="stable")  # so that of equals, the route's own is last
    return np.concatenate([facing, poses])[order]


@cache  # once, however many models learn
def _remark_on_parallel_views() -> None:
    log.warning("parallel views need a reach, so only those on the route are learned; give --learning-walk-m")


@cache  # once, however many models learn
def _remark_on_learning_walk() -> None:
    log.warning(
        "there are no views next to the route, so only those on it are learned, without a learning walk; give --grid-database for one"
    )


def training_source(renderer: Renderer) -> Renderer:
    """What draws the views to learn: the renderer, or what image databases, carried eyes and changed worlds have for this."""
    return renderer.training if isinstance(renderer, DatabaseViews | TiltedEye | ChangedViews) else renderer


def training_views(
    encoding: Encoding,
    renderer: Renderer,
    poses: Float[np.ndarray, "n 3"],
    progress: Progress = no_progress,
    *,
    warn: bool = True,
) -> TrainingViews:
    """The encoded views at poses, and the poses of those that are worth learning.

    A view without contrast is left out, as where a plant covers the eye: it holds nothing to recognise, yet after normalising it lies
    nearer to every view than most true matches do.

    Where the eye does not see all around, the views are of the full circle all the same: a model must `see` the mask of
    `encoding.for_eye(renderer.eye)` before it learns them.

    Args:
        encoding: What is kept of a view.
        renderer: Draws the views; see `training_source`.
        poses: Where they are taken.
        progress: Called after each batch.
        warn: Whether views without contrast, or with hardly any, are a warning.

    Raises:
        SettingError: Where no view is left.
    """
    poses = np.asarray(poses, dtype=float)  # a list of poses will do
    images, contrasts, source = [], [], training_source(renderer)
    encoded = encoding.for_eye(renderer.eye)
    encoded.remark_on_overlap()
    with one_torch_thread():
        for start in range(0, len(poses), BATCH):
            part = poses[start : start + BATCH]
            batch = encoded.at(source, part)
            contrasts.append(_contrast(batch, encoded.mask))
            images.append(batch[contrasts[-1] > MIN_CONTRAST])
            progress(min(start + BATCH, len(poses)), len(poses))
    contrast = torch.cat(contrasts) if contrasts else torch.empty(0)
    worth = (contrast > MIN_CONTRAST).numpy()
    if not worth.any():
        raise SettingError(
            f"none of {len(poses)} training views shows anything; choose another route, eye or encoding ({encoding})"
        )
    if warn:
        _warn_of_contrast(encoding, source, poses, contrast)
    return torch.cat(images), poses[worth]


def _warn_of_contrast(
    encoding: Encoding, source: Renderer, poses: Float[np.ndarray, "n 3"], contrast: Float32[torch.Tensor, " n"]
) -> None:
    """Log how many views at poses show nothing, or hardly anything, and which is the first of them."""
    weak = contrast <= max(MIN_CONTRAST, WEAK_CONTRAST * float(contrast.median()))
    if not weak.any():
        return
    first = int(weak.int().argmax())
    x, y, _ = poses[first].tolist()
    where = source.label(poses[first]) if isinstance(source, DatabaseViews) else f"at x {x:.2f} m, y {y:.2f} m"
    log.warning(
        "%d of %d training views are constant or nearly so in the encoding '%s' (the first: %s); %d are not learned. Where something "
        "covers the eye this is right; else choose another --encoding (foreground-mask needs images with transparency)",
        int(weak.sum()),
        len(weak),
        encoding,
        where,
        int((contrast <= MIN_CONTRAST).sum()),
    )


def _contrast(images: Images, mask: FeatureMask | None) -> Float32[torch.Tensor, " n"]:
    """Standard deviation of what a model sees of feature images."""
    if mask is None or not mask.partial:
        pixels = images.flatten(start_dim=1) if mask is None else mask.pixels(images)
        return pixels.std(dim=1, correction=0)
    pixels = mask.select(images)
    centred = pixels - pixels.nanmean(dim=1, keepdim=True)
    return centred.square().nanmean(dim=1).sqrt().nan_to_num(0.0)  # 0 where nothing is known


def shared_views(model: object, views: Images) -> Images:
    """Views that a model has learned: its own tensor, where it keeps all of them as they are, so that they are in memory once."""
    kept = getattr(model, "snapshots", None)
    if isinstance(kept, torch.Tensor) and kept.device == views.device and torch.equal(kept, views):
        return kept
    return views


def train(
    model: FamiliarityModel, encoding: Encoding, renderer: Renderer, poses: Float[np.ndarray, "n 3"]
) -> TrainedModel:
    """Train a new model on the views at poses (see `training_views`), as the renderer's eye sees them."""
    seeing(model, encoding.for_eye(renderer.eye).mask)
    views, kept = training_views(encoding, renderer, poses)
    model.fit(views)
    return TrainedModel(model=model, encoding=encoding, eye=renderer.eye, poses=kept)
