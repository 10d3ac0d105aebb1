"""Study 1: the world and its views (section 4.1, figures 4 and 5)."""

import numpy as np
import pandas as pd

from ...reports.results import StudyResults
from . import published
from .parameters import Progress, StudySettings
from .study_data import StudyData


def study(data: StudyData, settings: StudySettings, progress: Progress) -> StudyResults:
    """The grid, the route, and how many views there are."""
    poses = data.route.poses
    return StudyResults(
        tables={
            "grid": pd.DataFrame(data.grid, columns=["x_m", "y_m"]),
            "route": pd.DataFrame({"x_m": poses[:, 0], "y_m": poses[:, 1], "heading_deg": np.degrees(poses[:, 2])}),
        },
        numbers={
            "grid_views": len(data.grid),
            "grid_views_published": published.GRID_VIEWS,
            "route_views": len(poses),
            "route_length_m": data.route.length,
            "places_near_the_route": len(data.near),
            "panorama": f"{data.route_views.shape[2]} x {data.route_views.shape[1]}",
        },
    )
