"""Filters by their Fourier transforms along azimuth, and products of these with the transforms of views.

A product of matrices by BLAS may depend, in its last bits, on how many rows there are: one view alone would be scanned to other bytes
than among others. So on a CPU the products are computed here: each is summed in the order of the rows of the view, whatever the other
views and filters are. This is as fast as BLAS for many views, and faster for few.
"""

import copy
from collections.abc import Iterator

import torch
from jaxtyping import Float

from tussock.render.compile import compiled

from ..threads import in_threads
from .growing import Growing
from .rotations import one_by_one

# Filters, and views, that are multiplied at once: what is computed on the way then stays in the processor's cache
# (measured on an AMD EPYC with 1 MB of it per core).
FILTERS, VIEWS = 1000, 16
COLUMNS = 16  # to a multiple of which those of a product are filled up: all views' begin at a multiple of 64 bytes
TERMS = 5  # of a sum that are added at once: numbers of rows are filled up to a multiple of it with 0
SMALL = 2**23  # multiplications; below it, one thread is the quickest


class Spectra:
    """Transforms of filters. Further ones can be added; this computes nothing of the others again.

    Args:
        filters: (m, h, w) The first ones, float32 or float64.
    """

    def __init__(self, filters: Float[torch.Tensor, "m h w"]):
        self.width, self.size, self._blocks = filters.shape[2], FILTERS, []
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
        for block in (filters[:space], *filters[space:].split(self.size)):
            if len(block) == 0:
                continue
            transformed = _columns(torch.fft.rfft(block))
            if space:
                self._blocks[-1] = self._blocks[-1].appended(transformed)
            else:
                self._blocks.append(Growing(transformed, dim=2))
            space = 0

    def products(
        self, views: Float[torch.Tensor, "n h w"], among: slice = slice(None)
    ) -> Iterator[tuple[int, slice, Float[torch.Tensor, "2 views f columns"]]]:
        """Products of views and filters at each frequency, summed over the rows: the transforms of the responses.

        Args:
            views: (n, h, w)
            among: The filters to multiply.

        Returns:
            Of some views and filters after the other: the index of the first view, which filters, and the real and the imaginary
            parts of their products (2, views, f, columns); columns after those of the filters are 0.
        """
        transformed = one_by_one(torch.fft.rfft, views)
        # For each view two rows: Im(conj(V) F) is Re(conj(iV) F).
        rows = _rows(torch.stack([transformed, 1j * transformed], dim=1).flatten(0, 1))
        rows = rows.unflatten(1, (len(views), 2))  # (f, n, 2, 2 h)
        start, stop, _ = among.indices(len(self))
        for first, block in zip(range(0, stop, self.size), self._blocks, strict=False):
            inside = max(start - first, 0), min(stop - first, len(block))
            if inside[0] < inside[1]:
                for view in range(0, len(views), VIEWS):
                    some = rows[:, view : view + VIEWS].contiguous()
                    yield view, slice(first + inside[0], first + inside[1]), _multiplied(some, block.storage, *inside)


def _rows(spectra: torch.Tensor) -> Float[torch.Tensor, "f n parts"]:
    """Real and imaginary parts of all rows of spectra (n, h, f), then as many 0 as make their number a multiple of TERMS."""
    parts = torch.view_as_real(spectra).permute(2, 0, 1, 3).flatten(2)
    return torch.nn.functional.pad(parts, (0, -parts.shape[2] % TERMS))


def _columns(spectra: torch.Tensor) -> Float[torch.Tensor, "f parts m"]:
    """The same for filters (m, h, f), each of which becomes a column. In two steps, as a plain transposition is much faster."""
    parts = torch.view_as_real(spectra)  # (m, h, f, 2)
    transposed = parts.flatten(1).T.contiguous().unflatten(0, parts.shape[1:]).transpose(0, 1)  # (f, h, 2, m)
    return torch.nn.functional.pad(transposed.flatten(1, 2), (0, 0, 0, -2 * parts.shape[1] % TERMS))


def _multiplied(rows: torch.Tensor, filters: torch.Tensor, first: int, last: int) -> torch.Tensor:
    """The product of matrices rows (f, n, 2, k) x filters (f, k, first to last) at each frequency, as (2, n, f, columns)."""
    frequencies, n = rows.shape[:2]
    if rows.device.type != "cpu":
        products = torch.bmm(rows.flatten(1, 2), filters[:, :, first:last])
        products = products.unflatten(1, (n, 2)).permute(2, 1, 0, 3)
        return torch.nn.functional.pad(products, (0, (first - last) % COLUMNS))
    products = torch.empty(2, n, frequencies, last - first + (first - last) % COLUMNS, dtype=rows.dtype)
    arrays = rows.numpy(), filters.numpy(), first, last, products.numpy()
    large = rows.numel() * (last - first) >= SMALL
    in_threads(lambda begin, end: _multiply(*arrays, begin, end), frequencies, torch.get_num_threads() if large else 1)
    return products


@compiled(fastmath={"contract"})
def _multiply(rows, filters, first, last, products, begin, end):
    """The same for frequencies `begin` to `end`. Loops are unrolled: a number, once loaded, is used for two rows and TERMS terms."""
    n, m = products.shape[1], last - first
    products[:, :, begin:end] = 0
    for f in range(begin, end):
        for k in range(0, rows.shape[3], TERMS):
            f0 = filters[f, k, first:last]
            f1 = filters[f, k + 1, first:last]
            f2 = filters[f, k + 2, first:last]
            f3 = filters[f, k + 3, first:last]
            f4 = filters[f, k + 4, first:last]
            for v in range(n):
                real, imaginary = products[0, v, f], products[1, v, f]
                a, b = rows[f, v, 0, k : k + TERMS], rows[f, v, 1, k : k + TERMS]
                a0, a1, a2, a3, a4 = a[0], a[1], a[2], a[3], a[4]
                b0, b1, b2, b3, b4 = b[0], b[1], b[2], b[3], b[4]
                for j in range(m):
                    real[j] = real[j] + a0 * f0[j] + a1 * f1[j] + a2 * f2[j] + a3 * f3[j] + a4 * f4[j]
                    imaginary[j] = imaginary[j] + b0 * f0[j] + b1 * f1[j] + b2 * f2[j] + b3 * f3[j] + b4 * f4[j]
