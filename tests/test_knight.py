"""knight2019 on a made database in the published format: its numbers by plain loops, and what it refuses."""

import json
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from commands import tussock

from tussock.navigation.cli.main import main
from tussock.navigation.studies.protocols import KNIGHT2019
from tussock.navigation.studies.protocols.knight2019 import (
    CONSTRAINED,
    FULL,
    INFOMAX,
    PERFECT,
    best_headings,
    infomax,
    perfect_memory,
)
from tussock.navigation.studies.protocols.knight2019_published import PUBLISHED
from tussock.navigation.studies.protocols.library_square import (
    Recorded,
    nearest_segment,
    read_set,
    simplified,
)
from tussock.world.errors import FileError

WIDTH, HEIGHT = 240, 50  # of the images in the files, twice as fine as those that are compared
POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:{}\nsize 12345\n".format("0" * 64)


def panorama(x: float, y: float) -> np.ndarray:
    """A grey panorama that changes with the position (m); its column 0 looks along 0 degrees."""
    azimuth = np.arange(WIDTH) * 2 * np.pi / WIDTH
    waves = [np.sin(k * azimuth + 0.05 * k * x + 0.03 * (k + 1) * y + k**2) / k for k in range(1, 9)]
    skyline = 0.5 + 0.2 * np.sum(waves, axis=0)
    rows = np.linspace(1, 0, HEIGHT)[:, None]
    return (255 * (rows < skyline)).astype(np.uint8) // 2 + (60 * (1 + np.sin(7 * azimuth))).astype(np.uint8)


def facing(image: np.ndarray, heading: float) -> np.ndarray:
    """A panorama as it is seen at a heading (degrees): moved left."""
    return np.roll(image, -round(heading / 360 * image.shape[1]), axis=1)


def write_images(folder: Path, poses: list[tuple[float, float, float]], grid: bool = False) -> None:
    """An image database of poses (m, m, degrees) as the published ones are."""
    folder.mkdir(parents=True)
    lines = ["X [mm], Y [mm], Z [mm], Heading [degrees], Filename" + ", Grid X, Grid Y, Grid Z" * grid]
    for k, (x, y, heading) in enumerate(poses):
        cv2.imwrite(str(folder / f"image_{k}.png"), facing(panorama(x, y), heading))
        lines.append(f"{1000 * x:g}, {1000 * y:g}, 0, {heading:g}, image_{k}.png" + f", {k}, 0, 0" * grid)
    (folder / "database_entries.csv").write_text("\n".join(lines) + "\n")
    kind = "grid" if grid else "route"
    (folder / "database_metadata.yaml").write_text(f"%YAML:1.0\n---\nmetadata:\n   type: {kind}\n")


def write_square(folder: Path, positions: int) -> Path:
    """Route 1, an L of 3 m and 2 m with jitter of 2 cm, and a grid of 1.2 m; masks only."""
    random = np.random.default_rng(3)
    line = [(0.3 * k, 0.0, 0.0) for k in range(10)] + [(3.0, 0.25 * k, 90.0) for k in range(9)]
    jitter = random.uniform(-0.02, 0.02, (19, 2))
    route = [(x + dx, y + dy, heading) for (x, y, heading), (dx, dy) in zip(line, jitter, strict=True)]
    write_images(folder / "routes" / "route1" / "mask", route)
    (folder / "routes" / "route1" / "decimate.sh").write_text("DECIMATE_DISTANCE=30\n")
    places = [(1.2 * i - 3.6, 1.2 * j - 3.6, -90.0) for i in range(positions) for j in range(positions)]
    write_images(folder / "image_grids" / "mid_day" / "mask", places, grid=True)
    return folder


@pytest.fixture(scope="module")
def database(tmp_path_factory) -> Path:
    return write_square(tmp_path_factory.mktemp("square"), 9)


@pytest.fixture(scope="module")
def few(tmp_path_factory) -> Path:
    """The same with few positions."""
    return write_square(tmp_path_factory.mktemp("few"), 4)


