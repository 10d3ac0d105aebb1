"""The CPU renderer against Embree (an independent ray caster), against images of another program, and against its own laws."""

import dataclasses
import json

import cv2
import numpy as np
import pytest
import trimesh
from quick_cases import quick
from renderer_laws import batches_and_threads_do_not_matter, low_resolution_is_the_mean_over_each_pixels_solid_angle
from scenes import (
    full_poses,
    hills,
    mesh_world,
    post,
    random_poses,
    random_texture,
    random_world,
    textured_world,
    world_of,
)
from scipy.spatial.transform import Rotation

from tussock.render import culling_kernels
from tussock.render.culling_kernels import View, find_candidates
from tussock.render.eye import Eye
from tussock.render.poses import poses_of_eye
from tussock.render.renderer import open_renderer
from tussock.render.scanline import ScanlineRenderer
from tussock.render.triangle_tree import TriangleTree
from tussock.world.errors import InputError
from tussock.world.files import read_world
from tussock.world.geometry import column_azimuths
from tussock.world.scene import World


def embree(world: World, eye: Eye, pose) -> np.ndarray:
    """A view (height, width, 4) by casting the eye's rays with Embree; one ray a pixel."""
    triangles, rgb = world.surfaces()
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)
    x, y, heading, z, pitch, roll = poses_of_eye(world, eye, [pose])[0]
    azimuth, elevation = column_azimuths(eye.width), eye.elevations()[:, None]
    towards = np.broadcast_arrays(
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    )
    # Turned about the axes of the world, in the opposite order: roll about x, pitch about y, heading about z.
    turns = Rotation.from_euler("xyz", [roll, -pitch, heading])
    towards = turns.apply(np.stack(towards, axis=-1).reshape(-1, 3))
    hit = mesh.ray.intersects_first(np.broadcast_to([x, y, z], towards.shape), towards)
    hit = hit.reshape(eye.height, eye.width)
    view = np.concatenate([rgb, np.full((len(rgb), 1), 255, np.uint8)], axis=1)[hit]
    view[hit < 0] = [*world.sky_rgb, 0]
    return view


def share_different(a: np.ndarray, b: np.ndarray) -> float:
    return float((a != b).any(axis=-1).mean())


@pytest.mark.parametrize(
    "preset",
    quick(
        [
            "tussock-field",
            "meadow",
            "scrub",
            "hay-meadow",
            "woodland",
            "tiny",
            "desert",
            "arena",
            "tiny hill_height=0.5",
        ],
        "tussock-field",
        "meadow",
        "scrub",
        "tiny",
        "arena",
        "tiny hill_height=0.5",
    ),
)
def test_equals_embree_in_generated_worlds(preset):
    world = World.generate(preset, seed=3)
    rng = np.random.default_rng(0)
    x0, y0, x1, y1 = world.field
    poses = np.column_stack([rng.uniform(x0, x1, 3), rng.uniform(y0, y1, 3), rng.uniform(-3, 3, 3)])
    with open_renderer(world, backend="cpu") as renderer:
        for pose, view in zip(poses, renderer.render(poses), strict=True):
            assert share_different(view, embree(world, renderer.eye, pose)) < 0.001


def test_equals_embree_in_the_sussex_world(sussex):
    world = read_world(sussex / "world5000_gray.bin")
    poses = random_poses(4) + [5, 5, 0]
    with open_renderer(world, backend="cpu") as renderer:
        for pose, view in zip(poses, renderer.render(poses), strict=True):
            assert share_different(view, embree(world, renderer.eye, pose)) < 0.001


@pytest.mark.parametrize("span", [(90, -90), (60, -15), (5, -80)])
def test_equals_embree_among_triangles_above_below_and_around_the_eye(span):
    world = random_world(seed=5, n=400)
    top, bottom = np.radians(span)
    eye = Eye(width=360, height=120, top=top, bottom=bottom, z=0.1)
    with open_renderer(world, eye, "cpu") as renderer:
        for pose in random_poses(5):
            assert share_different(renderer.render([pose])[0], embree(world, eye, pose)) < 0.001


@pytest.mark.parametrize(
    "name", quick(["tussock-field", "woodland", "random", "hills"], "tussock-field", "random", "hills")
)
def test_pitched_and_rolled_eyes_equal_embree(name):
    if name == "hills":
        world = mesh_world(hills(), *(post(x, x / 2, 0.2) for x in np.arange(0.5, 6, 0.5))).on_mesh()
    else:
        world = random_world(seed=5, n=400) if name == "random" else World.generate(name, seed=3)
    with open_renderer(world, Eye(width=360, height=120, top=1.2, bottom=-0.9), "cpu") as renderer:
        poses = full_poses(world.field, 8)
        for pose, view in zip(poses, renderer.render(poses), strict=True):
            assert share_different(view, embree(world, renderer.eye, pose)) < 0.001


