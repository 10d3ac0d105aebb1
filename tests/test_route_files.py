"""Routes as people bring them: understood, or refused in a line that says what they are."""

import io
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import trimesh

from tussock.navigation.cli.main import main
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.files import write_world
from tussock.world.geometry import Route
from tussock.world.route_columns import column_of
from tussock.world.route_files import read_route
from tussock.world.route_smoothing import jitter, smoothed
from tussock.world.scene import World

U = np.linspace(0, 1, 60)
XY = np.column_stack([0.3 + 2.4 * U, 0.5 + 1.6 * U**2])  # a bend from east to 53 degrees
HEADING = np.degrees(np.arctan2(3.2 * U, 2.4))
BEARING = 90 - HEADING
RADIANS = np.radians(HEADING)


def table(header: str | None, *columns, separator: str = ",", end: str = "\n") -> str:
    """A table as text."""
    rows = [
        separator.join(f"{value:.6f}" if not isinstance(value, str) else value for value in row)
        for row in zip(*columns, strict=True)
    ]
    return end.join([*([header] if header is not None else []), *rows, ""])


def write(folder: Path, name: str, content: str | bytes) -> Path:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder / name


def same(route: Route, headings: np.ndarray | None = HEADING) -> bool:
    expected = Route.through(XY).poses[:, 2] if headings is None else np.radians(headings)
    return bool(np.allclose(route.xy, XY, atol=2e-6) and np.allclose(route.poses[:, 2], expected, atol=2e-4))


X, Y = XY.T
TABLES = {
    "semicolons and decimal commas": ("r.csv", table("x_m;y_m;heading_deg", X, Y, HEADING, separator=";").replace(".", ",")),
    "tabs and decimal commas": ("r.txt", table("x\ty\theading", X, Y, HEADING, separator="\t").replace(".", ",")),
    "spaces and decimal commas": ("r.txt", table("x y heading", X, Y, HEADING, separator=" ").replace(".", ",")),
    "tabs, millimetres and radians": ("r.tsv", table("X [mm]\tY [mm]\tyaw (rad)", 1e3 * X, 1e3 * Y, RADIANS, separator="\t")),
    "spaces, centimetres": ("r.dat", table("x [cm]  y [cm]  Heading [deg]", 1e2 * X, 1e2 * Y, HEADING, separator="   ")),
    "a database's entries": ("database_entries.csv", table("X [mm], Y [mm], Z [mm], Heading [degrees], Filename",
        1e3 * X, 1e3 * Y, 0 * X, BEARING, ["a.png"] * 60, separator=", ")),
    "a geographer's": ("r.csv", table("Easting,Northing,bearing", X, Y, BEARING)),
    "a tracker's": ("r.csv", table("frame,time,pos_x,pos_y,likelihood,theta_deg", U, U, X, Y, U, HEADING)),
    "a rosbag's": ("r.csv", table("field.pose.position.x,field.pose.position.y,field.yaw_rad", X, Y, RADIANS)),
    "numpy's": ("r.txt", table("# x y heading", X, Y, HEADING, separator=" ")),
    "comments of MATLAB's": ("r.csv", "% made today\n\n" + table("x,y,heading", X, Y, HEADING).replace("\n", "\n% more\n", 1)),
    "Windows": ("r.csv", b"\xef\xbb\xbf" + table("x_m,y_m,heading_deg", X, Y, HEADING, end="\r\n").encode()),
    "UTF-16": ("r.csv", table("x_m,y_m,heading_deg", X, Y, HEADING).encode("utf-16")),
    "UTF-16 without a mark": ("r.csv", table("x_m;y_m;heading_deg", X, Y, HEADING, separator=";").encode("utf-16-le")),
    "an old Mac": ("r.csv", table("x_m,y_m,heading_deg", X, Y, HEADING, end="\r")),
    "camel case and feet": ("r.csv", table("posX [ft],posY [ft],headingDeg", X / 0.3048, Y / 0.3048, HEADING)),
    "a tracker's with a text before the names, and units below": ("r.txt", ('"Header lines";"4"\n"Trial";"1"\n\n'
        '"Time";"X center";"Y center";"Direction"\n"s";"cm";"cm";"deg"\n'
        + table(None, U, 1e2 * X, 1e2 * Y, HEADING, separator=";")).encode("utf-16")),
    "TrackMate's three lines of names, and units": ("r.csv", "LABEL,TRACK_ID,POSITION_X,POSITION_Y,yaw\nLabel,Track ID,X,Y,Yaw\n"
        + ",,(mm),(mm),(rad)\n" + table(None, ["ID1"] * 60, ["0"] * 60, 1e3 * X, 1e3 * Y, RADIANS)),
    "TRex's": ("r.csv", table("frame,X#wcentroid (cm),Y#wcentroid (cm),heading", U, 1e2 * X, 1e2 * Y, HEADING)),
    "ROS 1: names in a comment, text in the rows, a quaternion": ("r.csv", table(
        "%time,field.header.frame_id,field.pose.pose.position.x,field.pose.pose.position.y,field.pose.pose.orientation.x,"
        "field.pose.pose.orientation.y,field.pose.pose.orientation.z,field.pose.pose.orientation.w,field.twist.twist.linear.x",
        U, ["odom"] * 60, X, Y, 0 * X, 0 * X, np.sin(RADIANS / 2), np.cos(RADIANS / 2), U)),
    "TUM's": ("r.txt", table("# timestamp tx ty tz qx qy qz qw", U, X, Y, U, 0 * X, 0 * X, -np.sin(RADIANS / 2), -np.cos(RADIANS / 2),
        separator=" ")),
    "EuRoC's": ("r.csv", table("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []",
        U, X, Y, np.cos(RADIANS / 2), 0 * X, 0 * X, np.sin(RADIANS / 2))),
    "numbers of rows, tracks of which there is one": ("r.csv", table("id,ant_id,x,y,heading",
        [str(n) for n in range(60)], ["7"] * 60, X, Y, HEADING)),
    "spreadsheets": ("r.csv", table("x_m,y_m,heading_deg,,", X, Y, HEADING, [""] * 60, [""] * 60) + ",,,,\n,,,,\n"),
}  # fmt: skip


