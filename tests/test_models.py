"""One conformance suite for all familiarity models, and for two memories, opponent or of both hemifields, of some of them."""

import copy
from functools import cache

import numpy as np
import pytest
import torch
from jaxtyping import TypeCheckError
from scenes import views
from small_models import small

from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.models import HEMIFIELDS, MODELS, OPPONENT, make_model
from tussock.navigation.models.base import FamiliarityModel, Model, memory_bytes, score
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.navigation.models.incremental import IncrementalModel
from tussock.navigation.models.registry import split_prefix
from tussock.navigation.scan import scan_window
from tussock.navigation.steering.navigator import Look
from tussock.navigation.steering.scan import Scan
from tussock.world.errors import InputError, SettingError
from tussock.world.geometry import turn_of_columns

REFUSED = (InputError, TypeCheckError)  # with type checking on, as here, a wrong rank does not reach our own check

BUILTIN = list(MODELS.builtin)
# Two memories of a model that keeps views, one that learns view by view, an estimator and a control. That those of all
# models are two models, one less the other or both together, is a law in test_model_oracles.py and test_hemifields.py.
PREFIXES = ("", OPPONENT, HEMIFIELDS)
NAMES = [
    *BUILTIN,
    *(prefix + name for prefix in PREFIXES[1:] for name in ("perfect-memory", "infomax", "mlp", "random")),
]
KEEPS_VIEWS = {"perfect-memory", "chain", "window-memory", "spike-overlap"}  # their memory grows with the route
DRAWS_NOTHING = {"visual-compass", "perfect-memory", "chain", "window-memory"}
INCREMENTAL = {
    "perfect-memory", "chain", "window-memory", "infomax", "mushroom-body", "spiking-mushroom-body", "spike-overlap",
}  # fmt: skip
LEARNS_NOTHING = {"random"}  # controls
THRESHOLDS = {"adaboost", "mushroom-body", "spike-overlap"}  # whose scans jump where a sum crosses a threshold

# Models are trained with their defaults, but for one: its default is passes over a route of hundreds of views, and on a
# dozen they are too few updates to learn anything. And the weights of spikes are for images of positive values: white noise makes
# few cells fire.
PARAMETERS = {"rbm": {"epochs": 500}, "spiking-mushroom-body": {"kenyon_weight": 0.1}}


def base(name: str) -> str:
    """The name without `opponent-` or `hemifields-`."""
    return split_prefix(name)[1]


@cache
def trained_once(name: str) -> Model:
    return make_model(name, **PARAMETERS.get(base(name), {})).fit(views(12))


@pytest.fixture(params=NAMES)
def name(request) -> str:
    return request.param


@pytest.fixture
def trained(name) -> Model:
    """A small model after views(12). Tests share it: they scan it and do not train it."""
    return small_once(name)


@cache
def small_once(name: str) -> Model:
    return small(name).fit(views(12))


def state(model: Model) -> dict[str, bytes]:
    """What it has learned, to the last bit."""
    return {key: tensor.detach().cpu().numpy().tobytes() for key, tensor in model.learned.items()}


def same(model: Model, other: Model) -> bool:
    """Whether two models learned the same, and scan in the same way."""
    return state(model) == state(other) and torch.equal(model.scan(views(3, 5)), other.scan(views(3, 5)))


def test_model_of_a_name_has_the_class_of_the_registry(name):
    model = make_model(name)
    assert isinstance(model, FamiliarityModel)
    assert isinstance(model, Model)
    assert model.name == name
    assert model.paper
    assert type(getattr(model, "first", model)) is MODELS.find(base(name))
    assert MODELS.name_of(MODELS.find(base(name))) == base(name)


def test_repr_names_the_class(name, trained):
    for model in (make_model(name), trained):
        assert MODELS.find(base(name)).__name__ in repr(model)
        assert ("Opponent" in repr(model)) == name.startswith(OPPONENT)
        assert ("Hemifields" in repr(model)) == name.startswith(HEMIFIELDS)


