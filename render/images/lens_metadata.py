"""How the metadata of a database says that its images are raw pictures of a panoramic camera, and how to unwrap them.

BoB robotics writes `unwrapper`: the centre as a share of width and height, radii as shares of the height, `offsetDegrees` and `flip`.
In databases of videos it stands under `imageInput`.
"""

import math
from pathlib import Path
from typing import Any

from tussock.world.errors import FileError, SettingError

from .lenses import Ring
from .metadata import group_in
from .unwrapping import Unwrapping

MIN_ASPECT = 2.0  # width by height from which a picture of a panoramic camera is taken to be unwrapped already
MAX_COLUMNS = 720  # of a panorama whose size is not stated, as in the published Sussex databases


def needs_unwrapping(metadata: dict[str, Any], height: int, width: int) -> bool:
    """Whether images of a size are raw pictures. Where the metadata does not say, those of a panoramic camera are, unless they are wide."""
    stated = metadata.get("needsUnwrapping")
    if isinstance(stated, int | float | str):
        return _is_true(stated)
    return _is_true(group_in(metadata, "camera").get("isPanoramic")) and width < MIN_ASPECT * height


def unwrapper_in(metadata: dict[str, Any]) -> dict[str, Any]:
    """What metadata say about unwrapping; empty where that is nothing."""
    return group_in(metadata, "unwrapper") or group_in(metadata, "imageInput", "unwrapper")


def stated_unwrapping(metadata: dict[str, Any], height: int, width: int, path: Path) -> Unwrapping:
    """How the metadata says that raw pictures of a size are unwrapped. Raises FileError where it does not, which names its path."""
    group = unwrapper_in(metadata)
    centre = group.get("centre", group.get("center"))
    radii = [group.get("inner"), group.get("outer")]
    values = [*(centre if isinstance(centre, list) else [None]), *radii]
    numbers = [float(each) for each in values if isinstance(each, int | float) and math.isfinite(each)]
    if len(values) != 4 or len(numbers) != 4:
        raise FileError(
            f"{path}: the images need unwrapping, and it has no unwrapper with centre, inner and outer; "
            "make panoramas with tussock unwrap, which can find them"
        )
    x, y, inner, outer = numbers
    if max(numbers) <= 1:  # shares
        x, y, inner, outer = x * width, y * height, inner * height, outer * height
    offset, size = group.get("offsetDegrees", 0), group.get("size")
    try:
        ring = Ring(
            centre=(x, y),
            inner=inner,
            outer=outer,
            offset=math.radians(offset) if _is_number(offset) else 0.0,
            flip=_is_true(group.get("flip")),
            mirrored=_is_true(group.get("mirrored")),
        )
        across, down = size if isinstance(size, list) and len(size) == 2 else natural_size(ring)
        return Unwrapping(ring, int(across), int(down), ring.top, ring.bottom)
    except (SettingError, TypeError, ValueError, OverflowError) as error:
        raise FileError(f"{path}: its unwrapper cannot be used ({error})") from error


def natural_size(ring: Ring) -> tuple[int, int]:
    """Columns and rows of a panorama with about the pixels of a ring, but not too many."""
    width = max(4, min(MAX_COLUMNS, round(ring.around / 4) * 4))
    return width, max(1, round((ring.outer - ring.inner) * width / ring.around))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_true(value: Any) -> bool:
    if isinstance(value, str):
        return value.lower() in ("true", "yes", "on", "1")
    return isinstance(value, int | float) and value != 0
