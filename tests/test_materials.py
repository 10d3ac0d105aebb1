"""Materials of mesh files: what a wall, or its texture, looks like by the rules of each format."""

import logging
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_files import UV, png, wall_glb

from tussock.render import Eye, open_renderer
from tussock.render.images.database import read_database
from tussock.render.images.writing import Grid, write_database
from tussock.world.errors import InputError
from tussock.world.files import read_world, write_world
from tussock.world.geometry import Bounds
from tussock.world.meshes.reading import MeshReading
from tussock.world.scene import World
from tussock.world.textures import to_display, to_linear

CASES = Path(__file__).parent / "cases"
NORTH = (0.0, 0.0, np.pi / 2)
EYE = Eye(width=360, height=75, z=0.5)
CHESS = np.array([[(200, 100, 50), (0, 0, 0)], [(30, 60, 90), (255, 255, 255)]], np.uint8)  # 2 x 2


def view(world: World, eye: Eye = EYE) -> np.ndarray:
    with open_renderer(world, eye, "cpu") as renderer:
        return renderer.render([NORTH])[0]


def at(world: World, x: float, z: float) -> list[int]:
    """What is seen at the point (x, 1, z) of the wall."""
    picture = view(world, Eye(width=1440, height=480, top=np.pi / 3, bottom=-np.pi / 3, z=0.5))
    up, left = np.degrees(np.arctan2(z - 0.5, np.hypot(x, 1))), np.degrees(np.arctan(-x))
    return picture[int((60 - up) * 4), int((180 - left) * 4)].tolist()


def corners(world: World) -> list[list[int]]:
    """The middles of the quarters of the wall, row by row."""
    return [at(world, x, z)[:3] for z in (0.75, 0.25) for x in (-0.5, 0.5)]


@pytest.fixture
def read(tmp_path):
    """Reads a world from the content of a file, next to others."""

    def world(content: bytes | str, suffix: str = "glb", **others: bytes | str) -> World:
        for name, data in {f"world.{suffix}": content, **{n.replace("_", "."): d for n, d in others.items()}}.items():
            (tmp_path / name).write_bytes(data.encode() if isinstance(data, str) else data)
        return read_world(tmp_path / f"world.{suffix}")

    return world


NEAREST = {"magFilter": 9728, "minFilter": 9728}
PICTURE = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}

# The cases that the issue brought.


def test_stripes_are_seen_by_default():
    picture = view(read_world(CASES / "02_texture_lost_by_default" / "stripes.obj"), Eye(width=360, height=75, z=0.3))
    row = picture[50, 136:224, 0].astype(int)
    assert (np.minimum(row, 255 - row) < 5).mean() > 0.8
    assert np.abs(np.diff(row > 127)).sum() == 7  # 8 stripes


@pytest.mark.parametrize("name", ["no_material.glb", "white_material.glb", "plain_material.glb", "vertex_colours.obj"])
def test_colours_of_vertices_are_kept_with_any_material(name):
    assert read_world(CASES / "06_vertex_colours_lost" / name).rgb.tolist() == [[255, 0, 0]] * 2


def test_a_material_without_a_colour_is_white():
    assert read_world(CASES / "06_vertex_colours_lost" / "default_material.glb").rgb.tolist() == [[255] * 3] * 2


def test_a_leaf_is_a_leaf_and_not_its_card():
    picture = view(read_world(CASES / "09_alpha_cutout_leaf" / "leaf.glb"), Eye(width=360, height=75, z=0.3))
    seen = np.unique(picture[:, 120:240].reshape(-1, 4), axis=0).tolist()
    assert seen == [[0, 160, 0, 255], [191, 191, 191, 0]]
    card = (
        2 * np.degrees(np.arctan(1)) * np.degrees(np.arctan(0.7) + np.arctan(0.3))
    )  # about; pixels are a square degree
    assert 0.15 < (picture[:, 120:240, 3] == 255).sum() / card < 0.3


# glTF.


