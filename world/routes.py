"""Routes that an insect could walk: smooth, with a few corners, clear of all obstacles.

This works in any world: obstacles are what its triangles cover on the ground, whatever they belong to. Where agents stand on the
world's mesh (`World.on_mesh`), the ground is not an obstacle, heights are those above it, and a route keeps off what is too steep and
off its edge. Lengths are measured over the x-y plane.
"""

import logging

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from .errors import InputError, SettingError
from .generate import seeded
from .geometry import Bounds, Route, place_text
from .obstacles import clearance
from .origin import shown
from .paths import CELL, MARGIN, MIN_CLEARANCE, PREFERRED_CLEARANCE, Paths
from .scene import World

log = logging.getLogger(__name__)

MIN_LENGTH = 0.1  # m of a route
USUAL_LENGTH = 8.0  # m; nobody is told where it does not fit into a small field, as nobody asked for it
SPACING = 0.01  # m between points of a route
MAX_TURN = np.radians(30)  # of a route within 2 cm
MAX_ATTEMPTS = 60

MAX_CHECKED = 10**6  # points of a route
MAX_CELLS = 4 * 10**7  # of the grid: a field of 126 m x 126 m


def generate_route(
    world: World, seed: int, length: float = USUAL_LENGTH, goal: tuple[float, ...] | None = None
) -> Route:
    """Generate a smooth route with 2 to 4 corners through a world. The same world and seed give the same bytes.

    The route stays 5 % of the field's shorter side (at most 0.3 m) inside the field, and MIN_CLEARANCE away from all obstacles
    lower than BODY_HEIGHT and higher than STEP_HEIGHT. Points are 1 cm apart, each faces the next one.

    Args:
        world: The world.
        seed: A whole number from 0.
        length: Length of the route (m). In a field that is too small for it, the route is 0.8 of the field's diagonal long.
        goal: x and y of its end (m), to within 10 cm. With it, several seeds give several routes to the same goal.

    Raises:
        SettingError: For an invalid length, seed or goal.
        InputError: Where the world has no room for such a route.
    """
    check_length(length)
    rng, field = seeded(seed), world.field
    longest = 0.8 * float(np.hypot(*field.size))
    if length > longest and length != USUAL_LENGTH:
        log.warning("a route of %g m does not fit into the field (%s); this one is %.2f m long", length, field, longest)
    length = min(float(length), longest)
    if np.prod(field.size / CELL + 2 * MARGIN) > MAX_CELLS:
        of_a_file = "" if world.origin else " (or the unit of the file, such as --unit mm)"
        raise InputError(
            f"the field ({field}) is too large to look for a route in, {MAX_CELLS * CELL**2:,.0f} m2 at most; give a route{of_a_file}"
        )
    inside = field.widened(-min(0.3, 0.05 * float(field.size.min())))
    if goal is not None:
        _check_goal(world, goal, inside)
    paths = Paths.of(world, inside)
    for _ in range(MAX_ATTEMPTS if len(paths.nodes) else 0):
        corners = _random_corners(inside, length, rng, goal)  # they begin at the goal, where there is one
        path = paths.through(corners) if corners is not None else None
        if path is None:
            continue
        for smoothing in (0.16, 0.11, 0.07, 0.045):
            route = _smoothed(path, smoothing, length)
            if (
                route is not None
                and _is_valid(route, inside)
                and clearance(world, route).min() >= MIN_CLEARANCE
                and _first_off_ground(world, route) is None
            ):
                points = np.round(route, 9)  # to a nanometre: further digits differ from processor to processor
                return Route.through(points if goal is None else points[::-1])
    raise InputError(
        f"found no route of {length:.2f} m in the field ({field}) that keeps {100 * MIN_CLEARANCE:g} cm clear of plants; "
        "ask for a shorter one or for less vegetation"
    )


def in_equal_steps(route: Route, step: float, turn: float) -> Route:
    """A route along another one in straight steps of one length, whose directions are multiples of an angle.

    An agent with this step that always turns by the right multiple of the angle stands on its points exactly. It drifts away from the
    given route by up to some centimetres. The program of Ardin et al. (2016) lays out its routes in this way, with 10 cm and 2 degrees.

    Args:
        route: The route.
        step: Length of each step (m).
        turn: The angle (rad).
    """
    along = np.diff(route.resampled(step).xy, axis=0)
    headings = turn * np.rint(np.arctan2(along[:, 1], along[:, 0]) / turn)
    steps = step * np.column_stack([np.cos(headings), np.sin(headings)])
    return Route.through(np.vstack([route.xy[:1], route.xy[0] + np.cumsum(steps, axis=0)]))


def check_length(length: float) -> None:
    """Refuse an invalid length of a route (m). Raises SettingError."""
    if not MIN_LENGTH <= length < np.inf:
        raise SettingError(f"a route of {length} m; give a length of at least {MIN_LENGTH} m")


