"""OBJ, PLY and other files as people write them: polygons, indices, names of textures, and files that are something else."""

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scenes import random_world

from tussock.world.errors import FileError, InputError
from tussock.world.file_kinds import kind_of, looks_like_route, looks_like_world, numbers_in
from tussock.world.files import read_world, write_world
from tussock.world.meshes.obj import map_options
from tussock.world.meshes.polygons import triangulated
from tussock.world.meshes.reading import MeshReading
from tussock.world.meshes.search import Neighbours
from tussock.world.route_files import read_route
from tussock.world.scene import World

RED = (200, 30, 30)
L_SHAPE = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], dtype=float)  # area 5


def png(rgb=RED) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (4, 4), rgb).save(file, "png")
    return file.getvalue()


def wall(folder, library: str = "mtllib w.mtl", material: str = "map_Kd red.png", name: str = "w.obj"):
    """A square with a texture, standing along x."""
    (folder / "w.mtl").write_text(f"newmtl m\nKd 1 1 1\n{material}\n")
    text = (
        "v -1 1 0\nv 1 1 0\nv 1 1 1\nv -1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    (folder / name).write_text(f"{library}\n{text}")
    return folder / name


def area(world: World) -> float:
    a, b, c = np.moveaxis(world.triangles.astype(float), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


# Files that a mesh names


@pytest.mark.parametrize(
    ("written", "there"),
    [
        ("map_Kd maps\\red.png", "maps/red.png"),
        ("map_Kd C:\\scan\\maps\\red.png", "maps/red.png"),
        ("map_Kd C:\\scan\\maps\\red.png", "red.png"),
        ("map_Kd \\\\server\\share\\red.png", "red.png"),
        ("map_Kd /home/me/scan/red.png", "red.png"),
        ("map_Kd file:///C:/scan/red.png", "red.png"),
        ("map_Kd Maps/Red.PNG", "maps/red.png"),
        ("map_Kd my%20red.png", "my red.png"),
        ("map_Kd my red.png", "my red.png"),
        ('map_Kd "my red.png"', "my red.png"),
        ("map_Kd 100%.png", "100%.png"),
        ("map_Kd ./red.png", "red.png"),
        ("map_Kd ../red.png", "../red.png"),
        ("map_Kd -s 1 1 1 -bm 0.5 maps/red.png", "maps/red.png"),
        ("map_Kd -s 2 my red.png", "my red.png"),
        ("map_Kd -blendu on -blendv off -clamp on -o 0.5 0.5 -mm 0 1 red.png", "red.png"),
        ("map_kd\tred.png", "red.png"),
    ],
)
def test_a_texture_is_found_as_people_write_it(tmp_path, caplog, written, there):
    folder = tmp_path / "world"
    (folder / there).parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(exist_ok=True)
    (folder / there).write_bytes(png())
    assert read_world(wall(folder, material=written)).rgb.tolist() == [list(RED)] * 2
    assert not caplog.messages


@pytest.mark.parametrize(
    ("library", "material", "words"),
    [
        ("mtllib w.mtl", "map_Kd gone.png", ["gone.png", "not found"]),
        ("mtllib w.mtl", "map_Kd https://example.org/red.png", ["example.org", "not followed"]),
        ("mtllib w.mtl", "map_Kd damaged.png", ["damaged.png", "cannot be read as an image"]),
        ("mtllib w.mtl", "map_Kd pointer.png", ["pointer.png", "git lfs pull"]),
        ("mtllib w.mtl", "map_d gone.png", ["gone.png", "not found"]),
        ("mtllib gone.mtl", "", ["gone.mtl", "not found"]),
        ("", "", ["material m", "mtllib"]),
        ("mtllib other.mtl", "", ["material m", "none of its material files"]),
    ],
)
def test_what_is_not_found_is_said_once_and_strictly_refused(tmp_path, caplog, library, material, words):
    (tmp_path / "damaged.png").write_bytes(png()[:40])
    (tmp_path / "pointer.png").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 4\n")
    (tmp_path / "other.mtl").write_text("newmtl n\nKd 1 0 0\n")
    path = wall(tmp_path, library, material)
    read_world(path)
    (message,) = caplog.messages
    assert all(word in message for word in ["w.obj", *words]), message
    with pytest.raises(FileError) as refusal:
        read_world(path, MeshReading(strict=True))
    assert all(word in str(refusal.value) for word in ["w.obj", *words])


def test_several_material_files_are_read(tmp_path, caplog):
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0 1 0\n")
    (tmp_path / "b b.mtl").write_text("newmtl m\nmap_Kd red.png\n")
    (tmp_path / "red.png").write_bytes(png())
    for library in (
        "mtllib a.mtl\nmtllib b b.mtl",
        "# mtllib no.mtl\nmtllib A.MTL\nmtllib sub\\b%20b.mtl".replace("sub\\", ".\\"),
    ):
        assert read_world(wall(tmp_path, library)).rgb[0].tolist() == list(RED)
    (tmp_path / "c.mtl").write_text("newmtl m\nmap_Kd red.png\n")
    assert read_world(wall(tmp_path, "mtllib a.mtl c.mtl")).rgb[0].tolist() == list(RED)
    assert not caplog.messages


def test_the_options_of_a_texture_end_where_its_name_begins():
    assert map_options("-s 2 3 1 -o 0.5 my 2 walls.png") == ({"-s": ["2", "3", "1"], "-o": ["0.5"]}, "my 2 walls.png")
    assert map_options("-clamp on a.png") == ({"-clamp": ["on"]}, "a.png")
    assert map_options("-x.png") == ({}, "-x.png")
    assert map_options("") == ({}, "")


def test_names_lead_nowhere_but_to_files(tmp_path):
    search = Neighbours(tmp_path / "w.obj")
    (tmp_path / "folder").mkdir()
    for name in (
        "",
        " ",
        ".",
        "folder",
        "a\0b",
        "x" * 5000,
        "http://example.org/a.png",
        "..",
        "/",
        "C:\\",
        "//",
        "%00",
    ):
        assert search.find(name) is None


def gltf_wall(folder, **changes) -> dict:
    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 1, -1], [-1, 1, -1]], "<f4")
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4")
    (folder / "my scan.bin").write_bytes(
        corners.tobytes() + np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes() + uv.tobytes()
    )
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
                      {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12},
                        {"buffer": 0, "byteOffset": 60, "byteLength": 32}],
        "buffers": [{"byteLength": 92, "uri": "my%20scan.bin"}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "my%20tex.png"}],
    } | changes  # fmt: skip
    (folder / "w.gltf").write_text(json.dumps(tree))
    return tree


