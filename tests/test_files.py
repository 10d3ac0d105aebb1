"""Readers and writers of worlds and routes: what is written comes back, what is damaged is refused in one line."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import TypeCheckError
from PIL import Image
from scenes import random_world

from tussock.world.atomic import replacing
from tussock.world.errors import DiskFullError, FileError, InputError
from tussock.world.files import open_world, read_world, write_world
from tussock.world.geometry import Route
from tussock.world.params import is_generated
from tussock.world.route_files import read_route, write_route
from tussock.world.scene import World

SUFFIXES = (".glb", ".ply")


def same(a: World, b: World) -> bool:
    arrays = all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("triangles", "rgb"))
    return arrays and all(
        getattr(a, name) == getattr(b, name) for name in ("ground", "sky_rgb", "field", "double_sided", "origin")
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "world", [World.generate("tiny", 5), random_world(double_sided=False), random_world(ground=False)]
)
def test_a_world_comes_back_complete_and_is_written_alike_twice(tmp_path, suffix, world):
    for name in ("a", "b"):
        write_world(world, tmp_path / (name + suffix))
    assert (tmp_path / ("a" + suffix)).read_bytes() == (tmp_path / ("b" + suffix)).read_bytes()
    assert same(read_world(tmp_path / ("a" + suffix)), world)


def test_the_sussex_world_survives_both_formats(tmp_path, sussex):
    world = read_world(sussex / "world5000_gray.bin")
    assert world.triangles.shape == (5000, 3, 3)
    assert (world.rgb[:, [0, 2]] == 0).all()
    for suffix in SUFFIXES:
        write_world(world, tmp_path / f"w{suffix}")
        assert same(read_world(tmp_path / f"w{suffix}"), world)


def test_an_antworld_file_is_read_as_its_format_says(tmp_path):
    triangles = np.array([[[0, 1, 2], [3, 4, 5], [6, 7, 8]], [[1, 1, 1], [2, 1, 1], [2, 2, 2]]], dtype=float)
    planes = [triangles[:, corner, axis] for axis in range(3) for corner in range(3)]  # x0 x1 x2 y0 ..
    np.concatenate([*planes, *[[0.5, 1.0]] * 3]).astype("<f8").tofile(tmp_path / "w.bin")
    world = read_world(tmp_path / "w.bin")
    assert np.array_equal(world.triangles, triangles.astype(np.float32))
    assert world.rgb.tolist() == [[0, 128, 0], [0, 255, 0]]
    assert world.ground is not None
    assert world.ground.bounds == (0, 1, 6, 7)


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj"])
def test_vertex_colours_of_foreign_meshes_become_triangle_colours(tmp_path, suffix):
    box = trimesh.creation.box()
    box.unmerge_vertices()
    colours = np.random.default_rng(0).integers(0, 256, (len(box.faces), 3)).astype(np.uint8)
    box.visual.vertex_colors = np.repeat(np.column_stack([colours, np.full(len(colours), 255, np.uint8)]), 3, axis=0)
    box.export(tmp_path / f"box{suffix}")
    world = read_world(tmp_path / f"box{suffix}")
    expected = box.triangles if suffix != ".glb" else box.triangles[..., [0, 2, 1]] * [1, -1, 1]  # glTF is y-up
    assert np.allclose(world.triangles, expected, atol=1e-6)
    assert np.abs(world.rgb.astype(int) - colours).max() <= 1
    assert world.field == (-0.5, -0.5, 0.5, 0.5)


def test_face_colours_of_foreign_meshes_are_kept(tmp_path):
    box = trimesh.creation.box()
    box.visual.face_colors = np.column_stack(
        [np.arange(12) * 20, np.arange(12), 255 - np.arange(12), np.full(12, 255)]
    ).astype(np.uint8)
    box.export(tmp_path / "box.ply")
    assert np.array_equal(read_world(tmp_path / "box.ply").rgb, box.visual.face_colors[:, :3])


def textured_square(image: np.ndarray) -> trimesh.Trimesh:
    """Two triangles, the square's lower right and upper left half, with an image across the square."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(image))
    visual = trimesh.visual.TextureVisuals(uv=corners, material=material)
    return trimesh.Trimesh(np.column_stack([corners, np.ones(4)]), [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)


def test_textures_are_kept_and_averaged_over_each_triangle(tmp_path):
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    across, down = np.meshgrid(np.arange(64), np.arange(64))
    image[across + down >= 63] = (200, 100, 50)  # the lower right half of the image
    textured_square(image).export(tmp_path / "square.glb")
    world = read_world(tmp_path / "square.glb")
    assert np.abs(world.rgb.astype(int) - [[200, 100, 50], [0, 0, 0]]).max() <= 25  # but for the diagonal
    assert np.array_equal(world.texturing.textures[0].rgba[..., :3], image)
    write_world(world, tmp_path / "again.glb")
    again = read_world(tmp_path / "again.glb")
    assert same(again, world)
    assert np.array_equal(again.texturing.textures[0].rgba, world.texturing.textures[0].rgba)
    assert np.array_equal(again.texturing.uv, world.texturing.uv)
    with pytest.raises(InputError, match="textures"):
        write_world(world, tmp_path / "square.ply")


def test_a_materials_factor_tints_its_texture(tmp_path):
    square = textured_square(np.full((8, 8, 3), 200, np.uint8))
    square.visual.material.baseColorFactor = [0, 255, 127, 255]
    square.export(tmp_path / "square.glb")
    world = read_world(tmp_path / "square.glb")
    assert np.abs(world.rgb.astype(int) - [0, 200, 145]).max() <= 1  # half the light, by the sRGB standard
    write_world(world, tmp_path / "again.glb")
    assert same(read_world(tmp_path / "again.glb"), world)


def test_many_textured_meshes_keep_their_order(tmp_path):
    squares = []
    for i in range(13):
        square = textured_square(np.full((8, 8, 3), 10 * i, np.uint8))
        square.apply_translation([i, 0, 0])
        squares.append(square)
    plain = trimesh.creation.box()
    plain.visual.face_colors = (9, 90, 200, 255)
    trimesh.Scene([*squares, plain]).export(tmp_path / "squares.glb")
    world = read_world(tmp_path / "squares.glb")
    write_world(world, tmp_path / "again.glb")
    again = read_world(tmp_path / "again.glb")
    assert same(again, world)
    assert len(again.texturing.textures) == 13
    assert np.array_equal(again.texturing.index, world.texturing.index)
    assert np.bincount(world.texturing.index + 1).tolist() == [12] + [2] * 13


def test_a_route_comes_back_from_csv(tmp_path):
    route = Route(np.array([[0.1, 1 / 3, 0.5], [1.0, -2.0, -3.0], [4.0, 5.0, 3.0]]))
    write_route(route, tmp_path / "r.csv")
    assert (tmp_path / "r.csv").read_text().startswith("x_m,y_m,heading_deg\n0.1,")
    assert np.allclose(read_route(tmp_path / "r.csv").poses, route.poses, rtol=0, atol=1e-15)


def test_a_route_without_headings_faces_along_itself(tmp_path):
    (tmp_path / "r.csv").write_text("y_m, x_m\n0, 0\n1, 0\n1, 1\n")
    assert np.allclose(np.degrees(read_route(tmp_path / "r.csv").poses[:, 2]), [90, 0, 0])


def test_the_sussex_routes_are_metres_and_radians(sussex):
    route = read_route(sussex / "ant1_route1.bin")
    assert np.allclose(route.start, (6.30, 8.45, np.radians(-130.3464364)))
    assert np.allclose(route.goal[:2], (5.10, 1.00))
    assert np.isclose(route.length, 8.114, atol=1e-3)


BAD_ROUTES = {
    "x_m,y_m,heading_deg\n0,0,0\nnan,1,2\n": r"r\.csv, line 3: x_m is 'nan'; a route needs finite metres",
    "x_m,y_m,heading_deg\n0,0,0\n1,1,inf\n": "line 3: heading_deg is 'inf'; a route needs finite degrees",
    "x_m,y_m,heading_deg\n0,0,0\n1\n": "line 3: y_m is ''",
    "x_m,y_m,heading_deg\n0,0,0\n1,here,2\n": "line 3: y_m is 'here'",
    "x_m,y_m,heading_deg\n0,0,0\n": "1 point.* at least 2",
    "x_m,y_m,heading_deg\n0,0,0\n0,0,9\n": "at least 2 distinct",
    "a,b,c\n0,0,0\n": "line 1: the columns are 'a,b,c'",
    "": "line 1",
    "x_m,y_m,x_m,heading_deg\n0,0,0,0\n1,1,0,0\n": r"r\.csv, line 1: columns 1 and 3 are .*'x_m'; rename",
    "y_m,heading_deg,x_m,heading_deg,heading_deg\n0,0,0,0,0\n": "columns 2 and 4 and 5 are .*'heading_deg'",
    'x_m,y_m\n"' + "1" * 200_000 + '",2\n': "cannot be read as CSV",
}


@pytest.mark.parametrize(("text", "message"), BAD_ROUTES.items())
def test_bad_routes_are_refused_by_line(tmp_path, text, message):
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(InputError, match=message) as refusal:
        read_route(tmp_path / "r.csv")
    assert str(tmp_path / "r.csv") in str(refusal.value)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("w.bin", b"\0" * 95, "95 bytes.* multiple of 96"),
        ("w.bin", b"", "0 bytes"),
        ("w.bin", np.full(12, np.nan).tobytes(), "triangle 0 .* not finite"),
        ("w.bin", np.full(12, 7.0).tobytes(), "colours run from 7 to 7"),
        ("w.glb", b"glTF", "cannot be read"),
        ("w.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "cannot be read"),
        ("w.obj", b"v 0 0 0\n", "no triangles|cannot be read"),
        ("w.xyzzy", b"x", "unknown kind"),
    ],
)
def test_damaged_worlds_are_refused(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_world(tmp_path / name)


@pytest.fixture(scope="module", params=SUFFIXES)
def whole(request, tmp_path_factory) -> Path:
    """The file of a world."""
    path = tmp_path_factory.mktemp("whole") / f"w{request.param}"
    write_world(World.generate("tiny", 1), path)
    return path


@given(share=st.floats(0.01, 0.99))
def test_a_truncated_world_is_refused(whole, share):
    data, cut = whole.read_bytes(), whole.with_stem("cut")
    cut.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match="cut"):
        read_world(cut)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(InputError, match=r"no world file .*nowhere\.glb"):
        read_world(tmp_path / "nowhere.glb")
    with pytest.raises(InputError, match=r"no route file .*nowhere\.csv"):
        read_route(tmp_path / "nowhere.csv")


