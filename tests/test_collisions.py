"""Bodies and obstacles: laws of a step, against the clearance along it and against walking in tiny steps."""

import dataclasses
import functools
import itertools

import numpy as np
import pytest
from quick_cases import quick
from scenes import mesh_world, post, surface, world_of

from tussock.world.collisions import MARGIN, Contact, slid, stopped
from tussock.world.geometry import Bounds
from tussock.world.obstacles import clearance, footprints
from tussock.world.scene import World

MOVES = pytest.mark.parametrize("move", [stopped, slid])
RADII = (0.0, 0.005, 0.02)
WORLDS = ("tiny", "tussock-field", "triangles", "courtyard")
ROUNDING = 2e-9  # m


def wall(start, end) -> np.ndarray:
    """Two upright triangles: from above a line, without area."""
    (a, b), (c, d) = start, end
    return np.array([[(a, b, 0), (c, d, 0), (c, d, 0.3)], [(a, b, 0), (c, d, 0.3), (a, b, 0.3)]])


def walls(*points) -> np.ndarray:
    """Upright triangles along a line through some points."""
    return np.concatenate([wall(*each) for each in itertools.pairwise(points)])


def bare(*parts) -> World:
    triangles = np.concatenate(parts) if parts else np.zeros((0, 3, 3))
    return world_of(triangles, np.zeros((len(triangles), 3)))