def test_gltf_names_are_decoded_and_missing_ones_named(tmp_path, caplog):
    gltf_wall(tmp_path)
    read_world(tmp_path / "w.gltf")
    assert "'my%20tex.png' is not found" in caplog.text
    caplog.clear()
    (tmp_path / "my tex.png").write_bytes(png())
    assert read_world(tmp_path / "w.gltf").rgb.tolist() == [list(RED)] * 2
    assert not caplog.messages
    gltf_wall(tmp_path, buffers=[{"byteLength": 93, "uri": "my%20scan.bin"}])
    with pytest.raises(FileError, match="has 92 bytes of 93"):
        read_world(tmp_path / "w.gltf")
    gltf_wall(tmp_path, buffers=[{"byteLength": 92, "uri": "gone.bin"}])
    with pytest.raises(FileError, match=r"needs the file 'gone\.bin'"):
        read_world(tmp_path / "w.gltf")


def test_textures_in_webp_are_read_and_those_in_ktx_are_named(tmp_path, caplog):
    Image.new("RGB", (4, 4), RED).save(tmp_path / "red.webp", lossless=True)
    webp = {"textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}], "images": [{"uri": "red.webp"}]}
    gltf_wall(tmp_path, **webp, extensionsRequired=["EXT_texture_webp"])
    assert read_world(tmp_path / "w.gltf").rgb.tolist() == [list(RED)] * 2
    assert not caplog.messages
    gltf_wall(tmp_path, textures=[{"extensions": {"KHR_texture_basisu": {"source": 0}}}], images=[{"uri": "red.ktx2"}])
    read_world(tmp_path / "w.gltf")
    assert "KHR_texture_basisu; export with PNG or JPEG" in caplog.text


def test_only_textures_of_base_colours_are_missed(tmp_path, caplog):
    (tmp_path / "my tex.png").write_bytes(png())
    base = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    gltf_wall(
        tmp_path,
        materials=[{"pbrMetallicRoughness": base, "normalTexture": {"index": 1}}],
        textures=[{"source": 0}, {"source": 1}],
        images=[{"uri": "my%20tex.png"}, {"uri": "bumps.png"}],
    )
    read_world(tmp_path / "w.gltf", MeshReading(strict=True))
    assert not caplog.messages


# Polygons


def test_concave_polygons_are_covered_and_keep_their_fronts():
    rng = np.random.default_rng(0)
    for _ in range(30):
        angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(4, 12)))
        radius = rng.uniform(0.2, 1.0, len(angle))  # a star is simple and mostly concave
        star = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        if np.diff(angle, append=angle[0] + 2 * np.pi).max() > 0.9 * np.pi:
            continue
        basis = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]  # in any plane
        shapes = [star, L_SHAPE, star[::-1]]
        points = np.concatenate([shape @ basis for shape in shapes])
        triangles, polygon = triangulated(points, np.array([len(shape) for shape in shapes]))
        flat = np.concatenate(shapes)[triangles]
        doubled = np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
        for i, shape in enumerate(shapes):
            x, y = shape.T
            whole = np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))
            assert np.isclose(doubled[polygon == i].sum(), whole)
            assert np.isclose(np.abs(doubled[polygon == i]).sum(), abs(whole))  # none overlap, all face alike


