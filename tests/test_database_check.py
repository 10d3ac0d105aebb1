"""Each problem of a database is found, and nothing else; correct databases have no problems."""

import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from quick_cases import quick

from tussock.render.eye import Eye
from tussock.render.images.check import Problem, check_database
from tussock.render.images.database import read_database
from tussock.render.images.entries import ENTRIES
from tussock.render.images.metadata import METADATA, read_metadata, write_metadata
from tussock.render.images.writing import Grid, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError
from tussock.world.files import read_world
from tussock.world.route_files import read_route
from tussock.world.scene import World

EYE = Eye(width=24, height=6)
SIDE = 8
GRID = Grid(begin=(0.4, 0.4), spacing=0.2, size=(SIDE, SIDE))


def curve(n: int = 40) -> np.ndarray:
    """Poses (n, 3) along a bend, facing along it."""
    turn = np.linspace(0, np.pi / 2, n)
    return np.column_stack([1 + np.sin(turn), 2 - np.cos(turn), turn])


@pytest.fixture(scope="module")
def correct(tmp_path_factory) -> Path:
    """A folder with a correct grid and a correct route."""
    folder = tmp_path_factory.mktemp("correct")
    with open_renderer(World.generate("tiny", 1), EYE, "cpu") as renderer:
        write_database(folder / "grid", renderer, GRID)
        write_database(folder / "route", renderer, curve())
    return folder


@pytest.fixture
def grid(correct, tmp_path) -> Path:
    return Path(shutil.copytree(correct / "grid", tmp_path / "grid"))


@pytest.fixture
def route(correct, tmp_path) -> Path:
    return Path(shutil.copytree(correct / "route", tmp_path / "route"))


def replace(path: Path, *changes: tuple[str, str]) -> None:
    text = path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)


def only(folder: Path, kind: str) -> Problem:
    """The one problem that a database has."""
    (problem,) = check_database(folder)
    assert problem.kind == kind
    return problem


def test_correct_databases_have_no_problems(grid, route):
    assert check_database(grid) == check_database(route) == []


def test_a_folder_without_a_database_is_refused(tmp_path):
    with pytest.raises(InputError, match=ENTRIES):
        check_database(tmp_path)


# Files.


def test_missing_images(route):
    (route / "image_00007.png").unlink()
    assert only(route, "missing-image").where == f"{ENTRIES}, line 9"


def test_a_row_that_names_no_image(route):
    replace(route / ENTRIES, ("image_00007.png", ""))
    (route / "image_00007.png").unlink()
    assert only(route, "missing-image").what == "the row names no image"


def test_truncated_and_invalid_images(route):
    path = route / "image_00007.png"
    whole = path.read_bytes()
    for data in (whole[:-20], whole[:30], b"", b"text"):
        path.write_bytes(data)
        assert only(route, "unreadable-image").where == "image_00007.png"


def test_images_of_another_size(route):
    cv2.imwrite(str(route / "image_00007.png"), np.zeros((6, 25, 3), dtype=np.uint8))
    problem = only(route, "image-size")
    assert (problem.where, problem.what) == ("image_00007.png", "it is 25 x 6, most images are 24 x 6")


def test_a_resolution_that_differs_from_the_images(route):
    replace(route / METADATA, ("[ 24, 6 ]", "[ 720, 150 ]"))
    assert only(route, "image-size") == Problem(
        "image-size", METADATA, "the resolution is 720 x 150, most images are 24 x 6"
    )


def test_images_that_no_row_names(route):
    shutil.copy(route / "image_00007.png", route / "extra.PNG")
    (route / "notes.txt").write_text("mine")
    assert only(route, "unlisted-image").where == "extra.PNG"


def test_a_mask_that_is_not_there(route):
    metadata = read_metadata(route / METADATA)
    metadata["tussock"]["eye"]["mask"] = "mask.png"
    write_metadata(route / METADATA, metadata)
    assert only(route, "missing-mask").where == METADATA
    cv2.imwrite(str(route / "mask.png"), np.full((6, 24), 255, dtype=np.uint8))
    assert check_database(route) == []


def test_rows_without_headings_are_remarked_upon(route, caplog):
    lines = (route / ENTRIES).read_text().splitlines()
    at = lines[0].split(", ").index("Heading [degrees]")
    for row in (3, 4):
        cells = lines[row].split(", ")
        cells[at] = ""
        lines[row] = ", ".join(cells)
    (route / ENTRIES).write_text("\n".join(lines) + "\n")
    assert check_database(route) == []
    assert [f"line 4: 2 of {len(lines) - 1} rows have no heading" in each.getMessage() for each in caplog.records] == [
        True
    ]