def slab(x: float, y: float, width: float) -> np.ndarray:
    """A square that is low enough to count as an obstacle: it has an area, in two triangles."""
    a, b, c, d = [(x + i * width / 2, y + j * width / 2, 0.02) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return np.array([[a, b, c], [a, c, d]])


@functools.cache
def world_named(name: str) -> World:
    rng = np.random.default_rng(3)
    if name == "triangles":  # of all sizes, some upright, some without area or with equal corners
        triangles = rng.uniform((0, 0, -0.01), (3, 3, 0.1), (250, 1, 3)) + 10 ** rng.uniform(
            -3, -0.5, (250, 1, 1)
        ) * rng.normal(size=(250, 3, 3))
        triangles[:60, 2, :2] = triangles[:60, 0, :2]
        triangles[60:70, 2] = triangles[60:70, 1]
        triangles[70:80] = triangles[70:80, :1] * [1, 1, 0] + [0, 0, 0.03]
        return bare(triangles)
    if name == "courtyard":
        posts = [post(x, y, 0.0, width=0.06) for x, y in rng.uniform(0.2, 2.8, (60, 2)).tolist()]
        return bare(walls((0, 0), (3, 0), (3, 3), (0, 3), (0, 0)), walls((1, 1), (2, 1.2), (1.5, 2)), *posts)
    return World.generate(name, 1)


def steps_in(world: World, n: int, length: float, *, room: float = 0.0, seed: int = 0):
    """Starts with more room than some metres, half of them close to an obstacle, and ends of steps."""
    rng, low, high = np.random.default_rng(seed), 0.0, 3.0
    shapes = footprints(world)
    inside = shapes[((shapes > low) & (shapes < high)).all(axis=(1, 2))]
    close = inside[rng.integers(0, len(inside), 40 * n), 0] + rng.normal(scale=0.03 + room, size=(40 * n, 2))
    starts = np.concatenate([rng.uniform(low, high, (4 * n, 2)), close])
    starts = starts[(clearance(world, starts) >= room) & ((starts > low) & (starts < high)).all(axis=1)]
    starts = np.concatenate([starts[: n // 2], starts[len(starts) - (n - n // 2) :]])
    angle = rng.uniform(-np.pi, np.pi, n)
    return starts, starts + length * np.column_stack([np.cos(angle), np.sin(angle)])


def assert_equal(one: Contact, other: Contact, atol: float = 0.0) -> None:
    np.testing.assert_array_equal(one.touched, other.touched)
    np.testing.assert_allclose(one.positions, other.positions, rtol=0, atol=atol)
    np.testing.assert_allclose(one.normals, other.normals, rtol=0, atol=max(atol, 0) * 100)


def by_tiny_steps(world: World, start, end, radius: float, n: int = 300):
    """Slide in `n` tiny steps, knowing nothing but clearances: an independent computation."""
    xy, velocity, h = start.copy(), (end - start) / n, 1e-8
    for _ in range(n):
        before, after = clearance(world, xy), clearance(world, xy + velocity)
        blocked = (after < radius) & (after < before)
        xy[~blocked] += velocity[~blocked]
        if not blocked.any():
            continue
        low, part = np.zeros((blocked.sum(), 1)), velocity[blocked]
        for half in 0.5 ** np.arange(1, 12):  # how much of this tiny step can be made
            low = np.where((clearance(world, xy[blocked] + (low + half) * part) >= radius)[:, None], low + half, low)
        xy[blocked] += low * part
        deeper = xy[blocked] + 1e-6 * part / np.hypot(*part.T)[:, None]  # there, what blocks it is the nearest
        around = deeper[:, None] + h * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        east, west, north, south = clearance(world, around.reshape(-1, 2)).reshape(-1, 4).T
        normal = np.column_stack([east - west, north - south])
        normal /= np.hypot(*normal.T)[:, None]
        rest = part - np.minimum((part * normal).sum(axis=1), 0)[:, None] * normal
        velocity[blocked] = np.where(((rest * (end - start)[blocked]).sum(axis=1) > 0)[:, None], rest, 0)
    return xy


# Stopping: a body gets to the first point of its step where its clearance is its radius


@pytest.mark.parametrize("length", [0.05, 1.0])
@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("name", quick(WORLDS, "tiny", "triangles", "courtyard"))
def test_a_step_ends_at_its_first_contact(name, radius, length):
    world = world_named(name)
    start, end = steps_in(world, 60, length, room=radius + 2 * MARGIN)
    contact = stopped(world, start, end, radius)
    assert contact.touched.sum() > 0
    np.testing.assert_array_equal(contact.positions[~contact.touched], end[~contact.touched])

    share = np.linspace(0, 1, 401)[:, None, None]
    way = (start + share * (contact.positions - start)).reshape(-1, 2)
    assert clearance(world, way).min() >= radius
    hit = contact.touched
    np.testing.assert_allclose(clearance(world, contact.positions[hit]), radius + MARGIN, rtol=0, atol=ROUNDING)
    along = (contact.positions - start)[hit]
    np.testing.assert_allclose(along[:, 0] * (end - start)[hit, 1], along[:, 1] * (end - start)[hit, 0], atol=1e-12)


@pytest.mark.parametrize("radius", RADII[1:])
@pytest.mark.parametrize("name", WORLDS)
def test_the_normal_is_the_way_in_which_the_clearance_grows(name, radius):
    world = world_named(name)
    start, end = steps_in(world, 60, 0.05, room=radius + 2 * MARGIN, seed=1)
    contact = stopped(world, start, end, radius)
    hit, normal = contact.touched, contact.normals[contact.touched]
    assert np.isnan(contact.normals[~hit]).all()
    np.testing.assert_allclose(np.hypot(*normal.T), 1.0)
    towards = clearance(world, contact.positions[hit] - (radius + 2 * MARGIN) * normal)
    np.testing.assert_allclose(towards, 0.0, atol=2 * MARGIN)
    assert ((end - start)[hit] * normal).sum(axis=1).max() < 0


@MOVES
@pytest.mark.parametrize("name", ["tussock-field", "triangles"])
def test_a_body_among_stems_never_gets_closer_to_any(name, move):
    """Also where it begins inside a footprint: there its clearance is 0."""
    world = world_named(name)
    start, end = steps_in(world, 200, 0.05, seed=2)
    before = clearance(world, start)
    assert (before < 0.02).sum() > 10
    contact = move(world, start, end, 0.02)
    assert (clearance(world, contact.positions) >= np.minimum(before, 0.02) - ROUNDING).all()


@MOVES
def test_a_body_walks_out_of_what_it_is_in_but_not_further_in(move):
    """A slab from -0.1 to 0.1 m; its two triangles meet in the diagonal."""
    world = world_of([[(-0.1, -0.1, 0.02), (0.1, -0.1, 0.02), (0.1, 0.1, 0.02)]], np.zeros((1, 3)))
    start = np.tile([0.02, -0.09], (4, 1))  # the nearest edge is the lower one
    end = start + [[0.0, -0.05], [0.0, 0.05], [0.04, -0.01], [0.05, 0.0]]
    contact = move(world, start, end, 0.01)
    assert contact.touched.tolist() == [False, True, False, False]
    np.testing.assert_array_equal(contact.positions[[0, 2, 3]], end[[0, 2, 3]])
    np.testing.assert_allclose(contact.positions[1], start[1], atol=1e-9)
    np.testing.assert_allclose(contact.normals[1], [0, -1], atol=1e-9)


@MOVES
def test_from_the_middle_of_a_footprint_every_way_leads_out(move):
    world = world_of([[(0, 0, 0.02), (3 / 64, 0, 0.02), (0, 4 / 64, 0.02)]], np.zeros((1, 3)))
    angle = np.linspace(-3, 3, 40)
    start = np.full((40, 2), 1 / 64)  # as far from each edge
    end = start + 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert not move(world, start, end, 0.01).touched.any()


def test_from_a_blade_of_grass_a_body_goes_to_either_side_and_through_no_other():
    world = bare(wall((0, -1), (0, 1)), wall((0.03, -1), (0.03, 1)))
    start = np.zeros((2, 2))
    contact = stopped(world, start, np.array([[-0.5, 0.0], [0.5, 0.0]]), 0.01)
    assert contact.touched.tolist() == [False, True]
    np.testing.assert_allclose(contact.positions, [[-0.5, 0], [0.03, 0]], atol=2 * MARGIN)


def test_a_body_too_close_to_two_walls_walks_out_between_them():
    world = bare(wall((0, 0.005), (1, 0.005)), wall((0, -0.005), (1, -0.005)))
    contact = stopped(world, np.array([[0.95, 0.001]]), np.array([[1.05, 0.001]]), 0.01)
    np.testing.assert_array_equal(contact.positions, [[1.05, 0.001]])


# Sliding


@pytest.mark.parametrize("radius", [0.005, 0.02])
@pytest.mark.parametrize("name", ["tiny", "courtyard"])
def test_sliding_is_what_tiny_steps_do(name, radius):
    world = world_named(name)
    start, end = steps_in(world, 300, 0.05, room=radius + 2 * MARGIN, seed=4)
    contact = slid(world, start, end, radius)
    hit = np.flatnonzero(contact.touched)[:20]
    assert len(hit) > 15
    tiny = by_tiny_steps(world, start[hit], end[hit], radius + MARGIN)
    np.testing.assert_allclose(contact.positions[hit], tiny, rtol=0, atol=2e-4)


@pytest.mark.parametrize("length", [0.05, 1.0])
@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("name", WORLDS)
def test_sliding_keeps_clear_gains_no_distance_and_never_turns_back(name, radius, length):
    world = world_named(name)
    start, end = steps_in(world, 100, length, room=radius + 2 * MARGIN, seed=5)
    stop, slide = stopped(world, start, end, radius), slid(world, start, end, radius)
    np.testing.assert_array_equal(stop.touched, slide.touched)
    np.testing.assert_array_equal(stop.normals, slide.normals)
    assert (clearance(world, slide.positions) >= radius).all()
    assert (np.hypot(*(slide.positions - start).T) <= length + 1e-12).all()
    first = np.hypot(*(stop.positions - start).T)
    assert (first + np.hypot(*(slide.positions - stop.positions).T) <= length + 1e-12).all()
    assert (((slide.positions - stop.positions) * (end - start)).sum(axis=1) >= -1e-12).all()
    assert not np.array_equal(stop.positions, slide.positions)


@pytest.mark.parametrize("radius", RADII)
def test_along_a_wall_the_rest_of_the_step_is_projected_on_it(radius):
    world = bare(wall((1, -2), (1, 2)))
    start, end = np.array([[0.9, 0.0], [0.9, 0.0], [1.1, 0.0]]), np.array([[1.3, 0.3], [1.3, -0.3], [0.7, 0.3]])
    contact = slid(world, start, end, radius)
    x = radius + MARGIN
    np.testing.assert_allclose(contact.positions, [[1 - x, 0.3], [1 - x, -0.3], [1 + x, 0.3]], atol=1e-9)
    np.testing.assert_allclose(contact.normals, [[-1, 0], [-1, 0], [1, 0]], atol=1e-9)


@pytest.mark.parametrize("radius", RADII[1:])
@pytest.mark.parametrize("target", [wall((1, -2), (1, 2)), post(1.04, 0.0, 0.0), slab(1.04, 0.0, 0.08)])
def test_a_head_on_step_slides_nowhere(radius, target):
    start, end = np.array([[0.9, 0.0]]), np.array([[1.3, 0.0]])
    contact = slid(bare(target), start, end, radius)
    np.testing.assert_allclose(contact.positions, [[1 - radius - MARGIN, 0.0]], rtol=0, atol=1e-6)


@pytest.mark.parametrize("angle", [20, 60, 89, 100, 120, 170])
def test_a_body_stops_in_a_sharp_corner_and_follows_a_wide_one(angle):
    """A wall along x, and from its end another one at an angle, inside of which the body walks along the first."""
    turn = np.radians(180 - angle)
    world = bare(walls((0, 0), (1, 0), (1 + np.cos(turn), np.sin(turn))))
    start, end = np.array([[0.6, 0.03]]), np.array([[1.5, 0.0]])
    contact = slid(world, start, end, 0.02)
    size = 0.02 + MARGIN
    corner = np.array([1 - size / np.tan(np.radians(angle) / 2), size])  # where the body touches both
    if angle < 90:
        np.testing.assert_allclose(contact.positions[0], corner, rtol=0, atol=1e-6)
    else:
        beyond = contact.positions[0] - corner
        assert beyond @ [np.cos(turn), np.sin(turn)] > 0.01
        np.testing.assert_allclose(beyond @ [-np.sin(turn), np.cos(turn)], 0.0, atol=1e-6)


@MOVES
@pytest.mark.parametrize(("gap", "passes"), [(0.0399, False), (0.0401, True)])
def test_a_gap_lets_a_body_through_if_it_is_wider(gap, passes, move):
    world = bare(wall((1, gap / 2), (1, 2)), wall((1, -2), (1, -gap / 2)))
    angle = np.linspace(-0.3, 0.3, 41)
    start = np.zeros((41, 2))
    start[:, 0] = 0.9
    end = start + 0.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    through = move(world, start, end, 0.02).positions[:, 0] > 1.0
    assert through[20] == passes
    assert passes or not through.any()


@MOVES
@pytest.mark.parametrize("radius", RADII)
def test_no_body_leaves_a_room_however_long_its_steps(radius, move):
    """20 steps each, of 1 mm to 100 m; in the corners, walls share only an edge."""
    corners = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 8)]
    world = bare(walls(*corners))
    rng = np.random.default_rng(0)
    xy = rng.uniform(-0.3, 0.3, (50, 2))
    for _ in range(20):
        angle, length = rng.uniform(-np.pi, np.pi, 50), 10 ** rng.uniform(-3, 2, 50)
        xy = np.round(
            move(world, xy, xy + length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), radius).positions, 9
        )
        assert (clearance(world, xy) >= radius).all()
        assert (np.hypot(*xy.T) < 1.0).all()


def test_a_body_keeps_clear_of_a_wall_that_it_follows_for_long():
    """Positions are rounded to nanometres after each step, as a walk does."""
    world = bare(wall((-200, 0), (200, 60)))
    xy = np.array([[0.0, 0.1]])
    for _ in range(500):
        xy = np.round(slid(world, xy, xy + [0.05, -0.05], 0.01).positions, 9)
    assert clearance(world, xy)[0] >= 0.01
    assert xy[0, 0] > 5


# Symmetries


@MOVES
@pytest.mark.parametrize("name", ["tiny", "tussock-field", "courtyard"])
def test_a_mirrored_world_mirrors_the_outcome(name, move):
    world = world_named(name)
    flip = np.array([1, -1, 1], dtype=np.float32)
    x0, y0, x1, y1 = world.field
    mirrored = dataclasses.replace(world, triangles=world.triangles * flip, field=Bounds(x0, -y1, x1, -y0))
    start, end = steps_in(world, 150, 0.08, seed=6)
    one, other = move(world, start, end, 0.01), move(mirrored, start * flip[:2], end * flip[:2], 0.01)
    back = Contact(other.positions * flip[:2], other.touched, other.normals * flip[:2])
    assert_equal(one, back, atol=1e-9)


@MOVES
@pytest.mark.parametrize("name", ["tiny", "tussock-field", "courtyard"])
def test_a_rotated_world_rotates_the_outcome(name, move):
    """By a quarter, which no rounding of corners changes."""
    world = world_named(name)
    quarter = np.array([[0, 1], [-1, 0]])
    turned = world.triangles.copy()
    turned[..., :2] = world.triangles[..., :2] @ quarter
    field = Bounds(-world.field.y_max, world.field.x_min, -world.field.y_min, world.field.x_max)
    start, end = steps_in(world, 150, 0.08, seed=7)
    one = move(world, start, end, 0.01)
    other = move(dataclasses.replace(world, triangles=turned, field=field), start @ quarter, end @ quarter, 0.01)
    assert_equal(Contact(one.positions @ quarter, one.touched, one.normals @ quarter), other, atol=1e-9)


@MOVES
def test_a_world_rotated_by_any_angle_rotates_the_outcome(move):
    angle = 0.7
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    parts = [walls((1, 1), (2, 1.2), (1.5, 2)), wall((0.2, 2.5), (2.7, 2.5))]
    world, turned = bare(*parts), bare(*(np.concatenate([p[..., :2] @ rotation, p[..., 2:]], axis=2) for p in parts))
    start, end = steps_in(world, 300, 0.3, room=0.02, seed=8)
    one, other = move(world, start, end, 0.01), move(turned, start @ rotation, end @ rotation, 0.01)
    np.testing.assert_allclose(one.positions @ rotation, other.positions, rtol=0, atol=1e-5)


@MOVES
def test_a_batch_is_what_its_bodies_do_alone(move):
    world = world_named("tussock-field")
    start, end = steps_in(world, 36, 0.08, seed=9)
    radius = np.tile(RADII, 12)
    together = move(world, start, end, radius)
    for k in range(36):
        alone = move(world, start[k : k + 1], end[k : k + 1], float(radius[k]))
        row = Contact(*(each[k : k + 1] for each in dataclasses.astuple(together)))
        assert_equal(alone, row)


# Worlds


@MOVES
def test_nothing_hinders_without_obstacles_and_without_steps(move):
    lying = np.array([[(0, 0, 0.001), (1, 0, 0.001), (0, 1, 0.001)], [(0, 0, 0.5), (1, 0, 0.5), (0, 1, 0.5)]])
    xy = np.array([[0.1, 0.1], [0.2, 0.2]])
    for world in (bare(), bare(lying)):
        contact = move(world, xy, xy + 0.1, 0.01)
        np.testing.assert_array_equal(contact.positions, xy + 0.1)
        assert not contact.touched.any()
    still = move(bare(wall((0, 0.105), (1, 0.105))), xy, xy, 0.01)
    assert not still.touched.any()
    np.testing.assert_array_equal(still.positions, xy)
    assert len(move(bare(lying), xy[:0], xy[:0], 0.01).positions) == 0


@MOVES
def test_obstacles_stand_on_the_ground_of_a_mesh(move):
    """On a slope, bodies stop at the same posts; one that the ground buries lets them pass."""
    flat = mesh_world(surface(lambda x, y: 0.0, 0.5), post(3.0, 3.0, 0.0), post(2.0, 2.0, -1.0))
    tilt = (flat.triangles + flat.triangles[..., :1] * [0, 0, 0.5]).astype(np.float32)
    angle = np.linspace(-3, 3, 50)
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    for middle, hits in ((3.0, True), (2.0, False)):
        start, end = middle - 0.2 * way, middle + 0.2 * way
        level = move(flat.on_mesh(), start, end, 0.01)
        slope = move(dataclasses.replace(flat, triangles=tilt).on_mesh(), start, end, 0.01)
        assert (level.touched == hits).all()
        np.testing.assert_array_equal(level.touched, slope.touched)
        np.testing.assert_allclose(level.positions, slope.positions, atol=1e-5)
