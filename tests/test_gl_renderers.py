"""The OpenGL renderers against the exact CPU renderer.

PyOpenGL binds a process to EGL or to OSMesa, so one of them runs here and the other one in another process
(`test_backend_in_its_own_process`). Without the library a test is skipped; with TUSSOCK_REQUIRE_GL=1 it fails.
"""

import itertools
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from quick_cases import quick
from scenes import full_poses, hills, mesh_world, post, random_poses, random_texture, textured_world

from tussock.render import Eye, Renderer, gl, open_renderer
from tussock.render.cubemap import Cubemap, face_size_for
from tussock.render.raster import RasterRenderer
from tussock.world.errors import InputError, MissingDependencyError, SettingError
from tussock.world.files import read_world
from tussock.world.geometry import Bounds, Pose, turn_of_columns
from tussock.world.scene import Ground, World
from tussock.world.textures import ALPHAS, FILTERS, WRAPS, Texture, Texturing

BACKENDS = ("egl", "osmesa")
SKY, SAND = (191, 191, 191), (229, 183, 90)
HERE = Pose(0.0, 0.0, 0.3)


@pytest.fixture(scope="module")
def sussex_world(sussex):
    return read_world(sussex / "world5000_gray.bin")


def make_world(triangles=(), rgb=(), **kwargs) -> World:
    settings = {
        "ground": Ground(SAND, Bounds(-30, -30, 30, 30)),
        "sky_rgb": SKY,
        "field": Bounds(-5, -5, 5, 5),
    } | kwargs
    triangles = np.array(triangles, dtype=np.float32).reshape(-1, 3, 3)
    return World(triangles=triangles, rgb=np.array(rgb, dtype=np.uint8).reshape(-1, 3), **settings)


@pytest.fixture(scope="module")
def garden() -> World:
    """Blades 2 mm to 25 m away, some shortly behind others, and leaves 1 to 5 mm above the ground."""
    rng = np.random.default_rng(7)
    distance = np.r_[0.002, 0.004, 0.01, np.geomspace(0.05, 25, 250)]
    angle = rng.uniform(-np.pi, np.pi, len(distance))
    foot = np.column_stack([distance * np.cos(angle), distance * np.sin(angle), 0 * angle])
    blade = (
        np.stack([0 * foot, rng.normal(0, 0.1, foot.shape), rng.normal(0, 0.1, foot.shape)], axis=1)
        * distance[:, None, None]
    )
    blade[:, 2, 2] = rng.uniform(0.02, 0.3, len(distance)) * np.maximum(distance, 0.2)
    leaf = rng.uniform(-1, 1, (100, 3, 3)) * 0.3 * [1, 1, 0]
    leaf += np.column_stack([rng.uniform(-6, 6, (100, 2)), rng.uniform(0.001, 0.005, 100)])[:, None]
    triangles = np.concatenate([foot[:, None] + blade, leaf])
    return make_world(triangles, rng.integers(0, 256, (len(triangles), 3)))


def difference(a, b) -> np.ndarray:
    """Largest difference of each pixel's channels (grey levels)."""
    return np.abs(a.astype(int) - b).max(axis=-1)


def assert_agree(views, exact, share=0.01):
    """Few pixels differ visibly (under 2 % is promised), and the mean does not differ."""
    assert views.shape == exact.shape
    assert (difference(views, exact) > 8).mean() < share
    assert np.abs(views.mean(axis=(0, 1, 2)) - exact.mean(axis=(0, 1, 2))).max() < 0.5


def test_agrees_with_the_exact_renderer(backend, garden):
    poses = [HERE, Pose(1.0, 2.0, -2.0), Pose(-3.0, 0.5, 1.5)]
    with open_renderer(garden, backend=backend) as ours, open_renderer(garden, backend="cpu") as cpu:
        assert isinstance(ours, Renderer)
        assert (ours.world, ours.eye, ours.backend) == (garden, Eye(), backend)
        views, exact = ours.render(poses), cpu.render(poses)
    assert_agree(views, exact)
    palette = {(*rgb, 255) for rgb in garden.rgb.tolist()} | {(*SAND, 255), (*SKY, 0)}
    assert {tuple(pixel) for pixel in views.reshape(-1, 4).tolist()} <= palette  # no light, gamma or mixed colours


def test_agrees_in_the_sussex_world(backend, sussex_world):
    poses = np.array([(5, 5, 0.0), (6.3, 8.45, 2.0), (2.5, 7.5, -1.0)])
    with open_renderer(sussex_world, backend=backend) as ours, open_renderer(sussex_world, backend="cpu") as cpu:
        assert_agree(ours.render(poses), cpu.render(poses))


