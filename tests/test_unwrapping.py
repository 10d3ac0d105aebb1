"""Raw pictures of panoramic lenses become the panoramas that they were made of; lenses agree with OpenCV; rings are found."""

import json
import math
import re

import attrs
import cv2
import numpy as np
import pytest
from commands import interrupted
from hypothesis import given, settings
from hypothesis import strategies as st

from tussock.navigation.cli.main import main
from tussock.render.eye import Eye
from tussock.render.images.calibration import read_calibration
from tussock.render.images.camera import Camera
from tussock.render.images.lenses import Fisheye, Omnidirectional, Panorama, PanoramaPart, Ring
from tussock.render.images.pictures import read_image
from tussock.render.images.ring_search import find_ring
from tussock.render.images.unwrapping import Unwrapping
from tussock.world.errors import FileError, InputError, SettingError

TOP, BOTTOM = np.radians(40), np.radians(-20)
EDGES = {"top": TOP, "bottom": BOTTOM}
RING = Ring(centre=(150.0, 140.0), inner=30.0, outer=120.0, top=TOP, bottom=BOTTOM)


def panorama(width: int = 120, height: int = 30, seed: int = 0) -> np.ndarray:
    """A smooth RGB panorama, from 40 to 240, that is continuous around its edge."""
    noise = np.random.default_rng(seed).uniform(40, 240, (5, 14, 3)).astype(np.float32)
    wide = cv2.resize(np.tile(noise, (1, 3, 1)), (3 * width, height), interpolation=cv2.INTER_LINEAR)
    return np.rint(wide[:, width : 2 * width]).astype(np.uint8)


def wrapped(view: np.ndarray, ring: Ring, height: int = 280, width: int = 300, surround: int = 5) -> np.ndarray:
    """The picture that a lens with this ring makes of a panorama: each pixel asks for its azimuth and elevation."""
    y, x = np.mgrid[:height, :width].astype(float)
    x, y = x - ring.centre[0], y - ring.centre[1]
    radius, clockwise = np.hypot(x, y), np.arctan2(x, -y)
    azimuth = (1 if ring.mirrored else -1) * (clockwise - ring.offset)
    share = (radius - ring.inner) / (ring.outer - ring.inner)
    row = ((1 - share) if ring.flip else share) * len(view) - 0.5
    column = (np.pi - azimuth) / (2 * np.pi) % 1 * view.shape[1] - 0.5
    padded = np.concatenate([view[:, -1:], view, view[:, :1]], axis=1)
    row = np.clip(row, 0, len(view) - 1)
    picture = cv2.remap(padded, (column + 1).astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)
    picture[(share < 0) | (share > 1)] = surround
    return picture


def unwrapping(lens, width: int = 120, height: int = 30, top: float = TOP, bottom: float = BOTTOM) -> Unwrapping:
    return Unwrapping(lens, width, height, top, bottom)


def error(one: np.ndarray, other: np.ndarray) -> float:
    """Mean difference in grey levels, without the rows next to the surround."""
    return float(np.abs(one[1:-1].astype(int) - other[1:-1]).mean())


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("offset", [0.0, 0.7, -2.0])
def test_a_wrapped_panorama_is_returned(flip, mirrored, offset):
    ring = Ring(
        centre=(150.3, 140.6), inner=30, outer=120, offset=offset, flip=flip, mirrored=mirrored, top=TOP, bottom=BOTTOM
    )
    view = panorama()
    assert error(unwrapping(ring)(wrapped(view, ring)), view) < 1.0
    assert error(np.roll(view, 3, axis=1), view) > 5  # so that the test above could fail


def test_up_in_the_picture_is_ahead_and_clockwise_is_to_the_right():
    picture = np.zeros((200, 200, 3), dtype=np.uint8)
    for colour, (x, y) in (((255, 0, 0), (100, 40)), ((0, 255, 0), (160, 100)), ((0, 0, 255), (40, 100))):
        cv2.circle(picture, (x, y), 12, colour, -1)
    view = unwrapping(Ring(centre=(100, 100), inner=20, outer=95))(picture)
    columns = [int(view[..., channel].sum(axis=0).argmax()) for channel in range(3)]
    assert np.allclose(columns, [60, 90, 30], atol=4)  # ahead, to the right, to the left, of 120


