"""Models spelled with their parameters: the text and the model are each other's inverse, and what spells none is refused."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import views

from tussock.navigation.models import MODELS, OPPONENT, make_model, model_class
from tussock.navigation.models.base import Model
from tussock.world.errors import InputError
from tussock.world.specs import split_list

TUSSOCK = Path(sys.executable).with_name("tussock")


@st.composite
def chosen(draw, cls: type[Model]) -> dict[str, Any]:
    """Some of the parameters of a class."""
    parameters = {}
    for each in dataclasses.fields(cls):
        if each.init and each.name not in ("seed", "device") and draw(st.booleans()):
            values = value(each.default, cls.CHOICES.get(each.name, ()), cls.LIMITS.get(each.name))
            parameters[each.name] = draw(values)
    if parameters.get("columns", 36) * parameters.get("rows", 10) < parameters.get("inputs", 40):
        parameters["inputs"] = 1  # a mushroom body has no more of them than columns x rows
    return parameters


def value(default, choices, limits) -> st.SearchStrategy:
    """What a parameter with this default can be."""
    if isinstance(default, tuple):
        return st.lists(value(default[0], choices, limits), min_size=1, max_size=4).map(tuple)
    if default is None:
        return st.none() | st.integers(*map(int, limits or (1, 10**6)))
    if isinstance(default, int):
        return st.integers(*map(int, limits or (1, 10**4)))
    low, high = limits or (0.0, 1e300)
    numbers = st.floats(low, min(high, 1e300))
    names = st.sampled_from(sorted(choices)) if choices else st.nothing()
    return names if choices and not limits else names | numbers


@pytest.mark.parametrize("name", MODELS)
@given(st.data())
def test_a_model_is_its_spelling(name, data):
    cls = model_class(name)
    model = cls(**data.draw(chosen(cls)))
    text = str(model)
    again = make_model(text, seed=7)
    assert again.parameters == model.parameters | {"seed": 7}
    assert type(again) is type(model)
    assert str(again) == text
    opposed = make_model(OPPONENT + text)
    assert opposed.parameters == model.parameters
    assert str(opposed) == OPPONENT + text
    assert split_list(f"chain, {text} ,{OPPONENT}{text}") == ["chain", text, OPPONENT + text]


@pytest.mark.parametrize("name", MODELS)
def test_the_spelling_of_defaults_is_the_name(name):
    assert str(make_model(name, seed=3)) == name
    assert str(make_model(OPPONENT + name)) == OPPONENT + name


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
def test_a_spelled_model_has_what_the_text_says(text, parameters):
    for prefix in ("", OPPONENT):
        model = make_model(prefix + text.strip(), device="cpu", seed=5)
        name = text.split()[0]
        assert model.name == prefix + name
        assert model.parameters == make_model(name, seed=5, **parameters).parameters


def test_a_spelled_model_learns_as_the_same_made_with_keywords():
    spelled = make_model("opponent-infomax traversals=2 rate=baddeley", seed=1).fit(views(6))
    keywords = make_model("opponent-infomax", traversals=2, rate="baddeley", seed=1).fit(views(6))
    assert spelled.scan(views(3, 1)).equal(keywords.scan(views(3, 1)))
    assert not spelled.scan(views(3, 1)).equal(make_model("opponent-infomax", seed=1).fit(views(6)).scan(views(3, 1)))


REFUSED = {
    "mushroom-body colour=red": "mushroom-body has no parameter 'colour'; its parameters are columns, rows, cells, inputs",
    "perfect-memory window=1": "perfect-memory has no parameter 'window'; its parameters are none",
    "opponent-infomax name=x": "infomax has no parameter 'name'",
    "oracle cells=3": "unknown model 'oracle'; known: ",
    "infomax seed=3": "give it as --seed",
    "rbm device=cuda": "give it as --device",
    "infomax 3": "'3' is not a parameter; give name=value",
    "infomax rate = 3": "'rate' is not a parameter; give name=value",
    "infomax rate=": "'rate=' is not a parameter",
    "infomax =3": "'=3' is not a parameter",
    "infomax units=3 units=4": "units is given twice",
    "infomax rate=fast": "rate 'fast'; give one of z-scored, unit-range, baddeley or a number from 0",
    "infomax rate=nan": "rate nan",
    "infomax units=true": "units True; give a whole number",
    "infomax traversals=none": "traversals None; give a whole number",
    "rbm units=1,2": "units (1, 2); give a whole number",
    "rbm units=1.5": "units 1.5; give a whole number",
    "rbm rate=" + 400 * "9": "rate inf",
    "rbm units=" + 400 * "9": "units inf",
    "rbm rate=-1": "rate -1.0; give a number from 0",
    "mlp hidden_layer_sizes=()": "hidden_layer_sizes is empty",
    "mlp hidden_layer_sizes=(3": "hidden_layer_sizes ('(3',)",
    "mlp hidden_layer_sizes=3,,4": "hidden_layer_sizes (3, '', 4)",
    "mlp hidden_layer_sizes=(3,(4))": "hidden_layer_sizes (3, '(4)')",
    "mushroom-body inputs=361": "361 inputs",
    "mlp-rotation\nunits=0": "units 0",
}


def test_what_spells_no_model_is_refused_in_one_line_that_repeats_it():
    # Outside: with the type checks that are on here, some do not come so far.
    script = (
        "import json, sys\n"
        "from tussock import make_model\n"
        "from tussock.world.errors import InputError\n"
        "for text in json.load(sys.stdin):\n"
        "    try:\n"
        "        print('made', make_model(text))\n"
        "    except InputError as error:\n"
        "        print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], input=json.dumps(list(REFUSED)), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    for text, message in zip(REFUSED, done.stdout.splitlines(), strict=True):
        assert message.startswith(f"model {text!r}: ")
        assert REFUSED[text] in message


def test_what_is_spelled_is_not_given_again():
    with pytest.raises(InputError, match=r"'rbm units=3': units is also given"):
        make_model("rbm units=3", units=4)


def test_parameters_that_mean_nothing_are_refused_before_the_work():
    with pytest.raises(InputError, match="units 0"):
        make_model("rbm", units=0)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a,b", ["a", "b"]),
        (" a , b c=1 ", ["a", "b c=1"]),
        ("a x=(1,2),b", ["a x=(1,2)", "b"]),
        ("a x=(1, 2) y=(3,4), b", ["a x=(1, 2) y=(3,4)", "b"]),
        ("a x=1,2", ["a x=1", "2"]),
        ("", [""]),
        ("a,", ["a", ""]),
    ],
)
def test_a_list_is_parted_at_commas_outside_parentheses(text, parts):
    assert split_list(text) == parts


SMALL = ("--world", "tiny", "--seed", "2", "--size", "60x10", "--samples", "1", "--spacing-m", "0.1", "--json")


def printed(*arguments: str) -> dict:
    done = subprocess.run([TUSSOCK, *arguments, *SMALL], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_commands_take_a_spelled_model_and_say_which(tmp_path):
    texts = ["mlp hidden_layer_sizes=(8,4) max_iter=3", "mushroom-body cells=200 active=0.05"]
    rows = printed("compare", "--models", ", ".join(texts))["models"]
    assert list(rows) == texts
    for text in texts:
        evaluated = printed("evaluate", "--model", text)
        assert evaluated["model"] == text
        assert evaluated["median_error_deg"] == rows[text]["median_error_deg"]
    file = str(tmp_path / "m.safetensors")
    assert printed("train", "--model", texts[1], "--out", file)["model"] == texts[1]
    assert printed("evaluate", "--model", file)["model"] == texts[1]
