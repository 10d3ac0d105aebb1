"""Study 1: the world and the database (section 4.1, figures 4 and 5)."""

import numpy as np
import pandas as pd

from ...reports.findings import Findings
from . import published
from .material import Material
from .settings import Settings


def study(material: Material, settings: Settings, progress=lambda done, total: None) -> Findings:
    """What there is to look at: the grid, the route, and what an eye sees."""
    poses = material.route.poses
    return Findings(
        tables={
            "grid": pd.DataFrame(material.grid, columns=["x_m", "y_m"]),
            "route": pd.DataFrame({"x_m": poses[:, 0], "y_m": poses[:, 1], "heading_deg": np.degrees(poses[:, 2])}),
        },
        numbers={
            "grid_views": len(material.grid), "grid_views_published": published.GRID_VIEWS, "route_views": len(poses),
            "route_length_m": material.route.length, "places_near_the_route": len(material.near),
            "panorama": f"{material.route_views.shape[2]} x {material.route_views.shape[1]}",
        },
    )  # fmt: skip