def test_the_inner_circle_is_the_upper_edge_unless_it_is_flipped():
    y, x = np.mgrid[:200, :200]
    picture = np.repeat((np.hypot(x - 100, y - 100) < 50)[..., None] * np.uint8(255), 3, axis=2)
    ring = {"centre": (100, 100), "inner": 10, "outer": 90, **EDGES}
    view, flipped = unwrapping(Ring(**ring))(picture), unwrapping(Ring(**ring, flip=True))(picture)
    assert view[2].min() == flipped[-3].min() == 255
    assert view[-3].max() == flipped[2].max() == 0


@settings(max_examples=20, derandomize=True, deadline=None)
@given(st.integers(0, 119))
def test_turning_the_picture_rolls_the_panorama_and_so_does_the_offset(columns):
    view, turn = panorama(), columns * 2 * np.pi / 120
    turned = Ring(centre=(150, 140), inner=30, outer=120, offset=turn, **EDGES)
    picture = wrapped(view, RING)
    assert error(unwrapping(turned)(picture), np.roll(unwrapping(RING)(picture), -columns, axis=1)) < 1.0
    matrix = cv2.getRotationMatrix2D(RING.centre, -np.degrees(turn), 1)  # clockwise
    rotated = cv2.warpAffine(picture, matrix, (300, 280), flags=cv2.INTER_LINEAR)
    assert error(unwrapping(RING)(rotated), np.roll(unwrapping(RING)(picture), columns, axis=1)) < 1.5


def test_a_mirrored_picture_is_that_of_a_mirrored_lens():
    picture = wrapped(panorama(), RING)
    mirrored = Ring(centre=(299 - 150, 140), inner=30, outer=120, mirrored=True, **EDGES)
    assert np.array_equal(unwrapping(mirrored)(picture[:, ::-1].copy()), unwrapping(RING)(picture))


def test_a_panorama_of_the_same_size_is_returned_to_the_last_bit():
    view = panorama()
    lens = Panorama(width=120, height=30, top=TOP, bottom=BOTTOM)
    assert np.array_equal(unwrapping(lens)(view), view)
    rolled = Panorama(width=120, height=30, top=TOP, bottom=BOTTOM, offset=np.pi / 2)
    assert np.array_equal(unwrapping(rolled)(view), np.roll(view, -30, axis=1))
    mirrored = Panorama(width=120, height=30, top=TOP, bottom=BOTTOM, mirrored=True)
    assert np.array_equal(unwrapping(mirrored)(view), view[:, ::-1])
    assert unwrapping(lens).seen(30, 120).all()


def test_rows_of_a_sphere_are_cut_out_and_averaged():
    sphere = panorama(720, 360)
    view = unwrapping(Panorama(width=720, height=360), 180, 15, np.radians(60), np.radians(0))(sphere)
    expected = cv2.resize(sphere[60:180], (180, 15), interpolation=cv2.INTER_AREA)
    assert np.abs(view.astype(int) - expected).max() <= 1


def test_a_picture_is_averaged_where_a_pixel_covers_many_of_it():
    checks = np.indices((280, 300)).sum(axis=0) % 2 * np.uint8(255)
    picture = np.repeat(checks[..., None].astype(np.uint8), 3, axis=2)
    view = unwrapping(RING, 12, 3)(picture)
    assert np.abs(view.astype(int) - 127).max() < 8


K = np.array([[300, 0, 320], [0, 310, 240], [0, 0, 1.0]])
D = np.array([0.05, -0.01, 0.002, -0.001])
FISHEYE = {"matrix": (300.0, 310.0, 320.0, 240.0, 0.0), "distortion": tuple(D.tolist())}