def test_a_level_eye_has_the_same_bytes_among_tilted_ones():
    world = random_world()
    poses = full_poses(world.field, 9)
    poses[::3, 4:] = 0
    with open_renderer(world, Eye(width=120, height=40, samples=1), "cpu") as renderer:
        views = renderer.render(poses)
        assert all(
            np.array_equal(view, renderer.render(pose[None])[0]) for view, pose in zip(views, poses, strict=True)
        )
        planar = renderer.render(random_poses(4))
        level = np.column_stack([random_poses(4), np.full(4, renderer.eye.z), np.zeros((4, 2))])
        assert np.array_equal(renderer.render(level), planar)


def test_an_eye_rolled_on_its_side_sees_up_at_its_left(renderer):
    """A quarter turn of roll takes the right side down: what was above is at the left, what was below at the right."""
    world = world_of([[(-9, -9, 2), (9, -9, 2), (0, 30, 2)]], [[9, 9, 9]], ground=False)
    eye = Eye(width=90, height=20, top=0.3, bottom=-0.3)
    with open_renderer(world, eye, "cpu") as opened:
        view = opened.render([(0.0, 0.0, 0.7, 0.5, 0.0, np.pi / 2)])[0, ..., 3]
        assert (view[:, 20:25] == 255).all()  # 90 degrees to the left
        assert not view[:, 45:].any()
        view = opened.render([(0.0, 0.0, 0.7, 0.5, np.pi / 2, 0.0)])[0, ..., 3]  # its nose up
        assert (view[:, 43:47] == 255).all()


def test_pitched_views_of_a_textured_world_turn_with_the_world():
    """To tilt the eye is to tilt the world the other way, textures and holes included."""
    world = textured_world([random_texture(1), random_texture(2, alpha="mask")], ground=False)
    eye = Eye(width=120, height=40, top=1.0, bottom=-1.0, samples=1)
    for pose in full_poses(world.field, 4):
        turned = (
            Rotation.from_euler("xyz", [pose[5], -pose[4], pose[2]])
            .inv()
            .apply(world.triangles.reshape(-1, 3) - pose[[0, 1, 3]])
        )
        other = dataclasses.replace(world, triangles=turned.reshape(-1, 3, 3).astype(np.float32))
        with open_renderer(world, eye, "cpu") as ours, open_renderer(other, eye, "cpu") as theirs:
            still = theirs.render([(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)])[0]
            assert share_different(ours.render([pose])[0], still) < 0.002


def test_agrees_with_images_of_another_program(sussex):
    world = read_world(sussex / "world5000_gray.bin")
    world = dataclasses.replace(world, double_sided=False)
    for known in json.loads((sussex / "frames" / "poses.json").read_text())["views"]:
        expected = cv2.imread(str(sussex / "frames" / known["file"]))[..., ::-1].astype(int)
        with open_renderer(world, Eye(z=known["z_m"]), "cpu") as renderer:
            view = renderer.render([(known["x_m"], known["y_m"], np.radians(known["heading_deg"]))])[0, ..., :3]
        assert np.abs(view - expected).mean() < 2.6


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(random_world(), Eye(width=120, height=40, samples=1, z=0.05), "cpu") as opened:
        yield opened


def test_turning_left_rolls_the_view_right(renderer):
    for pose in random_poses(5):
        view = renderer.render([pose])[0]
        for columns in (1, 17, 60, 119):
            turned = renderer.render([pose + [0, 0, columns * 2 * np.pi / 120]])[0]
            assert share_different(turned, np.roll(view, columns, axis=1)) < 0.002


def test_a_view_does_not_change_when_world_and_pose_move_together(renderer):
    world, angle, shift = renderer.world, 0.7, np.array([0.5, -0.25, 0])
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    triangles = (world.triangles @ rotation.T + shift).astype(np.float32)
    moved, still = (dataclasses.replace(world, triangles=each, ground=None) for each in (triangles, world.triangles))
    with open_renderer(moved, renderer.eye, "cpu") as of_moved, open_renderer(still, renderer.eye, "cpu") as of_still:
        for x, y, heading in random_poses(5):
            moved_pose = (*(rotation @ [x, y, 0] + shift)[:2], heading + angle)
            assert share_different(of_moved.render([moved_pose])[0], of_still.render([(x, y, heading)])[0]) < 0.002


