"""What is kept of a view: an encoding is a chain of named steps from a panorama to a feature image.

`Encoding.parse("foreground-mask | vertical-edges | resize 3 | normalise")` and `str(encoding)` are each other's inverse.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import attrs
import numpy as np
import torch
from jaxtyping import Float32

from tussock.render.eye import Eye
from tussock.render.receptors import receptors_of
from tussock.render.spectrum import HUMAN
from tussock.world.errors import SettingError
from tussock.world.registry import Registry, suggestion
from tussock.world.specs import signature_of

from .encoding_ommatidia import SeenByOmmatidia
from .encoding_rounding import Round
from .encoding_steps import STEPS as BUILTIN
from .encoding_steps import Blur, EncodingStep, Images, Normalise, Resize, Scale, Views, Visible
from .encoding_steps_colour import COLOUR_STEPS
from .encoding_steps_published import STEPS as PUBLISHED
from .encoding_steps_ultraviolet import REFLECTANCE, ULTRAVIOLET_STEPS, of_insects
from .eye_encoding import EyeEncoding
from .feature_mask import FeatureMask

STEPS = Registry(
    "encodings",
    "encoding step",
    {
        step.name: f"{step.__module__}:{step.__qualname__}"
        for step in (*BUILTIN, *PUBLISHED, *COLOUR_STEPS, *ULTRAVIOLET_STEPS)
    },
)
OLD_NAMES = {"sky-mask": "foreground-mask"}  # of steps; files and people may still use them
PRESETS = {
    "grey": "grey | {blur}{resize}",
    "sky": "foreground-mask | {blur}{resize}normalise",
    "edges": "foreground-mask | {blur}vertical-edges | {resize}normalise",
    "green": "green-channel | {blur}{resize}",
    "uv": f"ultraviolet {REFLECTANCE} | {{blur}}{{resize}}",
    "uv-green": f"ultraviolet-green {REFLECTANCE} | {{blur}}{{resize}}",
}
FINE_WIDTH = 120  # columns that a preset encoding reduces wider views to
BATCH_PIXELS = 108_000  # of views that are encoded at once: they stay in the processor's cache through all steps


@attrs.frozen
class Encoding:
    """A chain of steps, applied in order. What they make of a view is rounded (`Round`).

    Attributes:
        steps: One that takes views (grey or foreground-mask, say), then any number of others. A resize by 1 is left out.
        rounded: Whether values are rounded; not where a mask normalises them later, as low contrast would be lost.
    """

    steps: tuple[EncodingStep, ...] = attrs.field(
        converter=lambda steps: tuple(step for step in steps if step != Resize(1))
    )
    rounded: bool = True

    def __attrs_post_init__(self):
        if not self.steps:
            raise SettingError("an encoding without steps; give at least grey")
        normalised = False
        for place, step in enumerate(self.steps):
            if getattr(step, "takes_views", False) != (place == 0):
                where = "at the beginning only" if place else "after one that takes views, such as grey"
                raise SettingError(f"encoding {str(self)!r}: {label(step)!r} can stand {where}")
            if normalised and getattr(step, "takes_unit_range", False):
                problem = f"{label(step)} takes values from 0 to 1; put it before normalise"
                raise SettingError(f"encoding {str(self)!r}: {problem}")
            normalised |= isinstance(step, Normalise)

    def __call__(self, views: Views) -> Float32[torch.Tensor, "n h w"]:
        """Feature images of views (n, height, width, 3 or 4) uint8."""
        if views.ndim != 4 or views.shape[-1] not in (3, 4) or views.dtype != np.uint8:
            raise SettingError(f"views are (n, height, width, 3 or 4) uint8, got {views.shape} {views.dtype}")
        batch = max(1, BATCH_PIXELS // max(1, views.shape[1] * views.shape[2]))
        parts = [self._encode(views[start : start + batch]) for start in range(0, max(1, len(views)), batch)]
        return torch.from_numpy(np.concatenate(parts))

    def _encode(self, views: Views) -> Images:
        images = views
        for step in self._applied:
            images = step(images)
        return images.astype(np.float32, copy=False)

    @property
    def _applied(self) -> tuple[Any, ...]:
        """The steps, and the rounding of what they make of a view: before it is scaled down, so that this loses nothing."""
        if not self.rounded:
            return self.steps
        last = len(self.steps)
        while isinstance(self.steps[last - 1], Scale):
            last -= 1
        return *self.steps[:last], Round(), *self.steps[last:]

    def bounds(self, height: int, width: int) -> tuple[tuple[int, int], float, float]:
        """Shape (h, w) of the feature image of a view of height x width, and its least and greatest value, but for rounding."""
        images, low, high = np.zeros((1, height, width, 4), np.uint8), 0.0, 1.0
        for step in self._applied:
            images = step(images)
            unknown = (-np.inf, np.inf)
            low, high = step.bounds(low, high, images.size) if isinstance(step, EncodingStep) else unknown
        return (images.shape[1], images.shape[2]), low, high

    def for_eye(self, eye: Eye) -> "EyeEncoding":
        """This encoding for the views of an eye, which may have a field of view or a mask. Raises SettingError where it cannot be."""
        if eye.compound is not None:
            return self._for_ommatidia(eye)
        known = eye.known
        one_column = any(getattr(step, "shows_one_column", False) for step in self.steps)
        visible = eye.visible() if eye.masked or known is not None or one_column else None
        if visible is None or (visible.all() and known is None and not one_column):
            return EyeEncoding(self._seeing(eye), None)
        local, normalised, gain = self._without_normalise()
        chain = attrs.evolve(self, steps=local, rounded=not normalised)
        visible = chain.visible(visible)
        if not visible.any() or (known is not None and not chain.visible(known.visible()).any()):
            raise SettingError(
                f"encoding {str(self)!r} leaves no pixel that is made of visible ones alone; give less blur or resize, or a wider field"
            )
        partial = known is not None
        mask = FeatureMask(torch.from_numpy(visible), normalised=normalised, gain=gain, partial=partial)
        return EyeEncoding(chain._seeing(eye), mask, known.visible() if partial else None)

    def _seeing(self, eye: Eye) -> "Encoding":
        """The chain for the channels that views of an eye show."""
        return self if eye.spectrum == HUMAN else attrs.evolve(self, steps=map(of_insects, self.steps))

    def _for_ommatidia(self, eye: Eye) -> "EyeEncoding":
        """For a compound eye: all steps before the normalisation are of the panorama that its ommatidia look at."""
        local, normalised, gain = self._without_normalise()
        shape, _, _ = attrs.evolve(self, steps=local).bounds(eye.height, eye.width)
        if shape != (eye.height, eye.width):
            raise SettingError(
                f"encoding {str(self)!r} makes images of another size ({shape[1]}x{shape[0]}), but ommatidia look at all of a view: "
                "leave resize out, and steps of several planes"
            )
        visible = receptors_of(eye).visible(eye.ommatidia_in_field())
        chain = attrs.evolve(self, steps=(*local, SeenByOmmatidia(eye)), rounded=not normalised)
        return EyeEncoding(chain._seeing(eye), FeatureMask(torch.from_numpy(visible), normalised=normalised, gain=gain))

    def _without_normalise(self) -> tuple[tuple[EncodingStep, ...], bool, float]:
        """The steps before normalise, whether there is one, and the factor by which its result is scaled. Raises SettingError."""
        at = next((place for place, step in enumerate(self.steps) if isinstance(step, Normalise)), len(self.steps))
        rest = self.steps[at + 1 :]
        for step in rest:
            if not isinstance(step, Scale):
                raise SettingError(
                    f"encoding {str(self)!r}: with a field or mask, normalise takes what is visible at each heading, so it stands last, "
                    f"or before scale only; put {label(step)} before it"
                )
        gain = float(np.prod([step.factor for step in rest if isinstance(step, Scale)]))
        return self.steps[:at], at < len(self.steps), gain

    def visible(self, mask: Visible) -> Visible:
        """Which pixels of a feature image are made of visible ones (height, width) alone. Raises SettingError where that is not known."""
        for step in self.steps:
            check = getattr(step, "visible", None)
            if check is None:
                raise SettingError(
                    f"encoding {str(self)!r}: {label(step)} lacks visible(mask), which a field or mask needs"
                )
            mask = check(mask)
        return mask

    def __str__(self) -> str:
        return self._text(STEPS.name_of)

    def text_in_files(self) -> str:
        """The chain with the location of each class from outside: a name may mean another class in another process."""
        return self._text(STEPS.name_in_files)

    def _text(self, name_of: Callable[[type], str]) -> str:
        steps = [[name_of(type(step)), *map(format_number, parameters_of(step))] for step in self.steps]
        texts = list(map(" ".join, steps))
        return " | ".join(texts if len(texts) != 1 else [*texts, "resize 1"])  # one word alone may be a preset's name

    @classmethod
    def parse(cls, text: str, *, importing: bool = True) -> "Encoding":
        """The encoding that a text holds: steps separated by `|`, each a name and its numbers.

        Args:
            text: A chain. A step from outside is named by its entry point or as `package.module:Class`.
            importing: Whether `package.module:Class` may be imported; a file must not cause that.

        Raises:
            SettingError: For an unknown step, and for numbers that it does not take.
        """
        try:
            return cls(tuple(_parse_step(part, importing) for part in text.split("|")))
        except SettingError as error:
            raise error if repr(text) in str(error) else SettingError(f"encoding {text!r}: {error}") from error

    @classmethod
    def named(cls, name: str, resize: float = 1.0, blur: float = 0.0) -> "Encoding":
        """The encoding of a preset, or of a chain in full.

        Args:
            name: A preset (grey, sky, edges), a chain, or a step that can stand alone.
            resize: Factor by which a preset reduces the view; 1 leaves it as it is.
            blur: Standard deviation (pixels of the view) of the smoothing at the beginning of a preset; 0 is none.
        """
        if name in PRESETS:
            text = PRESETS[name].format(
                blur=f"blur {format_number(blur)} | " if blur else "",
                resize=f"resize {format_number(resize)} | " if resize != 1 else "",
            )
            return cls.parse(text.rstrip(" |"))
        if not ("|" in name or ":" in name or OLD_NAMES.get(name, name) in STEPS):
            raise SettingError(
                f"unknown encoding {name!r}{suggestion(name, PRESETS)}; known: {', '.join(PRESETS)}, or a chain: 'grey | resize 6'"
            )
        if resize != 1 or blur != 0:
            raise SettingError(f"encoding {name!r} is a chain in full: put resize and blur into it")
        return cls.parse(name)


def label(step: Any) -> str:
    """The name of a step in a chain."""
    return STEPS.name_of(type(step))


def automatic_resize(eye: Eye) -> float:
    """The factor by which a preset encoding reduces the views of an eye; the ommatidia of a compound eye reduce them themselves."""
    return 1.0 if eye.compound is not None else max(1.0, eye.width / FINE_WIDTH)


def describe_encoding(encoding: Encoding, eye: Eye) -> tuple[str, float | None, float]:
    """An encoding in short: a preset's name, its resize (None: automatic) and blur; else the whole chain."""
    blur = next((step.sigma for step in encoding.steps if isinstance(step, Blur)), 0.0)
    resize = next((step.factor for step in encoding.steps if isinstance(step, Resize)), 1.0)
    for name, preset in _presets(resize, blur).items():
        if preset == encoding:
            return name, None if resize == automatic_resize(eye) else resize, blur
    return str(encoding), None, 0.0


