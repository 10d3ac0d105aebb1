"""Standing on a mesh: which of it is ground, how high that is, and what the eye sees there."""

import dataclasses
import itertools
import logging
import pickle

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scenes import FIELD, hills, mesh_world, post, random_world, surface, world_of

from tussock.navigation.content import content_of
from tussock.navigation.surroundings import Surroundings
from tussock.render.eye import Eye
from tussock.render.occlusion import covered_within
from tussock.render.renderer import open_renderer
from tussock.world import ground_check
from tussock.world.errors import InputError, SettingError
from tussock.world.files import read_world, write_world
from tussock.world.geometry import Bounds, Pose
from tussock.world.scene import Ground, World
from tussock.world.terrain import MIN_SHARE, STEP_HEIGHT, WELD_DIGITS, Terrain

EYE = Eye(width=180, height=40)
MIDDLE = np.array([[3.0, 3.0]])


def terrain_of(*parts, **settings) -> Terrain:
    return Terrain.of(np.concatenate(parts).astype(np.float32), **settings)


def all_ground(triangles: np.ndarray) -> Terrain:
    """A terrain in which every triangle is ground."""
    return Terrain(triangles, np.ones(len(triangles), dtype=bool), np.radians(45))


def slow_height(triangles: np.ndarray, xy: np.ndarray, slack: float) -> np.ndarray:
    """The highest triangle at each point, one by one, by the weights of its corners; they may be this much under 0."""
    highest = np.full(len(xy), -np.inf)
    for a, b, c in triangles.astype(float):
        sides = np.column_stack([b - a, c - a])
        size = np.abs(sides[:2]).max()
        if size == 0 or abs(np.linalg.det(sides[:2] / size)) < 1e-12:
            continue
        weights = np.linalg.solve(sides[:2], (xy - a[:2]).T)
        inside = (weights >= -slack).all(axis=0) & (weights.sum(axis=0) <= 1 + slack)
        height = a[2] + sides[2] @ weights
        highest = np.where(inside, np.maximum(highest, height), highest)
    return highest


# Heights


