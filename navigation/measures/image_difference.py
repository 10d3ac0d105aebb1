"""How much views differ when the eye turns, or stands elsewhere: image difference functions (Zeil, Hofmann and Chahl 2003).

The difference of two encoded views is the root mean square difference of their pixels. Over all rotations of one view it is the
*rotational* image difference function; over displacements of the eye at one heading, the *translational* one. Of both, the
minimum is measured (`Valley`).

An eye with a field or a mask sees a part of each turned view, and of recorded images a part may be unknown: then the difference is that
over what is seen of both (`Overlap`). Rotations at which too little is are not compared.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from tussock.render.images.source import DatabaseViews
from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Route, columns_of_turn
from tussock.world.progress import Progress, printed

from ..encoding import Encoding
from ..evaluation import encoded_views
from ..feature_mask import FeatureMask
from ..models.rotations import in_batches
from ..overlap import overlaps
from ..scan import best_turn
from ..training import training_source, training_views
from .valley import Valley, greatest, valley, valley_of_rotations

BATCH = 64  # views compared at once
SIDES = {
    "ahead": (1.0, 0.0),
    "left": (0.0, 1.0),
}  # directions of displacement: forward and to the left, in the eye's own frame


@dataclass(frozen=True, kw_only=True)
class Rotational:
    """The rotational image difference functions at one displacement.

    Attributes:
        displacement: From the reference (m), as asked for.
        distance: Mean distance from the reference at which the views were taken (m); of an image database, that of the nearest ones.
        curve: (w,) Mean difference at each rotation of the views, turned left by 0, 1, .. columns from the reference's heading; nan where
            none is compared.
        valleys: The minimum of each view.
        errors: (n,) Turn to the minimum of each view (rad, -pi..pi).
    """

    displacement: float
    distance: float
    curve: Float[np.ndarray, " w"]
    valleys: list[Valley]
    errors: Float[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True)
class Translational:
    """The translational image difference function in one direction.

    Attributes:
        distances: (k,) Displacement from the reference (m).
        curve: (k,) Mean difference at the reference's heading.
        valley: Its minimum.
    """

    distances: Float[np.ndarray, " k"]
    curve: Float[np.ndarray, " k"]
    valley: Valley


def differences(
    views: Float32[torch.Tensor, "n h w"], references: Float32[torch.Tensor, "m h w"], mask: FeatureMask | None = None
) -> Float[np.ndarray, "n m w"]:
    """The root mean square difference of all views at all rotations, turned left by 0, 1, .. columns, from all references.

    Args:
        views: As an `EyeEncoding` makes them.
        references: Likewise.
        mask: Of this encoding. What shows too little of a reference at a rotation differs by inf.
    """
    if mask is not None:
        blocks = list(overlaps(references, mask))
        squares = [torch.cat([each.squared(batch) for each in blocks], dim=2) for batch in in_batches(views)]
        return torch.cat(squares).sqrt().transpose(1, 2).numpy()
    level = float(references.mean(dtype=torch.float64))  # which changes no difference, and rounding is least around 0
    of_views, of_references = (images.double().numpy() - level for images in (views, references))
    width, pixels = views.shape[2], views.shape[1] * views.shape[2]
    spectra = np.fft.rfft(of_references)
    energies = np.square(of_references).sum(axis=(1, 2))
    rows = [np.empty((0, len(references), width))]
    for start in range(0, len(views), BATCH):
        batch = of_views[start : start + BATCH]
        products = np.einsum("nhf,mhf->nmf", np.fft.rfft(batch).conj(), spectra, optimize=True)
        squared = np.square(batch).sum(axis=(1, 2))[:, None, None] + energies[:, None]
        squared = squared - 2 * np.fft.irfft(products, n=width)
        rows.append(np.sqrt(squared.clip(0) / pixels))
    return np.concatenate(rows)


def differences_of_places(
    encoding: Encoding,
    renderer: Renderer,
    queries: Float[np.ndarray, "n 3"],
    references: Float[np.ndarray, "m 3"],
    *,
    aligned: bool = False,
    progress: Progress | None = None,
) -> tuple[Float[np.ndarray, "n k"], Float[np.ndarray, "k 3"]]:
    """The image difference of each query view from each reference view.

    Args:
        encoding: What is compared.
        renderer: Draws the views; of image databases, references are images of the route.
        queries: Poses of the query views.
        references: Poses of the reference views.
        aligned: Compare them at one compass heading, where they differ by inf if too little of both is seen there; else at the
            rotation at which they differ least.
        progress: Called with how many queries are compared, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        The differences, and the poses of the references that show anything (see `training_views`).
    """
    progress = printed(progress, "comparing", "views")
    mask = encoding.for_eye(renderer.eye).mask
    views, kept = training_views(encoding, renderer, references)
    rows, done = [], 0
    for batch in encoded_views(encoding, renderer, queries):
        scans = differences(batch, views, mask)
        if aligned:
            turns = kept[:, 2] - queries[done : done + len(batch), None, 2]
            columns = np.rint(columns_of_turn(turns, scans.shape[2])).astype(int) % scans.shape[2]
            rows.append(np.take_along_axis(scans, columns[..., None], axis=2)[..., 0])
        else:
            rows.append(scans.min(axis=2))
        done += len(batch)
        progress(done, len(queries))
    return np.concatenate(rows), kept


def spread(route: Route, apart: float) -> Float[np.ndarray, "k 3"]:
    """Poses of a route's points, each at least this far along it from the one before (m)."""
    kept, last = [], -np.inf
    for pose, along in zip(route.poses, route.arc.tolist(), strict=True):
        if along - last >= apart - 1e-9:
            kept.append(pose)
            last = along
    return np.array(kept)


