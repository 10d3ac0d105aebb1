"""A model that knows nothing: the control that others are measured against."""

import numpy as np
import torch
from jaxtyping import Float32, UInt64

from .base import Images, Learned, Model, Scans, Scores, Shapes, model


@model
class RandomHeadings(Model):
    """Learns nothing of the views; familiarity is a random number from 0 to 1, drawn for each rotation of each view.

    The control of Ardin et al.: the most familiar heading is random, and differs where anything in the view differs. The number is
    a hash of what is visible of the view at that rotation, with weights drawn from the seed: the same view always has the same heading.
    Memory: one weight for each row and each column.
    """

    name = "random"
    paper = "Ardin et al. 2016"
    takes_mask = True
    recognises = False
    dtypes = {"rows": torch.int64, "columns": torch.int64}  # noqa: RUF012

    def _learn(self, views: Images) -> Learned:
        random = np.random.default_rng(self.seed)
        rows, columns = (random.integers(2**63, size=size) * 2 + 1 for size in views.shape[1:])  # odd, of 64 bits
        return {"rows": self._on_device(torch.from_numpy(rows)), "columns": self._on_device(torch.from_numpy(columns))}

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"rows": (height,), "columns": (width,)}

    def _prepare(self) -> None:
        self._rows, columns = (self.learned[key].cpu().numpy().view(np.uint64) for key in ("rows", "columns"))
        column = np.arange(len(columns))
        self._at = (column[:, None] + column) % len(columns)  # (w, w) where each column is at each rotation
        self._columns = columns[self._at]

    def _scan(self, views: Images) -> Scans:
        pixels = as_numbers(views)
        if self.mask is None:
            hashes = split_mix(split_mix((pixels * self._rows[:, None]).sum(axis=1)) @ self._columns)
        else:
            rows = self._rows[:, None] * self.mask.visible.numpy().astype(np.uint64)
            seen = split_mix(
                pixels.transpose(0, 2, 1) @ rows
            )  # (n, w, w) each column where each of the mask hides some of it
            column = np.arange(len(self._at))[:, None]
            hashes = split_mix((seen[:, column, self._at] * self._columns).sum(axis=1))
        return self._shares(hashes)

    def _score(self, views: Images) -> Scores:
        rows = self._rows[:, None] * (1 if self.mask is None else self.mask.visible.numpy().astype(np.uint64))
        seen = split_mix((as_numbers(views) * rows).sum(axis=1))  # (n, w)
        return self._shares(split_mix(seen @ self._columns[:, 0]))

    def _shares(self, hashes: UInt64[np.ndarray, "*shape"]) -> Float32[torch.Tensor, "*shape"]:
        """Hashes as numbers from 0 to 1."""
        return self._on_device(torch.from_numpy((hashes >> np.uint64(40)).astype(np.float32) * np.float32(2**-24)))


def as_numbers(views: Images) -> UInt64[np.ndarray, "n h w"]:
    """The bits of each pixel."""
    return (views.cpu().numpy() + np.float32(0)).view(np.uint32).astype(np.uint64)  # -0 becomes 0


def split_mix(numbers: UInt64[np.ndarray, "..."]) -> UInt64[np.ndarray, "..."]:
    """A bijection after which every bit depends on all: that of Steele, Lea and Flood's SplitMix (2014)."""
    numbers = numbers + np.uint64(0x9E3779B97F4A7C15)
    numbers = (numbers ^ numbers >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    numbers = (numbers ^ numbers >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return numbers ^ numbers >> np.uint64(31)
