"""The one engine behind every model: all rotations of views against filters, and the heading found from them.

Rotation k of a view is what the eye sees after turning left by k columns: the view rolled right by k. The response of a
filter F with bias b to rotation k of a view V is a circular correlation,

    r[k] = b + sum over rows i, columns j of V[i, (j - k) mod w] F[i, j]

By the correlation theorem its Fourier transform along azimuth is `sum over rows of conj(fft(V)) fft(F)`: an rFFT of each image, one
small matrix product a frequency, and the way back give all w rotations of all views against all filters. Written in real
numbers, all of it but the rFFT is products of matrices.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from world.errors import InputError
from world.geometry import turn_of_columns, wrap_angle

CHUNK_BYTES = 16 * 2**20  # bound on the responses held at once; more is slower, as memory then is fresh each time
WIDE = 360  # columns from which on an inverse FFT beats a product with the matrix of the transform


class FilterBank:
    """Filters (m, h, w) kept as their spectra, ready to meet any number of views.

    shape: (h, w) of the filters, and of every view. biases: added to the responses; None is none.
    """

    def __init__(self, filters: Float32[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"] | None = None):
        self.shape = tuple(filters.shape[1:])
        spectra = torch.view_as_real(torch.fft.rfft(filters))  # (m, h, f, 2)
        self.spectra: Float32[torch.Tensor, "f parts m"] = spectra.permute(2, 1, 3, 0).flatten(1, 2).contiguous()
        # The imaginary part of frequency 0 is nothing. The first row's takes the biases; see `chunks`.
        if biases is not None:
            self.spectra[0, 1] = biases
        self._inverse = inverse_transform(self.shape[1]).to(filters.device) if self.shape[1] < WIDE else None

    def __len__(self) -> int:
        return self.spectra.shape[2]

    def chunks(
        self, views: Float32[torch.Tensor, "n h w"], among: slice | None = None
    ) -> Iterator[tuple[slice, Float32[torch.Tensor, "n w m"]]]:
        """Responses of views to consecutive slices of the filters (those `among`): as many at once as CHUNK_BYTES hold, or one."""
        n, height, width = views.shape
        frequencies = width // 2 + 1
        spectra = torch.fft.rfft(views)
        # For each view two rows: one makes the real part of conj(V) F, the other the imaginary part.
        rows = torch.view_as_real(torch.stack([spectra, 1j * spectra]))  # (2, n, h, f, 2)
        rows = rows.permute(3, 0, 1, 2, 4).reshape(frequencies, 2 * n, 2 * height)
        rows[0, :n, 1] = width  # adds the biases to frequency 0, and so to all rotations
        at_once = max(1, CHUNK_BYTES // (8 * width * max(1, n)))
        first, last, _ = (among or slice(None)).indices(len(self))
        for start in range(first, last, at_once):
            part = slice(start, min(start + at_once, last))
            m = part.stop - start
            transformed = torch.bmm(rows, self.spectra[:, :, part]).reshape(2 * frequencies, n * m)
            if self._inverse is None:
                halves = transformed.reshape(frequencies, 2, n, m)
                imaginary = torch.cat([torch.zeros_like(halves[:1, 1]), halves[1:, 1]])
                responses = torch.fft.irfft(torch.complex(halves[:, 0], imaginary), n=width, dim=0)
            else:
                responses = product(self._inverse, transformed).reshape(width, n, m)
            yield part, responses.movedim(0, 1)

    def responses(self, views: Float32[torch.Tensor, "n h w"]) -> Float32[torch.Tensor, "n w m"]:
        """Responses (view, rotation, filter) all at once."""
        n, m = len(views), len(self)
        if n == 0 or m == 0:
            return torch.empty(n, self.shape[1], m, device=self.spectra.device)
        found = [response for _, response in self.chunks(views)]
        return found[0] if len(found) == 1 else torch.cat(found, dim=2)


@lru_cache(maxsize=16)
def inverse_transform(width: int) -> Float32[torch.Tensor, "{width} parts"]:
    """The matrix of the inverse rFFT: from the real and the imaginary part of each frequency to `width` values."""
    frequency = torch.arange(width // 2 + 1, dtype=torch.float64)
    weight = torch.where((frequency == 0) | (2 * frequency == width), 1.0, 2.0) / width
    phase = torch.outer(torch.arange(width, dtype=torch.float64), frequency) * (2 * math.pi / width)
    return torch.stack([phase.cos() * weight, -phase.sin() * weight], dim=2).reshape(width, -1).float()


class _Product(torch.autograd.Function):
    """a @ b by oneDNN, which on some processors is thrice as fast as what torch takes by itself; a is a constant."""

    @staticmethod
    def forward(ctx, a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(a)
        return torch.ops.mkldnn._linear_pointwise(a, b.T, None, "none", [], "")

    @staticmethod
    def backward(ctx, gradient: torch.Tensor) -> tuple[None, torch.Tensor]:
        (a,) = ctx.saved_tensors
        return None, torch.ops.mkldnn._linear_pointwise(a.T, gradient.T, None, "none", [], "")


def product(a: Float32[torch.Tensor, "i k"], b: Float32[torch.Tensor, "k j"]) -> Float32[torch.Tensor, "i j"]:
    """a @ b, where a is a constant."""
    fast = a.device.type == "cpu" and torch.backends.mkldnn.is_available()
    return _Product.apply(a, b) if fast else a @ b


def bell(width: int, deviation: float) -> Float32[torch.Tensor, " {width}"]:
    """A Gaussian over the rotations about rotation 0, of sum 1; deviation: its standard deviation (rad), over 0."""
    turns = torch.as_tensor(turn_of_columns(np.arange(width), width), dtype=torch.float32)
    return torch.softmax(-0.5 * (turns / deviation) ** 2, dim=0)


def smoothed(scans: Float32[torch.Tensor, "n w"], deviation: float) -> Float32[torch.Tensor, "n w"]:
    """Each rotation averaged with its neighbours, by a Gaussian with a standard deviation of `deviation` (rad); 0 is as it is."""
    if deviation == 0:
        return scans
    weights = bell(scans.shape[1], deviation).to(scans.device)
    return torch.fft.irfft(torch.fft.rfft(scans) * torch.fft.rfft(weights), n=scans.shape[1])


def scan_window(width: int, angle: float, centre: float = 0.0) -> Bool[np.ndarray, " width"]:
    """Which rotations a scan of `angle` (rad, full width) about `centre` (rad to the left of the present heading) looks at."""
    if not 0 < angle <= 2 * np.pi + 1e-9:
        raise InputError(f"a scan of {np.degrees(angle):g} degrees; give over 0 and up to 360")
    away = np.abs(wrap_angle(turn_of_columns(np.arange(width), width) - centre))
    allowed = away <= angle / 2 + 1e-9
    allowed[away.argmin()] = True  # a window narrower than a column still looks somewhere
    return allowed


def best_turn(
    familiarity: Float[np.ndarray, "n w"], window: Bool[np.ndarray, "... w"] | None = None, interpolate: bool = True
) -> Float[np.ndarray, " n"]:
    """The turn (rad, left positive) to the most familiar rotation of each scan; the first of equal ones.

    window: rotations to choose from (see `scan_window`), the same for all scans or one row each; None is all of them.
    With `interpolate`, the peak of the parabola through the best rotation and its neighbours, which is finer than a column.
    """
    n, width = familiarity.shape
    if n == 0:
        return np.empty(0)
    within = familiarity if window is None else np.where(window, familiarity, -np.inf)
    best = within.argmax(axis=1)
    columns = best.astype(float)
    if interpolate:
        rows = np.arange(n)
        left, peak, right = (familiarity[rows, (best + step) % width].astype(float) for step in (-1, 0, 1))
        bend = left - 2 * peak + right
        local_peak = (left <= peak) & (right <= peak) & (bend < 0)
        columns += np.where(local_peak, 0.5 * (left - right) / np.where(local_peak, bend, 1.0), 0.0)
    return turn_of_columns(columns, width)
