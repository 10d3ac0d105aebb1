"""One conformance suite for all models, and each against an independent computation."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import TypeCheckError
from sklearn.neural_network import MLPClassifier

from navigation import rotation
from navigation.familiarity import FamiliarityModel, SnapshotModel
from navigation.models import MLP, MODELS, PerfectMemory, VisualCompass, make_model
from world.errors import InputError

REFUSED = (InputError, TypeCheckError)  # with type checking on, as here, a wrong rank does not reach our own check


def views(n: int, seed: int = 0, h: int = 5, w: int = 24) -> torch.Tensor:
    return torch.randn(n, h, w, generator=torch.Generator().manual_seed(seed))


@pytest.fixture(params=MODELS)
def model(request) -> FamiliarityModel:
    return make_model(request.param)


def test_is_a_familiarity_model(model):
    assert isinstance(model, FamiliarityModel)


def test_scanning_a_rolled_view_rolls_the_scan(model):
    scan = model.fit(views(10)).scan(views(4, seed=1))
    assert scan.shape == (4, 24)
    for k in (1, 7, 23):
        # Turned left by k already: what was rotation k is rotation 0.
        rolled = model.scan(torch.roll(views(4, seed=1), k, dims=-1))
        assert torch.allclose(rolled, torch.roll(scan, -k, dims=-1), atol=1e-4)


def test_a_learned_view_is_most_familiar_as_it_was_learned(model):
    learned = views(10)
    best = model.fit(learned).scan(learned).argmax(dim=1)
    if isinstance(model, VisualCompass):
        best = best[-1:]  # it keeps one
    if isinstance(model, MLP):
        # Its recipe teaches only that a view is more familiar than one turned by 60 degrees.
        scan = model.scan(learned)
        assert (scan[0::2, 0] > scan[0::2, -4]).all()
        assert (scan[1::2, 0] > scan[1::2, 4]).all()
        return
    assert (torch.minimum(best, 24 - best) <= 1).float().mean() >= 0.95


def test_the_same_seed_learns_the_same(model):
    again = make_model(next(name for name, make in MODELS.items() if type(make(0)) is type(model)))
    assert torch.equal(model.fit(views(10)).scan(views(3, 1)), again.fit(views(10)).scan(views(3, 1)))


def test_fitting_again_forgets(model):
    fresh = model.fit(views(6, 1)).scan(views(3, 2))
    assert torch.equal(model.fit(views(9)).fit(views(6, 1)).scan(views(3, 2)), fresh)


def test_one_view_no_view_and_a_constant_view(model):
    model.fit(views(1))
    assert model.scan(views(0)).shape == (0, 24)
    assert torch.isfinite(model.scan(torch.zeros(1, 5, 24))).all()
    assert torch.isfinite(model.fit(torch.zeros(2, 5, 24)).scan(views(1))).all()


def test_what_cannot_be_learned_or_scanned_is_refused(model):
    with pytest.raises(InputError, match="learned nothing"):
        model.scan(views(1))
    with pytest.raises(InputError, match="at least one view"):
        model.fit(views(0))
    broken = views(3)
    broken[1, 2, 3] = torch.nan
    with pytest.raises(InputError, match=r"view 1 .* not finite"):
        model.fit(broken)
    model.fit(views(3))
    with pytest.raises(InputError, match=r"view 1 .* not finite"):
        model.scan(broken)
    with pytest.raises(InputError, match=r"shape \(5, 24\), got \(5, 25\)"):
        model.scan(views(1, w=25))
    with pytest.raises(REFUSED):
        model.scan(views(1)[0])


def test_unknown_models_are_refused_with_the_known_ones():
    with pytest.raises(InputError, match="perfect-memory"):
        make_model("perfect-memry")


@given(st.integers(1, 8), st.integers(1, 3), st.integers(1, 6), st.integers(4, 20), st.integers(0, 999))
def test_perfect_memory_is_equation_1_at_every_rotation(m, n, h, w, seed):
    snapshots, queries = views(m, seed, h, w), views(n, seed + 1, h, w)
    snapshots[0] = torch.roll(queries[0], 2, dims=-1)  # one that matches to the last bit
    familiarity, match = PerfectMemory().fit(snapshots).match(queries)
    for view, scan, which in zip(queries.double(), familiarity, match, strict=True):
        for k in range(w):
            rms = (torch.roll(view, k, dims=-1) - snapshots).square().mean(dim=(1, 2)).sqrt()
            assert np.isclose(-scan[k], rms.min(), atol=2e-3)
            assert np.isclose(rms[which[k]], rms.min(), atol=2e-3)
    assert familiarity[0, 2] == 0
    assert familiarity[0].argmax() == 2


def test_perfect_memory_finds_the_brute_force_headings():
    snapshots, queries = views(40), views(25, 1)
    scan = PerfectMemory().fit(snapshots).scan(queries)
    brute = torch.stack(
        [
            (torch.roll(queries.double(), k, dims=-1)[:, None] - snapshots).square().mean(dim=(2, 3)).min(dim=1).values
            for k in range(24)
        ],
        dim=1,
    )
    assert torch.equal(scan.argmax(dim=1), brute.argmin(dim=1))
    assert torch.allclose(scan.max(dim=1).values.double(), -brute.min(dim=1).values.sqrt(), rtol=1e-6)


def test_snapshot_models_say_what_they_recognised():
    model = PerfectMemory()
    assert isinstance(model, SnapshotModel)
    learned = views(7)
    _, match = model.fit(learned).match(learned)
    assert match[:, 0].tolist() == list(range(7))


def test_many_snapshots_are_matched_in_chunks(monkeypatch):
    model, learned = PerfectMemory().fit(views(30)), views(30)
    scan, match = model.match(learned)
    monkeypatch.setattr(rotation, "CHUNK_BYTES", 4 * 8 * 24 * 30)  # four snapshots at once
    chunked_scan, chunked_match = model.match(learned)
    assert torch.allclose(chunked_scan, scan, atol=1e-4)
    assert torch.equal(chunked_match, match)
    assert match[:, 0].tolist() == list(range(30))


def test_the_compass_keeps_the_last_view():
    learned = views(5)
    compass = VisualCompass().fit(learned)
    assert torch.equal(compass.scan(learned), PerfectMemory().fit(learned[-1:]).scan(learned))
    assert (compass.match(learned)[1] == 4).all()


def test_mlp_scan_equals_the_network_on_rolled_views():
    model = MLP(iterations=20).fit(views(8))
    query = views(2, 3)
    weights = torch.fft.irfft(model._bank.spectra.permute(2, 1, 0), n=24).flatten(start_dim=1)
    for k in (0, 5, 23):
        hidden = torch.relu(torch.roll(query, k, dims=-1).flatten(start_dim=1) @ weights.T + model._bias)
        assert torch.allclose(model.scan(query)[:, k], hidden @ model._output[0] + model._output_bias, atol=1e-4)


def test_mlp_learns_as_scikit_learns_classifier_does():
    random = np.random.default_rng(0)
    pattern = torch.as_tensor(random.normal(size=(5, 24)), dtype=torch.float32)
    data = pattern + 1.5 * views(300, 4)
    train, test = data[:150], data[150:]
    ours = MLP(seed=1).fit(train)
    images, labels = ours.training_data(test)
    right = ((ours.scan(images)[:, 0] > 0) == (labels > 0.5)).float().mean().item()
    theirs = MLPClassifier(max_iter=600, random_state=1)
    train_images, train_labels = ours.training_data(train)
    theirs.fit(train_images.flatten(start_dim=1).numpy(), train_labels.numpy())
    their_right = theirs.score(images.flatten(start_dim=1).numpy(), labels.numpy())
    assert right > 0.8
    assert abs(right - their_right) < 0.06


def test_mlp_turns_its_negatives_right_and_left_in_turn():
    learned = views(4)
    images, labels = MLP().training_data(learned)
    assert labels.tolist() == [1] * 4 + [0] * 4
    turned = [
        torch.roll(view, 4 if i % 2 else -4, dims=-1) for i, view in enumerate(learned)
    ]  # 60 degrees of 24 columns
    assert torch.equal(images[4:], torch.stack(turned))
