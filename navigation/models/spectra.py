"""Filters by their Fourier transforms along azimuth, and their responses to all rotations of views."""

import copy
from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Float, Float64

from ..threads import in_threads
from .growing import Tiles
from .products import TILE, respond

# Filters, and views, that are multiplied at once: what is computed on the way then stays in the processor's cache
# (measured on an AMD EPYC with 1 MB of it per core).
FILTERS, VIEWS = 1024, 16
SMALL = 2**23  # multiplications; below it, one thread is the quickest


class Spectra:
    """Transforms of filters. Further ones can be added; this computes nothing of the others again.

    A response is split into what is even in the rotation (the inverse transform of the real parts of the products) and what is odd
    (that of the imaginary parts). As r[k] = even[k] + odd[k] and r[-k] = even[k] - odd[k], half of the rotations need an inverse
    transform, as a product of matrices.

    Args:
        filters: (m, h, w) The first ones, float32 or float64.
    """

    def __init__(self, filters: Float[torch.Tensor, "m h w"]):
        self.width, self.size, self._blocks = filters.shape[2], FILTERS, []
        self._even, self._odd = (each.to(filters) for each in _inverse(self.width))
        self._add(filters)

    def __len__(self) -> int:
        return sum(len(block) for block in self._blocks)

    def appended(self, filters: Float[torch.Tensor, "m h w"]) -> "Spectra":
        """These filters and then others; this object stays as it is."""
        combined = copy.copy(self)
        combined._blocks = list(self._blocks)
        combined._add(filters)
        return combined

    def _add(self, filters: Float[torch.Tensor, "m h w"]) -> None:
        space = self.size - len(self._blocks[-1]) if self._blocks else 0
        if space and len(filters):
            self._blocks[-1] = self._blocks[-1].appended(torch.fft.rfft(filters[:space]))
        self._blocks += [Tiles(torch.fft.rfft(some)) for some in filters[space:].split(self.size) if len(some)]

    def responses(
        self,
        views: Float[torch.Tensor, "n h w"],
        biases: Float[torch.Tensor, " m"] | None = None,
        among: slice = slice(None),
    ) -> Iterator[tuple[slice, slice, Float[torch.Tensor, "views w filters"]]]:
        """Which views, which filters, and the responses of these filters to all rotations of these views; some after the other.

        What is yielded may be changed by the caller, and is overwritten when the next is asked for.

        Args:
            views: (n, h, w)
            biases: (m,) Added to the responses; None means none.
            among: The filters to compare with.
        """
        rows = _rows(views)
        start, stop, _ = among.indices(len(self))
        some = min(len(views), VIEWS), self.width, min(stop - start, self.size)
        storage = views.new_empty(some).flatten()
        for begin, block in zip(range(0, stop, self.size), self._blocks, strict=False):
            first, last = max(start - begin, 0), min(stop - begin, len(block))
            if first >= last:
                continue
            filters = slice(begin + first, begin + last)
            bias = views.new_zeros(last - first) if biases is None else biases[filters]
            for view in range(0, len(views), VIEWS):
                of_views = rows[:, 2 * view : 2 * (view + VIEWS)].contiguous()
                shape = of_views.shape[1] // 2, self.width, last - first
                responses = storage[: shape[0] * shape[1] * shape[2]].view(shape)
                self._respond(of_views, block.storage, bias, first, responses)
                yield slice(view, view + len(responses)), filters, responses

    def _respond(
        self, rows: torch.Tensor, tiles: torch.Tensor, biases: torch.Tensor, first: int, responses: torch.Tensor
    ) -> None:
        """Store the responses (n, w, m) of filters of a block, from the `first` one on."""
        if rows.device.type != "cpu":
            return respond_on_device(rows, tiles, biases, self._even, self._odd, first, responses)
        arrays = [each.numpy() for each in (rows, tiles, biases, self._even, self._odd)]
        begin, end = first // TILE, -(-(first + responses.shape[2]) // TILE)
        large = rows.numel() * TILE * (end - begin) >= SMALL
        return in_threads(
            lambda low, high: respond(*arrays, first, responses.numpy(), begin + low, begin + high),
            end - begin,
            torch.get_num_threads() if large else 1,
        )


def _inverse(width: int) -> tuple[Float64[torch.Tensor, "i f"], Float64[torch.Tensor, "i f"]]:
    """What makes responses at rotations 0 to w // 2 of real parts, and of imaginary parts; with an even number of rows for `respond`."""
    count = width // 2 + 1
    identity = torch.eye(count, dtype=torch.float64)
    halves = (torch.fft.irfft(parts, n=width, dim=0)[:count] for parts in (identity, 1j * identity))
    even, odd = (torch.nn.functional.pad(half, (0, 0, 0, count % 2)).contiguous() for half in halves)
    return even, odd


def respond_on_device(
    rows: torch.Tensor, tiles: torch.Tensor, biases: torch.Tensor, even: torch.Tensor, odd: torch.Tensor,
    first: int, responses: torch.Tensor,
) -> None:
    """`respond` for all tiles by torch, whose sums may be rounded differently in another batch."""
    n, width, m = responses.shape
    needed = tiles[first // TILE : -(-(first + m) // TILE)]
    products = torch.matmul(rows, needed).movedim(0, 2).flatten(2)[..., first % TILE :][..., :m]  # (f, 2 n, m)
    products = products.unflatten(1, (n, 2)).permute(2, 1, 0, 3)  # (2, n, f, m)
    count = width // 2 + 1
    middle, b = torch.matmul(even[:count], products[0]) + biases, torch.matmul(odd[:count], products[1])
    responses[:, :count] = middle + b
    responses[:, count:] = (middle - b)[:, 1 : (width + 1) // 2].flip(1)


def _rows(views: Float[torch.Tensor, "n h w"]) -> Float[torch.Tensor, "f rows parts"]:
    """For each view two rows: conj(V) F has the real part Re V Re F + Im V Im F, and the imaginary part Re V Im F - Im V Re F."""
    if views.device.type == "cpu":  # by numpy, which transforms each row by itself, and so to the same bytes in every batch
        transformed = torch.from_numpy(np.fft.rfft(views.numpy()))
    else:
        transformed = torch.fft.rfft(views)
    n, h, f = transformed.shape
    rows = views.new_empty(f, n, 2, h, 2)
    rows[:, :, 0] = torch.view_as_real(transformed).permute(2, 0, 1, 3)
    rows[:, :, 1, :, 0] = -rows[:, :, 0, :, 1]
    rows[:, :, 1, :, 1] = rows[:, :, 0, :, 0]
    return rows.flatten(3).flatten(1, 2)