def l_shaped_obj() -> str:
    return "".join(f"v {x} 0 {z}\n" for x, z in L_SHAPE) + "f 1 2 3 4 5 6\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (l_shaped_obj(), 5.0),
        (l_shaped_obj() + "f 1 2 3\n", 5.0 + 1.5),
        ("v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\n", 1.0),
        ("v\t0 0 0\n  v 1 0 0\nv 1 0 1  # top\n# f 1 2 3\nf\t1 2 3 # front\n", 0.5),
        ("v 0 0 0\r\nv 1 0 0\r\nv 1 0 1\r\nf 1 2 \\\r\n3\r\n", 0.5),
        ("v 0 0 0\rv 1 0 0\rv 1 0 1\rf 1 2 3\r", 0.5),
        ("\ufeffv 0 0 0\nv 1 0 0\nv 1 0 1\nf 1//1 2//1 3//1\nvn 0 1 0\n", 0.5),
        ("v 0 0 0\nv 1 0 0\nv 1 0 1\nf -3 -2 -1\nv 5 0 0\nv 7 0 0\nv 7 0 2\nf -3/1 -2/2 -1/3\n", 2.5),
        ("v 0 0 0 1\nv 1 0 0 1\nv 1 0 1 1\nl 1 2\np 1\nf 1 2 3\n", 0.5),
    ],
)
def test_obj_files_are_read_as_people_write_them(tmp_path, text, expected):
    for encoding in ("utf-8", "utf-16"):
        (tmp_path / "w.obj").write_text(text, encoding=encoding, newline="")
        assert np.isclose(area(read_world(tmp_path / "w.obj")), expected)


@pytest.mark.parametrize(
    ("comment", "metres"),
    [
        ("# File units = inches", 0.0254),
        ("# file units = Meters", 1.0),
        ("# Units: mm", 0.001),
        ("# units per em = 4", 1.0),
        ("# File units = parsecs", 1.0),
    ],
)
def test_the_unit_that_an_obj_states_is_taken(tmp_path, caplog, comment, metres):
    (tmp_path / "w.obj").write_text(f"# Alias OBJ Model File\n{comment}\n\n{l_shaped_obj()}")
    assert np.isclose(area(read_world(tmp_path / "w.obj")), 5 * metres**2)
    assert ("says that its unit is" in caplog.text) == (metres != 1)
    assert np.isclose(area(read_world(tmp_path / "w.obj", MeshReading(unit="cm"))), 5e-4)


def test_a_ply_header_may_have_more_spaces_than_it_needs(tmp_path):
    (tmp_path / "w.ply").write_bytes(
        mixed_ply("").replace(b"element vertex 6", b"element  vertex   6 ").replace(b"float x", b"float\tx")
    )
    assert len(read_world(tmp_path / "w.ply").triangles) == 7


