"""PLY files before trimesh reads them: polygons of any kind become triangles, and text keeps all its digits."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from .ply_header import Element, Header, Property, read_header, rows_of
from .polygons import triangulated

NAMES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}
CORNERS = ("vertex_indices", "vertex_index")
DAMAGED = "it cannot be read: its data are not as long as its header says; copy or export it again"


def prepared_ply(path: Path) -> tuple[bytes, Header]:
    """The file as trimesh reads it, with triangles only; and its header."""
    data = path.read_bytes()
    header = read_header(data)
    if any(element.name == "tristrips" and element.length for element in header.elements):
        raise FileError(
            "its triangles are in strips (tristrips), which are not read; open it in MeshLab or CloudCompare and save it again"
        )
    if header.order and _holds_triangles_alone(header, data):
        return data, header
    columns = _read(header, data)
    faces = columns.get("face", {})
    corners = next((faces[name] for name in CORNERS if name in faces), None)
    if corners is None or "vertex" not in columns:
        return data, header
    return _written(header, columns["vertex"], faces, corners), header


def _holds_triangles_alone(header: Header, data: bytes) -> bool:
    """Whether trimesh reads the file rightly as it is: all lists of an element are equally long, and faces are triangles."""
    at = header.end
    for element in header.elements:
        numbers: dict[str, int] = {}
        for each in element.properties:
            if each.count is not None:  # as long as in the first row
                kind = np.dtype(header.order + each.count)
                start = at + rows_of(header, _before(element, each), numbers).itemsize
                if start + kind.itemsize > len(data):
                    return False
                numbers[each.name] = int(np.frombuffer(data, kind, 1, start)[0])
        rows = rows_of(header, element, numbers)
        if (
            any(numbers.get(name, 3) != 3 for name in CORNERS)
            or not 0 <= element.length * rows.itemsize <= len(data) - at
        ):
            return False
        table = np.frombuffer(data, rows, element.length, at)
        if any((table[f"count of {name}"] != number).any() for name, number in numbers.items()):
            return False
        at += element.length * rows.itemsize
    return at == len(data)


def _before(element: Element, last: Property) -> Element:
    """An element with only the properties before one of its own."""
    return Element(element.name, element.length, element.properties[: element.properties.index(last)])


def _read(header: Header, data: bytes) -> dict[str, dict[str, Any]]:
    """The elements: for each property an array, or for a list the pair of all its values and how many each has."""
    words = data[header.end :].split() if not header.order else []
    at, columns = header.end if header.order else 0, {}
    for element in header.elements:
        values: dict[str, Any]
        if all(each.count is None for each in element.properties):
            values, at = _read_table(header, element, data, words, at)
        elif header.order:
            values, at = _read_binary_rows(header, element, data, at)
        else:
            values, at = _read_text_rows(element, words, at)
        columns[element.name] = values
    return columns


def _read_table(
    header: Header, element: Element, data: bytes, words: list[bytes], at: int
) -> tuple[dict[str, Any], int]:
    """An element without lists."""
    names = [each.name for each in element.properties]
    if header.order:
        rows = np.dtype([(each.name, header.order + each.kind) for each in element.properties])
        end = at + element.length * rows.itemsize
        if not at <= end <= len(data):
            raise FileError(DAMAGED)
        table = np.frombuffer(data, rows, element.length, at)
        return {name: table[name] for name in names}, end
    end = at + element.length * len(names)
    if not at <= end <= len(words):
        raise FileError(DAMAGED)
    table = np.array(words[at:end], dtype=np.float64).reshape(element.length, len(names))
    kinds = ["f8" if each.kind == "f4" else each.kind for each in element.properties]  # text may have more digits
    return {name: table[:, i].astype(kinds[i]) for i, name in enumerate(names)}, end


def _read_binary_rows(header: Header, element: Element, data: bytes, at: int) -> tuple[dict[str, Any], int]:
    """An element with lists: where its rows begin is found one by one, then rows that are equally long are read together."""
    starts, counts, at = _find_rows(header, element, data, at)
    lists = [each.name for each in element.properties if each.count is not None]
    offsets = {name: np.cumsum(counts[:, i]) - counts[:, i] for i, name in enumerate(lists)}
    columns: dict[str, Any] = {
        each.name: np.empty(len(starts) if each.count is None else counts[:, lists.index(each.name)].sum(), each.kind)
        for each in element.properties
    }
    content = np.frombuffer(data, np.uint8)
    shapes, shape_of = np.unique(counts, axis=0, return_inverse=True)
    for i, shape in enumerate(shapes):
        numbers = dict(zip(lists, shape.tolist(), strict=True))
        rows = np.flatnonzero(shape_of.ravel() == i)
        kind = rows_of(header, element, numbers)
        table = content[starts[rows, None] + np.arange(kind.itemsize)].copy().view(kind)[:, 0]
        for each in element.properties:
            if each.count is None:
                columns[each.name][rows] = table[each.name]
            else:
                columns[each.name][offsets[each.name][rows, None] + np.arange(numbers[each.name])] = table[each.name]
    return {
        name: (values, counts[:, lists.index(name)]) if name in lists else values for name, values in columns.items()
    }, at


def _find_rows(header: Header, element: Element, data: bytes, at: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Where each row of an element begins, (rows, lists) how long its lists are, and where the element ends."""
    order = "little" if header.order == "<" else "big"
    lists, gap = [], 0  # bytes before a list's count, of the count, and of one value
    for each in element.properties:
        size = np.dtype(each.kind).itemsize
        if each.count is None:
            gap += size
        else:
            lists.append((gap, np.dtype(each.count).itemsize, size))
            gap = 0
    starts, counts = [], []
    for _ in range(element.length):
        starts.append(at)
        for before, width, size in lists:
            number = int.from_bytes(data[at + before : at + before + width], order)
            counts.append(number)
            at += before + width + number * size
        at += gap
        if at > len(data):
            raise FileError(DAMAGED)
    return np.array(starts, np.int64), np.array(counts, np.int64).reshape(-1, len(lists)), at