def test_a_database_of_which_no_row_is_written_yet(route):
    (route / ENTRIES).unlink()
    with pytest.raises(InputError, match="if it was interrupted, the same command completes it"):
        check_database(route)


def test_repeated_rows(route):
    lines = (route / ENTRIES).read_text().splitlines(keepends=True)
    (route / ENTRIES).write_text("".join([*lines[:9], lines[8], *lines[9:]]))
    problem = only(route, "row-twice")
    assert problem.where == f"{ENTRIES}, line 10"
    assert "image_00007.png is in line 9" in problem.what


@pytest.mark.parametrize("name", ["/etc/hostname", "../secret.png", "link.png"])
def test_names_that_leave_the_folder_are_never_opened(route, monkeypatch, name):
    secret = route.parent / "secret.png"
    shutil.move(route / "image_00007.png", secret)
    (route / "link.png").symlink_to(secret)
    replace(route / ENTRIES, ("image_00007.png", name))
    if name != "link.png":
        (route / "link.png").unlink()
    opened, read_bytes = [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: (opened.append(path.resolve()), read_bytes(path))[1])
    problem = only(route, "name-leaves-folder")
    assert problem.where == f"{ENTRIES}, line 9"
    assert len(opened) == 39
    assert all(path.is_relative_to(route.resolve()) for path in opened)


def test_damaged_metadata_and_entries(route):
    (route / METADATA).write_text("%YAML:1.0\n---\nmetadata: [\n")
    assert only(route, "damaged-metadata").where == METADATA
    (route / METADATA).unlink()
    assert check_database(route) == []  # it is guessed, and logged
    write_metadata(route / METADATA, {"type": "film"})
    assert "'film'" in only(route, "damaged-metadata").what
    write_metadata(route / METADATA, {"type": "route"})
    replace(route / ENTRIES, ("image_00007.png", "image_00007.png, 5"))
    assert "line 9" in only(route, "damaged-entries").what


@pytest.mark.parametrize("value", [0, "x", [], {}, {"resolution": "x", "size": [1], "views": {}}, [None]])
def test_metadata_of_another_structure_is_not_a_problem(grid, value):
    metadata = read_metadata(grid / METADATA)
    write_metadata(grid / METADATA, metadata | dict.fromkeys(("grid", "camera", "tussock", "needsUnwrapping"), value))
    assert check_database(grid) == []


# Numbers.


def test_heights_that_differ_from_those_in_the_names(grid):
    replace(grid / ENTRIES, (", 10, 90,", ", 200, 90,"))
    problem = only(grid, "height-differs-from-name")
    assert problem.what.startswith("64 rows have another Z")
    assert problem.what.endswith("the first 200 instead of 10")


def test_positions_that_differ_from_those_in_the_names(grid):
    a, b = (f"image_+000{x}00_+000400_+000010.png" for x in (6, 8))
    replace(grid / ENTRIES, (a, "a.png"), (b, a), ("a.png", b))
    problem = only(grid, "place-differs-from-name")
    assert problem.what.startswith("2 rows have another position")
    assert problem.what.endswith("the first at X 600, Y 400")


def test_names_with_x_and_y_exchanged(grid):
    for path in sorted(grid.glob("*.png")):
        image, x, y, z = path.stem.split("_")
        path.rename(grid / f"{image}_{y}_{x}_{z}.new")
    for path in grid.glob("*.new"):
        path.rename(path.with_suffix(".png"))
    lines = [line.split(", ") for line in (grid / ENTRIES).read_text().splitlines()]
    for cells in lines[1:]:
        image, x, y, z = cells[6].removesuffix(".png").split("_")
        cells[6] = f"{image}_{y}_{x}_{z}.png"
    (grid / ENTRIES).write_text("".join(", ".join(cells) + "\n" for cells in lines))
    assert only(grid, "place-differs-from-name").what.endswith("the first at X 600, Y 400; x and y are exchanged")


def change_bearings(folder: Path, bearing) -> None:
    """Replace the bearing of each row (degrees) by bearing(row, degrees)."""
    lines = [line.split(", ") for line in (folder / ENTRIES).read_text().splitlines()]
    for row, cells in enumerate(lines[1:]):
        cells[3] = f"{bearing(row, float(cells[3])):.3f}"
    (folder / ENTRIES).write_text("".join(", ".join(cells) + "\n" for cells in lines))


def test_single_headings_off_the_path(route):
    change_bearings(route, lambda row, degrees: degrees + (100 if row in (7, 9) else 50 if row == 20 else -360))
    problem = only(route, "heading-off-path")
    assert problem.where == f"{ENTRIES}, line 9"
    assert problem.what.startswith("2 headings are over 60 degrees off the path, the first by 9")


