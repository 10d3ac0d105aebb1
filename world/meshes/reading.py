"""How a mesh file is read: which axis is up, in which unit it is, and whether losses are refused. Light to import."""

from ..errors import SettingError
from ..settings import choice, number, settings, switch

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": 0.3048}  # in metres


@settings
class MeshReading:
    """How the numbers in a mesh file become metres with z up.

    Attributes:
        up: The axis of the file that points up. "auto" is y for glTF, as its standard says, and z for all other formats.
        unit: Unit of the file's coordinates. "auto" is metres, with a warning where the numbers suggest another unit.
        scale: Metres in one unit of the file, in place of `unit`.
        strict: Refuse a file of which something is lost, such as a texture that is not found; otherwise that is a warning.
    """

    up: str = choice("auto", ("auto", "x", "y", "z"))
    unit: str = choice("auto", ("auto", *UNITS))
    scale: float | None = number(None, above=0, optional=True, unit="m")
    strict: bool = switch(False)

    def __attrs_post_init__(self):
        if self.scale is not None and self.unit != "auto":
            raise SettingError(
                f"scale {self.scale:g} and unit {self.unit!r} both say how long a unit is; give one of the two"
            )

    @property
    def metres(self) -> float:
        """Metres in one unit of the file."""
        return self.scale if self.scale is not None else UNITS.get(self.unit, 1.0)

    @property
    def unit_given(self) -> bool:
        """Whether a unit or a scale is given."""
        return self.scale is not None or self.unit != "auto"

    @property
    def changes_coordinates(self) -> bool:
        """Whether the axis or the unit is given."""
        return self.up != "auto" or self.unit_given
