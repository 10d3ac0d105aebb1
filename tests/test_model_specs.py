"""Specs of models: a text with a name and parameters, and the model that it describes."""

import sys
from pathlib import Path
from typing import Any

import attrs
import pytest
from commands import printed
from hypothesis import given
from hypothesis import strategies as st
from scenes import views

from tussock.navigation.models import HEMIFIELDS, MODELS, OPPONENT, make_model, model_spec
from tussock.navigation.models.base import Model
from tussock.navigation.models.infomax import RATES
from tussock.navigation.models.registry import split_prefix
from tussock.world.errors import SettingError
from tussock.world.specs import split_list

TUSSOCK = Path(sys.executable).with_name("tussock")
NAMES = list(MODELS.builtin)
TWO_MEMORIES = (OPPONENT, HEMIFIELDS)  # prefixes of names


@st.composite
def chosen(draw, cls: type[Model]) -> dict[str, Any]:
    """Some of the parameters of a class."""
    fields = [each for each in attrs.fields(cls) if each.init and each.name not in ("seed", "device")]
    parameters = {each.name: draw(values(each.default, each.metadata)) for each in fields if draw(st.booleans())}
    if parameters.get("columns", 36) * parameters.get("rows", 10) < parameters.get("inputs", 40):
        parameters["inputs"] = 1  # a mushroom body has no more of them than columns x rows
    return parameters


def values(default: Any, metadata: Any) -> st.SearchStrategy:
    """Valid values of a parameter with this default."""
    if isinstance(default, bool):
        return st.booleans()
    if "choices" in metadata:
        return st.sampled_from(metadata["choices"])
    if isinstance(default, bool):
        return st.booleans()
    if isinstance(default, tuple):
        return st.lists(values(default[0], metadata), min_size=1, max_size=4).map(tuple)
    low, high = metadata["low"], metadata["high"]
    if default is None or isinstance(default, int):
        whole = st.integers(int(low), int(min(high, 100)))
        return whole | st.none() if default is None else whole
    numbers = st.floats(max(low, -1e300), min(high, 1e300))
    return numbers | st.sampled_from([*RATES]) if isinstance(default, str) else numbers


@pytest.mark.parametrize("name", NAMES)
@given(st.data())
def test_the_spec_of_a_model_makes_the_same_model(name, data):
    cls = MODELS.find(name)
    model = cls(**data.draw(chosen(cls)))
    text = str(model)
    again = make_model(text, seed=7)
    assert again.parameters == model.parameters | {"seed": 7}
    assert type(again) is type(model)
    assert str(again) == str(model_spec(text)) == text
    for prefix in TWO_MEMORIES:
        both = make_model(prefix + text)
        assert both.parameters == model.parameters
        assert str(both) == str(model_spec(prefix + text)) == prefix + text
        assert split_list(f"chain, {text} ,{prefix}{text}") == ["chain", text, prefix + text]


@pytest.mark.parametrize("name", NAMES)
def test_the_spec_of_defaults_is_the_name(name):
    assert str(make_model(name, seed=3)) == name
    for prefix in TWO_MEMORIES:
        assert str(make_model(prefix + name)) == prefix + name


@pytest.mark.parametrize(
    ("text", "parameters"),
    [
        ("mushroom-body inputs=10 cells=2000", {"inputs": 10, "cells": 2000}),
        ("  mushroom-body\t active=1e-2 ", {"active": 0.01}),
        ("infomax rate=baddeley", {"rate": "baddeley"}),
        ("infomax rate=0.1 units=none", {"rate": 0.1, "units": None}),
        ("mlp hidden_layer_sizes=100,50", {"hidden_layer_sizes": (100, 50)}),
        ("mlp hidden_layer_sizes=(100, 50)", {"hidden_layer_sizes": (100, 50)}),
        ("mlp hidden_layer_sizes=(100,)", {"hidden_layer_sizes": (100,)}),
        ("mlp hidden_layer_sizes=100 solver=lbfgs", {"hidden_layer_sizes": (100,), "solver": "lbfgs"}),
        ("adaboost negatives_deg=-45", {"negatives_deg": (-45.0,)}),
    ],
)
def test_a_spec_sets_parameters(text, parameters):
    for prefix in ("", *TWO_MEMORIES):
        model = make_model(prefix + text.strip(), device="cpu", seed=5)
        name = text.split()[0]
        assert model.name == prefix + name
        assert model.parameters == make_model(name, seed=5, **parameters).parameters


FORMER = [(name, former, present) for name in NAMES for former, present in MODELS.find(name).renamed.items()]


@pytest.mark.parametrize(("name", "former", "present"), FORMER)
@pytest.mark.parametrize("prefix", ["", *TWO_MEMORIES])
def test_former_names_of_parameters_are_understood_and_present_ones_printed(prefix, name, former, present):
    name = prefix + name
    text = f"{name} {former}=7"
    assert str(make_model(text)) == str(model_spec(text)) == str(make_model(name, **{former: 7}))
    assert f" {present}=7" in str(make_model(text))
    for twice in (f"{text} {present}=6", f"{text} {former}=6"):
        with pytest.raises(SettingError, match=f"{present} is given twice"):
            make_model(twice)
    with pytest.raises(SettingError, match=present):
        make_model(text, **{present: 6})
    with pytest.raises(SettingError, match=former):
        make_model(name, **{former: 7, present: 6})


