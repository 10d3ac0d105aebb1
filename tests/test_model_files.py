"""Model files: what was saved comes back, and what is no model file is refused in one line that names it."""

import json
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import safetensors
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.torch import save_file
from scenes import views

from tussock.navigation.encoding import Encoding
from tussock.navigation.models import MODELS, make_model
from tussock.navigation.models.base import Model
from tussock.navigation.models.files import load_model, save_model
from tussock.render.eye import Eye
from tussock.world.errors import InputError

CHEAPER = {
    "mlp": {"max_iter": 5},
    "mlp-rotation": {"steps": 5},
    "mlp-mixture": {"steps": 5, "stretches": 2},
    "adaboost": {"pool": 50, "features": 5, "passes": 1},
    "rbm": {"epochs": 2},
    "autoencoder": {"epochs": 2},
    "mushroom-body": {"cells": 100, "active": 0.05},
}
NAMES = [*MODELS, "opponent-perfect-memory", "opponent-autoencoder"]


@cache
def trained(name: str) -> Model:
    return make_model(name, **CHEAPER.get(name, {})).fit(views(4))


@pytest.fixture
def saved(tmp_path) -> Path:
    """A file that holds infomax with all that can be beside it."""
    path = tmp_path / "infomax.model"
    encoding, eye = Encoding.named("edges", resize=3), Eye(width=72, height=15, samples=2)
    save_model(trained("infomax"), path, encoding=encoding, eye=eye, poses=np.arange(12.0).reshape(4, 3))
    return path


def rewrite(path: Path, change: Callable[[dict, dict], object]) -> None:
    """Let `change(header, tensors)` at what a file holds; what it returns is written for the header."""
    with safetensors.safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["tussock"])
        tensors = {key: file.get_tensor(key).clone() for key in file.keys()}  # noqa: SIM118 (it is no dict)
    header = change(header, tensors)
    save_file(tensors, path, {"tussock": json.dumps(header)})


def refuses(path: Path, **options) -> str:
    with pytest.raises(InputError) as refusal:
        load_model(path, **options)
    message = str(refusal.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_what_was_saved_comes_back(saved):
    loaded = load_model(saved)
    assert loaded.model.name == "infomax"
    assert loaded.model.shape == (5, 24)
    assert torch.equal(loaded.model.scan(views(3, 1)), trained("infomax").scan(views(3, 1)))
    assert loaded.encoding == Encoding.named("edges", resize=3)
    assert loaded.eye == Eye(width=72, height=15, samples=2)
    assert loaded.poses.tolist() == np.arange(12.0).reshape(4, 3).tolist()


def test_what_is_not_known_comes_back_as_none(tmp_path):
    save_model(trained("rbm"), tmp_path / "rbm")
    loaded = load_model(tmp_path / "rbm")
    assert loaded.encoding is loaded.eye is loaded.poses is None


def test_parameters_come_back_with_their_types(tmp_path):
    model = make_model("mlp", hidden_layer_sizes=(6, 5), negatives_deg=(90.0,), max_iter=3, seed=9).fit(views(4))
    save_model(model, tmp_path / "mlp")
    loaded = load_model(tmp_path / "mlp").model
    assert loaded.parameters == model.parameters
    assert loaded.hidden_layer_sizes == (6, 5)
    assert (loaded.predict(views(3, 1)) == model.predict(views(3, 1))).all()


def test_a_loaded_model_learns_on(tmp_path):
    for name in ("perfect-memory", "infomax", "mushroom-body"):
        model = make_model(name, **CHEAPER.get(name, {})).fit(views(4))
        save_model(model, tmp_path / name)
        loaded = load_model(tmp_path / name).model.partial_fit(views(3, 1))
        assert torch.equal(loaded.scan(views(2, 2)), model.partial_fit(views(3, 1)).scan(views(2, 2)))


def test_a_loaded_model_needs_its_file_no_longer(saved):
    model = load_model(saved).model
    saved.write_bytes(bytes(saved.stat().st_size))  # in place: tensors that look into the file would see it
    assert torch.equal(model.learned["weights"], trained("infomax").learned["weights"])


@pytest.mark.parametrize("name", NAMES)
def test_the_same_model_gives_the_same_bytes(name, tmp_path):
    for file in ("one", "other"):
        save_model(trained(name), tmp_path / file, poses=np.zeros((4, 3)))
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


def test_another_model_than_expected_is_refused_naming_both(saved):
    assert load_model(saved, expect="infomax").model.name == "infomax"
    for expected in ("mushroom-body", "opponent-infomax"):
        message = refuses(saved, expect=expected)
        assert "'infomax'" in message
        assert repr(expected) in message


def test_a_device_that_is_not_there_is_refused(saved):
    with pytest.raises(InputError, match="device 'nonsense'"):
        load_model(saved, device="nonsense")


def test_what_is_no_file_is_refused(tmp_path):
    refuses(tmp_path / "missing")
    refuses(tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"x", b"\x00" * 8, b"\xff" * 64, b"x_m,y_m\n1,2\n", b"\x02" + b"\x00" * 7 + b"{}"]
)
def test_what_is_no_model_file_is_refused(content, tmp_path):
    path = tmp_path / "model"
    path.write_bytes(content)
    refuses(path)


