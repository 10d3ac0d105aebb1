"""Image databases: whatever is in their files, they are read, copied and completed, or refused, and nothing beside them is touched."""

import logging
import os
import shutil
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from fuzzing import FOLDER, VALUES, answer, damaged, holds, main
from hypothesis import given
from hypothesis import strategies as st

from tussock.render import Eye, open_renderer
from tussock.render.images.camera import Camera
from tussock.render.images.check import check_database
from tussock.render.images.database import read_database
from tussock.render.images.entries import ENTRIES
from tussock.render.images.importing import import_database
from tussock.render.images.metadata import METADATA, read_metadata, write_metadata
from tussock.render.images.pictures import read_image
from tussock.render.images.ring_search import find_ring
from tussock.render.images.writing import Grid, write_database
from tussock.world.geometry import Bounds
from tussock.world.scene import World

SHEET = b"""X [mm], Y [mm], Z [mm], Heading [degrees], Filename
100, 200, 10, 90, image_00000.png
200, 200, 10, 90, "image_00001.png"
300, 200, , 1e1, sub/image.png
"""
YAML = b"""%YAML:1.0
---
metadata:
   time: "2020-01-01"
   type: grid
   grid:
      beginAtMM: [ 0., 0., 10. ]
      separationMM: [ 100., 100., 0. ]
      size: [ 3, 1, 1 ]
   camera: { name: x, resolution: [ 4, 2 ], isPanoramic: 0 }
   needsUnwrapping: 0
   matrix: !!opencv-matrix
      rows: 1
      cols: 2
      dt: d
      data: [ 1., 2.5 ]
"""
JSONS = [
    b'{"metadata": {"type": "route", "list": [1, [2, {"a": "b"}]], "n": null, "x": 1e5}}',
    b'<?xml version="1.0"?><opencv_storage><metadata><type>route</type></metadata></opencv_storage>',
]
logging.disable()  # what is assumed about damaged files
SECRET = FOLDER / "secret.png"  # beside the databases
IMAGE = cv2.imencode(".png", np.arange(24, dtype=np.uint8).reshape(2, 4, 3))[1].tobytes()
SECRET.write_bytes(IMAGE)


def fresh(name: str, sheet: bytes = SHEET, yaml: bytes = YAML) -> Path:
    """A database with these files, and images that its rows name, a link out of it, and one in a circle."""
    folder = FOLDER / name
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "sub").mkdir(parents=True)
    (folder / ENTRIES).write_bytes(sheet)
    (folder / METADATA).write_bytes(yaml)
    for image in ("image_00000.png", "image_00001.png", "sub/image.png"):
        (folder / image).write_bytes(IMAGE)
    (folder / "link.png").symlink_to(SECRET)
    (folder / "outside").symlink_to(FOLDER)
    (folder / "circle.png").symlink_to("circle.png")
    return folder


def beside(*folders: Path) -> dict[str, bytes]:
    """All files but those of some folders."""
    return {
        str(path): path.read_bytes()
        for path in FOLDER.rglob("*")
        if path.is_file() and not any(each in path.parents for each in folders)
    }


def read_and_copied(folder: Path) -> None:
    """Read a database, its images, check it and copy it; nothing but the copy changes."""
    copy = FOLDER / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    before = beside()
    check_database(folder)
    database = answer(folder, lambda: read_database(folder))
    if database is not None:
        for name in filter(None, database.names):
            assert Path(os.path.realpath(folder / name)).is_relative_to(os.path.realpath(folder)), name
        answer(folder, database.views)
        answer(None, lambda: database.write(copy))
    assert beside(copy) == before


@holds(80)
@given(damaged([SHEET]) | st.binary(max_size=99), damaged([YAML, *JSONS]) | st.just(YAML) | st.binary(max_size=99))
def databases(sheet, yaml):
    read_and_copied(fresh("damaged", sheet, yaml))


