"""The engine behind every model: the responses of filters to all rotations of a view.

Rotation k of a view is what the eye sees after turning left by k columns: the view rolled right by k. The response of a filter F
with bias b to rotation k of a view V is a circular correlation,

    r[k] = b + sum over rows i, columns j of V[i, (j - k) mod w] F[i, j]

By the correlation theorem its Fourier transform along azimuth is, at each frequency, a product of the view's and the filter's,

    R = sum over rows i of conj(V[i]) F[i]

so all views meet all filters in one small product of matrices per frequency. `FilterBank` is just this. `NearestFilters` finds the
filter with the least response, faster where filters or views are many.

A mask stands still with the eye: it is part of the filters (see `FeatureMask`), and what it hides makes no difference.

The same views give the same bytes on the same machine with the same number of threads. With other threads, or in other batches,
responses agree within 1e-6 sqrt(w) |V| |F| (rounding).
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float, Float32, Float64, Int64

from ..feature_mask import FeatureMask

# Filters, and views, that `NearestFilters` takes at once: what is computed on the way then stays in the processor's cache
# (measured on an AMD EPYC with 1 MB of it per core).
FILTERS, VIEWS = 1000, 8


class FilterBank:
    """Filters, ready to meet any number of views.

    Args:
        filters: (m, h, w)
        biases: (m,) Added to the responses; None means none.
        mask: What the filters see of the views; None means everything.
    """

    def __init__(
        self,
        filters: Float32[torch.Tensor, "m h w"],
        biases: Float32[torch.Tensor, " m"] | None = None,
        mask: FeatureMask | None = None,
    ):
        self._mask, self._width, self._biases = mask, filters.shape[2], biases
        if mask is not None:
            filters = filters.double() * mask.visible.to(filters.device)
            self._sums = filters.sum(dim=(1, 2))
        self._spectra = torch.fft.rfft(filters).permute(2, 1, 0).contiguous()  # (f, h, m)

    def responses(self, views: Float32[torch.Tensor, "n h w"]) -> Float32[torch.Tensor, "n w m"]:
        """Response of each filter to each rotation of each view."""
        responses = self._correlated(views) if self._mask is None else self.exact(views).float()
        return responses if self._biases is None else responses + self._biases

    def exact(self, views: Float32[torch.Tensor, "n h w"]) -> Float64[torch.Tensor, "n w m"]:
        """Responses to what a mask shows, without biases. In float64: at some rotations only a small part of a view's contrast is seen."""
        assert self._mask is not None
        mean, factor = self._mask.statistics(views)
        return (self._correlated(views.double()) - mean[..., None] * self._sums) * factor[..., None]

    def _correlated(self, views: Float[torch.Tensor, "n h w"]) -> Float[torch.Tensor, "n w m"]:
        spectra = torch.fft.rfft(views).permute(2, 0, 1)  # (f, n, h)
        products = torch.bmm(spectra.conj(), self._spectra)  # (f, n, m)
        return torch.fft.irfft(products, n=self._width, dim=0).movedim(0, 1)


class NearestFilters:
    """Finds the filter with the least response to each rotation of a view.

    The responses are those of a `FilterBank`. For batches it takes half the time: products are real, and a response is split into
    what is even in the rotation (the inverse transform of the real parts of R) and what is odd (that of the imaginary parts). As
    r[k] = even[k] + odd[k] and r[-k] = even[k] - odd[k], half of the rotations need an inverse transform, as a product of matrices.

    Args:
        filters: (m, h, w)
        biases: (m,) Added to the responses.
    """

    def __init__(self, filters: Float32[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"]):
        self._width = width = filters.shape[2]
        count = width // 2 + 1
        identity = torch.eye(count, dtype=torch.float64, device=filters.device)
        self._even = torch.fft.irfft(identity, n=width, dim=0)[:count].float()
        self._odd = torch.fft.irfft(1j * identity, n=width, dim=0)[:count].float()
        self._left = torch.arange(count, device=filters.device)  # rotations 0, 1, .. w // 2
        self._right = -self._left % width  # and the same to the right
        # Blocks of (f, 2 h, m).
        self._filters = [_parts(torch.fft.rfft(block)).mT.contiguous() for block in filters.split(FILTERS)]
        self._biases = biases.split(FILTERS)

    def nearest(
        self, views: Float32[torch.Tensor, "n h w"], among: slice = slice(None)
    ) -> tuple[Float32[torch.Tensor, "n w"], Int64[torch.Tensor, "n w"]]:
        """The least response to each rotation of each view, and the filter that gives it.

        Args:
            views: (n, h, w)
            among: The filters to compare.

        Returns:
            The responses, and the indices of the filters; of responses that are equal but for rounding, any.
        """
        n = len(views)
        spectra = torch.fft.rfft(views)
        rows = _parts(torch.cat([spectra, 1j * spectra]))  # Im(conj(V) F) is Re(conj(iV) F)
        least = views.new_full((n, self._width), torch.inf)
        index = torch.zeros(n, self._width, dtype=torch.int64, device=views.device)
        for first, filters, biases in self._blocks(among):
            products = torch.bmm(rows, filters).unflatten(1, (2, n))  # (f, 2, n, m)
            products[0, 0] += self._width * biases  # frequency 0 adds to all rotations alike
            for start in range(0, n, VIEWS):
                some = slice(start, start + VIEWS)
                self._update(products[:, :, some], first, least[some], index[some])
        return least, index

    def _update(self, products: torch.Tensor, first: int, least: torch.Tensor, index: torch.Tensor) -> None:
        """Enter the least of these responses, and their filters, where they are less than what was found before."""
        even, odd = (
            (inverse @ part.flatten(1)).unflatten(1, part.shape[1:])
            for inverse, part in zip((self._even, self._odd), products.unbind(1), strict=True)
        )
        for rotations, responses in ((self._left, even + odd), (self._right, even - odd)):
            values, which = _least(responses)
            less = values < least[:, rotations]
            least[:, rotations] = values.where(less, least[:, rotations])
            index[:, rotations] = (first + which).where(less, index[:, rotations])

    def _blocks(self, among: slice) -> Iterator[tuple[int, torch.Tensor, torch.Tensor]]:
        """Index of the first filter, filters (f, 2 h, m) and biases (m,) of each block, as far as they are `among` those to compare."""
        start, stop, _ = among.indices(sum(map(len, self._biases)))
        for first, filters, biases in zip(range(0, stop, FILTERS), self._filters, self._biases, strict=False):
            inside = slice(max(start - first, 0), stop - first)
            if inside.start < len(biases):
                yield first + inside.start, filters[:, :, inside], biases[inside]


def _parts(spectra: torch.Tensor) -> Float32[torch.Tensor, "f n parts"]:
    """Real parts of all rows, then imaginary parts of all rows, of spectra (n, h, f)."""
    return torch.view_as_real(spectra).permute(2, 0, 3, 1).flatten(2)


def _least(responses: Float32[torch.Tensor, "half n m"]) -> tuple[torch.Tensor, torch.Tensor]:
    """Least response over the filters (n, half), and its index. On a CPU by numpy, whose argmin is faster than torch's."""
    on_cpu = responses.device.type == "cpu"
    index = torch.from_numpy(responses.numpy().argmin(axis=-1)) if on_cpu else responses.argmin(dim=-1)
    return responses.gather(-1, index[..., None])[..., 0].T, index.T
