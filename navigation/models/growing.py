"""Tensors that grow at the cost of what is added."""

from dataclasses import dataclass

import torch


@dataclass
class _Storage:
    """Room for more than is there, and how much of it is taken."""

    tensor: torch.Tensor
    taken: int


class Growing:
    """A tensor that grows along one dimension. It is never changed: what `appended` returns shares the storage with it, behind its end.

    The room doubles when it is full, so that a number is copied once or twice in all, however often something is added.

    Args:
        tensor: What is there first.
        dim: The dimension.
    """

    def __init__(self, tensor: torch.Tensor, dim: int = 0):
        self._dim, self._length = dim, tensor.shape[dim]
        self._storage = _Storage(tensor.contiguous(), self._length)

    def __len__(self) -> int:
        return self._length

    @property
    def tensor(self) -> torch.Tensor:
        """What is there."""
        return self._storage.tensor.narrow(self._dim, 0, self._length)

    @property
    def storage(self) -> torch.Tensor:
        """The whole storage: its layout does not depend on the length. Numbers after the length have no meaning."""
        return self._storage.tensor

    def appended(self, more: torch.Tensor) -> "Growing":
        """This and then `more`; this object stays as it is."""
        total = self._length + more.shape[self._dim]
        storage = self._storage
        another_grew = storage.taken > self._length
        if another_grew or storage.tensor.shape[self._dim] < total:
            shape = list(storage.tensor.shape)
            shape[self._dim] = max(total, 2 * self._length)
            storage = _Storage(storage.tensor.new_zeros(shape), self._length)
            storage.tensor.narrow(self._dim, 0, self._length).copy_(self.tensor)
        combined = object.__new__(Growing)
        combined._dim, combined._length, combined._storage = self._dim, total, storage
        storage.tensor.narrow(self._dim, self._length, more.shape[self._dim]).copy_(more)
        storage.taken = total
        return combined
