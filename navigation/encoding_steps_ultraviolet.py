"""Steps of encodings for what insects see in green and in ultraviolet.

In the ultraviolet the sky is bright and the ground is dark, plants and soil alike, in any weather: a tenth of the light or less comes back
from them. So the skyline is where the ultraviolet drops (Moeller 2002; Differt and Moeller 2015). Views of an eye with the spectrum of
insects show the ultraviolet (render/spectrum.py). Of other views, and of recorded images, the open sky is 1, and all else is `reflectance`.
"""

from typing import ClassVar

import attrs
import numpy as np
from jaxtyping import Float32

from tussock.world.errors import SettingError
from tussock.world.settings import number

from .encoding_steps import EncodingStep, ForegroundMask, Images, PixelStep, Views, Visible

REFLECTANCE = 0.05  # of foliage and soil in the ultraviolet, about, in the presets


@attrs.frozen
class GreenChannel(PixelStep):
    """What green receptors see: the green channel, 0..1."""

    name: ClassVar[str] = "green-channel"
    takes_views: ClassVar[bool] = True

    def __call__(self, images: Views) -> Images:
        return images[..., 1] * np.float32(1 / 255)


@attrs.frozen
class Ultraviolet(PixelStep):
    """What ultraviolet receptors see, 0..1: open sky is 1, and all else is dark. The sky is found as `foreground-mask` finds it.

    Attributes:
        reflectance: Of all that is not sky.
    """

    name: ClassVar[str] = "ultraviolet"
    takes_views: ClassVar[bool] = True
    estimates_sky: ClassVar[bool] = True
    reflectance: float = number(low=0, high=1)

    def __call__(self, images: Views) -> Images:
        return self.ultraviolet(images)

    def ultraviolet(self, images: Views) -> Images:
        """The ultraviolet in views, 0..1."""
        return 1 - np.float32(1 - self.reflectance) * ForegroundMask()(images)


@attrs.frozen
class UltravioletGreen(Ultraviolet):
    """The contrast of ultraviolet and green, (u - g) / (u + g), -1..1: outdoors it hardly changes as the light grows brighter or dimmer."""

    name: ClassVar[str] = "ultraviolet-green"

    def __call__(self, images: Views) -> Images:
        ultraviolet, green = self.ultraviolet(images), GreenChannel()(images)
        total = ultraviolet + green
        return np.divide(ultraviolet - green, total, out=np.zeros_like(total), where=total > 0)

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return -1.0, 1.0


@attrs.frozen
class UltravioletAndGreen(Ultraviolet):
    """Both channels, 0..1: the ultraviolet plane above the green one. Models learn them as one image of twice the rows.

    A blur, or a resize that does not divide the height, mixes them where they meet.
    """

    name: ClassVar[str] = "ultraviolet-and-green"

    def __call__(self, images: Views) -> Float32[np.ndarray, "n both_planes w"]:
        return np.concatenate([self.ultraviolet(images), GreenChannel()(images)], axis=1)

    def visible(self, mask: Visible) -> Visible:
        """The same pixels, in both planes."""
        return np.concatenate([mask, mask])


class _Shown(Ultraviolet):
    """Of views that show the ultraviolet in place of red."""

    estimates_sky: ClassVar[bool] = False

    def ultraviolet(self, images: Views) -> Images:
        return images[..., 0] * np.float32(1 / 255)


class ShownUltraviolet(_Shown):
    """`Ultraviolet` of such views."""


class ShownUltravioletGreen(_Shown, UltravioletGreen):
    """`UltravioletGreen` of such views."""


class ShownUltravioletAndGreen(_Shown, UltravioletAndGreen):
    """`UltravioletAndGreen` of such views."""


SHOWN = {
    Ultraviolet: ShownUltraviolet,
    UltravioletGreen: ShownUltravioletGreen,
    UltravioletAndGreen: ShownUltravioletAndGreen,
}
ULTRAVIOLET_STEPS = (GreenChannel, *SHOWN)


def of_insects(step: EncodingStep) -> EncodingStep:
    """A step for views that show the ultraviolet in place of red. Raises SettingError for a number that would then mean nothing."""
    if not isinstance(step, Ultraviolet) or type(step) not in SHOWN:
        return step
    share = f"{step.reflectance:g}"
    if step.reflectance != REFLECTANCE:
        raise SettingError(
            f"{step.name} {share} says what all but the sky reflects, which an eye with the spectrum of insects sees: give {step.name} "
            f"{REFLECTANCE:g}, and --spectrum 'insect plants={share} ground={share} stones={share} other={share}'"
        )
    return SHOWN[type(step)](step.reflectance)
