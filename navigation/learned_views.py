"""Which of the views that were learned looks most like another view, at one rotation of it."""

from collections.abc import Iterable

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int64

from tussock.world.geometry import columns_of_turn

from .feature_mask import FeatureMask
from .threads import one_torch_thread

Images = Float32[torch.Tensor, "n h w"]


class LearnedViews:
    """Encoded views, compared as perfect memory does: by |v - s|^2 of what the eye sees of both.

    All are compared by one product of matrices, |v - s|^2 = |v|^2 - 2 v . s + |s|^2. Where its rounding leaves open which is the
    nearest, the distance is computed again directly. So the result does not depend on what is compared at the same time; of equally near
    views it is the first.

    Args:
        views: (m, h, w) They are not copied, but for what a mask shows of them.
        mask: What the eye sees; None means everything.
    """

    def __init__(self, views: Images, mask: FeatureMask | None):
        self._mask = mask
        self._rows = self._pixels(views)
        self._squares = _squares(self._rows)

    def nearest(self, looks: Iterable[tuple[Float32[torch.Tensor, "h w"], float]]) -> list[int]:
        """Index of the learned view that is nearest to each of some views, as seen after a turn.

        Args:
            looks: Views, each with the turn (rad, left positive), which is rounded to whole columns.
        """
        turned = [view.roll(int(np.rint(columns_of_turn(turn, view.shape[1]))), dims=1) for view, turn in looks]
        seen = self._pixels(torch.stack(turned))
        with one_torch_thread():
            products = seen @ self._rows.T
        squared = self._squares - 2.0 * products.numpy().astype(np.float64)
        # A product of n pixels is wrong by n / 2 eps |v| |s| at most, and the difference of two distances by four times that.
        longest = np.sqrt(self._squares.max() * _squares(seen))
        tolerance = 2 * seen.shape[1] * np.finfo(np.float32).eps * longest
        candidates = squared <= (squared.min(axis=1) + tolerance)[:, None]
        return [self._nearest_of(np.flatnonzero(some), view) for some, view in zip(candidates, seen, strict=True)]

    def _nearest_of(self, candidates: Int64[np.ndarray, " k"], view: Float32[torch.Tensor, " pixels"]) -> int:
        """Which of some learned views is the nearest, in float64."""
        if len(candidates) == 1:
            return int(candidates[0])
        differences = self._rows.numpy()[candidates] - view.numpy().astype(np.float64)
        return int(candidates[(differences**2).sum(axis=1).argmin()])

    def _pixels(self, views: Images) -> Float32[torch.Tensor, "n pixels"]:
        """What the eye sees of views, in rows."""
        return views.flatten(start_dim=1) if self._mask is None else self._mask.pixels(views)


def _squares(rows: Float32[torch.Tensor, "n pixels"]) -> Float64[np.ndarray, " n"]:
    """Sum of the squares of each row, without a copy of all in float64."""
    return np.einsum("ij,ij->i", rows.numpy(), rows.numpy(), dtype=np.float64)
