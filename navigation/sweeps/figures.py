"""The figures of a sweep's report."""

import numpy as np
import pandas as pd
from jaxtyping import UInt8
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tussock.world.geometry import Route
from tussock.world.scene import World

from ..reports.plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from ..studies.thesis.drawing import GOOD_COLOUR, SOFT_COLOUR, canvas, draw_route, panorama, plan
from .statistics import MEASURES, Interval, by_axis, spoken, words

COLOURS = (ROUTE_COLOUR, PATH_COLOUR, GOOD_COLOUR, "#8a6100", "#7b4fb5", CURVE_COLOUR, SOFT_COLOUR)
MOST_CHOICES = 24  # of an axis that are drawn by name


def along_axis(table: pd.DataFrame, axis: list[str], measures: list[str], by: list[str]) -> Figure:
    """Each measure over the choices of an axis, with confidence intervals; a line for each choice of `by` (none: one line)."""
    figure, axes = canvas((7.2, 0.6 + 2.1 * len(measures)), len(measures), 1, sharex=True)
    parts = [(words(key), part) for key, part in table.groupby(by, dropna=False, sort=True)] if by else [("", table)]
    names = list(by_axis(table, axis, []))
    numeric = len(axis) == 1 and pd.api.types.is_numeric_dtype(table[axis[0]]) and not bool(table[axis[0]].isna().any())
    joined = numeric and not axis[0].endswith("seed")
    places = np.sort(table[axis[0]].unique().astype(float)) if numeric else np.arange(len(names), dtype=float)
    room = np.diff(places).min() if len(places) > 1 else 1.0
    for number, (label, part) in enumerate(parts):
        shift = (
            (0.3 if numeric else 0.6) * room * ((number + 0.5) / len(parts) - 0.5)
        )  # so that intervals do not cover each other
        found = {name: values for name, (_, values) in by_axis(part, axis, measures).items()}
        at = [place for place, name in zip(places, names, strict=True) if name in found]
        for panel, measure in zip(axes[:, 0], measures, strict=True):
            _intervals(
                panel,
                np.array(at) + shift,
                [found[name][measure] for name in names if name in found],
                label,
                number,
                joined,
            )
    for panel, measure in zip(axes[:, 0], measures, strict=True):
        panel.set_ylabel(MEASURES[measure].replace(" (", "\n("))
        panel.grid(axis="y", color="#00000018")
        panel.set_ylim(bottom=0, top=1.05 if measure == "arrived" else None)
    axes[-1, 0].set_xlabel(" and ".join(map(spoken, axis)))
    if numeric:
        axes[-1, 0].set_xticks(places if len(places) <= 12 else places[:: len(places) // 10])
    elif len(names) <= MOST_CHOICES:
        axes[-1, 0].set_xticks(
            places,
            [name if len(name) < 26 else name[:24] + "…" for name in names],
            rotation=20 if len(names) > 4 else 0,
        )
    if by:
        figure.legend(
            *axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4, frameon=False, fontsize=8
        )
    return figure


def _intervals(axes: Axes, places: np.ndarray, found: list[Interval], label: str, number: int, joined: bool) -> None:
    """Means as dots with their intervals as bars, joined where the places are numbers."""
    values = np.array([each.value for each in found])
    ends = np.array([[each.value - each.low for each in found], [each.high - each.value for each in found]])
    colour, style = COLOURS[number % len(COLOURS)], "o-" if joined else "o"
    axes.errorbar(
        places, values, yerr=ends.clip(0), fmt=style, color=colour, label=label, ms=4, lw=1.2, elinewidth=1, capsize=2
    )


def walked(world: World, route: Route, steps: pd.DataFrame, at: int) -> Figure:
    """A walk from above, with the places of poor steps; the step `at` is ringed."""
    xy = steps[["x_m", "y_m"]].to_numpy()
    every = np.vstack([route.xy, xy])
    across, up = np.ptp(every, axis=0) + 0.7
    scale = min(6.4 / across, 4.6 / up)
    figure, axes = canvas((max(2.6, scale * across + 0.8), scale * up + 0.6))
    draw_route(axes[0, 0], route)
    way = xy.copy()
    way[steps["reset"].notna().to_numpy()] = np.nan  # it did not walk to where it was put
    axes[0, 0].plot(*way.T, color=PATH_COLOUR, lw=1.4, zorder=3)
    poor = steps["cause"].notna().to_numpy()
    axes[0, 0].plot(*xy[poor].T, ".", color=CURVE_COLOUR, ms=5, zorder=4)
    axes[0, 0].plot(*xy[at], "o", mfc="none", mec=CURVE_COLOUR, ms=13, mew=1.6, zorder=5)
    plan(axes[0, 0], world, every)
    return figure


def seen(view: UInt8[np.ndarray, "h w c"], recognised: UInt8[np.ndarray, "h w c"] | None) -> Figure:
    """What an agent saw as it chose a poor heading, above the learned view that it recognised, if that is known."""
    rows = 1 if recognised is None else 2
    figure, axes = canvas((7.2, 1.5 * rows + 0.2), rows, 1, sharex=True)
    panorama(axes[0, 0], view, "seen")
    if recognised is not None:
        panorama(axes[1, 0], recognised, "recognised")
        axes[0, 0].set_xlabel("")
    return figure
