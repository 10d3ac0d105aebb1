"""Meshes of other programs with any content, in any axes and units: each is read, or refused in one line that names it."""

import base64
import json
import logging

import numpy as np
from fuzzing import FOLDER, answer, damaged, damaged_json, holds, main
from hypothesis import given
from hypothesis import strategies as st

from tussock.world.file_kinds import kind_of, looks_like_route, looks_like_world
from tussock.world.files import read_world
from tussock.world.meshes.obj import map_options
from tussock.world.meshes.polygons import triangulated
from tussock.world.meshes.reading import UNITS, MeshReading
from tussock.world.meshes.search import Neighbours
from tussock.world.origin import local_xy

logging.disable()  # remarks are many here

OBJ = [
    b"mtllib w.mtl\nv 0 0 0\nv 1 0 0 1 0 0\nv 1 1 1\nv 0 1 1\nvt 0 0\nvt 1 0\nusemtl m\nf 1/1 2/2 3/1 4/2\nusemtl n\nf -4 -3 -2\n",
    b"\tv 0 0 0 # a\r\nv 500000 5600000 0\r\nv 500001 5600000 1\r\no x\r\ng y\r\n"
    b"f 1 2 \\\r\n3\r\nf 1//1 2//1 3//1 1 2\r\nl 1 2\r\nvn 0 0 1\n",
]
MTL = [
    b"newmtl m\nKd 1 0.5 0\nmap_Kd -s 1 2 -clamp on maps\\my%20red.png\nmap_d ../w.obj\nnewmtl n\nKd 0 0 1\n",
    b"newmtl m\nmap_Kd C:\\scan\\red.png\nd 0.5\nnewmtl  a  b\nmap_Kd\tred.png\n",
]
PLY = [
    b"ply\nformat ascii 1.0\ncomment TextureFile red.png\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\n"
    b"element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    b"0 0 0\n1 0 0\n1 1 1\n0 1 5638660.25\n4 0 1 2 3 200 30 30\n3 0 1 2 1 2 3\n",
    b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
    b"property list uchar int vertex_index\nproperty float quality\nend_header\n"
    + np.arange(9, dtype=">f4").tobytes() + b"".join(bytes([n]) + np.arange(n, dtype=">i4").tobytes() + b"\0\0\0\0" for n in (3, 3)),
    b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
    b"property list uint uint vertex_index\nproperty list uchar float texcoord\nend_header\n"
    + np.arange(9, dtype="<f4").tobytes()
    + b"".join(np.array([n, *range(n)], "<u4").tobytes() + bytes([2 * n]) + np.ones(2 * n, "<f4").tobytes() for n in (3, 2)),
]  # fmt: skip
LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n"
readings = st.builds(
    MeshReading,
    up=st.sampled_from(["auto", "x", "y", "z"]),
    unit=st.sampled_from(["auto", *UNITS]),
    strict=st.booleans(),
)


@holds(120)
@given(
    st.sampled_from([("obj", OBJ), ("ply", PLY), ("mtl", MTL)]).flatmap(
        lambda kind: st.tuples(st.just(kind[0]), damaged(kind[1]) | st.binary(max_size=200))
    ),
    readings,
)
def meshes(file, reading):
    kind, data = file
    (FOLDER / "w.mtl").write_bytes(data if kind == "mtl" else MTL[0])
    path = FOLDER / f"w.{'obj' if kind == 'mtl' else kind}"
    path.write_bytes(OBJ[0] if kind == "mtl" else data)
    world = answer(path, lambda: read_world(path, reading))
    if world is not None:
        assert np.isfinite(world.triangles).all()
        assert np.isfinite(world.origin_m).all()
        assert np.isfinite(local_xy(world, [(0.0, 0.0), (1e6, 1e6)], "x")).all()


def gltf_tree():
    """A glTF with much of what the standard allows."""
    corners, faces = np.arange(12, dtype="<f4").reshape(4, 3) % 5, np.array([0, 1, 2, 0, 2, 3], "<u2")
    data = corners.tobytes() + faces.tobytes() + np.array([[0, 255], [9, 8], [1, 1], [3, 4]], "u1").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    sparse = {"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}, {"name": "b", "nodes": [1]}],
        "extensionsUsed": ["EXT_mesh_gpu_instancing"], "extensionsRequired": ["KHR_mesh_quantization"],
        "nodes": [{"children": [1, 2], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 5, 6, 7, 1]}, {"mesh": 0, "camera": 0},
                  {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0},
                                   {"attributes": {"POSITION": 3}, "mode": 6}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
                      {"bufferView": 2, "componentType": 5121, "count": 4, "type": "VEC2", "normalized": True},
                      {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12, "byteStride": 2},
                        {"buffer": 0, "byteOffset": 60, "byteLength": 8}],
        "buffers": [{"byteLength": 68, "uri": uri}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}],
        "images": [{"uri": "..%2Fred.png"}, {"bufferView": 2, "mimeType": "image/webp"}],
    }  # fmt: skip


@holds(150)
@given(damaged_json(gltf_tree()), readings)
def gltf_trees(tree, reading):
    path = FOLDER / "tree.gltf"
    path.write_text(json.dumps(tree))
    world = answer(path, lambda: read_world(path, reading))
    assert world is None or np.isfinite(world.triangles).all()


@holds(200)
@given(
    st.text(max_size=40)
    | st.sampled_from(["C:\\a\\..\\b", "//x/y", "%2e%2e/x", "file:///", "a/b/../../c", "-s 1 2 3", "-o"])
)
def names(name):
    search = Neighbours(FOLDER / "w.obj")
    path = search.find(name)
    assert path is None or path.is_file()
    options, file = map_options(name)
    assert all(each.startswith("-") for each in options)
    assert file == file.strip("\"'")


@holds(100)
@given(
    st.binary(max_size=400) | st.sampled_from([LFS, *OBJ, *PLY]),
    st.sampled_from(["bin", "csv", "glb", "obj", "", "xyz"]),
)
def kinds(data, suffix):
    path = FOLDER / f"file.{suffix}"
    path.write_bytes(data)
    kind_of(data)
    numbers = np.frombuffer(data[: len(data) // 8 * 8], dtype="<f8")
    with np.errstate(all="ignore"):
        assert not (looks_like_route(numbers) and looks_like_world(numbers))
    answer(path, lambda: read_world(path))


coordinate = st.floats(-1e6, 1e6) | st.integers(-2, 2).map(float)


@holds(150)
@given(st.lists(st.lists(st.tuples(coordinate, coordinate, coordinate), max_size=9), max_size=5))
def polygons(polygons):
    points = np.array([point for polygon in polygons for point in polygon], dtype=float).reshape(-1, 3)
    triangles, polygon = triangulated(points, np.array([len(each) for each in polygons], dtype=np.int64))
    assert len(triangles) == len(polygon) == sum(max(len(each) - 2, 0) for each in polygons)
    starts = np.cumsum([0, *map(len, polygons)])
    for triangle, of in zip(triangles, polygon, strict=True):
        assert starts[of] <= triangle.min()
        assert triangle.max() < starts[of + 1]


if __name__ == "__main__":
    main()
