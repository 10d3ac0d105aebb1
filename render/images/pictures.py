"""Pictures in files: read as RGB or RGBA of 8 bits, or refused by name."""

import os
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image

from tussock.world.errors import FileError
from tussock.world.file_kinds import head_of, is_lfs_pointer

Picture = UInt8[np.ndarray, "_ _ _"]  # height, width, channels (RGB or RGBA)

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP")
MAX_PIXELS = 8 * 10**7  # of an image, because a small file may claim any size; Pillow itself warns above 89 million


def check_content(path: Path) -> None:
    """Refuse a file that only points to its content in Git LFS. Raises FileError."""
    try:
        is_pointer = is_lfs_pointer(head_of(path))
    except OSError:
        return  # whatever reads the file reports this
    if is_pointer:
        raise FileError(f"{path} is only a pointer of Git LFS, not the file itself; run git lfs pull in its repository")


def read_image(path: Path) -> Picture:
    """Read an image as RGB or RGBA. Raises FileError if it is missing, too large or cannot be read to its end."""
    check_exists(path)
    check_content(path)
    damaged = f"{path} cannot be read as an image of 8 bits; replace it"
    try:
        with Image.open(path, formats=FORMATS) as header:  # reads the header only
            width, height = header.size
    except Image.DecompressionBombError as error:
        raise FileError(f"{path} is too large; give images of up to {MAX_PIXELS:,} pixels") from error
    except Exception as error:  # Pillow raises whatever its parsers raise
        raise FileError(damaged) from error
    check_size(path, width, height)
    try:
        data = path.read_bytes()
        # libpng complains on standard error about a file that is cut off.
        whole = data[1:4] != b"PNG" or b"IEND" in data[-12:]
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if whole else None
    except (cv2.error, OSError):
        image = None
    if image is None or image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise FileError(damaged)
    if image.ndim == 2:
        return cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def encoded(picture: Picture, suffix: str, quality: int = 80) -> bytes:
    """The bytes of a picture in a file.

    Args:
        picture: RGB or RGBA.
        suffix: ".png", which is lossless, or ".jpg", which has no alpha.
        quality: Of a JPEG.
    """
    code = cv2.COLOR_RGBA2BGRA if picture.shape[2] == 4 else cv2.COLOR_RGB2BGR
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1] if suffix == ".png" else [cv2.IMWRITE_JPEG_QUALITY, quality]
    return cv2.imencode(suffix, cv2.cvtColor(picture, code), options)[1].tobytes()


def check_exists(path: Path) -> None:
    """Raises FileError if there is no such image."""
    if not os.path.isfile(path):  # unlike Path.is_file, False for names that are too long
        raise FileError(f"there is no image {path}; a check of the database lists all that are missing")


def check_size(path: Path, width: float, height: float) -> None:
    """Raises FileError if a picture claims too many pixels to be opened."""
    if not 0 < width * height <= MAX_PIXELS:
        raise FileError(f"{path} is {width:.0f} x {height:.0f}; give images of up to {MAX_PIXELS:,} pixels")