def test_scan_of_a_rolled_view_is_the_rolled_scan(name, trained):
    scan = trained.scan(views(8, seed=1))
    assert scan.shape == (8, 24)
    assert scan.dtype == torch.float32
    for k in (1, 7, 23):
        # Turned left by k already: what was rotation k is rotation 0.
        rolled = trained.scan(torch.roll(views(8, seed=1), k, dims=-1))
        wrong = (rolled - torch.roll(scan, -k, dims=-1)).abs() > 1e-4 * (scan.max() - scan.min())
        # The FFT rounds a rolled view differently, by 1e-7: a sum that near to a threshold may cross it.
        assert wrong.float().mean() <= (0.01 if base(name) in THRESHOLDS else 0)


def test_a_scan_turns_to_the_most_familiar_rotation_in_its_window(trained):
    look = Look(views=views(3, seed=1), compass=np.zeros(3))
    scan = Scan(model=trained, width=2.0, refine=False)
    motion = scan.decide(look, [scan.begin()] * 3)
    window = scan_window(24, 2.0)
    for turn, familiarity in zip(motion.turn, motion.scan.familiarity, strict=True):
        assert np.isclose(turn, turn_of_columns(np.where(window, familiarity, -np.inf).argmax(), 24))


def test_scan_of_a_rolled_view_with_flat_patches_is_the_rolled_scan(name):
    # As edges have them. A filter of sum 0 makes nothing of a patch but rounding errors, which must not decide.
    patches = (views(4, seed=2) > 1).float()
    model = small(name).fit((views(30) > 1).float())
    scan = model.scan(patches)
    rolled = model.scan(torch.roll(patches, 7, dims=-1))
    wrong = (rolled - torch.roll(scan, -7, dims=-1)).abs() > 1e-3 * (scan.max() - scan.min())
    assert wrong.float().mean() <= (0.02 if base(name) == "mushroom-body" else 0)  # where cells tie, either may fire


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here")
def test_model_learns_and_scans_on_a_gpu_as_on_the_cpu(name):
    model, there = small(name).fit(views(12)), small(name, device="cuda").fit(views(12))
    scan, other = model.scan(views(4, seed=1)), there.scan(views(4, seed=1)).cpu()
    assert (scan.argmax(dim=1) == other.argmax(dim=1)).float().mean() >= 0.75


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) not in LEARNS_NOTHING])
def test_learned_view_is_most_familiar_at_its_learned_heading(name):
    trained = trained_once(name)
    scan = trained.scan(views(12))
    if base(name) == "mlp":
        # Its recipe trains only that a view is more familiar than one turned by 60 degrees.
        attractive = getattr(trained, "attractive", trained).scan(views(12))
        assert (attractive[0::2, 0] > attractive[0::2, -4]).all()
        assert (attractive[1::2, 0] > attractive[1::2, 4]).all()
        return
    best = scan.argmax(dim=1)
    if base(name) == "visual-compass":
        best = best[-1:]  # it keeps one
    assert (torch.minimum(best, 24 - best) <= 1).float().mean() >= 0.95


def test_views_are_scanned_together_as_each_alone(name, trained):
    together = trained.scan(views(70, 1))
    alone = torch.cat([trained.scan(view[None]) for view in views(70, 1)])
    wrong = (together - alone).abs() > 1e-4 * (alone.max() - alone.min())
    assert wrong.float().mean() <= (0.01 if base(name) in THRESHOLDS else 0)


VISIBLE = torch.arange(24).expand(5, 24) + torch.arange(5)[:, None] > 8
MASKS = {"all": None, "part": FeatureMask(VISIBLE), "normalised": FeatureMask(VISIBLE, normalised=True, gain=0.5)}