def test_a_fisheye_lens_agrees_with_opencv():
    azimuth, elevation = np.linspace(-1.2, 1.2, 9), np.linspace(-0.8, 0.8, 7)
    pixels = Fisheye(**FISHEYE, looking="ahead").pixels(azimuth, elevation)
    level = np.cos(elevation)[:, None]
    down = np.broadcast_to(-np.sin(elevation)[:, None], (7, 9))
    points = np.stack([-level * np.sin(azimuth), down, level * np.cos(azimuth)], axis=2).reshape(-1, 1, 3)
    expected = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), K, D)[0].reshape(7, 9, 2)
    assert np.abs(pixels - expected).max() < 1e-9


def omnidirectional_pixels(points: np.ndarray, xi: float, k, d) -> np.ndarray:
    """Mei and Rives 2007, equations 3 to 7, point by point."""
    found = []
    for point in points:
        x, y, z = point / np.linalg.norm(point)
        x, y = x / (z + xi), y / (z + xi)
        r2 = x * x + y * y
        radial = 1 + d[0] * r2 + d[1] * r2**2
        dx, dy = 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x), d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y
        found.append(k[:2, :2] @ [x * radial + dx, y * radial + dy] + k[:2, 2])
    return np.array(found)


@pytest.mark.parametrize(
    ("looking", "axes"), [("up", [(0, 1, 0), (-1, 0, 0), (0, 0, 1)]), ("down", [(0, -1, 0), (-1, 0, 0), (0, 0, -1)])]
)
def test_an_omnidirectional_lens_agrees_with_its_equations(looking, axes):
    azimuth, elevation = np.linspace(-3, 3, 9), np.linspace(-0.3, 0.8, 7) * (1 if looking == "up" else -1)
    lens = Omnidirectional(xi=0.9, **FISHEYE, looking=looking)
    a, e = np.meshgrid(azimuth, elevation)
    world = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=2).reshape(-1, 3)
    expected = omnidirectional_pixels(world @ np.array(axes, dtype=float).T, 0.9, K, D).reshape(7, 9, 2)
    assert np.abs(lens.pixels(azimuth, elevation) - expected).max() < 1e-9


@pytest.mark.parametrize("kind", [Fisheye, Omnidirectional])
@pytest.mark.parametrize("looking", ["up", "down"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_ahead_is_clockwise_from_up_by_the_offset(kind, looking, mirrored):
    more = {"xi": 1.0} if kind is Omnidirectional else {}
    lens = kind(matrix=(100.0, 100.0, 0.0, 0.0, 0.0), looking=looking, mirrored=mirrored, offset=0.5, **more)
    x, y = lens.pixels(np.array([0.0]), np.array([0.2]))[0, 0]
    assert np.arctan2(x, -y) == pytest.approx(0.5)
    left = lens.pixels(np.array([0.3]), np.array([0.2]))[0, 0]
    turn = np.arctan2(left[0], -left[1]) - 0.5  # who looks up at the sky has the left clockwise from ahead
    assert turn == pytest.approx(0.3 if (looking == "up") != mirrored else -0.3)


def test_what_a_lens_cannot_show_is_not_seen():
    seen = unwrapping(Fisheye(**FISHEYE, looking="ahead")).seen(480, 640)
    assert seen[:, 55:65].all()
    assert not seen[:, :20].any()
    assert (
        unwrapping(Fisheye(**FISHEYE, looking="ahead"))(np.full((480, 640, 3), 9, np.uint8))[~seen] == 0
    ).mean() > 0.9


# Calibrations.


def storage(path, **values):
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        file.write(name, value)
    file.release()
    return path


@pytest.mark.parametrize("ending", [".yaml", ".json", ".xml"])
def test_calibrations_that_opencv_writes_are_read(tmp_path, ending):
    path = storage(tmp_path / f"c{ending}", K=K, D=D.reshape(4, 1), image_width=640, image_height=480)
    lens = read_calibration(path, "fisheye", 640, 480, looking="down")
    assert (lens.matrix, lens.distortion, lens.looking) == (FISHEYE["matrix"], FISHEYE["distortion"], "down")
    half = read_calibration(path, "fisheye", 320, 240)
    assert np.allclose(half.matrix, (150, 155, 159.75, 119.75, 0))
    path = storage(tmp_path / f"o{ending}", camera_matrix=K, distortion_coefficients=D.reshape(1, 4), xi=1.2)
    assert read_calibration(path, "omnidirectional", 640, 480).xi == 1.2


def test_lists_and_the_camera_info_of_ros_are_read(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"K": K.tolist(), "D": D.tolist()}))
    assert read_calibration(tmp_path / "a.json", "fisheye", 640, 480) == Fisheye(**FISHEYE)
    numbers = ", ".join(map(str, K.ravel()))
    (tmp_path / "b.yaml").write_text(
        f"image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [{numbers}]\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [{', '.join(map(str, D))}]\n"
    )
    assert read_calibration(tmp_path / "b.yaml", "fisheye", 640, 480) == Fisheye(**FISHEYE)