def test_a_factor_multiplies_a_texture_in_linear_light(read):
    factor = [0.0, 0.5, 0.25, 1.0]
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": factor}}
    world = read(wall_glb(material, image=png(np.full((2, 2, 3), 200)), TEXCOORD_0=UV))
    expected = np.rint(255 * to_display(np.array(factor[:3]) * to_linear(200 / 255))).astype(int).tolist()
    assert at(world, 0.3, 0.6) == [*expected, 255]
    assert np.abs(world.rgb - np.array(expected)).max() <= 1
    plain = read(wall_glb({"pbrMetallicRoughness": {"baseColorFactor": factor}}))
    assert plain.texturing is None
    assert plain.rgb[0].tolist() == np.rint(255 * to_display(factor[:3])).astype(int).tolist()


@pytest.mark.parametrize(
    ("kind", "value", "shown"),
    [("uint8", 128, 128), ("uint16", 32768, 188), ("float32", 0.5, 188), ("float32", 1.5, 255), ("float32", np.nan, 0)],
)
def test_colours_of_vertices_are_display_colours_in_bytes_and_else_linear(read, kind, value, shown):
    world = read(wall_glb(COLOR_0=np.full((4, 4), value, kind)))
    assert world.texturing is None
    assert world.rgb.tolist() == [[shown] * 3] * 2


@pytest.mark.parametrize(
    ("kind", "value", "linear"), [("uint8", 128, None), ("uint16", 16384, 16384 / 65535), ("float32", 0.25, 0.25)]
)
def test_colours_of_vertices_times_the_texture_times_the_factor(read, kind, value, linear):
    """In linear light, wherever on the wall; colours in bytes are display colours, others are linear."""
    colours = np.full((4, 3), value, kind)
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.5, 1, 1, 1]}}
    world = read(wall_glb(material, image=png(np.full((2, 2, 3), 200)), TEXCOORD_0=UV, COLOR_0=colours))
    corner = to_linear(value / 255) if linear is None else linear
    light = to_linear(200 / 255) * corner * np.array([0.5, 1, 1])
    for place in ((0.3, 0.6), (-0.8, 0.2)):
        assert np.abs(np.array(at(world, *place)[:3]) - 255 * to_display(light)).max() <= 1
    assert np.abs(world.rgb - 255 * to_display(light)).max() <= 1


def test_colours_are_interpolated_in_perspective(read):
    """Black to white along the wall: in space, and not in the view, they are linear."""
    colours = np.array([0, 255, 255, 0], np.uint8)[:, None].repeat(3, axis=1)
    world = read(wall_glb(COLOR_0=colours))
    for x in (-0.9, -0.5, 0.0, 0.4, 0.8):
        assert abs(at(world, x, 0.6)[0] - 255 * (x + 1) / 2) < 2


@pytest.mark.parametrize(
    ("mode", "cutoff", "seen"), [("OPAQUE", 0.5, 4), ("MASK", 0.2, 3), ("MASK", 0.7, 1), ("BLEND", 0, 2)]
)
def test_alpha_modes(read, mode, cutoff, seen):
    alpha = np.array([[0, 64], [160, 255]])
    image = png(np.dstack([np.full((2, 2, 3), 9), alpha]))
    world = read(
        wall_glb(PICTURE | {"alphaMode": mode, "alphaCutoff": cutoff}, image=image, sampler=NEAREST, TEXCOORD_0=UV)
    )
    alphas = [at(world, x, z)[3] for z in (0.75, 0.25) for x in (-0.5, 0.5)]
    assert alphas == [0] * (4 - seen) + [255] * seen


def test_alpha_of_factors_and_of_vertices_makes_holes_too(read):
    faint = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.3]}}
    assert at(read(wall_glb(faint | {"alphaMode": "BLEND"})), 0, 0.5)[3] == 0
    assert at(read(wall_glb(faint | {"alphaMode": "MASK", "alphaCutoff": 0.2})), 0, 0.5) == [255, 0, 0, 255]
    assert at(read(wall_glb(faint)), 0, 0.5) == [255, 0, 0, 255]
    colours = np.array([(9, 9, 9, 255), (9, 9, 9, 0), (9, 9, 9, 0), (9, 9, 9, 255)], np.uint8)
    world = read(wall_glb({"alphaMode": "MASK"}, COLOR_0=colours))
    assert [at(world, x, 0.4) for x in (-0.5, 0.5)] == [[9, 9, 9, 255], [191, 191, 191, 0]]
    assert at(read(wall_glb({}, COLOR_0=colours)), 0.5, 0.4) == [9, 9, 9, 255]