def test_a_mirrored_world_mirrors_the_view(renderer):
    mirrored = dataclasses.replace(renderer.world, triangles=renderer.world.triangles * np.float32([1, -1, 1]))
    with open_renderer(mirrored, renderer.eye, "cpu") as other:
        for x, y, heading in random_poses(5):
            view, mirror = renderer.render([(x, y, heading)])[0], other.render([(x, -y, -heading)])[0]
            assert share_different(view, mirror[:, ::-1]) < 0.002


def test_a_batch_equals_its_views_one_by_one_and_threads_do_not_matter(renderer):
    batches_and_threads_do_not_matter(renderer)


def test_low_resolution_is_the_mean_over_each_pixels_solid_angle():
    low_resolution_is_the_mean_over_each_pixels_solid_angle(random_world())


def test_culling_shows_a_triangle_only_from_its_front():
    # The first one faces the eye at the origin (its normal points west), the second one is its reverse.
    front = np.array([[1, -1, -1], [1, 0, 1], [1, 1, -1]])
    eye = Eye(width=16, height=9, top=0.5, bottom=-0.5, z=0.0)
    ahead = (4, 8)
    for corners, seen in ((front, True), (front[::-1], False)):
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        assert (normal @ -corners[0] > 0) == seen
        for double_sided in (False, True):
            world = world_of(corners[None], [[10, 20, 30]], ground=False, double_sided=double_sided)
            with open_renderer(world, eye, "cpu") as opened:
                assert (opened.render([(0.0, 0.0, 0.0)])[0][ahead][3] == 255) == (seen or double_sided)


def test_alpha_is_zero_in_the_sky_and_full_elsewhere(renderer):
    view = renderer.render(random_poses(3))
    sky = (view[..., :3] == renderer.world.sky_rgb).all(axis=-1)
    assert np.array_equal(sky, view[..., 3] == 0)
    assert (view[:, -1, :, 3] == 255).all()  # ground


def test_an_empty_batch_is_empty_and_a_closed_renderer_is_refused():
    opened = open_renderer(random_world(), Eye(width=8, height=2), "cpu")
    assert opened.render(np.empty((0, 3))).shape == (0, 2, 8, 4)
    opened.close()
    with pytest.raises(InputError, match="closed"):
        opened.render([(0.0, 0.0, 0.0)])


@pytest.mark.parametrize("pose", [(np.nan, 0.0, 0.0), (0.0, np.inf, 0.0)])
def test_poses_that_are_not_finite_are_refused(renderer, pose):
    with pytest.raises(InputError, match="finite"):
        renderer.render([pose])


def test_an_unknown_renderer_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match="cpu, cuda, egl, osmesa"):
        open_renderer(random_world(), Eye(), "vulkan")


TREE_OF = TriangleTree.of


def tree_with_large_boxes(triangles: np.ndarray, leaf: int) -> TriangleTree:
    tree = TREE_OF(triangles, leaf)
    boxes = np.full_like(tree.boxes, 1e6)
    boxes[:, :3] = -1e6
    return dataclasses.replace(tree, boxes=boxes)


@pytest.mark.parametrize("name", ["tussock-field", "tiny", "a wall", "random"])
def test_what_the_tree_leaves_out_changes_no_byte(monkeypatch, name):
    """Compared with the same renderer with boxes so large that none is ever between the rays, or hidden."""
    if name == "a wall":  # which hides most of a crowd
        wall = np.array([[(1, -9, 0), (1, 9, 0), (1, 9, 3)], [(1, -9, 0), (1, 9, 3), (1, -9, 3)]], dtype=np.float32)
        crowd = random_world(seed=2, n=3000)
        rgb = np.concatenate([np.zeros((2, 3), np.uint8), crowd.rgb])
        world = dataclasses.replace(crowd, triangles=np.concatenate([wall, crowd.triangles]), rgb=rgb, ground=None)
    else:
        world = random_world(seed=5, n=2000) if name == "random" else World.generate(name, seed=3)
    rng = np.random.default_rng(1)
    x0, y0, x1, y1 = world.field
    poses = np.column_stack([rng.uniform(x0, x1, 6), rng.uniform(y0, y1, 6), rng.uniform(-3, 3, 6)])
    for eye in (Eye(), Eye(width=90, height=25, samples=4, top=np.radians(90), bottom=np.radians(-90), z=0.2)):
        with ScanlineRenderer(world, eye) as renderer:
            views = renderer.render(poses)
        with monkeypatch.context() as patch:
            patch.setattr(TriangleTree, "of", tree_with_large_boxes)
            with ScanlineRenderer(world, eye) as renderer:
                assert np.array_equal(renderer.render(poses), views)


