"""Views of a world that has changed since its views were learned."""

from collections.abc import Sequence

import numpy as np

from tussock.world.change import Change
from tussock.world.errors import SettingError
from tussock.world.eye_change import EyeMount
from tussock.world.geometry import Route
from tussock.world.scene import World

from .lighting import lit
from .poses import AnyPoses, Views
from .renderer import Renderer


def changed_world(world: World, change: Change, seed: int = 0, route: Route | None = None, state: int = 0) -> World:
    """The world after a change. Of a lit world, the shapes change first; then the light, which may have changed, is put on it anew.

    Args:
        world: The world as it was.
        change: What changes.
        seed: Of what is drawn.
        route: Through the world.
        state: See `Change.apply`.

    Raises:
        SettingError: Where the sun is to change and the world has none, or where its light is of a file.
    """
    if world.light is None:
        if change.of_light:
            raise SettingError(
                f"{str(change)!r} changes the sun, and this world has none: give --light, such as --light sun"
            )
        return change.apply(world, seed, route, state)
    before, light = world.without_light(), change.lit(world.light)
    changed = change.apply(before, seed, route, state)
    return world if changed is before and light == world.light else lit(changed, light)


class ChangedViews:
    """A renderer of a changed world, which may differ from step to step of a walk, a `Renderer`.

    Args:
        renderers: Of the states of the world; at each step of a walk, one of them is drawn.
        training: Draws the views that are learned: of the world as it was.
        seed: Of which state a step has.
        mount: How the eye is mounted; the renderers draw its views.

    Attributes:
        training: Draws the views that are learned.
        mount: How the eye is mounted.
        world: The world in its first state. Obstacles and recordings are of this one.
    """

    def __init__(self, renderers: Sequence[Renderer], training: Renderer, seed: int = 0, mount: EyeMount | None = None):
        self._renderers, self.training, self._seed = tuple(renderers), training, seed
        self.mount = mount or EyeMount()
        first = self._renderers[0]
        self.world, self.eye, self.backend = first.world, first.eye, first.backend

    def at_step(self, step: int) -> Renderer:
        """The renderer of the state of the world at a step of a walk."""
        if len(self._renderers) == 1:
            return self._renderers[0]
        return self._renderers[int(np.random.default_rng([self._seed, step]).integers(len(self._renderers)))]

    def render(self, poses: AnyPoses) -> Views:
        """See `Renderer.render`; in the first state."""
        return self._renderers[0].render(poses)

    def close(self) -> None:
        """Close the renderers of the changed world."""
        for renderer in self._renderers:
            renderer.close()

    def __enter__(self) -> "ChangedViews":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()


def at_step(renderer: Renderer, step: int) -> Renderer:
    """What draws the views at a step of a walk: the renderer, or that of the state of a changed world."""
    return renderer.at_step(step) if isinstance(renderer, ChangedViews) else renderer
