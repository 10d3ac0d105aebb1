"""The engine behind every model: the responses of filters to all rotations of a view.

Rotation k of a view is what the eye sees after turning left by k columns: the view rolled right by k. The response of a filter F
with bias b to rotation k of a view V is a circular correlation,

    r[k] = b + sum over rows i, columns j of V[i, (j - k) mod w] F[i, j]

By the correlation theorem its Fourier transform along azimuth is, at each frequency, a product of the view's and the filter's,

    R = sum over rows i of conj(V[i]) F[i]

so all views meet all filters in one small product of matrices per frequency (`Spectra`, `products`). `FilterBank` is just this, and
`NearestFilters` finds the filter with the least response.

A mask stands still with the eye: it is part of the filters (see `FeatureMask`), and what it hides makes no difference.

A view gives the same bytes alone as among others, on the same machine with the same number of threads. With other threads responses
agree within 1e-6 sqrt(w) |V| |F| (rounding).
"""

import copy

import torch
from jaxtyping import Float, Float32, Float64

from ..feature_mask import FeatureMask
from .spectra import Nearest, Spectra


class FilterBank:
    """Filters, ready to meet any number of views.

    Args:
        filters: (m, h, w) float32; or float64, in which equal responses stay equal.
        biases: (m,) Added to the responses; None means none.
        mask: What the filters see of the views; None means everything.
    """

    def __init__(
        self,
        filters: Float[torch.Tensor, "m h w"],
        biases: Float32[torch.Tensor, " m"] | None = None,
        mask: FeatureMask | None = None,
    ):
        self._mask, self._width, self._biases, self._dtype = mask, filters.shape[2], biases, filters.dtype
        if mask is not None:
            filters = filters.double() * mask.visible.to(filters.device)
            self._sums = filters.sum(dim=(1, 2))
        self._training = filters if filters.requires_grad else None
        if self._training is None:
            self._spectra = Spectra(filters)

    def appended(self, filters: Float32[torch.Tensor, "m h w"]) -> "FilterBank":
        """These filters and then others, without biases; this object stays as it is."""
        combined = copy.copy(self)
        if self._mask is not None:
            filters = filters.double() * self._mask.visible.to(filters.device)
            combined._sums = torch.cat([self._sums, filters.sum(dim=(1, 2))])
        combined._spectra = self._spectra.appended(filters)
        return combined

    def responses(self, views: Float32[torch.Tensor, "n h w"]) -> Float32[torch.Tensor, "n w m"]:
        """Response of each filter to each rotation of each view."""
        responses = self._correlated(views.to(self._dtype)) if self._mask is None else self.exact(views)
        responses = responses.float()
        return responses if self._biases is None else responses + self._biases

    def exact(self, views: Float32[torch.Tensor, "n h w"]) -> Float64[torch.Tensor, "n w m"]:
        """Responses to what a mask shows, without biases. In float64: at some rotations only a small part of a view's contrast is seen."""
        assert self._mask is not None
        mean, factor = self._mask.statistics(views)
        return (self._correlated(views.double()) - mean[..., None] * self._sums) * factor[..., None]

    def _correlated(self, views: Float[torch.Tensor, "n h w"]) -> Float[torch.Tensor, "n w m"]:
        if self._training is not None:  # products that torch can differentiate
            spectra, filters = torch.fft.rfft(views).permute(2, 0, 1), torch.fft.rfft(self._training).permute(2, 1, 0)
            return torch.fft.irfft(torch.bmm(spectra.conj(), filters), n=self._width, dim=0).movedim(0, 1)
        responses = views.new_empty(len(views), self._width, len(self._spectra))
        for chunk in self._spectra.chunks(views):
            responses[chunk.views, :, chunk.filters] = chunk.responses()
        return responses


class NearestFilters:
    """Finds the filter with the least response to each rotation of a view.

    Args:
        filters: (m, h, w)
        biases: (m,) Added to the responses.
    """

    def __init__(self, filters: Float32[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"]):
        self._spectra, self._biases = Spectra(filters), biases

    def appended(
        self, filters: Float32[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"]
    ) -> "NearestFilters":
        """These filters and then others; this object stays as it is."""
        combined = copy.copy(self)
        combined._spectra, combined._biases = self._spectra.appended(filters), torch.cat([self._biases, biases])
        return combined

    def nearest(
        self,
        views: Float32[torch.Tensor, "n h w"],
        tolerance: Float32[torch.Tensor, " n"],
        among: slice = slice(None),
    ) -> Nearest:
        """The least response to each rotation of each view, and the filter that gives it.

        Args:
            views: (n, h, w)
            tolerance: (n,) By how much responses to a view differ that rounding might have put into another order.
            among: The filters to compare.

        Returns:
            Of responses that are equal but for rounding, any; then it is doubtful.
        """
        nearest = Nearest.nothing((len(views), views.shape[2]), views)
        for chunk in self._spectra.chunks(views, self._biases, among):
            for part in chunk.nearest(tolerance[chunk.views]):
                nearest[chunk.views].take(part, chunk.filters.start, tolerance[chunk.views])
        return nearest
