"""Draws the pictures of docs/models.md: the familiarity of every heading for each model, on a straight and at a corner.

    python docs/draw_models.py [NAME ...] [--out FOLDER]

writes FOLDER/NAME.png; without names for all models, without a folder into assets/models.
"""

import argparse
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tussock.navigation import Encoding, make_model, train, training_poses
from tussock.navigation.models import MODELS
from tussock.navigation.reports.drawing import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR, STYLE, save_picture
from tussock.navigation.scan import best_turn
from tussock.render import open_renderer
from tussock.world import World
from tussock.world.geometry import Pose, Route, turn_of_columns, wrap_angle
from tussock.world.routes import generate_route

PICTURES = Path(__file__).parents[1] / "assets" / "models"
STRETCH = 0.5  # m over which the route's change of heading is taken
FROM_ENDS = 1.0  # m at both ends of the route that are left out
ASIDE = 0.05  # m to the left of the route: no view was learned there
FACING = np.radians(40)  # to the left of the route's heading, so that the answer is not rotation 0


def straight_and_corner(route: Route) -> tuple[float, float]:
    """Where along the route (m) its heading changes the least, and the most, over STRETCH."""
    along = np.arange(FROM_ENDS, route.length - FROM_ENDS, 0.05)
    change = np.abs(change_of_heading(route, along))
    return float(along[change.argmin()]), float(along[change.argmax()])


def change_of_heading(route: Route, along: np.ndarray | float) -> np.ndarray:
    """By how much the route turns (rad) over STRETCH, about each position along it (m)."""
    before, after = (route.at(along + side * STRETCH / 2)[:, 2] for side in (-1, 1))
    return wrap_angle(after - before)


def draw(path: Path, scans: list[tuple[str, np.ndarray, float]], title: str) -> None:
    """Write a picture of one model's familiarity at every heading, one panel per position.

    Args:
        path: File to write.
        scans: For each position its name, the familiarity at each rotation, and the direction that the eye faces, to the left of the
            route's heading (rad). In the picture the route's heading is 0.
        title: Text before the positions' names.
    """
    with matplotlib.rc_context(STYLE | {"font.size": 11, "axes.titlesize": 11}):
        figure = Figure(figsize=(8, 2.3), layout="constrained")
        panels = figure.subplots(1, len(scans), sharey=True, squeeze=False)[0]
        for axes, (position, familiarity, facing) in zip(panels, scans, strict=True):
            draw_familiarity(axes, familiarity, facing)
            axes.set_title(f"{title} {position}")
        panels[0].set_ylabel("familiarity")
        figure.supxlabel("degrees to the left of the route's heading (negative: to the right)", fontsize=11)
        figure.get_layout_engine().set(wspace=0.06)
        save_picture(figure, path)


def draw_familiarity(axes: Axes, familiarity: np.ndarray, facing: float) -> None:
    """Draw the familiarity of each rotation, the route's heading as a line and the most familiar heading as a dot."""
    width = len(familiarity)
    headings = np.degrees(wrap_angle(facing + turn_of_columns(np.arange(width), width)))
    order = headings.argsort()
    x, y = headings[order], familiarity[order]
    axes.plot(np.r_[x[-1] - 360, x, x[0] + 360], np.r_[y[-1], y, y[0]], color=CURVE_COLOUR, lw=1.4)
    error = float(np.degrees(wrap_angle(facing + best_turn(familiarity[None])[0])))
    axes.axvline(0, color=ROUTE_COLOUR, lw=1)
    axes.plot(error, y.max(), "o", color=PATH_COLOUR, ms=7, mec="white", zorder=3)
    label = f"{abs(error):.0f} degree{'' if round(abs(error)) == 1 else 's'} off"
    corner, align = (0.02, "left") if error > 45 else (0.99, "right")  # away from the dot
    axes.text(corner, 1, label, color=PATH_COLOUR, ha=align, va="top", transform=axes.transAxes)
    axes.set(xlim=(-180, 180), xticks=range(-180, 181, 90))
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(y=0.2)


def main() -> None:
    """Draw the pictures, and print by how many degrees the route turns at the corner."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=[*MODELS.builtin, "opponent-infomax"], metavar="NAME")
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder for the pictures")
    options = parser.parse_args()
    world = World.generate("tussock-field", seed=7)
    route = generate_route(world, seed=7)
    encoding = Encoding.named("edges", resize=6)
    places = straight_and_corner(route)
    eyes = [Pose(*route.at(along)[0]).moved(0, ASIDE).turned(FACING) for along in places]
    options.out.mkdir(exist_ok=True)
    with open_renderer(world) as renderer:
        seen = encoding(renderer.render(eyes))
        for name in options.names:
            model = train(make_model(name), encoding, renderer, training_poses(route, 0.04)).model
            straight, corner = model.scan(seen).numpy()
            positions = [("on a straight", straight, FACING), ("at a corner", corner, FACING)]
            draw(options.out / f"{name}.png", positions, title=name)
            print(options.out / f"{name}.png")
    turn = np.degrees(np.abs(change_of_heading(route, places[1]))).item()
    print(f"degrees by which the corner turns: {turn:.1f}")


if __name__ == "__main__":
    main()
