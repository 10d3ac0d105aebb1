"""Files of worlds and routes with any content: each is read, or refused in one line that names it."""

import io
import json
import logging
import struct

import numpy as np
import scipy.io
import trimesh
from fuzzing import FOLDER, answer, damaged, damaged_json, holds, main
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tussock.render import Eye, open_renderer
from tussock.world.files import read_world, write_world
from tussock.world.heading_names import HEADINGS
from tussock.world.meshes.ply_header import comments_of, read_header
from tussock.world.route_files import read_route
from tussock.world.scene import World


def valid_worlds() -> dict[str, list[bytes]]:
    """Valid files of worlds, by suffix."""
    world = World.generate("tiny", 0)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4), (9, 200, 30)))
    visual = trimesh.visual.TextureVisuals(uv=corners, material=material)
    square = trimesh.Trimesh(
        np.column_stack([corners, np.ones(4)]), [[0, 1, 2], [0, 2, 3]], process=False, visual=visual
    )
    box = trimesh.creation.box()
    for suffix in ("glb", "ply"):
        write_world(world, FOLDER / f"valid.{suffix}")
    antworld = np.concatenate(
        [world.triangles[:9].reshape(9, 9)[:, [0, 3, 6, 1, 4, 7, 2, 5, 8]].T, world.rgb[:9].T / 255]
    )
    return {
        "glb": [(FOLDER / "valid.glb").read_bytes(), bytes(trimesh.Scene([square, box]).export(file_type="glb"))],
        "ply": [
            (FOLDER / "valid.ply").read_bytes(),
            box.export(file_type="ply"),
            box.export(file_type="ply", encoding="ascii"),
        ],
        "obj": [square.export(file_type="obj").encode(), box.export(file_type="obj").encode()],
        "stl": [box.export(file_type="stl"), box.export(file_type="stl_ascii").encode()],
        "bin": [antworld.astype("<f8").tobytes()],
        "off": [box.export(file_type="off").encode()],
    }


WORLDS = valid_worlds()
EYE = Eye(width=8, height=3, samples=1)


def read_and_draw(path) -> None:
    """Read a world, draw it, stand on its mesh and write it again, unless it is refused."""
    world = answer(path, lambda: read_world(path))
    if world is None:
        return
    renderer = answer(None, lambda: open_renderer(world, EYE, "cpu"))
    if renderer is not None:
        with renderer:
            x, y = (world.field.x_min + world.field.x_max) / 2, (world.field.y_min + world.field.y_max) / 2
            answer(None, lambda: renderer.render([(x, y, 0.0), (0.0, 0.0, 1.0)]))
    standing = answer(None, world.on_mesh)
    if standing is not None:
        triangle = standing.terrain.triangles[standing.terrain.is_ground][-1:, :, :2].astype(float)
        heights = standing.ground_height(np.concatenate([triangle[0], triangle.mean(axis=1)]))
        assert np.isnan(heights).all() or np.nanmax(np.abs(heights)) <= 1e7
    again = path.with_name("again.glb")
    answer(again, lambda: write_world(world, again))


@holds(120)
@given(
    st.sampled_from(list(WORLDS)).flatmap(
        lambda kind: st.tuples(st.just(kind), damaged(WORLDS[kind]) | st.binary(max_size=200))
    )
)
def world_files(file):
    kind, data = file
    path = FOLDER / f"world.{kind}"
    path.write_bytes(data)
    read_and_draw(path)


def glb_of(tree, rest: bytes) -> bytes:
    """A GLB with a JSON chunk, and the bytes that follow it."""
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest


def glb_parts(data: bytes):
    """The JSON chunk of a GLB, and the bytes that follow it."""
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length]), data[20 + length :]


GLBS = [glb_parts(data) for data in WORLDS["glb"]]
COMMENT = read_header(WORLDS["ply"][0]).comment("tussock")
LINES = comments_of("tussock", COMMENT).encode()


@holds(120)
@given(st.sampled_from(GLBS).flatmap(lambda parts: st.tuples(damaged_json(parts[0]), st.just(parts[1]))))
def world_trees(parts):
    path = FOLDER / "tree.glb"
    path.write_bytes(glb_of(*parts))
    read_and_draw(path)


@holds(80)
@given(damaged_json(COMMENT), st.sampled_from(["glb", "ply"]))
def world_metadata(comment, kind):
    path = FOLDER / f"metadata.{kind}"
    if kind == "ply":
        data = WORLDS["ply"][0]
        assert LINES in data
        path.write_bytes(data.replace(LINES, comments_of("tussock", comment).encode()))
    else:
        tree, rest = glb_parts(WORLDS["glb"][0])
        tree["scenes"][0]["extras"]["tussock"] = comment
        path.write_bytes(glb_of(tree, rest))
    read_and_draw(path)


