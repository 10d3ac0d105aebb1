"""OBJ and MTL files before trimesh reads them: what people write and trimesh misreads is written as it reads it."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import FileError
from .polygons import triangulated
from .search import Neighbours

LIBRARY = "tussock.mtl"  # name of all material files together, in what trimesh is given
MAP_OPTIONS = {  # of a texture in an MTL file, and how many values follow
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-colorspace": 1, "-imfchan": 1, "-mm": 2, "-o": 3, "-s": 3,
    "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
OPTIONAL_VALUES = ("-o", "-s", "-t")  # of their three values, the last two may be left out
HEAD = 4096  # bytes in which a unit may be stated
UNIT_NAMES = {
    name: unit
    for unit, names in {
        "mm": "mm millimeters millimetres",
        "cm": "cm centimeters centimetres",
        "m": "m meters metres",
        "in": "in inch inches",
        "ft": "ft foot feet",
    }.items()
    for name in names.split()
}
USED_MAPS = ("map_kd", "map_d")
FACES_WITHOUT_TEXTURE = re.compile(r"\nf(?: +\d+(?://\d+)?)+ *(?=\n)")  # none of their corners has a place in a texture


def prepared_obj(path: Path, search: Neighbours) -> tuple[bytes, list[str]]:
    """The file as trimesh reads it: plain lines, absolute indices, and one material file with plain names.

    What it names and is not found is entered in `search.missing`. Also gives remarks about what is not read.
    """
    text = decoded(path.read_bytes()).replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")
    text = f"\n{text}\n"
    text = re.sub(r"\n[ \t]+", "\n", text) if "\n " in text or "\n\t" in text else text
    if "\t" in text:
        text = text.replace("\t", " ")
    if "#" in text:
        text = re.sub(r"\n#[^\n]*", "\n", text)
        text = re.sub(r"\n((?:v|vt|vn|f) [^#\n]*)#[^\n]*", r"\n\1", text)
    other = None if "\nf " in text else re.search(r"\n(l|curv|curv2|surf) ", text)
    if other:
        content = "lines" if other[1] == "l" else "free-form curves and surfaces"
        raise FileError(f"it holds no triangles, only {content}; export it with surfaces as polygons")
    if re.search(r"\nf[^\n]*-", text):
        text = "\n".join(_with_absolute_indices(text.split("\n")))
    libraries = [name.strip() for name in re.findall(r"\nmtllib +([^\n]*)", text)]
    if libraries:
        text = f"\nmtllib {LIBRARY}" + re.sub(r"\nmtllib [^\n]*", "", text)
    used = {name.strip() for name in re.findall(r"\nusemtl +([^\n]*)", text)}
    materials = _materials(libraries, used, search)
    search.texts[LIBRARY] = materials.encode()
    remarks = []
    if FACES_WITHOUT_TEXTURE.search(text):
        remarks = _remarks_on_faces(text, materials)
        if re.search(r"\nf +\d+/\d", text):
            text = _with_texture_coordinates(text)
    if re.search(r"\nf(?: +\S+){5}", text):
        text = _without_polygons(text)
    return text.encode(), remarks


def stated_unit(path: Path) -> str | None:
    """The unit in the comments before the first vertex, as SketchUp writes it ("# File units = inches"), or None."""
    with path.open("rb") as file:
        head = file.read(HEAD).decode("latin-1").partition("\nv ")[0]
    stated = re.search(r"^#\s*(?:file )?units?\s*[=:]\s*([a-z]+)\s*$", head, re.IGNORECASE | re.MULTILINE)
    return UNIT_NAMES.get(stated[1].lower()) if stated else None


def decoded(data: bytes) -> str:
    """The text in a file: UTF-8, UTF-16 with a mark, or Latin-1."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").lstrip("\ufeff")
    try:
        return data.decode().lstrip("\ufeff")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _with_absolute_indices(lines: list[str]) -> Iterator[str]:
    """The lines, with the indices of faces counted from the start of the file; -1 is the vertex before the face."""
    counts = {"v": 0, "vt": 0, "vn": 0}
    for line in lines:
        word = line.split(" ", 1)[0]
        if word in counts:
            counts[word] += 1
        elif word == "f":
            totals = tuple(counts.values())
            corners = [zip(corner.split("/"), totals, strict=False) for corner in line.split()[1:]]
            line = "f " + " ".join(
                "/".join(str(int(i) + 1 + total) if i.startswith("-") else i for i, total in corner)
                for corner in corners
            )
        yield line