def check_route(world: World, route: Route) -> None:
    """Refuse a route that leaves the world or its ground. Raises InputError."""
    inside = world.field.contains(*route.xy.T)
    if not inside.all():
        x, y = route.xy[~inside][0]
        local = f", with its origin ({shown(world.origin_m)}) subtracted" if any(world.origin_m) else ""
        raise InputError(
            f"the route leaves the world ({world.field}) at {place_text(x, y)}{local}; choose a route of this world"
        )
    spacing = max(SPACING, route.length / MAX_CHECKED)
    problem = _first_off_ground(world, route.at(np.arange(0.0, route.length + spacing, spacing))[:, :2])
    if problem is not None:
        raise InputError(f"the route cannot be walked: {problem}; choose another route, or give --max-slope-deg")


def _first_off_ground(world: World, xy: Float[np.ndarray, "n 2"]) -> str | None:
    """Why a route through points (m) cannot be walked, at the first point where it leaves the ground or is too steep; None if nowhere."""
    if world.terrain is None:
        return None
    height = world.ground_height(xy)
    if np.isnan(height).any():
        return world.terrain.problem(*xy[np.isnan(height).argmax()].tolist())
    steep = world.terrain.is_too_steep(np.hypot(*np.diff(xy, axis=0).T), np.diff(height))
    if not steep.any():
        return None
    (x, y), (before, after) = xy[steep.argmax()].tolist(), height[steep.argmax() :][:2].tolist()
    return f"the ground rises from {before:g} to {after:g} m at {place_text(x, y)}"


def _check_goal(world: World, goal: tuple[float, ...], inside: Bounds) -> None:
    """Refuse an invalid goal, and one with an obstacle near it. Raises SettingError."""
    if len(goal) != 2:
        raise SettingError(f"a goal at {goal!r}; give x and y (m)")
    x, y = goal
    if not (np.isfinite(goal).all() and inside.contains(x, y)):
        raise SettingError(f"a goal at {place_text(x, y)}; choose one inside the field, off its edge ({inside})")
    if world.terrain is not None and not world.stands(np.array([goal]))[0]:
        raise SettingError(f"a goal at {place_text(x, y)}: {world.terrain.problem(x, y)}; choose another one")
    room = float(clearance(world, np.array([goal]))[0])
    if room < PREFERRED_CLEARANCE:
        raise SettingError(
            f"the goal {place_text(x, y)} is {room:.2f} m from an obstacle; choose one that is at least {PREFERRED_CLEARANCE} m away"
        )


def _random_corners(
    inside: Bounds, length: float, rng: np.random.Generator, start: tuple[float, ...] | None = None
) -> Float[np.ndarray, "n 2"] | None:
    """Ends and corners of 3 to 5 straight legs, together a little longer than `length`; None if no draw was inside."""
    n, legs = 400, int(rng.integers(3, 6))
    turn = np.radians(rng.uniform(35, 110, (n, legs))) * rng.choice([-1, 1], (n, 1)) * (-1) ** np.arange(legs)
    turn *= np.where(rng.random((n, legs)) < 0.15, -1, 1)  # sometimes two turns in the same direction
    turn[:, 0] = rng.uniform(-np.pi, np.pi, n)
    direction, leg = turn.cumsum(axis=1), 1.06 * length * rng.dirichlet(np.full(legs, 8.0), n)
    first = rng.uniform(inside[:2], inside[2:], (n, 2)) if start is None else np.tile(start, (n, 1))
    steps = leg[..., None] * np.stack([np.cos(direction), np.sin(direction)], axis=2)
    corners = np.concatenate([first[:, None], first[:, None] + steps.cumsum(axis=1)], axis=1)
    fits = inside.contains(corners[..., 0], corners[..., 1]).all(axis=1)
    fits &= np.hypot(*(corners[:, -1] - corners[:, 0]).T) > 0.35 * length  # it does not end near its start
    return corners[fits.argmax()] if fits.any() else None


def _smoothed(path: Float[np.ndarray, "k 2"], smoothing: float, length: float) -> Float[np.ndarray, "n 2"] | None:
    """The path, smoothed over about `smoothing` metres and cut to `length`; None if it is shorter."""
    if len(path) < 2:  # all corners are nearest to one node
        return None
    smooth = gaussian_filter1d(_resampled(path), smoothing / SPACING, axis=0, mode="nearest")
    route = _resampled(smooth)
    n = round(length / SPACING) + 1
    return route[:n] if len(route) >= n else None


def _resampled(path: Float[np.ndarray, "k 2"]) -> Float[np.ndarray, "n 2"]:
    """Points along a polyline, SPACING apart, from its start."""
    arc = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T))]
    at = np.arange(0.0, arc[-1], SPACING)
    return np.column_stack([np.interp(at, arc, path[:, i]) for i in (0, 1)])


def _is_valid(route: Float[np.ndarray, "n 2"], inside: Bounds) -> bool:
    """Whether a route stays inside, has no sharp turn, and does not return to an earlier position."""
    steps = np.diff(route, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    if not inside.contains(*route.T).all() or np.abs(heading[2:] - heading[:-2]).max() > MAX_TURN:
        return False
    points, apart = route[::5], 5 * SPACING
    row, other = np.triu_indices(len(points), round(0.8 / apart))
    return bool((np.hypot(*(points[row] - points[other]).T) > 0.3).all())
