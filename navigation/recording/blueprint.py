"""How a recording is shown: what the agent sees on the left, the world on the right. It travels inside the recording."""

from dataclasses import dataclass, replace

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tussock.world.geometry import Route

from ..failures import Cause
from ..walker import Step
from .signals import LINES, MAPS, entity, line_names, map_names, ways
from .viewer import TIMELINE

CAUSE_COLOURS = {  # as on dark grey, in which names are written
    Cause.OCCLUSION: (185, 130, 255), Cause.OFF_CATCHMENT: (255, 255, 255), Cause.ALIASING: (255, 110, 205),
    Cause.UNLEARNED: (255, 225, 0), Cause.CORNER: (0, 225, 225), Cause.UNEXPLAINED: (185, 185, 185),
}  # fmt: skip
EYE_OFFSET = (-0.75, -0.55, 0.85)  # of the camera from the middle of the route, in lengths of the route's extent


TOUCHED, CARRIED = "world/touched", "world/carried"  # marks where obstacles met the agent, and where it was carried to


def cause_entity(cause: Cause) -> str:
    """Where the marks of a cause are logged."""
    return f"world/causes/{cause.replace(' ', '_')}"


TILT = "tilt/degrees"
MARKS = {cause_entity(cause): colour for cause, colour in CAUSE_COLOURS.items()} | {
    TOUCHED: (255, 140, 0), CARRIED: (255, 255, 255),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What a recording of a walk shows: panels exist only for these.

    Attributes:
        recognised: Learned views that are recognised.
        scan: Familiarity of all rotations.
        tilt: Pitch and roll of the eye.
        lines: Names of the signals that are numbers.
        maps: Names of the signals that are several values.
        ways: Names of the signals that are ways.
    """

    recognised: bool = False
    scan: bool = False
    tilt: bool = False
    lines: tuple[str, ...] = ()
    maps: tuple[str, ...] = ()
    ways: tuple[str, ...] = ()

    def with_step(self, step: Step, *, learned: bool) -> "Shown":
        """The same, and what a step has. learned: Whether the poses of the learned views are known."""
        names = {"lines": line_names(step.signals), "maps": map_names(step.signals), "ways": ways(step.signals)}
        return replace(
            self,
            recognised=self.recognised or (step.match is not None and learned),
            scan=self.scan or step.familiarity is not None,
            tilt=self.tilt or step.tilt is not None,
            **{kind: tuple(dict.fromkeys([*getattr(self, kind), *found])) for kind, found in names.items()},
        )


OF_A_SCAN = Shown(recognised=True, scan=True)


def blueprint(route: Route, max_deviation: float, shown: Shown = OF_A_SCAN) -> rrb.Blueprint:
    """The layout of a recording.

    Args:
        route: The route in it.
        max_deviation: Deviation to which its plot reaches (m).
        shown: What there is to show.
    """
    return rrb.Blueprint(
        rrb.Horizontal(_agent_views(max_deviation, shown), _surroundings(route, shown), column_shares=[1, 1]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="following"),
        collapse_panels=True,
    )


def _agent_views(max_deviation: float, shown: Shown) -> rrb.Vertical:
    """What the agent sees, what it recognises and steers by, and how well it does."""
    views: list[tuple[float, rrb.View | rrb.Container]] = [
        (1.3, rrb.Spatial2DView(origin="view", name="What the agent sees (ahead is the middle)"))
    ]
    if shown.recognised:
        views.append((1.3, rrb.Spatial2DView(origin="recognised", name="The learned view it recognises")))
    if shown.scan:
        hidden = rrb.PlotLegend(visible=False)
        name = "Familiarity above the least, by degrees to the right (red: chosen, grey: not compared)"
        views.append((1, rrb.BarChartView(origin="familiarity", name=name, plot_legend=hidden)))
    if shown.lines:
        legend = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
        views.append((1.3, rrb.TimeSeriesView(origin=LINES, name="What it steers by", plot_legend=legend)))
    if shown.maps:
        maps = [
            rrb.TensorView(origin=entity(MAPS, name), name=f"{name}, now on the right", view_fit="Fill")
            for name in shown.maps
        ]
        views.append((1.3, rrb.Horizontal(*maps)))
    views.append((1, _curve("deviation", "Deviation from the route (m)", (0.0, max_deviation))))
    views.append((1, _curve("error", "Heading error (degrees; grey: 45 to either side)", (-90.0, 90.0))))
    if shown.tilt:
        limits, legend = rrb.ScalarAxis(range=(-45.0, 45.0)), rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
        name = "Tilt of the eye (degrees): front up, right side down"
        views.append((1, rrb.TimeSeriesView(origin=TILT, name=name, axis_y=limits, plot_legend=legend)))
    if not shown.scan:
        views.append((1, _curve("goal", "Distance from the goal (m)", None)))
    shares, panels = zip(*views, strict=True)
    return rrb.Vertical(*panels, row_shares=shares)


def _curve(origin: str, name: str, limits: tuple[float, float] | None) -> rrb.TimeSeriesView:
    axis = None if limits is None else rrb.ScalarAxis(range=limits)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_y=axis, plot_legend=rrb.PlotLegend(visible=False))


def _surroundings(route: Route, shown: Shown) -> rrb.Vertical:
    """The world with the route and the path, what the walk is about, and what happens."""
    middle = (route.xy.min(axis=0) + route.xy.max(axis=0)) / 2
    extent = max(float(np.ptp(route.xy, axis=0).max()), 1.0)
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    arrows = "".join(f", {name} (green arrow)" for name in shown.ways)
    world = rrb.Spatial3DView(
        origin="world",
        name=f"World, route (blue, to the ball) and path (red){arrows}",
        overrides=dict.fromkeys(("world/path", *MARKS), so_far),
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
