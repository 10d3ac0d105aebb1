"""The mushroom body of Ardin et al. (2016) with spiking neurons, and one-shot learning gated by dopamine."""

import logging
from functools import cache

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int32, Int64

from tussock.world.errors import SettingError
from tussock.world.settings import number, switch, whole

from ..threads import in_threads
from .base import Images, Learned, Scans, Scores, Shapes, model
from .checks import check_scan
from .incremental import IncrementalModel
from .spikes import Neuron, Plasticity, fire, learn, peaks, respond, steps_to_spike, synaptic_currents

log = logging.getLogger(__name__)
NEURONS = 360  # projection neurons of the original, 36 x 10; its current is meant for this number
MIN_CELLS = 10  # Kenyon cells that a view needs to be told from others
NUMBERS = 2**23  # of pixels at rotations that are held at once: 64 MB


@model
class SpikingMushroomBody(IncrementalModel):
    """Projection neurons, Kenyon cells and an output neuron that fire spikes, simulated for one presentation of each view.

    A projection neuron for each visible pixel gets the pixel as a current, scaled with the view to a fixed norm. A Kenyon cell gets the
    spikes of `inputs` of them, and the output neuron those of all Kenyon cells. Where a view is learned, dopamine follows its
    presentation and weakens the synapses of the cells that fired together with the output neuron. Familiarity is minus the number of
    spikes of the output neuron; of rotations with equally many, that is more familiar which brings it less input. Constant memory.

    The circuit and its protocol are Ardin's. The constants are those of its public reimplementation in BoB robotics (projects/ardin_mb),
    which has leaky integrate-and-fire neurons where the paper has Izhikevich's. Its units: ms, mV, nF and nA.

    Attributes:
        cells: Number of Kenyon cells.
        inputs: Projection neurons per Kenyon cell, different ones; all of them, where there are fewer.
        current: Norm of the currents of a view, for 360 projection neurons; for others their mean square is the same (nA).
        kenyon_weight: Current that a spike adds at a synapse onto a Kenyon cell (nA).
        output_weight: The same at a synapse onto the output neuron that has learned nothing (nA).
        presentation_ms: Time that a view is shown for.
        silence_ms: Time for which the circuit is simulated after that.
        capacitance: Of the membrane of all neurons (nF).
        membrane_ms: Time constant of the membrane.
        threshold_mv: Potential above rest at which a neuron fires.
        refractory_ms: Time of rest after a spike.
        kenyon_synapse_ms: Time constant of the synapses onto Kenyon cells.
        output_synapse_ms: Time constant of those onto the output neuron.
        timing_ms: Time constant with which pairs of spikes leave tags.
        tag_ms: Time constant of tags.
        dopamine: Amount that is released at the end of a presentation that is learned.
        dopamine_ms: Time constant of its clearance.
        break_ties: Of rotations with equally many spikes that is more familiar which brings the output neuron less input: the sum of the
            weights of all spikes that reach it. Otherwise they are equally familiar.
    """

    name = "spiking-mushroom-body"
    paper = "Ardin et al. 2016"
    dtypes = {"wiring": torch.int64}  # noqa: RUF012
    takes_mask = True

    cells: int = whole(20_000, high=10_000_000)
    inputs: int = whole(10)
    current: float = number(4.0, low=0, unit="nA")
    kenyon_weight: float = number(0.0525, low=0, unit="nA")
    output_weight: float = number(0.6, low=0, unit="nA")
    presentation_ms: int = whole(40, high=1000, unit="ms")
    silence_ms: int = whole(40, high=1000, unit="ms")
    capacitance: float = number(0.2, low=1e-6, unit="nF")
    membrane_ms: float = number(20.0, low=0.01, unit="ms")
    threshold_mv: float = number(10.0, low=1e-6, unit="mV")
    refractory_ms: int = whole(2, low=0, high=1000, unit="ms")
    kenyon_synapse_ms: float = number(3.0, low=0.01, unit="ms")
    output_synapse_ms: float = number(8.0, low=0.01, unit="ms")
    timing_ms: float = number(15.0, low=0.01, unit="ms")
    tag_ms: float = number(40.0, low=0.01, unit="ms")
    dopamine: float = number(0.03, low=0)
    dopamine_ms: float = number(20.0, low=0.01, unit="ms")
    break_ties: bool = switch(True)

    @property
    def steps(self) -> int:
        """Steps that a view is simulated for."""
        return self.presentation_ms + self.silence_ms

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and every input of a Kenyon cell is a projection neuron, and no weight is negative."""
        super().check_learned(shape, learned)
        wiring, neurons = learned["wiring"], self._size(*shape)
        if not 0 <= int(wiring.min()) <= int(wiring.max()) < neurons:
            raise SettingError(
                f"{self.name}: cells are wired to neurons {int(wiring.min())} to {int(wiring.max())} of {neurons}"
            )
        if learned["synapses"].min() < 0:
            raise SettingError(f"{self.name}: a synapse has the weight {float(learned['synapses'].min()):g}, below 0")

    def spikes(self, views: Images) -> list[Int32[np.ndarray, "spikes 3"]]:
        """Spikes of the Kenyon cells at all rotations of each view: the rotation, the cell and the step (ms) of each spike."""
        check_scan(views, self.shape)
        rotations = np.arange(views.shape[2])
        return [self._spikes(view, rotations, self._learned["wiring"]) for view in views.cpu()]

    def _begin(self, height: int, width: int) -> Learned:
        wiring = different(self._size(height, width), self.cells, self.inputs, self._random())
        synapses = torch.full((self.cells,), self.output_weight, dtype=torch.float32)
        return {"wiring": self._on_device(wiring), "synapses": self._on_device(synapses)}

    def _add(self, learned: Learned, views: Images) -> Learned:
        synapses = learned["synapses"].cpu().numpy().copy()
        rule = Plasticity(
            timing=self.timing_ms,
            tag=self.tag_ms,
            dopamine=self.dopamine,
            release=self.presentation_ms,
            clearance=self.dopamine_ms,
        )
        few = 0
        for view in views.cpu():
            spikes = self._spikes(view, np.zeros(1, np.int64), learned["wiring"])
            few += len(np.unique(spikes[:, 1])) < MIN_CELLS
            learn(spikes, synapses, self.steps, self._neuron(self.output_synapse_ms), rule)
        if 2 * few > len(views):
            warn_of_silence()
        return {"wiring": learned["wiring"], "synapses": self._on_device(torch.from_numpy(synapses))}

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"wiring": (self.cells, min(self.inputs, self._size(height, width))), "synapses": (self.cells,)}

    def _scan(self, views: Images) -> Scans:
        return self._familiarity(views, np.arange(views.shape[2]))

    def _score(self, views: Images) -> Scores:
        return self._familiarity(views, np.zeros(1, np.int64))[:, 0]

    def _familiarity(self, views: Images, rotations: Int64[np.ndarray, " k"]) -> Float32[torch.Tensor, "n k"]:
        """Familiarity at some rotations of each view."""
        wiring, synapses = self._learned["wiring"], self._learned["synapses"].cpu().numpy()
        output = self._neuron(self.output_synapse_ms)
        scans = np.empty((len(views), len(rotations)), np.float32)
        block = max(1, NUMBERS // self._size(*views.shape[1:]))
        for view, scan in zip(views.cpu(), scans, strict=True):
            for start in range(0, len(scan), block):
                some = slice(start, min(start + block, len(scan)))
                counts, sums = np.empty(some.stop - start), np.empty(some.stop - start)
                spikes = self._spikes(view, rotations[some], wiring)
                respond(spikes, synapses, self.steps, output, counts, sums)
                scan[some] = -counts - (sums / (1 + sums) if self.break_ties else 0)  # from 0 to 1
        return self._on_device(torch.from_numpy(scans))

    def _spikes(
        self, view: Float32[torch.Tensor, "h w"], rotations: Int64[np.ndarray, " n"], wiring: torch.Tensor
    ) -> Int32[np.ndarray, "spikes 3"]:
        """Spikes of the Kenyon cells at some rotations: the index of the rotation, the cell and the step of each."""
        cell = self._neuron(self.kenyon_synapse_ms)
        currents, highest = train_tables(cell, self.kenyon_weight, self.presentation_ms, self.steps)
        trains = steps_to_spike(self._currents(view, rotations), cell, self.presentation_ms).T
        wired, parts = wiring.cpu().numpy(), {}

        def work(begin: int, end: int) -> None:
            some = fire(np.ascontiguousarray(trains[:, begin:end]), wired, currents, highest, cell)
            parts[begin] = some + np.array([begin, 0, 0], np.int32)

        in_threads(work, len(rotations), min(torch.get_num_threads(), len(rotations)))
        return np.concatenate([parts[begin] for begin in sorted(parts)])

    def _currents(
        self, view: Float32[torch.Tensor, "h w"], rotations: Int64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, "n neurons"]:
        """Current into each projection neuron (nA): the visible pixels at some rotations, scaled to a fixed mean square."""
        visible = torch.ones(view.shape, dtype=torch.bool) if self.mask is None else self.mask.visible.cpu()
        rows, columns = visible.nonzero().unbind(dim=1)
        turned = view[rows, (columns - torch.from_numpy(rotations)[:, None]) % view.shape[1]]  # as rolled to the right
        pixels = (turned if self.mask is None else self.mask.scaled_pixels(turned)).double().numpy()
        norm = np.sqrt(np.square(pixels).sum(axis=1, keepdims=True))
        scale = self.current * np.sqrt(pixels.shape[1] / NEURONS)
        return np.divide(scale * pixels, norm, out=np.zeros_like(pixels), where=norm > 0)

    def _neuron(self, synapse_ms: float) -> Neuron:
        """A neuron of the circuit with synapses of some time constant (ms)."""
        decay, synaptic_decay = float(np.exp(-1 / self.membrane_ms)), float(np.exp(-1 / synapse_ms))
        return Neuron(
            decay=decay,
            gain=(1 - decay) * self.membrane_ms / self.capacitance,
            threshold=self.threshold_mv,
            refractory=self.refractory_ms,
            synaptic_decay=synaptic_decay,
            synaptic_mean=synapse_ms * (1 - synaptic_decay),
        )


@cache  # once is enough
def warn_of_silence() -> None:
    """Log that hardly a Kenyon cell fires."""
    log.warning(
        "%s: at most of the learned views fewer than %d Kenyon cells fire, so headings cannot be told apart; give an encoding of values "
        "from 0 to 1, not normalised, or a larger kenyon_weight",
        SpikingMushroomBody.name,
        MIN_CELLS,
    )


@cache
def train_tables(
    neuron: Neuron, weight: float, presentation: int, steps: int
) -> tuple[Float64[np.ndarray, "trains steps"], Float64[np.ndarray, " trains"]]:
    """`synaptic_currents` and `peaks` of trains of spikes between neurons of one kind."""
    currents = synaptic_currents(neuron, weight, presentation, steps)
    return currents, peaks(currents, neuron)


def different(choices: int, sets: int, size: int, random: torch.Generator) -> Int64[torch.Tensor, "sets size"]:
    """Sets of `size` different whole numbers below `choices`, or of all of them, drawn with equal probabilities.

    Floyd's algorithm: in each step a number is drawn among one more than before, and the new one is taken where it is there already.
    """
    size = min(size, choices)
    chosen = torch.full((sets, size), -1)
    for k in range(size):
        newest = choices - size + k
        drawn = torch.randint(newest + 1, (sets,), generator=random)
        twice = (chosen == drawn[:, None]).any(dim=1)
        chosen[:, k] = torch.where(twice, newest, drawn)
    return chosen.sort(dim=1).values
