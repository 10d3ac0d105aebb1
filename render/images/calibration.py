"""Calibrations of fisheye and omnidirectional lenses, in the files of OpenCV, ROS, Kalibr and camodocal."""

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tussock.world.errors import FileError, SettingError

from .lenses import Fisheye, Omnidirectional
from .metadata import read_storage

log = logging.getLogger(__name__)

MATRICES = ("K", "camera_matrix", "cameramatrix", "intrinsic_matrix", "intrinsics", "mtx")
DISTORTIONS = (
    *("D", "distortion_coefficients", "distortion_coeffs", "distortioncoefficients", "distortioncoeffs"),
    *("dist_coeffs", "distcoeffs", "distortion", "dist"),
)
# What the files of these lenses state as model_type, camera_model or distortion_model.
MODELS = {
    "fisheye": ("equidistant", "fisheye", "kannala_brandt"),
    "omnidirectional": ("omni", "mei", "omnidirectional", "omnidir"),
}


def read_calibration(path: Path, lens: str, width: int, height: int, **options: Any) -> Fisheye | Omnidirectional:
    """Read the calibration of a lens.

    Args:
        path: YAML, JSON or XML, as OpenCV writes it, with K and D (or camera_matrix and distortion_coefficients), and xi; or of ROS, Kalibr
            (the first camera) or camodocal (VINS).
        lens: "fisheye" or "omnidirectional".
        width: Of the pictures; K is scaled to it if the file states that it was calibrated at another size.
        height: Of the pictures.
        **options: Fields of the lens that the file does not have.

    Raises:
        FileError: It is not a calibration of this lens.
    """
    _refuse_ocamcalib(path)
    known = {key.lower(): value for key, value in _flat(read_storage(path)).items()}
    _refuse_other_models(path, known, lens)
    matrix, distortion = (_matrix(known, names) for names in (MATRICES, DISTORTIONS))
    matrix, distortion, xi = _kalibr(known, matrix, distortion)
    matrix, distortion = _camodocal(known, lens, matrix, distortion)
    if matrix is None or len(matrix) != 9:
        raise FileError(f"{path} has no matrix K of 3 x 3 numbers; give the calibration of a {lens} lens")
    if distortion is None:
        log.warning("%s has no distortion D that is known by its name; it is taken as 0", path)
        distortion = [0.0] * 4
    if len(distortion) < 4:
        raise FileError(f"{path} has a distortion D of {len(distortion)} numbers; a {lens} lens has 4")
    if len(distortion) > 4:
        raise FileError(
            f"{path} has a distortion D of {len(distortion)} numbers, as a lens of another kind; a {lens} lens has 4"
        )
    scale = _scale(known, width, height, path)
    fx, skew, cx, _, fy, cy = matrix[:6]
    numbers_of_k = (fx * scale, fy * scale, (cx + 0.5) * scale - 0.5, (cy + 0.5) * scale - 0.5, skew * scale)
    try:
        if lens == "fisheye":
            return Fisheye(matrix=numbers_of_k, distortion=tuple(distortion), **options)
        xi = xi or _matrix(known, ("xi",))
        if not xi:
            raise FileError(f"{path} has no xi; give the calibration of an omnidirectional lens, or --lens fisheye")
        return Omnidirectional(xi=xi[0], matrix=numbers_of_k, distortion=tuple(distortion), **options)
    except SettingError as error:
        raise FileError(f"{path} cannot be used as a calibration ({error})") from error


def _refuse_ocamcalib(path: Path) -> None:
    """Refuse a text of OCamCalib, which no reader of YAML would name. Raises FileError."""
    if path.is_file():
        with path.open("rb") as file:
            if b"DIRECT mapping function" in file.read(1000):
                raise FileError(
                    f"{path} is a calibration of OCamCalib, which is not read; calibrate it with OpenCV, or give --lens ring"
                )


def _refuse_other_models(path: Path, known: dict[str, Any], lens: str) -> None:
    """Refuse a calibration that states another model of lens, whose numbers mean something else. Raises FileError."""
    stated = [
        str(known[name]).lower() for name in ("model_type", "camera_model", "distortion_model") if known.get(name)
    ]
    if known.get("fisheye_model") == 0:  # of OpenCV's sample program
        stated.append("pinhole")
    models = MODELS[lens]
    if stated and not any(model in models for model in stated):
        raise FileError(f"{path} is the calibration of another lens ({', '.join(stated)}); calibrate it as {lens}")


def _kalibr(
    known: dict[str, Any], matrix: list[float] | None, distortion: list[float] | None
) -> tuple[list[float] | None, list[float] | None, list[float] | None]:
    """K, D and xi, of Kalibr's list of intrinsics where there is one: (xi), fu, fv, pu, pv."""
    if matrix is None or len(matrix) not in (4, 5):
        return matrix, distortion, None
    fx, fy, cx, cy = matrix[-4:]
    return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], distortion, matrix[:-4]


def _camodocal(
    known: dict[str, Any], lens: str, matrix: list[float] | None, distortion: list[float] | None
) -> tuple[list[float] | None, list[float] | None]:
    """K and D, of camodocal's single numbers where there are such (as VINS has them)."""
    focal, terms = {
        "fisheye": (("mu", "mv"), ("k2", "k3", "k4", "k5")),
        "omnidirectional": (("gamma1", "gamma2"), ("k1", "k2", "p1", "p2")),
    }[lens]
    numbers = [_matrix(known, (name,)) for name in (*focal, "u0", "v0", *terms)]
    if matrix is not None or not all(numbers):
        return matrix, distortion
    fx, fy, cx, cy, *found = (each[0] for each in numbers if each)
    return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], found


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    """Values of nested groups under their own names; a matrix stays one."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict) and "data" not in value:
            flat = _flat(value) | flat
        else:
            flat[key] = value
    return flat


def _matrix(known: dict[str, Any], names: Sequence[str]) -> list[float] | None:
    """The numbers of a matrix, row by row, however it is written."""
    for name in names:
        value = known.get(name.lower())
        value = value.get("data") if isinstance(value, dict) else value
        rows = value if isinstance(value, list) else [value]
        cells = [cell for row in rows for cell in (row if isinstance(row, list) else [row])]
        found = [float(cell) for cell in cells if isinstance(cell, int | float) and math.isfinite(cell)]
        if found and len(found) == len(cells):
            return found
    return None


def _scale(known: dict[str, Any], width: int, height: int, path: Path) -> float:
    """By how much the pictures are larger than those of the calibration."""
    size = _matrix(known, ("image_size", "imagesize", "img_size", "resolution"))
    calibrated = size or [
        *(_matrix(known, ("image_width", "width")) or []),
        *(_matrix(known, ("image_height", "height")) or []),
    ]
    if len(calibrated) != 2 or min(calibrated) <= 0:
        return 1.0
    scale = width / calibrated[0]
    if abs(height / calibrated[1] - scale) > 0.01 * scale:
        raise FileError(
            f"{path} is of pictures of {calibrated[0]:g} x {calibrated[1]:g}, these are {width} x {height}; give its own calibration"
        )
    return scale