parts = st.sampled_from(
    ["..", ".", "", "sub", "outside", "secret.png", "link.png", "circle.png", "image_00000.png", "named", str(FOLDER)]
)
names = (
    st.lists(parts, min_size=1, max_size=5).map("/".join) | st.text(max_size=20)
    | st.sampled_from(["a" * 300, "a/" * 3000, "\0", "a\nb.png", ENTRIES, METADATA, "\ud800", "/dev/zero", "/proc/self/environ", "é.png"])
)  # fmt: skip


@holds(80)
@given(st.lists(names, min_size=1, max_size=3))
def file_names(found):
    rows = "".join(f'{100 * i}, 200, 10, 90, "{name.replace(chr(34), chr(34) * 2)}"\n' for i, name in enumerate(found))
    sheet = SHEET.split(b"\n")[0] + b"\n" + rows.encode("utf-8", "surrogatepass")
    read_and_copied(fresh("named", sheet))


def encoded(image: np.ndarray) -> list[bytes]:
    """An image in the formats that can hold it."""
    found = []
    for kind in (".png", ".jpg", ".bmp", ".tiff", ".webp", ".jp2", ".hdr", ".pgm"):
        try:
            done, data = cv2.imencode(kind, image)
        except cv2.error:
            continue
        if done:
            found.append(data.tobytes())
    return found


def png_of_size(width: int, height: int) -> bytes:
    """A PNG that says it has a size, and holds no pixels of it."""
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0" * 99)),
        (b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )


KINDS = [
    (shape, dtype) for shape in [(1, 1), (5, 7), (5, 7, 3), (5, 7, 4)] for dtype in (np.uint8, np.uint16, np.float32)
]
IMAGES = [data for shape, dtype in KINDS for data in encoded(np.ones(shape, dtype))]
SIZES = st.sampled_from([0, 1, 2**14, 2**15, 2**16, 2**20, 2**31 - 1, 2**32 - 1])


@holds(160)
@given(damaged(IMAGES) | st.sampled_from(IMAGES) | st.binary(max_size=99) | st.builds(png_of_size, SIZES, SIZES))
def images(data):
    path = FOLDER / "image.png"
    path.write_bytes(data)
    image = answer(path, lambda: read_image(path))
    assert image is None or (image.dtype == np.uint8 and image.shape[2] in (3, 4))


metadata = st.dictionaries(
    st.text(max_size=5) | st.sampled_from(["type", "camera", "grid", "rows", "dt"]), VALUES, max_size=4
)


@holds(120)
@given(metadata)
def metadata_comes_back(kept):
    path = FOLDER / METADATA
    path.unlink(missing_ok=True)
    if answer(path, lambda: write_metadata(path, kept) or True):
        assert repr(read_metadata(path)) == repr(kept)
    else:
        assert not path.exists()


def video(width: int, height: int, count: int) -> bytes:
    """An AVI with some grey frames."""
    path = FOLDER / "made.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 15, (width, height))
    for i in range(count):
        writer.write(np.full((height, width, 3), 40 * i, np.uint8))
    writer.release()
    return path.read_bytes()


FILM = video(16, 8, 4)
FRAMES = b"Frame, X [mm], Y [mm], Heading [degrees]\n0, 0, 0, 90\n2, 10, 0, 90\n3, 20, 0, 90\n"
FILM_YAML = b'%YAML:1.0\n---\nmetadata:\n   type: route\n   videoFile: "film.avi"\n'


@holds(80)
@given(
    damaged([FRAMES]) | st.just(FRAMES),
    damaged([FILM_YAML]) | st.just(FILM_YAML),
    damaged([FILM]) | st.binary(max_size=99),
)
def videos(sheet, yaml, film):
    folder = fresh("film", sheet, yaml)
    (folder / "film.avi").write_bytes(film)
    read_and_copied(folder)


numbers_or_more = VALUES | st.floats() | st.integers(-(10**9), 10**9) | st.lists(st.floats(), max_size=3)
unwrappers = st.fixed_dictionaries(
    {},
    optional=dict.fromkeys(
        ("centre", "center", "inner", "outer", "offsetDegrees", "flip", "size", "mirrored"), numbers_or_more
    ),
)


