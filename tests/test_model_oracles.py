"""Each model against a computation that shares nothing with it."""

from itertools import pairwise, product
from operator import mul

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scenes import views
from scipy.stats import chisquare, kstest
from sklearn.base import clone
from sklearn.metrics import classification_report
from sklearn.model_selection import GridSearchCV
from sklearn.neural_network import MLPClassifier
from small_models import small

from tussock.navigation.models import (
    MLP,
    MODELS,
    RBM,
    AdaBoost,
    Autoencoder,
    Chain,
    Infomax,
    MLPMixture,
    MLPRotation,
    MushroomBody,
    PerfectMemory,
    RandomHeadings,
    VisualCompass,
    spectra,
)
from tussock.navigation.models.adaboost import best_stump, haar_filters
from tussock.navigation.models.base import SequenceModel, SnapshotModel
from tussock.navigation.models.firing import largest_drives
from tussock.navigation.models.infomax import RATES, infomax_update
from tussock.navigation.models.mlp_rotation import jittered
from tussock.navigation.models.mushroom_body import ARDIN2016, largest, receptive_fields
from tussock.navigation.models.random import split_mix
from tussock.navigation.scan import scan_window
from tussock.world.errors import SettingError


def turned(images: torch.Tensor) -> np.ndarray:
    """Every view at every rotation, (n, w, h, w) in float64."""
    return np.stack([np.roll(images.double().numpy(), k, axis=-1) for k in range(images.shape[-1])], axis=1)


# Perfect memory, compass


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
    brute = ((turned(queries)[:, :, None] - snapshots.double().numpy()) ** 2).mean(axis=(3, 4)).min(axis=2)
    assert scan.argmax(dim=1).tolist() == brute.argmin(axis=1).tolist()
    assert np.allclose(scan.max(dim=1).values, -np.sqrt(brute.min(axis=1)), rtol=1e-6)


@given(st.integers(1, 90), st.integers(1, 3), st.integers(1, 4), st.integers(4, 12), st.integers(0, 999))
def test_whole_numbers_decide_between_rotations_and_snapshots_that_are_alike(m, n, h, w, seed):
    random = np.random.default_rng(seed)
    levels = random.integers(-2, 3, (m + n, h, w))  # so few that many differences are equal
    windows = random.random((n, w)) < 0.5
    windows[:, 0] = True
    snapshots, queries = torch.from_numpy(levels / 4096).float().split([m, n])
    familiarity, match = PerfectMemory().fit(snapshots + 1).match(queries + 1, windows)
    for v, (query, window) in enumerate(zip(levels[m:], windows, strict=True)):
        squared = np.array([np.square(np.roll(query, k, axis=1) - levels[:m]).sum(axis=(1, 2)) for k in range(w)])
        best = np.where(window, squared.min(axis=1), squared.max() + 1).argmin()
        assert torch.where(torch.from_numpy(window), familiarity[v], -torch.inf).argmax() == best
        for k in (best - 1, best, (best + 1) % w):
            assert match[v, k] == squared[k].argmin()
            assert familiarity[v, k] == -np.float32(np.sqrt(squared[k].min() / 4096**2 / (h * w)))


@pytest.mark.parametrize("make", [PerfectMemory, Chain])
def test_snapshot_models_give_the_view_that_they_recognised(make):
    assert isinstance(make(), SnapshotModel)
    _, match = make().fit(views(7)).match(views(7))
    assert match[:, 0].tolist() == list(range(7))


def test_snapshots_compared_in_blocks_give_the_same_matches(monkeypatch):
    learned = views(30)
    scan, match = PerfectMemory().fit(learned).match(learned)
    monkeypatch.setattr(spectra, "FILTERS", 4)
    monkeypatch.setattr(spectra, "VIEWS", 7)
    scan_of_blocks, match_of_blocks = PerfectMemory().fit(learned).match(learned)
    assert torch.allclose(scan_of_blocks, scan, atol=1e-4)
    assert torch.equal(match_of_blocks, match)
    assert match[:, 0].tolist() == list(range(30))


def test_the_compass_keeps_the_last_view():
    learned = views(5)
    compass = VisualCompass().fit(learned)
    assert torch.equal(compass.scan(learned), PerfectMemory().fit(learned[-1:]).scan(learned))
    assert (compass.match(learned)[1] == 4).all()


# Chain


def street(seed: int = 0, keys: int = 9, between: int = 8) -> torch.Tensor:
    """Views of a smooth walk: each turns slowly into the next of a few unlike images. Mean 0 and variance 1, as encodings make them:
    between two images contrast would fall, and all blends of low contrast would look alike.
    """
    corners = views(keys, seed, 5, 36)
    share = torch.linspace(0, 1, between + 1)[:-1, None, None]
    blends = [(1 - share) * one + share * other for one, other in pairwise(corners)]
    images = torch.cat(blends)
    images -= images.mean(dim=(1, 2), keepdim=True)
    return images / images.std(dim=(1, 2), keepdim=True)


ALL_ROUND = np.ones(36, dtype=bool)


def noisy(images: torch.Tensor) -> torch.Tensor:
    return images + 0.2 * views(len(images), 99, 5, 36)