@pytest.mark.parametrize(("seed", "mask"), [*enumerate(MASKS)])
def test_score_is_the_familiarity_at_the_present_heading(name, mask, seed):
    model = small(name, seed=seed).see(MASKS[mask]).fit(views(12, seed))
    queries = torch.cat([views(20, seed + 10), views(12, seed)])
    scores, scanned = model.score(queries), model.scan(queries)[:, 0]
    assert scores.dtype == torch.float32
    assert scores.shape == (32,)
    wrong = (scores - scanned).abs() > 1e-5 * scanned.abs().max()
    assert wrong.sum() <= (1 if base(name) in THRESHOLDS else 0)
    assert torch.equal(scores, torch.cat([model.score(view[None]) for view in queries]))


@pytest.mark.parametrize("name", ["perfect-memory", "visual-compass"])
def test_score_of_views_that_are_known_in_part_is_that_of_the_scan(name):
    model = make_model(name).see(FeatureMask(torch.ones(5, 24, dtype=torch.bool), partial=True))
    route = views(12)
    route[:, :, 20:] = torch.nan
    model.fit(route)
    assert torch.equal(model.score(route), model.scan(route)[:, 0])


@pytest.mark.parametrize("name", ["perfect-memory", "chain", "window-memory"])
def test_score_of_encoded_views_is_exact(name):
    whole = np.random.default_rng(0).integers(-5 * 4096, 5 * 4096, size=(60, 5, 24))
    encoded = torch.from_numpy(whole / 4096).float()
    squared = ((whole[:20, None] - whole[None, 20:]) ** 2).sum(axis=(2, 3)).min(axis=1)
    expected = -np.sqrt(squared / 4096**2 / (5 * 24)).astype(np.float32)
    assert make_model(name).fit(encoded[20:]).score(encoded[:20]).numpy().tobytes() == expected.tobytes()


@pytest.mark.parametrize("name", ["rbm", "autoencoder"])
def test_score_of_large_views_has_the_same_bytes_alone_on_several_threads(name):
    large, threads = views(3, h=100, w=400), torch.get_num_threads()
    model = small(name, units=3).fit(large)
    try:
        torch.set_num_threads(2)
        assert torch.equal(model.score(large), torch.cat([model.score(view[None]) for view in large]))
    finally:
        torch.set_num_threads(threads)


@pytest.mark.parametrize("activation", ["identity", "logistic", "tanh", "relu"])
def test_score_of_a_network_has_the_same_bytes_alone(activation):
    model = small("mlp", activation=activation, hidden_layer_sizes=(13, 5)).fit(views(12))
    scores, scanned = model.score(views(30, 1)), model.scan(views(30, 1))[:, 0]
    assert torch.allclose(scores, scanned, rtol=0, atol=1e-5 * float(scanned.abs().max()))
    assert torch.equal(scores, torch.cat([model.score(view[None]) for view in views(30, 1)]))


@pytest.mark.parametrize("smoothing_deg", [0.0, 1.0, 6.0, 180.0])
def test_score_of_a_mushroom_body_averages_as_its_scan(smoothing_deg):
    model = small("mushroom-body", smoothing_deg=smoothing_deg).fit(views(12, w=72))
    wrong = (model.score(views(40, 1, w=72)) - model.scan(views(40, 1, w=72))[:, 0]).abs() > 1e-6
    assert wrong.float().mean() <= 0.05  # where drives tie, either cell may fire


def test_the_same_seed_learns_the_same_bytes(name):
    model = small(name, seed=3).fit(views(10))
    assert model.learned
    assert same(model, small(name, seed=3).fit(views(10)))


def test_random_numbers_drawn_elsewhere_make_no_difference(name, trained):
    torch.manual_seed(77)
    torch.rand(5)
    np.random.seed(77)  # noqa: NPY002 (the global generator, which must not matter)
    assert state(small(name).fit(views(12))) == state(trained)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) not in DRAWS_NOTHING])
