"""The one engine behind every model: all rotations of views against filters, and the heading found from them.

Rotation k of a view is what the eye sees after turning left by k columns: the view rolled right by k. The response of a
filter F with bias b to rotation k of a view V is a circular correlation,

    r[k] = b + sum over rows i, columns j of V[i, (j - k) mod w] F[i, j]

By the correlation theorem its Fourier transform along azimuth is `R = sum over rows of conj(fft(V)) fft(F)`: for each frequency
one small product of matrices, of all views and all filters. Back from there the real part of R makes what of r is even in k, the
imaginary part what is odd, which takes half the work: r[k] = even[k] + odd[k] and r[-k] = even[k] - odd[k].

All of it, the transforms too, is products of real matrices, in shapes whose results were found to be the same on any number of
threads, which those of FFTs are not. Tests compare the bytes.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float32, Shaped
from torch.nn.functional import pad

from tussock.world.geometry import turn_of_columns

BLOCK = (
    1040  # filters that meet views at once, at most: smaller blocks have more to begin, larger ones hold more memory
)
ROTATIONS = 6144  # of views that meet filters at once; what is held on the way is then 100 MB or so

# Much memory, when freed, goes back to the system at once, and comes anew page by page, which can take longer than the products
# that it holds. Freeing this much once makes glibc keep up to 62 MB of freed memory, in this process, for the next time.
torch.empty(31 * 2**20, dtype=torch.uint8)


class FilterBank:
    """Filters (m, h, w) kept as their spectra, ready to meet any number of views.

    shape: (h, w) of the filters, and of every view. biases: added to the responses; None is none.
    """

    def __init__(self, filters: Float32[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"] | None = None):
        self.shape = tuple(filters.shape[1:])
        self._transform, self._cosines, self._sines = (each.to(filters.device) for each in transforms(self.shape[1]))
        if biases is None:
            biases = filters.new_zeros(len(filters))
        parts = filters.tensor_split(math.ceil(len(filters) / BLOCK)) if len(filters) else []
        self._sizes = [len(part) for part in parts]
        self._blocks = [self._block(*each) for each in zip(parts, biases.split(self._sizes), strict=True)]

    def _block(
        self, filters: Float32[torch.Tensor, "m h w"], biases: Float32[torch.Tensor, " m"]
    ) -> Float32[torch.Tensor, "f terms padded"]:
        """Spectra of some filters: for each frequency the real part of every row, the imaginary part, and at frequency 0 the bias.

        Zero filters fill it up to an odd multiple of 16: with what is no multiple, oneDNN's results depend on the number of
        threads, and near powers of two caches collide.
        """
        m, height, _ = filters.shape
        padding = (16 - m) % 32
        by_rows = pad(filters.transpose(0, 1), (0, 0, 0, padding))
        spectra = self._spectra(by_rows.flatten(0, 1)).unflatten(2, (height, m + padding))
        bias = pad(biases[None, None], (0, padding, 0, 0, 0, spectra.shape[1] - 1))
        return torch.cat([*spectra, bias], dim=1)

    def __len__(self) -> int:
        return sum(self._sizes)

    def halves(
        self, views: Float32[torch.Tensor, "n h w"], among: slice | None = None
    ) -> Iterator[tuple[slice, Float32[torch.Tensor, "half n padded"], Float32[torch.Tensor, "half n padded"]]]:
        """Consecutive slices of the filters (those `among`) with the even and the odd half of their responses to views, for
        k = 0 .. w // 2: a view's response is even[k] + odd[k] at rotation k, and even[k] - odd[k] at rotation -k.
        The last dimension may be longer than the slice: what follows are zeros. No gradient reaches the views.
        """
        rows = self._rows(views).detach()
        first, last, _ = (among or slice(None)).indices(len(self))
        end = 0
        for block, size in zip(self._blocks, self._sizes, strict=True):
            start, end = end, end + size
            part = slice(max(first, start), min(last, end))
            if part.start >= part.stop:
                continue
            if part.stop - part.start < size:
                block = block[:, :, part.start - start : part.stop - start]
            real, imaginary = products(rows, block).unflatten(1, (2, len(views))).unbind(1)
            even = product(self._cosines, real.flatten(1)).unflatten(1, real.shape[1:])
            odd = product(self._sines, imaginary.flatten(1)).unflatten(1, real.shape[1:])
            yield part, even, odd

    def _rows(self, views: Float32[torch.Tensor, "n h w"]) -> Float32[torch.Tensor, "f n2 terms"]:
        """What each frequency of a block is multiplied by: for the real parts of all views' responses, then for the imaginary parts."""
        n, height, width = views.shape
        real, imaginary = self._spectra(views.flatten(0, 1)).unflatten(2, (n, height))
        rows = real.new_zeros(len(real), 2, n, 2 * height + 1)
        rows[:, 0, :, :height], rows[:, 0, :, height:-1] = real, imaginary
        rows[:, 1, :, :height], rows[:, 1, :, height:-1] = -imaginary, real
        rows[0, 0, :, -1] = width  # the bias adds to all rotations
        return rows.flatten(1, 2)

    def _spectra(self, rows: Float32[torch.Tensor, "n w"]) -> Float32[torch.Tensor, "2 f n"]:
        """Real and imaginary parts of the rows' Fourier transforms; of a constant row exactly 0 but for frequency 0."""
        level = rows[:, :1]
        spectra = product(self._transform, (rows - level).T).unflatten(0, (2, -1))
        spectra[0, 0] += rows.shape[1] * level[:, 0]
        return spectra

    def chunks(self, views: Float32[torch.Tensor, "n h w"]) -> Iterator[Float32[torch.Tensor, "n w m"]]:
        """Responses (view, rotation, filter) to one block of the filters after the other."""
        for part, even, odd in self.halves(views):
            both = all_rotations(even + odd, even - odd, self.shape[1])
            yield both[..., : part.stop - part.start].movedim(0, 1)

    def responses(self, views: Float32[torch.Tensor, "n h w"]) -> Float32[torch.Tensor, "n w m"]:
        """Responses (view, rotation, filter) all at once."""
        found = list(self.chunks(views))
        if len(found) == 1:
            return found[0]
        return torch.cat([views.new_empty(len(views), self.shape[1], 0), *found], dim=2)


