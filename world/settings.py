"""Settings that check themselves: fields with a range and a unit, for attrs classes.

    @settings
    class Body:
        step_length: float = number(0.05, above=0, unit="m")

A value outside its range raises `SettingError` where the settings are made, whoever makes them: a script, the command line
or a sweep file. A tool can read the range and unit of a field: `describe(Body)`.

attrs does the work: it checks when an object is made and when it is changed, keeps values as they are, takes arrays and any
other class as a value, and comes with rerun-sdk already. pydantic would convert values by rules of its own, and msgspec
checks only what it decodes.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from numbers import Integral, Real
from typing import Any, TypeVar, dataclass_transform

import attrs

from .errors import SettingError

T = TypeVar("T")


def converted(*, default: Any, converter: Callable[..., Any], takes_self: bool = False) -> Any:
    """A field whose value, the default included, is made by a converter, which raises SettingError for what it cannot use.

    takes_self: the converter also gets the object, with the fields before this one.
    """
    convert = attrs.Converter(converter, takes_self=True) if takes_self else converter
    return attrs.field(default=default, converter=convert)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(attrs.field, converted))
def settings(cls: type[T]) -> type[T]:
    """Class decorator: a frozen class of keyword fields, which are checked when it is made."""
    return attrs.frozen(kw_only=True, slots=False)(cls)


def number(
    default: Any = attrs.NOTHING, *, low: float = -math.inf, high: float = math.inf, above: float | None = None,
    below: float | None = None, unit: str = "", optional: bool = False, names: Collection[str] = (),
) -> Any:  # fmt: skip
    """A field for a finite number.

    low, high: the range, both ends allowed. above, below: the range, the end not allowed.
    unit: of the number; a "rad" is also reported in degrees. optional: None is allowed.
    names: texts that are allowed in place of a number.
    """
    limits = _Limits(Real, low, high, above, below)
    return _field(default, limits, unit, optional, names)


def whole(
    default: Any = attrs.NOTHING, *, low: float = 1, high: float = 2**62, unit: str = "", optional: bool = False
) -> Any:
    """A field for a whole number from `low` to `high`, both allowed. optional: None is allowed."""
    return _field(default, _Limits(Integral, low, high, None, None), unit, optional, ())


def numbers(
    default: tuple[float, ...], *, low: float = -math.inf, high: float = math.inf, unit: str = "", single: bool = False
) -> Any:
    """A field for a tuple of at least one number. single: one number that stands alone is allowed as well."""
    return _several(default, _Limits(Real, low, high, None, None), unit, single)


def wholes(
    default: tuple[int, ...], *, low: float = 1, high: float = 2**62, unit: str = "", single: bool = False
) -> Any:
    """A field for a tuple of at least one whole number. single: one number that stands alone is allowed as well."""
    return _several(default, _Limits(Integral, low, high, None, None), unit, single)


def choice(default: str, names: Iterable[str]) -> Any:
    """A field for one of several texts."""
    known = tuple(names)

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if value not in known:
            refuse(instance, attribute, value, f"one of {', '.join(known)}")

    return attrs.field(default=default, validator=check, metadata={"choices": known})


def text(default: Any = attrs.NOTHING, *, optional: bool = False) -> Any:
    """A field for a text that can be printed. optional: None is allowed."""

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if not ((optional and value is None) or (isinstance(value, str) and value.isprintable())):
            refuse(instance, attribute, value, "a text that can be printed")

    return attrs.field(default=default, validator=check)


def switch(default: bool) -> Any:
    """A field for True or False."""
    return instance_of(bool, default, "True or False")


def instance_of(kinds: Any, default: Any, wanted: str, *, converter: Callable[[Any], Any] | None = None) -> Any:
    """A field for an object of some class. wanted: what it should be, in words. converter: applied before the check."""

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if not isinstance(value, kinds):
            refuse(instance, attribute, value, wanted)

    return attrs.field(default=default, validator=check, converter=converter)


def describe(cls: type) -> dict[str, dict[str, Any]]:
    """Default, unit and range of every field of a settings class, by name."""
    return {each.name: {"default": each.default} | dict(each.metadata) for each in attrs.fields(cls)}


def refuse(instance: Any, attribute: attrs.Attribute, value: Any, wanted: str) -> None:
    """Raise SettingError for a value: what was given, and what is wanted."""
    label = getattr(type(instance), "name", "") or type(instance).__name__
    raise SettingError(f"{label}: {attribute.name} is {shown(value, attribute.metadata)}; give {wanted}")


def shown(value: Any, metadata: Mapping[str, Any]) -> str:
    """A value as an error reports it: an angle in degrees as well."""
    if metadata.get("unit") == "rad" and isinstance(value, Real) and not isinstance(value, bool):
        return f"{value:g} rad ({math.degrees(float(value)):g} degrees)"
    return repr(value)


class _Limits:
    """A kind of number and its range."""

    def __init__(self, kind: type, low: float, high: float, above: float | None, below: float | None):
        self.kind, self.low, self.high, self.above, self.below = kind, low, high, above, below

    def allow(self, value: Any) -> bool:
        if isinstance(value, bool) or not isinstance(value, self.kind) or not math.isfinite(value):
            return False
        inside = self.low <= value <= self.high
        return inside and (self.above is None or value > self.above) and (self.below is None or value < self.below)

    def convert(self, value: Any) -> Any:
        """A number as Python's own type; anything else as it is."""
        if isinstance(value, bool) or not isinstance(value, self.kind):
            return value
        return int(value) if self.kind is Integral else float(value)  # type: ignore[arg-type]

    def wanted(self, unit: str) -> str:
        parts = ["a whole number" if self.kind is Integral else "a number"]
        low = f"over {self.above:g}" if self.above is not None else f"from {self.low:g}" if self.low > -math.inf else ""
        bounded = self.high < math.inf and not (self.kind is Integral and self.high >= 2**62)
        high = f"under {self.below:g}" if self.below is not None else f"to {self.high:g}" if bounded else ""
        parts += [part for part in (low, high) if part]
        return " ".join(parts) + (f" ({unit})" if unit else "")


def _field(default: Any, limits: _Limits, unit: str, optional: bool, names: Collection[str]) -> Any:
    def convert(value: Any) -> Any:
        return limits.convert(value)

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if (optional and value is None) or (isinstance(value, str) and value in names) or limits.allow(value):
            return
        others = [f"one of {', '.join(names)}"] * bool(names) + ["None"] * optional
        refuse(instance, attribute, value, " or ".join([limits.wanted(unit), *others]))

    return attrs.field(default=default, converter=convert, validator=check, metadata=_metadata(limits, unit))


def _several(default: tuple, limits: _Limits, unit: str, single: bool) -> Any:
    def convert(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return tuple(map(limits.convert, value))
        return limits.convert(value)

    def check(instance: Any, attribute: attrs.Attribute, value: Any) -> None:
        if single and limits.allow(value):
            return
        if not (isinstance(value, tuple) and value and all(map(limits.allow, value))):
            refuse(
                instance, attribute, value, f"at least one {limits.wanted(unit).removeprefix('a ')}, as in {default!r}"
            )

    return attrs.field(default=default, converter=convert, validator=check, metadata=_metadata(limits, unit))


def _metadata(limits: _Limits, unit: str) -> dict[str, Any]:
    low, high = (a if b is None else b for a, b in ((limits.low, limits.above), (limits.high, limits.below)))
    return {"unit": unit, "low": low, "high": high}
