"""Draws the pictures of docs/models.md: how familiar each model finds every heading, on a straight and at a corner.

    python docs/draw_models.py [NAME ...]

writes assets/models/NAME.png; without names, for all models.
"""

import sys
from pathlib import Path

import numpy as np

from tussock.navigation import Encoding, learn, make_model, training_poses
from tussock.navigation.models import MODELS
from tussock.navigation.reports.plots import familiarity_curves
from tussock.render import open_renderer
from tussock.world import World
from tussock.world.geometry import Pose, Route, wrap_angle
from tussock.world.routes import generate_route

PICTURES = Path(__file__).parents[1] / "assets" / "models"
STRETCH = 0.5  # m over which the route's change of heading is taken
FROM_ENDS = 1.0  # m of the route at both ends where no place is looked for
BESIDE = 0.05  # m to the left of the route: no trained view is there
FACING = np.radians(40)  # to the left of the route's heading, so that the answer is not rotation 0


def straight_and_corner(route: Route) -> tuple[float, float]:
    """Where along the route (m) its heading changes the least, and the most, over STRETCH."""
    along = np.arange(FROM_ENDS, route.length - FROM_ENDS, 0.05)
    before, after = (route.at(along + side * STRETCH / 2)[:, 2] for side in (-1, 1))
    change = np.abs(wrap_angle(after - before))
    return float(along[change.argmin()]), float(along[change.argmax()])


def main(names: list[str]) -> None:
    world = World.generate("tussock-field", seed=7)
    route = generate_route(world, seed=7)
    encoding = Encoding.named("edges", resize=6)
    eyes = [Pose(*route.at(along)[0]).moved(0, BESIDE).turned(FACING) for along in straight_and_corner(route)]
    PICTURES.mkdir(exist_ok=True)
    with open_renderer(world) as renderer:
        seen = encoding(renderer.render(eyes))
        for name in names:
            model = make_model(name)
            learn(model, encoding, renderer, training_poses(route.resampled(0.04)))
            straight, corner = model.scan(seen).numpy()
            places = [("on a straight", straight, FACING), ("at a corner", corner, FACING)]
            familiarity_curves(PICTURES / f"{name}.png", places, title=name)
            print(PICTURES / f"{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:] or [*MODELS.builtin, "opponent-infomax"])