@pytest.mark.parametrize("kind", TABLES)
def test_tables_are_understood(tmp_path, caplog, kind):
    assert same(read_route(write(tmp_path, *TABLES[kind])))
    assert not caplog.records


@pytest.mark.parametrize(
    ("content", "columns"),
    [
        (table(None, 1e3 * X, 1e3 * Y, HEADING), "x [mm],y [mm],heading"),
        (table(None, U, HEADING, X, Y, separator=" "), "-,heading_deg,x,y"),
        (table(None, X, Y, U, RADIANS, separator=";").replace(".", ","), "x,y,-,theta_rad"),
        (table("x_m,X [mm],y_m,w", X, 7e3 * X, Y, HEADING), "x,-,y,heading"),
        (table("a;b;c", X, Y, HEADING, separator=";"), "x,y,heading"),
        (table(None, [f"2019-03-04 10:11:{n:02d}" for n in range(60)], X, Y, HEADING), "-,x,y,heading"),
        (table("ant,x,y,h", [str(n // 30) for n in range(60)], X, Y, HEADING), "-,x,y,heading"),
        (table(None, U, X, Y, 0 * X, 0 * X, np.sin(RADIANS / 2), np.cos(RADIANS / 2)), "-,x,y,qx,qy,qz,qw"),
    ],
)
def test_columns_are_named_by_the_flag(tmp_path, content, columns):
    assert same(read_route(write(tmp_path, "r.csv", content), columns=columns))
    with pytest.raises(InputError, match="--columns"):
        read_route(tmp_path / "r.csv")


@pytest.mark.parametrize("columns", ["x", "x,y,z", "x,x", "x [furlong],y", "x [px],y", ",", "x_m,X [mm],y", "x y"])
def test_names_of_columns_that_mean_nothing_are_refused(tmp_path, columns):
    with pytest.raises(InputError, match="--columns"):
        read_route(write(tmp_path, "r.csv", table(None, X, Y)), columns=columns)


REFUSED = {
    "a column twice by meaning": (table("x_m,X [mm],y_m", X, X, Y), "'x_m' and 'X \\[mm\\]' all hold x; choose with --columns"),
    "two headings": (table("x,y,yaw,bearing", X, Y, X, X), "'yaw' and 'bearing' all hold heading"),
    "pixels": (table("x_px,y_px", X, Y), "pixels; a route needs metres"),
    "an unknown unit": (table("x [furlong],y [furlong]", X, Y), "the unit of 'x \\[furlong\\]' is unknown"),
    "degrees on the globe": (table("latitude,longitude", X, Y), "in degrees on the globe; convert them to metres"),
    "no names": (table(None, X, Y, HEADING), "line 1: the columns have no names; give them, as --columns x,y,heading"),
    "many gaps": ("x,y\n" + "0,0\n1,1\n,\n2,2\nNaN,nan\n3,3\n", "line 4: x is ''; .* \\(2 of 6 rows lack a number"),
    "several tracks": (table("frame,ant_id,x,y", U, ["4", "7"] * 30, X, Y), "holds 2 tracks by its column 'ant_id' \\(4, 7\\)"),
    "pixels in a line of units": ("POSITION_X,POSITION_Y\n(pixel),(pixel)\n" + table(None, X, Y), "is in pixels"),
    "DeepLabCut": ("scorer,DLC,DLC,DLC\nbodyparts,head,head,head\ncoords,x,y,likelihood\n" + table(None, U, X, Y, U),
        "DeepLabCut .* pixels"),
    "a pointer of Git LFS": ("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n", "git lfs pull"),
    "noise": (bytes(range(256)) * 9, "neither text nor"),
    "an image": (b"\x89PNG\r\n\x1a\n" + bytes(99), "an image"),
    "a spreadsheet": (b"PK\x03\x04" + bytes(99), "save it as CSV"),
    "JSON": (json.dumps({"x": [1, 2]}), "JSON"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_other_things_are_refused_by_what_they_are(tmp_path, kind):
    content, message = REFUSED[kind]
    with pytest.raises(InputError, match=message) as refusal:
        read_route(write(tmp_path, "r.csv", content))
    assert str(tmp_path / "r.csv") in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_world_given_as_a_route_is_recognised(tmp_path):
    world = World.generate("tiny", 0)
    for suffix in ("glb", "ply"):
        write_world(world, tmp_path / f"w.{suffix}")
    box = trimesh.creation.box()
    for suffix in ("obj", "stl"):
        box.export(tmp_path / f"w.{suffix}")
    (tmp_path / "a.stl").write_text(str(box.export(file_type="stl_ascii")))
    planes = [*world.triangles.transpose(2, 1, 0).reshape(9, -1), *world.rgb.T / 255]
    np.concatenate(planes).astype("<f8").tofile(tmp_path / "w.bin")
    for name in ("w.glb", "w.ply", "w.obj", "w.stl", "a.stl", "w.bin"):
        for as_name in (name, "r.bin" if name == "w.bin" else "r.csv"):
            write(tmp_path, as_name, (tmp_path / name).read_bytes())
            with pytest.raises(InputError, match=r"it is a world .*give it as --world"):
                read_route(tmp_path / as_name)


@pytest.mark.parametrize("third", [0.0, 1.0])
def test_an_antworld_route_of_any_length_is_no_world(tmp_path, third):
    """Its third plane may lie between 0 and 1 as colours do, and its size may be that of a world."""
    path = write(tmp_path, "r.bin", np.array([100 * X, 100 * Y, third + 0 * X]).astype("<f8").tobytes())
    with pytest.raises(InputError, match=r"third plane may be a height \(cm\); --headings path"):
        read_route(path)
    assert same(read_route(path, headings="path"), None)
    assert same(read_route(path, headings="as-is"), np.full(60, third))


def test_a_folder_of_images_is_named(tmp_path):
    write(tmp_path, "database_entries.csv", "X [mm], Y [mm], Filename\n")
    with pytest.raises(InputError, match="--route-database"):
        read_route(tmp_path)


# Headings

OTHERS = {"bearing": BEARING, "radians": RADIANS, "radians-bearing": np.radians(BEARING), "clockwise": -HEADING}


@pytest.mark.parametrize("name", OTHERS)
def test_headings_in_another_convention_are_refused_with_its_flag(tmp_path, caplog, name):
    path = write(tmp_path, "r.csv", table("x_m,y_m,heading_deg", X, Y, OTHERS[name]))
    with pytest.raises(InputError, match=f"degrees off the path .* they fit; --headings {name} reads them so"):
        read_route(path)
    assert same(read_route(path, headings=name))
    assert same(read_route(path, headings="path"), None)
    assert same(read_route(path, headings="as-is"), OTHERS[name])
    assert not caplog.records


def test_a_convention_that_was_chosen_is_taken_with_a_remark(tmp_path, caplog):
    path = write(tmp_path, "r.csv", table("x_m,y_m,heading_deg", X, Y, HEADING))
    assert same(read_route(path, headings="bearing"), BEARING)
    assert "with --headings as given, headings are" in caplog.text


@pytest.mark.parametrize("name", ["ccw", "bearing"])
def test_a_column_in_radians_is_not_converted_twice(tmp_path, name):
    content = table("x_m,y_m,heading_rad", X, Y, RADIANS if name == "ccw" else np.radians(BEARING))
    path = write(tmp_path, "r.csv", content)
    assert same(read_route(path, headings=name))
    assert same(read_route(path, headings={"ccw": "radians", "bearing": "radians-bearing"}[name]))


def test_headings_that_are_all_zero_are_refused_and_others_remarked_upon(tmp_path, caplog):
    with pytest.raises(InputError, match=r"headings are all 0, .*--headings path takes the path's directions"):
        read_route(write(tmp_path, "r.csv", table("x_m,y_m,heading_deg", X, Y, 0 * X)))
    assert same(read_route(write(tmp_path, "r.csv", table("x_m,y_m,heading_deg", X, Y, 0 * X + 90))), 0 * X + 90)
    assert "constant 90 degrees; --headings path" in caplog.text


def test_an_empty_column_of_headings_is_none(tmp_path, caplog):
    assert same(read_route(write(tmp_path, "r.csv", table("x,y,heading", X, Y, [""] * 60))), None)
    assert "'heading' is empty" in caplog.text


def test_the_command_line_reads_headings_as_told(tmp_path, capsys):
    path = write(tmp_path, "r.csv", table(None, X, Y, BEARING))
    command = [
        "evaluate",
        "--world",
        "tiny",
        "--route",
        str(path),
        "--size",
        "60x12",
        "--json",
        "--columns",
        "x,y,heading",
    ]
    with pytest.raises(SystemExit) as refusal:
        main(command)
    assert refusal.value.code == 2
    assert "--headings bearing" in capsys.readouterr().err
    main([*command, "--headings", "bearing", "--smooth-m", "0.02"])
    assert json.loads(capsys.readouterr().out)["median_error_deg"] < 45


# Positions


def test_a_few_gaps_are_left_out_with_their_lines(tmp_path, caplog):
    rows = table("x_m,y_m,heading_deg", X, Y, HEADING).split("\n")
    rows[5], rows[30] = ",,", "nan,NaN,3"
    route = read_route(write(tmp_path, "r.csv", "\n".join(rows)))
    assert np.allclose(route.xy, np.delete(XY, [4, 29], axis=0), atol=1e-6)
    assert "2 of 60 rows lack a number and are left out (lines 6, 31)" in caplog.text


def test_many_repeated_points_are_counted(tmp_path, caplog):
    write(tmp_path, "r.csv", table("x_m,y_m,heading_deg", *np.repeat([X, Y, HEADING], 3, axis=1)))
    assert same(read_route(tmp_path / "r.csv"))
    assert "120 of 180 points repeat the one before" in caplog.text


def test_millimetres_without_a_unit_are_remarked_upon(tmp_path, caplog):
    read_route(write(tmp_path, "r.csv", table("x,y", 1e3 * X, 1e3 * Y)))
    assert "'x' and 'y' have no unit; taken as metres, the route is 2400 m wide" in caplog.text


def test_degrees_without_a_unit_are_remarked_upon(tmp_path, caplog):
    read_route(write(tmp_path, "r.csv", table("X,Y", 1e-2 * X, 50 + 1e-2 * Y)))
    assert "the route is 0.024 m wide. If they are degrees on the globe, convert them" in caplog.text


def test_numbers_of_rows_without_a_name_are_no_positions(tmp_path, caplog):
    rows = [f'"{n}"' for n in range(1, 61)]
    assert same(read_route(write(tmp_path, "r.txt", table('"x" "y" "heading"', rows, X, Y, HEADING, separator=" "))))
    assert "the first is taken as the number of the row" in caplog.text


def test_a_lost_animal_is_a_gap_however_it_is_written(tmp_path, caplog):
    rows = table("x_m,y_m,qx,qy,qz,qw", X, Y, 0 * X, 0 * X, np.sin(RADIANS / 2), np.cos(RADIANS / 2)).split("\n")
    rows[5], rows[30] = "inf,inf,0,0,0,1", f"{X[29]:.6f},{Y[29]:.6f},0,0,0,0"
    route = read_route(write(tmp_path, "r.csv", "\n".join(rows)))
    assert np.allclose(route.poses[:, 2], np.radians(np.delete(HEADING, [4, 29])), atol=1e-4)
    assert "2 of 60 rows lack a number and are left out (lines 6, 31)" in caplog.text


@pytest.mark.parametrize("up", [False, True])
def test_a_path_over_x_and_z_is_remarked_upon(tmp_path, caplog, up):
    columns = (X, 1 + 1e-4 * U, Y) if up else (X, Y, 1 + 1e-4 * U)
    read_route(write(tmp_path, "r.csv", table("pos_x,pos_y,pos_z", *columns)))
    assert ("if y is up, export the track with z up" in caplog.text) == up


def wavy(noise: float, rows: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    """A path of 3.2 m, without and with noise (m)."""
    s = np.linspace(0, 3, rows)
    exact = np.column_stack([s, 0.3 * np.sin(2 * s)])
    return exact, exact + np.random.default_rng(0).normal(0, noise, exact.shape)


def test_jitter_is_measured_and_smoothed(tmp_path, caplog):
    exact, noisy = wavy(0.004)
    assert jitter(noisy) == pytest.approx(0.004, rel=0.1)
    assert jitter(exact) < 1e-6
    path = write(tmp_path, "r.csv", table("x_m,y_m", *noisy.T))
    assert read_route(path).length > 15
    assert "positions jitter by about 0.0039 m" in caplog.text
    assert "--smooth-m 0.04 averages them" in caplog.text
    caplog.clear()
    route = read_route(path, smooth=0.04)
    assert not caplog.records
    assert route.length == pytest.approx(Route.through(exact).length, rel=0.01)
    assert Route.through(exact).nearest(route.xy)[0][100:-100].max() < 0.002


def test_smoothing_keeps_straight_lines_and_ends():
    line = np.column_stack([np.linspace(0, 2, 50), np.linspace(1, 5, 50)])
    assert np.allclose(smoothed(line, 0.3), line, atol=1e-3)
    _, noisy = wavy(0.01, 200)
    assert np.allclose(smoothed(noisy, 0.1)[[0, -1]], noisy[[0, -1]])
    with pytest.raises(SettingError, match="no two of its points"):
        smoothed(line, 100.0)


# Arrays


def mat(version: str = "5", compressed: bool = False, **variables) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, format=version, do_compression=compressed)
    return stream.getvalue()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


MATRIX = np.column_stack([XY, HEADING])
ARRAYS = {
    "vectors": ("r.mat", mat(x=X, y=Y, heading=HEADING), None),
    "a matrix": ("r.mat", mat(route=MATRIX, name="ant"), None),
    "a matrix that lies": ("r.mat", mat(compressed=True, route=MATRIX.T), None),
    "version 4": ("r.mat", mat("4", route=MATRIX), None),
    "a struct": ("r.mat", mat(data={"x_mm": 1e3 * X, "y_mm": 1e3 * Y, "theta_rad": RADIANS}), None),
    "one of several": ("r.mat", mat(a=MATRIX, b=XY[:, ::-1]), "a"),
    "chosen vectors": ("r.mat", mat(px=X, py=Y, w=HEADING, x=Y, y=X), "px,py,w"),
    "a struct's": ("r.mat", mat(s={"px": X, "py": Y, "yaw_rad": RADIANS}), "s.px,s.py,s.yaw_rad"),
    "columns": ("r.mat", mat(a=np.column_stack([XY, U, RADIANS])), "x,y,-,theta_rad"),
    "columns of one": ("r.mat", mat(a=np.column_stack([XY, U, HEADING]), b=MATRIX), "a:x,y,-,heading"),
    "npy": ("r.npy", npy(MATRIX), None),
    "npy in columns": ("r.csv", npy(np.asfortranarray(MATRIX)), None),
    "structured npy": ("r.npy", npy(np.rec.fromarrays([X, Y, HEADING], names="x,y,heading")), None),
}  # fmt: skip


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_are_understood(tmp_path, kind):
    name, content, columns = ARRAYS[kind]
    assert same(read_route(write(tmp_path, name, content), columns=columns))


def test_several_tracks_in_arrays_are_refused(tmp_path):
    path = write(tmp_path, "r.mat", mat(x_pos=np.repeat(X, 2), y_pos=np.repeat(Y, 2), identity=np.tile([0.0, 1.0], 60)))
    with pytest.raises(InputError, match="holds 2 tracks by its column 'identity'"):
        read_route(path)
    assert len(read_route(path, columns="x_pos,y_pos").xy) == 60


def test_npz_holds_arrays_by_name(tmp_path):
    np.savez_compressed(tmp_path / "r.npz", x=X, y=Y, heading=HEADING)
    assert same(read_route(tmp_path / "r.npz"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (mat(a=MATRIX, b=XY), r"it holds a \(60 x 3\), b \(60 x 2\); .*--columns NAME"),
        (mat(a="text"), "no arrays of numbers"),
        (mat(x=X, y=Y[1:]), r"different lengths \(x 60, y 59\)"),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + b"\x89HDF\r\n\x1a\n", "save it with -v7"),
        (mat(a=MATRIX)[:500], "damaged MAT-file"),
        (b"x,y\n1,2\n", "not a MAT-file"),
    ],
)
def test_other_mat_files_are_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        read_route(write(tmp_path, "r.mat", content))


def claims() -> list[tuple[str, bytes]]:
    """Small files that claim to hold gigabytes."""
    whole, four = mat(a=np.arange(6.0).reshape(2, 3)), mat("4", a=np.arange(6.0).reshape(2, 3))
    sizes = np.array([2, 3], "<i4").tobytes()
    huge = np.array([2**14, 2**14], "<i4").tobytes()
    cells = mat(a=np.array([[1, 2, 3], [4, 5, 6]], dtype=object))
    array = npy(np.zeros((10, 3)))
    return [
        ("r.mat", whole.replace(sizes, huge)),
        ("r.mat", cells.replace(sizes, huge)),
        ("r.mat", whole[:132] + np.uint32(2**31).tobytes() + whole[136:]),
        ("r.mat", whole.replace(np.array([9, 48], "<u4").tobytes(), np.array([9, 2**31], "<u4").tobytes())),
        ("r.mat", four[:4] + huge + four[12:]),
        ("r.npy", array.replace(b"(10, 3), }", b"(99999999, 3), }")),
    ]


@pytest.mark.parametrize("number", range(6))
def test_a_claim_of_gigabytes_allocates_nothing(tmp_path, number):
    name, content = claims()[number]
    assert content not in (mat(a=np.arange(6.0).reshape(2, 3)), npy(np.zeros((10, 3))))
    path = write(tmp_path, name, content)
    read_route(write(tmp_path, "good.mat", mat(a=MATRIX)))  # imports what it needs
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"damaged|cannot be read"):
            read_route(path)
        assert tracemalloc.get_traced_memory()[1] < 10**7
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "axis", "factor", "bearing"),
    [
        ("x", "x", 1, False), ("X [mm]", "x", 1e-3, False), ("y (cm)", "y", 1e-2, False), ("position_x_m", "x", 1, False),
        ("UTM Easting", "x", 1, False), ("centroidY", "y", 1, False), ("yaw_rad", "heading", 1, False),
        ("compass heading [deg]", "heading", np.pi / 180, True), ("azimuth", "heading", np.pi / 180, True),
        ("time", None, 0, False), ("x1", None, 0, False), ("vx", None, 0, False), ("pitch", None, 0, False), ("", None, 0, False),
    ],
)  # fmt: skip
def test_names_of_columns(name, axis, factor, bearing):
    column = column_of(name)
    if axis is None:
        assert column is None
    else:
        assert column is not None
        assert (column.axis, column.factor, column.bearing) == (axis, factor, bearing)


def test_names_in_a_comment_without_rows_are_no_route(tmp_path):
    (tmp_path / "empty.csv").write_text("# x_m,y_m,heading_deg\n")
    with pytest.raises(FileError):
        read_route(tmp_path / "empty.csv")
