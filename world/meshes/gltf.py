"""glTF files before trimesh reads them: what the standard asks for and trimesh leaves out is added, or refused by name.

A `.gltf` with its buffers, or a `.glb`, becomes a GLB of one buffer in which trimesh finds everything: numbers that are stored as
whole numbers, sparse or in fans are written out, instances become nodes, cameras are left out (trimesh drops the meshes of their
nodes). The numbers and order of materials, textures, samplers, images and meshes stay.
"""

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np

from ..errors import FileError
from .gltf_materials import carry_materials
from .gltf_numbers import Accessors
from .search import Neighbours

MAX_NUMBERS = 3 * 10**7  # that a file may claim without having them; as many as the corners of the largest world
MAX_INSTANCES = 10**5
GL_TRIANGLES, GL_STRIP, GL_FAN = 4, 5, 6
COMPRESSED_MESH = "without mesh compression"
REMEDIES = {
    "KHR_draco_mesh_compression": "without Draco compression",
    "EXT_meshopt_compression": COMPRESSED_MESH,
    "KHR_meshopt_compression": COMPRESSED_MESH,
    "KHR_texture_basisu": "with textures in PNG or JPEG",
    "MSFT_texture_dds": "with textures in PNG or JPEG",
    "EXT_texture_avif": "with textures in PNG or JPEG",
}
SUPPORTED = {  # of those that a file may require; KHR_materials_... changes at most how light is reflected
    "KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "EXT_mesh_gpu_instancing", "KHR_lights_punctual",
    "KHR_xmp", "KHR_xmp_json_ld", "EXT_lights_ies", "EXT_lights_image_based", "MSFT_lod", "KHR_animation_pointer",
}  # fmt: skip


def prepared_gltf(path: Path, search: Neighbours) -> tuple[bytes, list[str]]:
    """The file as a GLB for trimesh, and remarks about what is not read.

    Args:
        path: A `.glb` or `.gltf`.
        search: Finds buffers and textures; textures that are missing are entered there.

    Raises:
        FileError: For what cannot be read rightly; other errors where the file is damaged.
    """
    tree, chunk = read_tree(path)
    _check_version(tree)
    _check_extensions(tree)
    buffers = _buffers(tree, chunk, search)
    remarks = _choose_scene(tree) + _remarks_on_motion(tree)
    accessors = Accessors(tree, buffers, MAX_NUMBERS)
    _expand_instances(tree, accessors)
    _write_out_numbers(tree, accessors)
    _check_textures(tree, accessors.buffer, search)
    carry_materials(tree)
    return _as_glb(tree, accessors.buffer), remarks