def test_another_seed_learns_something_else(name, trained):
    other = small(name, seed=4).fit(views(12))
    assert state(trained) != state(other)
    if name.startswith(OPPONENT) and base(name) in LEARNS_NOTHING:
        # To a control a view is as familiar after learning it as after learning it turned round.
        assert not other.scan(views(3, 5)).any()
        return
    assert not torch.equal(trained.scan(views(3, 5)), other.scan(views(3, 5)))


def test_only_controls_scan_independently_of_what_they_learned(name, trained):
    other = small(name).fit(views(12, 1))
    assert torch.equal(trained.scan(views(3, 5)), other.scan(views(3, 5))) == (base(name) in LEARNS_NOTHING)


def test_fit_forgets_earlier_views_and_returns_the_model(name, trained):
    model = small(name).fit(views(9, 1))
    assert model.fit(views(12)) is model
    assert same(model, trained)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in INCREMENTAL])
def test_learning_in_parts_equals_learning_at_once(name, trained):
    in_parts = small(name)
    for part in (slice(0, 4), slice(4, 5), slice(5, 12)):  # the first of them begins
        assert in_parts.partial_fit(views(12)[part]) is in_parts
    assert same(in_parts, trained)
    assert same(small(name).fit(views(12)[:4]).partial_fit(views(12)[4:]), trained)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in INCREMENTAL])
@pytest.mark.parametrize("make_copy", [copy.copy, copy.deepcopy])
def test_learning_on_changes_no_copy(name, make_copy):
    model = small(name).fit(views(5))
    model.partial_fit(views(1, 7)).partial_fit(views(1, 8))  # by now it may change its own tensors in place
    copied, twin = make_copy(model), make_copy(model)
    model.partial_fit(views(1, 1)).partial_fit(views(1, 2))
    after = state(model)
    copied.partial_fit(views(1, 3)).partial_fit(views(1, 4))
    assert state(model) == after != state(copied)
    expected = small(name).fit(torch.cat([views(5), views(1, 7), views(1, 8)]))
    assert same(twin, expected)
    assert same(copied, expected.partial_fit(torch.cat([views(1, 3), views(1, 4)])))


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in INCREMENTAL])
def test_learning_on_changes_no_tensor_that_was_given_out(name):
    model = small(name).fit(views(5)).partial_fit(views(1, 7)).partial_fit(views(1, 8))
    held = dict(model.learned)
    before = state(model)
    model.partial_fit(views(1, 1)).partial_fit(views(1, 2))
    assert {key: tensor.numpy().tobytes() for key, tensor in held.items()} == before != state(model)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in INCREMENTAL])
@pytest.mark.parametrize("masked", [False, True])
def test_a_view_learned_between_scans_is_learned_as_among_others(name, masked):
    mask = FeatureMask(torch.arange(24).expand(5, 24) > 8) if masked else None
    model, at_once = small(name).see(mask), small(name).see(mask).fit(views(12))
    for view in views(12).split(1):
        model.partial_fit(view).scan(view)
    assert same(model, at_once)


def test_incremental_models_have_partial_fit(name):
    assert hasattr(make_model(name), "partial_fit") == (base(name) in INCREMENTAL)
    assert isinstance(make_model(base(name)), IncrementalModel) == (base(name) in INCREMENTAL)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in INCREMENTAL])
def test_failed_partial_fit_leaves_the_model_as_it_was(name):
    model = small(name).fit(views(5))
    before = copy.deepcopy(model)
    broken = views(4, 1)
    broken[3, 2, 1] = torch.nan  # the last: those before it must not stay either
    for bad in (broken, views(0), views(2, w=25), torch.full((1, 5, 24), torch.inf)):
        with pytest.raises(SettingError):
            model.partial_fit(bad)
        assert same(model, before)


