"""Image databases: what is written is read back to the last bit, also after interruptions; published databases can be read."""

import json
import logging
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from commands import Process
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tussock.navigation.cli.databases import DatabaseGridCommand
from tussock.navigation.cli.main import main
from tussock.render.eye import Eye
from tussock.render.images.check import check_database
from tussock.render.images.database import Database, read_database
from tussock.render.images.entries import ENTRIES, stored_poses
from tussock.render.images.metadata import METADATA, read_metadata, write_metadata
from tussock.render.images.pictures import read_image
from tussock.render.images.writing import Grid, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError, SettingError
from tussock.world.geometry import Bounds, wrap_angle
from tussock.world.scene import World

WORLD = World.generate("tiny", 1)
EYE = Eye(width=24, height=6)
GRID = Grid(begin=(0.2, 0.4), spacing=0.2, size=(5, 3))
ROUTE = np.column_stack([np.linspace(0.5, 2.5, 9), np.full(9, 1.0), np.zeros(9)])


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(WORLD, EYE, "cpu") as renderer:
        yield renderer


class BlackRenderer:
    """A renderer of black views, which takes no time."""

    backend = "cpu"

    def __init__(self, eye: Eye = EYE):
        self.world, self.eye = WORLD, eye

    def render(self, poses):
        return np.zeros((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)

    def close(self): ...

    def __enter__(self):
        return self

    def __exit__(self, *_): ...


def contents(folder: Path) -> dict[str, bytes]:
    """All files under a folder, the metadata without its time."""
    files = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return files | {METADATA: re.sub(rb" time: .*", b"", files[METADATA])}


# Writing, and reading back.

numbers = st.floats(-1e5, 1e5)
angles = st.one_of(
    st.floats(-1e3, 1e3), st.sampled_from([np.pi, -np.pi, np.pi / 2, -1e-13, np.nextafter(np.pi, 0), 0.0])
)
positions = st.lists(st.tuples(numbers, numbers, angles), min_size=1, max_size=4)


@settings(derandomize=True)
@given(positions)
@example([(0.0005 / 3, -1e-13, np.radians(90.0000000001)), (0.1 + 0.2, -0.0, -np.pi / 2)])
@example([(63 / 10, 8.45, np.pi / 2 - np.radians(359.9999999999)), (1 / 3, 2 / 3, np.pi / 2 + 1e-14)])
def test_poses_are_read_back_to_the_last_bit(tmp_path_factory, positions):
    stored = stored_poses(positions)
    assert stored_poses(stored).tobytes() == stored.tobytes()
    assert np.abs(stored[:, :2] - np.array(positions)[:, :2]).max() <= 0.51e-9
    assert np.abs(wrap_angle(stored[:, 2] - np.array(positions)[:, 2])).max() <= np.radians(0.51e-9)
    assert (stored[:, 2] >= -np.pi).all()
    assert (stored[:, 2] < np.pi).all()
    database, rendered = write_database(tmp_path_factory.mktemp("w") / "d", BlackRenderer(), positions)
    assert rendered == len(positions)
    assert database.poses.tobytes() == stored.tobytes()


def test_the_files_of_a_grid(tmp_path, renderer):
    database, rendered = write_database(tmp_path / "new" / "g", renderer, GRID)
    assert rendered == len(database) == 15
    lines = (tmp_path / "new" / "g" / ENTRIES).read_text().splitlines()
    assert lines[0] == (
        "X [mm], Y [mm], Z [mm], Heading [degrees], Pitch [degrees], Roll [degrees], Filename, Grid X, Grid Y, Grid Z"
    )
    assert lines[2] == "400, 400, 10, 90, 0, 0, image_+000400_+000400_+000010.png, 1, 0, 0"
    assert (tmp_path / "new" / "g" / METADATA).read_text().startswith("%YAML:1.0\n---\nmetadata:\n   time: ")
    metadata = database.metadata
    assert (database.kind, metadata["type"]) == ("grid", "grid")
    assert metadata["grid"] == {
        "beginAtMM": [200.0, 400.0, 10.0], "separationMM": [200.0, 200.0, 0.0], "size": [5, 3, 1],
    }  # fmt: skip
    assert metadata["camera"] == {"name": "tussock", "resolution": [24, 6], "isPanoramic": 0}
    assert metadata["needsUnwrapping"] == metadata["isGreyscale"] == 0
    assert np.allclose(database.poses, GRID.poses(), rtol=0, atol=1e-12)
    assert (database.z == 0.01).all()
    assert np.array_equal(database.views(), renderer.render(database.poses))
    image = cv2.imread(str(tmp_path / "new" / "g" / database.names[1]), cv2.IMREAD_COLOR)  # as BoB's readers do
    assert np.array_equal(image[..., ::-1], renderer.render(database.poses[1:2])[0, ..., :3])


def test_the_files_of_a_route(tmp_path, renderer):
    poses = ROUTE + [0, 0, 2.5]
    database, _ = write_database(tmp_path / "r", renderer, poses)
    lines = (tmp_path / "r" / ENTRIES).read_text().splitlines()
    assert lines[0] == "X [mm], Y [mm], Z [mm], Heading [degrees], Pitch [degrees], Roll [degrees], Filename"
    assert lines[1] == "500, 1000, 10, 306.760551217, 0, 0, image_00000.png"
    assert database.kind == "route"
    assert database.poses.tobytes() == stored_poses(poses).tobytes()
    assert np.array_equal(database.views([8, 0]), renderer.render(database.poses[[8, 0]]))
    assert len(database.views([])) == 0


def test_invalid_poses_and_grids_are_refused(tmp_path):
    same_names = Grid(begin=(0.0005, 0), spacing=0.001, size=(3, 1))
    for poses, message in (
        (np.empty((0, 3)), "0 views"),
        ([(np.nan, 0.0, 0.0)], "pose 0 is .*nan"),
        ([(2e6, 0.0, 0.0)], r"up to 1e\+06 m"),
        (same_names, "wider spacing"),
    ):
        with pytest.raises(SettingError, match=message):
            write_database(tmp_path / "d", BlackRenderer(), poses)
    assert not (tmp_path / "d").exists()
    for parameters, message in (
        ({"spacing": 0.0004}, "spacing is 0.0004.*0.001"),
        ({"begin": (0.0, np.inf)}, "begin is .*inf"),
        ({"begin": (0.0,)}, "begin"),
        ({"size": (0, 3)}, "size is"),
        ({"size": (1001, 1000)}, "1,000,000"),
    ):
        with pytest.raises(SettingError, match=message):
            Grid(**parameters)


# Completing after an interruption.


def test_only_missing_views_are_drawn_again(tmp_path, renderer):
    seen = []
    whole, _ = write_database(tmp_path / "a", renderer, GRID, lambda done, total: seen.append((done, total)))
    assert seen[-1] == (15, 15)
    out = tmp_path / "b"
    write_database(out, renderer, GRID)
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    assert write_database(out, renderer, GRID)[1] == 0
    assert before == {path: path.stat().st_mtime_ns for path in out.iterdir()}
    (out / whole.names[3]).unlink()
    lines = (out / ENTRIES).read_text().splitlines(keepends=True)
    (out / ENTRIES).write_text("".join(lines[:8] + lines[9:]))
    (out / f".{whole.names[7][:-4]}.1.partial.png").write_bytes(b"half")
    (out / ".database_entries.1.partial.csv").write_bytes(b"half")
    assert write_database(out, renderer, GRID)[1] == 2
    assert contents(out) == contents(tmp_path / "a")


def test_another_world_eye_kind_or_pose_is_refused_and_nothing_is_changed(tmp_path, renderer):
    out = tmp_path / "d"
    write_database(out, renderer, GRID)
    (out / "image_+000200_+000400_+000010.png").unlink()  # so that there is a view to draw
    (out / ".image_00000.1.partial.png").write_bytes(b"half")
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    with (
        open_renderer(World.generate("tiny", 2), EYE, "cpu") as other_world,
        pytest.raises(InputError, match="differs in its world"),
    ):
        write_database(out, other_world, GRID)
    for eye in (Eye(width=26, height=6), Eye(width=24, height=6, top=1.0), Eye(width=24, height=6, samples=2)):
        with pytest.raises(InputError, match="differs in its eye"):
            write_database(out, BlackRenderer(eye), GRID)
    with pytest.raises(InputError, match="differs in its type"):
        write_database(out, renderer, GRID.poses())
    with pytest.raises(InputError, match="differs in its poses"):
        write_database(out, renderer, Grid(begin=(0.2, 0.4), spacing=0.2, size=(5, 2)))
    assert before == {path: path.stat().st_mtime_ns for path in out.iterdir()}


def test_a_folder_with_anything_else_is_refused_and_nothing_is_changed(tmp_path, renderer):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "notes.txt").write_text("mine")
    for name in ("file", "notes", "file/below"):
        with pytest.raises(InputError):
            write_database(tmp_path / name, renderer, ROUTE)
    published = by_hand(tmp_path / "published", PUBLISHED)
    with pytest.raises(InputError, match="version"):
        write_database(published, renderer, ROUTE)
    write_database(tmp_path / "changed", renderer, ROUTE)
    (tmp_path / "changed" / ENTRIES).write_text(PUBLISHED)
    with pytest.raises(InputError, match="was changed"):
        write_database(tmp_path / "changed", renderer, ROUTE)
    assert (tmp_path / "notes" / "notes.txt").read_text() == (tmp_path / "file").read_text() == "mine"


