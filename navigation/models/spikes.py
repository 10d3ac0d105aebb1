"""Compiled loops of the spiking mushroom body, in steps of 1 ms. Potentials are above rest (mV).

A leaky integrate-and-fire neuron with membrane time constant tau, resistance R and input I(t) has

    tau dV/dt = -V + R I          a spike where V reaches the threshold; then V is 0 for the refractory time

and its synapses turn a spike into a current that jumps by their weight and decays exponentially. Within a step the current is its mean,
and both equations are solved exactly. A spike arrives one step after it was fired.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int16

from tussock.render.compile import compiled

MARGIN = 1e-5  # by which rounding may change the sum of peaks, as a share of the threshold


class Neuron(NamedTuple):
    """A leaky integrate-and-fire neuron with exponential synapses.

    Attributes:
        decay: Share of the potential that is left after a step.
        gain: Potential that a unit of current adds in a step (mV).
        threshold: At which it fires (mV).
        refractory: Steps of rest after a spike.
        synaptic_decay: Share of the current of its synapses that is left after a step.
        synaptic_mean: Mean of this current over a step, as a share of that at the beginning.
    """

    decay: float
    gain: float
    threshold: float
    refractory: int
    synaptic_decay: float
    synaptic_mean: float


class Plasticity(NamedTuple):
    """How synapses onto the output neuron change, in three factors: pairs of spikes leave a tag, which dopamine turns into a change.

    Attributes:
        timing: Time constant of the pairing of two spikes (steps).
        tag: Time constant of a tag (steps).
        dopamine: Amount that is released.
        release: Step of the release.
        clearance: Time constant of dopamine (steps).
    """

    timing: float
    tag: float
    dopamine: float
    release: int
    clearance: float


def steps_to_spike(
    current: Float64[np.ndarray, "*shape"], neuron: Neuron, presentation: int
) -> Int16[np.ndarray, "*shape"]:
    """The step, from 0, in which a constant current makes a resting neuron fire; `presentation` where it does not within this many steps.

    From V(n) = R I (1 - decay^n), after n steps. With this number, the whole train of spikes is known.
    """
    steps = np.arange(1, presentation + 1)
    resistance = neuron.gain / (1 - neuron.decay)
    least = neuron.threshold / (
        resistance * (1 - neuron.decay**steps)
    )  # current with which the threshold is reached in `steps`
    return np.searchsorted(-least, -current).astype(np.int16)


def synaptic_currents(
    neuron: Neuron, weight: float, presentation: int, steps: int
) -> Float64[np.ndarray, "trains steps"]:
    """Current that each train of spikes brings a neuron of the same kind in each step.

    Row k is of the train whose first spike is in step k (see `steps_to_spike`); the last row is of no spike.
    """
    currents = np.zeros((presentation + 1, steps))
    for first in range(presentation):
        synapse = 0.0
        for step in range(steps):
            since = step - 1 - first  # the spike of the step before arrives
            if 0 <= since < presentation - first and since % (first + 1 + neuron.refractory) == 0:
                synapse += weight
            currents[first, step] = synapse * neuron.synaptic_mean
            synapse *= neuron.synaptic_decay
    return currents


def peaks(currents: Float64[np.ndarray, "trains steps"], neuron: Neuron) -> Float64[np.ndarray, " trains"]:
    """Highest potential to which each train of spikes alone would bring a neuron, if it had no threshold (mV)."""
    potential, highest = np.zeros(len(currents)), np.zeros(len(currents))
    for current in currents.T:
        potential = neuron.decay * potential + neuron.gain * current
        highest = np.maximum(highest, potential)
    return highest


@compiled
def fire(trains, wiring, currents, highest, cell_neuron):
    """Spikes of the Kenyon cells at each of n views.

    The potential of a cell is the sum of what its inputs add, until it fires. So it cannot fire where the sum of their peaks stays below
    the threshold: most cells are not simulated at all.

    Args:
        trains: (neurons, n) Train of each projection neuron, as a row of `currents`.
        wiring: (cells, inputs) Projection neurons of each cell.
        currents: (trains, steps) From `synaptic_currents`.
        highest: (trains,) From `peaks`.
        cell_neuron: `Neuron` that all cells are.

    Returns:
        (spikes, 3) View, cell and step of each spike, in the order of the cells.
    """
    n, steps = trains.shape[1], currents.shape[1]
    of_neurons = _peaks_of(trains, highest)
    limit = np.float32(cell_neuron.threshold * (1 - MARGIN))
    spikes, count = np.empty((1024, 3), np.int32), 0
    bound, current = np.empty(n, np.float32), np.empty(steps)
    for cell in range(len(wiring)):
        wired = wiring[cell]
        bound[:] = 0
        for neuron in wired:
            peak = of_neurons[neuron]
            for j in range(n):
                bound[j] += peak[j]
        for j in range(n):
            if bound[j] < limit:
                continue
            current[:] = 0
            for neuron in wired:
                brought = currents[trains[neuron, j]]
                for step in range(steps):
                    current[step] += brought[step]
            potential, resting = 0.0, 0
            for step in range(steps):
                if resting > 0:
                    resting -= 1
                    continue
                potential = cell_neuron.decay * potential + cell_neuron.gain * current[step]
                if potential >= cell_neuron.threshold:
                    if count == len(spikes):
                        spikes = np.concatenate((spikes, np.empty_like(spikes)))
                    spikes[count, 0], spikes[count, 1], spikes[count, 2] = j, cell, step
                    count += 1
                    potential, resting = 0.0, cell_neuron.refractory
    return spikes[:count].copy()


@compiled
def _peaks_of(trains, highest):
    """Peak of the train of each projection neuron (neurons, n)."""
    of_neurons = np.empty(trains.shape, np.float32)
    for neuron in range(len(trains)):
        for j in range(trains.shape[1]):
            of_neurons[neuron, j] = highest[trains[neuron, j]]
    return of_neurons


@compiled
def respond(spikes, synapses, steps, output, counts, inputs):
    """Let the output neuron respond to the spikes of the Kenyon cells at each of n views.

    Args:
        spikes: (spikes, 3) From `fire`.
        synapses: (cells,) Weights of the synapses onto the output neuron.
        steps: Steps that a view is simulated for.
        output: `Neuron` that the output neuron is.
        counts: (n,) Stored here: how often it fires.
        inputs: (n,) Stored here: the sum of the weights of all spikes that arrive.
    """
    n = len(counts)
    arriving = np.zeros((n, steps + 1))
    for k in range(len(spikes)):
        arriving[spikes[k, 0], spikes[k, 2] + 1] += synapses[spikes[k, 1]]
    for j in range(n):
        counts[j], inputs[j] = 0, 0
        synapse, potential, resting = 0.0, 0.0, 0
        for step in range(steps):
            inputs[j] += arriving[j, step]
            synapse += arriving[j, step]
            if resting > 0:
                resting -= 1
            else:
                potential = output.decay * potential + output.gain * output.synaptic_mean * synapse
            synapse *= output.synaptic_decay
            if potential >= output.threshold:
                counts[j] += 1
                potential, resting = 0.0, output.refractory


@compiled
def learn(spikes, synapses, steps, output, rule):
    """Change the synapses as one view does that is presented with dopamine. Returns how often the output neuron fires meanwhile.

    A pair of spikes on both sides of a synapse, in either order, adds -exp(-interval / timing) to its tag c. With d, the dopamine, the
    weight changes by dw/dt = c d, and is never negative. Tags and dopamine that are left at the end go on to act until they are gone.

    Args:
        spikes: (spikes, 3) From `fire`, of one view.
        synapses: (cells,) Weights, changed in place.
        steps: Steps that a view is simulated for.
        output: `Neuron` that the output neuron is.
        rule: `Plasticity`
    """
    owner = _numbers(spikes[:, 1])
    active = owner[-1] + 1 if len(owner) else 0
    weights, tags, fired = np.zeros(active), np.zeros(active), np.full(active, -np.inf)
    for k in range(len(spikes)):
        weights[owner[k]] = synapses[spikes[k, 1]]
    rate = 1 / rule.tag + 1 / rule.clearance  # at which the product of tag and dopamine decays
    in_step = (1 - np.exp(-rate)) / rate
    synapse, potential, resting, count, output_fired, dopamine = 0.0, 0.0, 0, 0, -np.inf, 0.0
    for step in range(steps):
        for k in range(len(spikes)):
            if spikes[k, 2] == step - 1:
                synapse += weights[owner[k]]
        if resting > 0:
            resting -= 1
        else:
            potential = output.decay * potential + output.gain * output.synaptic_mean * synapse
        synapse *= output.synaptic_decay
        for k in range(len(spikes)):
            if spikes[k, 2] == step:
                tags[owner[k]] -= np.exp(-(step - output_fired) / rule.timing)
        if potential >= output.threshold:
            potential, resting, output_fired = 0.0, output.refractory, step
            count += 1
            for k in range(active):
                tags[k] -= np.exp(-(step - fired[k]) / rule.timing)
        for k in range(len(spikes)):
            if spikes[k, 2] == step:
                fired[owner[k]] = step
        dopamine += rule.dopamine * (step == rule.release)
        rest = in_step if step < steps - 1 else 1 / rate
        for k in range(active):
            weights[k] = max(0.0, weights[k] + tags[k] * dopamine * rest)
            tags[k] *= np.exp(-1 / rule.tag)
        dopamine *= np.exp(-1 / rule.clearance)
    for k in range(len(spikes)):
        synapses[spikes[k, 1]] = weights[owner[k]]
    return count


@compiled
def _numbers(cells):
    """For each spike the number of its cell among those that fire, from the cells of all spikes in their order."""
    numbers = np.zeros(len(cells), np.int64)
    for k in range(1, len(cells)):
        numbers[k] = numbers[k - 1] + (cells[k] != cells[k - 1])
    return numbers