def test_walking_along_a_chain_goes_from_its_beginning_to_its_end():
    snapshots = street()
    chain = Chain().fit(snapshots)
    assert isinstance(chain, SequenceModel)
    walk = chain.follow()
    assert walk.progress is None
    progress, last = [], len(snapshots) - 1
    for i, view in enumerate(noisy(snapshots)):
        familiarity, index = walk.look(view, ALL_ROUND)
        assert familiarity.shape == index.shape == (36,)
        assert familiarity.argmax() == 0
        assert abs(int(index[0]) - i) <= 1
        assert walk.progress == index[0] / last
        progress.append(walk.progress)
    assert progress[0] <= 1 / last
    assert progress[-1] >= 1 - 1 / last
    assert np.abs(np.array(progress) - np.linspace(0, 1, len(progress))).max() <= 1 / last + 1e-9


def test_a_chain_compares_only_the_window():
    snapshots = street()
    n = len(snapshots)
    walk = Chain(window=0.1).fit(snapshots).follow()
    for i, view in enumerate(noisy(snapshots)):
        before = walk.active
        _, index = walk.look(view, ALL_ROUND)
        if i > 0:
            # At rotations that resemble nothing the nearest would lie anywhere.
            assert index.min() >= before - 0.05 * n - 1
            assert index.max() <= before + 0.1 * n + 1


def test_a_chain_compares_as_perfect_memory_of_its_window():
    snapshots = street()
    n = len(snapshots)
    walk = Chain(window=0.1).fit(snapshots).follow()
    walk.look(snapshots[30], ALL_ROUND)
    familiarity, index = walk.look(noisy(snapshots)[31], ALL_ROUND)
    first, last = 30 - round(0.1 * n / 2), 30 + round(0.1 * n)
    brute = turned(noisy(snapshots)[31:32])[0][:, None] - snapshots[first : last + 1].double().numpy()
    rms = np.sqrt((brute**2).mean(axis=(2, 3)))
    assert np.allclose(-familiarity, rms.min(axis=1), atol=1e-4)
    assert (index - first).tolist() == rms.argmin(axis=1).tolist()


@pytest.mark.parametrize(("start", "there"), [(4, 60), (60, 4), (30, 63)])
def test_a_chain_put_elsewhere_finds_its_progress_again(start, there):
    snapshots = street()
    walk = Chain().fit(snapshots).follow()
    walk.look(snapshots[start], ALL_ROUND)
    assert walk.progress == start / 63
    for view in noisy(snapshots)[there : there + 3]:
        walk.look(view, ALL_ROUND)
    assert abs(walk.active - min(there + 2, 63)) <= 1


def test_a_chain_without_a_match_is_lost_until_something_matches():
    snapshots = street()
    walk = Chain().fit(snapshots).follow()
    walk.look(snapshots[20], ALL_ROUND)
    walk.look(3 * views(1, 5, 5, 36)[0], ALL_ROUND)
    assert walk.progress is None
    walk.look(snapshots[50], ALL_ROUND)
    assert walk.progress == 50 / 63


def test_of_two_positions_that_look_alike_a_chain_takes_the_near_one():
    snapshots = street()
    snapshots[45:50] = snapshots[10:15]
    chain = Chain().fit(snapshots)
    walk = chain.follow()
    walk.active = 46
    walk.look(snapshots[47], ALL_ROUND)
    assert walk.active == 47
    walk.active = 11
    walk.look(snapshots[47], ALL_ROUND)
    assert walk.active == 12
    assert PerfectMemory().fit(snapshots).match(snapshots[47:48])[1][0, 0] == 12


def test_a_chain_follows_only_rotations_it_is_allowed():
    snapshots = street()
    walk = Chain().fit(snapshots).follow()
    walk.look(snapshots[20].roll(-9, dims=-1), ALL_ROUND)
    assert walk.active == 20  # which is rotation 9
    narrow = scan_window(36, np.pi / 3)
    walk = Chain().fit(snapshots).follow()
    walk.look(snapshots[20].roll(-9, dims=-1), narrow)
    assert walk.active != 20
    with pytest.raises(SettingError, match="shape"):
        walk.look(views(1)[0], np.ones(24, dtype=bool))


def test_walks_along_one_chain_are_independent():
    chain = Chain().fit(street())
    one, other = chain.follow(), chain.follow()
    one.look(street()[5], ALL_ROUND)
    other.look(street()[50], ALL_ROUND)
    assert (one.active, other.active) == (5, 50)


# MLP


def pattern_in_noise() -> tuple[torch.Tensor, torch.Tensor]:
    data = views(1, 1)[0] + 1.5 * views(300, 4)
    return data[:150], data[150:]


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("activation", ["identity", "logistic", "tanh", "relu"])
@pytest.mark.parametrize("solver", ["lbfgs", "sgd", "adam"])
def test_mlp_learns_like_the_classifier_of_scikit_learn(solver, activation):
    train, test = pattern_in_noise()
    settings = {"solver": solver, "activation": activation, "hidden_layer_sizes": (20,), "max_iter": 150}
    ours, theirs = MLP(seed=1, **settings), MLPClassifier(random_state=1, **settings)
    ours.fit(train)
    theirs.fit(*(each.flatten(start_dim=1).squeeze(1).numpy() for each in labelled(ours, train)))
    images, labels = ours.training_data(test)
    right = ours.score(images.numpy(), labels.numpy())
    assert right > 0.6
    assert abs(right - theirs.score(images.flatten(start_dim=1).numpy(), labels.numpy())) < 0.06
    # The scan's first column is the output of the same network.
    assert ((ours.scan(images)[:, 0] > 0).numpy() == ours.predict(images.numpy())).all()


