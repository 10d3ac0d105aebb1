"""One conformance suite for all models, and for each of them doubled by `opponent-`."""

import copy
from functools import cache

import numpy as np
import pytest
import torch
from jaxtyping import TypeCheckError
from scenes import views

from tussock.navigation.models import MODELS, OPPONENT, make_model
from tussock.navigation.models.base import FamiliarityModel, IncrementalModel, Model
from tussock.navigation.models.files import load_model, save_model
from tussock.world.errors import InputError

REFUSED = (InputError, TypeCheckError)  # with type checking on, as here, a wrong rank does not reach our own check

NAMES = [*MODELS, *(OPPONENT + name for name in MODELS)]
KEEP_ALL = {"perfect-memory", "chain"}  # their memory grows with the route
DRAW_NOTHING = {"visual-compass", "perfect-memory", "chain"}
LEARN_ON = {"perfect-memory", "chain", "infomax", "mushroom-body"}  # have partial_fit
KNOW_NOTHING = {"random"}  # controls: of no view do they know that they learned it
THRESHOLDS = {"adaboost", "mushroom-body"}  # whose scans jump where a sum crosses a threshold

# Models are trained with their defaults, but for one: its default is passes over a route of hundreds of views, and on a
# dozen they are too few updates to learn anything.
PARAMETERS = {"rbm": {"epochs": 500}}
# For tests that train several times and ask nothing of the quality.
CHEAPER = {
    "mlp": {"max_iter": 20},
    "mlp-rotation": {"steps": 20},
    "mlp-mixture": {"steps": 20},
    "adaboost": {"pool": 100, "features": 10, "passes": 2},
    "rbm": {"epochs": 10},
    "autoencoder": {"epochs": 10},
    "mushroom-body": {"cells": 500, "active": 0.02},
}


def base(name: str) -> str:
    """The name without `opponent-`."""
    return name.removeprefix(OPPONENT)


def cheap(name: str, **parameters) -> Model:
    return make_model(name, **(CHEAPER.get(base(name), {}) | parameters))


@cache
def trained_once(name: str) -> Model:
    return make_model(name, **PARAMETERS.get(base(name), {})).fit(views(12))


@pytest.fixture(params=NAMES)
def name(request) -> str:
    return request.param


@pytest.fixture
def trained(name) -> Model:
    """The model with its defaults after views(12). Tests share it: they scan it and do not train it."""
    return trained_once(name)


def state(model: Model) -> dict[str, bytes]:
    """What it has learned, to the last bit."""
    return {key: tensor.detach().cpu().numpy().tobytes() for key, tensor in model.learned.items()}


def knows_what_it_knew(model: Model, before: Model) -> bool:
    return state(model) == state(before) and torch.equal(model.scan(views(3, 5)), before.scan(views(3, 5)))


def test_is_a_familiarity_model_of_its_name(name):
    model = make_model(name)
    assert isinstance(model, FamiliarityModel)
    assert isinstance(model, Model)
    assert model.name == name
    assert model.paper
    assert type(getattr(model, "attractive", model)).__name__ == MODELS[base(name)]


def test_its_repr_names_its_class(name, trained):
    for model in (make_model(name), trained):
        assert MODELS[base(name)] in repr(model)
        assert ("Opponent" in repr(model)) == name.startswith(OPPONENT)


def test_scanning_a_rolled_view_rolls_the_scan(name, trained):
    scan = trained.scan(views(8, seed=1))
    assert scan.shape == (8, 24)
    assert scan.dtype == torch.float32
    for k in (1, 7, 23):
        # Turned left by k already: what was rotation k is rotation 0.
        rolled = trained.scan(torch.roll(views(8, seed=1), k, dims=-1))
        wrong = (rolled - torch.roll(scan, -k, dims=-1)).abs() > 1e-4 * (scan.max() - scan.min())
        # The FFT rounds a rolled view differently, by 1e-7: a sum that near to a threshold may cross it.
        assert wrong.float().mean() <= (0.01 if base(name) in THRESHOLDS else 0)


