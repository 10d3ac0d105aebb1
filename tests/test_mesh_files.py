"""Meshes of other programs: axes, units, places far from 0, and files that they name. What is lost is said or refused."""

import base64
import json
import logging
import struct

import numpy as np
import pytest
import trimesh

from tussock.navigation.experiment import Experiment
from tussock.render import Eye, open_renderer
from tussock.world.errors import FileError, SettingError
from tussock.world.files import open_world, read_world, write_world
from tussock.world.geometry import Bounds, Route, place_text
from tussock.world.meshes.axes import turned_y_up, turned_z_up
from tussock.world.meshes.reading import UNITS, MeshReading
from tussock.world.origin import FAR, local_route, local_xy, origin_of
from tussock.world.route_files import write_route
from tussock.world.scene import World

UTM = np.array([512_340.0, 5_638_660.0, 0.0])
ROOF = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0.5]], dtype=float)  # no symmetry
ROOF_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def posts(seed: int = 0, count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Upright posts on a floor of 6 x 6 m, z up: corners and faces."""
    rng = np.random.default_rng(seed)
    parts = [trimesh.creation.box(bounds=[(0, 0, -0.01), (6, 6, 0)])]
    for x, y, height in np.column_stack([rng.uniform(0.5, 5.5, (count, 2)), rng.uniform(0.3, 0.8, count)]):
        parts.append(trimesh.creation.box(bounds=[(x, y, 0), (x + 0.08, y + 0.08, height)]))
    mesh = trimesh.util.concatenate(parts)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def obj_of(vertices, faces) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    return "\n".join(lines + ["f " + " ".join(str(i + 1) for i in face) for face in np.asarray(faces).tolist()]) + "\n"


def ply_of(vertices, faces, kind: str = "float", order: str = "<") -> bytes:
    """A binary PLY."""
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"ply\nformat {name} 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property {kind} {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    body = np.asarray(vertices).astype(order + {"float": "f4", "double": "f8"}[kind]).tobytes()
    return (
        head.encode()
        + body
        + b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in np.asarray(faces).tolist())
    )


class Gltf:
    """A glTF file, written number by number from the standard."""

    def __init__(self):
        self.tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [], "meshes": []}
        self.tree |= {"accessors": [], "bufferViews": []}
        self.data = b""

    def view(self, data: bytes, **fields) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        self.tree["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)} | fields)
        self.data += data
        return len(self.tree["bufferViews"]) - 1

    def add(self, values, kind: str, **fields) -> int:
        """An accessor."""
        values = np.asarray(values).astype(f"<{kind}")
        number = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}[kind]
        shape = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[1 if values.ndim == 1 else values.shape[1]]
        view = {"bufferView": self.view(values.tobytes()), "componentType": number, "count": len(values), "type": shape}
        self.tree["accessors"].append(view | fields)
        return len(self.tree["accessors"]) - 1

    def mesh(self, vertices, faces=None, mode: int = 4, **fields) -> int:
        primitive = {"attributes": {"POSITION": self.add(vertices, "f4")}, "mode": mode} | fields
        if faces is not None:
            primitive["indices"] = self.add(np.ravel(faces), "u2")
        self.tree["meshes"].append({"primitives": [primitive]})
        return len(self.tree["meshes"]) - 1

    def write(self, path) -> None:
        """As `.glb`, or as `.gltf` with its buffer in a data URI."""
        buffer = {"byteLength": len(self.data)}
        if path.suffix == ".gltf":
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            path.write_text(json.dumps(self.tree | {"buffers": [buffer]}))
            return
        text = json.dumps(self.tree | {"buffers": [buffer]}).encode()
        text, data = text + b" " * (-len(text) % 4), self.data + b"\0" * (-len(self.data) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
        path.write_bytes(
            head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        )


def roof(**node) -> Gltf:
    """A glTF of the roof, in one node."""
    gltf = Gltf()
    gltf.tree["nodes"] = [{"mesh": gltf.mesh(ROOF, ROOF_FACES)} | node]
    return gltf


def corners_of(world: World) -> np.ndarray:
    """The triangles, in an order that does not depend on that of the file."""
    rows = np.roll(world.triangles.astype(float), 0, axis=1)
    first = [min(range(3), key=lambda i: tuple(np.round(t[i], 5))) for t in rows]  # each from its smallest corner
    rows = np.stack([np.roll(t, -i, axis=0) for t, i in zip(rows, first, strict=True)])
    return rows[np.lexsort(np.round(rows.reshape(len(rows), 9), 5).T[::-1])]


def same_shape(world: World, vertices: np.ndarray, faces) -> bool:
    """Whether the triangles of a world are those of vertices with z up, fronts included."""
    field = Bounds(0, 0, 0, 0)
    triangles = np.asarray(vertices)[np.asarray(faces)].astype(np.float32)
    wanted = World(
        triangles=triangles, rgb=np.zeros((len(triangles), 3), np.uint8), ground=None, sky_rgb=(0, 0, 0), field=field
    )
    return len(world.triangles) == len(triangles) and np.allclose(corners_of(world), corners_of(wanted), atol=2e-6)


def z_up(vertices: np.ndarray) -> np.ndarray:
    """Points of a glTF file with z up, by the matrix of a turn by 90 degrees about x."""
    return np.asarray(vertices) @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float).T


# Axes and units


@pytest.mark.parametrize(("along", "thickness"), [("x", 0.0), ("y", 0.0), ("x", 0.01), ("x", 0.1)])
def test_one_can_stand_before_and_behind_a_flat_wall(tmp_path, caplog, along, thickness):
    caplog.set_level(logging.INFO)
    points = np.array([(-1, 0, 0), (1, 0, 0), (1, thickness, 1), (-1, thickness, 1)], dtype=float) + (0, 3, 0)
    points = points if along == "x" else points[:, [1, 0, 2]]
    trimesh.Trimesh(points, [(0, 1, 2), (0, 2, 3)], process=False).export(tmp_path / "wall.ply")
    field = read_world(tmp_path / "wall.ply").field
    margin = 2.0 if thickness < 0.02 else 0.0
    expected = (-1, 3 - margin, 1, 3 + thickness + margin)
    assert np.allclose(field, expected if along == "x" else np.array(expected)[[1, 0, 3, 2]])
    assert (f"a flat wall along {along}" in caplog.text) == (margin > 0)


def test_the_turns_are_rotations_and_undo_each_other():
    points = np.random.default_rng(0).normal(size=(50, 3))
    for up, axis in (("x", 0), ("y", 1), ("z", 2)):
        turn = turned_z_up(np.eye(3), up).T
        assert np.linalg.det(turn) == 1
        assert np.array_equal(turn @ np.eye(3)[axis], [0, 0, 1])
    assert np.array_equal(turned_z_up(points, "y"), z_up(points))
    assert turned_z_up(turned_y_up(points), "y").tobytes() == points.tobytes()


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gltf_is_y_up(tmp_path, suffix):
    vertices, faces = posts()
    gltf = Gltf()
    gltf.tree["nodes"] = [{"mesh": gltf.mesh(turned_y_up(vertices), faces)}]
    gltf.write(tmp_path / f"posts{suffix}")
    world = read_world(tmp_path / f"posts{suffix}")
    assert same_shape(world, vertices, faces)
    assert np.allclose(world.field, (0, 0, 6, 6))
    sideways = read_world(tmp_path / f"posts{suffix}", MeshReading(up="z"))
    assert same_shape(sideways, turned_y_up(vertices), faces)


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_the_axis_that_is_up_can_be_given(tmp_path, suffix, up):
    vertices, faces = posts()
    turned = {"x": vertices[:, [2, 0, 1]], "y": turned_y_up(vertices), "z": vertices}[up]
    trimesh.Trimesh(turned, faces, process=False).export(tmp_path / f"posts{suffix}")
    assert same_shape(read_world(tmp_path / f"posts{suffix}", MeshReading(up=up)), vertices, faces)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb"])
def test_what_has_no_colour_is_white_in_every_format(tmp_path, suffix):
    trimesh.Trimesh(*posts(), process=False).export(tmp_path / f"posts{suffix}")
    assert (read_world(tmp_path / f"posts{suffix}").rgb == 255).all()


@pytest.mark.parametrize("reading", [{"unit": unit} for unit in UNITS] + [{"scale": 0.5}])
def test_the_unit_can_be_given(tmp_path, reading):
    vertices, faces = posts()
    metres = reading.get("scale") or UNITS[reading["unit"]]
    (tmp_path / "posts.obj").write_text(obj_of(vertices / metres, faces))
    assert same_shape(read_world(tmp_path / "posts.obj", MeshReading(**reading)), vertices, faces)


def test_a_scale_and_a_unit_are_one_too_many():
    with pytest.raises(SettingError, match="give one of the two"):
        MeshReading(unit="mm", scale=0.001)
    with pytest.raises(SettingError, match="one of auto, x, y, z"):
        MeshReading(up="-z")


def test_an_axis_or_a_unit_is_refused_where_there_is_no_file():
    world = World.generate("tiny", 0)
    for source in ("tiny", world):
        with pytest.raises(SettingError, match="up, unit and scale are for files"):
            Experiment(world=source, reading=MeshReading(up="y")).open_world()
    assert open_world("tiny", 0, MeshReading(strict=True)).origin == world.origin


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v: v * 1000, ["wide", "--unit mm"]),
        (lambda v: v / 1000, ["wide", "--scale"]),
        (turned_y_up, ["y seems to be up", "--up y"]),
        (lambda v: v[:, [2, 0, 1]], ["x seems to be up", "--up x"]),
        (lambda v: v * [1, 1, 8], ["as high as wide", "--up"]),
    ],
)
def test_numbers_that_suggest_something_else_are_remarked_upon_once(tmp_path, caplog, change, words):
    vertices, faces = posts()
    (tmp_path / "posts.obj").write_text(obj_of(change(vertices), faces))
    read_world(tmp_path / "posts.obj")
    (message,) = caplog.messages
    assert all(word in message for word in ["posts.obj", *words]), message


def test_a_gltf_that_is_not_as_its_standard_says_is_remarked_upon(tmp_path, caplog):
    vertices, faces = posts()
    gltf = Gltf()
    gltf.tree["nodes"] = [{"mesh": gltf.mesh(vertices, faces)}]
    gltf.write(tmp_path / "posts.glb")
    read_world(tmp_path / "posts.glb")
    assert "--up z" in caplog.text
    caplog.clear()
    assert same_shape(read_world(tmp_path / "posts.glb", MeshReading(up="z")), vertices, faces)
    assert not caplog.messages


def test_nothing_is_remarked_upon_where_all_is_well(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    vertices, faces = posts()
    (tmp_path / "posts.obj").write_text(obj_of(vertices, faces))
    read_world(tmp_path / "posts.obj")
    for preset in ("tiny", "meadow"):
        world = World.generate(preset, 3)
        trimesh.Trimesh(
            world.triangles.reshape(-1, 3), np.arange(3 * len(world.triangles)).reshape(-1, 3), process=False
        ).export(tmp_path / "plain.ply")
        write_world(world, tmp_path / "own.glb")
        read_world(tmp_path / "plain.ply"), read_world(tmp_path / "own.glb")
    assert not caplog.messages


def test_our_glb_files_are_written_y_up_and_the_old_ones_still_open(tmp_path):
    world = World.generate("tiny", 4)
    write_world(world, tmp_path / "new.glb")
    (mesh,) = trimesh.load_scene(tmp_path / "new.glb", process=False).geometry.values()
    height = mesh.vertices[:, 1]  # y, as other programs see it
    assert np.isclose(height.min(), world.triangles[..., 2].min())
    assert np.isclose(height.max(), world.triangles[..., 2].max())
    again = read_world(tmp_path / "new.glb")
    assert again.triangles.tobytes() == world.triangles.tobytes()
    scene = trimesh.load_scene(tmp_path / "new.glb", process=False)  # as version 1 was written
    (mesh,) = scene.geometry.values()
    mesh.vertices = turned_z_up(mesh.vertices, "y")
    scene.metadata["tussock"] = {
        key: value for key, value in scene.metadata["tussock"].items() if key != "origin_m"
    } | {"version": 1}
    scene.export(tmp_path / "old.glb")
    old = read_world(tmp_path / "old.glb")
    assert old.triangles.tobytes() == world.triangles.tobytes()
    assert (old.field, old.ground, old.origin) == (world.field, world.ground, world.origin)


def test_metadata_of_ours_are_ignored_where_another_program_moved_the_mesh(tmp_path, caplog):
    write_world(World.generate("tiny", 4), tmp_path / "w.glb")
    scene = trimesh.load_scene(tmp_path / "w.glb", process=False)
    scene.apply_translation([500, 0, 0])
    scene.export(tmp_path / "moved.glb")
    world = read_world(tmp_path / "moved.glb")
    assert world.ground is None
    assert world.field.x_min > 490
    assert "the metadata are ignored" in caplog.text


# Nodes, instances and scenes of glTF


def turn(axis: int, angle: float) -> np.ndarray:
    """The matrix of a turn about an axis (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(4)
    matrix[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return matrix


def placed(matrix: np.ndarray) -> np.ndarray:
    return ROOF @ matrix[:3, :3].T + matrix[:3, 3]


def test_transforms_of_nodes_are_multiplied_from_the_root(tmp_path):
    angle = 0.7
    gltf = roof()
    inner = np.diag([2.0, 1.0, 0.5, 1.0])
    inner[:3, 3] = 1, 2, 3
    quaternion = [0, np.sin(angle / 2), 0, np.cos(angle / 2)]  # about y
    gltf.tree["nodes"] = [
        {"translation": [5, 0, 1], "rotation": quaternion, "scale": [1, 3, 1], "children": [1]},
        {"matrix": inner.T.ravel().tolist(), "children": [2]},
        {"mesh": 0, "camera": 0, "translation": [0, 0.25, 0]},  # a camera in the node of a mesh
    ]
    gltf.tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}]
    gltf.write(tmp_path / "w.glb")
    move, lift = np.eye(4), np.eye(4)
    move[:3, 3], lift[:3, 3] = (5, 0, 1), (0, 0.25, 0)
    whole = move @ turn(1, angle) @ np.diag([1, 3, 1, 1]) @ inner @ lift
    assert same_shape(read_world(tmp_path / "w.glb"), z_up(placed(whole)), ROOF_FACES)


def test_one_mesh_in_several_places_is_there_several_times(tmp_path):
    gltf = roof()
    gltf.tree["nodes"] = [{"mesh": 0, "translation": [3.0 * i, 0, 0]} for i in range(3)]
    gltf.tree["scenes"] = [{"nodes": [0, 1, 2]}]
    gltf.write(tmp_path / "w.glb")
    vertices = np.concatenate([ROOF + [3 * i, 0, 0] for i in range(3)])
    faces = np.concatenate([ROOF_FACES + 4 * i for i in range(3)])
    assert same_shape(read_world(tmp_path / "w.glb"), z_up(vertices), faces)


def test_instances_by_the_extension_are_placed(tmp_path):
    gltf = roof(translation=[0, 0, 10])
    places, scales = (
        np.array([[0, 0, 0], [5, 0, 0], [0, 1, 9]], dtype=float),
        np.array([[1, 1, 1], [2, 2, 2], [1, 3, 1]]),
    )
    attributes = {"TRANSLATION": gltf.add(places, "f4"), "SCALE": gltf.add(scales, "f4")}
    gltf.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    gltf.tree["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    gltf.write(tmp_path / "w.glb")
    vertices = np.concatenate([ROOF * scale + place + [0, 0, 10] for place, scale in zip(places, scales, strict=True)])
    faces = np.concatenate([ROOF_FACES + 4 * i for i in range(3)])
    assert same_shape(read_world(tmp_path / "w.glb"), z_up(vertices), faces)


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, -2, 1), (-1, -1, -1)])
def test_a_mirrored_box_still_faces_outwards(tmp_path, scale):
    box = trimesh.creation.box()
    gltf = Gltf()
    gltf.tree["nodes"] = [{"mesh": gltf.mesh(box.vertices, box.faces), "scale": list(scale)}]
    gltf.write(tmp_path / "w.glb")
    a, b, c = np.moveaxis(read_world(tmp_path / "w.glb").triangles.astype(float), 1, 0)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) > 0).all()