@pytest.mark.parametrize("name", ["infomax", "opponent-infomax"])
@pytest.mark.parametrize("seed", range(6))
def test_diverging_partial_fit_leaves_the_model_as_it_was(name, seed):
    # Of two opponents either may diverge alone; with the fifth of these seeds it is the repulsive one.
    model = make_model(name, rate=0.004, seed=seed).fit(views(1, 50 + seed))
    for more in views(40, 100 + seed).split(1):
        before = copy.deepcopy(model)
        try:
            model.partial_fit(more)
        except InputError as error:
            assert "rate" in str(error)  # noqa: PT017 (not each raises it)
            assert same(model, before)
            return
    pytest.fail("it never diverged")


def test_training_that_is_interrupted_at_the_end_leaves_the_model_as_it_was(name, monkeypatch):
    model = small(name).fit(views(5))
    before, prepare = copy.deepcopy(model), type(model)._prepare

    def interrupted(model: Model) -> None:
        prepare(model)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(type(model), "_prepare", interrupted)
        with pytest.raises(KeyboardInterrupt):
            model.fit(views(4, 1, w=20))
    assert model.shape == before.shape
    assert same(model, before)


def test_memory_grows_with_the_views_only_where_they_are_kept(name):
    few, many = (small(name).fit(views(n)).memory_bytes for n in (16, 48))
    expected = 3 * few if base(name) in KEEPS_VIEWS else few
    if base(name) == "spike-overlap":  # the wiring stays
        expected -= 2 * sum(small_once(name).learned[key].nbytes for key in ("wiring", "weights"))
    assert many == expected


def test_memory_bytes_are_the_size_of_what_is_learned(name, trained):
    assert make_model(name).memory_bytes == 0
    assert memory_bytes(trained) == sum(len(each) for each in state(trained).values()) > 0
    if base(name) == "visual-compass":
        assert trained.memory_bytes <= 2 * (5 * 24 * 4 + 8)  # one view, and its index


def test_model_from_a_file_scans_the_same_bytes(name, trained, tmp_path):
    save_model(TrainedModel(model=trained), tmp_path / "model")
    loaded = load_model(tmp_path / "model", expect=name)
    assert loaded.model.name == name
    assert loaded.model.parameters == trained.parameters
    assert same(loaded.model, trained)
    save_model(loaded, tmp_path / "again")
    assert (tmp_path / "again").read_bytes() == (tmp_path / "model").read_bytes()


def test_scanning_changes_nothing(name, trained):
    before, queries = state(trained), views(4, 1)
    first = trained.scan(queries)
    assert torch.equal(trained.scan(queries), first)
    assert state(trained) == before
    assert torch.equal(queries, views(4, 1))
    assert not first.requires_grad


def test_scans_on_other_numbers_of_threads_agree_to_rounding(name, trained):
    queries, threads = views(40, 1), torch.get_num_threads()
    try:
        scans = []
        for number in (1, 2, 5):
            torch.set_num_threads(number)
            scans.append(trained.scan(queries))
    finally:
        torch.set_num_threads(threads)
    for scan in scans[1:]:
        wrong = (scan - scans[0]).abs() > 1e-5 * scans[0].abs().max()
        assert wrong.float().mean() <= (0.01 if base(name) in THRESHOLDS else 0)


def test_training_leaves_the_given_views_unchanged_and_keeps_none_of_them(name, trained):
    given = views(12)
    model = small(name).fit(given)
    assert torch.equal(given, views(12))
    given.zero_()  # the caller may change them afterwards
    assert same(model, trained)


def test_one_view_no_view_and_a_constant_view(name):
    model = small(name).fit(views(1))
    assert model.scan(views(0)).shape == (0, 24)
    assert model.score(views(0)).shape == (0,)
    assert torch.isfinite(model.scan(torch.zeros(1, 5, 24))).all()
    for level in (0.0, 0.7):
        model = small(name).fit(torch.full((2, 5, 24), level))
        scan = model.scan(torch.cat([views(1), torch.full((1, 5, 24), level)]))
        assert torch.isfinite(scan).all()
        assert scan[1].max() - scan[1].min() <= 1e-3 * (1 + scan[1].abs().max())  # all its rotations are the same image