FX, FY, CX, CY = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
TERMS = ", ".join(map(str, D))
OTHER_PROGRAMS = {
    "Kalibr's fisheye": ("fisheye", "cam0:\n  T_cam_imu:\n  - [1.0, 0.0]\n  - [0.0, 1.0]\n  camera_model: pinhole\n"
        f"  distortion_coeffs: [{TERMS}]\n  distortion_model: equidistant\n  intrinsics: [{FX}, {FY}, {CX},\n    {CY}]\n"
        "  resolution: [640, 480]\ncam1:\n  camera_model: pinhole\n  intrinsics: [9, 9, 9, 9]\n"),
    "Kalibr's omni": ("omnidirectional", f"cam0:\n  camera_model: omni\n  distortion_coeffs: [{TERMS}]\n  distortion_model: radtan\n"
        f"  intrinsics: [1.5, {FX}, {FY}, {CX}, {CY}]\n  resolution: [640, 480]\n"),
    "camodocal's MEI": ("omnidirectional", "%YAML:1.0\n---\nmodel_type: MEI\nmirror_parameters:\n   xi: 1.5\ndistortion_parameters:\n"
        f"   k1: {D[0]}\n   k2: {D[1]}\n   p1: {D[2]}\n   p2: {D[3]}\n"
        f"projection_parameters:\n   gamma1: {FX}\n   gamma2: {FY}\n   u0: {CX}\n   v0: {CY}\n"),
    "camodocal's KANNALA_BRANDT": ("fisheye", "%YAML:1.0\n---\nmodel_type: KANNALA_BRANDT\nprojection_parameters:\n"
        f"   k2: {D[0]}\n   k3: {D[1]}\n   k4: {D[2]}\n   k5: {D[3]}\n   mu: {FX}\n   mv: {FY}\n   u0: {CX}\n   v0: {CY}\n"),
}  # fmt: skip


@pytest.mark.parametrize("program", OTHER_PROGRAMS)
def test_calibrations_of_other_programs_are_read(tmp_path, caplog, program):
    lens, text = OTHER_PROGRAMS[program]
    (tmp_path / "c.yaml").write_text(text)
    expected = Fisheye(**FISHEYE) if lens == "fisheye" else Omnidirectional(**FISHEYE, xi=1.5)
    assert read_calibration(tmp_path / "c.yaml", lens, 640, 480) == expected
    assert not caplog.records
    other = {"fisheye": "omnidirectional", "omnidirectional": "fisheye"}[lens]
    with pytest.raises(FileError, match="is the calibration of another lens"):
        read_calibration(tmp_path / "c.yaml", other, 640, 480)


def test_a_lost_distortion_is_reported(tmp_path, caplog):
    path = storage(tmp_path / "c.xml", CameraMatrix=K, DistortionCoeffs=D)
    assert read_calibration(path, "fisheye", 640, 480) == Fisheye(**FISHEYE)
    assert not caplog.records
    read_calibration(storage(tmp_path / "d.xml", K=K, bending=D), "fisheye", 640, 480)
    assert "no distortion D that is known by its name" in caplog.text


