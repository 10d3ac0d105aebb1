"""Tensors that grow at the cost of what is added."""

import copy
from dataclasses import dataclass
from typing import TypeVar

import torch
from jaxtyping import Complex, Float

from .products import FILTERS, PANEL, TILE

Self = TypeVar("Self", bound="Growing")


@dataclass
class _Storage:
    """Room for more than is there, and how much of it is taken."""

    tensor: torch.Tensor
    taken: int


class Growing:
    """A tensor that grows along its first dimension.

    It is never changed: what `appended` returns shares the storage with it, behind its end. The room doubles when it is full, so that
    a number is copied once or twice in all, however often something is added.

    Args:
        tensor: What is there first.
    """

    def __init__(self, tensor: torch.Tensor):
        self._length = len(tensor)
        self._storage = _Storage(tensor.contiguous(), self._length)

    def __len__(self) -> int:
        return self._length

    @property
    def tensor(self) -> torch.Tensor:
        """What is there."""
        return self._storage.tensor[: self._length]

    def appended(self: Self, more: torch.Tensor) -> Self:
        """This and then `more`; this object stays as it is."""
        total, storage = self._length + len(more), self._storage
        another_grew = storage.taken > self._length
        if another_grew or self._room() < total:
            storage = _Storage(self._enlarged(max(total, 2 * self._length)), self._length)
        combined = copy.copy(self)
        combined._length, combined._storage = total, storage
        self._enter(storage.tensor, more)
        storage.taken = total
        return combined

    def _room(self) -> int:
        return len(self._storage.tensor)

    def _enlarged(self, size: int) -> torch.Tensor:
        """A storage with room for `size`, and what is there."""
        storage = self._storage.tensor.new_zeros(size, *self._storage.tensor.shape[1:])
        storage[: self._length] = self.tensor
        return storage

    def _enter(self, storage: torch.Tensor, more: torch.Tensor) -> None:
        """Store `more` behind what is there."""
        storage[self._length : self._length + len(more)] = more


class Tiles(Growing):
    """Fourier transforms of filters, in tiles (t, f, TILE / PANEL, parts, PANEL): the real and imaginary parts of all rows.

    Args:
        spectra: (m, h, f) The first ones.
    """

    def __init__(self, spectra: Complex[torch.Tensor, "m h f"]):
        m, height, frequencies = spectra.shape
        real = torch.view_as_real(spectra)
        tiles = real.new_zeros(-(-m // TILE), frequencies, TILE // PANEL, 2 * height, PANEL)
        self._length = 0
        self._enter(tiles, spectra)
        self._length, self._storage = m, _Storage(tiles, m)

    @property
    def storage(self) -> Float[torch.Tensor, "t f panels parts panel"]:
        """The whole storage. Numbers after the length have no meaning."""
        return self._storage.tensor

    def _room(self) -> int:
        return len(self.storage) * TILE

    def _enlarged(self, size: int) -> torch.Tensor:
        tiles = self.storage.new_zeros(-(-min(size, FILTERS) // TILE), *self.storage.shape[1:])
        taken = -(-self._length // TILE)
        tiles[:taken] = self.storage[:taken]
        return tiles

    def _enter(self, storage: torch.Tensor, more: torch.Tensor) -> None:
        parts = torch.view_as_real(more)  # (m, h, f, 2)
        panels = storage.unflatten(3, (-1, 2)).permute(0, 2, 3, 1, 4, 5)  # (t, panels, h, f, 2, PANEL)
        done = 0
        while done < len(parts):
            panel, column = divmod(self._length + done, PANEL)
            some = parts[done : done + PANEL - column]
            # In two steps, as a plain transposition is slower.
            transposed = some.flatten(1).T.contiguous().unflatten(0, parts.shape[1:])
            panels[divmod(panel, panels.shape[1])][..., column : column + len(some)] = transposed
            done += len(some)
