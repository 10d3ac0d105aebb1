"""The worst walks in a sweep's report: each from above, with its view where it went wrong."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure

from tussock.render.changed_views import at_step
from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError
from tussock.world.specs import Spec

from ..changed_world import changed_views
from ..experiment import Experiment
from ..experiment_settings import TYPES, experiment_of
from ..failures import Cause, Diagnosis
from ..reports.report import Command, Drawing, Section
from ..training import training_source, training_views
from .figures import view_and_match, walk_map
from .recordings import recordings_in


def walk_section(number: int, key: str, row: dict[str, Any], steps: pd.DataFrame, folder: Path) -> Section:
    """What the report shows of a walk.

    Args:
        number: Its number among the worst walks.
        key: Key of its run.
        row: Its row of the table.
        steps: Its trajectory.
        folder: Folder of the sweep.

    Returns:
        A section with the walk from above, its view at one step, why that step was poor, and the command that repeats the run.
    """
    shown = step_to_show(row, steps)
    evidence = describe_evidence(steps.iloc[shown])
    caption = f"Step {shown}" + (f": {evidence}." if evidence else ".")
    if recorded := recordings_in(folder).get(key):
        caption += f" Its recording is {recorded}."
    drawing = Drawing(
        names=(f"walk-{key}", f"view-{key}"),
        draw=lambda: _draw(row, steps, shown),
        alt=f"The walk from above, and its view at step {shown}",
        caption=caption,
    )
    title = f"{number}. {row['model']}: {_describe(row)}" + (f": {row['cause']}" if row["cause"] else "")
    return Section(title=title, anchor=f"walk-{key}", blocks=[drawing, Command(row["command"])])


def _draw(row: dict[str, Any], steps: pd.DataFrame, shown: int) -> Iterator[Figure]:
    """The walk from above, and the view at one of its steps. Raises InputError where its world or model cannot be opened."""
    experiment, step = experiment_of({name: row.get(name) for name in TYPES}), steps.iloc[shown]
    pose = np.array([[step["x_m"], step["y_m"], np.radians(step["heading_deg"])]])
    world, route = experiment.open_world_and_route()
    with experiment.open_renderer(world) as learned_in, changed_views(experiment, learned_in, route) as renderer:
        view, match = renderer.eye.hide(at_step(renderer, shown).render(pose))[0], None
        if isinstance(experiment.model, Spec) and not pd.isna(step["match"]):
            learned = learned_pose(int(step["match"]), experiment, renderer, experiment.training_poses(world, route))
            match = renderer.eye.hide(training_source(renderer).render(learned))[0]
        world = renderer.world
    yield walk_map(world, route, steps, shown)
    yield view_and_match(view, match)


def learned_pose(
    number: int, experiment: Experiment, renderer: Renderer, poses: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "1 3"]:
    """(1, 3) Pose of the view that was learned with a number; views without contrast were not learned."""
    count, learned = 0, poses[:0]
    while len(learned) <= number and count < len(poses):
        some = poses[count : count + number + 1 - len(learned)]  # no more views are drawn than it takes
        count += len(some)
        with suppress(SettingError):  # none of these was learned
            learned = np.concatenate([learned, training_views(experiment.encoding, renderer, some, warn=False)[1]])
    return learned[[number]]


def step_to_show(row: dict[str, Any], steps: pd.DataFrame) -> int:
    """The last step that failed for the walk's cause, or else the step farthest from the route."""
    same = steps.index[steps["cause"] == row["cause"]] if row["cause"] else []
    return int(same[-1]) if len(same) else int(steps["deviation_m"].idxmax())


def describe_evidence(step: pd.Series) -> str | None:
    """Why a step of a trajectory was poor, with the evidence; None for a good step."""
    known = step.dropna().to_dict()
    if "cause" not in known:
        return None
    error, turning = (float(np.radians(known[name])) for name in ("error_deg", "turning_deg"))
    nearest, recognised = known.get("nearest_view_m"), known.get("recognised_view_m")
    diagnosis = Diagnosis(
        covered=known.get("covered"),
        nearest=nearest,
        recognised=recognised,
        error=error,
        turning=turning,
        recognises=known["cause"] != Cause.UNEXPLAINED,  # so that a cause that was not given is not found here
    )
    return str(diagnosis)


def _describe(row: dict[str, Any]) -> str:
    """How a walk ended."""
    end = f"{row['reason']} after {row['steps']} steps, {100 * row['mean_deviation_m']:.1f} cm off the route on average"
    return end + (f", put back {row['resets']} times" if row["resets"] else "")