WRAPPED = {10497: [0, 1, 0, 1], 33648: [1, 0, 0, 1], 33071: [0, 0, 0, 1]}  # the texel seen in quarters of u = -1 .. 1


@pytest.mark.parametrize("wrap", WRAPPED)
def test_wrap_modes(read, wrap):
    image = png(np.array([[0, 255]])[..., None].repeat(3, axis=2))
    uv = UV * [2, 1] - [1, 0]
    world = read(
        wall_glb(
            PICTURE, image=image, sampler=NEAREST | {"wrapS": wrap, "wrapT": wrap}, TEXCOORD_0=uv.astype(np.float32)
        )
    )
    assert [at(world, x, 0.6)[0] // 255 for x in (-0.75, -0.25, 0.25, 0.75)] == WRAPPED[wrap]


def test_the_texture_coordinates_that_the_material_names(read):
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}
    mirrored = (UV * [-1, 1] + [1, 0]).astype(np.float32)
    world = read(wall_glb(material, image=png(CHESS), sampler=NEAREST, TEXCOORD_0=UV, TEXCOORD_1=mirrored))
    assert corners(world) == CHESS[:, ::-1].reshape(-1, 3).tolist()


@pytest.mark.parametrize(
    ("transform", "seen"),
    [
        ({"offset": [0, 1], "scale": [1, -1]}, CHESS[::-1]),  # "defining a bottom-left origin", says the extension
        ({"offset": [0.5, 0]}, CHESS[:, ::-1]),
        ({"offset": [0, 1], "rotation": np.pi / 2}, np.rot90(CHESS, -1)),  # "rotated clockwise 90 degrees"
    ],
)
def test_texture_transforms(read, transform, seen):
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    material = {"pbrMetallicRoughness": {"baseColorTexture": texture}}
    assert (
        corners(read(wall_glb(material, image=png(CHESS), sampler=NEAREST, TEXCOORD_0=UV)))
        == seen.reshape(-1, 3).tolist()
    )


def test_the_example_of_the_texture_transform_extension(read):
    """ "This example utilizes only the lower left quadrant of the source image, rotated clockwise 90 degrees.\""""
    image = np.random.default_rng(0).integers(0, 256, (4, 4, 3), dtype=np.uint8)
    texture = {
        "index": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}},
    }
    world = read(
        wall_glb(
            {"pbrMetallicRoughness": {"baseColorTexture": texture}}, image=png(image), sampler=NEAREST, TEXCOORD_0=UV
        )
    )
    assert corners(world) == np.rot90(image[2:, :2], -1).reshape(-1, 3).tolist()


def test_the_older_specular_model(read):
    old = {"diffuseTexture": {"index": 0}, "diffuseFactor": [1, 1, 1, 1]}
    material = {"extensions": {"KHR_materials_pbrSpecularGlossiness": old}}
    world = read(wall_glb(material, image=png(CHESS), sampler=NEAREST, TEXCOORD_0=UV))
    assert corners(world) == CHESS.reshape(-1, 3).tolist()


def test_what_other_programs_show_is_reported_once(read, caplog):
    caplog.set_level(logging.WARNING)
    read(
        wall_glb({"pbrMetallicRoughness": {"metallicFactor": 1, "baseColorFactor": [1, 0, 0, 1]}, "doubleSided": True})
    )
    assert not caplog.records
    read(wall_glb({"name": "lamp", "emissiveFactor": [1, 1, 0]}))
    assert [record.getMessage().count("emissive light (material 'lamp')") for record in caplog.records] == [1]
    caplog.clear()
    read(wall_glb({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.6]}, "alphaMode": "BLEND"}))
    assert [record.getMessage().count("translucent") for record in caplog.records] == [1]


# OBJ, STL and PLY.

OBJ = """mtllib world.mtl
v -1 1 0
v 1 1 0
v 1 1 1
v -1 1 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl m
f 1/1 2/2 3/3
f 1/1 3/3 4/4
"""
GREY = np.full((2, 2, 3), 200, np.uint8)


