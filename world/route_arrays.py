"""Arrays from MATLAB's .mat (up to version 7) and numpy's .npy and .npz, by name. What a file claims of its sizes is checked first."""

import io
import math
import struct
import warnings
import zipfile
import zlib

import numpy as np

from .errors import FileError, first_line

MAX_UNPACKED = 2**28  # bytes of a compressed variable
MAX_NESTED = 20  # structs in structs
COMPRESSED, MATRIX = 15, 14  # data types of MAT-files


def read_mat(data: bytes) -> dict[str, np.ndarray]:
    """The numeric arrays in a MAT-file, those in structs as struct.field. Raises FileError."""
    if b"MATLAB 7.3" in data[:32] or data[512:516] == b"\x89HDF":
        raise FileError("it is a MAT-file of version 7.3 (HDF5); save it with -v7, or as CSV")
    if data.startswith(b"MATLAB 5.0"):
        order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
        if order is None:
            raise FileError("it is a damaged MAT-file; save it again with -v7")
        _check_elements(data[128:], order, 0)
    else:
        _check_version_4(data)
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            variables = loadmat(
                io.BytesIO(data), squeeze_me=True, struct_as_record=False, verify_compressed_data_integrity=False
            )
    except Exception as error:  # scipy raises whatever its parser raises
        raise FileError(f"it cannot be read as a MAT-file ({first_line(error)})") from error
    return _flat({name: value for name, value in variables.items() if not name.startswith("__")})


def _flat(values: dict, prefix: str = "", depth: int = 0) -> dict[str, np.ndarray]:
    """Numeric arrays in variables and in the fields of structs."""
    arrays = {}
    for name, value in values.items():
        if hasattr(value, "_fieldnames") and depth < MAX_NESTED:
            arrays |= _flat(
                {field: getattr(value, field) for field in value._fieldnames}, f"{prefix}{name}.", depth + 1
            )
        elif isinstance(value, np.ndarray) and value.dtype.kind in "iufb" and value.size > 1:
            arrays[prefix + name] = value.astype(np.float64)
    return arrays


def _check_elements(data: bytes, order: str, depth: int) -> None:
    """Refuse elements of a MAT-file that claim more than is there, as a reader allocates what they claim."""
    damaged = FileError("it is a damaged MAT-file: a part claims more than the file holds; save it again with -v7")
    if depth > MAX_NESTED:
        raise damaged
    position, index = 0, 0
    while position + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, position)
        if kind >> 16:  # a small element: its size, its type and up to 4 bytes
            if kind >> 16 > 4:
                raise damaged
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, position + 4, position + 8
        else:
            begin = position + 8
            end = begin + size + (-size % 8 if kind != COMPRESSED else 0)
        if begin + size > len(data):
            raise damaged
        part = data[begin : begin + size]
        if kind == COMPRESSED:
            _check_elements(_unpacked(part), order, depth + 1)
        elif kind == MATRIX:
            _check_elements(part, order, depth + 1)
        elif index == 1 and depth and kind == 5:  # the second part of a matrix: its dimensions
            sizes = struct.unpack(f"{order}{size // 4}i", part[: size // 4 * 4])
            if any(each < 0 for each in sizes) or math.prod(sizes) > len(data):
                raise damaged
        position, index = end, index + 1


def _unpacked(part: bytes) -> bytes:
    inflate = zlib.decompressobj()
    try:
        unpacked = inflate.decompress(part, MAX_UNPACKED)
    except zlib.error as error:
        raise FileError(f"it is a damaged MAT-file ({error}); save it again with -v7") from error
    if not inflate.eof:
        raise FileError(
            "it is a damaged MAT-file: a compressed part is incomplete or too large; save it again with -v7"
        )
    return unpacked


def _check_version_4(data: bytes) -> None:
    """Refuse what is not a MAT-file of version 4, or claims more than it holds."""
    position = 0
    while position < len(data):
        if position + 20 > len(data):
            raise FileError("it is not a MAT-file, or damaged; save it again with -v7")
        kind, rows, columns, complex_, name = struct.unpack_from("<5i", data, position)
        size = {0: 8, 1: 4, 2: 4, 3: 2, 4: 2, 5: 1}.get(kind // 10 % 10)
        if not (0 <= kind < 1000 and size) or min(rows, columns, name) < 0 or complex_ not in (0, 1):
            raise FileError("it is not a MAT-file, or damaged; save it again with -v7")
        position += 20 + name + rows * columns * size * (1 + complex_)
    if position != len(data):
        raise FileError("it is a damaged MAT-file: it claims more than it holds; save it again with -v7")


def read_npy(data: bytes) -> dict[str, np.ndarray]:
    """The array in a .npy, or its fields where it is a structured one. Raises FileError."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(stream)
        if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
            raise ValueError("it has objects, or another size than it claims")
        array = np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape, order="F" if fortran else "C")
    except Exception as error:  # numpy evaluates the header as Python, which raises anything
        raise FileError(f"it cannot be read as .npy ({first_line(error)})") from error
    if dtype.names:
        return {name: array[name].astype(np.float64) for name in dtype.names if array[name].dtype.kind in "iuf"}
    return {"array": array.astype(np.float64)} if dtype.kind in "iuf" and array.size > 1 else {}


def read_npz(data: bytes) -> dict[str, np.ndarray]:
    """The numeric arrays in a .npz by their names. Raises FileError."""
    arrays = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for member in archive.infolist():
                if member.filename.endswith(".npy"):
                    with archive.open(member) as file:
                        content = file.read(MAX_UNPACKED + 1)
                    if len(content) > MAX_UNPACKED:
                        raise FileError(
                            f"{member.filename} is larger than {MAX_UNPACKED >> 20} MB; give an array of points"
                        )
                    name = member.filename.removesuffix(".npy")
                    arrays |= {
                        name if key == "array" else f"{name}.{key}": each for key, each in read_npy(content).items()
                    }
    except FileError:
        raise
    except Exception as error:  # zipfile raises errors of zlib, struct and others
        raise FileError(f"it cannot be read as .npz ({first_line(error)})") from error
    return arrays
