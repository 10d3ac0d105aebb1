"""An encoding for the views of one eye, with what that eye sees of them."""

from typing import TYPE_CHECKING

import attrs
import numpy as np
import torch
from jaxtyping import Bool, Float32

from tussock.render.images.source import DatabaseViews
from tussock.render.poses import Poses
from tussock.render.renderer import Renderer
from tussock.world.errors import SettingError

from .encoding_steps import Views, Visible
from .feature_mask import FeatureMask
from .overlap import remark_on_overlap

if TYPE_CHECKING:
    from .encoding import Encoding


@attrs.frozen
class EyeEncoding:
    """An encoding for the views of one eye.

    With a field of view or a mask it encodes the full circle, and leaves it to the model to hide what the eye does not see at each
    rotation, and to normalise what it sees (`Model.see`).

    Attributes:
        encoding: What is made of the full circle.
        mask: What of it the model sees; None where nothing is hidden.
        known: (height, width) What an image shows of the world, as it was recorded; None where that is all of it.
    """

    encoding: "Encoding"
    mask: FeatureMask | None
    known: Visible | None = attrs.field(default=None, eq=attrs.cmp_using(eq=np.array_equal))

    def at(self, renderer: Renderer, poses: Poses) -> Float32[torch.Tensor, "n h w"]:
        """Feature images of what a renderer, or image databases, show at poses."""
        return self(renderer.render(poses), renderer.known(poses) if isinstance(renderer, DatabaseViews) else None)

    def __call__(
        self, views: Views, known: Bool[np.ndarray, "n height width"] | None = None
    ) -> Float32[torch.Tensor, "n h w"]:
        """Feature images of the full circle, nan where they are not made of what is known.

        Args:
            views: (n, height, width, 3 or 4)
            known: What each view shows of the world; None: as it was recorded.
        """
        first = self.encoding.steps[0]
        if self.mask is not None and views.shape[-1] == 3 and getattr(first, "estimates_sky", False):
            raise SettingError(
                f"{first.name} estimates the sky from the whole view, hidden parts too; with a field, side, mask "
                "or compound eye give views with alpha, or take grey"
            )
        images = self.encoding(views)
        if self.known is None:
            return images
        for image, each in zip(images, [self.known] * len(views) if known is None else known, strict=True):
            image[torch.from_numpy(~self.encoding.visible(each))] = torch.nan
        return images

    def remark_on_overlap(self) -> None:
        """Log at how many rotations two images show too little of the same to be compared, if there are any."""
        if self.known is not None and self.mask is not None:
            shown = self.encoding.visible(self.known)
            remark_on_overlap(shown & self.mask.visible.numpy(), shown)

    def seen(self, views: Views) -> Float32[torch.Tensor, "n h w"]:
        """Feature images as the eye sees them at its present heading, 0 where it sees nothing: not to be turned (`FeatureMask.images`)."""
        images = self(views)
        return images if self.mask is None else self.mask.images(images)
