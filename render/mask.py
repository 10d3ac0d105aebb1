"""A mask: which pixels of an eye see nothing, such as those behind the robot's body or a pole."""

import base64
import hashlib
import os
import re
import warnings
import zlib
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tussock.world.errors import FieldError, FileError, first_line

if TYPE_CHECKING:  # the command line reads the defaults of an eye: without numpy, its help appears at once
    import numpy as np
    from jaxtyping import Bool

MAX_PIXELS = 8 * 10**7  # of a picture of a mask, as of those of cameras
MIN_BRIGHT = 128  # a pixel of a picture that is at least so bright, and so opaque, is visible
FORM = re.compile(r"([1-9]\d{0,4})x([1-9]\d{0,4}):([\w=-]*)")


class Mask(str):
    """The visible pixels of an eye, as a text that settings, files and messages can hold: "720x150:" and their bits, packed.

    Two masks are equal where the same pixels are visible, wherever they come from.

    Attributes:
        source: The picture that it was read from; None where it was not.
    """

    source: str | None = None

    @classmethod
    def of(cls, visible: "Bool[np.ndarray, 'height width']", source: str | None = None) -> "Mask":
        """The mask with these visible pixels."""
        import numpy as np

        height, width = visible.shape
        packed = base64.urlsafe_b64encode(zlib.compress(np.packbits(visible).tobytes(), 9)).decode()
        mask = cls(f"{width}x{height}:{packed}")
        mask.source = source
        return mask

    def visible(self) -> "Bool[np.ndarray, 'height width']":
        """Which pixels are visible. Raises SettingError for a text that is not a mask's."""
        return _unpacked(str(self))

    def __repr__(self) -> str:
        return f"<{self.source or 'mask'}, {self.partition(':')[0]}, {hashlib.sha256(self.encode()).hexdigest()[:8]}>"


def as_mask(value: Any, width: int, height: int) -> Mask:
    """The mask that a setting means.

    Args:
        value: A mask or its text (also in pieces), a (height, width) bool array, or the path of a picture.
        width: Columns of the eye.
        height: Its rows.

    Raises:
        FileError: For a picture that cannot be read.
        SettingError: For anything else that is not a mask, and for one of another size.
    """
    import numpy as np

    if isinstance(value, Sequence) and not isinstance(value, str) and all(isinstance(each, str) for each in value):
        value = "".join(value)
    if isinstance(value, np.ndarray):
        if value.dtype != bool or value.shape != (height, width):
            raise FieldError(
                "Eye",
                "",
                f"a mask of shape {value.shape} and type {value.dtype}; give ({height}, {width}) booleans, "
                "True where a pixel is visible",
            )
        return Mask.of(value)
    if isinstance(value, str) and FORM.fullmatch(value):
        mask = value if isinstance(value, Mask) else Mask(value)
        if mask.visible().shape != (height, width):
            raise FieldError(
                "Eye",
                "",
                f"a mask of {mask.partition(':')[0]} pixels for an eye of {width}x{height}; give a picture, or one of this size",
            )
        return mask
    if isinstance(value, str | os.PathLike) and str(value):
        return Mask.of(fitted(read_mask(Path(value)), width, height), str(value))
    raise FieldError("Eye", "mask", f"is {value!r}; give a picture's file, ({height}, {width}) booleans or None")


def read_mask(path: Path) -> "Bool[np.ndarray, 'height width']":
    """Which pixels of a picture are bright, and opaque. Raises FileError for a file that is not a picture."""
    import numpy as np
    from PIL import Image

    from tussock.world.file_kinds import head_of, kind_of

    if not os.path.isfile(path):  # unlike Path.is_file, False for names that are too long
        raise FileError(
            f"there is no mask {str(path)!r}; give a picture that is white where the eye sees, black where it does not"
        )
    try:
        with (
            warnings.catch_warnings(action="ignore", category=Image.DecompressionBombWarning),
            Image.open(path) as image,
        ):
            if image.width * image.height > MAX_PIXELS:
                raise FileError(
                    f"{str(path)!r} is {image.width} x {image.height}; give a mask of up to {MAX_PIXELS:,} pixels"
                )
            pixels = np.asarray(image.convert("RGBA").convert("LA"))
    except FileError:
        raise
    except Exception as error:  # Pillow raises whatever its parsers raise
        kind = kind_of(head_of(path))
        reason = f"{first_line(error)}; save it as PNG"
        if kind is not None and kind.group != "image":
            reason = f"it is {kind.name}; {kind.remedy if kind.group == 'pointer' else 'give a picture'}"
        raise FileError(f"{str(path)!r} cannot be read as a picture of a mask: {reason}") from error
    return np.asarray((pixels >= MIN_BRIGHT).all(axis=2))


def fitted(visible: "Bool[np.ndarray, 'rows columns']", width: int, height: int) -> "Bool[np.ndarray, 'height width']":
    """A mask in another number of pixels: one is visible where all that it covers of the picture is."""
    import numpy as np

    def edges(pixels: int, of: int) -> tuple[np.ndarray, np.ndarray]:
        each = np.arange(pixels)
        return each * of // pixels, -(-(each + 1) * of // pixels)

    hidden = np.zeros((visible.shape[0] + 1, visible.shape[1] + 1), np.int32)  # enough for 2**31 pixels
    hidden[1:, 1:] = (~visible).cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
    (top, bottom), (left, right) = edges(height, visible.shape[0]), edges(width, visible.shape[1])
    rows = hidden[bottom] - hidden[top]
    return rows[:, right] == rows[:, left]


@lru_cache(maxsize=64)
def _unpacked(text: str) -> "Bool[np.ndarray, 'height width']":
    """The visible pixels that a text holds; as the array is shared, it cannot be changed."""
    import numpy as np

    match = FORM.fullmatch(text)
    if match is None:
        raise FieldError("Eye", "", f"{text[:40]!r} is not a mask; give a picture's file")
    width, height = int(match[1]), int(match[2])
    size = -(-width * height // 8)
    try:
        packed = zlib.decompressobj().decompress(base64.urlsafe_b64decode(match[3]), size + 1)
    except (ValueError, zlib.error) as error:
        raise FieldError("Eye", "", f"the mask of {width}x{height} pixels is damaged ({first_line(error)})") from error
    if len(packed) != size:
        raise FieldError("Eye", "", f"the mask of {width}x{height} pixels is damaged; give a picture's file")
    visible = np.unpackbits(np.frombuffer(packed, np.uint8), count=width * height).astype(bool).reshape(height, width)
    visible.setflags(write=False)
    return visible