def test_so_do_views_with_flat_patches(name):
    # As edges have them. A filter that sums to 0 makes nothing of a patch but rounding, which must not decide.
    patches = (views(4, seed=2) > 1).float()
    model = cheap(name).fit((views(30) > 1).float())
    scan = model.scan(patches)
    rolled = model.scan(torch.roll(patches, 7, dims=-1))
    wrong = (rolled - torch.roll(scan, -7, dims=-1)).abs() > 1e-3 * (scan.max() - scan.min())
    assert wrong.float().mean() <= (0.02 if base(name) == "mushroom-body" else 0)  # where cells tie, either may fire


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here")
def test_it_learns_and_scans_on_a_gpu_as_on_the_cpu(name):
    model, there = cheap(name).fit(views(12)), cheap(name, device="cuda").fit(views(12))
    scan, other = model.scan(views(4, seed=1)), there.scan(views(4, seed=1)).cpu()
    assert (scan.argmax(dim=1) == other.argmax(dim=1)).float().mean() >= 0.75


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) not in KNOW_NOTHING])
def test_a_learned_view_is_most_familiar_as_it_was_learned(name):
    trained = trained_once(name)
    scan = trained.scan(views(12))
    if base(name) == "mlp":
        # Its recipe teaches only that a view is more familiar than one turned by 60 degrees.
        attractive = getattr(trained, "attractive", trained).scan(views(12))
        assert (attractive[0::2, 0] > attractive[0::2, -4]).all()
        assert (attractive[1::2, 0] > attractive[1::2, 4]).all()
        return
    best = scan.argmax(dim=1)
    if base(name) == "visual-compass":
        best = best[-1:]  # it keeps one
    assert (torch.minimum(best, 24 - best) <= 1).float().mean() >= 0.95


def test_many_views_are_scanned_as_each_alone(name):
    model = cheap(name).fit(views(150))
    together = model.scan(views(70, 1))
    alone = torch.cat([model.scan(view[None]) for view in views(70, 1)])
    wrong = (together - alone).abs() > 1e-4 * (alone.max() - alone.min())
    assert wrong.float().mean() <= (0.01 if base(name) in THRESHOLDS else 0)


def test_the_same_seed_learns_the_same_bytes(name):
    one, other = cheap(name, seed=3).fit(views(10)), cheap(name, seed=3).fit(views(10))
    assert one.learned
    assert knows_what_it_knew(one, other)


def test_what_others_draw_makes_no_difference(name):
    one = cheap(name).fit(views(6))
    torch.manual_seed(77)
    torch.rand(5)
    np.random.seed(77)  # noqa: NPY002 (the generator that nobody should use)
    assert state(cheap(name).fit(views(6))) == state(one)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) not in DRAW_NOTHING])
def test_another_seed_learns_something_else(name):
    one, other = cheap(name, seed=3).fit(views(10)), cheap(name, seed=4).fit(views(10))
    assert state(one) != state(other)
    if name.startswith(OPPONENT) and base(name) in KNOW_NOTHING:
        # What knows nothing finds a view as familiar after learning it as after learning it turned round.
        assert not one.scan(views(3, 5)).any()
        return
    assert not torch.equal(one.scan(views(3, 5)), other.scan(views(3, 5)))


@pytest.mark.parametrize("name", NAMES)
def test_only_controls_know_nothing_of_what_they_learned(name):
    # Why they are left out above: and only they are.
    one, other = cheap(name).fit(views(10)), cheap(name).fit(views(10, 1))
    assert torch.equal(one.scan(views(3, 5)), other.scan(views(3, 5))) == (base(name) in KNOW_NOTHING)


def test_fitting_again_forgets(name):
    fresh = cheap(name).fit(views(6, 1))
    assert knows_what_it_knew(cheap(name).fit(views(9)).fit(views(6, 1)), fresh)


def test_fit_gives_the_model_itself(name):
    model = cheap(name)
    assert model.fit(views(4)) is model


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in LEARN_ON])
def test_learning_on_is_as_learning_all_at_once(name):
    at_once = cheap(name).fit(views(10))
    bit_by_bit = cheap(name)
    for part in (slice(0, 4), slice(4, 5), slice(5, 10)):  # the first of them begins
        assert bit_by_bit.partial_fit(views(10)[part]) is bit_by_bit
    assert knows_what_it_knew(bit_by_bit, at_once)
    assert knows_what_it_knew(cheap(name).fit(views(10)[:4]).partial_fit(views(10)[4:]), at_once)