@lru_cache(maxsize=16)
def transforms(
    width: int,
) -> tuple[Float32[torch.Tensor, "parts {width}"], Float32[torch.Tensor, "f f"], Float32[torch.Tensor, "f f"]]:
    """Matrices of the rFFT, of which all real parts come first, and of the way back: from real parts to the even half of what they
    stand for, and from imaginary parts to the odd half.
    """
    frequency = torch.arange(width // 2 + 1, dtype=torch.float64)
    phase = torch.outer(frequency, torch.arange(width, dtype=torch.float64)) * (2 * math.pi / width)
    weight = torch.where((frequency == 0) | (2 * frequency == width), 1.0, 2.0) / width
    back = phase[:, : len(frequency)]
    return torch.cat([phase.cos(), -phase.sin()]).float(), (back.cos() * weight).float(), (-back.sin() * weight).float()


def in_parts(views: Float32[torch.Tensor, "n h w"]) -> tuple[Float32[torch.Tensor, "part h w"], ...]:
    """Views in parts that have ROTATIONS at most; a single view is never parted."""
    most = max(1, ROTATIONS // views.shape[2])
    return views.tensor_split(max(1, math.ceil(len(views) / most)))


def all_rotations(
    left: Shaped[torch.Tensor, "half ..."], right: Shaped[torch.Tensor, "half ..."], width: int
) -> Shaped[torch.Tensor, "{width} ..."]:
    """All rotations 0 .. w - 1, of values at rotations 0, 1, .. w // 2 (to the left) and 0, -1, .. -(w // 2)."""
    return torch.cat([left, right[1 : (width + 1) // 2].flip(0)])


def product(a: Float32[torch.Tensor, "i k"], b: Float32[torch.Tensor, "k j"]) -> Float32[torch.Tensor, "i j"]:
    """a @ b, where a is a constant."""
    if not (_has_onednn(a) and b.numel()):
        return a @ b
    return _Product.apply(a, b) if b.requires_grad else _by_onednn(a, b)


def products(a: Float32[torch.Tensor, "f i k"], b: Float32[torch.Tensor, "f k j"]) -> Float32[torch.Tensor, "f i j"]:
    """a[f] @ b[f] of each f, where a is a constant."""
    i, k, j = *a.shape[1:], b.shape[2]
    # As a convolution of f groups. Where k is a multiple of 4, as it can be for gradients, oneDNN would order b anew at great cost.
    # Small ones are not worth it, and with few columns they depend on the number of threads.
    if not (_has_onednn(a) and k % 4 and j >= 64 and i * j >= 4000):
        return torch.bmm(a, b)
    return _Product.apply(a, b) if b.requires_grad else _by_onednn(a, b)


def _by_onednn(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """`product` or `products` by oneDNN, which on some processors is thrice as fast as what torch takes by itself."""
    if a.ndim == 2:
        b = b if b.T.is_contiguous() else b.contiguous()  # it knows no other strides, and is extremely slow with them
        return torch.ops.mkldnn._linear_pointwise(a, b.T, None, "none", [], "")
    (f, i, k), j = a.shape, b.shape[2]
    return torch.mkldnn_convolution(b.reshape(1, f * k, j), a.reshape(f * i, k, 1), None, [0], [1], [1], f).reshape(
        f, i, j
    )


class _Product(torch.autograd.Function):
    """`_by_onednn` with its gradient."""

    @staticmethod
    def forward(ctx, a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(a)
        return _by_onednn(a, b)

    @staticmethod
    def backward(ctx, gradient: torch.Tensor) -> tuple[None, torch.Tensor]:
        (a,) = ctx.saved_tensors
        return None, (product if a.ndim == 2 else products)(a.mT, gradient)


def _has_onednn(tensor: torch.Tensor) -> bool:
    return tensor.device.type == "cpu" and torch.backends.mkldnn.is_available()


def bell(width: int, deviation: float) -> Float32[torch.Tensor, " {width}"]:
    """A Gaussian over the rotations about rotation 0, of sum 1; deviation: its standard deviation (rad), over 0."""
    turns = torch.as_tensor(turn_of_columns(np.arange(width), width), dtype=torch.float32)
    return torch.softmax(-0.5 * (turns / deviation) ** 2, dim=0)


def smoothed(scans: Float32[torch.Tensor, "n w"], deviation: float) -> Float32[torch.Tensor, "n w"]:
    """Each rotation averaged with its neighbours, by a Gaussian with a standard deviation of `deviation` (rad); 0 is as it is."""
    if deviation == 0:
        return scans
    width = scans.shape[1]
    rotation = torch.arange(width)
    weights = bell(width, deviation)[(rotation[:, None] - rotation) % width]
    return product(weights.to(scans.device), scans.T).T