def test_other_calibrations_are_refused_in_one_line(tmp_path):
    (tmp_path / "ocam.txt").write_text("#polynomial coefficients for the DIRECT mapping function\n\n5 -271 0 1 2 3\n")
    five = storage(tmp_path / "five.yaml", K=K, D=np.zeros((1, 5)))
    sized = storage(tmp_path / "sized.yaml", K=K, D=D, image_width=100, image_height=100)
    (tmp_path / "text.yaml").write_text("a picture\n")
    (tmp_path / "lfs.yaml").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    for path, lens, message in (
        (five, "fisheye", "5 numbers"),
        (sized, "fisheye", "100 x 100, these are 640 x 480"),
        (storage(tmp_path / "d.yaml", D=D), "fisheye", "no matrix K"),
        (storage(tmp_path / "k.yaml", K=K, D=D), "omnidirectional", "no xi"),
        (tmp_path / "text.yaml", "fisheye", "cannot be read|has no matrix"),
        (tmp_path / "lfs.yaml", "fisheye", "git lfs pull"),
        (tmp_path / "none.yaml", "fisheye", "cannot be read"),
        (tmp_path / "ocam.txt", "omnidirectional", "OCamCalib, which is not read"),
        (
            storage(tmp_path / "p.yaml", K=K, D=D, distortion_model="plumb_bob"),
            "fisheye",
            r"another lens \(plumb_bob\)",
        ),
        (storage(tmp_path / "q.yaml", K=K, D=D, fisheye_model=0), "fisheye", r"another lens \(pinhole\)"),
    ):
        with pytest.raises(FileError, match=message) as refusal:
            read_calibration(path, lens, 640, 480)
        assert "\n" not in str(refusal.value)
    with pytest.raises(SettingError, match="needs a calibration"):
        Camera(lens="fisheye")


# Finding the ring.

PLACES = [
    ((150.3, 139.6), 30.0, 120.0),
    ((120.0, 140.0), 20.0, 100.0),
    ((150.0, 140.0), 45.0, 160.0),
]  # the last is cut off


@pytest.mark.parametrize("surround", [0, 20, 255])
@pytest.mark.parametrize(("centre", "inner", "outer"), PLACES)
def test_a_ring_is_found_to_a_pixel(centre, inner, outer, surround):
    ring = Ring(centre=centre, inner=inner, outer=outer)
    picture = wrapped(np.clip(panorama(), 45, 225), ring, surround=surround).astype(float)
    noisy = picture + np.random.default_rng(0).normal(0, 3, picture.shape)
    found = find_ring([np.clip(noisy, 0, 255).astype(np.uint8)])
    assert np.abs(np.subtract(found.centre, centre)).max() < 0.5
    assert abs(found.outer - outer) < 1
    assert abs(found.inner - inner) < 1.5


