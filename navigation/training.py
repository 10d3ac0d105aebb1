"""Learning a route: where its training views are taken, and giving them to a model."""

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float, Float32

from tussock.render.renderer import Renderer
from tussock.world.errors import InputError
from tussock.world.geometry import Bounds, Route, wrap_angle

from .encoding import Encoding
from .models.base import FamiliarityModel

AHEAD = 0.3  # m; how far ahead on the route a view taken beside it faces
SIDES = (0.25, 0.5, 1.0)  # shares of the learning walk's reach at which views are taken, on both sides
BATCH = 64  # views rendered and encoded at once
BLANK = 1e-3  # standard deviation under which a feature image holds nothing to recognise


def training_poses(
    route: Route, *, every: int = 1, learning_walk: float = 0.0, field: Bounds | None = None
) -> Float[np.ndarray, "n 3"]:
    """Poses to learn from: every `every`-th of the route's, and, beside each, those of a learning walk.

    learning_walk: reach to both sides (m); 0 is training on the route only, as the thesis does. Views taken on the route face
    along it. Views beside it face a point of the route AHEAD of there, so that following them leads back to the route: on the
    route only, the recovered heading is parallel to it and displacement adds up. Poses outside `field` are left out.
    """
    if every < 1:
        raise InputError(f"every {every}; give 1 for every view, 6 for one in six")
    if not (np.isfinite(learning_walk) and learning_walk >= 0):
        raise InputError(f"a learning walk of {learning_walk} m; give 0 (none) or a reach in metres")
    poses = route.poses[::every]
    if learning_walk == 0:
        return poses
    heading = poses[:, 2]
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    ahead = route.at(route.arc[::every] + AHEAD)[:, :2]
    batches = []
    for share in SIDES:
        for side in (1, -1):
            xy = poses[:, :2] + side * share * learning_walk * left
            aim = ahead - xy
            batches.append(np.column_stack([xy, np.arctan2(aim[:, 1], aim[:, 0])]))
    batches.append(poses)  # last, so that the last view of all is the route's own at its end
    every_pose = np.stack(batches, axis=1).reshape(-1, 3)  # in the order of the route
    every_pose[:, 2] = wrap_angle(every_pose[:, 2])
    if field is not None:
        every_pose = every_pose[field.contains(every_pose[:, 0], every_pose[:, 1])]
    return every_pose


def training_views(
    encoding: Encoding, renderer: Renderer, poses: Float[np.ndarray, "n 3"],
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> tuple[Float32[torch.Tensor, "m h w"], Float[np.ndarray, "m 3"]]:  # fmt: skip
    """The encoded views at poses, and the poses of those that are worth learning.

    A view without contrast, as an eye has whose view a plant covers altogether, is left out: it holds nothing to recognise, yet after
    normalising it lies nearer to every view than most true matches do. progress(done, total) is called after each batch.
    Raises InputError when no view is left.
    """
    images, kept = [], []
    for start in range(0, len(poses), BATCH):
        part = poses[start : start + BATCH]
        batch = encoding(renderer.render(part))
        seen = batch.flatten(start_dim=1).std(dim=1, correction=0) > BLANK
        images.append(batch[seen])
        kept.append(part[seen.numpy()])
        progress(min(start + BATCH, len(poses)), len(poses))
    if not sum(map(len, kept)):
        raise InputError(
            f"none of {len(poses)} training views shows anything; choose another route, eye or encoding ({encoding})"
        )
    return torch.cat(images), np.concatenate(kept)


def learn(
    model: FamiliarityModel, encoding: Encoding, renderer: Renderer, poses: Float[np.ndarray, "n 3"],
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> Float[np.ndarray, "m 3"]:  # fmt: skip
    """Fit the model to the views at poses; return the poses whose views it learned. See `training_views`."""
    views, kept = training_views(encoding, renderer, poses, progress)
    model.fit(views)
    return kept