def test_tall_pixels_are_averaged_by_solid_angle(backend, garden):
    """In a row from 40 to 80 degrees the upper rays have a fifth of the weight of the lower ones."""
    eye = Eye(width=16, height=4, top=np.radians(80), bottom=np.radians(-80), samples=24)
    with open_renderer(garden, eye, backend) as ours, open_renderer(garden, eye, "cpu") as cpu:
        views, exact = ours.render([HERE]), cpu.render([HERE])
    assert difference(views, exact).max() < 3


@pytest.mark.parametrize(
    ("preset", "share"),
    quick(
        [
            ("tussock-field", 0.02),
            ("meadow", 0.02),
            ("scrub", 0.02),
            ("hay-meadow", 0.04),
            ("woodland", 0.06),
            ("desert", 0.02),
            ("tussock-field hill_height=0.5 rut_depth=0.1", 0.02),
        ],
        ("tussock-field", 0.02),
        ("scrub", 0.02),
        ("tussock-field hill_height=0.5 rut_depth=0.1", 0.02),
    ),
)
def test_agrees_in_generated_worlds(backend, preset, share):
    """Worlds full of leaves smaller than a pixel, which the pixels of a cube, in slightly other directions, may miss."""
    poses = np.array([(5, 5, 0.0), (2.5, 7.5, -1.0), (8, 3, 2.0)])
    world = World.generate(preset, seed=1)
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        assert_agree(ours.render(poses), cpu.render(poses), share=share)


def test_culled_sussex_frames(backend, sussex, sussex_world):
    """The frames are of another renderer, which is 0.35 to 1.4 grey levels off; the limit is twice the error of a cube."""
    world = replace(sussex_world, double_sided=False)
    for entry in json.loads((sussex / "frames" / "poses.json").read_text())["views"]:
        frame = cv2.imread(str(sussex / "frames" / entry["file"]))[..., ::-1]
        with open_renderer(world, Eye(z=entry["z_m"]), backend) as ours:
            view = ours.render([Pose(entry["x_m"], entry["y_m"], np.radians(entry["heading_deg"]))])[0]
        assert np.abs(view[..., :3].astype(int) - frame).mean() < 2.6


def test_low_resolution_is_averaged(backend, sussex_world):
    eye, poses = Eye(width=120, height=25), np.array([(5, 5, 0.0), (2.5, 7.5, -1.0)])
    with open_renderer(sussex_world, eye, backend) as ours, open_renderer(sussex_world, eye, "cpu") as cpu:
        views, exact = ours.render(poses), cpu.render(poses)
    assert difference(views, exact).mean() < 2.5
    assert np.abs(views.mean(axis=(0, 1, 2)) - exact.mean(axis=(0, 1, 2))).max() < 0.5


@pytest.mark.parametrize("eye", [Eye(top=np.pi / 2, bottom=-np.pi / 2), Eye(width=64, height=9, top=0.2, bottom=0.1)])
def test_any_span_of_elevations(backend, garden, eye):
    with open_renderer(garden, eye, backend) as ours, open_renderer(garden, eye, "cpu") as cpu:
        views, exact = ours.render([HERE]), cpu.render([HERE])
    assert np.abs(views.astype(int) - exact).mean() < 1.5


@pytest.mark.parametrize("columns", [180, -360, 37])
def test_turning_left_rolls_right(backend, garden, columns):
    with open_renderer(garden, backend=backend) as ours:
        view, turned = ours.render([HERE, HERE.turned(float(turn_of_columns(columns, 720)))])
    limit = 0.02 if columns % 180 else 0.0005  # a quarter turn maps the cube onto itself
    assert (difference(turned, np.roll(view, columns, axis=1)) > 8).mean() < limit


def test_a_batch_equals_its_views_one_by_one(backend, garden):
    poses = [HERE, Pose(1.0, 2.0, -2.0)]
    with open_renderer(garden, backend=backend) as ours:
        both = ours.render(poses)
        np.testing.assert_array_equal(both, np.concatenate([ours.render([pose]) for pose in poses]))
        assert ours.render([]).shape == (0, 150, 720, 4)


