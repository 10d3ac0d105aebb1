"""Which triangles of a world are which plant."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int, Int32, Shaped, UInt8

from .errors import SettingError

# In place of the number of a plant:
GROUND = -1  # the ground, and what lies flat on it
OTHER = -2  # hedges, far hills, walls, new objects, and what is not known


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantGroups:
    """Which triangles of a world are which plant. Stones and pieces of litter count as plants here. Immutable.

    Attributes:
        of: (n,) number of the plant that each triangle belongs to; GROUND or OTHER where it belongs to none.
        kinds: Names of the kinds of plants, such as "tussock".
        kind: (plants,) the kind of each plant, as an index of `kinds`.
        foot: (plants, 3) where it stands: x, y, z (m).
    """

    of: Int32[np.ndarray, " n"]
    kinds: tuple[str, ...]
    kind: UInt8[np.ndarray, " plants"]
    foot: Float32[np.ndarray, "plants 3"]

    def __post_init__(self):
        if len(self.kind) != len(self.foot):
            raise SettingError(
                f"{len(self.kind)} plants have a kind and {len(self.foot)} have a foot; give both of each"
            )
        if len(self.of) and not OTHER <= self.of.min() <= self.of.max() < len(self.kind):
            raise SettingError(f"triangles belong to plants {self.of.min()} to {self.of.max()} of {len(self.kind)}")
        if len(self.kind) and self.kind.max() >= len(self.kinds):
            raise SettingError(f"a plant is of kind {self.kind.max()}, and there are {len(self.kinds)} kinds")

    def __len__(self) -> int:
        return len(self.kind)

    def per_triangle(self, values: Shaped[np.ndarray, " plants"], otherwise: Any) -> Shaped[np.ndarray, " n"]:
        """Values of the plants, for each triangle that of its plant; `otherwise` where it belongs to none."""
        spread = np.full(len(self.of), otherwise, values.dtype)
        inside = self.of >= 0
        spread[inside] = values[self.of[inside]]
        return spread


@dataclass
class GroupsBuilder:
    """Collects the groups of triangles that are added one after the other.

    Attributes:
        of: Plant of each triangle, piece by piece.
        kinds: Kind of each plant.
        foot: Where plants stand, piece by piece.
    """

    of: list[Int[np.ndarray, " n"]] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    foot: list[Float[np.ndarray, "plants 3"]] = field(default_factory=list)

    def add(self, kind: str, xy: Float[np.ndarray, "plants 2"], row: Int[np.ndarray, " n"]) -> None:
        """Add plants of a kind that stand at positions (m), and triangles that belong to the plants `row` of these."""
        self.of.append(row + len(self.kinds))
        self.kinds += [kind] * len(xy)
        self.foot.append(np.column_stack([xy, np.zeros(len(xy))]))

    def add_none(self, count: int, what: int) -> None:
        """Add triangles that belong to no plant: GROUND or OTHER."""
        self.of.append(np.full(count, what))

    def build(self, height: Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, " n"]] | None = None) -> PlantGroups:
        """The groups of all that was added. `height` gives that of the ground at positions (both m); None: it is flat."""
        names = tuple(dict.fromkeys(self.kinds))
        number = {name: i for i, name in enumerate(names)}
        foot = np.concatenate([np.zeros((0, 3)), *self.foot])
        if height is not None:
            foot[:, 2] = height(foot[:, :2])
        return PlantGroups(
            of=np.concatenate([np.zeros(0), *self.of]).astype(np.int32),
            kinds=names,
            kind=np.array([number[name] for name in self.kinds], dtype=np.uint8),
            foot=foot.astype(np.float32),
        )


def no_plants(count: int) -> PlantGroups:
    """The groups of triangles of which none is of a plant or of the ground."""
    groups = GroupsBuilder()
    groups.add_none(count, OTHER)
    return groups.build()