def test_a_file_cut_short_is_refused(saved):
    whole = saved.read_bytes()
    for length in (1, 7, 8, 9, 100, len(whole) // 2, len(whole) - 1):
        saved.write_bytes(whole[:length])
        refuses(saved)


@settings(max_examples=150)
@given(st.data())
def test_a_byte_gone_wrong_is_refused_or_harmless(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("flip") / "model"
    save_model(trained("rbm"), path, eye=Eye(), poses=np.zeros((4, 3)), encoding=Encoding.named("sky"))
    content = bytearray(path.read_bytes())
    header = 8 + int.from_bytes(content[:8], "little")
    content[data.draw(st.integers(0, header + 40))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    try:
        load_model(path)
    except InputError as error:
        assert str(path) in str(error)  # noqa: PT017 (it need not be raised)


def test_a_safetensors_file_of_something_else_is_refused(tmp_path):
    save_file({"learned.weights": torch.zeros(3)}, tmp_path / "other")
    refuses(tmp_path / "other")
    save_file({"learned.weights": torch.zeros(3)}, tmp_path / "other", {"format": "pt"})
    refuses(tmp_path / "other")


@pytest.mark.parametrize("text", ["", "{", "nonsense", "[" * 100_000], ids=["empty", "half", "words", "deep"])
def test_a_header_that_is_no_json_is_refused(text, tmp_path):
    save_file({"learned.weights": torch.zeros(3)}, tmp_path / "other", {"tussock": text})
    refuses(tmp_path / "other")


@pytest.mark.parametrize("version", [2, 0, None, "1"])
def test_another_version_is_refused_naming_both(saved, version):
    rewrite(saved, lambda header, tensors: header | {"version": version})
    message = refuses(saved)
    assert f"version {version}" in message
    assert "version 1" in message


@pytest.mark.parametrize("header", [[], ["version", 1], 1, "tussock", None, {}, {"version": 1}], ids=str)
@pytest.mark.parametrize("expect", [None, "infomax"])
def test_a_header_of_another_kind_is_refused(saved, header, expect):
    rewrite(saved, lambda old, tensors: header)
    refuses(saved, expect=expect)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("model", "infomix"),
        ("model", "opponent-infomix"),
        ("model", "rbm"),  # which learns other tensors
        ("model", 7),
        ("model", None),
        ("model", ["infomax"]),
        ("parameters", {"unitz": 3}),
        ("parameters", {"device": "cpu"}),
        ("parameters", {"name": "x"}),
        ("parameters", ["units"]),
        ("parameters", None),
        ("parameters", {"rate": -1.0}),
        ("parameters", {"rate": "fast"}),
        ("shape", [5]),
        ("shape", [5, 24, 1]),
        ("shape", [5, 25]),
        ("shape", [24, 5]),
        ("shape", ["5", "24"]),
        ("shape", [5.0, 24.0]),
        ("shape", [10**9, 10**9]),
        ("shape", [-5, 24]),
        ("shape", [0, 0]),
        ("shape", None),
        ("shape", {"h": 5, "w": 24}),
        ("encoding", "nonsense"),
        ("encoding", 5),
        ("encoding", ["grey"]),
        ("eye", {"width": 1}),
        ("eye", {"wide": 72}),
        ("eye", {"width": "72"}),
        ("eye", []),
        ("eye", "eye"),
    ],
    ids=str,
)
def test_a_header_with_something_wrong_in_it_is_refused(saved, key, value):
    rewrite(saved, lambda header, tensors: header | {key: value})
    refuses(saved)


@pytest.mark.parametrize("key", ["version", "model", "parameters", "shape", "encoding", "eye"])
@pytest.mark.parametrize("expect", [None, "infomax"])
def test_a_header_with_something_missing_is_refused(saved, key, expect):
    rewrite(saved, lambda header, tensors: {k: value for k, value in header.items() if k != key})
    refuses(saved, expect=expect)


LEARNED = [(name, key) for name in NAMES for key in trained(name).learned]


@pytest.mark.parametrize(("name", "key"), LEARNED)
def test_a_tensor_that_is_missing_is_refused(name, key, tmp_path):
    path = tmp_path / "model"
    save_model(trained(name), path)
    rewrite(path, lambda header, tensors: (tensors.pop(f"learned.{key}"), header)[1])
    refuses(path)


def change(path: Path, key: str, into: Callable[[torch.Tensor], torch.Tensor]) -> None:
    rewrite(path, lambda header, tensors: (tensors.update({key: into(tensors[key])}), header)[1])


@pytest.mark.parametrize(("name", "key"), [(name, key) for name, key in LEARNED if trained(name).learned[key].ndim > 0])
def test_a_tensor_of_another_shape_is_refused(name, key, tmp_path):
    path = tmp_path / "model"
    for into in (lambda t: t[..., :-1].clone(), lambda t: torch.cat([t, t], dim=-1), lambda t: t[None].clone()):
        save_model(trained(name), path)
        change(path, f"learned.{key}", into)
        refuses(path)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
@pytest.mark.parametrize(
    ("name", "key"), [(name, key) for name, key in LEARNED if trained(name).learned[key].is_floating_point()]
)
def test_a_number_that_is_not_finite_is_refused(name, key, bad, tmp_path):
    path = tmp_path / "model"
    save_model(trained(name), path)

    def spoil(tensor: torch.Tensor) -> torch.Tensor:
        tensor.view(-1)[-1] = bad
        return tensor

    change(path, f"learned.{key}", spoil)
    refuses(path)


@pytest.mark.parametrize("neuron", [-1, 10**6])
def test_a_mushroom_body_wired_to_no_neuron_is_refused(neuron, tmp_path):
    path = tmp_path / "model"
    save_model(trained("mushroom-body"), path)
    change(path, "learned.wiring", lambda wiring: torch.full_like(wiring, neuron))
    refuses(path)


@pytest.mark.parametrize(
    "poses",
    [torch.zeros(4, 2).double(), torch.zeros(12).double(), torch.zeros(4, 3, dtype=torch.int64), torch.full((4, 3), torch.nan).double()],
    ids=["two columns", "flat", "integers", "NaN"],
)  # fmt: skip
def test_poses_that_are_none_are_refused(saved, poses):
    change(saved, "poses", lambda _: poses)
    refuses(saved)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_that_has_learned_nothing_is_not_saved(name, tmp_path):
    with pytest.raises(InputError, match=r"model: .*learned nothing"):
        save_model(make_model(name), tmp_path / "model")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    path = tmp_path / "nowhere" / "model"
    with pytest.raises(InputError, match="no folder") as refusal:
        save_model(trained("infomax"), path)
    assert str(path) in str(refusal.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_for_a_name_is_refused(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        save_model(trained("infomax"), tmp_path)


def test_in_a_read_only_folder_nothing_is_left(saved, monkeypatch):
    before = saved.read_bytes()
    monkeypatch.setattr(os, "access", lambda *_: False)  # who runs the tests may be allowed everything
    with pytest.raises(InputError, match="read-only"):
        save_model(trained("rbm"), saved)
    assert [each.read_bytes() for each in saved.parent.iterdir()] == [before]


def test_where_writing_fails_the_old_file_stays(saved, monkeypatch):
    before = saved.read_bytes()

    def full(path: Path, data: bytes) -> None:
        with path.open("wb") as file:
            file.write(data[:50])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="No space left"):
        save_model(trained("rbm"), saved)
    assert [each.read_bytes() for each in saved.parent.iterdir()] == [before]