@lru_cache  # the runs of a sweep have few
def _presets(resize: float, blur: float) -> dict[str, Encoding]:
    return {name: Encoding.named(name, resize=resize, blur=blur) for name in PRESETS}


def format_number(number: float) -> str:
    """A number with as many digits as it takes to read it back equal."""
    short = f"{number:.15g}"
    return short if float(short) == number else repr(float(number))


def parameters_of(step: Any) -> list[float]:
    """The numbers of a step, in their order."""
    return [getattr(step, name) for name in signature_of(type(step)).parameters]


def _parse_step(part: str, importing: bool) -> Any:
    name, *texts = part.split() or [""]
    if name in PRESETS and name not in STEPS:
        chain = PRESETS[name].format(blur="", resize="").rstrip(" |")
        raise SettingError(f"{name} is a preset, which stands alone (--resize reduces it); as a chain it is '{chain}'")
    kind = STEPS.find(OLD_NAMES.get(name, name), importing=importing)
    names = list(signature_of(kind).parameters)
    try:
        values = [float(text) for text in texts]
    except ValueError:
        values = []
    if len(values) != len(names) or len(texts) != len(names):
        takes = f"{len(names)} number{'s' * (len(names) != 1)} ({', '.join(names)})" if names else "no numbers"
        raise SettingError(f"{name} takes {takes}, got {part.strip()!r}")
    step = kind(*values)
    if not callable(step):
        raise SettingError(f"{name!r} is not an encoding step; name a class whose objects take and return images")
    return step