@pytest.mark.parametrize(
    ("bearing", "convention"),
    [
        (lambda row, degrees: 90 - degrees, "degrees counter-clockwise from +x"),
        (lambda row, degrees: -degrees, "degrees counter-clockwise from +y"),
        (lambda row, degrees: np.radians(degrees), "bearings in radians"),
    ],
)
def test_headings_in_another_convention(route, bearing, convention):
    change_bearings(route, bearing)
    problem = only(route, "heading-convention")
    assert convention in problem.what
    assert "degrees off the path (median)" in problem.what


@pytest.mark.parametrize(
    ("bearing", "remark"),
    [
        (lambda row, degrees: 0, "headings are all 0"),
        (lambda row, degrees: 150 + row % 2, "constant 15. degrees"),
        (
            lambda row, degrees: degrees - 90,
            "a constant 9. degrees to the left .* as degrees clockwise from +x they fit",
        ),
        (lambda row, degrees: degrees + 180, "point backwards along the path"),
        (lambda row, degrees: degrees + 130, "a constant 13. degrees to the right of the path"),
        (lambda row, degrees: 997 * row % 360, "do not follow the path"),
    ],
)
def test_headings_that_need_not_follow_the_path_are_remarked_upon(route, caplog, bearing, remark):
    change_bearings(route, bearing)
    assert check_database(route) == []
    (record,) = caplog.records
    assert re.search(remark.replace("+", r"\+"), record.getMessage())


def test_a_robot_that_backs_up_is_remarked_upon(route, caplog):
    change_bearings(route, lambda row, degrees: degrees + 180 * (10 <= row < 20))
    assert check_database(route) == []
    assert "10 successive headings are over 60 degrees off the path" in caplog.text


@pytest.mark.parametrize("seed", range(5))
def test_positions_that_jitter_accuse_no_heading(route, caplog, seed):
    lines = [line.split(", ") for line in (route / ENTRIES).read_text().splitlines()]
    at = np.array([[float(cell) for cell in cells[:2]] for cells in lines[1:]])
    step = np.median(np.hypot(*np.diff(at, axis=0).T))
    moved = at + np.random.default_rng(seed).uniform(-0.3, 0.3, at.shape) * step
    lines[1:] = [[f"{x:.3f}", f"{y:.3f}", *cells[2:]] for (x, y), cells in zip(moved, lines[1:], strict=True)]
    (route / ENTRIES).write_text("".join(", ".join(cells) + "\n" for cells in lines))
    assert {problem.kind for problem in check_database(route)} <= {"place-differs-from-name"}
    assert not caplog.records


@pytest.mark.parametrize(
    ("change", "what"),
    [
        # The grid begins at 400 and has 8 positions along x; what is beyond them is outside.
        (("[ 400.0, 400.0, 10.0 ]", "[ 500.0, 400.0, 10.0 ]"), "64 rows are not in the grid .* X 400, Y 400"),
        (("[ 200.0, 200.0, 0.0 ]", "[ 100.0, 200.0, 0.0 ]"), "32 rows are not in the grid .* X 1200, Y 400"),
    ],
)
def test_grids_that_are_not_where_their_metadata_puts_them(grid, change, what):
    replace(grid / METADATA, change)
    assert re.search(what, only(grid, "grid-metadata").what)


def test_grids_with_fewer_or_more_positions_than_rows(grid):
    replace(grid / METADATA, ("[ 8, 8, 1 ]", "[ 8, 7, 1 ]"))
    assert only(grid, "grid-metadata").what.startswith("8 rows are not in the grid")
    replace(grid / METADATA, ("[ 8, 7, 1 ]", "[ 8, 9, 1 ]"), ("views: 64", "seen: 64"))
    assert only(grid, "rows-missing").what.startswith("64 rows of 72")


def test_interrupted_databases(route):
    lines = (route / ENTRIES).read_text().splitlines(keepends=True)
    (route / ENTRIES).write_text("".join(lines[:31]))
    for i in range(30, 40):
        (route / f"image_{i:05d}.png").unlink()
    assert only(route, "rows-missing").what.startswith("30 rows of 40")


# The axes of grids, as the views show them.