def test_the_default_scene_is_read_and_the_others_are_named(tmp_path, caplog):
    gltf = roof()
    gltf.tree["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [7, 0, 0]}]
    gltf.tree |= {"scenes": [{"nodes": [0], "name": "attic"}, {"nodes": [1], "name": "yard"}], "scene": 1}
    gltf.write(tmp_path / "w.glb")
    assert same_shape(read_world(tmp_path / "w.glb"), z_up(ROOF + [7, 0, 0]), ROOF_FACES)
    assert "2 scenes; the default one (yard) is read, and not attic" in caplog.text
    with pytest.raises(FileError, match=r"attic.*--strict"):
        read_world(tmp_path / "w.glb", MeshReading(strict=True))


def test_without_scenes_all_nodes_are_read(tmp_path):
    gltf = roof()
    gltf.tree["nodes"] = [{"children": [1]}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, 4]}]
    del gltf.tree["scenes"], gltf.tree["scene"]
    gltf.write(tmp_path / "w.glb")
    assert len(read_world(tmp_path / "w.glb").triangles) == 4


def test_strips_and_fans_become_triangles_with_their_fronts(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 0, -1], [1, 0, -1], [0, 0, -2]], dtype=float)  # seen from above (y)
    for mode, wanted in ((5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]])):
        for indices in (None, np.arange(5)):
            gltf = Gltf()
            gltf.tree["nodes"] = [{"mesh": gltf.mesh(points, indices, mode)}]
            gltf.write(tmp_path / "w.glb")
            assert same_shape(read_world(tmp_path / "w.glb"), z_up(points), wanted)


