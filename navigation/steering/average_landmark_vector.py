"""Average landmark vector: one vector sums up a view, and its difference from that of the goal's view leads home."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
from jaxtyping import Float

from tussock.world.geometry import column_azimuths, wrap_angle
from tussock.world.settings import number, settings

from .navigator import Images, Look, Motion
from .places import Places, index_of_goal, needs_places


@settings
class AverageLandmarkVector:
    """Walks along the difference between the average landmark vector of the view and that of the goal's view.

        home = v(now) - v(goal),    v = mean of u over all landmarks

    where u is the unit vector, by the compass, from the agent to a landmark. Landmarks are columns of the encoded view that stand out, as
    edges do: their largest |pixel| is a peak among the columns. Each counts once, however high or strong it is: weighted by their pixels,
    near landmarks outweigh the others, and the vector leads astray. Seen from the east of the goal, landmarks around it appear farther
    to the west, so that the difference points home. Lambrinos D, Möller R, Labhart T, Pfeifer R, Wehner R (2000). A mobile robot
    employing insect strategies for navigation. Robotics and Autonomous Systems 30, 39-64.

    Attributes:
        contrast: A landmark's largest |pixel| is at least this share of the view's largest.
    """

    contrast: float = number(0.3, above=0, high=1)
    goal: Float[np.ndarray, "2"] = attrs.field(init=False)

    def learn(self, views: Images) -> None:
        """Refuse views without places. Raises SettingError."""
        raise needs_places("average-landmark-vector")

    def learn_at(self, views: Images, places: Places) -> None:
        """Learn the vector of the view (n, h, w) that was seen nearest to the goal."""
        at = index_of_goal(places)
        object.__setattr__(self, "goal", self.vectors(views[at : at + 1], places[at : at + 1, 2])[0])

    def begin(self) -> None:
        """An agent remembers nothing from look to look."""

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent along its difference."""
        home = self.vectors(look.views, look.compass) - self.goal
        turn = np.where(home.any(axis=1), wrap_angle(np.arctan2(home[:, 1], home[:, 0]) - look.compass), 0.0)
        return Motion(turn=turn, signals={"home_direction": home})

    def vectors(self, views: Images, headings: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 2"]:
        """The average landmark vectors of views (n, h, w) that face headings (rad), east and north; 0 of views without landmarks."""
        azimuths = column_azimuths(views.shape[2])
        vectors = []
        for view, heading in zip(views.abs().amax(dim=1).double().cpu().numpy(), headings, strict=True):
            landmarks, directions = self._landmarks(view), azimuths + heading
            sums = np.array([landmarks @ np.cos(directions), landmarks @ np.sin(directions)])
            vectors.append(sums / max(landmarks.sum(), 1.0))
        return np.reshape(vectors, (-1, 2))

    def _landmarks(self, contrast: Float[np.ndarray, " w"]) -> Float[np.ndarray, " w"]:
        """How much of a landmark each column is: 1, or half where the peak has two equal ends."""
        before, after = np.roll(contrast, 1), np.roll(contrast, -1)
        peak = ((contrast > before) & (contrast >= after)) / 2 + ((contrast >= before) & (contrast > after)) / 2
        return peak * (contrast >= self.contrast * contrast.max())
