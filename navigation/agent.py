"""An agent: a walk with a navigator that scans for what a trained model finds most familiar."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Pose, Route

from .body import Body
from .models.files import TrainedModel
from .steering.scan import Scan
from .stopping import StoppingRules
from .walk import Walk
from .walker import Step


@dataclass(frozen=True, kw_only=True)
class Agent:
    """Follows a route by familiarity: looks around, turns to the most familiar heading, steps.

    Attributes:
        renderer: Draws what it sees.
        trained: The model, with the encoding that it was trained with.
        route: The route to follow.
        scan_width: Full width of the scan (rad).
        scan_about: Direction of the world in the middle of the scan (rad); None means the present heading.
        body: How it moves.
        stopping: When a walk ends.
        seed: Of the noise on its turns.
    """

    renderer: Renderer
    trained: TrainedModel
    route: Route
    scan_width: float = np.pi
    scan_about: float | None = None
    body: Body = field(default_factory=Body)
    stopping: StoppingRules = field(default_factory=StoppingRules)
    seed: int = 0

    def start(self, offset: float = 0.0) -> Pose:
        """The route's first pose, moved to its left by `offset` (m; negative: right)."""
        return self.route.start.moved(0.0, offset)

    def walk(self, start: Pose) -> Iterator[Step]:
        """Walk from `start` until arrival or failure; the last step has a `reason`."""
        for (step,) in self.walk_many([start]):
            assert step is not None
            yield step

    def walk_many(self, starts: Sequence[Pose]) -> Iterator[list[Step | None]]:
        """Walk from each start, side by side: see `Walk.steps`. Walk k draws its noise from `seed` + k."""
        if self.trained.encoding is None:
            raise SettingError("the encoding of what the model learned is not known; give TrainedModel its encoding")
        self.trained.check()
        self.trained.check_eye(self.renderer.eye)
        walk = Walk(
            renderer=self.renderer,
            encoding=self.trained.encoding,
            route=self.route,
            starts=starts,
            body=self.body,
            stopping=self.stopping,
            noise=self.seed,
        )
        return walk.steps(Scan(model=self.trained.model, width=self.scan_width, about=self.scan_about))
