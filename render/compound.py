"""A compound eye as a value: settings, files and messages hold it as a text, as they hold a mask."""

import base64
import hashlib
import math
import os
import re
import zlib
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tussock.world.errors import FieldError, SettingError, first_line

if TYPE_CHECKING:  # the command line reads the defaults of an eye: without numpy, its help appears at once
    from .ommatidia import Ommatidia

FORM = re.compile(r"([1-9]\d{0,5}) ommatidia:([\w=-]*)")
SUFFIXES = (".eye", ".csv")  # of files
FINE = 6  # pixels in the acceptance angle of the panorama from which ommatidia are computed, at least
TURNS = 120  # of an eye, at least, where its panorama has as many columns
REACH = 4  # standard deviations up to which a Gaussian is summed
FWHM = 2.3548200450309493  # full width at half maximum of a Gaussian, in standard deviations


class CompoundEye(str):
    """The ommatidia of both eyes as a text: a name with its parameters ("ant", "fly ommatidia=300"), or "420 ommatidia:" and all angles.

    `as_compound` makes it. Two are equal where they have one name, or the same angles, wherever they come from.

    Attributes:
        source: The file that it was read from; None where it was not.
    """

    source: str | None = None

    @classmethod
    def of(cls, ommatidia: "Ommatidia", source: str | None = None) -> "CompoundEye":
        """The eye with these ommatidia."""
        import numpy as np

        from .ommatidia import problem_of

        arrays = [np.asarray(each, np.float64) for each in ommatidia]
        if len({each.shape for each in arrays}) > 1 or arrays[0].ndim != 1 or not len(arrays[0]):
            raise SettingError(
                "each ommatidium of an eye has an azimuth, an elevation, an acceptance angle and a side; give (n,) arrays"
            )
        if (problem := problem_of(ommatidia)) is not None:
            raise SettingError(f"ommatidium {problem[0]}: {problem[1]}")
        numbers = np.stack(arrays)
        packed = base64.urlsafe_b64encode(zlib.compress(numbers.astype("<f8").tobytes(), 9)).decode()
        eye = cls(f"{len(ommatidia.azimuth)} ommatidia:{packed}")
        eye.source = source
        return eye

    def ommatidia(self) -> "Ommatidia":
        """Where they look. Raises SettingError for a text that is not of an eye."""
        return _unpacked(str(self))

    def panorama(self) -> dict[str, Any]:
        """The size, the edges and the samples of a panorama that holds all that it sees, as fields of an `Eye`."""
        import numpy as np

        _, elevation, acceptance, _ = self.ommatidia()
        width = TURNS * math.ceil(2 * math.pi * FINE / float(acceptance.min()) / TURNS)
        spread = REACH / FWHM * acceptance
        top, bottom = np.degrees([(elevation + spread).max(), (elevation - spread).min()])
        top, bottom = min(90, math.ceil(top)), max(-90, math.floor(bottom))
        height = math.ceil((top - bottom) * width / 360)
        return {
            "width": width,
            "height": height,
            "samples": 4,
            "top": math.radians(top),
            "bottom": math.radians(bottom),
        }

    def __repr__(self) -> str:
        if FORM.fullmatch(self) is None:
            return str(self)
        return f"<{self.source or 'eye'}, {self.partition(':')[0]}, {hashlib.sha256(self.encode()).hexdigest()[:8]}>"


def as_compound(value: Any) -> CompoundEye:
    """The compound eye that a setting means. Raises SettingError."""
    from .ommatidia import Ommatidia, eye_spec, named_eye, read_eye

    if isinstance(value, Ommatidia):
        return CompoundEye.of(value)
    if isinstance(value, CompoundEye):
        return value
    if isinstance(value, str) and FORM.fullmatch(value):
        _unpacked(value)
        return CompoundEye(value)
    if isinstance(value, os.PathLike) or (isinstance(value, str) and Path(value).suffix.lower() in SUFFIXES):
        return CompoundEye.of(read_eye(Path(value)), str(value))
    if isinstance(value, str) and value.strip():
        spec = eye_spec(value)
        named_eye(str(spec))
        return CompoundEye(str(spec))
    raise FieldError("Eye", "compound", f"is {value!r}; give the name of an eye or a file (.eye, .csv)")


@lru_cache(maxsize=64)
def _unpacked(text: str) -> "Ommatidia":
    """The ommatidia that a text holds; as the arrays are shared, they cannot be changed."""
    import numpy as np

    from .ommatidia import Ommatidia, named_eye

    match = FORM.fullmatch(text)
    if match is None:
        found = named_eye(text)
    else:
        count = int(match[1])
        try:
            numbers = zlib.decompressobj().decompress(base64.urlsafe_b64decode(match[2]), 32 * count + 1)
            azimuth, elevation, acceptance, side = np.frombuffer(numbers, "<f8").reshape(4, count).copy()
        except (ValueError, zlib.error) as error:
            raise SettingError(f"the eye of {count} ommatidia is damaged ({first_line(error)})") from error
        found = Ommatidia(azimuth, elevation, acceptance, side.astype(np.int8))
    for each in found:
        each.setflags(write=False)
    return found