def relabelled(folder: Path, out: Path, source) -> Path:
    """A copy in which grid position (i, j) has the image of grid position source(i, j)."""
    shutil.copytree(folder, out)
    names = read_database(folder).names
    for k, name in enumerate(names):
        i, j = source(k % SIDE, k // SIDE)
        shutil.copy(folder / (names[j * SIDE + i] or ""), out / (name or ""))
    return out


LAST = SIDE - 1
MISLABELLED = {
    "transposed": (lambda i, j: (j, i), "+y, those along +y like +x: x and y are exchanged (the grid is transposed)"),
    "x mirrored": (lambda i, j: (LAST - i, j), "x is mirrored"),
    "y mirrored": (lambda i, j: (i, LAST - j), "y is mirrored"),
    "both": (lambda i, j: (LAST - i, LAST - j), "both axes are mirrored, or the views face backwards"),
    "both, transposed": (lambda i, j: (LAST - j, LAST - i), "x and y are exchanged and mirrored"),
}


@pytest.mark.parametrize("what", MISLABELLED)
def test_exchanged_and_mirrored_axes(correct, tmp_path, what):
    source, message = MISLABELLED[what]
    assert message in only(relabelled(correct / "grid", tmp_path / "g", source), "grid-axes").what


@pytest.mark.parametrize(
    ("turn", "message"), [(90, "90 degrees to the left"), (-90, "90 degrees to the right"), (180, "face backwards")]
)
def test_views_that_do_not_face_along_their_headings(grid, turn, message):
    with open_renderer(World.generate("tiny", 1), EYE, "cpu") as renderer:
        views = renderer.render(GRID.poses() + [0, 0, np.radians(turn)])
    for name, view in zip(read_database(grid).names, views, strict=True):
        cv2.imwrite(str(grid / (name or "")), cv2.cvtColor(view, cv2.COLOR_RGBA2BGRA))
    assert message in only(grid, "grid-axes").what
    change_bearings(grid, lambda row, degrees: degrees - turn)  # bearings are clockwise
    assert check_database(grid) == []


def test_axes_are_undetermined_without_panoramas_or_structure(correct, tmp_path):
    folder = relabelled(correct / "grid", tmp_path / "g", lambda i, j: (j, i))
    replace(folder / METADATA, ("needsUnwrapping: 0", "needsUnwrapping: 1"))
    assert only(folder, "needs-unwrapping").where == METADATA
    replace(folder / METADATA, ("needsUnwrapping: 1", "needsUnwrapping: 0"))
    for path in folder.glob("*.png"):
        cv2.imwrite(str(path), np.full((6, 24, 3), 90, dtype=np.uint8))
    assert check_database(folder) == []


@pytest.mark.parametrize(
    ("preset", "seed"),
    quick(
        [("tiny", 0), ("tiny", 2), ("tiny", 3), ("tiny", 4), ("tussock-field", 0), ("meadow", 2), ("scrub", 1)],
        ("tiny", 0),
        ("tiny", 3),
        ("tussock-field", 0),
        ("scrub", 1),
    ),
)
def test_transposed_grids_have_a_problem_and_correct_ones_do_not(tmp_path, preset, seed):
    with open_renderer(World.generate(preset, seed), EYE, "cpu") as renderer:
        write_database(tmp_path / "correct", renderer, GRID)
    assert check_database(tmp_path / "correct") == []
    assert "transposed" in only(relabelled(tmp_path / "correct", tmp_path / "g", lambda i, j: (j, i)), "grid-axes").what


def test_the_sussex_grid_and_routes_are_correct(tmp_path, sussex):
    grid = Grid(begin=(2, 2), spacing=0.2, size=(30, 20))
    with open_renderer(read_world(sussex / "world5000_gray.bin"), Eye(width=90, height=19), "cpu") as renderer:
        write_database(tmp_path / "grid", renderer, grid)
        assert check_database(tmp_path / "grid") == []
        for name in ("ant1_route1", "ant4_route1"):
            write_database(tmp_path / name, renderer, read_route(sussex / f"{name}.bin").resampled(0.05).poses)
            assert check_database(tmp_path / name) == []


def test_headings_that_were_chosen_are_examined_as_they_were_read(route):
    (problem,) = check_database(route, headings="ccw")  # they are bearings
    assert problem.kind == "heading-convention"
    assert "--headings bearing reads" in problem.what


def test_a_convention_that_was_found_is_read_with_its_flag(route):
    text = (route / ENTRIES).read_text().splitlines()
    rows = [line.split(", ") for line in text[1:]]
    changed = [", ".join([*row[:3], str(90 - float(row[3])), *row[4:]]) for row in rows]  # counter-clockwise from +x
    (route / ENTRIES).write_text("\n".join([text[0], *changed]) + "\n")
    assert "--headings ccw" in only(route, "heading-convention").what
    assert check_database(route, "ccw") == check_database(route, "as-is") == []
    assert np.allclose(read_database(route, "ccw").poses, curve(), atol=1e-9)
    with pytest.raises(InputError, match="headings are 'north'"):
        read_database(route, "north")