def test_a_ring_that_is_half_dark_is_found_in_one_picture_and_in_several():
    view = panorama()
    view[:, 20:65] = 6  # the body of the robot, say
    found = find_ring([wrapped(view, RING)])
    assert np.abs(np.subtract(found.centre, RING.centre)).max() < 1
    assert abs(found.outer - RING.outer) < 1.5
    views = [np.where(np.arange(120)[:, None] // 40 == each, panorama(), 6).astype(np.uint8) for each in range(3)]
    found = find_ring([wrapped(view, RING) for view in views])
    assert found.seen == 1
    assert abs(found.outer - RING.outer) < 1


def test_a_lens_without_a_dark_centre_has_the_inner_radius_0():
    found = find_ring([wrapped(panorama(), Ring(centre=(150, 140), inner=0, outer=120))])
    assert (found.inner, round(found.outer)) == (0, 120)


def test_pictures_without_a_ring_are_refused():
    rng = np.random.default_rng(0)
    for picture in (
        np.zeros((80, 90, 3), np.uint8),
        rng.integers(0, 256, (80, 90, 3)).astype(np.uint8),
        np.tile(np.linspace(0, 255, 90).astype(np.uint8)[:, None], (80, 1, 3)),
    ):
        with pytest.raises(FileError, match="no ring was found"):
            find_ring([picture])


# The command.


def run(capfd, *arguments) -> tuple[int, str, str]:
    capfd.readouterr()
    code = 0
    try:
        main(["unwrap", *map(str, arguments)])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, *capfd.readouterr()


def save(path, picture):
    cv2.imwrite(str(path), picture[..., ::-1])
    return path


def test_a_picture_a_folder_and_a_video_are_unwrapped(capfd, tmp_path):
    (tmp_path / "raw").mkdir()
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (300, 280))
    for seed in range(3):
        picture = wrapped(panorama(seed=seed), RING)
        save(tmp_path / "raw" / f"p{seed}.png", picture)
        writer.write(picture[..., ::-1])
    writer.release()
    edges = ["--top-deg", 40, "--bottom-deg", -20, "--size", "120x30", "--lens", "ring"]
    code, out, err = run(
        capfd, tmp_path / "raw/p1.png", "--out", tmp_path / "one.png", *edges, "--json", "--picture", tmp_path / "f.png"
    )
    result = json.loads(out)
    assert (code, result["lens"], result["size"]) == (0, "ring", "120x30")
    assert re.fullmatch(
        r"found a ring with --centre 150\.\d,1(39|40)\.\d --inner-px 3\d\.\d --outer-px 1(19|20)\.\d .*\n", err
    )
    assert error(read_image(tmp_path / "one.png"), panorama(seed=1)) < 2
    drawn = read_image(tmp_path / "f.png")
    assert np.abs(drawn[140, 150 + 120].astype(int) - [255, 0, 0]).max() < 40
    assert run(capfd, tmp_path / "raw", "--out", tmp_path / "many", *edges)[0] == 0
    assert [path.name for path in sorted((tmp_path / "many").iterdir())] == ["p0.png", "p1.png", "p2.png"]
    assert error(read_image(tmp_path / "many/p2.png"), panorama(seed=2)) < 2
    assert run(capfd, tmp_path / "v.avi", "--out", tmp_path / "frames", *edges, "--every", 2, "--format", "jpg")[0] == 0
    assert [path.name for path in sorted((tmp_path / "frames").iterdir())] == ["frame_00000.jpg", "frame_00002.jpg"]
    assert error(read_image(tmp_path / "frames/frame_00002.jpg"), panorama(seed=2)) < 6
    code, _, err = run(capfd, tmp_path / "raw", "--out", tmp_path / "many", *edges)
    assert (code, err.count("\n")) == (2, 1)


def test_ctrl_c_leaves_panoramas_that_a_second_run_completes(capfd, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (300, 280))
    for seed in range(40):
        writer.write(wrapped(panorama(seed=seed % 3), RING)[..., ::-1])
    writer.release()
    out = tmp_path / "out"
    made = [tmp_path / "v.avi", "--lens", "ring", "--centre", "150,140", "--inner-px", 35, "--outer-px", 120]
    arguments = [*made, "--size", "720x150", "--out"]
    code, err = interrupted(lambda: len(list(out.glob("frame_*"))) > 3, "unwrap", *arguments, out)
    assert (code, err.splitlines()[-1]) == (130, "tussock: interrupted")
    there = {path.name: read_image(path).shape for path in out.iterdir()}
    assert 3 < len(there) < 40
    assert set(there.values()) == {(150, 720, 3)}
    for other in (["--flip"], ["--offset-deg", 10]):
        code, _, err = run(capfd, *arguments, out, *other)
        assert code == 2
        assert re.fullmatch(r".*frame_00000\.png was made in another way.*give a new folder", err.splitlines()[-1])
    (out / ".frame_00038.7.partial.png").write_bytes(b"of a run that was killed")
    code, _, err = run(capfd, *arguments, out)
    assert (code, err.count(f"holds {len(there)} of 40 panoramas from an earlier run")) == (0, 1)
    assert run(capfd, *arguments, tmp_path / "at once")[0] == 0
    both = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in (out, tmp_path / "at once")]
    assert both[0] == both[1]
    assert run(capfd, *arguments, out)[2] == f"tussock: {out} holds all 40 panoramas already; give a new folder\n"
    (out / "frame_00003.png").unlink()
    (out / "mine.txt").touch()
    code, _, err = run(capfd, *arguments, out)
    assert (code, err.count("is not empty")) == (2, 1)


