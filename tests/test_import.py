"""Databases made of pictures, videos and tables: what is where it was taken, whatever the columns are called."""

import json
import logging
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from commands import interrupted

from tussock.navigation.cli.main import main
from tussock.render.images.camera import Camera
from tussock.render.images.check import check_database
from tussock.render.images.database import read_database
from tussock.render.images.entries import ENTRIES
from tussock.render.images.importing import ImportSettings, import_database
from tussock.render.images.metadata import METADATA, read_metadata, write_metadata
from tussock.render.images.pictures import read_image
from tussock.render.images.track import read_track
from tussock.world.errors import FileError, InputError, SettingError

WIDTH, HEIGHT = 32, 8
N = 20
TURN = np.linspace(0, np.pi / 2, N)
BEND = np.column_stack([2 * np.sin(TURN), 2 - 2 * np.cos(TURN), TURN])  # facing along the path
CAMERA = Camera(lens="panorama", top=1.0, bottom=-0.2)


def picture(i: int, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """A smooth RGB picture, whose mean grey level is 10 i + 20."""
    wave = 15 * np.sin(np.linspace(0, 2 * np.pi, width, endpoint=False) + i)
    return np.rint(np.broadcast_to(wave[None, :, None] + 10 * i + 20, (height, width, 3))).astype(np.uint8)


def save(path: Path, image: np.ndarray) -> Path:
    cv2.imwrite(str(path), image[..., ::-1])
    return path


@pytest.fixture
def folder(tmp_path) -> Path:
    """Pictures p0.png to p19.png."""
    (tmp_path / "raw").mkdir()
    for i in range(N):
        save(tmp_path / "raw" / f"p{i}.png", picture(i))
    return tmp_path / "raw"


@pytest.fixture
def video(tmp_path) -> Path:
    """A video of the same pictures, 10 a second."""
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (WIDTH, HEIGHT))
    for i in range(N):
        writer.write(picture(i)[..., ::-1])
    writer.release()
    return tmp_path / "v.avi"


def table(path: Path, header: str, rows, separator: str = ",") -> Path:
    path.write_text("\n".join([header, *(separator.join(map(str, row)) for row in rows)]) + "\n")
    return path


def bearings() -> np.ndarray:
    return 90 - np.degrees(BEND[:, 2])


def levels(database) -> list[int]:
    """Which pictures the views are."""
    return np.rint((database.views().mean(axis=(1, 2, 3)) - 20) / 10).astype(int).tolist()


