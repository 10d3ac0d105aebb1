"""Which pixels of feature images an eye sees.

A mask stands still with the eye, and the view turns behind it: what is seen at rotation k of a view v is M roll(v, k), with M 1 where
a pixel is visible and 0 elsewhere. The response of a filter F to it is F . M roll(v, k) = (M F) . roll(v, k): a mask belongs to the
filter. Sums over what is visible, at all rotations, are the responses of M itself. Where features are normalised, mean and
deviation are those of the visible pixels at each rotation: (M F) . (roll(v, k) - mean[k]) / deviation[k].

Blanking pixels of v instead is wrong: the blank turns with the view (docs/eyes.md).

What a recorded image does not show is another thing: it is not known, at any rotation, and does turn with the view. Such pixels of
feature images are nan, and a mask says so beforehand (`partial`).
"""

from collections.abc import Sequence
from typing import TypeVar

import attrs
import torch
from jaxtyping import Bool, Float, Float32, Float64

from tussock.world.errors import SettingError

MIN_DEVIATION = 1e-6  # of what is visible; with less it has no contrast, and is normalised to 0

WITH_MASK = "give an eye with a full field and no mask, or another model (docs/extending.md)"

Images = Float32[torch.Tensor, "n h w"]
T = TypeVar("T")


@attrs.frozen(eq=False)
class FeatureMask:
    """Which pixels of feature images are visible, and how they are normalised. Sums are in float64: at some rotations little is seen.

    Attributes:
        visible: (h, w)
        normalised: What is visible is shifted to mean 0 and scaled to unit variance (without contrast it becomes 0).
        gain: By which it is multiplied then.
        partial: Pixels of views may be unknown, which are nan. Then views are normalised where they are compared (overlap.py).
    """

    visible: Bool[torch.Tensor, "h w"]
    normalised: bool = False
    gain: float = 1.0
    partial: bool = False

    def __attrs_post_init__(self):
        if not self.visible.any():
            raise SettingError("the mask hides all pixels of the feature images; show at least one")

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, FeatureMask)
            and (self.normalised, self.gain, self.partial) == (other.normalised, other.gain, other.partial)
            and torch.equal(self.visible, other.visible)
        )

    __hash__ = None  # type: ignore[assignment]

    @property
    def count(self) -> int:
        """Number of visible pixels."""
        return int(self.visible.sum())

    def check(self, shape: Sequence[int]) -> None:
        """Refuse views of another shape (h, w). Raises SettingError."""
        if tuple(shape) != tuple(self.visible.shape):
            raise SettingError(
                f"views of shape {tuple(shape)} behind a mask of {tuple(self.visible.shape)}; encode views as the mask was made"
            )

    def scaled(self, factor: float) -> "FeatureMask":
        """The same, with what is visible multiplied by a factor."""
        return attrs.evolve(self, gain=self.gain * factor)

    def linear(self) -> "FeatureMask":
        """The same pixels, as they are."""
        return FeatureMask(self.visible)

    def pixels(self, views: Images) -> Float32[torch.Tensor, "n visible"]:
        """What is visible of views at their present heading."""
        return self.scaled_pixels(self.select(views))

    def scaled_pixels(self, pixels: Float[torch.Tensor, "n visible"]) -> Float32[torch.Tensor, "n visible"]:
        """Visible pixels of views, in rows, normalised where the mask says so."""
        pixels = pixels.double()
        if self.normalised:
            deviation, mean = torch.std_mean(pixels, dim=1, keepdim=True, correction=0)
            pixels = (pixels - mean) / deviation.where(deviation > MIN_DEVIATION, torch.inf)
        return (self.gain * pixels).float()

    def images(self, views: Images) -> Images:
        """The same as images, 0 where nothing is visible. Partial ones as they are, nan where nothing is visible or known."""
        if self.partial:
            return views.masked_fill(~self.visible.to(views.device), torch.nan)
        return self.spread(self.pixels(views))

    def select(self, images: Float[torch.Tensor, "n h w"]) -> Float[torch.Tensor, "n visible"]:
        """The visible pixels of images, as they are."""
        return images[:, self.visible.to(images.device)]

    def spread(self, pixels: Float[torch.Tensor, "n visible"]) -> Float[torch.Tensor, "n h w"]:
        """Images with these visible pixels, and 0 elsewhere."""
        images = pixels.new_zeros(len(pixels), *self.visible.shape)
        images[:, self.visible.to(pixels.device)] = pixels
        return images

    def statistics(self, views: Images) -> tuple[Float64[torch.Tensor, "n w"], Float64[torch.Tensor, "n w"]]:
        """Mean and factor at each rotation k: what is seen there is factor[k] (roll(v, k) - mean[k]), where it is visible."""
        n, width = len(views), views.shape[2]
        if not self.normalised:
            nothing = torch.zeros(n, width, dtype=torch.float64, device=views.device)
            return nothing, nothing + self.gain
        level = views.mean(dim=(1, 2), keepdim=True, dtype=torch.float64)  # around it, little is lost to rounding
        centred = views.double() - level
        mean = self._sums(centred) / self.count
        variance = self._sums(centred.square()) / self.count - mean.square()
        deviation = variance.clamp(min=0).sqrt()
        return mean + level[:, 0], self.gain / deviation.where(deviation > MIN_DEVIATION, torch.inf)

    def energies(self, views: Images) -> Float64[torch.Tensor, "n w"]:
        """Sum of the squares of what is seen at each rotation."""
        if self.normalised:
            return (self.statistics(views)[1] > 0).double() * (self.gain**2 * self.count)
        return self.gain**2 * self._sums(views.double().square())

    def _sums(self, images: Float64[torch.Tensor, "n h w"]) -> Float64[torch.Tensor, "n w"]:
        """Sum over the visible pixels of images at each rotation, by the correlation theorem."""
        mask = torch.fft.rfft(self.visible.to(images.device).double())
        width = images.shape[2]
        sums = [torch.fft.irfft((torch.fft.rfft(each.clone()).conj() * mask).sum(dim=0), n=width) for each in images]
        return torch.stack(sums)  # one by one, so that a view has the same sums, to the last bit, alone as among others


def energies(views: Float[torch.Tensor, "n h w"], mask: FeatureMask | None) -> Float[torch.Tensor, "n rotations"]:
    """Sum of the squares of what is seen at each rotation (n, w); where nothing is hidden it is the same at all of them (n, 1)."""
    return views.square().sum(dim=(1, 2))[:, None] if mask is None else mask.energies(views)


def is_partial(mask: FeatureMask | None) -> bool:
    """Whether pixels of views may be unknown."""
    return mask is not None and mask.partial


def check_takes_partial(model: object, mask: FeatureMask | None) -> None:
    """Refuse a model that cannot compare views of which parts are unknown. Raises SettingError."""
    if is_partial(mask) and not getattr(model, "takes_partial", False):
        raise SettingError(
            f"{getattr(model, 'name', type(model).__name__)} needs to know all of an image, and parts of these show nothing of the world; "
            "give perfect-memory, which compares what two images both show"
        )


def seeing(model: T, mask: FeatureMask | None) -> T:
    """Any untrained model, told what the eye sees. Raises SettingError where it does not mind that."""
    check_takes_partial(model, mask)
    see = getattr(model, "see", None)
    if see is not None:
        see(mask)
    elif mask is not None:
        raise SettingError(
            f"{type(model).__name__} lacks see(mask), so it does not know what the eye sees; {WITH_MASK}"
        )
    return model