MANY = ["--world", "tiny", "--seed", "1", "--size", "24x6", "--spacing-m", "0.08"]  # 38 x 38 views


def drawing(out: Path) -> Process:
    """tussock database grid, running."""
    command = [sys.executable, "-m", "tussock", "database", "grid", *MANY, "--out", str(out), "--json"]
    here = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    process = Process(command, env=here, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (out / METADATA).exists():
        assert process.poll() is None
        time.sleep(0.005)
    return process


def assert_all_files_are_complete(out: Path):
    database = read_database(out) if (out / ENTRIES).exists() else None
    if database is not None:
        assert database.names == database.columns["Filename"]
        assert len(database.views()) == len(database)
    for path in out.glob("image_*"):
        read_image(path)


@pytest.mark.slow
def test_a_killed_process_leaves_a_valid_database_that_can_be_completed(tmp_path, renderer):
    out, moments = tmp_path / "d", random.Random(4)
    for _ in range(3):
        drawn = len(list(out.glob("image_*")))
        with drawing(out) as process:
            while len(list(out.glob("image_*"))) == drawn and process.poll() is None:
                time.sleep(0.002)
            time.sleep(moments.uniform(0, 0.05))
            process.send_signal(signal.SIGKILL)
        assert_all_files_are_complete(out)
    listed = len(read_database(out)) if (out / ENTRIES).exists() else 0
    with drawing(out) as process:
        result = json.loads(process.communicate()[0])
    assert (result["images"], result["rendered"]) == (1444, 1444 - listed)
    write_database(tmp_path / "at once", renderer, Grid(begin=(0, 0), spacing=0.08, size=(38, 38)))
    assert contents(out) == contents(tmp_path / "at once")


def test_ctrl_c_leaves_a_database_that_can_be_completed(tmp_path, capfd):
    out = tmp_path / "d"
    with drawing(out) as process:
        time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        err = process.communicate()[1]
    assert process.returncode == 130
    assert err.splitlines()[-1] == "tussock: interrupted"
    assert_all_files_are_complete(out)
    assert not list(out.glob(".*"))


# Reading databases of others.

PUBLISHED = (
    "X [mm], Y [mm], Z [mm], Heading [degrees], Filename\n"
    "6300, 8450, 10, -90, image_00000.png\n6290, 8450, 10, 270, image_00001.png\n6290, 8440, 10, 180, image_00002.png\n"
)
YAML = """%YAML:1.0
---
metadata:
   time: "2019-02-11 10:02:30"
   type: route
   camera:
      name: panoramic
      resolution: [ 8, 4 ]
      isPanoramic: 0
   needsUnwrapping: 0
   isGreyscale: 0
"""


def by_hand(
    folder: Path, entries: str | bytes, yaml: str | bytes = YAML, images: int = 3, ending: str = ".png"
) -> Path:
    """A folder with the given texts and images of 8 x 4 pixels."""
    folder.mkdir(exist_ok=True)
    for name, text in ((ENTRIES, entries), (METADATA, yaml)):
        (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    for i in range(images):
        cv2.imwrite(str(folder / f"image_{i:05d}{ending}"), np.full((4, 8, 3), [10 * i, 50, 200], dtype=np.uint8))
    return folder


def test_a_published_route_is_read(tmp_path):
    database = read_database(by_hand(tmp_path / "d", PUBLISHED))
    assert database.kind == "route"
    assert np.allclose(database.poses, [(6.3, 8.45, -np.pi), (6.29, 8.45, -np.pi), (6.29, 8.44, -np.pi / 2)])
    assert database.z.tolist() == [0.01] * 3
    assert database.views().tolist()[1][0][0] == [200, 50, 10]  # RGB
    assert check_database(tmp_path / "d") == []


VARIANTS = {
    "another order": (
        "Filename, Heading [degrees], Z [mm], Y [mm], X [mm]\n"
        "image_00000.png, 270, 10, 8450, 6300\nimage_00001.png, 270, 10, 8450, 6290\nimage_00002.png, -180, 10, 8440, 6290\n"
    ),
    "no spaces": PUBLISHED.replace(", ", ","),
    "CRLF": PUBLISHED.replace("\n", "\r\n"),
    "a BOM": b"\xef\xbb\xbf" + PUBLISHED.encode(),
    "no last newline": PUBLISHED.rstrip(),
    "empty lines": PUBLISHED.replace("\n", "\n\n"),
    "decimals": PUBLISHED.replace("6300", "6300.000"),
    "commas at the ends": PUBLISHED.replace("\n", ",\n"),
    "spaces": PUBLISHED.replace(", ", "  ,  "),
    "quotes": PUBLISHED.replace("image_00000.png", '"image_00000.png"'),
    "pitch and roll": PUBLISHED.replace("[degrees], F", "[degrees], Pitch [degrees], Roll [degrees], F").replace(
        ", image", ", 0, , image"
    ),
    "turned further": PUBLISHED.replace("-90", "270").replace("180", "-540"),
}  # fmt: skip


@pytest.mark.parametrize("variant", VARIANTS)
def test_published_variants_read_the_same(tmp_path, variant):
    expected = read_database(by_hand(tmp_path / "a", PUBLISHED))
    database = read_database(by_hand(tmp_path / "b", VARIANTS[variant]))
    assert database.poses.tobytes() == expected.poses.tobytes()
    assert database.names == expected.names
    assert np.array_equal(database.z, expected.z)


def test_missing_cells_names_from_1_and_the_yaml_of_opencv_5(tmp_path):
    entries = 'X [mm], Y [mm], Heading [degrees], Filename, Note\n1000,,90, image00001.jpg\n, 2000, , ,"a, b"\n'
    database = read_database(by_hand(tmp_path / "d", entries, YAML.replace("%YAML:1.0", "%YAML 1.2"), images=0))
    assert database.names == ("image00001.jpg", None)
    assert np.array_equal(database.poses, [(1.0, np.nan, 0.0), (np.nan, 2.0, np.nan)], equal_nan=True)
    assert np.isnan(database.z).all()
    assert database.columns["Note"] == ("", "a, b")
    with pytest.raises(InputError, match="row 1 names no image"):
        database.views([1])
    with pytest.raises(InputError, match=r"there is no image .*image00001\.jpg"):
        database.views([0])


def test_grey_images_have_three_equal_channels_and_sizes_must_agree(tmp_path):
    folder = by_hand(tmp_path / "d", PUBLISHED)
    grey = np.arange(32, dtype=np.uint8).reshape(4, 8)
    cv2.imwrite(str(folder / "image_00000.png"), grey)
    assert np.array_equal(read_database(folder).views([0])[0], np.stack([grey] * 3, axis=2))
    assert len(read_database(folder).views()) == 3
    cv2.imwrite(str(folder / "image_00000.png"), grey[:3])
    with pytest.raises(InputError, match=r"image_00001\.png is 8 x 4 x 3, image_00000\.png is 8 x 3 x 3"):
        read_database(folder).views()
    for damaged in (b"", b"GIF89a", (folder / "image_00001.png").read_bytes()[:-5]):
        (folder / "image_00000.png").write_bytes(damaged)
        with pytest.raises(InputError, match=r"image_00000\.png cannot be read"):
            read_database(folder).views()
    cv2.imwrite(str(folder / "image_00000.png"), grey.astype(np.uint16))
    with pytest.raises(InputError, match="8 bits"):
        read_database(folder).views()


FRAMES = re.sub(r"image_0000(\d).png", r"\1", PUBLISHED).replace("Filename", "Frame")

BAD = {
    "no frame numbers": (PUBLISHED.replace("Filename", "Frame"), YAML, r"line 2: Frame is 'image_00000\.png'"),
    "no video": (FRAMES, YAML, "names no videoFile"),
    "a video above": (FRAMES, YAML + '   videoFile: "../d.png"\n', r"'\.\./d\.png' is not in the folder"),
    "a frame before the first": (FRAMES.replace("180, 2", "180, -2"), YAML, "line 4: Frame is not a whole number"),
    "no X": (PUBLISHED.replace("X [mm]", "X [m]"), YAML, r"line 1: there is no column 'X \[mm\]'"),
    "no names": (PUBLISHED.replace("Filename", "File"), YAML, "line 1: there is no column 'Filename'"),
    "two X": (PUBLISHED.replace("Y [mm]", "X [mm]"), YAML, r"line 1: the column 'X \[mm\]' .*twice"),
    "text for a number": (PUBLISHED.replace("8440", "north"), YAML, r"line 4: Y \[mm\] is 'north'"),
    "nan": (PUBLISHED.replace("180", "nan"), YAML, r"line 4: Heading \[degrees\] is 'nan'"),
    "too large": (PUBLISHED.replace("8440", "1e300"), YAML, r"line 4: Y \[mm\] is '1e300'"),
    "too many cells": (PUBLISHED.replace("10, 180", "10, 5, 180"), YAML, "line 4: 6 cells under 5 columns"),
    "no text": (b"\xff\xfe" + PUBLISHED.encode("utf-16-le"), YAML, "cannot be read as CSV"),
    "a cell without end": ('X [mm]\n"' + "1" * 200_000, YAML, "cannot be read as CSV"),
    "an empty file": ("", YAML, "line 1: there is no column"),
    "an absolute name": (PUBLISHED.replace("image_00001.png", "/etc/hosts"), YAML, "line 3: '/etc/hosts' is not in the folder"),
    "a name above": (PUBLISHED.replace("image_00001.png", "../d.png"), YAML, r"line 3: '\.\./d\.png' is not in the folder"),
    "a link out": (PUBLISHED.replace("image_00001.png", "link.png"), YAML, r"line 3: 'link\.png' is not in the folder"),
    "damaged YAML": (PUBLISHED, YAML + "   a: [ 1, 2\n", "line 1[0-9].* YAML"),
    "other YAML": (PUBLISHED, "%YAML:1.0\n---\nother: 1\n", "no 'metadata'"),
    "another type": (PUBLISHED, YAML.replace("type: route", "type: film"), "the type is 'film'"),
    "no type": (PUBLISHED, YAML.replace("type: route", "kind: route"), "the type is None"),
    "deep YAML": (PUBLISHED, YAML + "   a: " + "[" * 200_000, "nested too deeply"),
    "XML": (PUBLISHED, '<?xml version="1.0"?><opencv_storage>' + "<a>" * 200_000, "nested too deeply"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_damaged_databases_are_refused_in_one_line(tmp_path, what):
    entries, yaml, message = BAD[what]
    folder = by_hand(tmp_path / "d", entries, yaml)
    (tmp_path / "d.png").write_bytes((folder / "image_00000.png").read_bytes())
    (folder / "link.png").symlink_to(tmp_path / "d.png")
    with pytest.raises(InputError, match=message) as refusal:
        read_database(folder)
    assert "\n" not in str(refusal.value)
    assert str(folder) in str(refusal.value)


def test_missing_entries_are_named(tmp_path):
    folder = by_hand(tmp_path / "d", PUBLISHED)
    (folder / ENTRIES).unlink()
    with pytest.raises(InputError, match=f"there is no .*{ENTRIES}"):
        read_database(folder)


@st.composite
def damaged(draw, text: str) -> bytes:
    """A text with some bytes replaced, or any bytes at all."""
    data = bytearray(text.encode())
    for _ in range(draw(st.integers(1, 3))):
        at, length = draw(st.integers(0, len(data))), draw(st.integers(0, 8))
        data[at : at + length] = draw(
            st.binary(max_size=8) | st.sampled_from([b"\n", b",", b'"', b": ", b"- ", b"[", b"\0"])
        )
    return bytes(data)


@settings(max_examples=150, derandomize=True)
@given(
    entries=damaged(PUBLISHED) | st.binary(max_size=99) | st.just(PUBLISHED.encode()),
    yaml=damaged(YAML) | st.just(YAML.encode()),
)
def test_any_bytes_are_read_or_refused(tmp_path_factory, entries, yaml):
    folder = by_hand(tmp_path_factory.getbasetemp() / "fuzzed", entries, yaml)
    check_database(folder)
    try:
        database = read_database(folder)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert len(database) == len(database.poses) == len(database.z)


# What is understood of published databases.


def test_positions_far_from_the_origin_are_kept(tmp_path):
    entries = "".join(f"704497000.25, {5638660000 + 50 * i}.0, 56600, 0, image_{i:05d}.png\n" for i in range(3))
    database = read_database(by_hand(tmp_path / "d", PUBLISHED.splitlines(keepends=True)[0] + entries))
    assert database.poses[:, :2].tolist() == [[704497.00025, 5638660 + i / 20] for i in range(3)]
    assert database.z.tolist() == [56.6] * 3
    assert check_database(tmp_path / "d") == []


def with_alpha(folder: Path, *alphas: int | None) -> Path:
    """A database whose images have these constants as alpha, but in one pixel at a corner 255."""
    by_hand(folder, PUBLISHED)
    for i, alpha in enumerate(alphas):
        if alpha is not None:
            image = np.full((4, 8, 4), [10 * i, 50, 200, alpha], dtype=np.uint8)
            image[0, 0, 3] = 255
            cv2.imwrite(str(folder / f"image_{i:05d}.png"), image)
    return folder


def test_alpha_that_is_opaque_everywhere_is_dropped_and_that_is_logged_once(tmp_path, caplog):
    folder = with_alpha(tmp_path / "d", 255, 255, 255)
    database = read_database(folder)
    with caplog.at_level(logging.INFO, "tussock"):
        assert database.views([1]).shape == (1, 4, 8, 3)
        assert np.array_equal(database.views(), read_database(by_hand(tmp_path / "rgb", PUBLISHED)).views())
    assert [
        record.getMessage() for record in caplog.records if "alpha is 255" in record.getMessage()
    ] == caplog.messages
    assert len(caplog.messages) == 1
    caplog.clear()
    assert check_database(folder) == []
    assert "alpha is 255" in caplog.text


def test_alpha_is_kept_where_one_image_of_the_database_has_any(tmp_path, caplog):
    database = read_database(with_alpha(tmp_path / "d", 255, 255, 254))
    assert database.views([0]).shape == (1, 4, 8, 4)  # although all of this one is opaque
    assert not caplog.records
    many = PUBLISHED.splitlines(keepends=True)[0] + "".join(f"{i}, 0, 10, 90, image_{i:05d}.png\n" for i in range(70))
    folder = by_hand(tmp_path / "many", many, images=0)
    for i in range(70):
        cv2.imwrite(str(folder / f"image_{i:05d}.png"), np.full((4, 8, 4), 255 if i != 5 else 9, dtype=np.uint8))
    assert read_database(folder).views([0]).shape == (1, 4, 8, 4)


def test_opaque_alpha_and_none_are_mixed(tmp_path):
    assert read_database(with_alpha(tmp_path / "d", 255, None, 255)).views().shape == (3, 4, 8, 3)
    with pytest.raises(InputError, match=r"image_00001\.png is 8 x 4 x 3"):
        read_database(with_alpha(tmp_path / "e", 9, None, 255)).views()


def video_database(folder: Path, frames=(4, 0, 2), total: int = 6) -> Path:
    """Rows that are frames of a video, frame n of which is grey 40 n + 10."""
    by_hand(
        folder,
        PUBLISHED.replace("Filename", "Frame"),
        YAML.replace("[ 8, 4 ]", "[ 16, 8 ]") + '   videoFile: "drive.avi"\n',
        images=0,
    )
    text = (folder / ENTRIES).read_text()
    for i, frame in enumerate(frames):
        text = text.replace(f"image_{i:05d}.png", str(frame))
    (folder / ENTRIES).write_text(text)
    writer = cv2.VideoWriter(str(folder / "drive.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 15, (16, 8))
    for frame in range(total):
        writer.write(np.full((8, 16, 3), 40 * frame + 10, dtype=np.uint8))
    writer.release()
    return folder


def test_the_rows_of_a_video_database_are_its_frames(tmp_path):
    database = read_database(video_database(tmp_path / "d"))
    assert (len(database), database.frames) == (3, (4, 0, 2))
    assert np.rint((database.views().mean(axis=(1, 2, 3)) - 10) / 40).tolist() == [4, 0, 2]
    assert np.rint((database.views([2, 2]).mean(axis=(1, 2, 3)) - 10) / 40).tolist() == [2, 2]
    assert len(database.views([])) == 0
    assert np.array_equal(database.write(tmp_path / "copy").views(), database.views())


def test_frames_that_a_video_does_not_have_are_named(tmp_path, capfd):
    folder = video_database(tmp_path / "d", (0, 6, 10**8))
    with pytest.raises(InputError, match="6 frames that can be read; there is no frame 6"):
        read_database(folder).views()
    assert [(each.kind, each.where) for each in check_database(folder)] == [
        ("missing-frame", f"{ENTRIES}, line 3"), ("missing-frame", f"{ENTRIES}, line 4")
    ]  # fmt: skip
    whole = (folder / "drive.avi").read_bytes()
    for data in (
        b"",
        b"text",
        whole[:300],
        b"RIFF" + bytes(300),
        b"#EXTM3U\n/etc/hosts\n",
        b"ffconcat version 1.0\nfile /etc/hosts\n",
    ):
        (folder / "drive.avi").write_bytes(data)
        with pytest.raises(InputError, match=r"drive\.avi"):
            read_database(folder).views([0])
        (problem,) = check_database(folder)[:1]
        assert problem.kind in ("unreadable-video", "missing-frame")
    (folder / "drive.avi").unlink()
    with pytest.raises(InputError, match=r"there is no .*drive\.avi"):
        read_database(folder).views([0])
    assert capfd.readouterr().err == ""


RING = """   unwrapper:
      centre: [ 0.5, 0.5 ]
      inner: 0.1
      outer: 0.45
      offsetDegrees: 0.
      flip: 0
"""


def ring_database(folder: Path, yaml: str = RING, needs: str = "needsUnwrapping: 1") -> Path:
    """Three pictures of 80 x 80 of a ring that is bright ahead (up), from 30 degrees to the left to 30 to the right."""
    by_hand(
        folder, PUBLISHED, YAML.replace("needsUnwrapping: 0", needs).replace("[ 8, 4 ]", "[ 80, 80 ]") + yaml, images=0
    )
    y, x = np.mgrid[:80, :80] - 40
    bright = (np.abs(np.arctan2(x, -y)) < np.radians(30)) * np.uint8(200)
    for i in range(3):
        cv2.imwrite(str(folder / f"image_{i:05d}.png"), np.repeat(bright[..., None], 3, axis=2))
    return folder


def test_raw_pictures_are_unwrapped_as_the_metadata_has_it(tmp_path):
    views = read_database(ring_database(tmp_path / "d")).views()
    assert views.shape == (3, 28, 140, 3)  # 28 pixels from 8 to 36, 138 around the circle halfway
    bright = views[0, 14, :, 0] > 100
    assert np.flatnonzero(bright).tolist() == list(range(58, 82))  # 24 of 140 columns in the middle: 60 degrees
    turned = read_database(
        ring_database(tmp_path / "t", RING.replace("offsetDegrees: 0.", "offsetDegrees: 90."))
    ).views()
    assert np.array_equal(np.flatnonzero(turned[0, 14, :, 0] > 100), np.arange(23, 47))
    sized = read_database(ring_database(tmp_path / "s", RING + "      size: [ 72, 10 ]\n"))
    assert sized.views([0]).shape == (1, 10, 72, 3)
    assert check_database(tmp_path / "d") == []


def test_raw_pictures_without_a_way_to_unwrap_them_are_refused(tmp_path):
    for i, yaml in enumerate(
        ("", RING.replace("inner", "inward"), RING.replace("0.45", "0.05"), RING.replace("[ 0.5, 0.5 ]", "0.5"))
    ):
        folder = ring_database(tmp_path / str(i), yaml)
        with pytest.raises(InputError, match=METADATA) as refusal:
            read_database(folder).views()
        assert "\n" not in str(refusal.value)
        assert [each.kind for each in check_database(folder)] == ["needs-unwrapping"]
    assert "tussock unwrap" in str(refusal.value)


@pytest.mark.parametrize(
    ("needs", "unwrapped"),
    [("needsUnwrapping: 0", False), ("other: 0", False), ("needsUnwrapping: 1", True), ("panoramic", True)],
)
def test_whether_pictures_are_raw(tmp_path, needs, unwrapped):
    folder = ring_database(tmp_path / "d", needs="other: 0" if needs == "panoramic" else needs)
    if needs == "panoramic":  # a camera that is, and pictures that are square
        text = (folder / METADATA).read_text().replace("isPanoramic: 0", "isPanoramic: 1")
        (folder / METADATA).write_text(text)
    assert (read_database(folder).views([0]).shape != (1, 80, 80, 3)) == unwrapped


def test_the_kind_of_a_database_without_metadata_is_guessed(tmp_path, caplog):
    folder = by_hand(tmp_path / "d", PUBLISHED)
    (folder / METADATA).unlink()
    assert read_database(folder).kind == "route"
    assert "read as a route" in caplog.text
    assert read_database(folder).write(tmp_path / "copy").kind == "route"
    rows = PUBLISHED.replace("Filename", "Filename, Grid X, Grid Y, Grid Z").replace(".png", ".png, 0, 0, 0")
    (folder / ENTRIES).write_text(rows)
    assert read_database(folder).kind == "grid"


def test_pointers_of_git_lfs_are_named(tmp_path):
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0" * 64 + b"\nsize 12345\n"
    for name in (ENTRIES, METADATA, "image_00001.png", "drive.avi"):
        folder = tmp_path / name
        video_database(folder) if name == "drive.avi" else by_hand(folder, PUBLISHED)
        (folder / name).write_bytes(pointer)
        with pytest.raises(InputError, match=f"{name} is only a pointer of Git LFS.*git lfs pull"):
            read_database(folder).views()
        assert any("git lfs pull" in each.what for each in check_database(folder))


# Copying.

UNUSUAL = (
    YAML
    + """   unwrapper:
      centre: [ 0.5, 1e-3, -7 ]
      flipped: 1
      note: "it's \\"true\\""
   matrix: !!opencv-matrix
      rows: 1
      cols: 2
      dt: d
      data: [ 1., 2.5 ]
   list: [ [ 1, 2 ], { a: x, b: [ ] }, "" ]
"""
)


def test_a_copy_is_complete_and_its_copy_is_the_same(tmp_path):
    entries = PUBLISHED.replace("Filename\n", 'Filename, GPS, "a, ""b"""\n').replace(
        "00000.png", '00000.png,  51.5,"x, y"'
    )
    first = read_database(by_hand(tmp_path / "a", entries, UNUSUAL))
    second = first.write(tmp_path / "b")
    third = second.write(tmp_path / "c")
    assert contents(tmp_path / "b") == contents(tmp_path / "c")
    for other in (second, third):
        assert list(other.columns.items()) == list(first.columns.items())
        assert other.metadata == first.metadata
        assert np.array_equal(other.views(), first.views())
    assert first.columns['a, "b"'] == ("x, y", "", "")
    assert first.metadata["unwrapper"] == {"centre": [0.5, 0.001, -7], "flipped": 1, "note": 'it\'s "true"'}
    assert first.metadata["list"] == [[1, 2], {"a": "x", "b": []}, ""]
    assert "!!opencv-matrix" in (tmp_path / "b" / METADATA).read_text()
    with pytest.raises(InputError, match="new folder"):
        first.write(tmp_path / "b")
    (tmp_path / "a" / "image_00001.png").unlink()
    with pytest.raises(InputError, match=r"no image .*image_00001\.png"):
        first.write(tmp_path / "d")


def test_the_copy_of_a_drawn_database_is_the_same(tmp_path, renderer):
    database, _ = write_database(tmp_path / "a", renderer, GRID)
    assert isinstance(database.write(tmp_path / "b"), Database)
    assert contents(tmp_path / "b") == contents(tmp_path / "a")


keys = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,6}", fullmatch=True)
texts = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=9) | st.sampled_from(
    ["true", "null", "1e5", "~", '"', "'", " a ", "a: b", "- a", "\n", "\\"]
)
values = st.none() | st.integers(-(2**31), 2**31 - 1) | st.floats(allow_nan=False) | texts


@settings(max_examples=50, derandomize=True)
@given(
    st.dictionaries(keys, st.recursive(values, lambda each: st.lists(each) | st.dictionaries(keys, each), max_leaves=8))
)
def test_metadata_is_read_back(tmp_path_factory, metadata):
    path = tmp_path_factory.getbasetemp() / METADATA
    write_metadata(path, metadata)
    assert read_metadata(path) == metadata


def test_metadata_that_cannot_be_read_back_is_refused(tmp_path):
    for metadata in ({"a: b": 1}, {"a": "\x07"}, {"a": 2**70}):
        with pytest.raises(InputError, match=f"{METADATA}.*cannot hold"):
            write_metadata(tmp_path / METADATA, metadata)
    assert not (tmp_path / METADATA).exists()


# The command line.

SMALL = ["--world", "tiny", "--seed", "1", "--size", "24x6"]


def tussock(capfd, *arguments) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command, run in this process."""
    capfd.readouterr()
    code = 0
    try:
        main(["database", *map(str, arguments)])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, *capfd.readouterr()


def test_a_grid_from_the_command_line(capfd, tmp_path):
    out = tmp_path / "g"
    code, printed, err = tussock(capfd, "grid", *SMALL, "--out", out, "--json")
    result = json.loads(printed)
    assert (code, err) == (0, "renderer: cpu\n")
    assert list(result) == ["database", "type", "images", "rendered", "seconds"]
    assert (result["type"], result["images"], result["rendered"]) == ("grid", 256, 256)
    database = read_database(out)
    assert np.allclose(database.poses[[0, 1, 255]], [(0, 0, 0), (0.2, 0, 0), (3, 3, 0)])
    assert "rendered  0" in tussock(capfd, "grid", *SMALL, "--out", out)[1]
    tussock(
        capfd, "grid", *SMALL, "--out", tmp_path / "part", "--from-m", "0.3,1", "--to-m", "1,1.05", "--spacing-m", 0.1
    )
    assert np.allclose(read_database(tmp_path / "part").poses[:, :2], [(x / 10, 1) for x in range(3, 11)])


def test_a_grid_is_the_published_one_by_default():
    command = DatabaseGridCommand(out=Path("g"))
    for field in (Bounds(0, 0, 10, 10), Bounds(-0.16, -0.23, 10.24, 10.09)):  # of the presets and the Sussex world
        grid = command.grid(field, None, None)
        assert (grid.begin, grid.spacing, grid.size) == ((0.0, 0.0), 0.2, (51, 51))
        assert field.contains(*grid.poses()[:, :2].T).all()


def test_a_route_from_the_command_line_and_its_check(capfd, tmp_path):
    (tmp_path / "r.csv").write_text("x_m,y_m,heading_deg\n0.5,0.5,0\n2.49,0.5,0\n2.5,0.5,90\n2.5,2.5,90\n")
    out = tmp_path / "r"
    code, printed, _ = tussock(capfd, "route", *SMALL, "--route", tmp_path / "r.csv", "--out", out, "--json")
    assert code == 0
    assert json.loads(printed)["images"] == 201
    assert np.allclose(read_database(out).poses[[0, 1]], [(0.5, 0.5, 0), (0.52, 0.5, 0)])
    code, printed, _ = tussock(capfd, "check", out, "--json")
    assert code == 0
    assert json.loads(printed) == {"database": str(out), "type": "route", "images": 201, "problems": [], "ok": True}
    (out / "image_00003.png").unlink()
    code, printed, _ = tussock(capfd, "check", out, "--json")
    problem = {"kind": "missing-image", "where": f"{ENTRIES}, line 5", "what": "there is no image_00003.png"}
    assert (code, json.loads(printed)["problems"], json.loads(printed)["ok"]) == (1, [problem], False)
    code, printed, err = tussock(capfd, "check", out)
    assert (code, err) == (1, "")
    assert f"missing-image  {ENTRIES}, line 5  there is no image_00003.png\n" in printed


BAD_FLAGS = {
    "no spacing": (["grid", *SMALL, "--out", "d", "--spacing-m", "0"], "--spacing-m 0"),
    "too many views": (["grid", *SMALL, "--out", "d", "--spacing-m", "0.001"], "3001 x 3001 positions"),
    "corners exchanged": (["grid", *SMALL, "--out", "d", "--from-m", "2,2", "--to-m", "1,1"], "0 x 0 positions"),
    "a corner outside": (["grid", *SMALL, "--out", "d", "--to-m", "9,9"], "--to-m 9,9: that is outside the world"),
    "a corner that is not X,Y": (["grid", *SMALL, "--out", "d", "--from-m", "1"], "give X,Y"),
    "a spacing over the route": (["route", *SMALL, "--out", "d", "--spacing-m", "99"], "does not fit a route"),
    "a missing route": (["route", *SMALL, "--out", "d", "--route", "r.csv"], r"there is no route r\.csv"),
    "a file for a folder": (["grid", *SMALL, "--out", "file"], "file exists already"),
    "nothing to check": (["check", "nowhere"], "there is no nowhere/database_entries.csv"),
}


@pytest.mark.parametrize("what", BAD_FLAGS)
def test_bad_flags_are_one_line_exit_2_and_leave_nothing(capfd, tmp_path, monkeypatch, what):
    arguments, message = BAD_FLAGS[what]
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    code, out, err = tussock(capfd, *arguments)
    assert (code, out) == (2, "")
    lines = [line for line in err.splitlines() if line != "renderer: cpu"]
    assert len(lines) == 1, err
    assert re.search(message, lines[0]), lines
    assert os.listdir() == ["file"]


def test_rows_that_count_the_frames_of_a_tracker_are_the_frames_of_the_video_in_order(tmp_path, caplog):
    folder = video_database(tmp_path / "route", frames=(770714, 770724, 770735), total=3)
    database = read_database(folder)
    assert database.frames == (0, 1, 2)
    assert "as many as there are rows" in caplog.text
    assert np.abs(database.views()[:, 0, 0, 0].astype(int) - [10, 50, 90]).max() <= 3
    assert "missing-frame" not in {problem.kind for problem in check_database(folder)}
    other = video_database(tmp_path / "other", frames=(0, 1, 6), total=6)  # only its end is missing
    assert read_database(other).frames == (0, 1, 6)


def test_the_unwrapper_of_a_database_of_a_video_stands_under_image_input(tmp_path):
    folder = video_database(tmp_path / "route")
    yaml = (folder / METADATA).read_text()
    ring = "unwrapper:\n         centre: [ 0.5, 0.5 ]\n         inner: 0.1\n         outer: 0.5\n"
    (folder / METADATA).write_text(
        yaml.replace("needsUnwrapping: 0", "needsUnwrapping: 1") + f"   imageInput:\n      {ring}"
    )
    assert read_database(folder).views().shape[1:] != (8, 16, 3)