@pytest.mark.parametrize(("h", "w"), [(1, 4), (1, 24), (2, 4), (5, 7), (3, 5)])
def test_views_of_the_smallest_and_of_odd_sizes_are_learned(name, h, w):
    scan = small(name).fit(views(5, 0, h, w)).scan(views(2, 1, h, w))
    assert scan.shape == (2, w)
    assert torch.isfinite(scan).all()


def test_views_that_cannot_be_learned_or_scanned_are_refused(name):
    model = small(name)
    with pytest.raises(SettingError, match="learned nothing"):
        model.scan(views(1))
    with pytest.raises(SettingError, match="at least one view"):
        model.fit(torch.empty(0, 5, 24))
    broken = views(3)
    broken[1, 2, 3] = torch.nan
    with pytest.raises(SettingError, match=r"view 1 .* not finite"):
        model.fit(broken)
    with pytest.raises(SettingError, match="learned nothing"):
        model.scan(views(1))
    model.fit(views(3))
    with pytest.raises(SettingError, match=r"view 1 .* not finite"):
        model.scan(broken)
    with pytest.raises(SettingError, match=r"shape \(5, 24\), got \(5, 25\)"):
        model.scan(views(1, w=25))
    with pytest.raises(SettingError, match=r"view 1 .* not finite"):
        model.score(broken)
    with pytest.raises(SettingError, match="learned nothing"):
        small(name).score(views(1))
    with pytest.raises(REFUSED):
        model.scan(views(1)[0])


def test_a_score_beyond_float32_is_refused():
    model = small("mlp").fit(views(3))
    model.restore((5, 24), {key: torch.full_like(tensor, 1e12) for key, tensor in model.learned.items()})
    for familiarity in (model.scan, model.score):
        with pytest.raises(SettingError, match="beyond float32"):
            familiarity(torch.full((1, 5, 24), 1e12))


@pytest.mark.parametrize("device", ["cuda:99", "nonsense", ""])
def test_a_device_that_does_not_exist_is_refused(name, device):
    with pytest.raises(SettingError, match="device"):
        small(name, device=device).fit(views(3))


BAD_PARAMETERS = [
    ("perfect-memory", "seed", -1),
    ("perfect-memory", "device", 3),
    ("chain", "window", -0.1),
    ("chain", "window", 0.0),  # doubling it would never widen it
    ("chain", "max_mismatch", "much"),
    ("mlp", "activation", "sigmoid"),
    ("mlp", "solver", "newton"),
    ("mlp", "alpha", -1.0),
    ("mlp", "max_iter", 0),
    ("mlp", "hidden_layer_sizes", 0),
    ("mlp", "hidden_layer_sizes", (0,)),
    ("mlp", "hidden_layer_sizes", (10, -1)),
    ("mlp", "negatives_deg", ()),
    ("mlp", "negatives_deg", (float("nan"),)),
    ("mlp-rotation", "units", 0),
    ("mlp-rotation", "rate", -1.0),
    ("mlp-rotation", "noise", float("nan")),
    ("mlp-mixture", "segments", 0),
    ("adaboost", "pool", 0),
    ("adaboost", "features", 0),
    ("adaboost", "negatives_deg", ()),
    ("adaboost", "tolerance_deg", 200.0),  # no rotation is that far away
    ("rbm", "units", 0),
    ("rbm", "units", True),
    ("rbm", "units", 1.5),
    ("rbm", "rate", -1.0),
    ("autoencoder", "batch_size", 0),
    ("autoencoder", "rate", float("inf")),
    ("infomax", "units", 0),
    ("infomax", "rate", -1.0),
    ("infomax", "rate", "fast"),
    ("infomax", "traversals", 0),
    ("mushroom-body", "cells", 0),
    ("mushroom-body", "active", -0.1),
    ("mushroom-body", "active", 2.0),
    ("mushroom-body", "outputs", 0),
    ("mushroom-body", "learning", "hope"),
    ("mushroom-body", "rate", -1.0),
    ("mushroom-body", "target_deg", 0.0),
    ("mushroom-body", "inputs", 361),  # of 360 neurons
]


