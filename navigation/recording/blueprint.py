"""How a recording is shown: what the agent sees on the left, the world on the right. It travels inside the recording."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tussock.world.geometry import Route

from ..failures import Cause

TIMELINE = "step"
CAUSE_COLOURS = {  # as on dark grey, in which names are written
    Cause.OCCLUSION: (185, 130, 255), Cause.OFF_CATCHMENT: (255, 255, 255), Cause.ALIASING: (255, 110, 205),
    Cause.UNLEARNED: (255, 225, 0), Cause.CORNER: (0, 225, 225), Cause.UNEXPLAINED: (185, 185, 185),
}  # fmt: skip
EYE_OFFSET = (-0.75, -0.55, 0.85)  # of the camera from the middle of the route, in lengths of the route's extent


def cause_entity(cause: Cause) -> str:
    """Where the marks of a cause are logged."""
    return f"world/causes/{cause.replace(' ', '_')}"


def blueprint(route: Route, max_deviation: float) -> rrb.Blueprint:
    """The layout of a recording.

    Args:
        route: The route in it.
        max_deviation: Deviation to which its plot reaches (m).
    """
    return rrb.Blueprint(
        rrb.Horizontal(_agent_views(max_deviation), _surroundings(route), column_shares=[1, 1]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="following"),
        collapse_panels=True,
    )


def _agent_views(max_deviation: float) -> rrb.Vertical:
    """What the agent sees, what it recognises, and how well it does."""
    return rrb.Vertical(
        rrb.Spatial2DView(origin="view", name="What the agent sees (ahead is the middle)"),
        rrb.Spatial2DView(origin="recognised", name="The learned view it recognises"),
        rrb.BarChartView(
            origin="familiarity", name="Familiarity by degrees to the right", plot_legend=rrb.PlotLegend(visible=False)
        ),
        _curve("deviation", "Deviation from the route (m)", (0.0, max_deviation)),
        _curve("error", "Heading error (degrees)", (-90.0, 90.0)),
        row_shares=[1.3, 1.3, 1, 1, 1],
    )


def _curve(origin: str, name: str, limits: tuple[float, float]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin, name=name, axis_y=rrb.ScalarAxis(range=limits), plot_legend=rrb.PlotLegend(visible=False)
    )


def _surroundings(route: Route) -> rrb.Vertical:
    """The world with the route and the path, what the walk is about, and what happens."""
    middle = (route.xy.min(axis=0) + route.xy.max(axis=0)) / 2
    extent = max(float(np.ptp(route.xy, axis=0).max()), 1.0)
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    world = rrb.Spatial3DView(
        origin="world",
        name="World, route (blue, to the ball) and path (red)",
        overrides=dict.fromkeys(("world/path", *map(cause_entity, CAUSE_COLOURS)), so_far),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=np.array([*middle, 0.0]) + extent * np.array(EYE_OFFSET),
            look_target=[*middle, 0.0],
            eye_up=[0.0, 0.0, 1.0],
        ),
    )
    about = rrb.TextDocumentView(origin="about", name="About this walk")
    columns = rrb.TextLogColumns(text_log_columns=["loglevel", "body"])
    events = rrb.TextLogView(origin="events", name="Events", columns=columns)
    return rrb.Vertical(world, rrb.Horizontal(about, events, column_shares=[1, 2.2]), row_shares=[3, 1])


def image_format(width: int, height: int) -> rr.components.ImageFormat:
    """The format of the views in a recording."""
    return rr.components.ImageFormat(width=width, height=height, color_model="RGB", channel_datatype="U8")