def test_back_faces(backend):
    towards = [(1, 0.2, 0), (1, -0.2, 0), (1, 0, 0.5)]  # its normal points to the eye at the origin
    assert np.cross(np.subtract(towards[1], towards[0]), np.subtract(towards[2], towards[0]))[0] < 0
    away = [(-1, -0.2, 0), (-1, 0, 0.5), (-1, 0.2, 0)]
    world = make_world([towards, away], [(255, 0, 0), (0, 0, 255)])
    seen = {}
    for double_sided in (True, False):
        with open_renderer(replace(world, double_sided=double_sided), backend=backend) as ours:
            view = ours.render([Pose(0, 0, 0)])[0]
        seen[double_sided] = tuple(
            bool((view == (*rgb, 255)).all(-1).any()) for rgb in [(255, 0, 0), (0, 0, 255), SAND]
        )
    assert seen == {True: (True, True, True), False: (True, False, True)}


def test_an_eye_stands_on_the_mesh(backend):
    posts = [post(x, y, 41.6, 1.0) for x, y in np.random.default_rng(1).uniform(0.5, 5.5, (20, 2))]
    world = mesh_world(hills() + (0, 0, 42), *posts).on_mesh()
    poses = [Pose(2.0, 2.2, 1.0), Pose(5.0, 4.1, -2.0)]
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        assert_agree(ours.render(poses), cpu.render(poses))


def test_agrees_for_pitched_and_rolled_eyes_on_terrain(backend):
    world = mesh_world(hills(), *(post(x, x / 2, 0.2) for x in np.arange(0.5, 6, 0.5))).on_mesh()
    poses = full_poses(world.field, 4)
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        assert_agree(ours.render(poses), cpu.render(poses), share=0.02)


def test_an_empty_world_is_all_sky(backend):
    with open_renderer(make_world(ground=None), backend=backend) as ours:
        np.testing.assert_array_equal(ours.render([HERE]), np.full((1, 150, 720, 4), (*SKY, 0)))


def test_a_textured_quad(backend):
    """It is three texels wide, which a wrong row alignment shears; beside it, a quad of one colour, and the ground."""
    texels = np.array(
        [[(255, 0, 0), (0, 255, 0), (0, 0, 255)], [(255, 255, 0), (0, 255, 255), (9, 90, 200)]], dtype=np.uint8
    )
    rgba = np.concatenate([texels, np.full((2, 3, 1), 255, np.uint8)], axis=-1)
    corners = np.array([(1, 0.6, 0), (1, -0.6, 0), (1, -0.6, 0.8), (1, 0.6, 0.8)])
    quad = corners[[(0, 1, 2), (0, 2, 3)]]
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)[[(0, 1, 2), (0, 2, 3), (0, 0, 0), (0, 0, 0)]]
    index = np.array([0, 0, -1, -1], np.int32)
    texturing = Texturing(textures=(Texture(rgba=rgba, filter="nearest"),), index=index, uv=uv)
    world = make_world([*quad, *quad * [-1, 1, 1]], [(1, 2, 3)] * 2 + [(7, 8, 9)] * 2, texturing=texturing)
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        view = ours.render([Pose(0, 0, 0)])[0]
        assert_agree(view[None], cpu.render([Pose(0, 0, 0)]), share=0.001)

    def at(y, z):
        """The pixel that shows the point (1, y, z)."""
        up, side = np.degrees(np.arctan2(z - 0.01, np.hypot(1, y))), np.degrees(np.arctan(y))
        return view[int((60 - up) * 2), int((180 - side) * 2)]

    for row, z in enumerate((0.6, 0.2)):
        for column, y in enumerate((0.4, 0.0, -0.4)):
            assert at(y, z).tolist() == [*texels[row, column], 255]
    assert view[100, 0].tolist() == [7, 8, 9, 255]
    assert view[-1, 360].tolist() == [*SAND, 255]
    assert not (view == (1, 2, 3, 255)).all(-1).any()


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("colours", quick([False, True], True))
def test_agrees_in_textured_worlds(backend, kind, alpha, colours):
    pairs = itertools.product(WRAPS, WRAPS)
    textures = [random_texture(i, wrap=pair, filter=kind, alpha=alpha, cutoff=0.15 * i) for i, pair in enumerate(pairs)]
    world = textured_world(textures, n=200, colours=colours)
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        assert_agree(ours.render(random_poses(2)), cpu.render(random_poses(2)), share=0.002)


def test_agrees_where_texels_are_smaller_than_pixels(backend):
    """Each ray has a texel of its own, so that one a fifth of a pixel away is seen in another colour."""
    rgba = np.random.default_rng(0).integers(0, 256, (2048, 2048, 4), dtype=np.uint8)
    corners = np.array([(-3, -3, -0.1), (3, -3, -0.1), (3, 3, -0.1), (-3, 3, -0.1)])[[(0, 1, 2), (0, 2, 3)]]
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)[[(0, 1, 2), (0, 2, 3)]]
    texturing = Texturing(textures=(Texture(rgba=rgba),), index=np.zeros(2, np.int32), uv=uv)
    world = make_world(corners, [(0, 0, 0)] * 2, ground=None, texturing=texturing)
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        assert_agree(ours.render([HERE]), cpu.render([HERE]), share=0.005)


