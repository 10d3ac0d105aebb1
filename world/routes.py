"""Routes that an insect could walk: smooth, with a few corners, clear of all obstacles.

This works in any world: obstacles are what its triangles cover on the ground, whatever they belong to. Where agents stand on the
world's mesh (`World.on_mesh`), the ground is not an obstacle, heights are those above it, and a route keeps off what is too steep and
off its edge. Lengths are measured over the x-y plane.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from .errors import InputError, SettingError
from .generate import seeded
from .geometry import Bounds, Route, place_text
from .obstacles import clearance, footprints
from .origin import shown
from .scene import World

MIN_CLEARANCE = 0.04  # m from every obstacle
PREFERRED_CLEARANCE = 0.12  # m; with less, a path costs more than twice its length
MIN_LENGTH = 0.1  # m of a route
SPACING = 0.01  # m between points of a route
MAX_TURN = np.radians(30)  # of a route within 2 cm
MAX_ATTEMPTS = 60

CELL = 0.02  # m, of the grid of clearances
MARGIN = 20  # cells around the field, so that obstacles just outside it count
NODE_SPACING = 3  # cells between the nodes through which paths are planned
MAX_CHECKED = 10**6  # points of a route
MAX_CELLS = 4 * 10**7  # of the grid: a field of 126 m x 126 m


def generate_route(world: World, seed: int, length: float = 8.0, goal: tuple[float, ...] | None = None) -> Route:
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
    length = min(float(length), 0.8 * float(np.hypot(*field.size)))
    if np.prod(field.size / CELL + 2 * MARGIN) > MAX_CELLS:
        of_a_file = "" if world.origin else " (or the unit of the file, such as --unit mm)"
        raise InputError(
            f"the field ({field}) is too large to look for a route in, {MAX_CELLS * CELL**2:,.0f} m2 at most; give a route{of_a_file}"
        )
    inside = field.widened(-min(0.3, 0.05 * float(field.size.min())))
    if goal is not None:
        _check_goal(world, goal, inside)
    nodes, graph = _path_graph(_clearance_grid(world, inside), inside)
    for _ in range(MAX_ATTEMPTS if len(nodes) else 0):
        corners = _random_corners(inside, length, rng, goal)  # they begin at the goal, where there is one
        path = _cheapest_path(corners, nodes, graph) if corners is not None else None
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
                return Route.through(route if goal is None else route[::-1])
    raise InputError(
        f"found no route of {length:.2f} m in the field ({field}) that keeps {100 * MIN_CLEARANCE:g} cm clear of plants; "
        "ask for a shorter one or for less vegetation"
    )


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


def _clearance_grid(world: World, inside: Bounds) -> Float[np.ndarray, "rows columns"]:
    """Clearance (m), to about a cell, on a grid from the lower left corner of `inside`; rows run along y."""
    size = np.ceil(inside.size / CELL).astype(int) + 1 + 2 * MARGIN
    free = np.full((size[1], size[0]), 255, np.uint8)
    cells = (footprints(world) - np.array(inside[:2])) / CELL + MARGIN
    visible = np.logical_and(cells.max(axis=1) > 0, cells.min(axis=1) < size).all(axis=1)
    for shape in np.round(cells[visible] * 16).astype(np.int32):
        cv2.fillConvexPoly(free, shape, 0, shift=4)
    if world.terrain is not None:
        free[_is_off_ground(world, inside, size)] = 0
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL
    return distance[MARGIN:-MARGIN, MARGIN:-MARGIN]


def _is_off_ground(world: World, inside: Bounds, size: Int[np.ndarray, "2"]) -> Bool[np.ndarray, "rows columns"]:
    """Which cells of the grid of clearances have no ground, or ground that is too steep to a neighbour."""
    assert world.terrain is not None
    x, y = (np.arange(-MARGIN, n - MARGIN) * CELL + low for n, low in zip(size, inside[:2], strict=True))
    height = np.stack([world.ground_height(np.column_stack([x, np.full(len(x), row)])) for row in y])
    off = np.isnan(height)
    for axis in (0, 1):
        here, there = off.swapaxes(0, axis)[:-1], off.swapaxes(0, axis)[1:]  # views: they change `off`
        steep = world.terrain.is_too_steep(CELL, np.diff(height, axis=axis)).swapaxes(0, axis)
        here |= steep
        there |= steep
    return off


def _path_graph(grid: Float[np.ndarray, "rows columns"], inside: Bounds) -> tuple[Float[np.ndarray, "n 2"], csr_array]:
    """Nodes (m) that are clear of obstacles, and the cost of going from one to a near one: its length, more where it is tight."""
    rows, columns = np.mgrid[0 : grid.shape[0] : NODE_SPACING, 0 : grid.shape[1] : NODE_SPACING]
    is_node = grid[::NODE_SPACING, ::NODE_SPACING] > MIN_CLEARANCE
    number = np.where(is_node, np.arange(rows.size).reshape(rows.shape), -1)
    pad = 2 * NODE_SPACING
    padded = np.pad(grid, pad)  # no clearance outside
    here, there, cost = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)):
        between = [padded[rows + pad + down * s, columns + pad + right * s] for s in range(NODE_SPACING + 1)]
        narrowest = np.minimum.reduce(between)
        free = narrowest > MIN_CLEARANCE
        here.append(number[free])
        there.append(number[rows[free] // NODE_SPACING + down, columns[free] // NODE_SPACING + right])
        length = NODE_SPACING * CELL * np.hypot(down, right)
        cost.append(length * (1 + (PREFERRED_CLEARANCE / narrowest[free]) ** 2))
    edges = (np.concatenate(cost), (np.concatenate(here), np.concatenate(there)))
    graph = csr_array(edges, shape=(rows.size, rows.size))
    connected = np.unique(np.concatenate(edges[1]))
    xy = np.column_stack([columns.ravel(), rows.ravel()]) * CELL + np.array(inside[:2])
    return xy[connected], graph[connected][:, connected]


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


def _cheapest_path(corners: Float[np.ndarray, "n 2"], nodes, graph: csr_array) -> Float[np.ndarray, "k 2"] | None:
    """The cheapest path over the nodes by way of each corner; None if there is none."""
    stops = np.asarray(KDTree(nodes).query(corners)[1]).tolist()
    cost, before = dijkstra(graph, directed=False, indices=stops[:-1], return_predecessors=True)
    path = [stops[0]]
    for leg, stop in enumerate(stops[1:]):
        if not np.isfinite(cost[leg, stop]):
            return None
        backwards = [stop]
        while backwards[-1] != stops[leg]:
            backwards.append(before[leg, backwards[-1]])
        path += backwards[-2::-1]
    return nodes[path]


def _smoothed(path: Float[np.ndarray, "k 2"], smoothing: float, length: float) -> Float[np.ndarray, "n 2"] | None:
    """The path, smoothed over about `smoothing` metres and cut to `length`; None if it is shorter."""
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