def write(path, error: BaseException | None = None):
    """Replace a file; an error is raised in the middle of that."""
    with replacing(path) as partial:
        partial.write_text("half")
        if error is not None:
            error.filename = (
                str(partial) if getattr(error, "filename", None) == "PARTIAL" else getattr(error, "filename", None)
            )
            raise error
        partial.write_text("new")


def test_a_file_is_replaced_as_a_whole(tmp_path):
    path = tmp_path / "w.glb"
    path.write_text("old")
    write(path)
    assert path.read_text() == "new"
    assert [each.name for each in tmp_path.iterdir()] == ["w.glb"]


ABOUT_ANOTHER_FILE = [
    RuntimeError("no file"),
    FileNotFoundError(errno.ENOENT, "No such file or directory", "other.txt"),
    OSError(errno.ENOSPC, "No space left on device", "/elsewhere/other.txt"),
    BrokenPipeError(errno.EPIPE, "Broken pipe"),
    OSError("cannot identify image file"),
]


@pytest.mark.parametrize("error", ABOUT_ANOTHER_FILE, ids=lambda error: str(error)[:20])
def test_an_error_about_another_file_is_raised_unchanged_and_the_old_file_stays(tmp_path, error):
    path = tmp_path / "w.glb"
    path.write_text("old")
    with pytest.raises(type(error)) as raised:
        write(path, error)
    assert raised.value is error
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["w.glb"]