def test_models_that_learn_view_by_view_say_so(name):
    assert hasattr(make_model(name), "partial_fit") == (base(name) in LEARN_ON)
    assert isinstance(make_model(name.removeprefix(OPPONENT)), IncrementalModel) == (base(name) in LEARN_ON)


@pytest.mark.parametrize("name", [name for name in NAMES if base(name) in LEARN_ON])
def test_learning_on_that_fails_leaves_the_model_as_it_was(name):
    model = cheap(name).fit(views(5))
    before = copy.deepcopy(model)
    broken = views(4, 1)
    broken[3, 2, 1] = torch.nan  # the last: those before it must not stay either
    for bad in (broken, views(0), views(2, w=25), torch.full((1, 5, 24), torch.inf)):
        with pytest.raises(InputError):
            model.partial_fit(bad)
        assert knows_what_it_knew(model, before)


@pytest.mark.parametrize("name", ["infomax", "opponent-infomax"])
@pytest.mark.parametrize("seed", range(6))
def test_learning_on_that_runs_away_leaves_the_model_as_it_was(name, seed):
    # Of two opponents either may run away alone; with the fifth of these seeds it is the repulsive one.
    model = make_model(name, rate=0.004, seed=seed).fit(views(1, 50 + seed))
    for more in views(40, 100 + seed).split(1):
        before = copy.deepcopy(model)
        try:
            model.partial_fit(more)
        except InputError as error:
            assert "rate" in str(error)  # noqa: PT017 (not each raises it)
            assert knows_what_it_knew(model, before)
            return
    pytest.fail("it never ran away")


def test_learning_that_is_interrupted_at_the_end_leaves_the_model_as_it_was(name, monkeypatch):
    model = cheap(name).fit(views(5))
    before, prepare = copy.deepcopy(model), type(model)._prepare

    def interrupted(model: Model) -> None:
        prepare(model)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(type(model), "_prepare", interrupted)
        with pytest.raises(KeyboardInterrupt):
            model.fit(views(4, 1, w=20))
    assert model.shape == before.shape
    assert knows_what_it_knew(model, before)


def test_memory_grows_with_the_views_only_where_they_are_kept(name):
    # From a dozen on: a mixture has no more networks than views.
    few, many = (cheap(name).fit(views(n)).memory_bytes for n in (16, 48))
    assert many == (3 * few if base(name) in KEEP_ALL else few)


def test_memory_bytes_are_those_of_what_is_learned(name, trained):
    assert make_model(name).memory_bytes == 0
    assert trained.memory_bytes == sum(len(each) for each in state(trained).values()) > 0
    if base(name) == "visual-compass":
        assert trained.memory_bytes <= 2 * (5 * 24 * 4 + 8)  # one view, and which it was


def test_a_model_from_a_file_scans_alike_to_the_last_bit(name, trained, tmp_path):
    save_model(trained, tmp_path / "model")
    loaded = load_model(tmp_path / "model", expect=name).model
    assert loaded.name == name
    assert loaded.parameters == trained.parameters
    assert knows_what_it_knew(loaded, trained)
    save_model(loaded, tmp_path / "again")
    assert (tmp_path / "again").read_bytes() == (tmp_path / "model").read_bytes()


def test_scanning_changes_nothing(name, trained):
    before, queries = state(trained), views(4, 1)
    first = trained.scan(queries)
    assert torch.equal(trained.scan(queries), first)
    assert state(trained) == before
    assert torch.equal(queries, views(4, 1))
    assert not first.requires_grad


def test_a_scan_does_not_depend_on_the_number_of_threads(name, trained):
    seen, threads = views(40, 1), torch.get_num_threads()
    try:
        scans = []
        for number in (1, 2, 5):
            torch.set_num_threads(number)
            scans.append(trained.scan(seen).numpy().tobytes())
    finally:
        torch.set_num_threads(threads)
    assert len(set(scans)) == 1