X_, Y_, H_ = BEND[:, 0], BEND[:, 1], np.degrees(BEND[:, 2])
PHOTOS = [f"p{i}.png" for i in range(N)]
TABLES = {
    "names of tussock": ("x_m,y_m,heading_deg,filename", [X_, Y_, H_, PHOTOS], ","),
    "names of BoB": ("X [mm], Y [mm], Heading [degrees], Filename", [1e3 * X_, 1e3 * Y_, 90 - H_, PHOTOS], ", "),
    "semicolons": ("image;Easting (cm);Northing (cm);yaw", [PHOTOS, 100 * X_, 100 * Y_, H_], ";"),
    "paths of another machine": (
        "image\tx [m]\ty [m]\tbearing_deg",
        [[rf"C:\data\{p}" for p in PHOTOS], X_, Y_, 90 - H_],
        "\t",
    ),
    "radians, no names": ("x_m,y_m,theta_rad", [X_, Y_, BEND[:, 2]], ","),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_any_columns_read_the_same(folder, tmp_path, name):
    header, columns, separator = TABLES[name]
    track = table(tmp_path / "t.csv", header, zip(*columns, strict=True), separator)
    if separator == ";":  # with decimal commas, as spreadsheets of many countries write them
        track.write_text(re.sub(r"(\d)\.(\d)", r"\1,\2", track.read_text()))
    database, written = import_database(tmp_path / "d", folder, track, CAMERA)
    assert written == len(database) == N
    assert np.allclose(database.poses, BEND, atol=1e-5)
    assert levels(database) == list(range(N))
    assert np.array_equal(database.views()[3], picture(3))
    assert check_database(tmp_path / "d") == []


def test_names_separated_by_spaces_keep_their_units(tmp_path):
    track = tmp_path / "t.txt"
    track.write_text('x [mm]  y [mm]  filename\n1000 2000 "a 1.png"\n3000 2500 b.png\n')
    read = read_track(track)
    assert np.array_equal(read.poses[:, :2], [[1.0, 2.0], [3.0, 2.5]])
    assert read.names == ["a 1.png", "b.png"]


def test_columns_that_names_do_not_tell_are_given(folder, tmp_path):
    rows = [(i, *BEND[i], f"p{i}.png") for i in range(N)]
    track = table(tmp_path / "t.csv", "n,U,V,W,F", rows)
    with pytest.raises(FileError, match=r"no column x.*--columns x=NAME"):
        read_track(track)
    mapped = read_track(track, "x=U,y=V,heading=W,filename=F", headings="radians")
    assert np.allclose(mapped.poses, BEND)
    assert mapped.names == [f"p{i}.png" for i in range(N)]
    bare = tmp_path / "bare.csv"
    bare.write_text("".join(f"{i},{x},{y},{h},p{i}.png\n" for i, (x, y, h) in enumerate(BEND)))
    named = read_track(bare, "-,x,y,heading_rad,filename")
    assert np.allclose(named.poses, BEND)
    with pytest.raises(SettingError, match="--columns 'x=Q'"):
        read_track(track, "x=Q")
    track.write_text("lat,lon,yaw\n50.86806,-0.09823,0\n50.86807,-0.09824,0\n")
    for columns in (None, "x=lon,y=lat"):
        with pytest.raises(FileError, match="degrees on the globe"):
            read_track(track, columns)


def test_headings_of_another_convention_are_refused_with_its_name(folder, tmp_path):
    track = table(
        tmp_path / "t.csv", "x_m,y_m,heading", [(x, y, b) for (x, y, _), b in zip(BEND, bearings(), strict=True)]
    )
    with pytest.raises(FileError, match="--headings bearing"):
        import_database(tmp_path / "d", folder, track, CAMERA)
    assert not (tmp_path / "d").exists()
    database, _ = import_database(tmp_path / "d", folder, track, CAMERA, ImportSettings(headings="bearing"))
    assert np.allclose(database.poses, BEND, atol=1e-6)
    database, _ = import_database(tmp_path / "p", folder, track, CAMERA, ImportSettings(headings="path"))
    assert np.abs(database.poses[:, 2] - BEND[:, 2]).max() < 0.09


def test_what_is_assumed_is_logged(folder, tmp_path, caplog):
    track = table(tmp_path / "t.csv", "x,y", BEND[:, :2])
    with caplog.at_level(logging.INFO, "tussock"):
        import_database(tmp_path / "d", folder, track)
    said = "\n".join(record.getMessage() for record in caplog.records)
    for words in (
        "no unit and is taken as metres",
        "no column of headings",
        "names no pictures",
        "taken as a panorama",
        "--top-deg",
    ):
        assert said.count(words) == 1
    assert all("\n" not in record.getMessage() for record in caplog.records)


def test_positions_far_from_the_origin_keep_their_millimetres(folder, tmp_path):
    rows = [(704497000 + 1e3 * x, 5638660000 + 1e3 * y, 0) for x, y, _ in BEND]
    track = table(tmp_path / "t.csv", "x_mm,y_mm,heading_deg", rows)
    database, _ = import_database(tmp_path / "d", folder, track, CAMERA, ImportSettings(headings="as-is"))
    assert np.abs(database.poses[:, :2] - [704497, 5638660] - BEND[:, :2]).max() < 1e-6


# Videos.


def test_frames_are_taken_by_number_and_by_time(video, tmp_path):
    rows = [(3 * i, *BEND[i, :2], bearings()[i]) for i in range(6)]
    by_number = table(tmp_path / "n.csv", "frame,x_m,y_m,bearing", rows)
    database, _ = import_database(tmp_path / "n", video, by_number, CAMERA)
    assert levels(database) == [0, 3, 6, 9, 12, 15]
    by_time = table(
        tmp_path / "t.csv", "time_ms,x_m,y_m,bearing", [(5000 + 300 * i, *row[1:]) for i, row in enumerate(rows)]
    )
    assert levels(import_database(tmp_path / "t", video, by_time, CAMERA)[0]) == [0, 3, 6, 9, 12, 15]
    later = import_database(tmp_path / "s", video, by_time, CAMERA, ImportSettings(start=4.8))[0]
    assert levels(later) == [2, 5, 8, 11, 14, 17]
    with pytest.raises(FileError, match="line 2: it is before the first frame"):
        import_database(tmp_path / "e", video, by_time, CAMERA, ImportSettings(start=5.2))


def test_every_frame_between_rows_is_interpolated(video, tmp_path):
    track = table(
        tmp_path / "t.csv", "frame,x_m,y_m,heading_deg", [(0, 0, 0, 170), (10, 1, 0, -170), (19, 1, 0.9, -170)]
    )
    database, _ = import_database(tmp_path / "d", video, track, CAMERA, ImportSettings(every=5, headings="as-is"))
    assert levels(database) == [0, 5, 10, 15]
    assert np.allclose(database.poses[:, :2], [(0, 0), (0.5, 0), (1, 0), (1, 0.5)])
    assert np.allclose(np.degrees(database.poses[:, 2]) % 360, [170, 180, 190, 190])


def test_a_row_for_each_frame_and_unsorted_frames(video, tmp_path):
    track = table(tmp_path / "a.csv", "x_m,y_m,heading_rad", BEND)
    assert levels(import_database(tmp_path / "a", video, track, CAMERA)[0]) == list(range(N))
    back = table(tmp_path / "b.csv", "frame,x_m,y_m", [(i, i / 10, 0) for i in (7, 3, 3, 11)])
    assert levels(import_database(tmp_path / "b", video, back, CAMERA, ImportSettings(headings="path"))[0]) == [
        7,
        3,
        3,
        11,
    ]
    few = table(tmp_path / "c.csv", "x_m,y_m,heading_rad", BEND[:5])
    with pytest.raises(FileError, match=r"5 rows and v\.avi 20 frames"):
        import_database(tmp_path / "c", video, few, CAMERA)
    far = table(tmp_path / "f.csv", "frame,x_m,y_m", [(0, 0, 0), (10**9, 1, 0)])
    with pytest.raises(FileError, match="20 frames that can be read; there is no frame 1000000000"):
        import_database(tmp_path / "f", video, far, CAMERA, ImportSettings(headings="path"))


# Grids, masks, and completing.


def test_a_grid_has_its_indices_and_metadata(folder, tmp_path):
    rows = [(0.5 * (i % 5), 0.25 * (i // 5), 90) for i in range(N)]
    track = table(tmp_path / "t.csv", "x_m,y_m,bearing", rows)
    database, _ = import_database(tmp_path / "d", folder, track, CAMERA, ImportSettings(kind="grid"))
    assert database.kind == "grid"
    assert database.columns["Grid X"][:6] == ("0", "1", "2", "3", "4", "0")
    assert database.metadata["grid"] == {
        "beginAtMM": [0.0, 0.0, 0.0],
        "separationMM": [500.0, 250.0, 0.0],
        "size": [5, 4, 1],
    }
    assert database.names[6] == "image_+000500_+000250_+000000.png"
    assert [each for each in check_database(tmp_path / "d") if each.kind != "grid-axes"] == []
    with pytest.raises(FileError, match="a grid needs a column of headings"):
        import_database(
            tmp_path / "e",
            folder,
            table(tmp_path / "u.csv", "x_m,y_m", [r[:2] for r in rows]),
            CAMERA,
            ImportSettings(kind="grid"),
        )


@pytest.mark.parametrize("raw", [False, True])
def test_a_mask_is_unwrapped_and_kept_with_the_eye(tmp_path, raw):
    (tmp_path / "raw").mkdir()
    for i in range(3):
        save(tmp_path / "raw" / f"{i}.png", picture(i, 100, 100))
    mask = np.full((100, 100, 3) if raw else (8, 32, 3), 255, np.uint8)
    if raw:
        mask[50:, 45:55] = 0  # the pole behind
    else:
        mask[:, :2] = mask[:, -2:] = 0
    camera = Camera(lens="ring", centre=(49.5, 49.5), inner=10, outer=45, top=1.0, bottom=-0.2, width=32, height=8)
    track = table(tmp_path / "t.csv", "x_m,y_m,heading_rad", BEND[:3])
    database, _ = import_database(
        tmp_path / "d", tmp_path / "raw", track, camera, ImportSettings(mask=save(tmp_path / "m.png", mask))
    )
    eye = database.metadata["tussock"]["eye"]
    assert (eye["width"], eye["height"], eye["top"], eye["mask"]) == (32, 8, 1.0, "mask.png")
    kept = read_image(tmp_path / "d" / "mask.png")
    assert kept.shape == (8, 32, 3)
    assert (kept[:, [0, -1]] == 0).all()
    assert (kept[:, 5:-5] == 255).all()
    assert check_database(tmp_path / "d") == []
    save(tmp_path / "m.png", np.zeros((5, 77, 3), np.uint8))
    with pytest.raises(FileError, match="give a mask of the size"):
        import_database(tmp_path / "e", tmp_path / "raw", track, camera, ImportSettings(mask=tmp_path / "m.png"))


def test_a_picture_that_cannot_be_read_leaves_nothing(folder, tmp_path):
    track = table(tmp_path / "t.csv", "x_m,y_m,heading_rad", BEND)
    whole = (folder / "p7.png").read_bytes()
    (folder / "p7.png").write_bytes(b"text")
    covered = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    covered[:, :5] = 0
    mask = save(tmp_path / "m.png", covered)
    for _ in range(2):
        with pytest.raises(FileError, match=r"p7\.png cannot be read"):
            import_database(tmp_path / "d", folder, track, CAMERA, ImportSettings(mask=mask))
        assert not (tmp_path / "d").exists()
    (folder / "p7.png").write_bytes(whole)
    assert import_database(tmp_path / "d", folder, track, CAMERA)[1] == N


def test_a_transparent_part_of_a_mask_is_covered(folder, tmp_path, caplog):
    mask = np.full((HEIGHT, WIDTH, 4), 255, np.uint8)
    mask[:, :5, 3] = 0  # white, and transparent
    cv2.imwrite(str(tmp_path / "m.png"), mask)
    track = table(tmp_path / "t.csv", "x_m,y_m,heading_rad", BEND)
    import_database(tmp_path / "d", folder, track, CAMERA, ImportSettings(mask=tmp_path / "m.png"))
    assert "m.png covers 16 % of the panorama: kept as mask.png of the eye" in caplog.text
    kept = read_image(tmp_path / "d" / "mask.png")
    assert (kept[:, :5] == 0).all()
    assert (kept[:, 6:-1] == 255).all()


def test_an_interrupted_import_is_completed_and_another_one_is_refused(folder, tmp_path):
    track = table(tmp_path / "t.csv", "x_m,y_m,heading_rad", BEND)
    whole, _ = import_database(tmp_path / "a", folder, track, CAMERA)
    import_database(tmp_path / "b", folder, track, CAMERA)
    (tmp_path / "b" / "image_00004.png").unlink()
    lines = (tmp_path / "b" / ENTRIES).read_text().splitlines(keepends=True)
    (tmp_path / "b" / ENTRIES).write_text("".join(lines[:9]))
    assert import_database(tmp_path / "b", folder, track, CAMERA)[1] == 13
    again = read_database(tmp_path / "b")
    assert again.columns == whole.columns
    assert np.array_equal(again.views(), whole.views())
    assert import_database(tmp_path / "b", folder, track, CAMERA)[1] == 0
    for camera, settings in (
        (Camera(lens="panorama", top=0.9, bottom=-0.2), ImportSettings()),
        (CAMERA, ImportSettings(every=2)),
    ):
        with pytest.raises(FileError, match="differs in its"):
            import_database(tmp_path / "b", folder, track, camera, settings)
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "n.txt").write_text("mine")
    with pytest.raises(FileError, match="exists already"):
        import_database(tmp_path / "notes", folder, track, CAMERA)


def test_a_database_that_needs_unwrapping_is_imported_with_its_own_rows(folder, tmp_path):
    rows = [
        (1e3 * x, 1e3 * y, bearing, f"p{i}.png") for i, (x, y, bearing) in enumerate(np.c_[BEND[:, :2], bearings()])
    ]
    table(folder / ENTRIES, "X [mm], Y [mm], Heading [degrees], Filename", rows)
    for i in range(N):
        save(folder / f"p{i}.png", picture(i, 60, 60))
    ring = {"centre": [0.5, 0.5], "inner": 0.1, "outer": 0.45, "offsetDegrees": 90.0, "flip": 1}
    write_metadata(folder / METADATA, {"type": "route", "needsUnwrapping": 1, "unwrapper": ring})
    database, _ = import_database(tmp_path / "d", folder)
    assert np.array_equal(database.views(), read_database(folder).views())
    write_metadata(folder / METADATA, {"type": "route", "needsUnwrapping": 1, "imageInput": {"unwrapper": ring}})
    assert np.array_equal(import_database(tmp_path / "f", folder)[0].views(), database.views())
    assert not database.metadata["needsUnwrapping"]
    write_metadata(folder / METADATA, {"type": "route", "needsUnwrapping": 1})
    with pytest.raises(FileError, match="tussock unwrap"):
        read_database(folder).views()
    given = Camera(lens="ring", centre=(30.0, 30.0), inner=6, outer=27, offset=np.pi / 2, flip=True)
    assert np.array_equal(import_database(tmp_path / "e", folder, None, given)[0].views(), database.views())


def test_what_does_not_fit_together_is_refused_in_one_line(folder, video, tmp_path):
    good = [(*BEND[i, :2], f"p{i}.png") for i in range(N)]

    def refused(message: str, header: str, rows, source: Path = folder) -> None:
        track = table(tmp_path / "t.csv", header, rows)
        with pytest.raises(InputError, match=message) as refusal:
            import_database(tmp_path / "d", source, track, CAMERA, ImportSettings(headings="path"))
        assert "\n" not in str(refusal.value)
        assert not (tmp_path / "d").exists()

    refused("line 3: there is no picture '../v.avi'", "x_m,y_m,file", [good[0], (1, 2, "../v.avi")])
    refused("line 2: there is no picture '/etc/hosts'", "x_m,y_m,file", [(0, 0, "/etc/hosts")])
    refused("line 3: 'x_m' is 'far'", "x_m,y_m,file", [good[0], ("far", 2, "p1.png")])
    refused("line 2: 'x_m' is '1e300'", "x_m,y_m,file", [("1e300", 2, "p1.png")])
    refused("2 rows without names .* 20 pictures", "x_m,y_m", [(0, 0), (1, 1)])
    refused("no rows", "x_m,y_m", [])
    refused("may all hold the filename", "x_m,y_m,file,image", [(0, 0, "p0.png", "p1.png")])
    refused("is in pixels", "x_px,y_px,file", [(0, 0, "p0.png")])
    refused("frame is 'nan'", "x_m,y_m,frame", [(0, 0, "nan")], video)
    save(folder / "p7.png", picture(7, 16, 16))
    refused("p7.png is 16 x 16", "x_m,y_m,file", good[5:9])
    (folder / "p8.png").write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    refused("p8.png is only a pointer of Git LFS", "x_m,y_m,file", good[8:9])
    with pytest.raises(FileError, match="give one with --track"):
        import_database(tmp_path / "d", folder, None, CAMERA)


# The command line.


def run(capfd, *arguments) -> tuple[int, str, str]:
    capfd.readouterr()
    code = 0
    try:
        main(["database", "import", *map(str, arguments)])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, *capfd.readouterr()


def test_the_command_imports_a_sphere_as_jpeg(capfd, tmp_path):
    (tmp_path / "raw").mkdir()
    for i in range(4):
        save(tmp_path / "raw" / f"{i}.png", picture(i, 144, 72))
    track = table(tmp_path / "t.csv", "x,y,heading", [(100 * x, 100 * y, np.degrees(h)) for x, y, h in BEND[:4]])
    out = tmp_path / "d"
    arguments = [
        tmp_path / "raw",
        "--track",
        track,
        "--out",
        out,
        "--unit",
        "cm",
        "--headings",
        "ccw",
        "--lens",
        "equirectangular",
    ]
    code, printed, err = run(
        capfd, *arguments, "--size", "72x15", "--format", "jpg", "--top-deg", 60, "--bottom-deg", -15, "--json"
    )
    assert (code, err) == (0, f"{track} names no pictures: its rows are taken for 0.png to 3.png, in order\n")
    assert json.loads(printed) == {
        "database": str(out),
        "type": "route",
        "images": 4,
        "written": 4,
        "size": "72x15",
        "mask": None,
    }
    database = read_database(out)
    assert np.allclose(database.poses, BEND[:4], atol=1e-6)
    assert database.views().shape == (4, 15, 72, 3)
    assert np.degrees(read_metadata(out / METADATA)["tussock"]["eye"]["bottom"]) == pytest.approx(-15)
    code, _, err = run(capfd, tmp_path / "raw", "--track", track, "--out", tmp_path / "e", "--format", "gif")
    assert code == 2
    assert re.search("format is 'gif'", err)


def test_assumptions_are_repeated_only_where_images_are_written(capfd, folder, tmp_path):
    track = table(tmp_path / "t.csv", "x,y", BEND[:, :2])
    arguments = (folder, "--track", track, "--out", tmp_path / "d", "--lens", "panorama")
    code, _, first = run(capfd, *arguments)
    assert code == 0
    assert "is taken as metres" in first
    assert re.search(r"^written +0$", run(capfd, *arguments)[1], re.MULTILINE)
    assert run(capfd, *arguments)[2] == ""
    (tmp_path / "d" / "image_00004.png").unlink()
    assert run(capfd, *arguments)[2] == first
    code, _, err = run(capfd, *arguments, "--every", 2)
    assert (code, len(err.splitlines())) == (2, len(first.splitlines()) + 1)


def test_ctrl_c_leaves_a_database_that_a_second_run_completes(capfd, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (720, 152))
    for i in range(100):
        writer.write(picture(i % 20, 720, 152)[..., ::-1])
    writer.release()
    track = table(tmp_path / "t.csv", "x_m,y_m,heading_rad", [(i / 100, 0, 0) for i in range(100)])
    out = tmp_path / "d"
    arguments = [tmp_path / "v.avi", "--track", track, "--lens", "panorama", "--out"]
    code, err = interrupted(lambda: any(out.glob("image_*")), "database", "import", *arguments, out)
    assert (code, err.splitlines()[-1]) == (130, "tussock: interrupted")
    assert not list(out.glob(".*"))
    for path in out.glob("image_*"):
        read_image(path)
    if (out / ENTRIES).exists():
        assert len(read_database(out).views()) < 100
    assert run(capfd, *arguments, out)[0] == 0
    assert run(capfd, *arguments, tmp_path / "at once")[0] == 0
    both = [
        {path.name: path.read_bytes() for path in folder.iterdir() if path.name != METADATA}
        for folder in (out, tmp_path / "at once")
    ]
    assert both[0] == both[1]


def test_what_is_not_there_is_named_before_anything_else_is_wrong(capfd, folder, tmp_path):
    track = table(tmp_path / "t.csv", "x_m,y_m,heading", np.c_[BEND[:, :2], bearings()])
    new = ("--track", track, "--out", tmp_path / "d")
    for source in (tmp_path / "none", tmp_path / "none.mp4"):
        code, _, err = run(capfd, source, *new)
        assert (code, err) == (
            2,
            f"tussock: there is no folder or video {source}; give a folder of pictures, or a video\n",
        )
    code, _, err = run(capfd, track, *new)
    assert re.fullmatch(r"tussock: .*t\.csv is neither a folder of pictures nor a video .*\n", err)
    code, _, err = run(capfd, folder, "--track", track, "--out", folder)
    assert (code, err) == (2, f"tussock: {folder} exists already and is not an image database; give a new folder\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["raw", "t.csv"]


def test_flags_that_would_do_nothing_are_refused(capfd, folder, video, tmp_path):
    track = table(tmp_path / "t.csv", "x_m,y_m,heading_rad", BEND)
    framed = table(tmp_path / "f.csv", "frame,x_m,y_m,heading_rad", [(i, *BEND[i]) for i in range(N)])
    new = ("--out", tmp_path / "d", "--lens", "panorama")
    for arguments, words in (
        ((folder, "--track", track, *new, "--start-s", 3), "is a folder; leave it out"),
        ((video, "--track", track, *new, "--start-s", 3), "has no times"),
        ((video, "--track", framed, *new, "--start-s", 3), "has no times"),
        ((folder, "--track", track, *new, "--inner-px", 3), "inner of a ring, and the lens is 'panorama'"),
        ((folder, "--track", track, *new, "--top-deg", -20), "bottom is -15 and top is -20 degrees"),
        ((video, *new), "no table of where the pictures of .* were taken; give one with --track"),
    ):
        code, _, err = run(capfd, *arguments)
        assert (code, (tmp_path / "d").exists()) == (2, False), arguments
        assert re.search(words, err.splitlines()[-1]), err
    code, _, err = run(capfd, folder, "--track", track, "--out", tmp_path / "d", "--inner-px", 3)
    assert (code, err.splitlines()[-1].count("no ring was found")) == (2, 1)