@pytest.mark.parametrize(
    ("error", "kind", "remedy"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), DiskFullError, "make room"),
        (OSError(errno.EDQUOT, "Disk quota exceeded"), DiskFullError, "make room"),
        (OSError(errno.EIO, "Input/output error"), FileError, "another name"),
        (PermissionError(errno.EACCES, "Permission denied", "PARTIAL"), FileError, "another name"),
    ],
    ids=str,
)
def test_an_error_of_writing_is_about_the_target(tmp_path, error, kind, remedy):
    path = tmp_path / "w.glb"
    path.write_text("old")
    reason = error.strerror
    with pytest.raises(kind, match=remedy) as refusal:
        write(path, error)
    assert str(path) in str(refusal.value)
    assert reason in str(refusal.value)
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["w.glb"]


def test_an_error_of_replacing_is_about_the_target(tmp_path, monkeypatch):
    def fail(*names):
        raise PermissionError(errno.EPERM, "Operation not permitted", str(names[0]), None, str(names[1]))

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(FileError, match=r"w\.glb cannot be written \(Operation not permitted\)"):
        write(tmp_path / "w.glb")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_reported_as_such(small_disk):
    with (
        pytest.raises(DiskFullError, match=r"large\.bin cannot be written .*make room"),
        replacing(small_disk / "large.bin") as partial,
    ):
        partial.write_bytes(b"0" * 10**6)
    assert not list(small_disk.iterdir())


