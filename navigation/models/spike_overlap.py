"""Spike overlap: the Kenyon cells that fire first are the code of a view, and the code of every learned view is kept."""

import math
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64
from torch.nn.functional import embedding_bag

from tussock.world.errors import SettingError
from tussock.world.settings import number, whole, wholes

from .base import Images, Learned, Scans, Scores, Shapes, Windows, model
from .checks import check_scan
from .incremental import IncrementalModel
from .mushroom_body import MAX_NUMBERS
from .rotations import in_batches

# The circuit of ApiaViz (2026): a leaky cell with the input 1 + GAIN x drive fires when it reaches 1, after TAU ln(1 + 1 / (GAIN x drive)).
TAU, DURATION = 10.0, 50.0  # ms
GAIN = 0.1
DELAY = 1  # ms from the spike that starts the inhibition to its arrival; spikes are counted in bins of 1 ms


@model
class SpikeOverlap(IncrementalModel):
    """Kenyon cells with signed random inputs race to fire; familiarity is the overlap with the most similar code that was learned.

    A view is made of `planes` of the same size, one above the other, as the encoding steps of colour make them. Each is averaged over
    `rows` x `columns` fields of what lies within `field`. The planes of a stream are standardised together, and its share of the
    cells sums `inputs` of their fields, each with a normal weight. The share `active` of a stream's cells fires before inhibition
    arrives, and those that fire until then as well. The overlap of two codes is the number of cells in both, divided by the geometric
    mean of the numbers of cells in each. Memory grows with the number of views.

    Attributes:
        planes: Number of planes in each stream.
        columns: Fields from left to right.
        rows: Fields from top to bottom.
        cells: Number of Kenyon cells, in equal parts for each stream.
        inputs: Fields that a Kenyon cell sums.
        active: Share of a stream's cells whose spikes start the inhibition.
        field: What the eye compares, centred ahead (rad).
        pixel: Only every N-th column of a view is a pixel of the eye; the others are there for turns by less than a pixel.
    """

    name = "spike-overlap"
    paper = "ApiaViz 2026"
    dtypes = {"wiring": torch.int64, "codes": torch.bool}  # noqa: RUF012
    takes_mask = True

    planes: tuple[int, ...] = wholes((1,), single=True)
    columns: int = whole(64)
    rows: int = whole(8)
    cells: int = whole(8000)
    inputs: int = whole(10)
    active: float = number(0.02825, low=0, high=1)
    field: float = number(2 * math.pi, low=math.radians(1), high=2 * math.pi, unit="rad")
    pixel: int = whole(1)

    def match(self, views: Images, windows: Windows | None = None) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and which learned view is the most similar at each rotation."""
        check_scan(views, self.shape)
        if len(views) == 0:
            return self.scan(views), torch.empty(0, views.shape[2], dtype=torch.int64)
        pairs = [self._nearest(view) for batch in in_batches(views) for view in self._on_device(batch)]
        familiarity, index = zip(*pairs, strict=True)
        return torch.stack(familiarity), torch.stack(index)

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and every input of a cell is a field of its stream."""
        super().check_learned(shape, learned)
        for fields, part in zip(self._fields(), self._parts(), strict=True):
            wiring = learned["wiring"][part]
            if len(wiring) and not 0 <= int(wiring.min()) <= int(wiring.max()) < fields:
                raise SettingError(
                    f"{self.name}: cells are wired to fields {wiring.min()} to {wiring.max()} of {fields}"
                )

    def _begin(self, height: int, width: int) -> Learned:
        random, fields = self._random(), self._fields()
        if self.inputs > min(fields):
            raise SettingError(f"{self.name}: inputs is {self.inputs}, of {min(fields)} fields; give fewer")
        if self.cells * max(fields) > MAX_NUMBERS:
            raise SettingError(
                f"{self.name}: {self.cells} cells and {max(fields)} fields have over {MAX_NUMBERS:,} possible connections; give fewer"
            )
        self._pooling(height, width)  # refuses views of another number of planes
        wiring = [
            torch.rand(part.stop - part.start, count, generator=random).topk(self.inputs, dim=1).indices
            for count, part in zip(fields, self._parts(), strict=True)
        ]
        weights = torch.randn(self.cells, self.inputs, generator=random) / self.inputs**0.5
        codes = torch.empty(0, self.cells, dtype=torch.bool, device=self.device)
        return {"wiring": self._on_device(torch.cat(wiring)), "weights": self._on_device(weights), "codes": codes}

    def _add(self, learned: Learned, views: Images) -> Learned:
        codes = [self._codes(learned, view, np.zeros(1, dtype=int)) for view in views]
        return {**learned, "codes": torch.cat([learned["codes"], *codes])}

    def _shapes(self, height: int, width: int) -> Shapes:
        return {
            "wiring": (self.cells, self.inputs),
            "weights": (self.cells, self.inputs),
            "codes": (None, self.cells),
        }

    def _prepare(self) -> None:
        self._kept = self._learned["codes"].float()
        self._sizes = self._kept.sum(dim=1).clamp(min=1)

    def _scan(self, views: Images) -> Scans:
        return torch.stack([self._nearest(view)[0] for view in views])

    def _score(self, views: Images) -> Scores:
        return torch.cat([self._nearest(view, np.zeros(1, dtype=int))[0] for view in views])

    def _nearest(
        self, view: Float32[torch.Tensor, "h w"], rotations: np.ndarray | None = None
    ) -> tuple[Float32[torch.Tensor, " n"], Int64[torch.Tensor, " n"]]:
        """Overlap with, and index of, the most similar learned code, at some rotations (None: all); -1 where no cell fires."""
        rotations = np.arange(view.shape[1]) if rotations is None else rotations
        codes = self._codes(self._learned, view, rotations).float()
        sizes = codes.sum(dim=1)
        shared = codes @ self._kept.T  # whole numbers, so that they are the same in any order
        overlap, index = (shared / (sizes.clamp(min=1)[:, None] * self._sizes).sqrt()).max(dim=1)
        return overlap.where(sizes > 0, -1.0), index

    def _codes(
        self, learned: Learned, view: Float32[torch.Tensor, "h w"], rotations: np.ndarray
    ) -> Bool[torch.Tensor, "n cells"]:
        """Which cells fire at some rotations of a view."""
        pooled, codes, first = self._pooled(view, rotations), [], 0
        for planes, part in zip(self.planes, self._parts(), strict=True):
            rows = slice(first, first + planes * self.rows)
            inputs, first = pooled[:, rows].flatten(start_dim=1), rows.stop
            deviation, mean = torch.std_mean(inputs, dim=1, keepdim=True)
            standard = ((inputs - mean) / (deviation + 1e-6)).T.contiguous()
            several = standard if len(rotations) > 1 else standard.expand(-1, 2).contiguous()  # for one, torch is slow
            drive = embedding_bag(
                learned["wiring"][part], several, per_sample_weights=learned["weights"][part], mode="sum"
            )
            codes.append(first_to_fire(drive[:, : len(rotations)].T, self.active))
        return torch.cat(codes, dim=1)

    def _pooled(
        self, view: Float32[torch.Tensor, "h w"], rotations: np.ndarray
    ) -> Float32[torch.Tensor, "n rows columns"]:
        """Means over the fields of all planes, at some rotations; of what is visible of each field."""
        over_rows, over_columns, seen = self._pooling(*view.shape)
        columns = torch.as_tensor((seen - rotations[:, None]) % view.shape[1], device=view.device)
        if self.mask is None:
            return (over_rows @ view)[:, columns].transpose(0, 1) @ over_columns.T
        turned = torch.stack([view.roll(int(k), dims=1) for k in rotations])
        images = self.mask.images(turned)[:, :, torch.as_tensor(seen, device=view.device)]
        visible = self.mask.visible.to(view.device)[:, torch.as_tensor(seen, device=view.device)].float()
        shares = over_rows @ visible @ over_columns.T
        return (over_rows @ images @ over_columns.T) / shares.where(shares > 0, 1.0)

    def _pooling(
        self, height: int, width: int
    ) -> tuple[Float32[torch.Tensor, "rows h"], Float32[torch.Tensor, "columns seen"], np.ndarray]:
        """Weights of the rows of a view in those of the fields, and of its columns likewise; and which columns these are."""
        planes = sum(self.planes)
        if height % planes:
            raise SettingError(
                f"{self.name}: views of {height} rows are not {planes} planes of equal size; give other planes or encoding"
            )
        count = max(1, round(self.field / (2 * math.pi) * width))
        seen = (width - count) // 2 + np.arange(0, count, self.pixel)
        rows = torch.block_diag(*[averaging(self.rows, height // planes)] * planes)
        return self._on_device(rows), self._on_device(averaging(self.columns, len(seen))), seen

    def _fields(self) -> list[int]:
        """Number of fields of each stream."""
        return [planes * self.rows * self.columns for planes in self.planes]

    def _parts(self) -> list[slice]:
        """The cells of each stream."""
        ends = [round(self.cells * k / len(self.planes)) for k in range(len(self.planes) + 1)]
        return [slice(*each) for each in pairwise(ends)]


def averaging(fields: int, pixels: int) -> Float32[torch.Tensor, "{fields} {pixels}"]:
    """Weights that average pixels over fields: those that lie in a field, even in part, each with the same weight."""
    weights = torch.zeros(fields, pixels)
    for k in range(fields):
        first, end = k * pixels // fields, -(-(k + 1) * pixels // fields)
        weights[k, first:end] = 1 / (end - first)
    return weights


def first_to_fire(drive: Float32[torch.Tensor, "n cells"], active: float) -> Bool[torch.Tensor, "n cells"]:
    """Which cells fire before inhibition arrives.

    Args:
        drive: (n, cells) Input of each cell; those of 0 and less never fire.
        active: Share of the cells whose spikes start the inhibition.
    """
    count = min(max(1, round(active * drive.shape[1])), drive.shape[1])
    never = int(DURATION) + 1
    times = TAU * torch.log1p(1 / (GAIN * drive.clamp(min=1e-30)))
    bins = times.ceil().clamp(max=never).where(drive > 0, never).long()  # ms
    spikes = bins.new_zeros(len(drive), never + 1).scatter_add_(1, bins, torch.ones_like(bins))
    start = (spikes.cumsum(dim=1) < count).sum(dim=1, keepdim=True)  # when `count` cells have fired
    return (bins <= start + DELAY) & (bins < never)