def read_tree(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON of a glTF file, and the binary chunk of a `.glb` (empty for `.gltf`)."""
    data = path.read_bytes()
    if data[:4] != b"glTF":
        return json.loads(data.decode("utf-8-sig")), b""
    if len(data) < 20:
        raise FileError(f"it cannot be read: it ends after {len(data)} bytes; copy or export it again")
    if int.from_bytes(data[4:8], "little") != 2:
        raise FileError("it is a glTF 1 file; export it as glTF 2.0")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + length > len(data):
            raise FileError(
                f"it cannot be read: it ends after {len(data)} bytes, within its data; copy or export it again"
            )
        chunks.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return json.loads(chunks[b"JSON"]), chunks.get(b"BIN\0", b"")


def _check_version(tree: dict[str, Any]) -> None:
    version = str(tree.get("asset", {}).get("version", "2.0"))
    if version.split(".")[0] != "2":
        raise FileError(f"it is glTF {version}; export it as glTF 2.0")


def _check_extensions(tree: dict[str, Any]) -> None:
    """Refuse a file that requires an extension that is not supported, or whose geometry is in one. Raises FileError."""
    required = list(tree.get("extensionsRequired", []))
    for primitive in _primitives(tree):
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
            position = tree["accessors"][primitive["attributes"]["POSITION"]]
            required += ["KHR_draco_mesh_compression"] * ("bufferView" not in position)
    for name in required:
        if name not in SUPPORTED and not str(name).startswith("KHR_materials_"):
            how = REMEDIES.get(name, "without it")
            raise FileError(f"it needs the glTF extension {name}, which is not supported; export it {how}")


def _primitives(tree: dict[str, Any]) -> list[dict[str, Any]]:
    return [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]


def _buffers(tree: dict[str, Any], chunk: bytes, search: Neighbours) -> list[bytes]:
    """The contents of the buffers: of files, of data URIs, or of the binary chunk."""
    buffers = []
    for buffer in tree.get("buffers", []):
        uri, name = buffer.get("uri"), "its binary chunk"
        if uri is None:
            data = chunk
        elif uri.startswith("data:"):
            data, name = data_of_uri(uri), "a buffer in it"
        else:
            found = search.find(uri)
            if found is None:
                raise FileError(f"it needs the file {uri!r}, which is not next to it; copy it there, or export as .glb")
            data, name = found.read_bytes(), f"its file {uri!r}"
        if len(data) < buffer["byteLength"]:
            raise FileError(f"{name} has {len(data)} bytes of {buffer['byteLength']}; copy or export it again")
        buffers.append(data)
    return buffers


def data_of_uri(uri: str) -> bytes:
    """The content of a data URI."""
    head, _, data = uri.partition(",")
    return base64.b64decode(data) if head.endswith(";base64") else unquote_to_bytes(data)


def _choose_scene(tree: dict[str, Any]) -> list[str]:
    """Keep the default scene; where there are no scenes, all nodes. Gives a remark about the others."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    for node in nodes:
        node.pop("camera", None)
    if not scenes:
        below = {child for node in nodes for child in node.get("children", [])}
        tree |= {"scene": 0, "scenes": [{"nodes": [i for i in range(len(nodes)) if i not in below]}]}
        return []
    chosen = tree.setdefault("scene", 0)
    names = [str(scene.get("name", i)) for i, scene in enumerate(scenes)]
    others = ", ".join(name for i, name in enumerate(names) if i != chosen)
    if not others:
        return []
    return [f"holds {len(scenes)} scenes; the default one ({names[chosen]}) is read, and not {others}"]


def _remarks_on_motion(tree: dict[str, Any]) -> list[str]:
    skins = any("skin" in node for node in tree.get("nodes", []))
    return ["holds a mesh with a skeleton, which is read in the pose that it was modelled in"] if skins else []


def _expand_instances(tree: dict[str, Any], accessors: Accessors) -> None:
    """Make a node of each instance of EXT_mesh_gpu_instancing."""
    names = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
    nodes = tree.get("nodes", [])
    for node in list(nodes):
        instancing = node.get("extensions", {}).pop("EXT_mesh_gpu_instancing", None)
        if instancing is None or "mesh" not in node:
            continue
        values = {names[key]: accessors.read(i) for key, i in instancing["attributes"].items() if key in names}
        count = max(map(len, values.values()), default=0)
        if len(nodes) + count > MAX_INSTANCES:
            raise FileError(f"it holds {len(nodes) + count:,} nodes and instances; up to {MAX_INSTANCES:,} are read")
        mesh = node.pop("mesh")
        children = [{"mesh": mesh} | {key: each[i].tolist() for key, each in values.items()} for i in range(count)]
        node["children"] = [*node.get("children", []), *range(len(nodes), len(nodes) + count)]
        nodes.extend(children)


def _write_out_numbers(tree: dict[str, Any], accessors: Accessors) -> None:
    """Write out what trimesh reads wrongly: normalised and sparse numbers, and fans and strips of triangles."""
    for primitive in _primitives(tree):
        attributes = primitive["attributes"]
        for name in [name for name in attributes if name == "POSITION" or name.startswith(("TEXCOORD_", "COLOR_"))]:
            attributes[name] = accessors.plain(attributes[name], keep_bytes=name.startswith("COLOR_"))
        attributes.pop("NORMAL", None)  # surfaces are flat here
        if "indices" in primitive:
            primitive["indices"] = accessors.plain(primitive["indices"])
        if primitive.get("mode", GL_TRIANGLES) in (GL_STRIP, GL_FAN):
            count = accessors.count(attributes["POSITION"])
            corners = accessors.read(primitive["indices"]).ravel() if "indices" in primitive else np.arange(count)
            primitive["indices"] = accessors.add(_triangles_of(corners, primitive["mode"]).reshape(-1, 1).astype("<u4"))
            primitive["mode"] = GL_TRIANGLES


def _triangles_of(corners: np.ndarray, mode: int) -> np.ndarray:
    """(n, 3) The triangles of a strip or a fan, with their fronts as the standard says."""
    n = max(len(corners) - 2, 0)
    i = np.arange(n)
    if mode == GL_FAN:
        return np.column_stack([corners[i + 1], corners[i + 2], np.repeat(corners[:1], n)])
    odd = i % 2
    return np.column_stack([corners[i], corners[i + 1 + odd], corners[i + 2 - odd]])


def _check_textures(tree: dict[str, Any], buffer: bytes, search: Neighbours) -> None:
    """Enter the textures of base colours that cannot be used, with the reason."""
    for material in tree.get("materials", []):
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        old = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness", {}).get("diffuseTexture")
        for used in filter(None, (texture, old)):
            image, other = _image_of(tree["textures"][used["index"]])
            if image is None:
                search.missing[f"texture {used['index']}"] = f"is only in the format {other}; export with PNG or JPEG"
                continue
            source = tree["images"][image]
            if "uri" in source and not source["uri"].startswith("data:"):
                search.check_image(source["uri"])
            elif "uri" in source:
                search.check_image(f"image {image} in it", data_of_uri(source["uri"]))
            else:
                view = tree["bufferViews"][source["bufferView"]]
                start = view.get("byteOffset", 0)
                search.check_image(f"image {image} in it", buffer[start : start + view["byteLength"]])


def _image_of(texture: dict[str, Any]) -> tuple[int | None, str]:
    """The number of a texture's image, or None and the extensions that hold it."""
    extensions = texture.get("extensions", {})
    image = extensions.get("EXT_texture_webp", {}).get("source", texture.get("source"))
    return image, ", ".join(extensions) or "of no image"


def _as_glb(tree: dict[str, Any], buffer: bytes) -> bytes:
    """A GLB of one buffer."""
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(buffer), len(text), 0x4E4F534A)
    return b"".join([head, text, struct.pack("<II", len(buffer), 0x004E4942), buffer])