def test_bad_flags_are_one_line_exit_2_and_leave_nothing(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save(tmp_path / "p.png", wrapped(panorama(), RING))
    save(tmp_path / "grey.png", np.full((50, 50, 3), 90, np.uint8))
    (tmp_path / "pictures").mkdir()
    save(tmp_path / "pictures" / "p.png", panorama())
    (tmp_path / "v.mp4").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    for arguments, message in (
        (["v.mp4", "--out", "o"], "git lfs pull"),
        (["p.png", "--out", "o.gif"], r"\.png or \.jpg"),
        (["p.png", "--out", "o.png", "--lens", "mirror"], "lens is 'mirror'"),
        (["p.png", "--out", "o.png", "--lens", "fisheye"], "needs a calibration"),
        (["p.png", "--out", "o.png", "--centre", "1"], "give X,Y"),
        (["p.png", "--out", "o.png", "--inner-px", "200", "--lens", "ring"], "outer radius"),
        (["p.png", "--out", "o.png", "--top-deg", "-20", "--lens", "ring"], "bottom < top"),
        (["grey.png", "--out", "o.png", "--lens", "ring"], "no ring was found"),
        (["none.png", "--out", "o.png"], "there is no"),
        (["p.png", "--out", "p.png"], "is the picture itself"),
        (
            ["p.png", "--out", "o.png", "--lens", "fisheye", "--calibration", "c.yaml"],
            r"c\.yaml cannot be read: there is no such file",
        ),
        (["p.png", "--out", "o.png", "--lens", "panorama", "--centre", "1,2"], "of a ring"),
        (["grey.png", "--out", "o", "--every", "0"], "give at least 1"),
        (["pictures", "--out", "pictures", "--lens", "panorama"], "is the folder of the pictures"),
    ):
        code, out, err = run(capfd, *arguments)
        assert (code, out) == (2, ""), arguments
        assert re.search(message, err.splitlines()[-1]), err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grey.png", "p.png", "pictures", "v.mp4"]


def test_invalid_rings_are_refused():
    for values in (
        {"inner": 5, "outer": 5.5},
        {"inner": 1, "outer": 9, "centre": (1.0,)},
        {"inner": 1, "outer": 9, "top": -1.0},
    ):
        with pytest.raises(InputError, match="Ring"):
            Ring(**({"centre": (0.0, 0.0)} | values))
    with pytest.raises(InputError, match="panorama"):
        Unwrapping(RING, 10**5, 10**5, TOP, BOTTOM)


def test_a_part_of_a_panorama_is_put_where_it_is_and_the_rest_is_unknown():
    whole = np.random.default_rng(0).integers(0, 256, (10, 48, 3), dtype=np.uint8)
    camera = Camera(lens="panorama", top=1.0, bottom=-0.2, field=math.pi)
    unwrapping = camera.unwrapping([whole[:, 12:36]])
    assert (unwrapping.width, unwrapping.height) == (48, 10)
    seen = unwrapping.seen(10, 24)
    assert np.array_equal(seen, Eye(width=48, height=10, field=math.pi).visible())
    assert np.array_equal(unwrapping(whole[:, 12:36]), whole * seen[..., None])
    # Half a column of the field's 25 is outside on either side: it is not known.
    partly = Unwrapping(
        PanoramaPart(width=25, height=10, top=1.0, bottom=-0.2, field=math.radians(187.5)), 48, 10, 1.0, -0.2
    )
    assert np.array_equal(partly.seen(10, 25), seen)
    left = attrs.evolve(camera, offset=-math.pi / 2).unwrapping(
        [whole[:, 12:36]]
    )  # ahead is a quarter turn left of the middle
    assert np.array_equal(left.seen(10, 24), np.roll(seen, 12, axis=1))
    with pytest.raises(SettingError, match="part of a panorama"):
        Camera(lens="ring", field=math.pi)