def test_textures_that_are_too_large_are_refused(backend, monkeypatch):
    from OpenGL import GL

    asked = GL.glGetIntegerv
    monkeypatch.setattr(GL, "glGetIntegerv", lambda name: 4 if name == GL.GL_MAX_TEXTURE_SIZE else asked(name))
    world = textured_world([Texture(rgba=np.zeros((2, 5, 4), np.uint8))])
    with pytest.raises(SettingError, match=r"5 x 2 pixels.*allows 4.*cpu"):
        open_renderer(world, backend=backend)


def test_several_renderers_at_once(backend, garden, sussex_world):
    with open_renderer(garden, backend=backend) as first:
        before = first.render([HERE])
        with open_renderer(sussex_world, Eye(width=90, height=20), backend) as second:
            between = second.render([Pose(5, 5, 0)])
            np.testing.assert_array_equal(first.render([HERE]), before)
            np.testing.assert_array_equal(second.render([Pose(5, 5, 0)]), between)
        np.testing.assert_array_equal(first.render([HERE]), before)
        with ThreadPoolExecutor(2) as threads:  # they take turns
            for view in threads.map(lambda _: first.render([HERE]), range(4)):
                np.testing.assert_array_equal(view, before)
    with open_renderer(garden, backend=backend) as again:
        np.testing.assert_array_equal(again.render([HERE]), before)


def test_invalid_poses_sizes_and_backends_are_refused(backend, garden):
    ours = open_renderer(garden, backend=backend)
    with pytest.raises(SettingError, match="pose 0 is"):
        ours.render([Pose(0, np.nan, 0)])
    ours.close()
    ours.close()
    with pytest.raises(InputError, match="closed"):
        ours.render([HERE])
    with pytest.raises(SettingError, match="0 pixels"):
        RasterRenderer(garden, Eye(), backend, face_size=0)
    with pytest.raises(SettingError, match=r"1000000.*at most.*face_size"):
        RasterRenderer(garden, Eye(width=8, height=2), backend, face_size=10**6)
    other = next(name for name in BACKENDS if name != backend)
    with pytest.raises(SettingError, match=f"{other}.* through {backend}.* another process"):
        open_renderer(garden, backend=other)


@pytest.mark.parametrize(("name", "package"), [("egl", "libegl1"), ("osmesa", "libosmesa6")])
def test_a_missing_library_is_named(garden, monkeypatch, name, package):
    monkeypatch.setattr(gl, "_loads", lambda library: False)
    monkeypatch.setattr(gl, "_context", None)
    monkeypatch.setattr(gl, "bound_backend", lambda: None)
    with pytest.raises(MissingDependencyError, match=package) as error:
        open_renderer(garden, backend=name)
    assert "\n" not in str(error.value)


def test_the_environment_is_not_changed(backend, garden):
    before = dict(os.environ)
    with open_renderer(garden, backend=backend):
        assert gl.gl_device_name()
    assert dict(os.environ) == before


def test_cube_faces_follow_the_eye():
    names = [face.name for face in Cubemap(Eye(), 64).faces]
    assert names == ["ahead", "left", "behind", "right", "above"]
    assert [face.name for face in Cubemap(Eye(top=0.1, bottom=-1.5), 64).faces][-1] == "below"
    assert face_size_for(Eye()) == 1152


@pytest.mark.parametrize(
    "some", ["and (exact_renderer or textured_quad)", pytest.param("", marks=pytest.mark.slow)], ids=["a few", "all"]
)
@pytest.mark.parametrize("name", BACKENDS)
def test_backend_in_its_own_process(name, some):
    """The tests of a backend that this process cannot use run in another process: a few with the quick tests, all with the slow ones.

    All are those of each file that takes the fixture `backend`.
    """
    if name == (gl.bound_backend() or BACKENDS[0]):
        pytest.skip(f"{name} runs in this process")
    here = Path(__file__)
    files = [here] if some else [path for path in here.parent.glob("test_*.py") if "(backend" in path.read_text()]
    command = [sys.executable, "-m", "pytest", *files, "-k", f"{name} and not own_process {some}"]
    command += ["-p", "no:cacheprovider", *([] if some else ["-m", ""])]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=Path(__file__).parents[1], timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
