"""The last step of an encoding for a compound eye: from fine images to what its ommatidia see of them."""

import attrs
import numpy as np
from jaxtyping import Float32

from tussock.render.eye import Eye
from tussock.render.receptors import receptors_of

from .encoding_steps import EncodingStep, Images


@attrs.frozen
class SeenByOmmatidia(EncodingStep):
    """What the ommatidia of an eye see at all turns, as an image (see `Receptors`). People do not write it in a chain.

    Attributes:
        eye: A compound eye.
    """

    eye: Eye

    def __call__(self, images: Images) -> Float32[np.ndarray, "n rows turns"]:
        return receptors_of(self.eye).images(images)
