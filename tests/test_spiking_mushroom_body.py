"""The spiking mushroom body against a plain simulation of every neuron, and against the capacity that the paper derives."""

import math

import numpy as np
import pytest
import torch
from scenes import views
from scipy.stats import binom

from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.models import SpikingMushroomBody
from tussock.navigation.models.spikes import Plasticity, learn, respond
from tussock.navigation.models.spiking_mushroom_body import different, warn_of_silence
from tussock.world.errors import SettingError

# So that the few cells of a tiny circuit fire, and its output neuron too.
TINY = {"cells": 60, "inputs": 4, "kenyon_weight": 0.14, "output_weight": 0.9}


class Plain:
    """All neurons of a circuit, millisecond by millisecond, from the equations; with arrays of everything and no shortcut."""

    def __init__(self, model: SpikingMushroomBody, wiring: np.ndarray, neurons: int):
        self.model, self.neurons = model, neurons
        self.connected = np.zeros((len(wiring), neurons))
        for cell, inputs in enumerate(wiring):
            self.connected[cell, inputs] = model.kenyon_weight
        self.synapses = np.full(len(wiring), model.output_weight)

    def present(self, pixels: np.ndarray, learning: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Show an image. Returns the spikes (steps, cells) of the Kenyon cells and (steps,) of the output neuron."""
        model = self.model
        shown = model.current * math.sqrt(self.neurons / 360) * pixels / np.linalg.norm(pixels)
        layers = [Layer(model, self.neurons, 1.0), Layer(model, len(self.synapses), model.kenyon_synapse_ms)]
        output = Layer(model, 1, model.output_synapse_ms)
        projection, kenyon = np.zeros(self.neurons), np.zeros(len(self.synapses))
        all_kenyon, all_output = [], []
        tag, dopamine = np.zeros(len(self.synapses)), 0.0
        kenyon_at, output_at = np.full(len(self.synapses), -np.inf), -np.inf
        for step in range(model.presentation_ms + model.silence_ms):
            arriving = self.connected @ projection, self.synapses @ kenyon
            projection = layers[0].step(0.0, shown if step < model.presentation_ms else 0.0)
            kenyon = layers[1].step(arriving[0])
            fired = output.step(arriving[1])[0]
            all_kenyon.append(kenyon), all_output.append(fired)
            tag -= kenyon * math.exp(-(step - output_at) / model.timing_ms)
            if fired:
                tag -= np.exp(-(step - kenyon_at) / model.timing_ms)
                output_at = step
            kenyon_at[kenyon > 0] = step
            if learning:
                dopamine += model.dopamine * (step == model.presentation_ms)
                # Integral of dw/dt = tag dopamine over the step, by many small ones.
                times = (np.arange(2000) + 0.5) / 2000
                decay = np.exp(-times / model.tag_ms - times / model.dopamine_ms).mean()
                self.synapses = np.maximum(0, self.synapses + tag * dopamine * decay)
            tag *= math.exp(-1 / model.tag_ms)
            dopamine *= math.exp(-1 / model.dopamine_ms)
        if learning:  # what is left acts until it is gone
            times = (np.arange(1_000_000) + 0.5) / 1000
            decay = np.exp(-times / model.tag_ms - times / model.dopamine_ms).sum() / 1000
            self.synapses = np.maximum(0, self.synapses + tag * dopamine * decay)
        return np.array(all_kenyon), np.array(all_output)


class Layer:
    """Leaky integrate-and-fire neurons with exponential synapses."""

    def __init__(self, model: SpikingMushroomBody, size: int, synapse_ms: float):
        self.model, self.synapse_ms = model, synapse_ms
        self.potential, self.synapse, self.rest = np.full(size, -60.0), np.zeros(size), np.zeros(size)

    def step(self, arriving: np.ndarray | float, current: np.ndarray | float = 0.0) -> np.ndarray:
        """A millisecond. Returns 1.0 for each neuron that fires."""
        model = self.model
        self.synapse = self.synapse + arriving
        mean = self.synapse * self.synapse_ms * (1 - math.exp(-1 / self.synapse_ms))
        self.synapse = self.synapse * math.exp(-1 / self.synapse_ms)
        steady = -60.0 + (model.membrane_ms / model.capacitance) * (mean + current)
        awake = self.rest == 0
        self.potential = np.where(
            awake, steady + (self.potential - steady) * math.exp(-1 / model.membrane_ms), self.potential
        )
        self.rest = np.maximum(self.rest - 1, 0)
        fires = awake & (self.potential >= -60.0 + model.threshold_mv)
        self.potential = np.where(fires, -60.0, self.potential)
        self.rest = np.where(fires, model.refractory_ms, self.rest)
        return fires.astype(float)


def pictures(n: int, seed: int = 0) -> torch.Tensor:
    """Images of positive numbers."""
    return views(n, seed).abs()


def rotated(view: torch.Tensor) -> list[np.ndarray]:
    return [torch.roll(view, k, dims=-1).double().numpy().ravel() for k in range(view.shape[-1])]


@pytest.mark.parametrize(
    "changes",
    [{}, {"refractory_ms": 0, "capacitance": 0.15, "membrane_ms": 17.0}, {"presentation_ms": 25, "silence_ms": 70}],
)
def test_every_spike_and_weight_is_that_of_a_plain_simulation(changes):
    model = SpikingMushroomBody(**TINY, **changes).fit(pictures(3))
    plain = Plain(model, model.learned["wiring"].numpy(), 5 * 24)
    for picture in pictures(3):
        plain.present(picture.double().numpy().ravel(), learning=True)
    synapses = model.learned["synapses"].numpy()
    assert np.allclose(synapses, plain.synapses, atol=1e-5)
    assert 0.02 < (synapses < 0.9).mean() < 0.95  # some have learned, not all
    scan = model.scan(pictures(2, 5)).numpy()
    for picture, spikes, familiarity in zip(pictures(2, 5), model.spikes(pictures(2, 5)), scan, strict=True):
        for k, turned in enumerate(rotated(picture)):
            kenyon, output = plain.present(turned)
            expected = np.argwhere(kenyon.T > 0)
            assert spikes[spikes[:, 0] == k][:, 1:].tolist() == expected.tolist()
            total = float((kenyon[:-1] @ plain.synapses).sum())
            assert np.isclose(familiarity[k], -output.sum() - total / (1 + total), atol=1e-5)
        assert len(spikes)
    assert len(np.unique(np.floor(scan))) > 2  # the output neuron tells rotations apart


def test_without_a_rule_for_ties_familiarity_is_minus_the_spikes():
    model, other = (SpikingMushroomBody(**TINY, break_ties=each).fit(pictures(3)) for each in (False, True))
    spikes, familiarity = model.scan(pictures(4, 1)), other.scan(pictures(4, 1))
    assert torch.equal(spikes, spikes.round())
    assert (spikes - familiarity >= 0).all()
    assert (spikes - familiarity < 1).all()
    assert len(familiarity.unique()) > len(spikes.unique())


def test_a_view_is_as_familiar_in_any_unit():
    model = SpikingMushroomBody(**TINY).fit(pictures(3))
    assert torch.equal(model.scan(1000 * pictures(2, 1)), model.scan(pictures(2, 1)))
    assert torch.equal(
        SpikingMushroomBody(**TINY).fit(0.01 * pictures(3)).learned["synapses"], model.learned["synapses"]
    )


def test_it_learns_a_view_once_and_for_all():
    """One-shot learning: the synapses of the cells that fired are gone, and the view is the most familiar possible from then on."""
    model = SpikingMushroomBody().fit(pictures(1))
    (spikes,) = model.spikes(pictures(1))
    fired = np.unique(spikes[spikes[:, 0] == 0][:, 1])
    assert 50 < len(fired) < 3000
    assert (model.learned["synapses"][fired] < 1e-3).float().mean() > 0.9
    scan = model.scan(pictures(1))[0]
    assert scan[0] > -1
    assert scan[1:].max() < -3


def test_hidden_pixels_have_no_neurons():
    mask = FeatureMask(torch.arange(24).expand(5, 24) > 8)
    model = SpikingMushroomBody(**TINY).see(mask).fit(pictures(3))
    assert int(model.learned["wiring"].max()) < mask.count
    plain = Plain(model, model.learned["wiring"].numpy(), mask.count)
    plain.synapses = model.learned["synapses"].double().numpy()
    view = pictures(1, 5)
    counts = -torch.ceil(model.scan(view)[0])
    for k in range(24):
        turned = torch.roll(view, k, dims=-1)[:, mask.visible].double().numpy().ravel()
        assert plain.present(turned)[1].sum() == counts[k]


def test_views_without_light_cause_no_spike():
    model = SpikingMushroomBody(**TINY).fit(torch.zeros(2, 5, 24))
    assert (model.scan(torch.stack([torch.zeros(5, 24), -pictures(1)[0]])) == 0).all()
    assert (model.learned["synapses"] == model.output_weight).all()


def test_a_warning_says_once_that_hardly_a_cell_fires(caplog):
    warn_of_silence.cache_clear()
    for _ in range(2):
        SpikingMushroomBody().fit(views(3))  # of mean 0
    assert [record.message for record in caplog.records if "fewer than 10 Kenyon cells fire" in record.message] == [
        caplog.records[0].message
    ]
    caplog.clear()
    warn_of_silence.cache_clear()
    SpikingMushroomBody().fit(pictures(3))
    assert not caplog.records


@pytest.mark.parametrize(("choices", "size"), [(5, 2), (4, 4), (3, 7), (1, 1)])
def test_wiring_draws_every_set_equally_often(choices, size):
    drawn = different(choices, 6000, size, torch.Generator().manual_seed(1))
    size = min(size, choices)
    sets, counts = np.unique(drawn.numpy(), axis=0, return_counts=True)
    number = math.comb(choices, size)
    assert drawn.shape == (6000, size)
    assert len(sets) == number
    assert (np.diff(sets, axis=1) > 0).all()
    low, high = binom.ppf([1e-6, 1 - 1e-6], 6000, 1 / number)
    assert ((counts >= low) & (counts <= high)).all()


def test_capacity_is_that_of_the_paper():
    """m = ln(1 - P^(1 / (N p))) / ln(1 - p) = 376 random codes, each of a share p = 0.01 of N = 20,000 cells, can be learned
    until a share P = 0.01 of new ones brings the output neuron no spike, as if it had been learned."""
    cells, share, wrong = 20_000, 0.01, 0.01
    views_learned = math.log(1 - wrong ** (1 / (cells * share))) / math.log(1 - share)
    assert round(views_learned) == 376
    model = SpikingMushroomBody()
    output = model._neuron(model.output_synapse_ms)
    rule = Plasticity(timing=15.0, tag=40.0, dopamine=0.03, release=40, clearance=20.0)
    random, synapses = np.random.default_rng(0), np.full(cells, 0.6, np.float32)

    def codes(n: int) -> np.ndarray:
        """Spikes of n random codes, each cell of which fires twice during the presentation."""
        fire = np.argwhere(random.random((n, cells)) < share)
        first = random.integers(5, 20, len(fire))
        return np.stack(
            [np.repeat(fire[:, 0], 2), np.repeat(fire[:, 1], 2), np.stack([first, first + 12], axis=1).ravel()], axis=1
        ).astype(np.int32)

    for _ in range(376):
        code = codes(1)
        learn(code, synapses, model.steps, output, rule)
        counts, sums = np.zeros(1), np.zeros(1)
        respond(code, synapses, model.steps, output, counts, sums)
        assert counts[0] == 0  # it is familiar at once
    assert abs((synapses == 0.6).mean() - (1 - share) ** 376) < 0.003
    counts, sums = np.zeros(4000), np.zeros(4000)
    respond(codes(4000), synapses, model.steps, output, counts, sums)
    low, high = binom.ppf([0.0005, 0.9995], 4000, wrong) / 4000
    assert low <= (counts == 0).mean() <= high


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cells": 0}, "cells"),
        ({"silence_ms": 0}, "silence_ms"),
        ({"tag_ms": 0}, "tag_ms"),
        ({"break_ties": 2}, "break_ties"),
    ],
)
def test_invalid_parameters_are_refused(change, message):
    with pytest.raises(SettingError, match=message):
        SpikingMushroomBody(**change)