def reduced(folder: Path) -> list[np.ndarray]:
    """The images of a folder, as the original loads them."""
    names = [line.split(", ")[4] for line in (folder / "database_entries.csv").read_text().splitlines()[1:]]
    return [cv2.resize(cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE), (120, 25)) for name in names]


def poses(folder: Path) -> list[list[float]]:
    return [
        list(map(float, line.split(", ")[:4]))
        for line in (folder / "database_entries.csv").read_text().splitlines()[1:]
    ]


def wrapped(degrees: float) -> float:
    return (degrees + 180) % 360 - 180


def by_loops(folder: Path, corners: list[tuple[float, float]], within: float | None) -> tuple[int, float]:
    """How many positions are tested, and the root-mean-square error of perfect memory (degrees), by plain loops."""
    route, grid = folder / "routes" / "route1" / "mask", folder / "image_grids" / "mid_day" / "mask"
    learned, errors = reduced(route), []
    for image, (x, y, _, heading) in zip(reduced(grid), poses(grid), strict=True):
        best = None
        for (ax, ay), (bx, by) in pairwise(corners):
            along = np.array([bx - ax, by - ay])
            share = np.clip(np.dot([x / 1000 - ax, y / 1000 - ay], along) / np.dot(along, along), 0, 1)
            away = np.hypot(*(np.array([x / 1000, y / 1000]) - [ax, ay] - share * along))
            if best is None or away < best[0] - 1e-9:
                best = away, np.degrees(np.arctan2(along[1], along[0]))
        if best[0] >= 4:
            continue
        least, chosen = np.inf, None
        for other in learned:
            for c in range(120):
                candidate = heading + 3 * (c - 120 if c > 60 else c)
                if within is not None and abs(wrapped(candidate - best[1])) >= within:
                    continue
                difference = np.abs(np.roll(image, -c, axis=1).astype(int) - other).sum()
                if difference < least:
                    least, chosen = difference, candidate
        errors.append(wrapped(chosen - best[1]))
    return len(errors), float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.slow
def test_errors_are_those_of_plain_loops(database):
    results = KNIGHT2019.measure(database, 0, lambda done, total: None)
    table = results.tables["errors"].set_index(["route", "memory", "scan", "images"])
    learned, _ = read_set(database, "route1", "mask")
    corners = [tuple(each) for each in simplified(learned.xy, 0.3)]
    assert len(corners) == 3
    for scan, within in ((FULL, None), (CONSTRAINED, 90.0)):
        row = table.loc["route1", PERFECT, scan, "mask"]
        count, error = by_loops(database, corners, within)
        assert (row["positions"], row["obtained"]) == (count, pytest.approx(error, abs=1e-9))
        assert row["low"] <= row["obtained"] <= row["high"]
    assert (
        table["obtained"].notna().sum() == results.numbers["errors obtained"] == 8
    )  # mask, and the horizon made of it
    assert len(table) == results.numbers["errors published"] == 96


def test_the_published_numbers():
    assert len(PUBLISHED) == 96
    assert PUBLISHED["route3", "PerfectMemory", "mask"] == 8.28641
    assert PUBLISHED["route6", "InfoMaxConstrained", "unwrapped"] == 47.2201
    assert all(PUBLISHED[route, f"{memory}Constrained", kind] <= PUBLISHED[route, memory, kind]
               for route, memory, kind in PUBLISHED if not memory.endswith("Constrained"))  # fmt: skip


@pytest.mark.parametrize("compare", [perfect_memory, infomax])
@pytest.mark.parametrize("heading", [0.0, 33.0, -120.0, 177.0])
def test_the_heading_of_a_learned_place_is_recovered(compare, heading):
    """A place that was learned at one heading, seen at another: the difference is least at the learned one."""
    image = panorama(1.0, 2.0)[::2, ::2]
    learned = Recorded(images=facing(image, heading)[None], xy=np.zeros((1, 2)), facing=np.zeros(1))
    seen = Recorded(images=facing(image, -90.0)[None], xy=np.zeros((1, 2)), facing=np.full(1, -90.0))
    (found,) = best_headings(*compare(learned, seen, 0), seen.facing, np.zeros(1))
    assert wrapped(found - heading) == 0