def _with_texture_coordinates(text: str) -> str:
    """The text, with the place 0 0 in the texture for faces that have none: trimesh drops the texture of all faces otherwise."""
    number = len(re.findall(r"\nvt ", text)) + 1
    corner = re.compile(r" (\d+)(?:/(/\d+))?")
    text = FACES_WITHOUT_TEXTURE.sub(lambda face: corner.sub(rf" \1/{number}\2", face[0]), text)
    return f"{text}vt 0 0\n"


def _remarks_on_faces(text: str, materials: str) -> list[str]:
    """How many faces of which material have a texture and no place in it."""
    textured = {
        block.partition("\n")[0]
        for block in f"\n{materials}".split("\nnewmtl ")[1:]
        if any(line.lower().startswith(tuple(f"{key} " for key in USED_MAPS)) for line in block.split("\n"))
    }
    counts: Counter[str] = Counter()
    for block in text.split("\nusemtl ")[1:]:
        name, _, lines = block.partition("\n")
        if name.strip() in textured:
            counts[name.strip()] += len(FACES_WITHOUT_TEXTURE.findall(f"\n{lines}\n"))
    return [
        f"has no texture coordinates (vt) for {count:,} of the faces with material {name!r}, so each of these is drawn in one colour"
        for name, count in counts.items()
        if count
    ]


def _without_polygons(text: str) -> str:
    """The text, with faces of five and more corners as triangles."""
    vertices = np.array([line.split()[:3] for line in re.findall(r"\nv +([^\n]*)", text)], dtype=float)
    faces = [line.split() for line in re.findall(r"\nf((?: +\S+){5,})", text)]
    index = np.array([int(corner.split("/")[0]) - 1 for face in faces for corner in face])
    counts = np.array([len(face) for face in faces])
    triangles, polygon = triangulated(vertices[index], counts)
    corners = [corner for face in faces for corner in face]
    lines: list[list[str]] = [[] for _ in faces]
    for triangle, number in zip(triangles.tolist(), polygon.tolist(), strict=True):
        lines[number].append("\nf " + " ".join(corners[i] for i in triangle))
    parts = iter(lines)
    return re.sub(r"\nf(?: +\S+){5,}", lambda _: "".join(next(parts)), text)


def _materials(libraries: list[str], used: set[str], search: Neighbours) -> str:
    """All material files as one, in which textures have plain names."""
    lines: list[str] = []
    complete = True
    for library in libraries:
        for name in [library] if search.find(library) is not None else _file_names(library, search):
            path = search.find(name)
            if path is None:
                search.missing[name], complete = "is not found next to the file", False
            else:
                lines += _material_lines(decoded(path.read_bytes()), search)
    known = {line.split(" ", 1)[1] for line in lines if line.startswith("newmtl ")}
    if complete:
        where = "is in none of its material files" if libraries else "is in no material file: it names none (mtllib)"
        search.missing |= {f"material {name}": where for name in sorted(used - known)}
    return "\n".join(lines)


def _file_names(library: str, search: Neighbours) -> list[str]:
    """The names in an mtllib line that is not one name: several, or one with spaces that is not found."""
    names = library.split()
    return names if any(search.find(name) is not None for name in names) else [library]


def _material_lines(text: str, search: Neighbours) -> Iterator[str]:
    """The lines of a material file, with plain names of textures; those that are not found are left out."""
    for line in text.splitlines():
        key, _, rest = (
            line.strip().partition(" ") if "\t" not in line else line.strip().replace("\t", " ").partition(" ")
        )
        if key.lower() == "newmtl":
            yield f"newmtl {' '.join(rest.split())}"
        elif key.lower() not in USED_MAPS:
            yield f"{key} {rest}"
        else:
            options, name = map_options(rest)
            if name and search.check_image(name):
                yield f"{key} {name}"
                yield from (f"{key.lower()}{option} {' '.join(values)}" for option, values in options.items())


def map_options(rest: str) -> tuple[dict[str, list[str]], str]:
    """The options and the file name of a texture in an MTL file, such as "-s 2 2 1 maps/my wall.png"."""
    options, rest = {}, rest.strip()
    while (option := rest.split(" ", 1)[0].lower()) in MAP_OPTIONS:
        rest, values = rest[len(option) :].lstrip(), []
        while rest and len(values) < MAP_OPTIONS[option]:
            value, _, after = rest.partition(" ")
            if option in OPTIONAL_VALUES and values and not _is_number(value):
                break
            values.append(value)
            rest = after.lstrip()
        options[option] = values
    return options, rest.strip("\"'")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