ROUTES = [
    b"x_m,y_m,heading_deg\n0.5,0.5,0\n1,1,45\n2,1.5,-90\n",
    b'x_m, y_m\r\n"0.5",0.5\r\n1,1\r\n2,1.5\r\n',
    "﻿x_m,y_m,heading_deg,é\n0,0,0,x\n1,0,0,y\n".encode(),
    np.array([[0, 100, 200], [0, 50, 70], [0, 10, 20]], dtype="<f8").tobytes(),
]
odd_numbers = st.floats() | st.sampled_from([1e300, -1e300, 1e154, 1e18, 5e-324, -0.0])
U = np.linspace(0, 1, 30)
TABLES = [
    ("X [mm];Y [mm];yaw (rad)\n" + "\n".join(f"{1e3 * u:.1f};{9e2 * u * u:.1f};{u:.2f}" for u in U))
    .replace(".", ",")
    .encode(),
    ("% a comment\n# x y heading\n" + "\n".join(f"{u:.3f} {u * u:.3f} {45 + u:.1f}" for u in U)).encode(),
    ("frame\tpos_x\tpos_y\n" + "\n".join(f"{i}\t{u:.3f}\t{u * u:.3f}" for i, u in enumerate(U))).encode("utf-16"),
    b"X [mm], Y [mm], Heading [degrees], Filename\n1, 2, 3, a.png\n4, 5, , b.png\n",
]


def saved(save, *values, **options) -> bytes:
    """What a function writes to a stream."""
    stream = io.BytesIO()
    save(stream, *values, **options)
    return stream.getvalue()


MATRIX = np.column_stack([U, U * U, 45 + U])
VARIABLES = [
    {"route": MATRIX},
    {"s": {"x_mm": U, "y_mm": U * U}, "t": "text"},
    {"c": np.array([U, "a"], dtype=object), "x": U, "y": U},
]
ARRAYS = {
    "mat": [
        saved(scipy.io.savemat, VARIABLES[0], format="4"),
        *(saved(scipy.io.savemat, each, do_compression=small) for each in VARIABLES for small in (False, True)),
    ],
    "npy": [saved(np.save, MATRIX)],
    "npz": [saved(np.savez, x=U, y=U), saved(np.savez_compressed, a=MATRIX)],
}
rows = st.lists(st.tuples(odd_numbers, odd_numbers, odd_numbers), min_size=2, max_size=5)


@holds(120)
@given(
    damaged(ROUTES)
    | st.binary(max_size=100)
    | st.text(max_size=60).map(lambda text: text.encode("utf-8", "surrogatepass"))
    | rows.map(lambda rows: ("x_m,y_m,heading_deg\n" + "\n".join(",".join(map(repr, row)) for row in rows)).encode())
    | rows.map(lambda rows: np.array(rows, dtype="<f8").T.tobytes()),
    st.sampled_from(["csv", "bin"]),
)
def routes(data, kind):
    use_route(data, kind)


headings_flags = st.sampled_from(["auto", "auto", *HEADINGS])
columns_flags = (
    st.none()
    | st.sampled_from(["x,y", "x [mm],y [mm],-,theta", "route", "a:x,y,heading", "x,y,c", ":", ""])
    | st.text(max_size=8)
)
smooth_flags = st.sampled_from([0.0, 0.0, 1e-3, 0.1, 1e3])


@holds(200)
@given(
    damaged(TABLES) | st.text(max_size=60).map(lambda text: text.encode("utf-16", "surrogatepass")),
    st.sampled_from(["csv", "txt"]), headings_flags, columns_flags, smooth_flags,
)  # fmt: skip
def route_tables(data, kind, headings, columns, smooth):
    use_route(data, kind, headings, columns, smooth)


@holds(200)
@given(
    st.sampled_from(list(ARRAYS)).flatmap(lambda kind: st.tuples(st.just(kind), damaged(ARRAYS[kind]) | st.binary(max_size=200))),
    headings_flags, columns_flags, smooth_flags,
)  # fmt: skip
def route_arrays(file, headings, columns, smooth):
    use_route(file[1], file[0], headings, columns, smooth)


def use_route(data: bytes, kind: str, *how) -> None:
    """Read a route and ask it for all that it knows, unless it is refused."""
    path = FOLDER / f"route.{kind}"
    path.write_bytes(data)
    route = answer(path, lambda: read_route(path, *how))
    if route is not None:
        assert np.isfinite(route.poses).all()
        assert np.isfinite(route.length)
        assert np.isfinite(route.at([0.0, route.length / 3, np.inf])).all()
        assert np.isfinite(route.nearest(np.array([[0.0, 0.0]]))[0]).all()
        answer(None, lambda: route.resampled(route.length / 7))


def picture(visible: np.ndarray, mode: str, kind: str) -> bytes:
    """The picture of a mask."""
    file = io.BytesIO()
    Image.fromarray(visible.astype(np.uint8) * 255).convert(mode).save(file, kind)
    return file.getvalue()


MASK = np.random.default_rng(0).random((3, 8)) > 0.3
PICTURES = [picture(MASK, mode, kind) for mode, kind in (("L", "png"), ("RGBA", "png"), ("1", "bmp"), ("P", "gif"))]


@holds(120)
@given(damaged(PICTURES) | st.binary(max_size=60))
def masks(data):
    path = FOLDER / "mask.png"
    path.write_bytes(data)
    eye = answer(None, lambda: Eye(width=8, height=3, mask=path))
    if eye is not None:
        assert Eye(**eye.plain()) == eye
        assert eye.visible().any()


@holds(120)
@given(damaged([str(Eye(width=8, height=3, mask=MASK).mask).encode()]) | st.binary(max_size=60))
def texts_of_masks(data):
    answer(None, lambda: Eye(width=8, height=3, mask=data.decode("latin-1")).visible())


if __name__ == "__main__":
    logging.disable()  # remarks on what was assumed
    main()