def test_of_equal_differences_the_first_image_then_the_first_rotation_counts():
    differences = np.array([[5.0, 2, 2, 9, 2, 5]])
    which = np.array([[0, 3, 1, 0, 1, 0]])
    assert best_headings(differences, which, np.array([10.0]), np.zeros(1)) == [10 + 2 * 60]
    assert best_headings(differences, which, np.array([10.0]), np.array([-110.0]), 80.0) == [10 - 2 * 60]
    assert best_headings(differences, which, np.array([10.0]), np.array([70.0]), 20.0) == [10 + 60]


def test_a_line_is_simplified():
    steps = np.linspace(0, 1, 50)
    line = np.concatenate([np.column_stack([steps, 0.02 * np.sin(40 * steps)]), np.column_stack([np.ones(50), steps])])
    assert simplified(line, 0.05).tolist() == [line[0].tolist(), pytest.approx([1.0, 0.0], abs=0.06), line[-1].tolist()]
    assert len(simplified(line, 2.0)) == 2
    assert simplified(line[:1].repeat(5, axis=0), 0.1).shape == (2, 2)  # a robot that stands


def test_the_nearest_segment():
    corners = np.array([[0.0, 0], [2, 0], [2, 2]])
    distance, number, direction = nearest_segment(np.array([[1.0, 1.0], [3, 1], [-1, 0], [2, -1]]), corners)
    assert distance.tolist() == [1, 1, 1, 1]
    assert number.tolist() == [0, 1, 0, 0]  # of two that are as near, the first
    assert direction.tolist() == [0, 90, 0, 0]


def test_the_command_writes_a_page_with_both_numbers(few, tmp_path, capsys):
    out = tmp_path / "report"
    main(["replicate", "knight2019", "--database", str(few), "--out", str(out), "--json"])
    printed = capsys.readouterr()
    assert "lacks 22 of the 24 sets of images" in printed.err
    assert set(json.loads(printed.out)["claims"]) == {claim.key for claim in KNIGHT2019.claims}
    results = json.loads((out / "results.json").read_text())
    assert len(results["tables"]["errors"]["data"]) == 96
    page = (out / "report.html").read_text(encoding="utf-8")
    assert {item.name for item in KNIGHT2019.items} <= {text.partition('"')[0] for text in page.split('id="')}
    assert "tussock replicate knight2019 --database" in page
    before = (out / "results.json").read_bytes()
    main(["replicate", "knight2019", "--database", str(few), "--out", str(out), "--json"])
    assert (out / "results.json").read_bytes() == before


def test_pointers_of_git_lfs_are_one_line(database, tmp_path, capfd):
    route = tmp_path / "square" / "routes" / "route1" / "mask"
    write_images(route, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    write_images(tmp_path / "square" / "image_grids" / "mid_day" / "mask", [(0.0, 0.0, -90.0)], grid=True)
    (route / "image_1.png").write_text(POINTER)
    code, _, err = tussock(
        capfd, "replicate", "knight2019", "--database", tmp_path / "square", "--out", tmp_path / "out"
    )
    assert code == 2
    lines = [line for line in err.splitlines() if line.startswith("tussock:")]
    assert len(lines) == 1
    assert "image_1.png" in lines[0]
    assert "git lfs pull" in lines[0]


def test_another_folder_is_refused_with_what_to_fetch(tmp_path):
    with pytest.raises(FileError, match=r"sussex_library_square_data, after git lfs pull"):
        KNIGHT2019.measure(tmp_path, 0, lambda done, total: None)


def test_infomax_is_the_same_for_a_seed(few):
    learned, grid = read_set(few, "route1", "horizon")
    assert learned.images.shape[1:] == (1, 120)
    first, again, other = (infomax(learned, grid, seed)[0] for seed in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert INFOMAX in set(KNIGHT2019.measure(few, 0, lambda done, total: None).tables["summary"]["memory"])