def test_positions_in_whole_numbers_and_sparse_ones_are_read(tmp_path):
    gltf = Gltf()
    steps = np.rint(ROOF / 2 * 32767)
    position = gltf.add(steps, "i2", normalized=True)  # KHR_mesh_quantization
    gltf.tree["meshes"] = [
        {"primitives": [{"attributes": {"POSITION": position}, "indices": gltf.add(ROOF_FACES.ravel(), "u1")}]}
    ]
    gltf.tree |= {"nodes": [{"mesh": 0, "scale": [2, 2, 2]}], "extensionsRequired": ["KHR_mesh_quantization"]}
    gltf.write(tmp_path / "w.glb")
    assert np.abs(corners_of(read_world(tmp_path / "w.glb")) - corners_of_points(z_up(ROOF))).max() < 1e-4

    gltf = roof()
    moved = ROOF.copy()
    moved[[1, 3]] += [0, 2, 0]
    gltf.tree["accessors"][0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": gltf.view(np.array([1, 3], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": gltf.view(moved[[1, 3]].astype("<f4").tobytes())},
    }
    gltf.write(tmp_path / "w.glb")
    assert same_shape(read_world(tmp_path / "w.glb"), z_up(moved), ROOF_FACES)


def corners_of_points(vertices: np.ndarray) -> np.ndarray:
    field = Bounds(0, 0, 0, 0)
    triangles = vertices[ROOF_FACES].astype(np.float32)
    return corners_of(
        World(triangles=triangles, rgb=np.zeros((2, 3), np.uint8), ground=None, sky_rgb=(0, 0, 0), field=field)
    )