def viewpoints(
    renderer: Renderer, poses: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """Where views at poses are taken: there; of an image database, at its nearest entry, facing as the pose does.

    Returns:
        These poses, and which of them can be used: those in the field of the world, or on the grid.
    """
    if not isinstance(renderer, DatabaseViews):
        return poses, renderer.world.field.contains(poses[:, 0], poses[:, 1])
    rows, distance = renderer.nearest(poses)
    return np.column_stack([renderer.poses[rows, :2], poses[:, 2]]), distance <= renderer.reach


def displaced(poses: Float[np.ndarray, "n 3"], forward: float, left: float) -> Float[np.ndarray, "n 3"]:
    """Poses moved in their own frame (m)."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack(
        [poses[:, 0] + forward * cos - left * sin, poses[:, 1] + forward * sin + left * cos, poses[:, 2]]
    )


def rotational(
    renderer: Renderer, encoding: Encoding, references: Float[np.ndarray, "m 3"], displacements: Sequence[float]
) -> list[Rotational]:
    """The rotational image difference functions of reference views against views displaced to their left and right.

    Args:
        renderer: Draws the views; of image databases, references are images of the route, and displaced views those of the grid.
        encoding: What is compared.
        references: Poses of the reference views.
        displacements: Distances to the sides (m); 0 is the reference against itself.

    Raises:
        SettingError: Where no displaced view can be seen.
    """
    encoded = encoding.for_eye(renderer.eye)
    encoded.remark_on_overlap()
    wanted = encoded.at(training_source(renderer), references)
    results = []
    for displacement in displacements:
        sides = (0.0,) if displacement == 0 else (displacement, -displacement)
        distances, curves = [], []
        for side in sides:
            at, usable, images = references, np.ones(len(references), dtype=bool), wanted
            if displacement:
                at, usable = viewpoints(renderer, displaced(references, 0.0, side))
                images = encoded.at(renderer, at)
            for k in np.flatnonzero(usable).tolist():
                curves.append(differences(images[k : k + 1], wanted[k : k + 1], encoded.mask)[0, 0])
                distances.append(float(np.hypot(*(at[k] - references[k])[:2])))
        if not curves:
            raise SettingError(f"no reference has a view {displacement:g} m beside it; give smaller displacements")
        results.append(
            Rotational(
                displacement=displacement,
                distance=float(np.mean(distances)),
                curve=np.ma.masked_invalid(curves).mean(axis=0).filled(np.nan),
                valleys=[valley_of_rotations(curve) for curve in curves],
                errors=best_turn(-np.minimum(curves, [[greatest(curve)] for curve in curves])),
            )
        )
    return results


def translational(
    renderer: Renderer, encoding: Encoding, references: Float[np.ndarray, "m 3"], reach: float, steps: int = 10
) -> dict[str, Translational]:
    """The translational image difference functions of reference views, at their headings, ahead and to the left.

    Args:
        renderer: Draws the views, as for `rotational`.
        encoding: What is compared.
        references: Poses of the reference views.
        reach: Displacement to both sides (m).
        steps: Number of displaced positions on each side.
    """
    encoded = encoding.for_eye(renderer.eye)
    wanted = encoded.at(training_source(renderer), references)
    results = {}
    for name, (forward, left) in SIDES.items():
        distances, curve = [], []
        for offset in np.linspace(-reach, reach, 2 * steps + 1).tolist():
            at, usable = viewpoints(renderer, displaced(references, offset * forward, offset * left))
            if offset == 0:  # the reference itself
                distances.append(0.0)
                curve.append(0.0)
            elif usable.any():
                off = _unturned(encoded.at(renderer, at[usable]), wanted[torch.from_numpy(usable)], encoded.mask)
                if (compared := off.isfinite()).any():
                    away = np.hypot(*(at - references)[usable, :2].T)[compared.numpy()]
                    distances.append(float(np.sign(offset) * away.mean()))
                    curve.append(float(off[compared].mean()))
        order = np.argsort(distances, kind="stable")
        x, y = np.array(distances)[order], np.array(curve)[order]
        results[name] = Translational(distances=x, curve=y, valley=valley(x, y))
    return results


def _unturned(
    views: Float32[torch.Tensor, "n h w"], references: Float32[torch.Tensor, "n h w"], mask: FeatureMask | None
) -> Float[torch.Tensor, " n"]:
    """The difference of each view from its own reference, without turning it."""
    if mask is None:
        return (views - references).square().mean(dim=(1, 2)).sqrt()
    pairs = zip(views[:, None], references[:, None], strict=True)
    return torch.tensor([differences(view, reference, mask)[0, 0, 0] for view, reference in pairs])