@pytest.mark.parametrize(
    ("material", "seen"),
    [
        ("Kd 0.5 1 0.25\nmap_Kd a.png", [100, 200, 50]),
        ("map_Kd a.png", [200] * 3),
        ("Kd 0 0 0\nmap_Kd a.png", [200] * 3),  # by programs that do not multiply
        ("Kd 0.5 0 1", [128, 0, 255]),
        ("Kd 1 1 1\nmap_Kd -s 2 2 1 -clamp on a.png", [200] * 3),
        ("Kd 1 1 1\nd 0.4\nmap_Kd a.png", None),
        ("Kd 1 1 1\nTr 0.6\nmap_Kd a.png", None),
        ("Kd 1 1 1\nTr 0.4\nmap_Kd a.png", [200] * 3),
        ("Kd 1 1 1\nd 0\nmap_Kd a.png", [200] * 3),  # by programs that mix d and Tr up
    ],
)
def test_materials_of_obj(read, material, seen):
    world = read(OBJ, "obj", world_mtl=f"newmtl m\n{material}\n", a_png=png(GREY))
    found = at(world, 0.3, 0.6)
    assert found[3] == (255 if seen else 0)
    assert seen is None or np.abs(np.array(found[:3]) - seen).max() <= 1


@pytest.mark.parametrize("mask", ["brightness", "alpha", "larger"])
def test_holes_by_map_d(read, mask):
    holes = np.array([[0, 255], [255, 0]], np.uint8)
    if mask == "alpha":
        image = png(np.dstack([np.zeros((2, 2, 3), np.uint8), holes]))
    else:
        image = png(holes.repeat(8, axis=0).repeat(8, axis=1) if mask == "larger" else holes)
    world = read(OBJ, "obj", world_mtl="newmtl m\nKd 1 1 1\nmap_Kd a.png\nmap_d b.png\n", a_png=png(GREY), b_png=image)
    assert [at(world, x, z)[3] for z in (0.95, 0.05) for x in (-0.9, 0.9)] == [0, 255, 255, 0]
    alone = read(OBJ, "obj", world_mtl="newmtl m\nKd 0 0.5 0\nmap_d b.png\n", b_png=image)
    assert at(alone, 0.9, 0.95) == [0, 128, 0, 255]
    assert at(alone, -0.9, 0.95)[3] == 0


def test_the_alpha_of_a_texture_of_obj_makes_holes_unless_it_was_never_filled(read):
    pixels = np.dstack([GREY, [[255, 255], [255, 255]]]).astype(np.uint8)
    for alpha, seen in (([[0, 0], [255, 255]], [0, 255]), ([[0, 0], [0, 0]], [255, 255])):
        pixels[..., 3] = alpha
        world = read(OBJ, "obj", world_mtl="newmtl m\nmap_Kd a.png\n", a_png=png(pixels))
        assert [at(world, 0.1, z)[3] for z in (0.95, 0.05)] == seen


def test_options_of_a_map(read):
    picture = png(np.kron(CHESS, np.ones((8, 8, 1), np.uint8)))  # so that the middles of its quarters are flat
    plain = read(OBJ, "obj", world_mtl="newmtl m\nmap_Kd a.png\n", a_png=picture)
    assert corners(plain) == CHESS.reshape(-1, 3).tolist()
    moved = read(OBJ, "obj", world_mtl="newmtl m\nmap_Kd -o 0.5 0 a.png\n", a_png=picture)
    assert corners(moved) == CHESS[:, ::-1].reshape(-1, 3).tolist()
    enlarged = read(OBJ, "obj", world_mtl="newmtl m\nmap_Kd -s 0.5 0.5 a.png\n", a_png=picture)
    assert corners(enlarged) == [CHESS[1, 0].tolist()] * 4  # the lower left quarter
    clamped = read(OBJ, "obj", world_mtl="newmtl m\nmap_Kd -clamp on -o 1 -1 a.png\n", a_png=picture)
    assert corners(clamped) == [CHESS[1, 1].tolist()] * 4  # the lower right corner goes on