@pytest.mark.parametrize(
    ("extension", "words"),
    [
        ("KHR_draco_mesh_compression", "without Draco compression"),
        ("EXT_meshopt_compression", "without mesh compression"),
        ("KHR_texture_basisu", "PNG or JPEG"),
        ("ACME_magic", "export it without it"),
    ],
)
def test_a_required_extension_that_is_not_supported_is_refused_by_name(tmp_path, extension, words):
    gltf = roof()
    gltf.tree["extensionsRequired"] = [extension]
    gltf.write(tmp_path / "w.glb")
    with pytest.raises(FileError, match=rf"w\.glb.*{extension}.*{words}"):
        read_world(tmp_path / "w.glb")


def test_gltf_claims_allocate_nothing(tmp_path):
    for change in (
        {"count": 2**31},
        {"count": 10**9, "bufferView": None},
        {"byteOffset": 2**31},
        {"sparse": {"count": 2**31}},
    ):
        gltf = roof()
        gltf.tree["accessors"][0] |= change
        gltf.tree["accessors"][0] = {
            key: value for key, value in gltf.tree["accessors"][0].items() if value is not None
        }
        gltf.write(tmp_path / "w.glb")
        with pytest.raises(FileError, match=r"w\.glb"):
            read_world(tmp_path / "w.glb")