@pytest.mark.parametrize("prefix", PREFIXES)
@pytest.mark.parametrize(("name", "parameter", "value"), BAD_PARAMETERS, ids=str)
def test_an_invalid_parameter_is_refused_when_the_model_is_made(prefix, name, parameter, value):
    with pytest.raises(SettingError) as refusal:
        make_model(prefix + name, **{parameter: value})
    assert parameter in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(("name", "parameter", "value"), BAD_PARAMETERS[:-1], ids=str)
def test_an_invalid_parameter_is_refused_when_it_is_set(name, parameter, value):
    model = make_model(name)
    with pytest.raises(SettingError, match=parameter):
        setattr(model, parameter, value)
    assert model.parameters == make_model(name).parameters


def test_too_many_inputs_of_a_mushroom_body_are_refused_before_it_learns():
    model = small("mushroom-body")
    model.inputs = 49  # of 48 neurons
    with pytest.raises(SettingError, match="inputs"):
        model.fit(views(3))


@pytest.mark.parametrize("steps", range(1, 13))
def test_rotation_networks_train_for_any_number_of_steps(steps):
    assert torch.isfinite(small("mlp-rotation", steps=steps).fit(views(3)).scan(views(1))).all()


class Outside:
    """A model from outside, with no more than what is needed: familiarity is the mean of each column."""

    def __init__(self, gain: float = 1.0):
        self.gain = gain

    def fit(self, views):
        self.level = views.mean()
        return self

    def scan(self, views):
        return self.gain * (views - self.level).mean(dim=1)


def test_a_model_from_outside_needs_only_fit_and_scan():
    spec = f"{Outside.__module__}:Outside gain=2"
    model, opposed = make_model(spec, seed=3, device="cpu"), make_model(OPPONENT + spec)
    assert isinstance(model, FamiliarityModel)
    assert model.gain == 2
    assert memory_bytes(model) is memory_bytes(opposed) is None
    for each in (model, opposed):
        each.fit(views(5))
    away = Outside(gain=2).fit(views(5).roll(12, dims=-1))
    assert torch.equal(opposed.scan(views(3, 1)), model.scan(views(3, 1)) - away.scan(views(3, 1)))


def test_any_model_scores_views_by_its_own_score_or_by_its_scan(name, trained):
    assert torch.equal(score(trained, views(3, 1)), trained.score(views(3, 1)))
    outside = Outside().fit(views(5))
    assert torch.equal(score(outside, views(3, 1)), outside.scan(views(3, 1))[:, 0])
    opposed = make_model(f"{OPPONENT}{Outside.__module__}:Outside").fit(views(5))
    assert torch.equal(score(opposed, views(3, 1)), opposed.scan(views(3, 1))[:, 0])
    outside.score = lambda views: views[:, 0, 0]
    assert torch.equal(score(outside, views(3, 1)), views(3, 1)[:, 0, 0])


def test_a_class_without_scan_is_refused():
    with pytest.raises(SettingError, match="scan"):
        make_model("builtins:dict")


def test_public_names_are_loaded_when_they_are_used():
    from tussock import navigation
    from tussock.navigation import models

    make_model("opponent-perfect-memory")
    make_model("hemifields-perfect-memory")
    assert callable(navigation.opponent)  # the function, not the module opponents
    assert callable(navigation.hemifields)
    assert {"PerfectMemory", "MODELS", "make_model", "model_spec", "opponent", "hemifields"} <= set(dir(models))
    assert all(getattr(models, each) is not None for each in models.__all__)
