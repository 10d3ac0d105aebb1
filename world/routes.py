"""Routes an insect could walk: smooth, with a few corners, clear of everything that stands in the way.

Works on any world: obstacles are what its triangles cover on the ground, whatever made them.
"""

import cv2
import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from .errors import InputError
from .generate import seeded
from .geometry import Bounds, Route
from .scene import World

BODY_HEIGHT = 0.06  # m; what hangs higher is walked under
STEP_HEIGHT = 0.008  # m; what lies lower is walked over
CELL = 0.02  # m, of the occupancy grid
RIM = 20  # cells around the field, so that obstacles just outside count
NODE = 3  # cells between the nodes that paths are planned through
KEEP_AWAY = 0.04  # m from every obstacle
SHORTEST = 0.1  # m, of a route
PREFERRED = 0.12  # m; tighter than this costs more than twice the way
SPACING = 0.01  # m between points of a route
SHARPEST = np.radians(30)  # within 2 cm
TRIES = 60
MOST_CELLS = 4 * 10**7  # of the grid: a field of 126 m x 126 m


def clearance(world: World, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Distance (m, exact) from places to the nearest obstacle's footprint: 0 inside one, infinite if there is none."""
    xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    shapes = _footprints(world)
    if len(shapes) == 0:
        return np.full(len(xy), np.inf)
    middle = shapes.mean(axis=1)
    radius = np.hypot(*np.moveaxis(shapes - middle[:, None], -1, 0)).max(axis=1)
    near = KDTree(shapes.reshape(-1, 2)).query(xy)[0]  # no farther than the nearest corner
    distance = near.copy()
    for chunk in np.array_split(np.arange(len(xy)), len(xy) // 500 + 1):
        x, y = (xy[chunk, None, i] - middle[:, i] for i in (0, 1))
        row, shape = np.nonzero(x * x + y * y < (near[chunk, None] + radius) ** 2)  # the others are too far to matter
        np.minimum.at(distance, chunk[row], _distance_to(shapes[shape], xy[chunk[row]]))
    return distance


def generate_route(world: World, seed: int, length: float = 8.0, goal: tuple[float, ...] | None = None) -> Route:
    """A smooth route with 2 to 4 corners through a world; the same world and seed give the same bytes.

    length: of the route (m). Where the field is too small for it, the route is 0.8 of the field's diagonal long.
    The route stays 5 % of the field's shorter side (at most 0.3 m) inside the field, and 4 cm clear of everything that
    stands below 6 cm, except for what lies lower than 8 mm. Points are 1 cm apart, each heading towards the next.
    goal: where it ends (m), to within a decimetre; so routes with several seeds lead to one place.
    Raises InputError where the world has no room for it, or none at the goal.
    """
    check_length(length)
    rng, field = seeded(seed), world.field
    sides = np.array([field.x_max - field.x_min, field.y_max - field.y_min])
    length = min(float(length), 0.8 * float(np.hypot(*sides)))
    margin = min(0.3, 0.05 * float(sides.min()))
    if np.prod(sides / CELL + 2 * RIM) > MOST_CELLS:
        raise InputError(
            f"the field ({field}) is too large to look for a route in, {MOST_CELLS * CELL**2:,.0f} m2 at most; give a route"
        )
    inside = Bounds(field.x_min + margin, field.y_min + margin, field.x_max - margin, field.y_max - margin)
    if goal is not None:
        _check_goal(world, goal, inside)
    nodes, graph = _graph(_room(world, inside), inside)
    for _ in range(TRIES if len(nodes) else 0):
        corners = _zigzag(inside, length, rng, goal)  # from the goal, where there is one
        path = _walked(corners, nodes, graph) if corners is not None else None
        if path is None:
            continue
        for smoothing in (0.16, 0.11, 0.07, 0.045):
            route = _smoothed(path, smoothing, length)
            if route is not None and _is_good(route, inside) and clearance(world, route).min() >= KEEP_AWAY:
                return Route.through(route if goal is None else route[::-1])
    raise InputError(
        f"found no route of {length:.2f} m in the field ({field}) that keeps {100 * KEEP_AWAY:g} cm clear of plants; "
        "ask for a shorter one or for less vegetation"
    )


def check_length(length: float) -> None:
    """Refuse what is no length of a route (m). Raises InputError."""
    if not SHORTEST <= length < np.inf:
        raise InputError(f"a route of {length} m; give a length of at least {SHORTEST} m")


def check_route(world: World, route: Route) -> None:
    """Refuse a route that leaves the world. Raises InputError."""
    inside = world.field.contains(*route.xy.T)
    if not inside.all():
        x, y = route.xy[~inside][0]
        raise InputError(
            f"the route leaves the world ({world.field}) at ({x:g}, {y:g}) m; choose a route of this world"
        )


def _footprints(world: World) -> Float[np.ndarray, "n 6 2"]:
    """What of each triangle stands between the ground and body height, seen from above: convex, in order around.

    Walking around a triangle's edges, the part of each that lies between the heights gives two corners. At most one
    edge lies wholly outside; it repeats the corner before.
    """
    z = world.triangles[:, :, 2]
    start = world.triangles[(z.max(axis=1) >= STEP_HEIGHT) & (z.min(axis=1) <= BODY_HEIGHT)].astype(np.float64)
    step = np.roll(start, -1, axis=1) - start
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = (np.array([0.0, BODY_HEIGHT]) - start[:, :, 2:]) / step[:, :, 2:]  # shares of the edge; nan if level
    enter, leave = np.fmax(bounds.min(axis=2), 0.0), np.fmin(bounds.max(axis=2), 1.0)
    level = step[:, :, 2] == 0
    misses = np.where(level, (start[:, :, 2] < 0) | (start[:, :, 2] > BODY_HEIGHT), enter > leave)
    enter, leave = np.where(level, 0.0, enter), np.where(level, 1.0, leave)
    first = start[:, :, :2] + enter[:, :, None] * step[:, :, :2]
    last = start[:, :, :2] + leave[:, :, None] * step[:, :, :2]
    before = np.roll(last, 1, axis=1)
    first, last = (np.where(misses[:, :, None], before, corner) for corner in (first, last))
    return np.stack([first, last], axis=2).reshape(-1, 6, 2)


def _distance_to(shapes: Float[np.ndarray, "n 6 2"], xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Distance (m) of each point to the convex shape of the same row; 0 inside."""
    side, offset = np.roll(shapes, -1, axis=1) - shapes, xy[:, None] - shapes
    squared = (side**2).sum(axis=2)
    share = np.clip((side * offset).sum(axis=2) / np.where(squared > 0, squared, 1.0), 0, 1)
    distance = np.hypot(*np.moveaxis(offset - share[..., None] * side, -1, 0)).min(axis=1)
    turn = side[..., 0] * offset[..., 1] - side[..., 1] * offset[..., 0]  # twice the area of (corner, corner, point)
    within = ((turn >= 0).all(axis=1) | (turn <= 0).all(axis=1)) & (np.abs(turn.sum(axis=1)) > 1e-10)
    return np.where(within, 0.0, distance)


def _room(world: World, inside: Bounds) -> Float[np.ndarray, "rows columns"]:
    """Clearance (m) on a grid of cells from the lower left corner of `inside` (rows run along y), to about a cell."""
    size = np.ceil((np.array(inside[2:]) - np.array(inside[:2])) / CELL).astype(int) + 1 + 2 * RIM
    free = np.full((size[1], size[0]), 255, np.uint8)
    cells = (_footprints(world) - np.array(inside[:2])) / CELL + RIM
    near = np.logical_and(cells.max(axis=1) > 0, cells.min(axis=1) < size).all(axis=1)
    for shape in np.round(cells[near] * 16).astype(np.int32):
        cv2.fillConvexPoly(free, shape, 0, shift=4)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL
    return distance[RIM:-RIM, RIM:-RIM]


def _graph(room: Float[np.ndarray, "rows columns"], inside: Bounds) -> tuple[Float[np.ndarray, "n 2"], csr_array]:
    """Places (m) with room to stand, and what going from one to a near one costs: the way, more where it is tight."""
    rows, columns = np.mgrid[0 : room.shape[0] : NODE, 0 : room.shape[1] : NODE]
    number = np.where(room[::NODE, ::NODE] > KEEP_AWAY, np.arange(rows.size).reshape(rows.shape), -1)
    pad = np.pad(room, 2 * NODE)  # no room beyond the edge
    here, there, cost = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)):
        way = [pad[rows + 2 * NODE + down * s, columns + 2 * NODE + right * s] for s in range(NODE + 1)]
        narrowest = np.minimum.reduce(way)
        ok = narrowest > KEEP_AWAY
        here.append(number[ok])
        there.append(number[rows[ok] // NODE + down, columns[ok] // NODE + right])
        cost.append(NODE * CELL * np.hypot(down, right) * (1 + (PREFERRED / narrowest[ok]) ** 2))
    ends = (np.concatenate(cost), (np.concatenate(here), np.concatenate(there)))
    graph = csr_array(ends, shape=(rows.size, rows.size))
    stands = np.unique(np.concatenate(ends[1]))
    xy = np.column_stack([columns.ravel(), rows.ravel()]) * CELL + np.array(inside[:2])
    return xy[stands], graph[stands][:, stands]


def _check_goal(world: World, goal: tuple[float, ...], inside: Bounds) -> None:
    if len(goal) != 2:
        raise InputError(f"a goal at {goal!r}; give x and y (m)")
    x, y = goal
    if not (np.isfinite(goal).all() and inside.contains(x, y)):
        raise InputError(f"a goal at ({x:g}, {y:g}) m; choose one inside the field, off its edge ({inside})")
    room = float(clearance(world, np.array([goal]))[0])
    if room < PREFERRED:
        raise InputError(f"the goal ({x:g}, {y:g}) m has {room:.2f} m of room about it; choose one with {PREFERRED} m")


def _zigzag(
    inside: Bounds, length: float, rng: np.random.Generator, start: tuple[float, ...] | None = None
) -> Float[np.ndarray, "n 2"] | None:
    """Ends and corners of 3 to 5 straight legs, somewhat longer than `length`, or None if chance found none inside."""
    n, legs = 400, int(rng.integers(3, 6))
    turn = np.radians(rng.uniform(35, 110, (n, legs))) * rng.choice([-1, 1], (n, 1)) * (-1) ** np.arange(legs)
    turn *= np.where(rng.random((n, legs)) < 0.15, -1, 1)  # now and then it keeps turning the same way
    turn[:, 0] = rng.uniform(-np.pi, np.pi, n)
    direction, leg = turn.cumsum(axis=1), 1.06 * length * rng.dirichlet(np.full(legs, 8.0), n)
    first = rng.uniform(inside[:2], inside[2:], (n, 2)) if start is None else np.tile(start, (n, 1))
    steps = leg[..., None] * np.stack([np.cos(direction), np.sin(direction)], axis=2)
    corners = np.concatenate([first[:, None], first[:, None] + steps.cumsum(axis=1)], axis=1)
    fits = inside.contains(corners[..., 0], corners[..., 1]).all(axis=1)
    fits &= np.hypot(*(corners[:, -1] - corners[:, 0]).T) > 0.35 * length  # it leads somewhere
    return corners[fits.argmax()] if fits.any() else None


def _walked(corners: Float[np.ndarray, "n 2"], nodes, graph: csr_array) -> Float[np.ndarray, "k 2"] | None:
    """The cheapest path over the nodes past each corner, or None if there is no way."""
    stops = np.asarray(KDTree(nodes).query(corners)[1]).tolist()
    cost, before = dijkstra(graph, directed=False, indices=stops[:-1], return_predecessors=True)
    path = [stops[0]]
    for leg, stop in enumerate(stops[1:]):
        if not np.isfinite(cost[leg, stop]):
            return None
        back = [stop]
        while back[-1] != stops[leg]:
            back.append(before[leg, back[-1]])
        path += back[-2::-1]
    return nodes[path]


def _smoothed(path: Float[np.ndarray, "k 2"], smoothing: float, length: float) -> Float[np.ndarray, "n 2"] | None:
    """The path rounded off over about `smoothing` metres and cut to `length`, or None if it is shorter."""
    fine = gaussian_filter1d(_evenly(path, SPACING), smoothing / SPACING, axis=0, mode="nearest")
    route = _evenly(fine, SPACING)
    n = round(length / SPACING) + 1
    return route[:n] if len(route) >= n else None


def _evenly(path: Float[np.ndarray, "k 2"], spacing: float) -> Float[np.ndarray, "n 2"]:
    """Points along a polyline, `spacing` metres of arc apart, from its start."""
    arc = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T))]
    at = np.arange(0.0, arc[-1], spacing)
    return np.column_stack([np.interp(at, arc, path[:, i]) for i in (0, 1)])


def _is_good(route: Float[np.ndarray, "n 2"], inside: Bounds) -> bool:
    """Whether a route stays inside, has no sharp turn, and does not come back to where it was."""
    steps = np.diff(route, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    if not inside.contains(*route.T).all() or np.abs(heading[2:] - heading[:-2]).max() > SHARPEST:
        return False
    every, apart = route[::5], 5 * SPACING
    row, other = np.triu_indices(len(every), round(0.8 / apart))
    return bool((np.hypot(*(every[row] - every[other]).T) > 0.3).all())
