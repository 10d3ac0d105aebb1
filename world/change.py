"""What differs later in a world: plants gone or moved, grass mown, wind, a new object, another eye. Light to import.

    later = World.generate("tussock-field", seed=7).changed("removed amount=0.2 | wind amount=0.5 direction_deg=90", seed=3)

A change is a chain of parts with `|` between them, applied in order. A part has an `amount`: 0 changes nothing, and 1 is the most.
"""

import dataclasses
import math
import zlib
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import attrs

from .errors import SettingError
from .eye_change import EyeMount
from .registry import Registry
from .specs import format_spec

if TYPE_CHECKING:
    from .geometry import Route
    from .light import Light
    from .scene import World

CHANGES = Registry(
    "changes",
    "change",
    {
        name: f"tussock.world.{where}"
        for name, where in {
            "removed": "plant_changes:Removed",
            "moved": "plant_changes:Moved",
            "added": "plant_changes:Added",
            "grown": "plant_changes:Grown",
            "mown": "mowing:Mown",
            "wind": "wind:Wind",
            "object": "new_object:NewObject",
            "sun": "light_change:SunMoved",
            "clouds": "light_change:Clouded",
            "eye-raised": "eye_change:EyeRaised",
            "eye-turned": "eye_change:EyeTurned",
        }.items()
    },
)


@attrs.frozen(slots=False)
class Change:
    """A chain of changes of a world. `Change.parse` and `str` are each other's inverse.

    A part is any object that returns the changed world: `part(world, rng, route)`. It gets its own generator of random numbers. Other
    attributes are optional. At an `amount` of 0 it is not called; an amount is from 0 to 1. `mounted(mount)` returns how the eye is mounted
    then, and `lit(light)` the light. Where `states`, a number, is over 1, `in_state(state, rng)` returns the part as it is in one of these
    states.

    Attributes:
        parts: Those that are applied, in order.
    """

    parts: tuple[Any, ...]

    def __attrs_post_init__(self):
        if not self.parts:
            raise SettingError("a change without parts; give at least one, such as 'removed amount=0.2'")
        for part in self.parts:
            if not callable(part) or isinstance(part, type):
                raise SettingError(f"{part!r} is not a change; name a class whose objects return a changed world")
            amount = getattr(part, "amount", 1.0)
            if isinstance(amount, bool) or not isinstance(amount, int | float) or not 0 <= amount <= 1:
                raise SettingError(f"{CHANGES.name_of(type(part))}: amount is {amount!r}; give a number from 0 to 1")

    @classmethod
    def parse(cls, text: str, *, importing: bool = True) -> "Change":
        """The change that a text holds: parts separated by `|`, each a name and parameters.

        Args:
            text: A chain, such as "removed amount=0.2 | wind amount=0.5 direction_deg=90".
            importing: Whether `package.module:Class` may be imported.

        Raises:
            SettingError: For an unknown name or parameter, and for an invalid value.
        """

        def find(name: str) -> Callable[..., Any]:
            return CHANGES.find(name, importing=importing)

        try:
            check_names(text)
            return cls(tuple(CHANGES.spec(part.strip(), find).make() for part in text.split("|")))
        except SettingError as error:
            raise error if str(error).startswith("change ") else SettingError(f"change {text!r}: {error}") from error

    def apply(self, world: "World", seed: int = 0, route: "Route | None" = None, state: int = 0) -> "World":
        """The changed world; the world itself where every amount is 0.

        Args:
            world: The world as it is.
            seed: What is drawn differs with it. The same seed gives the same bytes.
            route: A new object stands next to it.
            state: Which of the states of a walk; see `states`.
        """
        changed = world
        for part, rng in self._with_generators(seed):
            if getattr(part, "amount", 1.0) == 0:
                continue
            if getattr(part, "states", 1) > 1:
                part = part.in_state(state, rng)
            changed = part(changed, rng, route)
            if not isinstance(changed, type(world)):
                raise SettingError(f"{self._name(part)} gives an object of type {type(changed).__name__}, not a World")
        if changed is world:
            return world
        if world.light is not None:
            raise SettingError(
                "the world is lit by a sun already, and its shadows would stay: change it first, as in lit(world.changed(...), light)"
            )
        changes = [*world.origin.get("changes", []), {"change": self.text_in_files(), "seed": int(seed)}]
        return dataclasses.replace(changed, origin=world.origin | {"changes": changes})

    def _with_generators(self, seed: int) -> Iterable[tuple[Any, Any]]:
        """Each part with its generator: that of its name, so that the parts before it do not matter."""
        import numpy as np

        from .generate import seeded

        seeded(seed)  # refuses an invalid seed
        count: dict[str, int] = {}
        for part in self.parts:
            name = CHANGES.name_in_files(type(part))
            count[name] = count.get(name, 0) + 1
            yield part, np.random.default_rng([int(seed), zlib.crc32(name.encode()), count[name]])

    @property
    def mount(self) -> EyeMount:
        """How the eye is mounted."""
        mount = EyeMount()
        for part in self.parts:
            mount = getattr(part, "mounted", lambda same: same)(mount)
        return mount

    @property
    def of_light(self) -> bool:
        """Whether it changes the sun or the sky."""
        return any(hasattr(part, "lit") for part in self.parts)

    def lit(self, light: "Light") -> "Light":
        """The light after the change. Raises SettingError at night."""
        for part in self.parts:
            light = getattr(part, "lit", lambda same: same)(light)
        return light

    @property
    def states(self) -> int:
        """How many states of the world there are, one of which is seen at each step of a walk; 1 where it stays the same."""
        return max(getattr(part, "states", 1) for part in self.parts)

    def __str__(self) -> str:
        return self._text

    @cached_property
    def _text(self) -> str:
        return " | ".join(map(_text_of, self.parts))

    def text_in_files(self) -> str:
        """The chain with the location of each class from outside: a name may mean another class in another process."""
        return " | ".join(_text_of(part, CHANGES.name_in_files) for part in self.parts)

    @staticmethod
    def _name(part: Any) -> str:
        return f"the change {CHANGES.name_of(type(part))!r}"


def as_change(value: Any) -> "Change | None":
    """A change from its text, its parts or None. Raises SettingError."""
    if isinstance(value, Change | None):
        return value
    if isinstance(value, str):
        return Change.parse(value)
    return Change((value,))


def check_names(text: str) -> None:
    """Refuse a change with an unknown name, without importing what the names stand for. Raises SettingError."""
    for part in text.split("|"):
        if not part.strip():
            raise SettingError(f"change {text!r}: a part is empty; give names and parameters, with | between them only")
        CHANGES.check((part.split() or [""])[0])


def _text_of(part: Any, name_of: Callable[[type], str] = CHANGES.name_of) -> str:
    """A part as `Change.parse` reads it, with angles in degrees where these are read as the same."""
    spec = CHANGES.spec_of(part)
    units = {each.name: each.metadata.get("unit") for each in attrs.fields(type(part))} if attrs.has(type(part)) else {}
    parameters: dict[str, Any] = {}
    for name, value in spec.parameters.items():
        degrees = round(math.degrees(value), 9) if units.get(name) == "rad" else None
        same = degrees is not None and math.radians(degrees) == value
        parameters |= {f"{name}_deg": degrees} if same else {name: value}
    return format_spec(name_of(type(part)), parameters)
