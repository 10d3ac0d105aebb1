"""Materials and pictures with any content: each is drawn, or refused in one line that names the file."""

import struct
import zlib

import numpy as np
from fuzz_files import glb_of, glb_parts, read_and_draw
from fuzzing import FOLDER, NUMBERS, damaged, damaged_json, holds, main
from gltf_files import UV, png, wall_glb
from hypothesis import given
from hypothesis import strategies as st

PIXELS = np.random.default_rng(0).integers(0, 256, (5, 4, 4), dtype=np.uint8)
PICTURES = [png(PIXELS), png(PIXELS[..., :3]), png(PIXELS[..., 0])]
TRANSFORM = {"offset": [0.1, 2.0], "rotation": 1.0, "scale": [2.0, -1.0], "texCoord": 0}
TEXTURE = {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": TRANSFORM}}
MATERIAL = {
    "pbrMetallicRoughness": {"baseColorTexture": TEXTURE, "baseColorFactor": [0.5, 1.0, 0.2, 0.9]},
    "alphaMode": "MASK",
    "alphaCutoff": 0.4,
    "emissiveFactor": [0, 1, 0],
}
SAMPLER = {"magFilter": 9728, "minFilter": 9987, "wrapS": 33071, "wrapT": 33648}
COLOURS = np.linspace(0, 1, 16, dtype=np.float32).reshape(4, 4)


def wall(picture: bytes, uv: np.ndarray = UV, colours: np.ndarray = COLOURS) -> bytes:
    return wall_glb(MATERIAL, image=picture, sampler=SAMPLER, TEXCOORD_0=uv, COLOR_0=colours)


@holds(120)
@given(damaged_json(glb_parts(wall(PICTURES[0]))[0]))
def material_trees(tree):
    path = FOLDER / "material.glb"
    path.write_bytes(glb_of(tree, glb_parts(wall(PICTURES[0]))[1]))
    read_and_draw(path)


odd = st.floats(width=32) | st.sampled_from([np.nan, np.inf, -1e30, 1e7, 1e6 + 0.5, -0.0])


@holds(120)
@given(st.lists(odd, min_size=8, max_size=8), st.lists(odd, min_size=16, max_size=16))
def corners(uv, colours):
    path = FOLDER / "corners.glb"
    uv, colours = np.array(uv, np.float32).reshape(4, 2), np.array(colours, np.float32).reshape(4, 4)
    path.write_bytes(wall(PICTURES[0], uv, colours))
    read_and_draw(path)


@st.composite
def claims(draw) -> bytes:
    """A PNG that claims another size than it has."""
    data = bytearray(draw(st.sampled_from(PICTURES)))
    sizes = st.sampled_from([0, 1, 9, 13_000, 50_000, *(number for number in NUMBERS if number < 2**32)])
    data[16:24] = struct.pack(">II", draw(sizes), draw(sizes))
    data[29:33] = zlib.crc32(data[12:29]).to_bytes(4, "big")
    return bytes(data)


@holds(120)
@given(damaged(PICTURES) | claims() | st.binary(max_size=50))
def pictures(picture):
    path = FOLDER / "picture.glb"
    path.write_bytes(wall(picture))
    read_and_draw(path)


OBJ = "mtllib a.mtl\nv -1 1 0 1 0 0\nv 1 1 0 0 1 0\nv 1 1 1 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl m\nf 1/1 2/2 3/3\n"
MTLS = [
    b"newmtl m\nKd 0.5 0.2 1\nd 0.7\nmap_Kd -clamp on -s 2 2 1 -o 0.1 0 a.png\nmap_d -imfchan m a.png\n",
    b"newmtl m\nTr 0.2\nKa 0.4 0.4 0.4\nmap_Kd a.png\n",
]


@holds(120)
@given(damaged(MTLS) | st.binary(max_size=60), st.sampled_from(PICTURES) | claims())
def mtl_files(mtl, picture):
    (FOLDER / "a.mtl").write_bytes(mtl)
    (FOLDER / "a.png").write_bytes(picture)
    path = FOLDER / "a.obj"
    path.write_text(OBJ)
    read_and_draw(path)


if __name__ == "__main__":
    main()