# Far from 0


def test_an_origin_is_taken_where_float32_is_coarse():
    assert origin_of(np.array([0.0, -5, 0]), np.array([10.0, 5, 1])) == (0, 0, 0)
    assert origin_of(UTM, UTM + [10, 10, 1]) == (512_340, 5_638_660, 0)
    assert origin_of(UTM - 3.5, UTM + 10)[:2] == (512_330, 5_638_650)
    assert origin_of(np.array([-20_000.0, 0, 0]), np.array([20_000.0, 1, 1])) == (0, 0, 0)  # nothing would be won
    assert np.spacing(np.float32(FAR)) < 0.001


@pytest.mark.parametrize("kind", ["obj", "ply", "ascii ply", "glb"])
def test_a_scan_in_utm_coordinates_keeps_its_millimetres(tmp_path, caplog, kind):
    vertices, faces = posts()
    path = tmp_path / f"posts.{kind.split()[-1]}"
    if kind == "obj":
        path.write_text(obj_of(vertices + UTM, faces))
    elif kind == "ply":
        path.write_bytes(ply_of(vertices + UTM, faces, "double"))
    elif kind == "ascii ply":  # "float", although its digits are more than a float has
        head = ply_of(vertices, faces).partition(b"end_header\n")[0].replace(b"binary_little_endian", b"ascii").decode()
        rows = [" ".join(map(repr, row)) for row in (vertices + UTM).tolist()] + [
            f"3 {a} {b} {c}" for a, b, c in faces.tolist()
        ]
        path.write_text(head + "end_header\n" + "\n".join(rows) + "\n")
    else:
        gltf = Gltf()
        x, y, _ = UTM
        gltf.tree["nodes"] = [{"mesh": gltf.mesh(turned_y_up(vertices), faces), "translation": [x, 0, -y]}]
        gltf.write(path)
    world = read_world(path)
    assert np.array_equal(np.array(world.origin_m) % 10, [0, 0, 0])
    assert np.abs(world.triangles[..., :2]).max() < 20
    assert same_shape(world, vertices + UTM - world.origin_m, faces)
    (message,) = caplog.messages
    assert "x 512340, y 5638660" in message
    for suffix in (".glb", ".ply"):
        write_world(world, tmp_path / f"again{suffix}")
        again = read_world(tmp_path / f"again{suffix}")
        assert again.origin_m == world.origin_m
        assert again.triangles.tobytes() == world.triangles.tobytes()