def test_a_name_that_is_too_long_is_refused(tmp_path):
    with pytest.raises(FileError, match="too long"):
        write(tmp_path / ("w" * 300 + ".glb"))


def test_a_world_that_cannot_be_written_is_refused(tmp_path):
    world = random_world()
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        write_world(world, tmp_path / "folder.glb")
    with pytest.raises(InputError, match="no folder"):
        write_world(world, tmp_path / "nowhere" / "w.glb")
    with pytest.raises(InputError, match=r"\.glb or \.ply"):
        write_world(world, tmp_path / "w.obj")
    with pytest.raises(InputError, match="no triangles"):
        write_world(random_world(n=0), tmp_path / "w.glb")


@pytest.mark.parametrize("name", ["tiny", " tiny  field_width=2.5", "tiny field_width=2.5 tussock_rgb=(1, 2, 3)"])
def test_nothing_in_the_current_folder_hides_a_preset(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    world = open_world(name, 3)
    (tmp_path / "tiny").mkdir()
    if name != "tiny":
        (tmp_path / name).write_text("no world")
    assert is_generated(name)
    assert same(open_world(name, 3), world)


@pytest.mark.parametrize(
    "name", ["tiny world.glb", "tiny.glb", "./tiny field_width=2.5.glb", "meadow/tiny.glb", "tiny-2.5 m.ply"]
)
def test_a_file_may_have_a_name_that_begins_like_a_preset(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    world = random_world()
    write_world(world, name)
    assert not is_generated(name)
    assert same(open_world(name), world)


@pytest.mark.parametrize("name", ["tundra", "tiny world", "tundra field_width=3", ""])
def test_a_name_of_neither_is_refused_with_the_presets(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="tussock-field") as refusal:
        open_world(name)
    assert repr(name) in str(refusal.value)


def test_worlds_whose_arrays_do_not_fit_are_refused():
    world = random_world(n=5)
    for change in (
        {"rgb": world.rgb[:4]},
        {"rgb": world.rgb / 255},
        {"triangles": world.triangles.astype(float)},
        {"ground": []},
    ):
        with pytest.raises((InputError, TypeCheckError)):
            World(**{**vars(world), **change})
    mine = np.zeros((1, 3, 3), dtype=np.float32)
    World(**{**vars(world), "triangles": mine, "rgb": world.rgb[:1]})
    mine[0, 0, 0] = 1  # the array of the caller can still be changed