def test_colours_of_vertices_in_obj(read, caplog):
    lines = OBJ.replace("v -1 1 0\n", "v -1 1 0 1 0 0\n").replace("v 1 1 0\n", "v 1 1 0 1 0 0\n")
    lines = lines.replace("v 1 1 1\n", "v 1 1 1 0 0 1\n").replace("v -1 1 1\n", "v -1 1 1 0 0 1\n")
    world = read(lines, "obj", world_mtl="newmtl m\nKd 0.8 0.8 0.8\n")
    assert np.abs(np.array(at(world, 0.2, 0.3)) - [255 * 0.7, 0, 255 * 0.3, 255]).max() <= 2
    many = lines.replace(" 1 0 0\n", " 255 0 0\n").replace(" 0 0 1\n", " 0 0 255\n")
    assert np.array_equal(view(read(many, "obj", world_mtl="newmtl m\n")), view(world))
    assert at(read(lines, "obj", world_mtl="newmtl m\nmap_Kd a.png\n", a_png=png(GREY)), 0.2, 0.3) == [
        200,
        200,
        200,
        255,
    ]
    assert "colours of vertices" in caplog.text


def test_colours_of_a_ply_are_interpolated(tmp_path):
    mesh = trimesh.Trimesh([(-1, 1, 0), (1, 1, 0), (1, 1, 1), (-1, 1, 1)], [(0, 1, 2), (0, 2, 3)], process=False)
    mesh.visual.vertex_colors = [(0, 0, 0, 255), (200, 0, 0, 255), (200, 0, 0, 255), (0, 0, 0, 255)]
    mesh.export(tmp_path / "wall.ply")
    world = read_world(tmp_path / "wall.ply")
    assert abs(at(world, 0.5, 0.6)[0] - 150) <= 2
    assert world.rgb.tolist() == [[133, 0, 0], [67, 0, 0]]


@pytest.mark.parametrize("program", ["VisCAM", "Magics"])
def test_colours_of_stl(tmp_path, program):
    red, green, none = (31, 31 << 5, 1 << 15) if program == "Magics" else (1 << 15 | 31 << 10, 1 << 15 | 31 << 5, 31)
    header = b"COLOR=\x09\x08\x07\xff" if program == "Magics" else b"made by hand"
    data = header.ljust(80) + struct.pack("<I", 3)
    for colour in (red, green, none):
        data += struct.pack("<12fH", 0, 0, 1, -1, 1, 0, 1, 1, 0, 1, 1, 1, colour)
    (tmp_path / "a.stl").write_bytes(data)
    own = (9, 8, 7) if program == "Magics" else (255, 255, 255)
    assert read_world(tmp_path / "a.stl").rgb.tolist() == [[255, 0, 0], [0, 255, 0], [*own]]


def obj_with_faces_without_texture(first: str, second: str) -> str:
    """An OBJ of two walls with a material each; the last of three faces of each has no texture coordinates."""
    obj = f"mtllib m.mtl\nusemtl {first}\nv -1 1 0\nv 1 1 0\nv 1 1 1\nv -1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 1 0\n"
    obj += f"f 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1\nusemtl {second}\nv 0 -1 0\nv 1 -1 0\nv 0 -1 1\nvt 0.5 0.5\nf 5 6 7\nf 5/4 6/4 7/4\n"
    return obj


def test_faces_without_texture_coordinates_leave_the_others_their_texture(read, caplog):
    image = png(np.full((2, 2, 4), (200, 30, 30, 255), np.uint8))
    obj = obj_with_faces_without_texture("a", "a")
    world = read(obj, "obj", m_mtl="newmtl a\nKd 1 1 1\nmap_Kd t.png\n", t_png=image)
    assert world.rgb.tolist() == [[200, 30, 30]] * 4
    (remark,) = [record.getMessage() for record in caplog.records if "vt" in record.getMessage()]
    assert "2 of the faces with material 'a'" in remark


