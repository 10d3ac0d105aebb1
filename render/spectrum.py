"""What the receptors of an eye see: red, green and blue, or, as insects do, ultraviolet in place of red."""

from typing import Any

from tussock.world.errors import FieldError, SettingError
from tussock.world.settings import number, settings
from tussock.world.specs import Spec, parse_spec

HUMAN = "human"


@settings
class Insect:
    """Receptors for ultraviolet, green and blue. Views show the ultraviolet where they show people red.

    There the sky is bright, and all else reflects little: grass and crops 0.02, bare soil 0.05 to 0.08 (315 to 400 nm), dry bright
    sand 0.14 at 300 nm to 0.24 at 400 nm (Feister and Grewe 1995); single leaves up to 0.06 (Grant et al. 2003).

    Attributes:
        plants: Share of the ultraviolet that plants and litter reflect.
        ground: That of the ground.
        stones: That of stones and pebbles.
        other: That of all else: hedges, far hills, walls, and meshes whose plants are not known.
    """

    plants: float = number(0.04, low=0, high=1, unit="share")
    ground: float = number(0.06, low=0, high=1, unit="share")
    stones: float = number(0.06, low=0, high=1, unit="share")
    other: float = number(0.05, low=0, high=1, unit="share")


def as_spectrum(value: Any) -> str:
    """The spectrum that a setting means: "human", or "insect" and what differs from its defaults. Raises SettingError."""
    if not isinstance(value, str):
        raise FieldError("Eye", "spectrum", f"is {value!r}; give human, insect, or 'insect ground=0.2'")
    return HUMAN if value.strip() == HUMAN else str(_spec(value))


def insect_of(spectrum: str) -> Insect | None:
    """What a spectrum of `as_spectrum` says of the ultraviolet; None where people see none."""
    return None if spectrum == HUMAN else _spec(spectrum).make()


def _spec(text: str) -> Spec:
    spec = parse_spec(text, _find)
    spec.make()  # refuses bad numbers
    return spec


def _find(name: str) -> type[Insect]:
    if name == HUMAN:
        raise SettingError("the spectrum human takes no parameters; insect does")
    if name != "insect":
        raise SettingError(f"unknown spectrum {name!r}; give human, insect, or 'insect ground=0.2'")
    return Insect
