"""A mushroom body: many sparsely wired Kenyon cells, and one output whose synapses weaken where a view was seen."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float32
from torch.nn.functional import embedding_bag

from tussock.world.errors import InputError

from .base import Images, IncrementalModel, Learned, Scans
from .filter_bank import FilterBank, smoothed

MOST_SHARES = 2**28  # of pixels in fields: 1 GB
AT_ONCE = 128  # views that are learned


@dataclass(kw_only=True, eq=False)
class MushroomBody(IncrementalModel):
    """Projection neurons, Kenyon cells with few random inputs each, and anti-Hebbian depression of their output synapses.

    Projection neurons average the view over the fields of a grid of `columns` x `rows`, less the mean at their elevation and divided
    by the contrast there to the power of `adaptation` (lateral inhibition and gain control). A Kenyon cell sums `inputs` of them;
    at any view the share `active` of the cells with the largest sums fires. Learning a view multiplies the output synapses of the
    cells that fire by 1 - `depression`. Familiarity is minus their mean over the cells that fire, averaged over
    neighbouring rotations (Gaussian, standard deviation `smoothing_deg`), as a head that sways would. Constant memory.
    """

    name = "mushroom-body"
    paper = "Ardin et al. 2016"

    LIMITS = {"active": (0.0, 1.0), "depression": (0.0, 1.0)}  # noqa: RUF012
    columns: int = 36
    rows: int = 10
    cells: int = 20_000
    inputs: int = 40
    active: float = 0.003
    depression: float = 0.8
    adaptation: float = 0.25
    smoothing_deg: float = 6.0

    @property
    def firing(self) -> int:
        """How many Kenyon cells fire."""
        return max(1, round(self.active * self.cells))

    def _begin(self, height: int, width: int) -> Learned:
        neurons = self.columns * self.rows
        wiring = torch.rand(self.cells, neurons, generator=self._random()).topk(self.inputs, dim=1).indices
        return {"wiring": self._here(wiring.sort(dim=1).values), "synapses": torch.ones(self.cells, device=self.device)}

    def _add(self, learned: Learned, views: Images) -> Learned:
        synapses = learned["synapses"].clone()
        fields = self._bank(*views.shape[1:])
        for some in views.split(AT_ONCE):
            unturned = torch.stack([self._projection(fields, view)[:, 0] for view in some], dim=1)
            for firing in self._firing(unturned, learned["wiring"]):
                synapses[firing] *= 1 - self.depression
        return {"wiring": learned["wiring"], "synapses": synapses}

    def check_parameters(self) -> None:
        """As for all models; and a Kenyon cell has no more inputs than there are projection neurons."""
        super().check_parameters()
        if self.inputs > self.columns * self.rows:
            raise InputError(
                f"{self.name}: {self.inputs} inputs of {self.columns * self.rows} projection neurons; give fewer"
            )

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"wiring": (self.cells, self.inputs), "synapses": (self.cells,)}

    def _prepare(self) -> None:
        assert self.shape is not None
        self._fields = self._bank(*self.shape)

    def _bank(self, height: int, width: int) -> FilterBank:
        """The fields of the projection neurons, for views of height x width."""
        if self.columns * self.rows * height * width > MOST_SHARES:
            raise InputError(
                f"{self.name}: {self.columns} x {self.rows} fields of {width} x {height} pixels are over {MOST_SHARES:,} numbers; "
                "give fewer, or smaller views (--resize)"
            )
        return FilterBank(receptive_fields(self.columns, self.rows, height, width).to(self.device))

    def _scan(self, views: Images) -> Scans:
        scans = []
        for view in views:
            firing = self._firing(self._projection(self._fields, view), self.learned["wiring"])
            scans.append(-self.learned["synapses"][firing].mean(dim=1))
        return smoothed(torch.stack(scans), np.radians(self.smoothing_deg))

    def _projection(self, fields: FilterBank, view: Float32[torch.Tensor, "h w"]) -> Float32[torch.Tensor, "neurons w"]:
        """What the projection neurons send at each rotation. Over all rotations, a field sees all of its elevation."""
        averages = fields.responses(view[None])[0].T
        contrast, mean = torch.std_mean(averages, dim=1, keepdim=True, correction=0)
        return (averages - mean) / (contrast + 0.02 * contrast.max() + 1e-9) ** self.adaptation

    def _firing(self, projections: Float32[torch.Tensor, "neurons n"], wiring: torch.Tensor) -> torch.Tensor:
        """Indices (n, firing) of the Kenyon cells that fire at each of n projections."""
        drive = embedding_bag(wiring, projections.contiguous(), mode="sum")  # (cells, n)
        return drive.T.contiguous().topk(self.firing, dim=1, sorted=False).indices


def receptive_fields(columns: int, rows: int, height: int, width: int) -> Float32[torch.Tensor, "neurons h w"]:
    """Filters that average a view over the fields of a grid, each pixel counted by the share of it inside the field."""

    def shares(fields: int, pixels: int) -> torch.Tensor:
        edges = torch.arange(fields + 1) * (pixels / fields)
        begin, end = edges[:-1, None], edges[1:, None]
        pixel = torch.arange(pixels)
        return (torch.minimum(end, pixel + 1.0) - torch.maximum(begin, pixel * 1.0)).clamp(min=0) / (pixels / fields)

    return torch.einsum("ri,cj->rcij", shares(rows, height), shares(columns, width)).reshape(-1, height, width)
