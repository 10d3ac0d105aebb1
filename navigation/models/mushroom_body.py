"""A mushroom body: many sparsely wired Kenyon cells, and a few outputs that are silent where a view was seen."""

import math
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64
from torch.nn.functional import embedding_bag

from tussock.world.errors import SettingError
from tussock.world.geometry import turn_of_columns
from tussock.world.settings import choice, number, whole

from ..threads import in_threads
from .base import Images, Learned, Scans, Scores, Shapes, model
from .filter_bank import FilterBank
from .firing import CELLS, largest_drives
from .incremental import IncrementalModel
from .rotations import gaussian, one_by_one, smoothed, weights_ahead

MAX_NUMBERS = 2**28  # in an array that is made on the way: 1 GB
BATCH = 128  # views that are learned at once
GROUP = 64  # cells whose largest drive is found first
# Parameters with which the model is that of Ardin et al. 2016, but for what docs/models.md says.
ARDIN2016 = {
    "overlap_deg": 0.0, "cells": 20_000, "inputs": 10, "active": 0.003, "outputs": 1, "learning": "depression", "traversals": 1,
}  # fmt: skip


@model
class MushroomBody(IncrementalModel):
    """Projection neurons, Kenyon cells with few random inputs each, and outputs that learn to be silent at what was seen.

    Projection neurons average the view over overlapping fields on a grid of `columns` x `rows`, less the mean at their elevation and
    divided by the contrast there to the power of `adaptation` (lateral inhibition and gain control). A Kenyon cell sums `inputs` of
    them; the share `active` of the cells with the largest sums fires. An output is the mean synapse of the cells that fire.
    Familiarity is minus the least output, averaged over neighbouring rotations. Constant memory.

    Each view is learned by one of the outputs, one after the other in turn. Learning by "contrast", the agent turns on the spot and
    sees the view at all rotations. Of all outputs at all rotations, only this one shall be silent, and only at the view's own
    heading; the synapses of the cells that fire change by the error of this prediction (Bennett et al. 2021). By "depression", the
    synapses of the cells that fire at the view's own heading are multiplied by 1 - `depression` (Ardin et al. 2016).

    Attributes:
        columns: Fields around the circle.
        rows: Fields from top to bottom.
        cells: Number of Kenyon cells.
        inputs: Projection neurons per Kenyon cell.
        active: Share of the Kenyon cells that fires.
        overlap_deg: Standard deviation of the Gaussian by which a field reaches into its neighbours around the circle (deg).
        outputs: Number of output neurons.
        learning: "contrast" or "depression".
        rate: By contrast: how much a synapse changes for a prediction error of 1.
        traversals: Passes over the views that are learned together.
        target_deg: By contrast: standard deviation of the headings that count as the view's own (deg).
        depression: By depression: share of its strength that the synapse of a firing cell loses when a view is learned.
        adaptation: Exponent of the contrast; 0 is no adaptation, 1 is complete.
        smoothing_deg: Standard deviation of the Gaussian over neighbouring rotations (deg), for a head that moves to and fro.
    """

    name = "mushroom-body"
    paper = "Ardin et al. 2016; Bennett et al. 2021"
    dtypes = {"wiring": torch.int64, "seen": torch.int64}  # noqa: RUF012
    takes_mask = True

    columns: int = whole(36)
    rows: int = whole(10)
    cells: int = whole(5_000)
    inputs: int = whole(40)
    active: float = number(0.03, low=0, high=1)
    overlap_deg: float = number(4.0, low=0, high=180, unit="deg")
    outputs: int = whole(7)
    learning: str = choice("contrast", ("contrast", "depression"))
    rate: float = number(10.0, low=0, high=1e6)
    traversals: int = whole(3)
    target_deg: float = number(6.0, low=0.1, high=180, unit="deg")
    depression: float = number(0.8, low=0, high=1)
    adaptation: float = number(0.25, low=0)
    smoothing_deg: float = number(6.0, low=0, unit="deg")

    def __attrs_post_init__(self):
        neurons = self.columns * self.rows
        if self.inputs > neurons:
            raise SettingError(f"{self.name}: inputs is {self.inputs}, of {neurons} projection neurons; give fewer")
        if self.cells * max(neurons, self.outputs) > MAX_NUMBERS:
            raise SettingError(
                f"{self.name}: {self.cells} cells, {neurons} projection neurons (columns x rows) and {self.outputs} outputs have "
                f"over {MAX_NUMBERS:,} possible connections; give fewer"
            )

    _grid: tuple[Any, ...] | None = attrs.field(init=False, repr=False, default=None)

    @property
    def firing(self) -> int:
        """Number of Kenyon cells that fire."""
        return max(1, round(self.active * self.cells))

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and every input of a Kenyon cell is a projection neuron."""
        super().check_learned(shape, learned)
        wiring, neurons = learned["wiring"], self.columns * self.rows
        if not 0 <= int(wiring.min()) <= int(wiring.max()) < neurons:
            raise SettingError(
                f"{self.name}: cells are wired to neurons {int(wiring.min())} to {int(wiring.max())} of {neurons}"
            )
        if int(learned["seen"]) < 0:
            raise SettingError(f"{self.name}: it has seen {int(learned['seen'])} views")

    def _begin(self, height: int, width: int) -> Learned:
        self.__attrs_post_init__()  # its parameters may have been changed one by one
        self._check_fields(height, width)
        neurons = self.columns * self.rows
        wiring = torch.rand(self.cells, neurons, generator=self._random()).topk(self.inputs, dim=1).indices
        synapses = torch.ones(self.outputs, self.cells, device=self.device)
        seen = torch.zeros((), dtype=torch.int64, device=self.device)
        return {"wiring": self._on_device(wiring.sort(dim=1).values), "synapses": synapses, "seen": seen}

    def _add(self, learned: Learned, views: Images) -> Learned:
        wiring, synapses, seen = learned["wiring"], learned["synapses"].clone(), int(learned["seen"])
        fields = self._fields_for(views.shape[1], views.shape[2])
        for _ in range(self.traversals):
            for place, firing in enumerate(self._firing_cells(fields, views, wiring), start=seen):
                output = place % self.outputs
                if self.learning == "depression":
                    synapses[output, firing[0]] *= 1 - self.depression
                else:
                    self._contrast(synapses, output, firing)
        return {"wiring": wiring, "synapses": synapses, "seen": learned["seen"] + len(views)}

    def _firing_cells(
        self, fields: FilterBank, views: Images, wiring: torch.Tensor
    ) -> Iterator[Int64[torch.Tensor, "n firing"]]:
        """For each view the Kenyon cells that fire, at all rotations or, for learning by depression, at its own heading only."""
        if self.learning == "contrast":
            yield from (self._firing(self._projection(fields, view), wiring) for view in views)
            return
        for batch in views.split(BATCH):
            unturned = torch.stack([self._projection(fields, view)[:, 0] for view in batch], dim=1)
            yield from self._firing(unturned, wiring)[:, None]

    def _contrast(
        self, synapses: Float32[torch.Tensor, "outputs cells"], output: int, firing: Int64[torch.Tensor, "w firing"]
    ) -> None:
        """Change the synapses, in place, so that one output is more silent at a view's own heading, and all are less so elsewhere."""
        width, count = firing.shape
        wanted = torch.zeros(self.outputs, width, device=firing.device)
        wanted[output] = gaussian(width, math.radians(self.target_deg)).to(firing.device)
        shares = torch.softmax(-outputs_of(synapses, firing).flatten(), dim=0).reshape(wanted.shape)
        change = self.rate * (shares - wanted)
        synapses.index_add_(1, firing.flatten(), change.repeat_interleave(count, dim=1))

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"wiring": (self.cells, self.inputs), "synapses": (self.outputs, self.cells), "seen": ()}

    def _learn_more(self, shape: tuple[int, int], views: Images) -> None:
        """The wiring stays as it is, and so does what it needs."""
        self._check_form(shape, self._learned)
        self._learned = self._add(self._learned, views)

    def _fields_for(self, height: int, width: int) -> FilterBank:
        """The fields of the projection neurons. They are made anew for another grid only."""
        grid = (self.columns, self.rows, self.overlap_deg, height, width, self.mask)
        if self._grid != grid:
            self._grid, self._fields = grid, self._field_bank(height, width)
        return self._fields

    def _check_fields(self, height: int, width: int) -> None:
        if self.columns * self.rows * height * width > MAX_NUMBERS:
            raise SettingError(
                f"{self.name}: {self.columns} x {self.rows} fields of {width} x {height} pixels are over {MAX_NUMBERS:,} numbers; "
                "give fewer columns or rows, or smaller views"
            )

    def _field_bank(self, height: int, width: int) -> FilterBank:
        """The fields of the projection neurons, for views of height x width; with a mask, of what is visible of each."""
        self._check_fields(height, width)
        fields = receptive_fields(self.columns, self.rows, height, width)
        if self.overlap_deg:
            fields = overlapping(fields, math.radians(self.overlap_deg))
        if self.mask is not None:
            fields = fields * self.mask.visible
            shares = fields.sum(dim=(1, 2))  # of the fields that are visible, 0 to 1
            fields = fields / torch.where(shares > 0, shares, 1)[:, None, None]
            self._shares = self._on_device(shares.reshape(self.rows, self.columns, 1))
        return self._bank(self._on_device(fields.double()))  # so that neurons that see the same respond alike

    def _scan(self, views: Images) -> Scans:
        return smoothed(self._familiarity(views, slice(None)), np.radians(self.smoothing_deg))

    def _score(self, views: Images) -> Scores:
        rotations, weights = map(self._on_device, weights_ahead(views.shape[2], math.radians(self.smoothing_deg)))
        return one_by_one(lambda each: each @ weights, self._familiarity(views, rotations))

    def _familiarity(self, views: Images, rotations: slice | torch.Tensor) -> Float32[torch.Tensor, "n k"]:
        """Minus the least output at some rotations of each view."""
        wiring, synapses = self._learned["wiring"], self._learned["synapses"]
        fields = self._fields_for(views.shape[1], views.shape[2])
        firing = (self._firing(self._projection(fields, view)[:, rotations], wiring) for view in views)
        return torch.stack([-outputs_of(synapses, cells).amin(dim=0) for cells in firing])

    def _projection(self, fields: FilterBank, view: Float32[torch.Tensor, "h w"]) -> Float32[torch.Tensor, "neurons w"]:
        """Output of the projection neurons at each rotation.

        Over all rotations, a field sees all of its elevation. Behind a mask this would be what the eye does not see at this rotation:
        there mean and contrast are those over the fields at an elevation, each weighted by the share of it that is visible, and
        neurons that see nothing are silent.
        """
        averages = fields.responses(view[None])[0].T.contiguous()
        if self.mask is not None:
            return self._seen_projection(averages.unflatten(0, (self.rows, self.columns))).flatten(0, 1)
        contrast, mean = torch.std_mean(averages, dim=1, keepdim=True, correction=0)
        return (averages - mean) / (contrast + 0.02 * contrast.max() + 1e-9) ** self.adaptation

    def _seen_projection(
        self, averages: Float32[torch.Tensor, "rows columns w"]
    ) -> Float32[torch.Tensor, "rows columns w"]:
        total = self._shares.sum(dim=1, keepdim=True).clamp(min=1e-9)
        mean = (self._shares * averages).sum(dim=1, keepdim=True) / total
        contrast = ((self._shares * (averages - mean).square()).sum(dim=1, keepdim=True) / total).sqrt()
        gain = (contrast + 0.02 * contrast.amax(dim=0) + 1e-9) ** self.adaptation
        return ((averages - mean) / gain).where(self._shares > 0, 0)

    def _firing(self, projections: Float32[torch.Tensor, "neurons n"], wiring: torch.Tensor) -> torch.Tensor:
        """Indices (n, firing) of the Kenyon cells that fire at each of n projections."""
        n = projections.shape[1]
        if projections.device.type != "cpu" or self.firing * CELLS > len(wiring):  # where many fire, sorting is faster
            several = projections if n > 1 else projections.expand(-1, 2)  # for one, torch takes 20 times as long
            return largest(embedding_bag(wiring, several.contiguous(), mode="sum")[:, :n], self.firing)
        cells = torch.empty(n, self.firing, dtype=torch.int64)
        of_neurons, of_cells, chosen = projections.numpy(), wiring.numpy(), cells.numpy()
        in_threads(
            lambda begin, end: largest_drives(
                np.ascontiguousarray(of_neurons[:, begin:end]), of_cells, chosen[begin:end]
            ),
            len(cells),
            min(torch.get_num_threads(), len(cells)),
        )
        return cells


