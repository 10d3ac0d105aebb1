"""The numbers in a glTF file: read from its accessors as the standard says, and added to it."""

from typing import Any

import numpy as np

from ..errors import FileError

KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
NUMBERS = {kind: number for number, kind in KINDS.items()}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Accessors:
    """The accessors of a glTF file, all of whose buffers are put into one.

    Attributes:
        parts: Contents of the one buffer, in their order; each begins at a multiple of 4 bytes.
    """

    def __init__(self, tree: dict[str, Any], buffers: list[bytes], most: int):
        """
        Args:
            tree: The JSON of the file. Its views are changed to the one buffer, accessors and views are added.
            buffers: Contents of its buffers.
            most: Numbers that accessors without data may claim.
        """
        self.parts, starts, self.size = [], [], 0
        self.list, self.views = tree.setdefault("accessors", []), tree.setdefault("bufferViews", [])
        for buffer in buffers:
            starts.append(self.size)
            self._append(buffer)
        sizes = [len(buffer) for buffer in buffers]
        for view in self.views:
            start, length = view.get("byteOffset", 0), view["byteLength"]
            if min(start, length) < 0 or start + length > sizes[view["buffer"]]:
                raise FileError("it cannot be read: its data end before they are complete; copy or export it again")
            view |= {"buffer": 0, "byteOffset": start + starts[view["buffer"]]}
        tree["buffers"] = [{"byteLength": self.size}]
        self.tree = tree
        self.joined = b"".join(self.parts)
        claimed = sum(a["count"] * WIDTHS[a["type"]] for a in self.list if "bufferView" not in a)
        if not claimed <= most:
            raise FileError(f"it claims {claimed} numbers and holds none of them; write it again")
        self.plain_ones: dict[tuple[int, bool], int] = {}

    @property
    def buffer(self) -> bytes:
        """The content of the one buffer."""
        return b"".join(self.parts)

    def count(self, index: int) -> int:
        """How many elements an accessor has."""
        return int(self.list[index]["count"])

    def read(self, index: int) -> np.ndarray:
        """(count, width) The numbers of an accessor; those that are normalised as floats from -1 or 0 to 1."""
        accessor = self.list[index]
        kind, width = np.dtype(KINDS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        values = self._block(accessor, accessor["count"], kind, width)
        if "sparse" in accessor:
            sparse, values = accessor["sparse"], values.copy()
            rows = self._block(
                sparse["indices"], sparse["count"], np.dtype(KINDS[sparse["indices"]["componentType"]]), 1
            )
            values[rows.ravel()] = self._block(sparse["values"], sparse["count"], kind, width)
        if accessor.get("normalized") and kind.kind in "iu":
            values = np.maximum(values / np.iinfo(kind).max, -1.0).astype("<f4")
        return values

    def _block(self, where: dict[str, Any], count: int, kind: np.dtype, width: int) -> np.ndarray:
        """Numbers in a view, which may be interleaved with others."""
        if "bufferView" not in where:
            return np.zeros((count, width), kind)
        view, row = self.views[where["bufferView"]], kind.itemsize * width
        stride = view.get("byteStride", row)
        start = where.get("byteOffset", 0)
        if not (
            count > 0 and start >= 0 and stride >= row and start + (count - 1) * stride + row <= view["byteLength"]
        ):
            raise FileError("it cannot be read: its data end before they are complete; copy or export it again")
        return np.ndarray((count, width), kind, self.joined, view["byteOffset"] + start, (stride, kind.itemsize))

    def plain(self, index: int, *, keep_bytes: bool = False) -> int:
        """An accessor with the same numbers that is neither sparse nor normalised; itself where it is so.

        keep_bytes: normalised bytes stay bytes, as trimesh takes them as colours.
        """
        if (index, keep_bytes) not in self.plain_ones:
            accessor = self.list[index]
            values = self.read(index)  # refuses numbers that are not there
            normalised = accessor.get("normalized") and accessor["componentType"] not in (5126, *[5121] * keep_bytes)
            changed = normalised or "sparse" in accessor
            self.plain_ones[index, keep_bytes] = self.add(values) if changed else index
        return self.plain_ones[index, keep_bytes]

    def add(self, values: np.ndarray) -> int:
        """Add an accessor with numbers. Returns its index."""
        kind = values.dtype.newbyteorder("<").str if values.dtype.itemsize > 1 else f"<{values.dtype.str[1:]}"
        data = np.ascontiguousarray(values).tobytes()
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(data)})
        view = {"bufferView": len(self.views) - 1, "componentType": NUMBERS[kind], "count": len(values)}
        self.list.append(view | {"type": TYPES[values.shape[1]]})
        self._append(data)
        self.tree["buffers"] = [{"byteLength": self.size}]
        return len(self.list) - 1

    def _append(self, data: bytes) -> None:
        padding = b"\0" * (-len(data) % 4)
        self.parts += [data, padding]
        self.size += len(data) + len(padding)
