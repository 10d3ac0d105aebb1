"""The world as it is when an agent walks: another than that in which it learned, where an experiment says so."""

import dataclasses
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from tussock.world.errors import SettingError

if TYPE_CHECKING:
    from tussock.render.renderer import Renderer
    from tussock.world.geometry import Route

    from .experiment import Experiment
    from .trained_navigator import TrainedNavigator


@contextmanager
def changed_views(experiment: "Experiment", renderer: "Renderer", route: "Route") -> "Iterator[Renderer]":
    """What draws the views of a walk: the renderer, or one of the changed world, which is closed with the block.

    Args:
        experiment: What changes.
        renderer: Of the world in which the views were learned.
        route: Through it.
    """
    change = experiment.test_change
    if change is None:
        yield renderer
        return
    from tussock.render.changed_views import ChangedViews, changed_world

    seed = experiment.seed if experiment.change_seed is None else experiment.change_seed
    training = getattr(renderer, "training", renderer)
    with ExitStack() as opened:
        states = [
            opened.enter_context(
                experiment.open_renderer(changed_world(renderer.world, change, seed, route, state), mount=change.mount)
            )
            for state in range(change.states)
        ]
        yield ChangedViews(states, training, seed, change.mount)


@contextmanager
def in_changed_world(experiment: "Experiment", trained: "TrainedNavigator") -> "Iterator[TrainedNavigator]":
    """What an experiment has learned, in the world where it walks; see `changed_views`."""
    with changed_views(experiment, trained.renderer, trained.route) as renderer:
        yield with_views(trained, renderer)


def with_views(trained: "TrainedNavigator", renderer: "Renderer") -> "TrainedNavigator":
    """The same navigator, which sees what a renderer draws."""
    return trained if renderer is trained.renderer else dataclasses.replace(trained, renderer=renderer)


def check_no_gusts(experiment: "Experiment") -> None:
    """Refuse a change that differs from step to step where nothing walks. Raises SettingError."""
    if experiment.test_change is not None and experiment.test_change.states > 1:
        raise SettingError(
            f"--test-change {str(experiment.test_change)!r}: gusts differ from step to step of a walk, and nothing walks here; "
            "leave gusts out"
        )