def mixed_ply(order: str) -> bytes:
    """A quad, a triangle and an L, each with a colour; as text where the order is empty."""
    points = np.array([(x, 1, z) for x, z in L_SHAPE])
    faces = [([0, 1, 2, 3], RED), ([0, 1, 2], (30, 30, 200)), ([0, 1, 2, 3, 4, 5], (1, 2, 3))]
    kind = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {kind} 1.0\ncomment by hand\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar alpha\nelement face 3\nproperty float quality\nproperty list uchar int vertex_index\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    )
    if order:
        body = b"".join(struct.pack(f"{order}3fB", *point, 255) for point in points)
        for face, rgb in faces:
            body += struct.pack(f"{order}fB{len(face)}i3B", 0.5, len(face), *face, *rgb)
        return head.encode() + body + struct.pack(f"{order}2i", 0, 1)
    rows = [" ".join(map(str, [*point, 255])) for point in points]
    rows += [" ".join(map(str, [0.5, len(face), *face, *rgb])) for face, rgb in faces]
    return (head + "\n".join([*rows, "0 1"]) + "\n").encode()


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_ply_polygons_keep_their_colours(tmp_path, order):
    (tmp_path / "w.ply").write_bytes(mixed_ply(order))
    world = read_world(tmp_path / "w.ply")
    assert world.rgb.tolist() == [list(RED)] * 2 + [[30, 30, 200]] + [[1, 2, 3]] * 4
    each = np.array(
        [area(World(**(vars(world) | {"triangles": t[None], "rgb": world.rgb[:1]}))) for t in world.triangles]
    )
    assert np.isclose(each[3:].sum(), 5)
    assert np.isclose(each[2], 1.5)


