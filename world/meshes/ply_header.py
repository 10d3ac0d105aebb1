"""The headers of PLY files."""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import FileError

COMMENT_LENGTH = 900  # characters of a line of data
KINDS = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip


@dataclass
class Property:
    """A property of an element: its kind, and the kind of the count before it where it is a list."""

    name: str
    kind: str
    count: str | None = None


@dataclass
class Element:
    """An element of a PLY: its name, how many there are, and its properties."""

    name: str
    length: int
    properties: list[Property]


@dataclass
class Header:
    """The header of a PLY.

    Attributes:
        order: "<" or ">" for binary files, "" for text.
        elements: In the order of the file.
        comments: Its comment lines.
        end: Where the data begin (bytes).
    """

    order: str
    elements: list[Element]
    comments: list[str]
    end: int

    def comment(self, key: str) -> Any:
        """The JSON in the comments that begin with a key, or None. Raises FileError where it is damaged."""
        parts = [line[len(key) + 1 :] for line in self.comments if line.startswith((f"{key} ", f"{key}+"))]
        if not parts:
            return None
        try:
            return json.loads("".join(part.strip() for part in parts))
        except (ValueError, RecursionError) as error:
            raise FileError(f"its {key} comment is damaged; write the world again") from error

    def stores_float32(self) -> bool:
        """Whether the corners are stored with 24 bits."""
        kinds = {
            each.kind
            for element in self.elements
            if element.name == "vertex"
            for each in element.properties
            if each.name in "xyz"
        }
        return bool(self.order) and "f4" in kinds


def comments_of(key: str, data: Any) -> str:
    """Comment lines that hold data as JSON, see `Header.comment`. The lines are short, as some programs cut long ones."""
    text = json.dumps(data, separators=(",", ":")).replace(" ", "\\u0020")  # no line begins or ends with a space
    parts = [text[at : at + COMMENT_LENGTH] for at in range(0, len(text), COMMENT_LENGTH)]
    return "".join(f"comment {key}{'+' if i else ' '}{part}\n" for i, part in enumerate(parts))


def read_header(data: bytes) -> Header:
    order, elements, comments, at = "", [], [], 0
    while True:
        end = data.find(b"\n", at)
        if end < 0:
            raise FileError("it cannot be read as PLY: its header does not end; copy or export it again")
        line = data[at:end].decode("utf-8", errors="replace").strip()
        words = line.split() or [""]
        at = end + 1
        if words[0] == "end_header":
            return Header(order, elements, comments, at)
        if words[0] == "format":
            order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[words[1]]
        elif words[0] in ("comment", "obj_info"):
            comments.append(line.partition(" ")[2])
        elif words[0] == "element":
            elements.append(Element(words[1], int(words[2]), []))
        elif words[0] == "property" and words[1] == "list":
            elements[-1].properties.append(Property(words[4], KINDS[words[3]], KINDS[words[2]]))
        elif words[0] == "property":
            elements[-1].properties.append(Property(words[2], KINDS[words[1]]))


def rows_of(header: Header, element: Element, numbers: dict[str, int]) -> np.dtype:
    """The rows of an element whose lists have these lengths."""
    fields: list[tuple] = []
    for each in element.properties:
        if each.count is None:
            fields.append((each.name, header.order + each.kind))
        else:
            shape = (numbers[each.name],)
            fields += [
                (f"count of {each.name}", header.order + each.count),
                (each.name, header.order + each.kind, shape),
            ]
    return np.dtype(fields)