def labelled(model: MLP, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    made, labels = model.training_data(images)
    return made, labels[:, None]


@pytest.mark.parametrize("activation", ["identity", "logistic", "tanh", "relu"])
def test_mlp_scan_equals_the_network_on_rolled_views(activation):
    model = MLP(max_iter=20, hidden_layer_sizes=(12, 7), activation=activation).fit(views(8))
    act = {
        "identity": lambda x: x,
        "logistic": lambda x: 1 / (1 + np.exp(-x)),
        "tanh": np.tanh,
        "relu": lambda x: np.maximum(x, 0),
    }[activation]
    layer = {key: tensor.double().numpy() for key, tensor in model.learned.items()}
    x = turned(views(3, 3)).reshape(3, 24, -1)
    for k in range(2):
        x = act(x @ layer[f"weights{k}"].T + layer[f"biases{k}"])
    logits = (x @ layer["weights2"].T + layer["biases2"])[..., 0]
    assert np.allclose(model.scan(views(3, 3)), logits, atol=1e-4)
    assert np.allclose(model.decision_function(views(3, 3)), logits[:, 0], atol=1e-4)


def test_mlp_turns_its_negatives_right_and_left_alternately():
    learned = views(4)
    images, labels = MLP().training_data(learned)
    assert labels.tolist() == [1] * 4 + [0] * 4
    turns = [-4, 4, -4, 4]  # 60 degrees of 24 columns
    turned_views = [torch.roll(view, k, dims=-1) for view, k in zip(learned, turns, strict=True)]
    assert torch.equal(images[4:], torch.stack(turned_views))


@pytest.mark.parametrize("shape", [(60, 20), (60, 4, 5)])
def test_mlp_works_like_the_estimators_of_scikit_learn(shape):
    x = np.random.default_rng(0).normal(size=shape)
    y = np.where(x.reshape(60, -1)[:, 0] > 0, 7, 3)
    model = MLP(max_iter=60, hidden_layer_sizes=(10,), learning_rate_init=0.01).fit(x, y)
    assert model.classes_.tolist() == [3, 7]
    chances = model.predict_proba(x)
    assert np.allclose(chances.sum(axis=1), 1)
    assert ((chances >= 0) & (chances <= 1)).all()
    assert (model.classes_[chances.argmax(axis=1)] == model.predict(x)).all()
    assert model.score(x, y) > 0.9
    report = classification_report(y, model.predict(x), output_dict=True)
    assert report["7"]["support"] == (y == 7).sum()

    twin = clone(model)
    assert twin.get_params() == model.get_params()
    assert twin.shape is None
    assert (twin.fit(x, y).predict(x) == model.predict(x)).all()
    assert twin.set_params(alpha=0.5).alpha == 0.5
    with pytest.raises(ValueError, match="parameter"):
        twin.set_params(beta=1)
    with pytest.raises(SettingError, match="alpha is -1"):
        twin.set_params(alpha=-1.0)
    assert twin.alpha == 0.5

    search = GridSearchCV(MLP(max_iter=20), {"hidden_layer_sizes": [(5,), (10,)], "solver": ["adam", "lbfgs"]}, cv=3)
    search.fit(x, y)
    assert set(search.best_params_) == {"hidden_layer_sizes", "solver"}
    assert search.best_score_ > 0.5
    assert set(search.predict(x)) <= {3, 7}


@pytest.mark.parametrize(
    "labels", [["a", "b"] * 5, [0] * 10, [0, 1, 2, 0, 1] * 2, [0, 1] * 4, [float("nan"), 1.0] * 5], ids=str
)
def test_mlp_refuses_labels_that_are_not_two_numbers(labels):
    with pytest.raises(SettingError, match="label"):
        MLP(max_iter=2).fit(views(10), labels)


# RBM


def test_rbm_familiarity_is_minus_the_free_energy_summed_over_all_hidden_states():
    for scale in (1.0, 0.5):
        model = RBM(units=6, epochs=100, scale=scale).fit(views(20))
        w, b, c = (model.learned[key].double().numpy() for key in ("weights", "visible", "hidden"))
        states = np.array(list(product([0.0, 1.0], repeat=6)))
        v = scale * turned(views(3, 1)).reshape(3, 24, 1, -1)
        energy = ((v - b.ravel()) ** 2).sum(axis=-1) / 2 - states @ c - (v @ w.reshape(6, -1).T @ states.T)[:, :, 0]
        assert np.allclose(model.scan(views(3, 1)), np.log(np.exp(-energy).sum(axis=2)), atol=1e-3)


def test_rbm_reconstructs_better_the_longer_it_learns():
    def error(epochs: int) -> float:
        model = RBM(units=50, epochs=epochs).fit(views(20))
        w, b, c = (model.learned[key].numpy() for key in ("weights", "visible", "hidden"))
        v, w = views(20).flatten(start_dim=1).numpy(), w.reshape(50, -1)
        chance = 1 / (1 + np.exp(-(v @ w.T + c)))
        return float(np.mean((v - b.ravel() - chance @ w) ** 2))

    errors = [error(epochs) for epochs in (1, 200, 1000)]
    assert errors[0] > 1.2 * errors[1]
    assert errors[1] > 1.2 * errors[2]


# Autoencoder


def test_autoencoder_scan_is_minus_the_rms_of_its_reconstruction():
    model = Autoencoder(units=15).fit(views(20))
    w, b, c = (model.learned[key].double().numpy() for key in ("weights", "visible", "hidden"))
    w, v = w.reshape(15, -1), turned(views(3, 1)).reshape(3, 24, -1)
    rebuilt = np.tanh(v @ w.T + c) @ w + b.ravel()
    assert np.allclose(model.scan(views(3, 1)), -np.sqrt(((v - rebuilt) ** 2).mean(axis=-1)), atol=1e-5)


def test_autoencoder_reconstructs_what_it_learned_better_than_what_it_did_not():
    model = Autoencoder(epochs=200).fit(views(20))
    assert model.scan(views(20))[:, 0].min() > model.scan(views(20, 1))[:, 0].max()


# Infomax


@given(st.integers(1, 6), st.integers(1, 9), st.floats(0, 0.1), st.integers(0, 999))
def test_infomax_learns_by_its_formula(units, inputs, rate, seed):
    random = np.random.default_rng(seed)
    weights, view = random.normal(size=(units, inputs)), random.normal(size=inputs)
    learned = torch.tensor(weights, dtype=torch.float32)
    infomax_update(learned, torch.tensor(view, dtype=torch.float32), rate)
    expected = weights.copy()
    u = [sum(weights[i, j] * view[j] for j in range(inputs)) for i in range(units)]
    for i in range(units):
        for j in range(inputs):
            back = sum(u[k] * weights[k, j] for k in range(units))
            expected[i, j] += rate * (weights[i, j] - (np.tanh(u[i]) + u[i]) * back)
    assert np.allclose(learned, expected, atol=1e-4)


def test_infomax_scan_is_minus_the_summed_activity():
    model = Infomax(units=30).fit(views(6))
    assert model.learned["weights"].shape == (30, 5, 24)
    activity = turned(views(3, 1)).reshape(3, 24, -1) @ model.learned["weights"].double().reshape(30, -1).numpy().T
    assert np.allclose(model.scan(views(3, 1)), -np.abs(activity).sum(axis=-1), rtol=1e-4)


@pytest.mark.parametrize("rate", [*RATES, 1e-4])
def test_infomax_passes_the_views_in_order_at_its_rate(rate):
    by_hand = Infomax()._begin(5, 24)["weights"].flatten(start_dim=1)
    assert torch.allclose(by_hand.mean(dim=1), torch.zeros(120), atol=1e-6)
    assert torch.allclose(by_hand.std(dim=1), torch.ones(120), atol=1e-5)
    eta = {"z-scored": 1 / 120**2, "unit-range": 0.97 / 120**2, "baddeley": 0.01 / 120}.get(rate, rate)
    for view in [*views(4), *views(4)]:
        infomax_update(by_hand, view.flatten(), eta)
    learned = Infomax(rate=rate, traversals=2).fit(views(4)).learned["weights"]
    assert torch.allclose(learned.flatten(start_dim=1), by_hand, rtol=1e-5, atol=1e-6)


def test_infomax_at_too_high_a_rate_is_refused():
    with pytest.raises(SettingError, match=r"infomax: .*lower rate"):
        Infomax(rate=1.0).fit(views(30))


# Mushroom body


@pytest.mark.parametrize(("columns", "rows", "h", "w"), [(6, 2, 4, 12), (9, 3, 5, 24), (36, 10, 4, 30), (5, 1, 1, 7)])
def test_receptive_fields_are_averages_that_together_see_every_pixel_alike(columns, rows, h, w):
    fields = receptive_fields(columns, rows, h, w).double().numpy()
    assert fields.shape == (columns * rows, h, w)
    assert (fields >= 0).all()
    assert np.allclose(fields.sum(axis=(1, 2)), 1)
    assert np.allclose(fields.sum(axis=0), columns * rows / (h * w))
    view = np.random.default_rng(0).normal(size=(h, w))
    assert np.allclose((fields * view).sum(axis=(1, 2)), field_average(view, columns, rows).ravel(), atol=1e-5)


def field_average(view: np.ndarray, columns: int, rows: int) -> np.ndarray:
    """Averages (rows, columns): each pixel is cut into rows x columns equal pieces, which fields hold whole."""
    h, w = view.shape
    pieces = view.repeat(rows, axis=0).repeat(columns, axis=1)
    averages = np.empty((rows, columns))
    for r in range(rows):
        for c in range(columns):
            averages[r, c] = pieces[r * h : (r + 1) * h, c * w : (c + 1) * w].mean()
    return averages


def ring(width: int, deviation_deg: float) -> np.ndarray:
    """A Gaussian over the rotations about rotation 0, of sum 1."""
    away = np.minimum(np.arange(width), width - np.arange(width)) * 360 / width
    weights = np.exp(-0.5 * (away / deviation_deg) ** 2)
    return weights / weights.sum()


def projection_neurons(
    view: np.ndarray, columns: int, rows: int, adaptation: float, overlap_deg: float = 0.0
) -> np.ndarray:
    """What they send, (rotations, neurons): averages less their mean over all rotations, by a power of their contrast over these.

    A field that reaches into its neighbours averages what the field alone does at neighbouring rotations.
    """
    averages = np.stack([field_average(np.roll(view, k, axis=1), columns, rows).ravel() for k in range(view.shape[1])])
    if overlap_deg:
        reach = ring(view.shape[1], overlap_deg)
        reach[reach < reach.max() * np.exp(-4.5)] = 0  # it ends at three standard deviations
        reach /= reach.sum()
        averages = np.sum([share * np.roll(averages, k, axis=0) for k, share in enumerate(reach)], axis=0)
    contrast = averages.std(axis=0)
    return (averages - averages.mean(axis=0)) / (contrast + 0.02 * contrast.max()) ** adaptation


@pytest.mark.parametrize(("columns", "rows", "h", "w"), [(12, 2, 4, 24), (9, 3, 5, 24)])
@pytest.mark.parametrize(("adaptation", "overlap_deg", "outputs"), [(0.0, 0.0, 1), (0.5, 0.0, 1), (0.25, 22.0, 3)])
@pytest.mark.parametrize("learning", ["depression", "contrast"])
def test_mushroom_body_scan_is_what_its_cells_do_at_each_rotation(
    columns, rows, h, w, adaptation, overlap_deg, outputs, learning
):
    model = MushroomBody(
        columns=columns, rows=rows, cells=200, inputs=6, active=0.05, depression=0.5, adaptation=adaptation,
        overlap_deg=overlap_deg, outputs=outputs, learning=learning, smoothing_deg=0.0,
    )  # fmt: skip
    model.fit(views(8, 0, h, w))
    wiring, synapses = model.learned["wiring"].numpy(), model.learned["synapses"].numpy()
    assert all(len(set(cell)) == 6 for cell in wiring)
    assert synapses.shape == (outputs, 200)
    assert len(np.unique(synapses)) > 2
    for view, scan in zip(views(3, 1, h, w).double().numpy(), model.scan(views(3, 1, h, w)), strict=True):
        for sent, familiarity in zip(
            projection_neurons(view, columns, rows, adaptation, overlap_deg), scan, strict=True
        ):
            firing = np.argsort(sent[wiring].sum(axis=1))[-10:]
            assert np.isclose(familiarity, -min(each[firing].mean() for each in synapses), atol=1e-4)


@given(st.integers(1, 200), st.integers(1, 9), st.integers(1, 70), st.integers(0, 999), st.data())
def test_cells_that_fire_are_those_of_a_stable_sort(cells, inputs, n, seed, data):
    count = data.draw(st.integers(1, cells))
    random = np.random.default_rng(seed)
    projections = random.integers(-2, 3, (12, n)).astype(np.float32)  # small whole numbers, so that many cells tie
    wiring, firing = random.integers(0, 12, (cells, inputs)), np.empty((n, count), dtype=np.int64)
    largest_drives(projections, wiring, firing)
    drives = projections[wiring].sum(axis=1)
    assert np.array_equal(firing, (-drives).argsort(axis=0, kind="stable")[:count].T)
    assert np.array_equal(firing, largest(torch.from_numpy(drives), count))


def test_mushroom_body_averages_over_neighbouring_rotations():
    learned, seen = views(8), views(3, 1)
    sharp = MushroomBody(smoothing_deg=0.0, cells=500, rate=1.0).fit(learned).scan(seen).double()
    away = np.minimum(np.arange(24), 24 - np.arange(24)) * 15.0
    gaussian = np.exp(-0.5 * (away / 20) ** 2)
    expected = sum(weight * torch.roll(sharp, k, dims=1) for k, weight in enumerate(gaussian / gaussian.sum()))
    assert torch.allclose(
        MushroomBody(smoothing_deg=20.0, cells=500, rate=1.0).fit(learned).scan(seen).double(), expected, atol=1e-5
    )


@pytest.mark.parametrize("depression", [1.0, 0.25])
def test_mushroom_body_depresses_the_synapses_of_the_cells_that_fire(depression):
    view = views(1)
    model = MushroomBody(
        **(ARDIN2016 | {"cells": 300, "inputs": 5, "active": 0.04}),
        smoothing_deg=0.0, columns=12, rows=5, depression=depression,
    ).fit(view)  # fmt: skip
    sent = projection_neurons(view[0].double().numpy(), 12, 5, model.adaptation)[0]
    firing = np.argsort(sent[model.learned["wiring"].numpy()].sum(axis=1))[-12:]
    expected = np.ones(300)
    expected[firing] = 1 - depression
    assert np.allclose(model.learned["synapses"][0], expected)
    assert np.isclose(model.scan(view)[0, 0], -(1 - depression))
    again = model.partial_fit(view)
    assert np.allclose(again.learned["synapses"][0], np.where(expected < 1, (1 - depression) ** 2, 1))


def test_outputs_of_a_mushroom_body_learn_one_view_each_in_turn():
    model = MushroomBody(**(ARDIN2016 | {"cells": 300, "outputs": 3}), smoothing_deg=0.0)
    model.fit(views(2)).partial_fit(views(3)[2:]).partial_fit(views(4)[3:])
    for output, learned in enumerate((views(4)[[0, 3]], views(2)[1:], views(3)[2:])):
        alone = MushroomBody(**(ARDIN2016 | {"cells": 300}), smoothing_deg=0.0).fit(learned)
        assert torch.equal(model.learned["synapses"][output], alone.learned["synapses"][0])


@pytest.mark.parametrize("traversals", [1, 2])
def test_mushroom_body_learns_by_contrast_as_its_formula_says(traversals):
    parameters = {
        "columns": 12,
        "rows": 5,
        "cells": 300,
        "inputs": 5,
        "active": 0.04,
        "adaptation": 0.5,
        "overlap_deg": 0.0,
    }
    model = MushroomBody(**parameters, outputs=2, rate=30.0, target_deg=20.0, traversals=traversals).fit(views(3))
    wiring, synapses = model.learned["wiring"].numpy(), np.ones((2, 300))
    for _ in range(traversals):
        for place, view in enumerate(views(3).double().numpy()):
            sent = projection_neurons(view, 12, 5, 0.5)
            firing = [np.argsort(-each[wiring].sum(axis=1), kind="stable")[:12] for each in sent]
            familiarity = np.array([[-synapses[output, cells].mean() for cells in firing] for output in (0, 1)])
            shares = np.exp(familiarity) / np.exp(familiarity).sum()
            for output, turn in product((0, 1), range(24)):
                wanted = ring(24, 20.0)[turn] if output == place % 2 else 0.0
                synapses[output, firing[turn]] += 30.0 * (shares[output, turn] - wanted)
    assert np.ptp(synapses) > 5
    assert np.allclose(model.learned["synapses"], synapses, atol=1e-3)


def test_what_a_mushroom_body_learns_by_contrast_it_keeps_apart_from_its_rotations():
    learned = views(20)
    scans = {
        learning: MushroomBody(outputs=1, learning=learning, cells=1000).fit(learned).scan(learned)
        for learning in ("contrast", "depression")
    }
    margins = {name: (scan[:, 0] - scan[:, 4:-3].amax(dim=1)) / scan.std() for name, scan in scans.items()}
    assert margins["contrast"].min() > 0
    assert margins["contrast"].mean() > margins["depression"].mean()


@pytest.mark.parametrize(("columns", "rows", "cells"), [(3000, 1000, 20_000), (3000, 1000, 1), (2, 20, 2**33)])
def test_a_mushroom_body_that_is_too_large_is_refused_before_memory_is_taken(columns, rows, cells, monkeypatch):
    monkeypatch.setattr(torch, "rand", lambda *_, **__: pytest.fail("it draws its wiring"))
    with pytest.raises(SettingError, match=rf"mushroom-body.*{columns}.*give fewer|mushroom-body.*{cells}.*give fewer"):
        MushroomBody(columns=columns, rows=rows, cells=cells).fit(views(1, 0, 25, 90))


# AdaBoost


@pytest.mark.parametrize(("h", "w"), [(1, 4), (1, 24), (2, 4), (2, 24), (3, 5), (6, 36)])
def test_haar_filters_sum_to_0_and_have_norm_1(h, w):
    filters = haar_filters(300, h, w, np.random.default_rng(0)).double()
    assert filters.shape == (300, h, w)
    assert torch.allclose(filters.sum(dim=(1, 2)), torch.zeros(300, dtype=torch.float64), atol=1e-5)
    assert torch.allclose(filters.square().sum(dim=(1, 2)), torch.ones(300, dtype=torch.float64), atol=1e-5)
    assert len({each.numpy().tobytes() for each in filters}) > 5


@pytest.mark.parametrize("seed", range(5))
def test_the_best_stump_is_the_one_that_trying_all_finds(seed):
    random = np.random.default_rng(seed)
    bins = random.integers(0, 64, (8, 30)).astype(np.uint8)
    labels, weights = random.choice([-1.0, 1.0], 30), random.random(30)
    weights /= weights.sum()

    def error(filter: int, cut: int, sign: float) -> float:
        return float(weights[np.where(bins[filter] > cut, sign, -sign) != labels].sum())

    stump = best_stump(bins, weights * labels)
    assert np.isclose(stump.error, min(error(*each) for each in product(range(8), range(63), (-1.0, 1.0))))
    assert np.isclose(stump.error, error(stump.filter, stump.bin, stump.sign))


def test_adaboost_keeps_freund_and_schapires_bound():
    # One pass: what it is trained on is then the views and their turned copies, and nothing it found itself.
    learned = views(60)
    model = AdaBoost(pool=150, features=80, passes=1).fit(learned)
    samples = torch.cat([learned, learned.roll(3, dims=-1), learned.roll(-3, dims=-1)])  # 45 degrees of 24 columns
    labels = np.repeat([1.0, -1.0], [60, 120])
    weights = np.where(labels > 0, 0.5 / 60, 0.5 / 120)
    first = weights.copy()
    filters, cuts, votes = (model.learned[key].double().numpy() for key in ("filters", "cuts", "votes"))
    responses = np.einsum("mhw,nhw->mn", filters, samples.double().numpy())
    answers = np.where(
        responses > cuts[:, None] + 1e-5, 1.0, -1.0
    )  # a cut is one sample's response, which lies below it
    bound = 1.0
    for stump, vote in zip(answers, votes, strict=True):
        error = weights[stump * np.sign(vote) != labels].sum()
        assert error < 0.5
        assert np.isclose(abs(vote), 0.5 * np.log((1 - error) / error), atol=1e-3)
        bound *= 2 * np.sqrt(error * (1 - error))
        weights *= np.exp(-vote * stump * labels)
        weights /= weights.sum()
    strong = votes @ answers
    assert first[np.sign(strong) != labels].sum() <= bound < 0.2
    # Views it has not seen, as theirs are no response that is a cut.
    responses = np.einsum("mhw,nkhw->nkm", filters, turned(views(5, 1)))
    assert np.allclose(model.scan(views(5, 1)), np.where(responses > cuts, 1.0, -1.0) @ votes, atol=1e-4)


# Networks trained on all rotations


@pytest.mark.parametrize(("make", "w"), [(MLPRotation, 24), (MLPRotation, 25), (MLPMixture, 24)])
def test_a_network_trained_on_one_view_peaks_where_it_was_learned(make, w):
    one = views(1, 0, 5, w)
    scan = make(steps=150).fit(one).scan(one)[0]
    assert scan.argmax() == 0
    # The target is as high on the left as on the right, and falls away.
    chance = torch.softmax(scan, dim=0)
    assert torch.isclose(chance[1], chance[-1], atol=0.05)
    assert chance[[2, 3, -2, -3]].max() < chance[[1, -1]].min() + 1e-3


def test_the_target_is_as_wide_as_target_deg():
    one = views(1, 0, 5, 36)
    scan = MLPRotation(target_deg=15.0, steps=400, noise=0.0, weight_decay=0.0).fit(one).scan(one)[0]
    away = np.minimum(np.arange(36), 36 - np.arange(36)) * 10
    target = np.exp(-0.5 * (away / 15) ** 2)
    assert np.allclose(torch.softmax(scan, dim=0), target / target.sum(), atol=0.02)


def test_a_mixture_cuts_the_route_where_views_change():
    # Twenty views that stay, and twenty that each differ by 1 from the one before.
    level = torch.cat([torch.zeros(20), torch.arange(20) + 1.0])
    route = level[:, None, None].expand(40, 5, 24).contiguous()
    segment = MLPMixture(segments=4).segment_of(route).tolist()
    assert segment == [0] * 20 + [0] * 4 + [1] * 5 + [2] * 5 + [3] * 6
    # Backwards the fast half comes first.
    assert MLPMixture(segments=4).segment_of(route.flip(0)).tolist() == [0] * 5 + [1] * 5 + [2] * 5 + [3] * 25


@given(st.integers(1, 30), st.integers(1, 12), st.integers(0, 99))
def test_segments_are_numbered_without_gaps_in_the_order_of_the_route(n, segments, seed):
    segment = MLPMixture(segments=segments).segment_of(views(n, seed))
    assert len(segment) == n
    assert segment[0] == 0
    assert set(torch.diff(segment).tolist()) <= {0, 1}
    assert segment[-1] < segments


def test_a_mixture_names_its_active_expert():
    route = views(12)
    model = MLPMixture(segments=3, steps=150).fit(route)
    active = model.active_expert(route)
    assert active.shape == (12, 24)
    assert set(active.flatten().tolist()) <= {0, 1, 2}
    assert (active[:, 0] == model.segment_of(route)).float().mean() >= 0.9
    # The mixture's odds are the sum of its networks'.
    w, b, out = (model.learned[key].double().numpy() for key in ("weights", "biases", "output"))
    activity = np.maximum(turned(route).reshape(12, 24, -1) @ w.reshape(len(w), -1).T + b, 0)
    outputs = np.einsum("nkgu,gu->nkg", activity.reshape(12, 24, 3, 20), out)
    assert np.allclose(model.scan(route), np.log(np.exp(outputs).sum(axis=2)), atol=1e-4)
    assert (active.numpy() == outputs.argmax(axis=2)).mean() > 0.99


def test_rotation_network_scan_equals_the_network_on_rolled_views():
    model = MLPRotation(steps=30, units=9).fit(views(6))
    w, b, out = (model.learned[key].double().numpy() for key in ("weights", "biases", "output"))
    activity = np.maximum(turned(views(3, 1)).reshape(3, 24, -1) @ w.reshape(9, -1).T + b, 0)
    assert np.allclose(model.scan(views(3, 1)), activity @ out[0], atol=1e-4)


# Random headings


def split_mix_of_int(number: int) -> int:
    number = (number + 0x9E3779B97F4A7C15) % 2**64
    number = (number ^ (number >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
    number = (number ^ (number >> 27)) * 0x94D049BB133111EB % 2**64
    return number ^ (number >> 31)


def test_hashes_are_mixed_as_split_mix_does():
    assert split_mix(np.array([1234567], dtype=np.uint64)).tolist() == [6457827717110365317]  # its published first draw
    numbers = np.random.default_rng(0).integers(2**64, size=50, dtype=np.uint64)
    assert split_mix(numbers).tolist() == [split_mix_of_int(number) for number in numbers.tolist()]


def test_random_familiarity_is_the_hash_of_each_rolled_view():
    model, queries = RandomHeadings(seed=3).fit(views(2, h=3, w=7)), views(2, 1, h=3, w=7)
    rows, columns = (model.learned[key].tolist() for key in ("rows", "columns"))
    assert all(weight % 2 for weight in rows + columns)
    scan = model.scan(queries)
    for n, k in product(range(2), range(7)):
        total = 0
        for j, column in enumerate(queries[n].roll(k, dims=-1).T):
            bits = [int.from_bytes(pixel.numpy().tobytes(), "little") for pixel in column]
            total += split_mix_of_int(sum(map(mul, rows, bits)) % 2**64) * columns[j]
        assert scan[n, k].item() == (split_mix_of_int(total % 2**64) >> 40) / 2**24


def test_random_headings_are_uniform_and_forget_the_view_before():
    width, model = 24, RandomHeadings().fit(views(1))
    seen = views(1000, 1)
    seen[1::2] = seen[::2]
    seen[1::2, 2, 11] += 1e-6  # of two consecutive views only this tells the second from the first
    headings = model.scan(seen).argmax(dim=1).numpy()
    assert chisquare(np.bincount(headings[::2], minlength=width)).pvalue > 0.01
    assert chisquare(np.bincount(headings[1::2], minlength=width)).pvalue > 0.01
    assert chisquare(np.bincount((headings[1::2] - headings[::2]) % width, minlength=width)).pvalue > 0.01
    assert kstest(model.scan(views(1000, 2)).flatten().numpy(), "uniform").pvalue > 0.01


@pytest.mark.parametrize("image", [torch.zeros(5, 24), torch.ones(5, 24)], ids=["blank", "ones"])
def test_random_headings_are_uniform_over_views_of_one_changed_pixel(image):
    # Numbers of few bits, nearly all the same: what a weak hash would map alike.
    seen = torch.stack([image] * 1000)
    seen[:, 1, 3] = torch.arange(1000) / 1024 + 2
    headings = RandomHeadings().fit(views(1)).scan(seen).argmax(dim=1).numpy()
    assert chisquare(np.bincount(headings, minlength=24)).pvalue > 0.01


def test_random_familiarity_takes_minus_zero_for_zero():
    model = RandomHeadings().fit(views(1))
    assert torch.equal(model.scan(torch.full((1, 5, 24), -0.0)), model.scan(torch.zeros(1, 5, 24)))


def test_random_headings_keep_nothing_of_the_views():
    one, other = RandomHeadings().fit(views(9)), RandomHeadings().fit(views(2, 1))
    assert all(torch.equal(one.learned[key], other.learned[key]) for key in one.learned)
    assert one.memory_bytes == 8 * (5 + 24)


# Opponent


@pytest.mark.parametrize("name", MODELS.builtin)
@pytest.mark.parametrize("w", [24, 25])
def test_opponents_are_two_models_one_less_the_other(name, w):
    learned, queries = views(8, 0, 5, w), views(4, 1, 5, w)
    away = torch.stack([view.roll(w // 2, dims=-1) for view in learned])
    opponents = small(f"opponent-{name}").fit(learned)
    attractive, repulsive = small(name).fit(learned), small(name).fit(away)
    assert torch.equal(opponents.scan(queries), attractive.scan(queries) - repulsive.scan(queries))
    assert opponents.memory_bytes == attractive.memory_bytes + repulsive.memory_bytes


def test_jittered_views_shift_smoothly_around_the_circle_by_jitter_deg():
    around = torch.arange(360) * (2 * np.pi / 360)
    views = torch.stack([around.cos(), around.sin()]).expand(200, 2, 360)  # a column's angle can be read back from it
    random = torch.Generator().manual_seed(0)
    jittered_views = jittered(views, np.radians(10), random)
    shift = torch.rad2deg(torch.atan2(jittered_views[:, 1], jittered_views[:, 0]) - around).remainder(360)
    shift = torch.where(shift > 180, shift - 360, shift)
    assert abs(float(shift.std()) - 10) < 0.7
    assert abs(float(shift.mean())) < 0.7
    assert (shift - shift.roll(1, dims=1)).abs().max() < 2.5  # degrees a column, the seam included
    assert torch.equal(jittered(views, 0.0, random), views)


def test_perfect_memory_matches_no_views_to_nothing():
    familiarity, index = PerfectMemory().fit(views(4)).match(views(4)[:0])
    assert familiarity.shape == index.shape == (0, 24)
