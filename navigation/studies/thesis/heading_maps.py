"""Maps of recovered headings."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...evaluation import RECOVERED_DEG
from ...reports.drawing import GOOD_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from ...reports.maps import draw_arrows, draw_map, draw_route, map_axes
from .study_data import StudyData


def draw_heading_map(
    axes: Axes, table: pd.DataFrame, data: StudyData, title: str = "", *, whole_route: bool = True
) -> None:
    """Draw recovered headings, green where they are less than 45 degrees off and red elsewhere, and the route in blue.

    Args:
        axes: Where to draw.
        table: One row per position, with the columns of `headings`.
        data: The views that the headings were recovered from.
        title: Title of the map.
        whole_route: Show all of the route, not only the part around the positions.
    """
    route = data.route
    draw_route(axes, route)
    shown = np.linspace(0, len(route.poses) - 1, max(4, int(route.length / 0.4))).astype(int)[:-1]
    draw_arrows(axes, *route.xy[shown].T, np.degrees(route.poses[shown, 2]), ROUTE_COLOUR, 0.12)
    good = table["error_deg"] < RECOVERED_DEG
    draw_arrows(axes, table["x_m"], table["y_m"], table["heading_deg"], np.where(good, GOOD_COLOUR, PATH_COLOUR))
    positions = table[["x_m", "y_m"]].to_numpy()
    draw_map(axes, data.world, np.vstack([route.xy, positions]) if whole_route else positions)
    count = f"{int(good.sum())} of {len(good)} less than 45° off"
    axes.set_title(f"{title}\n{count}" if title else count)


def heading_maps(tables: Mapping[str, pd.DataFrame], data: StudyData, titles: Mapping[str, str]) -> Figure:
    """Heading maps side by side. titles: the maps' titles by the names of their tables."""
    positions = [tables[name][["x_m", "y_m"]].to_numpy() for name in titles]
    drawn, axes = map_axes(np.vstack([data.route.xy, *positions]), len(titles))
    for axis, (name, title) in zip(axes[0], titles.items(), strict=True):
        draw_heading_map(axis, tables[name], data, title)
    for axis in axes[0, 1:]:
        axis.set_ylabel("")
    return drawn