def test_ply_texture_coordinates_of_corners_are_kept(tmp_path):
    (tmp_path / "two.png").write_bytes(png())
    head = (
        "ply\nformat ascii 1.0\ncomment TextureFile two.png\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    )
    rows = "0 0 0\n1 0 0\n1 0 1\n0 0 1\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n"
    (tmp_path / "w.ply").write_text(head + rows)
    assert read_world(tmp_path / "w.ply").rgb.tolist() == [list(RED)] * 2


@pytest.mark.parametrize("order", ["", "<"])
def test_ply_claims_allocate_nothing(tmp_path, order):
    data = mixed_ply(order)
    for old, new in (
        (b"vertex 6", b"vertex 2147483647"),
        (b"face 3", b"face 2147483647"),
        (b"edge 1", b"edge 2147483647"),
        (b"face 3", b"face -3"),
        *([(b"list uchar", b"list uint")] if order else [(b"0.5 4", b"0.5 2147483647")]),
    ):
        (tmp_path / "w.ply").write_bytes(data.replace(old, new))
        with pytest.raises(FileError, match=r"w\.ply"):
            read_world(tmp_path / "w.ply")


# Other files


OTHERS = {
    "w.glb": [(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n", "git lfs pull")],
    "w.obj": [
        (b"", "empty"),
        (b"<!DOCTYPE html><html></html>", "web page"),
        (b"PK\x03\x04abc", "archive"),
        (b"BLENDER-v300", "Blender"),
        (b"v 0 0 0\nv 1 0 0\nv 1 1 1\n", "point cloud of 3 points.*Poisson"),
        (b"# nothing\n", "no triangles"),
        (b"v 0 0 0\nv 1 0 0\nl 1 2\n", "no triangles, only lines"),
        (b"v 0 0 0\nv 1 0 0\ncstype bspline\ndeg 1\ncurv 0 1 1 2\nparm u 0 0 1 1\nend\n", "only free-form curves and surfaces"),
    ],
    "w.ply": [
        (b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 1 1\n",
         "point cloud of 2 points"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\n"
         b"property list int int vertex_indices\nend_header\n0 0 0\n4 0 0 0 -1\n", "tristrips.*MeshLab"),
        (b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "no triangles"),
    ],
    "w.xyz": [(b"0 0 0\n1 1 1\n1 2 3\n", "point cloud of 3 points")],
    "w.e57": [(b"ASTM-E57", "point cloud; make a mesh")],
    "w.las": [(b"LASF", "point cloud; make a mesh")],
    "w.fbx": [(b"Kaydara FBX Binary", "export it as GLB")],
    "w.dae": [(b"<?xml version='1.0'?>", "export it as GLB from Blender")],
    "w.skp": [(b"x", "SketchUp")],
    "w.stl": [(png(), "is an image")],
    "w.csv": [(b"x_m,y_m\n0,0\n1,1\n", "route.*--route")],
    "w.gltf": [
        (b"{", "cannot be read"), (b'{"asset": {"version": "1.0"}}', "glTF 1.0"), (b'{"asset": {"version": "2.0"}}', "no triangles")],
}  # fmt: skip


@pytest.mark.parametrize(("name", "data", "words"), [(name, *case) for name, cases in OTHERS.items() for case in cases])
def test_files_that_are_no_world_are_refused_with_what_they_are(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=words) as refusal:
        read_world(tmp_path / name)
    assert str(tmp_path / name) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(FileError, match="is a folder"):
        read_world(tmp_path)


def planes_file(path, *planes) -> Path:
    np.array(planes, dtype="<f8").tofile(path)
    return path


SPIRAL = np.linspace(0, 20, 96)
ROUTES = {  # x, y (cm) and heading (degrees) of routes of which the last numbers may be colours
    "straight": (np.linspace(100, 800, 96), np.linspace(900, 100, 96), np.zeros(96)),
    "east": (np.linspace(0, 500, 12), np.full(12, 3.0), np.zeros(12)),
    "spiral": (30 * SPIRAL * np.cos(SPIRAL), 30 * SPIRAL * np.sin(SPIRAL), np.zeros(96)),
    "one degree": (np.linspace(100, 800, 96), np.linspace(900, 100, 96), np.ones(96)),
}


@pytest.mark.parametrize("name", ROUTES)
def test_a_route_whose_headings_are_all_the_same_is_not_a_black_world(tmp_path, name):
    path = planes_file(tmp_path / "r.bin", *ROUTES[name])
    with pytest.raises(FileError, match=r"seems to be a route.*--route"):
        read_world(path)
    assert np.allclose(read_route(path, "as-is").xy, np.transpose(ROUTES[name][:2]) / 100)


@pytest.mark.parametrize("kind", ["few points", "small black triangles", "headings of less than a degree"])
def test_numbers_that_may_be_a_route_and_a_world_are_read_as_asked_for_with_a_remark(tmp_path, caplog, kind):
    planes = np.zeros((12, 40))  # small triangles in a row, black, with their last corners on the ground
    planes[:6] = np.linspace(0, 50, 40) + np.random.default_rng(0).normal(0, 0.1, (6, 40))
    planes[6:8] = 0.2
    x, y, _ = ROUTES["straight"]
    numbers = {
        "few points": [[0, 100, 200, 250], [0, 0, 50, 100], [0, 0, 0, 0]],
        "small black triangles": planes.reshape(3, -1),
        "headings of less than a degree": [x, y, np.linspace(0.1, 0.9, 96)],
    }[kind]
    path = planes_file(tmp_path / "r.bin", *numbers)
    assert len(read_world(path).triangles) == np.size(numbers) // 12
    assert "read as an AntWorld world" in caplog.text
    assert "give it with --route" in caplog.text
    caplog.clear()
    assert read_route(path, "as-is").xy.shape == (np.size(numbers) // 3, 2)
    assert "read as an AntWorld route" in caplog.text
    assert "give it as --world" in caplog.text


def test_a_world_of_colours_is_no_route(tmp_path, caplog):
    planes = np.random.default_rng(0).uniform(0, 1, (12, 2))  # so few numbers that steps say nothing
    assert len(read_world(planes_file(tmp_path / "w.bin", *planes)).triangles) == 2
    assert "route" not in caplog.text


def test_a_world_and_a_route_are_told_apart_by_their_contents(tmp_path, sussex):
    planes = np.array([np.linspace(100, 800, 96), np.linspace(900, 100, 96), np.full(96, -40.0)])
    planes.astype("<f8").tofile(tmp_path / "route.bin")  # a multiple of 96 bytes as well
    planes[:, :95].astype("<f8").tofile(tmp_path / "odd.bin")
    for name in ("route.bin", "odd.bin"):
        assert looks_like_route(numbers_in(tmp_path / name))
        assert not looks_like_world(numbers_in(tmp_path / name))
        with pytest.raises(FileError, match=r"seems to be a route.*--route"):
            read_world(tmp_path / name)
    world = sussex / "world5000_gray.bin"
    assert looks_like_world(numbers_in(world))
    assert not looks_like_route(numbers_in(world))
    for path in sussex.glob("ant*_route*.bin"):
        assert looks_like_route(numbers_in(path))
        assert not looks_like_world(numbers_in(path))
    for suffix in (".glb", ".ply"):
        write_world(random_world(), tmp_path / f"w{suffix}")
        assert kind_of((tmp_path / f"w{suffix}").read_bytes()) == ("world", suffix[1:].upper(), "")
    trimesh.creation.box().export(tmp_path / "box.obj")
    trimesh.creation.box().export(tmp_path / "ascii.stl", file_type="stl_ascii")
    trimesh.creation.box().export(tmp_path / "binary.stl")
    for name, kind in [("box.obj", "OBJ"), ("ascii.stl", "STL"), ("binary.stl", "STL")]:
        assert kind_of((tmp_path / name).read_bytes()) == ("world", kind, "")
    assert kind_of(b"x_m,y_m\n0,0\n1,1\n") is None
