"""Filters by their Fourier transforms along azimuth, and what comes of their responses to all rotations of views."""

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int64

from ..threads import in_threads
from .growing import Tiles
from .products import FILTERS, TILE, absolute, nearest, respond

VIEWS = 16  # that are multiplied at once: what is computed on the way stays in the processor's cache (1 MB of an AMD EPYC's core)
SMALL = 2**23  # multiplications; below it, one thread is the quickest


class Spectra:
    """Transforms of filters. Further ones can be added; this computes nothing of the others again.

    Args:
        filters: (m, h, w) The first ones, float32 or float64.
    """

    def __init__(self, filters: Float[torch.Tensor, "m h w"]):
        self.width, self.size, self._blocks = filters.shape[2], FILTERS, []
        self._inverse = tuple(each.to(filters) for each in inverse_transform(self.width))
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

    def chunks(
        self,
        views: Float[torch.Tensor, "n h w"],
        biases: Float[torch.Tensor, " m"] | None = None,
        among: slice = slice(None),
    ) -> Iterator["Chunk"]:
        """Blocks of views and filters, one by one, to compute what is wanted of their responses.

        Args:
            views: (n, h, w)
            biases: (m,) Added to the responses; None means none.
            among: The filters that respond.
        """
        rows = [_rows(some) for some in views.split(VIEWS)]
        start, stop, _ = among.indices(len(self))
        for begin, block in zip(range(0, stop, self.size), self._blocks, strict=False):
            first, last = max(start - begin, 0), min(stop - begin, len(block))
            if first >= last:
                continue
            filters = slice(begin + first, begin + last)
            added = views.new_zeros(last - first) if biases is None else biases[filters]
            tiles = block.storage[first // TILE : -(-last // TILE)]
            view = 0
            for of_views in rows:
                some = slice(view, view + of_views.shape[1] // 2)
                yield Chunk(some, filters, of_views, self._inverse, tiles, added, first % TILE, self.width)
                view = some.stop


@dataclass(frozen=True)
class Nearest:
    """Of some filters, that with the least response to each rotation of some views.

    Attributes:
        least: The least response.
        index: The filter that gives it.
        doubtful: Whether another filter's response is the same, but for rounding.
    """

    least: Float[torch.Tensor, "n w"]
    index: Int64[torch.Tensor, "n w"]
    doubtful: Bool[torch.Tensor, "n w"]

    @classmethod
    def nothing(cls, shape: tuple[int, int], like: torch.Tensor) -> "Nearest":
        """Of no filters, with a shape (n, w), and the type and device of a tensor."""
        least = like.new_full(shape, torch.inf)
        return cls(least, torch.zeros_like(least, dtype=torch.int64), torch.zeros_like(least, dtype=torch.bool))

    @property
    def parts(self) -> tuple[torch.Tensor, ...]:
        """Least responses, filters and doubts."""
        return self.least, self.index, self.doubtful

    def __getitem__(self, views: slice) -> "Nearest":
        return Nearest(*(each[views] for each in self.parts))

    def take(self, other: "Nearest", first: int, tolerance: Float[torch.Tensor, " n"]) -> None:
        """Take other filters in, in place; their numbers begin at `first`."""
        less, close = other.least < self.least, (other.least - self.least).abs() <= tolerance[:, None]
        self.least[less], self.index[less] = other.least[less], first + other.index[less]
        self.doubtful[less] = other.doubtful[less]
        self.doubtful[close] = True


@dataclass(frozen=True)
class Chunk:
    """Some views and filters whose products are computed at once.

    Attributes:
        views: Which views.
        filters: Which filters.
        rows: (f, 2 n, k) Of each view what gives the real parts of its products, then what gives the imaginary parts.
        inverse: As `inverse_transform`.
        tiles: Transforms of the filters, as `Tiles`.
        biases: (m,) Added to the responses.
        first: Where the first of the filters is in the tiles.
        width: Number of rotations.
    """

    views: slice
    filters: slice
    rows: torch.Tensor
    inverse: tuple[torch.Tensor, ...]
    tiles: torch.Tensor
    biases: torch.Tensor
    first: int
    width: int

    def responses(self) -> Float[torch.Tensor, "n w m"]:
        """Responses of the filters to all rotations of the views."""
        if not self._compiled:
            return self.by_torch()
        responses = self.rows.new_empty(*self._shape, len(self.biases))
        self._in_threads(lambda *arguments: respond(*arguments, responses.numpy()))
        return responses

    def nearest(self, tolerance: Float[torch.Tensor, " n"]) -> Iterator["Nearest"]:
        """The filters with the least response to each rotation of the views, in one part or several; their numbers begin at 0.

        Args:
            tolerance: (n,) By how much responses differ that rounding might have put into another order.
        """
        if not self._compiled:
            responses = self.by_torch()
            least, index = responses.min(dim=2)
            close = responses <= (least + tolerance[:, None])[..., None]
            yield Nearest(least, index, close.sum(dim=2) > 1)
            return
        by_tile = {}

        def work(*arguments) -> None:
            *_, begin, _ = arguments
            by_tile[begin] = Nearest.nothing(self._shape, self.rows)
            nearest(*arguments, tolerance.numpy(), *(each.numpy() for each in by_tile[begin].parts))

        self._in_threads(work)
        yield from (each for _, each in sorted(by_tile.items(), key=lambda item: item[0]))

    def absolute(self) -> Float[torch.Tensor, "n w"]:
        """Sum of the absolute responses of the filters to each rotation of the views."""
        if not self._compiled:
            return self.by_torch().abs_().sum(dim=2)
        sums = self.rows.new_empty(len(self.tiles), *self._shape)
        self._in_threads(lambda *arguments: absolute(*arguments, sums.numpy()))
        return sum(sums[1:], start=sums[0])

    def by_torch(self) -> Float[torch.Tensor, "n w m"]:
        """`responses` on any device. Sums may be rounded differently in another batch."""
        products = torch.bmm(self.rows, self.tiles.permute(1, 3, 0, 2, 4).flatten(2))  # (f, 2 n, columns)
        products = products[..., self.first : self.first + len(self.biases)].unflatten(1, (-1, 2))
        spectra = torch.complex(*products.unbind(dim=2))  # (f, n, m)
        return torch.fft.irfft(spectra, n=self.width, dim=0).movedim(0, 1) + self.biases

    @property
    def _compiled(self) -> bool:
        return self.rows.device.type == "cpu"

    @property
    def _shape(self) -> tuple[int, int]:
        return self.rows.shape[1] // 2, self.width

    def _in_threads(self, work: Callable[..., None]) -> None:
        """Call `work` with the arguments of a compiled function of products.py up to `end`, for the tiles of each thread."""
        inverse = tuple(each.numpy() for each in self.inverse)
        arrays = self.rows.numpy(), inverse, self.tiles.numpy(), self.biases.numpy()
        large = self.rows.numel() * len(self.tiles) * TILE >= SMALL
        count = min(torch.get_num_threads(), len(self.tiles)) if large else 1
        in_threads(lambda begin, end: work(*arrays, self.first, begin, end), len(self.tiles), count)


def _rows(views: Float[torch.Tensor, "n h w"]) -> Float[torch.Tensor, "f rows parts"]:
    """For each view two rows: conj(V) F has the real part Re V Re F + Im V Im F, and the imaginary part Re V Im F - Im V Re F."""
    on_cpu = views.device.type == "cpu"
    # By numpy, which transforms each row by itself, and so to the same bytes in every batch.
    transformed = torch.from_numpy(np.fft.rfft(views.numpy())) if on_cpu else torch.fft.rfft(views)
    rows = torch.stack([transformed, 1j * transformed], dim=1)  # (n, 2, h, f)
    return torch.view_as_real(rows.permute(3, 0, 1, 2).contiguous()).flatten(3).flatten(1, 2)


def inverse_transform(width: int) -> tuple[Float64[torch.Tensor, "2 i even"], Float64[torch.Tensor, "2 i odd"]]:
    """What makes responses of the real parts of products, and of the imaginary parts, at rotations 0, 1, ..

    The first is for frequencies of even numbers, and the second for those of odd numbers. They are for rotations 0 to w // 4: by their
    sum and their difference the others are known. Where w is odd, the first is for all frequencies and rotations 0 to w // 2, and the
    second for none. Rows are filled up with 0 to an even number.
    """
    count = width // 2 + 1
    identity = torch.eye(count, dtype=torch.float64)
    whole = torch.stack([torch.fft.irfft(parts, n=width, dim=0) for parts in (identity, 1j * identity)])
    of_even, of_odd = (whole[..., ::2], whole[..., 1::2]) if width % 2 == 0 else (whole, whole[..., :0])
    rotations = width // 4 + 1 if width % 2 == 0 else count
    padding = (0, 0, 0, rotations % 2)
    even, odd = (torch.nn.functional.pad(each[:, :rotations], padding).contiguous() for each in (of_even, of_odd))
    return even, odd