@holds(120)
@given(unwrappers, numbers_or_more)
def raw_pictures(unwrapper, needs):
    metadata = {"type": "route", "unwrapper": {"centre": [0.5, 0.5], "inner": 0.1, "outer": 0.45} | unwrapper}
    folder = fresh("raw")
    (folder / METADATA).unlink()
    if answer(folder, lambda: write_metadata(folder / METADATA, metadata | {"needsUnwrapping": needs}) or True):
        read_and_copied(folder)


TRACK = b"""x_m,y_m,heading_deg,filename,frame,time_s
0,0,0,image_00000.png,0,0.5
1,0,0,image_00001.png,2,0.6
2,0.1,5,sub/image.png,3,0.7
"""
CALIBRATION = b"%YAML:1.0\n---\nK: [ 9., 0., 2., 0., 9., 1., 0., 0., 1. ]\nD: [ 0.1, 0., 0., 0. ]\nxi: 1.0\n"


@holds(80)
@given(
    damaged([TRACK]) | st.binary(max_size=99) | st.just(TRACK),
    damaged([CALIBRATION]) | st.just(CALIBRATION),
    st.sampled_from(["auto", "fisheye", "omnidirectional", "panorama", "equirectangular", "ring"]),
    st.booleans(),
)
def imports(table, calibration, lens, from_video):
    folder, out = fresh("imported"), FOLDER / "out"
    shutil.rmtree(out, ignore_errors=True)
    (folder / "film.avi").write_bytes(FILM)
    (FOLDER / "t.csv").write_bytes(table)
    (FOLDER / "c.yaml").write_bytes(calibration)
    source = folder / "film.avi" if from_video else folder
    others = (out, FOLDER / "copy")
    before = beside(*others)
    calibrated = lens in ("fisheye", "omnidirectional")
    camera = answer(
        None, lambda: Camera(lens=lens, width=8, height=2, calibration=FOLDER / "c.yaml" if calibrated else None)
    )
    if answer(None, lambda: import_database(out, source, FOLDER / "t.csv", camera)):
        read_and_copied(out)
    assert beside(*others) == before


@holds(80)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 40), st.sampled_from([0, 3, 100]))
def rings(seed, width, height, noise):
    rng = np.random.default_rng(seed)
    picture = np.clip(rng.integers(0, 256, 3) + rng.normal(0, noise, (height, width, 3)), 0, 255).astype(np.uint8)
    found = answer(None, lambda: find_ring([picture]))
    assert found is None or (np.isfinite(found.centre).all() and 0 <= found.inner < found.outer)


RENDERER = open_renderer(World.generate("tiny", 0), Eye(width=4, height=2, samples=1), "cpu")
GRID = Grid.over(Bounds(0, 0, 1, 1), 0.5)
DRAWN = write_database(FOLDER / "drawn", RENDERER, GRID)[0].folder


@holds(40)
@given(damaged([(DRAWN / ENTRIES).read_bytes()]), damaged([(DRAWN / METADATA).read_bytes()]) | st.none(), names)
def completing(sheet, yaml, name):
    folder = FOLDER / "completed"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(DRAWN, folder)
    (folder / ENTRIES).write_bytes(sheet)
    first = min(folder.glob("image_*.png"))
    first.unlink()
    first.symlink_to(SECRET)
    (folder / ".image_x.partial.png").symlink_to(SECRET)
    if yaml is not None:
        (folder / METADATA).write_bytes(yaml)
    before = beside(folder)
    answer(folder, lambda: write_database(folder, RENDERER, GRID))
    assert beside(folder) == before


@holds(80)
@given(st.tuples(*[st.floats()] * 4), st.floats())
def grids(bounds, spacing):
    grid = answer(None, lambda: Grid.over(Bounds(*bounds), spacing))
    if grid is not None:
        assert np.isfinite(grid.poses()).all()


if __name__ == "__main__":
    main()