def test_every_box_of_the_tree_contains_its_triangles_and_its_parts():
    world = random_world(seed=4, n=1000)
    triangles, _ = world.surfaces()
    tree = TriangleTree.of(triangles, 8)
    assert sorted(tree.order) == list(range(len(triangles)))
    corners = tree.corners.transpose(0, 3, 2, 1).reshape(-1, 3, 3)
    assert np.array_equal(corners[: len(triangles)], triangles[tree.order])
    leaves = len(tree.boxes) // 2
    for k, (*low, x1, y1, z1) in enumerate(tree.boxes):
        if k >= leaves:
            inside = corners[: len(triangles)][(k - leaves) * 8 : (k - leaves + 1) * 8].reshape(-1, 3).T
        elif k >= 1:
            inside = np.hstack([tree.boxes[2 * k : 2 * k + 2, :3].T, tree.boxes[2 * k : 2 * k + 2, 3:].T])
            inside = inside[:, np.isfinite(inside).all(axis=0)]
        else:
            continue
        if inside.size:
            assert (inside.min(axis=1) >= low).all()
            assert (inside.max(axis=1) <= (x1, y1, z1)).all()


def test_no_ray_passes_between_two_triangles_at_an_upright_seam():
    """Two halves of a wall meet at the azimuth of the middle column, so its rays lie in the plane of the seam and the eye."""
    wall = np.array([[(1, -1, -1), (1, 0, -1), (1, 0, 1)], [(1, 0, -1), (1, 1, -1), (1, 0, 1)]], dtype=np.float32)
    eye = Eye(width=45, height=21, top=0.5, bottom=-0.5, z=0.0, samples=1)
    for corners in (wall, wall[:, ::-1], wall * [1, 1, -1]):
        with open_renderer(world_of(corners, [[9, 9, 9]] * 2, ground=False), eye, "cpu") as opened:
            assert (opened.render([(0.0, 0.0, 0.0)])[0, :, 22, 3] == 255).all()


@pytest.mark.parametrize("size", [(360, 75), (7, 400), (4000, 12)])
@pytest.mark.parametrize("scale", [0.02, 0.3, 5.0])
def test_no_triangle_that_a_ray_meets_is_left_out(size, scale):
    """All rays against all triangles of many leaves, in double precision; a third has its corners on a grid on which the eye is."""
    rng, (width, height), n = np.random.default_rng(8), size, culling_kernels.LEAF
    work, found, met = np.empty(9 * n, np.float32), np.empty(n, np.int64), 0
    for k in range(60):
        corners = (rng.uniform(-2, 2, (n, 1, 3)) + scale * rng.normal(size=(n, 3, 3))) * [1, 1, 0.5]
        corners = np.float32(np.round(4 * corners) / 4 if k % 3 == 0 else corners)
        view = View(0.25, -0.5, 0.0, rng.uniform(-20, 20), 1.0, height / 1.5, width, height, 0, width)
        count = find_candidates(np.ascontiguousarray(corners.transpose(2, 1, 0)), n, view, work, found)
        azimuths = view.heading + column_azimuths(width)
        tangents = np.tan(view.top - (np.arange(height) + 0.5) / view.rows_per_rad)
        a, b, c = (corners.astype(float) - [view.x, view.y, view.z]).transpose(1, 0, 2)
        volume = (a * np.cross(b, c)).sum(axis=1)
        for i in np.flatnonzero(abs(volume) > 1e-12):
            normals = np.cross([a[i], b[i], c[i]], [b[i], c[i], a[i]]) * np.sign(volume[i])
            flat = normals[:, :1] * np.cos(azimuths) + normals[:, 1:2] * np.sin(azimuths)
            hit = (flat[:, None] + normals[:, 2, None, None] * tangents[:, None] > 0).all(axis=0).any(axis=0)
            if hit.any():
                assert i in found[:count]
                seen = np.arange(int(work[6 * n + i]), int(work[7 * n + i]) + 1) % width
                assert set(np.flatnonzero(hit)) <= set(seen)
                met += 1
    assert met > 20