def test_learning_leaves_the_views_as_they_were_given(name):
    given = views(6)
    model = cheap(name).fit(given)
    assert torch.equal(given, views(6))
    before = copy.deepcopy(model)
    given.zero_()  # and they are the caller's to change afterwards
    assert knows_what_it_knew(model, before)


def test_one_view_no_view_and_a_constant_view(name):
    model = cheap(name).fit(views(1))
    assert model.scan(views(0)).shape == (0, 24)
    assert torch.isfinite(model.scan(torch.zeros(1, 5, 24))).all()
    for level in (0.0, 0.7):
        model = cheap(name).fit(torch.full((2, 5, 24), level))
        scan = model.scan(torch.cat([views(1), torch.full((1, 5, 24), level)]))
        assert torch.isfinite(scan).all()
        assert scan[1].max() - scan[1].min() <= 1e-3 * (1 + scan[1].abs().max())  # all its rotations are the same image


@pytest.mark.parametrize(("h", "w"), [(1, 4), (1, 24), (2, 4), (5, 7), (3, 5)])
def test_the_smallest_and_odd_views_are_learned(name, h, w):
    scan = cheap(name).fit(views(5, 0, h, w)).scan(views(2, 1, h, w))
    assert scan.shape == (2, w)
    assert torch.isfinite(scan).all()


def test_what_cannot_be_learned_or_scanned_is_refused(name):
    model = cheap(name)
    with pytest.raises(InputError, match="learned nothing"):
        model.scan(views(1))
    with pytest.raises(InputError, match="at least one view"):
        model.fit(torch.empty(0, 5, 24))
    broken = views(3)
    broken[1, 2, 3] = torch.nan
    with pytest.raises(InputError, match=r"view 1 .* not finite"):
        model.fit(broken)
    with pytest.raises(InputError, match="learned nothing"):
        model.scan(views(1))
    model.fit(views(3))
    with pytest.raises(InputError, match=r"view 1 .* not finite"):
        model.scan(broken)
    with pytest.raises(InputError, match=r"shape \(5, 24\), got \(5, 25\)"):
        model.scan(views(1, w=25))
    with pytest.raises(REFUSED):
        model.scan(views(1)[0])


@pytest.mark.parametrize("device", ["cuda:99", "nonsense", ""])
def test_a_device_that_is_not_there_is_refused(name, device):
    with pytest.raises(InputError, match="device"):
        cheap(name, device=device).fit(views(3))


@pytest.mark.parametrize("prefix", ["", OPPONENT])
@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("perfect-memory", "seed", -1),
        ("chain", "window", -0.1),
        ("chain", "window", 0.0),  # twice nothing is nothing: a lost walk would widen it for ever
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
        ("mlp-mixture", "stretches", 0),
        ("adaboost", "pool", 0),
        ("adaboost", "features", 0),
        ("adaboost", "negatives_deg", ()),
        ("adaboost", "apart_deg", 200.0),  # no rotation is as far as that
        ("rbm", "units", 0),
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
        ("mushroom-body", "inputs", 361),  # of 360 neurons
    ],
)
def test_parameters_that_mean_nothing_are_refused(prefix, name, parameter, value):
    with pytest.raises(InputError) as refusal:
        cheap(prefix + name, **{parameter: value}).fit(views(6))
    assert parameter in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("steps", range(1, 13))
def test_rotation_networks_train_for_any_number_of_steps(steps):
    assert torch.isfinite(make_model("mlp-rotation", steps=steps).fit(views(3)).scan(views(1))).all()


@pytest.mark.parametrize(
    "name", ["perfect-memry", "", "Perfect-Memory", "opponent-", "opponent-perfect-memry", "opponent"]
)
def test_unknown_models_are_refused_with_the_known_ones(name):
    with pytest.raises(InputError, match=r"known: .*perfect-memory.*mushroom-body"):
        make_model(name)


def test_opponent_is_the_function_however_often_it_is_asked_for():
    from tussock import navigation

    make_model("opponent-perfect-memory")
    assert callable(navigation.opponent)
    assert callable(navigation.opponent)
