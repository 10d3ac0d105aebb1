"""Settings that check themselves: fields with a unit and a range, for attrs classes.

    @settings
    class Body:
        step_length: float = number(0.05, above=0, unit="m")

An invalid value raises `FieldError`, a `SettingError`, where the settings are made: in a script, by the command line or from a sweep file.
`describe(Body)` gives the default, unit and range of every field.

Why attrs: it checks an object when it is made and when it is changed, accepts arrays and objects of any class as values, and
rerun-sdk requires it anyway. pydantic would convert values by rules of its own; msgspec checks only what it decodes.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from numbers import Integral, Real
from typing import Any, TypeVar, dataclass_transform

import attrs

from .errors import FieldError

T = TypeVar("T")
RGB = tuple[int, int, int]
MAX_COORDINATE = 1e7  # m from 0: beyond it float32 corners are metres apart, and squares of squares may overflow
MAX_WHOLE = 2**62  # what an int64 holds, with room to add; errors do not mention it


def converted(*, default: Any, converter: Callable[..., Any], takes_self: bool = False) -> Any:
    """A field whose value is made by a converter, which raises SettingError for an invalid one.

    Args:
        default: Value that is converted where none is given.
        converter: Makes the value of the field.
        takes_self: Whether the converter also gets the object, with the fields before this one.
    """
    convert = attrs.Converter(converter, takes_self=True) if takes_self else converter
    return attrs.field(default=default, converter=convert)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(attrs.field, converted))
def settings(cls: type[T]) -> type[T]:
    """Class decorator: a frozen class of keyword fields, which are checked when an object is made."""
    return attrs.frozen(kw_only=True, slots=False)(cls)


def number(
    default: Any = attrs.NOTHING,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    unit: str = "",
    optional: bool = False,
    names: Collection[str] = (),
) -> Any:
    """A field for a finite number.

    Args:
        default: Value of the field; none makes it a required one.
        low: Minimum, allowed itself.
        high: Maximum, allowed itself.
        above: Lower limit, not allowed itself.
        unit: Unit of the number. Errors report "rad" in degrees as well.
        optional: Whether None is allowed.
        names: Texts that are allowed in place of a number.
    """
    return _single(default, _Range(float, low, high, above, unit), optional, names)


def whole(
    default: Any = attrs.NOTHING, *, low: float = 1, high: float = MAX_WHOLE, unit: str = "", optional: bool = False
) -> Any:
    """A field for a whole number from `low` to `high`, both allowed. For the other arguments see `number`."""
    return _single(default, _Range(int, low, high, unit=unit), optional, ())


def numbers(default: tuple[float, ...], *, low: float = -math.inf, high: float = math.inf, unit: str = "") -> Any:
    """A field for a tuple of at least one number from `low` to `high`. For the other arguments see `number`."""
    return _several(default, _Range(float, low, high, unit=unit))


def wholes(default: tuple[int, ...], *, single: bool = False) -> Any:
    """A field for a tuple of at least one whole number from 1. single: Whether a number alone is allowed as well."""
    return _several(default, _Range(int, 1, MAX_WHOLE), single)


def colour(default: RGB) -> Any:
    """A field for a colour: red, green and blue, each a whole number from 0 to 255."""
    return _several(default, _Range(int, 0, 255), count=3)


def choice(default: str | None, names: Iterable[str], *, optional: bool = False) -> Any:
    """A field for one of several texts. optional: Whether None is allowed."""
    known = tuple(names)

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if not ((optional and value is None) or (isinstance(value, str) and value in known)):
            refuse(instance, attribute, value, f"one of {', '.join(known)}" + " or None" * optional)

    return attrs.field(default=default, validator=check, metadata={"choices": known})


def text(default: Any = attrs.NOTHING, *, optional: bool = False) -> Any:
    """A field for a printable text. optional: Whether None is allowed."""

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if not ((optional and value is None) or (isinstance(value, str) and value.isprintable())):
            refuse(instance, attribute, value, "a printable text" + " or None" * optional)

    return attrs.field(default=default, validator=check)


def switch(default: bool) -> Any:
    """A field for True or False."""
    return instance_of(bool, default, "True or False")


def instance_of(kinds: Any, default: Any, wanted: str) -> Any:
    """A field for an object of a class.

    Args:
        kinds: The class, or several, as for isinstance.
        default: Value of the field.
        wanted: What to give, for the error.
    """

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if not isinstance(value, kinds):
            refuse(instance, attribute, value, wanted)

    return attrs.field(default=default, validator=check)


def describe(cls: type) -> dict[str, dict[str, Any]]:
    """Default, unit, and range or choices of every field of a settings class, by name."""
    return {each.name: {"default": each.default} | dict(each.metadata) for each in attrs.fields(cls)}


def refuse(instance: Any, attribute: attrs.Attribute, value: Any, wanted: str, in_degrees: str = "") -> None:
    """Raise FieldError for a value.

    Args:
        instance: The object that is made; its class is called by its attribute `name` where it has one.
        attribute: The field.
        value: What was given.
        wanted: What to give instead.
        in_degrees: The same in degrees, of an angle.
    """
    label = getattr(type(instance), "name", "") or type(instance).__name__
    problem = f"is {shown(value, attribute.metadata)}; give {wanted}"
    angle = in_degrees and isinstance(value, float)
    raise FieldError(label, attribute.name, problem, f"is {math.degrees(value):g}; give {in_degrees}" if angle else "")


def shown(value: Any, metadata: Mapping[str, Any]) -> str:
    """A value as an error reports it: an angle in degrees as well."""
    if metadata.get("unit") == "rad" and isinstance(value, float):
        return f"{value:g} rad ({math.degrees(value):g} degrees)"
    return repr(value)


@attrs.frozen
class _Range:
    """Numbers of one kind (int or float) between limits, of which `above` is not allowed itself."""

    kind: type
    low: float
    high: float
    above: float = -math.inf
    unit: str = ""

    def convert(self, value: Any) -> Any:
        """A number as an int or float; anything else unchanged."""
        if isinstance(value, bool) or not isinstance(value, Integral if self.kind is int else Real):
            return value
        try:
            return self.kind(value)  # type: ignore[arg-type]
        except OverflowError:
            return value

    def __contains__(self, value: Any) -> bool:
        if isinstance(value, bool) or not isinstance(value, self.kind):
            return False
        return self.low <= value <= self.high and self.above < value < math.inf  # never nan or infinite

    def __str__(self) -> str:
        low = f"over {self.above:g}" if self.above > -math.inf else f"from {self.low:g}" if self.low > -math.inf else ""
        largest = MAX_WHOLE if self.kind is int else math.inf
        high = f"to {self.high:g}" if self.high < largest else ""
        words = ["whole number" if self.kind is int else "number", low, high, f"({self.unit})" if self.unit else ""]
        return " ".join(filter(None, words))

    def in_degrees(self) -> "_Range":
        """The same angles in degrees."""
        low, high, above = map(math.degrees, (self.low, self.high, self.above))
        return attrs.evolve(self, low=low, high=high, above=above, unit="degrees")

    @property
    def metadata(self) -> dict[str, Any]:
        """Unit and limits, for `describe`."""
        return {"unit": self.unit, "low": max(self.low, self.above), "high": self.high}


def _single(default: Any, allowed: _Range, optional: bool, names: Collection[str]) -> Any:
    """A field for one number."""
    others = [f"one of {', '.join(names)}"] * bool(names) + ["None"] * optional

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if not (value in allowed or (optional and value is None) or (isinstance(value, str) and value in names)):
            in_degrees = " or ".join([f"a {allowed.in_degrees()}", *others]) if allowed.unit == "rad" else ""
            refuse(instance, attribute, value, " or ".join([f"a {allowed}", *others]), in_degrees)

    return attrs.field(default=default, converter=allowed.convert, validator=check, metadata=allowed.metadata)


def _several(default: tuple, allowed: _Range, single: bool = False, count: int | None = None) -> Any:
    """A field for a tuple of numbers: `count` of them, or at least one."""
    wanted = f"{count} {str(allowed).replace('number', 'numbers')}" if count else f"at least one {allowed}"

    def convert(value: Any) -> Any:
        return tuple(map(allowed.convert, value)) if isinstance(value, list | tuple) else allowed.convert(value)

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        several = isinstance(value, tuple) and len(value) > 0 and all(each in allowed for each in value)
        if not ((several and count in (None, len(value))) or (single and value in allowed)):
            refuse(instance, attribute, value, f"{wanted}, as in {default!r}")

    return attrs.field(default=default, converter=convert, validator=check, metadata=allowed.metadata)