def test_faces_without_texture_coordinates_are_counted_by_their_material(read, tmp_path, caplog):
    mtl = "newmtl a b\nKd 1 1 1\n map_Kd -s 1 1 1 t.png\nnewmtl plain\nKd 1 0 0\nmap_Ks t.png\nnewmtl lost\nmap_Kd no.png\n"
    read(obj_with_faces_without_texture("a b", "plain"), "obj", m_mtl=mtl, t_png=png(GREY))
    (remark,) = [record.getMessage() for record in caplog.records if "vt" in record.getMessage()]
    assert "1 of the faces with material 'a b'" in remark
    with pytest.raises(InputError, match=r"'a b'.+--strict"):
        read_world(tmp_path / "world.obj", MeshReading(strict=True))
    caplog.clear()
    read(obj_with_faces_without_texture("plain", "lost"), "obj", m_mtl=mtl, t_png=png(GREY))
    assert [record.getMessage().count("no.png") for record in caplog.records if "not found" in record.getMessage()] == [
        1
    ]
    assert "vt" not in caplog.text
    no_coordinates = OBJ.replace("/1", "").replace("/2", "").replace("/3", "").replace("/4", "")
    world = read(no_coordinates, "obj", world_mtl="newmtl m\nKd 1 0 0\nmap_Kd a.png\n", a_png=png(GREY))
    assert world.rgb.tolist() == [[255, 0, 0]] * 2
    assert "2 of the faces with material 'm'" in caplog.text


# Written and read again.


@pytest.mark.parametrize("alpha", ["OPAQUE", "MASK", "BLEND"])
def test_a_textured_world_comes_back_from_glb(read, tmp_path, alpha):
    rng = np.random.default_rng(1)
    image = png(rng.integers(0, 256, (6, 5, 4), dtype=np.uint8))
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.9, 0.5, 0.2, 0.8]}}
    world = read(
        wall_glb(
            material | {"alphaMode": alpha, "alphaCutoff": 0.3},
            image=image,
            sampler={"magFilter": 9728, "wrapS": 33071, "wrapT": 33648},
            TEXCOORD_0=(UV * 3 - 1).astype(np.float32),
            COLOR_0=rng.integers(0, 256, (4, 4), dtype=np.uint8),
        )
    )
    write_world(world, tmp_path / "again.glb")
    again = read_world(tmp_path / "again.glb")
    assert np.array_equal(view(again), view(world))
    assert again.texturing.to_bytes() == world.texturing.to_bytes()
    assert np.array_equal(again.rgb, world.rgb)
    write_world(again, tmp_path / "third.glb")
    assert (tmp_path / "third.glb").read_bytes() == (tmp_path / "again.glb").read_bytes()


def test_textures_that_differ_only_in_their_wrap_come_back(tmp_path):
    from scenes import random_texture, textured_world

    one = random_texture(3, wrap=("repeat", "clamp"))
    textures = [one, *(type(one)(rgba=one.rgba, wrap=wrap) for wrap in (("mirror", "clamp"), ("clamp", "clamp")))]
    for colours in (False, True):
        world = textured_world(textures, n=30, colours=colours)
        write_world(world, tmp_path / "a.glb")
        again = read_world(tmp_path / "a.glb")
        for eye in (EYE, Eye(width=90, height=20)):
            with open_renderer(world, eye, "cpu") as first, open_renderer(again, eye, "cpu") as second:
                pose = [(0.1, 0.2, 0.3)]
                wrong = np.abs(first.render(pose).astype(int) - second.render(pose)).max(axis=-1) > 1
                assert wrong.mean() < 0.001  # uv are moved by whole pictures, which rounds them anew


def test_a_database_of_another_texture_is_of_another_world(read, tmp_path):
    digests = set()
    for name, sampler in (("a", NEAREST), ("b", NEAREST | {"wrapS": 33071}), ("c", NEAREST)):
        world = read(wall_glb(PICTURE, image=png(CHESS), sampler=sampler, TEXCOORD_0=UV))
        with open_renderer(world, Eye(width=8, height=2), "cpu") as renderer:
            write_database(tmp_path / name, renderer, Grid.over(Bounds(0, 0, 0.1, 0.1), 0.2))
        digests.add(read_database(tmp_path / name).metadata["tussock"]["world"])
    assert len(digests) == 2


# Refused.


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12])
def test_invalid_texture_coordinates_are_refused(read, value):
    uv = UV.copy()
    uv[2, 0] = value
    with pytest.raises(InputError, match="texture coordinate"):
        read(wall_glb(PICTURE, image=png(CHESS), TEXCOORD_0=uv))