def test_utm_millimetres_are_read_with_their_unit(tmp_path):
    vertices, faces = posts()
    (tmp_path / "posts.obj").write_text(obj_of((vertices + UTM) * 1000, faces))
    world = read_world(tmp_path / "posts.obj", MeshReading(unit="mm"))
    assert world.origin_m == tuple(UTM)
    assert same_shape(world, vertices, faces)


def test_coordinates_that_are_already_rounded_are_said(tmp_path, caplog):
    vertices, faces = posts()
    (tmp_path / "posts.ply").write_bytes(ply_of(vertices + UTM, faces, "float"))
    read_world(tmp_path / "posts.ply")
    assert "0.5 m apart" in caplog.text


def far_world() -> World:
    field = Bounds(0, 0, 6, 6)
    triangles = np.zeros((1, 3, 3), np.float32)
    rgb = np.zeros((1, 3), np.uint8)
    return World(triangles=triangles, rgb=rgb, ground=None, sky_rgb=(0, 0, 0), field=field, origin_m=tuple(UTM))


def test_places_in_the_files_coordinates_are_made_local(caplog):
    world, near = far_world(), np.array([[1.0, 2.0], [3.0, 4.0]])
    assert np.array_equal(local_xy(world, near, "the route"), near)
    assert not caplog.messages
    assert np.array_equal(local_xy(world, near + UTM[:2], "the route"), near)
    assert "the route: in the coordinates of the world's file" in caplog.text
    route = local_route(world, Route(np.array([[*(UTM[:2] + 1), 0.5], [*(UTM[:2] + 2), 0.6]])), "r")
    assert np.allclose(route.poses, [[1, 1, 0.5], [2, 2, 0.6]])
    outside = near + [100, 100]
    assert np.array_equal(local_xy(world, outside, "r"), outside)  # inside of neither