def outputs_of(
    synapses: Float32[torch.Tensor, "outputs cells"], firing: Int64[torch.Tensor, "w firing"]
) -> Float32[torch.Tensor, "outputs w"]:
    """The outputs at each rotation: the mean synapse of the cells that fire."""
    return torch.stack([of_output[firing].mean(dim=1) for of_output in synapses])


def largest(drive: Float32[torch.Tensor, "cells n"], count: int) -> Int64[torch.Tensor, "n count"]:
    """The cells with the largest drive, at each of n projections; of cells that tie, the first ones.

    The `count` largest are at least as large as the limit that as many groups of cells reach. This leaves few to be sorted.
    """
    n = drive.shape[1]
    groups = drive[: len(drive) // GROUP * GROUP].unflatten(0, (-1, GROUP)).amax(dim=1)
    least = groups.T.contiguous().topk(count, dim=1).values[:, -1] if len(groups) >= count else drive.amin(dim=0)
    cell, column = _true(drive >= least)
    column, order = column.sort(stable=True)
    numbers = column.bincount(minlength=n)
    place = torch.arange(len(column), device=drive.device) - (numbers.cumsum(dim=0) - numbers)[column]
    cells = cell.new_zeros(n, int(numbers.max()))
    cells[column, place] = cell[order]
    drives = drive.new_full(cells.shape, -torch.inf)
    drives[column, place] = drive[cell[order], column]
    return cells.gather(1, drives.sort(dim=1, descending=True, stable=True).indices[:, :count])


def _true(condition: Bool[torch.Tensor, "cells n"]) -> tuple[torch.Tensor, torch.Tensor]:
    """Rows and columns of what is true. On a CPU by numpy, which is faster than torch."""
    on_cpu = condition.device.type == "cpu"
    flat = torch.from_numpy(np.flatnonzero(condition.numpy())) if on_cpu else condition.flatten().nonzero()[:, 0]
    return flat // condition.shape[1], flat % condition.shape[1]


def receptive_fields(columns: int, rows: int, height: int, width: int) -> Float32[torch.Tensor, "neurons h w"]:
    """Filters that average a view over the fields of a grid, each pixel weighted by the share of it inside the field."""

    def shares(fields: int, pixels: int) -> torch.Tensor:
        edges = torch.arange(fields + 1) * (pixels / fields)
        begin, end = edges[:-1, None], edges[1:, None]
        pixel = torch.arange(pixels)
        return (torch.minimum(end, pixel + 1.0) - torch.maximum(begin, pixel * 1.0)).clamp(min=0) / (pixels / fields)

    return torch.einsum("ri,cj->rcij", shares(rows, height), shares(columns, width)).reshape(-1, height, width)


def overlapping(fields: Float32[torch.Tensor, "neurons h w"], deviation: float) -> Float32[torch.Tensor, "neurons h w"]:
    """Fields that reach into their neighbours around the circle, by a Gaussian (rad) that ends at three standard deviations.

    It ends so that a field of which a mask leaves nothing but its far tail sees nothing.
    """
    width = fields.shape[2]
    turn = torch.arange(width)
    within = torch.from_numpy(np.abs(turn_of_columns(turn.numpy(), width)) <= 3 * deviation + 1e-9)
    reach = gaussian(width, deviation) * within
    return fields @ (reach / reach.sum())[(turn[:, None] - turn) % width]