def _read_text_rows(element: Element, words: list[bytes], at: int) -> tuple[dict[str, Any], int]:
    """An element of a text file with lists, row by row."""
    parts: list[list[np.ndarray]] = [[] for _ in element.properties]
    for _ in range(element.length):
        for each, values in zip(element.properties, parts, strict=True):
            number = 1
            if each.count is not None:
                if at >= len(words):
                    raise FileError(DAMAGED)
                number = int(words[at])
                at += 1
            if number < 0 or at + number > len(words):
                raise FileError(DAMAGED)
            values.append(np.array(words[at : at + number], dtype=np.float64).astype(each.kind))
            at += number
    return _as_columns(element, parts), at


def _as_columns(element: Element, parts: list[list[np.ndarray]]) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for each, values in zip(element.properties, parts, strict=True):
        flat = np.concatenate(values) if values else np.empty(0, each.kind)
        columns[each.name] = (
            flat if each.count is None else (flat, np.array([len(row) for row in values], dtype=np.int64))
        )
    return columns


def _written(
    header: Header, vertices: dict[str, Any], faces: dict[str, Any], corners: tuple[np.ndarray, np.ndarray]
) -> bytes:
    """A binary PLY of the vertices, and of triangles that have the properties of their faces."""
    index, counts = corners
    points = np.column_stack([vertices[axis] for axis in "xyz"]).astype(np.float64)
    if len(index) and not 0 <= index.min() <= index.max() < len(points):
        raise FileError(f"a face has corner {index.max()} of {len(points)}; export it again")
    triangles, face = triangulated(points[index.astype(np.int64)], counts)
    columns: dict[str, np.ndarray] = {"vertex_indices": index[triangles].astype("<i4")}
    for name, values in faces.items():
        if not isinstance(values, tuple):
            columns[name] = values[face]
        elif name not in CORNERS and len(counts) and np.array_equal(values[1] * counts[0], counts * values[1][0]):
            width = int(values[1][0] // counts[0])  # numbers of each corner, such as texture coordinates
            columns[name] = values[0].reshape(len(index), width)[triangles].reshape(len(triangles), -1)
    plain = {name: values for name, values in vertices.items() if not isinstance(values, tuple)}
    texts = [f"comment {each}" for each in header.comments]
    head = "\n".join(
        ["ply", "format binary_little_endian 1.0", *texts, *_declared("vertex", plain), *_declared("face", columns)]
    )
    return f"{head}\nend_header\n".encode() + _packed(plain) + _packed(columns)


def _declared(element: str, columns: dict[str, np.ndarray]) -> list[str]:
    lines = [f"element {element} {len(next(iter(columns.values())))}"]
    for name, values in columns.items():
        kind = NAMES[values.dtype.str[1:]]
        lines.append(f"property {kind} {name}" if values.ndim == 1 else f"property list uchar {kind} {name}")
    return lines


def _packed(columns: dict[str, np.ndarray]) -> bytes:
    """The rows of an element, little-endian."""
    fields: list[tuple] = []
    for name, values in columns.items():
        kind = f"<{values.dtype.str[1:]}"
        fields += [(name, kind)] if values.ndim == 1 else [(f"count of {name}", "u1"), (name, kind, values.shape[1:])]
    rows = np.empty(len(next(iter(columns.values()))), np.dtype(fields))
    for name, values in columns.items():
        rows[name] = values
        if values.ndim > 1:
            rows[f"count of {name}"] = values.shape[1]
    return rows.tobytes()