def test_former_names_are_those_that_were_renamed():
    assert {(former, present) for _, former, present in FORMER} == {
        ("strange", "max_mismatch"), ("sway_deg", "jitter_deg"), ("penalty", "weight_decay"), ("stretches", "segments"),
        ("mined", "hard_negatives"), ("apart_deg", "tolerance_deg"),
    }  # fmt: skip


def test_a_model_of_a_spec_learns_as_the_same_made_with_keywords():
    of_spec = make_model("opponent-infomax traversals=2 rate=baddeley", seed=1).fit(views(6))
    keywords = make_model("opponent-infomax", traversals=2, rate="baddeley", seed=1).fit(views(6))
    assert of_spec.scan(views(3, 1)).equal(keywords.scan(views(3, 1)))
    assert not of_spec.scan(views(3, 1)).equal(make_model("opponent-infomax", seed=1).fit(views(6)).scan(views(3, 1)))


@pytest.mark.parametrize(
    "name",
    [
        "perfect-memry",
        "",
        "Perfect-Memory",
        "opponent-",
        "opponent-perfect-memry",
        "opponent",
        "hemifields-",
        "hemifields-perfect-memry",
        "hemifields",
        "hemifields-opponent-perfect-memory",
        "opponent-hemifields-perfect-memory",
    ],
)
def test_an_unknown_model_is_refused_with_the_known_ones(name):
    for make in (make_model, model_spec):
        with pytest.raises(SettingError, match=r"known: .*perfect-memory.*mushroom-body"):
            make(name)


# What is refused, and what the message holds.
REFUSED = {
    "mushroom-body colour=red": ["no parameter 'colour'", "columns, rows, cells, inputs"],
    "perfect-memory window=1": ["no parameter 'window'", "none"],
    "opponent-infomax name=x": ["no parameter 'name'"],
    "hemifields-infomax name=x": ["no parameter 'name'"],
    "hemifields-mushroom-body inputs=361": ["361"],
    "oracle cells=3": ["'oracle'", "known:"],
    "infomax seed=3": ["--seed"],
    "rbm device=cuda": ["--device"],
    "infomax 3": ["'3'", "name=value"],
    "infomax rate = 3": ["'rate'", "name=value"],
    "infomax rate=": ["'rate='"],
    "infomax =3": ["'=3'"],
    "infomax units=3 units=4": ["units", "twice"],
    "infomax rate=fast": ["rate", "'fast'", "z-scored, unit-range, baddeley", "number from 0"],
    "infomax rate=nan": ["rate", "nan"],
    "infomax units=true": ["units", "True", "whole number"],
    "infomax traversals=none": ["traversals", "None", "whole number"],
    "rbm units=1,2": ["units", "(1, 2)", "whole number"],
    "rbm units=1.5": ["units", "1.5", "whole number"],
    "rbm rate=" + 400 * "9": ["rate", "inf"],
    "rbm units=" + 400 * "9": ["units", "inf"],
    "rbm rate=-1": ["rate", "-1.0", "number from 0"],
    "mlp hidden_layer_sizes=()": ["hidden_layer_sizes", "at least one"],
    "mlp hidden_layer_sizes=(3": ["hidden_layer_sizes", "('(3',)"],
    "mlp hidden_layer_sizes=3,,4": ["hidden_layer_sizes", "(3, '', 4)"],
    "mlp hidden_layer_sizes=(3,(4))": ["hidden_layer_sizes", "(3, '(4)')"],
    "mushroom-body inputs=361": ["361"],
    "mlp-rotation\nunits=0": ["units", "0"],
}


@pytest.mark.parametrize("text", REFUSED)
def test_an_invalid_spec_is_refused_in_one_line(text):
    with pytest.raises(SettingError) as refusal:
        make_model(text)
    message = str(refusal.value)
    assert "\n" not in message
    assert split_prefix(text.split()[0])[1] in message
    for part in REFUSED[text]:
        assert part in message


def test_a_parameter_in_the_spec_is_not_given_as_a_keyword_too():
    with pytest.raises(SettingError, match=r"'rbm units=3': units is also given"):
        make_model("rbm units=3", units=4)


SMALL = ["--world", "tiny", "--size", "40x10", "--route-length-m", "1", "--spacing-m", "0.1"]


def test_commands_take_a_spec_and_report_it(capfd, tmp_path):
    texts = ["mlp hidden_layer_sizes=(8,4) max_iter=3", "mushroom-body cells=200 active=0.05"]
    rows = printed(capfd, "compare", *SMALL, "--models", ", ".join(texts))["models"]
    assert list(rows) == texts
    for text in texts:
        evaluated = printed(capfd, "evaluate", *SMALL, "--model", text)
        assert evaluated["model"] == text
        assert evaluated["median_error_deg"] == rows[text]["median_error_deg"]
    file = str(tmp_path / "m.safetensors")
    assert printed(capfd, "train", *SMALL, "--model", texts[1], "--out", file)["model"] == texts[1]
    assert printed(capfd, "evaluate", *SMALL, "--model", file)["model"] == texts[1]
