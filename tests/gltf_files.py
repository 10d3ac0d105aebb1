"""Makes small glTF files."""

import io
import json
import struct

import numpy as np
from PIL import Image

KINDS = {"uint8": 5121, "uint16": 5123, "uint32": 5125, "float32": 5126}
WALL = np.array([(-1, 1, 0), (1, 1, 0), (1, 1, 1), (-1, 1, 1)], np.float32)  # x, y, z up
UV = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)  # the whole picture, upright


def png(pixels) -> bytes:
    """A picture."""
    file = io.BytesIO()
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(file, "png")
    return file.getvalue()


def wall_glb(
    material: dict | None = None, *, image: bytes | None = None, sampler: dict | None = None, **attributes
) -> bytes:
    """A wall 2 m wide and 1 m high, 1 m north of the origin, as a GLB.

    material: the glTF material; {"index": 0} is the image. attributes: arrays of the four corners: COLOR_0=..., TEXCOORD_0=...
    """
    chunks, tree = [], {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}

    def view(data: bytes) -> int:
        tree["bufferViews"].append({"buffer": 0, "byteOffset": sum(map(len, chunks)), "byteLength": len(data)})
        chunks.append(data + b"\0" * (-len(data) % 4))
        return len(tree["bufferViews"]) - 1

    def accessor(array: np.ndarray, name: str) -> int:
        entry = {"bufferView": view(array.tobytes()), "componentType": KINDS[array.dtype.name], "count": len(array)}
        entry["type"] = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        if array.dtype.kind == "u" and name != "indices":
            entry["normalized"] = True
        if name == "POSITION":
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        tree["accessors"].append(entry)
        return len(tree["accessors"]) - 1

    # The standard's y is up: (x, z, -y).
    position = np.column_stack([WALL[:, 0], WALL[:, 2], -WALL[:, 1]])  # y up
    arrays = {"POSITION": position.astype(np.float32)} | attributes
    primitive = {"attributes": {name: accessor(np.asarray(array), name) for name, array in arrays.items()}}
    primitive["indices"] = accessor(np.array([0, 1, 2, 0, 2, 3], np.uint16), "indices")
    if material is not None:
        tree["materials"], primitive["material"] = [material], 0
    if image is not None:
        tree["images"] = [{"bufferView": view(image), "mimeType": "image/png"}]
        tree["textures"] = [{"source": 0}]
        if sampler is not None:
            tree["samplers"], tree["textures"][0]["sampler"] = [sampler], 0
    tree |= {"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}
    data = b"".join(chunks)
    tree["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(data), 0x004E4942) + data
