"""The one engine behind every model: all rotations of views against filters, and the heading found from them.

Rotation k of a view is what the eye sees after turning left by k columns: the view rolled right by k. The response of a
filter F to rotation k of a view V is the circular correlation

    r[k] = sum over rows i, columns j of V[i, (j - k) mod w] F[i, j]

and by the correlation theorem its Fourier transform along azimuth is `sum over rows of conj(fft(V)) fft(F)`: one rFFT of each
image, one small matrix product a frequency, one inverse rFFT give all w rotations of all views against all filters.
"""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Float32

from world.errors import InputError
from world.geometry import turn_of_columns, wrap_angle

CHUNK_BYTES = 16 * 2**20  # bound on the responses held at once; more is slower, as memory then is fresh each time


class FilterBank:
    """Filters (m, h, w) kept as their spectra, ready to meet any number of views.

    shape: (h, w) of the filters, and of every view.
    """

    def __init__(self, filters: Float32[torch.Tensor, "m h w"]):
        self.shape = tuple(filters.shape[1:])
        self.spectra: Complex64[torch.Tensor, "f h m"] = torch.fft.rfft(filters).permute(2, 1, 0).contiguous()

    def __len__(self) -> int:
        return self.spectra.shape[2]

    def chunks(
        self, views: Float32[torch.Tensor, "n h w"], among: slice | None = None
    ) -> Iterator[tuple[slice, Float32[torch.Tensor, "n m w"]]]:
        """Responses of views to consecutive slices of the filters (those `among`), no more than CHUNK_BYTES of them at once."""
        width = self.shape[1]
        conjugates = torch.fft.rfft(views).conj().permute(2, 0, 1).resolve_conj()  # (f, n, h)
        at_once = max(1, CHUNK_BYTES // (8 * width * max(1, len(views))))
        first, last, _ = (among or slice(None)).indices(len(self))
        for start in range(first, last, at_once):
            part = slice(start, min(start + at_once, last))
            product = torch.bmm(conjugates, self.spectra[:, :, part])  # (f, n, m)
            yield part, torch.fft.irfft(product.permute(1, 2, 0), n=width)

    def responses(self, views: Float32[torch.Tensor, "n h w"]) -> Float32[torch.Tensor, "n m w"]:
        """Responses (view, filter, rotation) all at once."""
        n, m = len(views), len(self)
        if n == 0 or m == 0:
            return torch.empty(n, m, self.shape[1], device=self.spectra.device)
        return torch.cat([response for _, response in self.chunks(views)], dim=1)


def rotations(view: Float32[torch.Tensor, "h w"], turns: torch.Tensor) -> Float32[torch.Tensor, "k h w"]:
    """The view at rotations `turns` (columns to the left), one image each."""
    width = view.shape[-1]
    columns = (torch.arange(width, device=view.device) - turns[:, None]) % width  # (k, w)
    return view[:, columns].movedim(0, 1)


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