@given(st.integers(0, 10**6))
def test_heights_are_those_of_looking_at_every_triangle(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    size = 10.0 ** rng.uniform(-4, 1.5, (n, 1, 1))  # from less than the finest cell to all of the field
    triangles = (rng.uniform(-3, 3, (n, 1, 3)) + size * rng.normal(size=(n, 3, 3))).astype(np.float32)
    upright = rng.random(n) < 0.1
    triangles[upright, :, :2] = triangles[upright, :1, :2]
    spread = np.concatenate([rng.uniform(-4, 4, (60, 2)), triangles[:, :, :2].astype(float).mean(axis=1)])
    height = all_ground(triangles).height(spread)
    lowest, highest = (slow_height(triangles, spread, slack) for slack in (-1e-6, 1e-6))
    height = np.where(np.isnan(height), -np.inf, height)
    assert (height >= lowest - 1e-4).all()
    assert (height <= highest + 1e-4).all()


@given(st.integers(0, 10**6))
def test_heights_on_a_grid_are_those_at_its_points(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    size = 10.0 ** rng.uniform(-4, 1.5, (n, 1, 1))
    corners = rng.uniform(-3, 3, (n, 1, 3)) + size * rng.normal(size=(n, 3, 3))
    triangles = np.concatenate([corners, np.round(2 * corners) / 2]).astype(np.float32)  # some with corners on the grid
    terrain = all_ground(triangles)
    x, y = np.linspace(-4, 4, 17), np.linspace(-4, 4.5, 35)
    points = np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2)
    np.testing.assert_array_equal(terrain.height_on_grid(x, y).ravel(), terrain.height(points))


def test_the_highest_of_several_surfaces_counts():
    floors = [surface(lambda x, y, z=z: z + 0.1 * x, 1.0) for z in (0.0, -2.0, 1.5)]
    np.testing.assert_allclose(all_ground(np.concatenate(floors).astype(np.float32)).height(MIDDLE), [1.8], atol=1e-6)


def test_there_are_no_gaps_between_triangles():
    """At corners, on edges, and off them by the smallest step, of a surface whose corners are at odd places."""
    rng = np.random.default_rng(0)
    triangles = surface(lambda x, y: np.sin(9 * x + y), 0.3)
    corners, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    inside = ((corners[:, :2] > 0.1) & (corners[:, :2] < 5.9)).all(axis=1)
    corners[inside, :2] += rng.uniform(-0.1, 0.1, (inside.sum(), 2))
    triangles = corners[number].reshape(-1, 3, 3).astype(np.float32)
    share = rng.random((len(triangles), 1))
    xy = [triangles[:, k, :2] * share + triangles[:, (k + 1) % 3, :2] * (1 - share) for k in range(3)]
    xy = np.concatenate([*xy, triangles[..., :2].reshape(-1, 2)]).astype(np.float64)
    xy = np.concatenate([xy, np.nextafter(xy, -9), np.nextafter(xy, 9)]).clip(0, 6)
    assert np.isfinite(all_ground(triangles).height(xy)).all()


def test_off_the_ground_there_is_no_height():
    terrain = terrain_of(hills())
    assert np.isnan(terrain.height(np.array([[-0.01, 3.0], [3.0, 6.01], [1e7, -1e7]]))).all()
    assert np.isfinite(terrain.height(np.array([[0.0, 0.0], [6.0, 6.0]]))).all()
    assert terrain.height(np.empty((0, 2))).shape == (0,)


def test_a_terrain_has_the_same_bytes_before_and_after_it_is_used():
    world = mesh_world(hills()).on_mesh()
    before = content_of(world)
    world.ground_height(MIDDLE)
    assert content_of(world) == before != content_of(mesh_world(hills()))
    copy = pickle.loads(pickle.dumps(world))
    assert np.array_equal(copy.ground_height(MIDDLE), world.ground_height(MIDDLE))


# What is ground


def slow_pieces(triangles: np.ndarray) -> list[set[int]]:
    """Triangles that hang together by equal corners, by joining two pieces at a time."""
    corners = [{tuple(np.round(corner, WELD_DIGITS)) for corner in triangle} for triangle in triangles.astype(float)]
    pieces = [({number}, each) for number, each in enumerate(corners)]
    joined = True
    while joined:
        joined = False
        for one, other in itertools.combinations(pieces, 2):
            if one[1] & other[1]:
                pieces.remove(one)
                pieces.remove(other)
                pieces.append((one[0] | other[0], one[1] | other[1]))
                joined = True
                break
    return [members for members, _ in pieces]


@given(st.integers(0, 10**6))
def test_the_ground_is_what_the_docs_say(seed):
    """Of random triangles whose corners are on a grid, so that many are joined, flat, steep or upright."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 25))
    steps = np.array([1.0, 1.0, rng.choice([0.002, 0.3])])
    triangles = (rng.integers(0, 5, (n, 1, 3)) * steps + rng.integers(-1, 2, (n, 3, 3)) * steps).astype(np.float32)
    a, b, c = triangles.astype(float).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    up = normal[:, 2] / 2
    slope = np.arctan2(np.hypot(normal[:, 0], normal[:, 1]), np.abs(normal[:, 2]))
    walkable = (slope <= np.radians(45)) & (up != 0)
    steep = np.flatnonzero(~walkable)
    for piece in slow_pieces(triangles[steep]):
        members = steep[list(piece)]
        walkable[members] = np.ptp(triangles[members, :, 2].astype(float)) <= STEP_HEIGHT
    numbers = np.flatnonzero(walkable)
    pieces = [numbers[list(piece)] for piece in slow_pieces(triangles[numbers])]
    areas = [np.abs(up[piece]).sum() for piece in pieces]
    large = [piece for piece, area in zip(pieces, areas, strict=True) if area >= MIN_SHARE * max(areas) - 1e-9]
    upward = [piece for piece in large if up[piece].sum() >= 0] or large
    if not areas or max(areas) == 0:
        with pytest.raises(InputError, match="no surface to stand on"):
            Terrain.of(triangles)
        return
    assert np.flatnonzero(Terrain.of(triangles).is_ground).tolist() == sorted(np.concatenate(upward).tolist())


def test_an_agent_stands_under_posts_leaves_and_boulders_not_on_them():
    ground = hills()
    z = float(terrain_of(ground).height(MIDDLE)[0])
    leaf = np.array([[[2.8, 2.8, z + 0.05], [3.2, 2.8, z + 0.06], [3.0, 3.3, z + 0.05]]])
    boulder = trimesh.creation.icosphere(radius=0.4).apply_translation([3.0, 3.0, z]).triangles
    for thing in (post(3.0, 3.0, z, 0.8), leaf, boulder, post(3.0, 3.0, z - 0.1, 0.8, width=1.0)):
        terrain = terrain_of(ground, thing)
        np.testing.assert_allclose(terrain.height(MIDDLE), z, atol=1e-5)
        assert terrain.is_ground.sum() == len(ground)


def test_a_scan_in_one_piece_has_a_hole_where_a_post_grows_out_of_it():
    """Its top is not ground, though walls join it to the ground, also where they consist of many small triangles."""
    fused = surface(lambda x, y: 0.2 * np.sin(x) + 0.8 * ((abs(x - 3) < 0.25) & (abs(y - 3) < 0.25)), 0.1)
    terrain = terrain_of(fused)
    assert np.isnan(terrain.height(MIDDLE)).all()
    np.testing.assert_allclose(terrain.height(np.array([[2.0, 2.0]])), 0.2 * np.sin(2.0), atol=1e-3)
    assert terrain.is_steep(2.73, 3.0)  # where the wall is
    assert not terrain.is_steep(2.0, 2.0)
    wall = trimesh.remesh.subdivide_to_size(*trimesh.triangles.to_kwargs(post(3.0, 3.0, 0.0)).values(), 0.006)
    assert terrain_of(surface(lambda x, y: 0.0), wall[0][wall[1]]).height(MIDDLE) == 0


def test_what_is_stepped_over_does_not_part_the_ground():
    """A terrace on a low kerb is joined to the ground by it. On a high kerb it is too small to be ground."""
    for height, stands in ((0.007, True), (0.1, False)):
        terrace = surface(lambda x, y: 0.0, 1.0, 6.0, 7.0) + (0, 0, height)
        kerb = np.array([[(6, 6, 0), (6, 6, height), (6, 6.5, height)]])
        on_terrace = terrain_of(surface(lambda x, y: 0.0), terrace, kerb).height(MIDDLE + 3.5)
        np.testing.assert_allclose(on_terrace, height if stands else np.nan, atol=1e-6)


def test_rough_ground_has_no_holes():
    """It has slopes of over 45 degrees, but nothing in it is higher than a step."""
    rough = surface(lambda x, y: np.random.default_rng(0).uniform(0, STEP_HEIGHT, np.shape(x)), 0.006, 0.0, 0.3)
    assert terrain_of(rough, max_slope=np.radians(45)).is_ground.all()
    assert not terrain_of(2 * rough, max_slope=np.radians(45)).is_ground.all()


def test_the_limit_of_the_slope_is_the_one_asked_for():
    slope = surface(lambda x, y: np.tan(np.radians(40)) * x, 1.0)
    assert terrain_of(slope).is_ground.all()
    assert terrain_of(slope, max_slope=np.radians(41)).is_ground.all()
    with pytest.raises(InputError, match="slopes by less than 39 degrees"):
        terrain_of(slope, max_slope=np.radians(39))


def test_ceilings_and_undersides_are_not_ground_whatever_way_all_faces_are():
    floor, ceiling = surface(lambda x, y: 0.1, 0.5), surface(lambda x, y: 2.5, 0.5)[:, ::-1]
    np.testing.assert_allclose(terrain_of(floor, ceiling).height(MIDDLE), 0.1, atol=1e-6)
    block = trimesh.creation.box((6, 6, 1)).triangles + (3, 3, 7)
    np.testing.assert_allclose(terrain_of(block).height(MIDDLE), 7.5)
    np.testing.assert_allclose(terrain_of(floor[:, ::-1]).height(MIDDLE), 0.1, atol=1e-6)


def test_the_ground_of_a_generated_world_is_ground_at_0():
    world = World.generate("tiny", 1)
    standing = world.on_mesh()
    xy = np.random.default_rng(0).uniform(0, 3, (200, 2))
    assert (standing.ground_height(xy) == 0).all()
    assert (world.ground_height(xy) == 0).all()


def test_the_ground_around_the_field_does_not_make_hills_small():
    plain = Ground((9, 9, 9), Bounds(-30, -30, 36, 36))
    world = mesh_world(hills() + (0, 0, 1), ground=plain).on_mesh()
    assert world.ground_height(MIDDLE)[0] > 0.5


# What is seen


def test_a_mesh_that_is_flat_at_0_is_seen_as_the_flat_ground_is():
    plants = random_world(3, ground=False).triangles
    floor = surface(lambda x, y: 0.0, 0.5, -3.0, 3.0)
    rgb = np.random.default_rng(0).integers(0, 256, (len(plants) + len(floor), 3)).astype(np.uint8)
    rgb[len(plants) :] = (200, 180, 140)
    flat = dataclasses.replace(
        world_of(plants, rgb[: len(plants)]), ground=Ground((200, 180, 140), Bounds(-3, -3, 3, 3))
    )
    mesh = dataclasses.replace(world_of(np.concatenate([plants, floor]), rgb, ground=False), field=FIELD).on_mesh()
    poses = [(0.2, 0.3, 1.0), (-2.0, 1.5, -3.0), (1.0, -1.0, 0.0)]
    seen = []
    for world in (flat, mesh):
        with open_renderer(world, EYE, "cpu") as renderer:
            seen.append(renderer.render(poses))
    assert np.array_equal(*seen)


def test_a_mesh_that_is_moved_up_looks_the_same():
    posts = [post(x, y, -0.4, 1.0) for x, y in np.random.default_rng(1).uniform(0.5, 5.5, (20, 2))]
    poses = np.array([(2.0, 2.2, 1.0), (5.0, 4.1, -2.0), (1.0, 4.0, 3.0)])
    seen = []
    for up in (0.0, 42.0):
        world = mesh_world(*(part + (0, 0, up) for part in (hills(), *posts))).on_mesh()
        with open_renderer(world, EYE, "cpu") as renderer:
            seen.append(renderer.render(poses))
    assert (seen[0] != seen[1]).any(axis=-1).mean() < 0.001
    assert len(np.unique(seen[0].reshape(-1, 4), axis=0)) > 10
    assert (seen[0][..., 3] == 0).mean() > 0.2  # the sky: no eye is in a hill


def test_an_eye_off_the_ground_is_refused_with_the_place_and_the_reason():
    world = mesh_world(hills(), surface(lambda x, y: 3 * x, 1.0, 6.0, 8.0)).on_mesh()
    with open_renderer(world, EYE, "cpu") as renderer:
        with pytest.raises(SettingError, match=r"pose 1: the mesh has no ground at \(7.5, 1\) m; choose another"):
            renderer.render([(1.0, 1.0, 0.0), (7.5, 1.0, 0.0)])
        with pytest.raises(SettingError, match=r"steeper than 45 degrees at \(7.5, 7\) m"):
            renderer.render([(7.5, 7.0, 0.0)])


def test_the_ground_beneath_the_eye_does_not_occlude():
    pose = Pose(3.0, 3.0, 0.0)
    world = mesh_world(hills()).on_mesh()
    assert covered_within(world, EYE, [pose], 0.05) == 0
    x, y, z = 3.0, 3.03, float(world.ground_height(MIDDLE)[0])
    assert covered_within(mesh_world(hills(), post(x, y, z - 0.1, width=0.04)).on_mesh(), EYE, [pose], 0.05) > 0.2


# Remarks


@pytest.fixture
def remarks(caplog):
    """What is remarked where a world is opened."""
    ground_check._looked_at.clear()

    def opened(world, **settings) -> str:
        caplog.clear()
        with caplog.at_level(logging.WARNING, "tussock"):
            Surroundings(world=world, **settings).open_world()
        return caplog.text

    return opened


def saved(path, *parts) -> str:
    """A file of triangles as others write it."""
    triangles = np.concatenate(parts)
    trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)).export(path)
    return str(path)


@pytest.mark.parametrize(("up", "span"), [(0.0, "-0.30 to 0.30"), (42.0, "41.70 to 42.30"), (-7.0, "-7.30 to -6.70")])
def test_a_world_with_a_ground_of_its_own_is_remarked_upon_once(tmp_path, remarks, up, span):
    name = saved(tmp_path / "hills.obj", hills() + (0, 0, up), post(3, 3, up))
    assert "mesh" not in remarks(name, ground="mesh")
    said = remarks(name)
    assert said.count("hills.obj: its ground runs") == 1
    assert f"z = {span} m" in said
    assert "--ground mesh" in said
    assert remarks(name) == ""


def test_plants_far_from_0_are_remarked_upon(tmp_path, remarks):
    plants = random_world(1, ground=False).triangles
    assert "surfaces run from z = 4" in remarks(saved(tmp_path / "a.stl", plants + np.float32([0, 0, 42])))
    assert remarks(saved(tmp_path / "b.stl", plants[plants[..., 2].min(axis=1) > 0])) == ""


def test_flat_worlds_are_not_remarked_upon(tmp_path, remarks, request):
    plants = World.generate("tiny", 1).triangles
    noise = surface(lambda x, y: np.random.default_rng(0).normal(0, 0.003, np.shape(x)), 0.1, -1.0, 4.0)
    assert remarks(saved(tmp_path / "floor.ply", plants, noise)) == ""
    for preset in ("tiny", "scrub"):
        write_world(World.generate(preset, 1), tmp_path / "w.glb")
        assert remarks(str(tmp_path / "w.glb")) == ""
        ground_check._looked_at.clear()
    assert remarks("tiny") == ""
    assert remarks(World.generate("tiny", 1)) == ""


def test_the_sussex_world_is_not_remarked_upon(remarks, sussex):
    assert remarks(str(sussex / "world5000_gray.bin")) == ""


def test_how_a_world_is_stood_on_is_not_kept_in_its_file(tmp_path):
    world = mesh_world(hills()).on_mesh()
    for suffix in ("glb", "ply"):
        write_world(world, tmp_path / f"w.{suffix}")
        assert read_world(tmp_path / f"w.{suffix}").terrain is None
        again = Surroundings(world=tmp_path / f"w.{suffix}", ground="mesh").open_world()
        assert np.array_equal(again.ground_height(MIDDLE), world.ground_height(MIDDLE))
