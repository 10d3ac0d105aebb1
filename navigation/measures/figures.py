"""Figures of image differences, catchments and place recognition."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from tussock.world.geometry import Pose, Route, column_azimuths, turn_of_columns
from tussock.world.scene import World

from ..reports.drawing import CURVE_COLOUR, GOOD_COLOUR, PATH_COLOUR, ROUTE_COLOUR, canvas
from ..reports.maps import draw_arrows, draw_map, draw_route, map_axes
from .catchment import Catchment, Landscape
from .description import APART, STEP, Description
from .image_difference import Rotational, Translational
from .place_recognition import PlaceRecognition

SHADES = "#0b3c8c", "#2f6bff", "#2b8a6f", "#d98c1f", "#e6352b", "#7b4fb5", CURVE_COLOUR  # of displacements
MAX_ARROWS = 600  # on a map


def difference_figure(rotations: Sequence[Rotational], translations: Mapping[str, Translational]) -> Figure:
    """The rotational image difference functions at each displacement, and the translational ones."""
    figure, axes = canvas((7.2, 3.0), 1, 2, sharey=True)
    left, right = axes[0]
    for number, each in enumerate(rotations):
        turns = np.degrees(turn_of_columns(np.arange(len(each.curve)), len(each.curve)))
        order = turns.argsort()
        label = f"{each.distance:.2g} m away" if each.displacement else "the same position"
        left.plot(turns[order], each.curve[order], color=SHADES[number % len(SHADES)], lw=1.3, label=label)
    left.set(
        xlim=(-180, 180), xticks=range(-180, 181, 90), xlabel="degrees left of the reference", ylabel="image difference"
    )
    for (name, each), colour in zip(translations.items(), (ROUTE_COLOUR, PATH_COLOUR), strict=False):
        right.plot(each.distances, each.curve, "o-", color=colour, ms=3, lw=1.3, label=name)
    right.set(xlabel="m from the reference, at its heading")
    left.set_ylim(bottom=0)
    for each in (left, right):
        each.legend(frameon=False, fontsize="small")
    return figure


def description_figure(found: Description) -> Figure:
    """Skylines, spectra, and how the image difference grows with turns and with distance."""
    figure, axes = canvas((9.0, 5.6), 2, 2)
    (skylines, spectra), (turns, growth) = axes
    azimuth = np.degrees(column_azimuths(found.skylines.shape[1]))
    for line, colour in zip(found.skylines[:4], SHADES, strict=False):
        skylines.plot(azimuth, line, color=colour, lw=1)
    skylines.set(xlim=(180, -180), xticks=range(180, -181, -90), xlabel="degrees left of ahead", ylabel="skyline (deg)")
    for label, power, colour in (
        ("skyline (deg²)", found.skyline_power, ROUTE_COLOUR),
        ("contrast", found.contrast_power, PATH_COLOUR),
    ):
        spectra.loglog(np.arange(1, power.shape[1] + 1), power.mean(axis=0), color=colour, lw=1.3, label=label)
    spectra.set(xlabel="cycles around the circle", ylabel="power")
    spectra.legend(frameon=False, fontsize="small")
    angles = np.degrees(turn_of_columns(np.arange(found.rotation.shape[1]), found.rotation.shape[1]))
    order = angles.argsort()
    _spread(turns, angles[order], found.rotation[:, order])
    turns.set(
        xlim=(-180, 180),
        xticks=range(-180, 181, 90),
        xlabel=f"degrees of turn, {APART:g} m apart",
        ylabel="image difference",
    )
    _spread(growth, STEP * np.arange(1, found.growth.shape[1] + 1), found.growth)
    growth.set(xlim=(0, None), ylim=(0, None), xlabel="m away, at the same heading", ylabel="image difference")
    return figure


def _spread(axes: Axes, x: np.ndarray, curves: np.ndarray) -> None:
    """The mean of curves, and the range of 90 % of them."""
    low, middle, high = (
        np.nanpercentile(curves, 5, axis=0),
        np.nanmean(curves, axis=0),
        np.nanpercentile(curves, 95, axis=0),
    )
    axes.fill_between(x, low, high, color=ROUTE_COLOUR, alpha=0.2, lw=0)
    axes.plot(x, middle, color=ROUTE_COLOUR, lw=1.5)


def catchment_figure(ground: Landscape, found: Catchment, around: Route | Pose, world: World | None) -> Figure:
    """The landscape and the catchment in it, and the headings that the model recovers, from above."""
    xy, half = ground.poses[:, :2], ground.spacing / 2
    figure, axes = map_axes(xy, columns=2)
    squares = xy[:, None] + half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    left, right = axes[0]
    draw_map(left, world, xy, half)
    for part, alpha in ((found.inside, 1.0), (~found.inside, 0.3)):
        cells = PolyCollection(
            list(squares[part]), array=ground.difference[part], cmap="viridis", alpha=alpha, zorder=1
        )
        cells.set_clim(ground.difference.min(), ground.difference.max())
        left.add_collection(cells)
        if alpha == 1.0:
            figure.colorbar(cells, ax=left, label="image difference", shrink=0.8)
    left.set_title(f"catchment (full colour): {found.area:.3g} m²")
    draw_map(right, world, xy, half)
    error = np.degrees(ground.errors)
    for part, colour in (
        (error <= 45, GOOD_COLOUR),
        ((error > 45) & (error <= 90), "#d98c1f"),
        (error > 90, PATH_COLOUR),
    ):
        shown = np.flatnonzero(part)[:: max(1, len(error) // MAX_ARROWS)]
        if len(shown):
            x, y = xy[shown].T
            draw_arrows(right, x, y, np.degrees(ground.headings[shown]), colour, 0.8 * ground.spacing)
    right.set_title("recovered headings: off by up to\n45 (green), 90 (orange), 180 degrees")
    for each in (left, right):
        if isinstance(around, Route):
            draw_route(each, around)
        else:
            draw_arrows(each, [around.x], [around.y], [np.degrees(around.heading)], ROUTE_COLOUR, 2 * ground.spacing)
    return figure


def place_figure(found: PlaceRecognition, tolerance: float) -> Figure:
    """The precision-recall curve, and the distances of the best matches."""
    figure, axes = canvas((7.2, 3.0), 1, 2)
    left, right = axes[0]
    left.step(
        np.r_[0, found.recall], np.r_[found.precision[0], found.precision], where="pre", color=ROUTE_COLOUR, lw=1.5
    )
    left.set(xlim=(0, 1), ylim=(0, 1.03), xlabel="recall", ylabel="precision")
    left.set_title(f"area {found.area:.3f}")
    distance = np.sort(found.distance)
    right.step(distance, np.arange(1, len(distance) + 1) / len(distance), where="post", color=ROUTE_COLOUR, lw=1.5)
    right.axvline(tolerance, color=PATH_COLOUR, lw=1, label="tolerance")
    right.set(ylim=(0, 1.03), xlabel="m from the query to its best match", ylabel="share of queries")
    right.set_xlim(left=0)
    right.legend(frameon=False, fontsize="small")
    return figure