def test_a_place_that_is_printed_can_be_given_again():
    field = Bounds(512_340.1239, 5_638_660.5551, 512_350.0, 5_638_670.9999)
    numbers = [float(text.strip(" xym")) for text in str(field).replace(",", "..").split("..")]
    x_min, x_max, y_min, y_max = numbers
    assert np.allclose((x_min, y_min, x_max, y_max), field, atol=0.001)
    assert field.contains(x_min, y_min)
    assert field.contains(x_max, y_max)
    assert place_text(512_340.1239, -0.0) == "(512340.124, 0) m"
    assert str(Bounds(0, 0, 10, 9.5)) == "x 0..10 m, y 0..9.5 m"


# The same world in four files


def test_the_same_world_in_any_file_gives_the_same_view_and_the_same_walk(tmp_path):
    world = World.generate("tiny", 3)
    ground = trimesh.Trimesh(world.surfaces()[0][-2:].reshape(-1, 3), np.arange(6).reshape(2, 3), process=False)
    plants = trimesh.Trimesh(
        world.triangles.reshape(-1, 3), np.arange(3 * len(world.triangles)).reshape(-1, 3), process=False
    )
    mesh = trimesh.util.concatenate([plants, ground])
    rgb = np.concatenate([np.repeat(world.rgb, 3, axis=0), [world.ground.rgb] * 6])
    mesh.visual.vertex_colors = np.column_stack([rgb, np.full(len(rgb), 255, np.uint8)]).astype(np.uint8)

    def file(name: str, vertices: np.ndarray):
        copy = mesh.copy()
        copy.vertices = vertices
        copy.export(tmp_path / name)
        return tmp_path / name

    vertices = np.asarray(mesh.vertices)
    double = mesh.copy()
    double.vertices = vertices + UTM
    (tmp_path / "utm.obj").write_text(double.export(file_type="obj", digits=12, include_normals=False))
    files = {
        file("z.ply", vertices): MeshReading(),
        file("y.glb", turned_y_up(vertices)): MeshReading(),
        file("y.obj", turned_y_up(vertices)): MeshReading(up="y"),
        file("mm.ply", vertices * 1000): MeshReading(unit="mm"),
        tmp_path / "utm.obj": MeshReading(),
    }
    start = Route.through(np.array([[0.5, 0.6], [1.0, 0.6], [1.4, 0.9]]))
    views, walks = [], []
    for path, reading in files.items():
        opened = read_world(path, reading)
        shift = UTM[:2] - np.array(opened.origin_m[:2]) if any(opened.origin_m) else np.zeros(2)
        route = tmp_path / f"{path.name}.csv"
        write_route(Route(start.poses + [*(UTM[:2] if any(opened.origin_m) else (0, 0)), 0]), route)
        eye = Eye(width=120, height=25)
        with open_renderer(opened, eye, "cpu") as renderer:
            views.append(renderer.render(start.poses + [*shift, 0]))
        run = Experiment(world=path, reading=reading, route=route, eye=eye, renderer="cpu", encoding="grey", threads=1)
        trajectory = run.run()
        walks.append(trajectory.xy - shift)
    for view, walk in zip(views[1:], walks[1:], strict=True):
        assert (view != views[0]).any(axis=-1).mean() < 0.001
        assert len(walk) > 10
        assert np.allclose(walk, walks[0], atol=1e-3)


def test_a_gltf_that_only_stands_with_z_up_is_read_so_and_that_is_said(tmp_path, caplog):
    wall = np.array([[(-1, 1, 0), (1, 1, 0), (1, 1, 1)], [(-1, 1, 0), (1, 1, 1), (-1, 1, 1)]], dtype=float)
    floor = np.array(
        [[(-1, 0, -1), (1, 0, -1), (1, 0, 1)], [(-1, 0, -1), (1, 0, 1), (-1, 0, 1)]], dtype=float
    )  # with y up

    def height(name, triangles, reading=None):
        path = tmp_path / f"{name}.glb"
        corners = triangles.reshape(-1, 3)
        trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False).export(path)
        caplog.clear()
        return np.ptp(read_world(path, reading).triangles[..., 2])

    assert height("wall", wall) == 1
    assert "--up y takes the standard's axis" in caplog.text
    assert height("wall", wall, MeshReading(up="y")) == 0
    assert height("floor", floor) == 0
    assert "standard's axis" not in caplog.text
    assert height("both", np.concatenate([wall[..., [0, 2, 1]] - [0, 0, 1], floor])) == 1
    assert "standard's axis" not in caplog.text
