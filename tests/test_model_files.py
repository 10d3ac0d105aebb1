"""Trained models and their files: what was saved is read back, and anything else is refused in one line that names the file."""

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
from small_models import small

from tussock.navigation.encoding import STEPS, Encoding
from tussock.navigation.models import MODELS, files, make_model
from tussock.navigation.models.base import Model, model
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.navigation.models.infomax import Infomax
from tussock.render.eye import Eye
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.settings import number

NAMES = [
    *MODELS.builtin,
    "opponent-perfect-memory",
    "opponent-autoencoder",
    "hemifields-perfect-memory",
    "hemifields-rbm",
]


@cache
def trained(name: str) -> Model:
    return small(name).fit(views(4))


@pytest.fixture
def saved(tmp_path) -> Path:
    """A file that holds infomax with its encoding, eye and poses."""
    path = tmp_path / "infomax.model"
    encoding, eye = Encoding.named("edges", resize=3), Eye(width=72, height=15, samples=2)
    save(trained("infomax"), path, encoding=encoding, eye=eye, poses=np.arange(12.0).reshape(4, 3))
    return path


def save(model: Model, path: Path, **known) -> None:
    save_model(TrainedModel(model=model, **known), path)


def rewrite(path: Path, change: Callable[[dict, dict], object]) -> None:
    """Change what a file holds by `change(header, tensors)`, which returns the new header."""
    with safetensors.safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["tussock"])
        tensors = {key: file.get_tensor(key).clone() for key in file.keys()}  # noqa: SIM118 (it is no dict)
    header = change(header, tensors)
    save_file(tensors, path, {"tussock": json.dumps(header)})


def refuses(path: Path, **options) -> str:
    with pytest.raises(FileError) as refusal:
        load_model(path, **options)
    message = str(refusal.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_a_trained_model_is_read_back_from_its_file(saved):
    loaded = load_model(saved)
    assert loaded.model.name == "infomax"
    assert loaded.model.shape == (5, 24)
    assert torch.equal(loaded.model.scan(views(3, 1)), trained("infomax").scan(views(3, 1)))
    assert loaded.encoding == Encoding.named("edges", resize=3)
    assert loaded.eye == Eye(width=72, height=15, samples=2)
    assert loaded.poses.tolist() == np.arange(12.0).reshape(4, 3).tolist()


def test_unknown_encoding_eye_and_poses_are_read_back_as_none(tmp_path):
    save(trained("rbm"), tmp_path / "rbm")
    loaded = load_model(tmp_path / "rbm")
    assert loaded.encoding is loaded.eye is loaded.poses is None


def test_parameters_are_read_back_with_their_types(tmp_path):
    model = make_model("mlp", hidden_layer_sizes=(6, 5), negatives_deg=(90.0,), max_iter=3, seed=9).fit(views(4))
    save(model, tmp_path / "mlp")
    loaded = load_model(tmp_path / "mlp").model
    assert loaded.parameters == model.parameters
    assert loaded.hidden_layer_sizes == (6, 5)
    assert (loaded.predict(views(3, 1)) == model.predict(views(3, 1))).all()


def test_a_loaded_model_can_learn_further_views(tmp_path):
    for name in ("perfect-memory", "infomax", "mushroom-body", "hemifields-infomax"):
        model = small(name).fit(views(4))
        save(model, tmp_path / name)
        loaded = load_model(tmp_path / name).model.partial_fit(views(3, 1))
        assert torch.equal(loaded.scan(views(2, 2)), model.partial_fit(views(3, 1)).scan(views(2, 2)))


def test_a_loaded_model_needs_its_file_no_longer(saved):
    model = load_model(saved).model
    saved.write_bytes(bytes(saved.stat().st_size))  # in place: tensors that look into the file would see it
    assert torch.equal(model.learned["weights"], trained("infomax").learned["weights"])


@pytest.mark.parametrize("name", NAMES)
def test_the_same_model_gives_the_same_bytes(name, tmp_path):
    for file in ("one", "other"):
        save(trained(name), tmp_path / file, poses=np.zeros((4, 3)))
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


def test_another_model_than_expected_is_refused_naming_both(saved):
    assert load_model(saved, expect="infomax").model.name == "infomax"
    for expected in ("mushroom-body", "opponent-infomax", "hemifields-infomax"):
        message = refuses(saved, expect=expected)
        assert "'infomax'" in message
        assert repr(expected) in message


def test_a_device_that_is_not_there_is_refused(saved):
    with pytest.raises(SettingError, match="device 'nonsense'"):
        load_model(saved, device="nonsense")


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    refuses(tmp_path / "missing")
    refuses(tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"x", b"\x00" * 8, b"\xff" * 64, b"x_m,y_m\n1,2\n", b"\x02" + b"\x00" * 7 + b"{}"]
)
def test_a_file_of_something_else_is_refused(content, tmp_path):
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
def test_a_wrong_byte_is_refused_or_harmless(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("flip") / "model"
    save(trained("rbm"), path, eye=Eye(), poses=np.zeros((4, 3)), encoding=Encoding.named("sky"))
    content = bytearray(path.read_bytes())
    header = 8 + int.from_bytes(content[:8], "little")
    content[data.draw(st.integers(0, header + 40))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    try:
        load_model(path)
    except FileError as error:
        assert str(path) in str(error)  # noqa: PT017 (it need not be raised)


def test_a_safetensors_file_of_something_else_is_refused(tmp_path):
    save_file({"learned.weights": torch.zeros(3)}, tmp_path / "other")
    refuses(tmp_path / "other")
    save_file({"learned.weights": torch.zeros(3)}, tmp_path / "other", {"format": "pt"})
    refuses(tmp_path / "other")


@pytest.mark.parametrize("text", ["", "{", "nonsense", "[" * 100_000], ids=["empty", "half", "words", "deep"])
def test_a_header_that_is_not_json_is_refused(text, tmp_path):
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
        ("model", "opponent-infomax"),  # which learns two of them
        ("model", "hemifields-infomax"),
        ("model", "hemifields-infomix"),
        ("model", "hemifields-opponent-infomax"),
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


@pytest.mark.parametrize("name", NAMES)
def test_a_tensor_that_is_missing_is_refused(name, tmp_path):
    path = tmp_path / "model"
    for key in trained(name).learned:
        save(trained(name), path)
        rewrite(path, lambda header, tensors, key=key: (tensors.pop(f"learned.{key}"), header)[1])
        refuses(path)


def change(path: Path, key: str, into: Callable[[torch.Tensor], torch.Tensor]) -> None:
    rewrite(path, lambda header, tensors: (tensors.update({key: into(tensors[key])}), header)[1])


@pytest.mark.parametrize("name", NAMES)
def test_a_tensor_of_another_shape_is_refused(name, tmp_path):
    path = tmp_path / "model"
    for key in [key for key, tensor in trained(name).learned.items() if tensor.ndim > 0]:
        for into in (lambda t: t[..., :-1].clone(), lambda t: torch.cat([t, t], dim=-1), lambda t: t[None].clone()):
            save(trained(name), path)
            change(path, f"learned.{key}", into)
            refuses(path)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", NAMES)
def test_a_number_that_is_not_finite_is_refused(name, bad, tmp_path):
    path = tmp_path / "model"

    def spoil(tensor: torch.Tensor) -> torch.Tensor:
        tensor.view(-1)[-1] = bad
        return tensor

    for key in [key for key, tensor in trained(name).learned.items() if tensor.is_floating_point()]:
        save(trained(name), path)
        change(path, f"learned.{key}", spoil)
        refuses(path)


@pytest.mark.parametrize("neuron", [-1, 10**6])
def test_a_mushroom_body_wired_to_neurons_that_do_not_exist_is_refused(neuron, tmp_path):
    path = tmp_path / "model"
    save(trained("mushroom-body"), path)
    change(path, "learned.wiring", lambda wiring: torch.full_like(wiring, neuron))
    refuses(path)


BAD_POSES = {
    "two columns": np.zeros((4, 2)),
    "flat": np.zeros(12),
    "integers": np.zeros((4, 3), dtype=np.int64),
    "NaN": np.full((4, 3), np.nan),
}


@pytest.mark.parametrize("poses", BAD_POSES.values(), ids=BAD_POSES)
def test_invalid_poses_in_a_file_are_refused(saved, poses):
    change(saved, "poses", lambda _: torch.tensor(poses))
    assert "poses" in refuses(saved)


@pytest.mark.parametrize("poses", [*BAD_POSES.values(), [(0.0, 0.0, 0.0)] * 4], ids=[*BAD_POSES, "list"])
def test_invalid_poses_are_refused_when_a_trained_model_is_made(poses):
    with pytest.raises(SettingError, match="poses"):
        TrainedModel(model=trained("infomax"), poses=poses)


@pytest.mark.parametrize("count", [3, 5])
@pytest.mark.parametrize("name", ["perfect-memory", "chain"])
def test_snapshots_need_as_many_poses(name, count, tmp_path):
    with pytest.raises(SettingError, match=f"{count} poses for 4 snapshots"):
        TrainedModel(model=trained(name), poses=np.zeros((count, 3)))
    path = tmp_path / "model"
    save(trained(name), path, poses=np.zeros((4, 3)))
    change(path, "poses", lambda _: torch.zeros(count, 3, dtype=torch.float64))
    assert f"{count} poses for 4 snapshots" in refuses(path)


def test_the_index_of_a_compass_needs_a_pose():
    assert len(TrainedModel(model=trained("visual-compass"), poses=np.zeros((4, 3))).poses) == 4
    with pytest.raises(SettingError, match="3 poses"):
        TrainedModel(model=trained("visual-compass"), poses=np.zeros((3, 3)))


def test_a_model_that_learned_more_since_is_not_saved_with_its_old_poses(tmp_path):
    learner = small("perfect-memory").fit(views(4))
    record = TrainedModel(model=learner, poses=np.zeros((4, 3)))
    learner.partial_fit(views(2, 1))
    with pytest.raises(SettingError, match="4 poses for 6 snapshots"):
        save_model(record, tmp_path / "model")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("field", ["model", "encoding", "eye"])
def test_anything_but_a_model_an_encoding_and_an_eye_is_refused(field):
    with pytest.raises(SettingError, match=field):
        TrainedModel(**({"model": trained("infomax")} | {field: "edges"}))


@pytest.mark.parametrize("name", NAMES)
def test_an_untrained_model_is_refused(name):
    with pytest.raises(SettingError, match="learned nothing"):
        TrainedModel(model=make_model(name))


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    path = tmp_path / "nowhere" / "model"
    with pytest.raises(InputError, match="no folder") as refusal:
        save(trained("infomax"), path)
    assert str(path) in str(refusal.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_for_a_name_is_refused(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        save(trained("infomax"), tmp_path)


def test_in_a_read_only_folder_nothing_is_left(saved, monkeypatch):
    before = saved.read_bytes()
    monkeypatch.setattr(os, "access", lambda *_: False)  # the tests may run with all rights
    with pytest.raises(InputError, match="read-only"):
        save(trained("rbm"), saved)
    assert [each.read_bytes() for each in saved.parent.iterdir()] == [before]


def test_the_old_file_stays_if_writing_fails(saved, monkeypatch):
    before = saved.read_bytes()

    def full(path: Path, data: bytes) -> None:
        with path.open("wb") as file:
            file.write(data[:50])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="No space left"):
        save(trained("rbm"), saved)
    assert [each.read_bytes() for each in saved.parent.iterdir()] == [before]


# Former names


def test_a_file_with_former_names_of_parameters_is_read(tmp_path):
    path = tmp_path / "model"
    save(trained("adaboost"), path)
    rewrite(path, lambda header, tensors: header | {"parameters": renamed_back(header["parameters"])})
    loaded = load_model(path).model
    assert loaded.parameters == trained("adaboost").parameters
    assert torch.equal(loaded.scan(views(3, 1)), trained("adaboost").scan(views(3, 1)))


def renamed_back(parameters: dict) -> dict:
    former = {"hard_negatives": "mined", "tolerance_deg": "apart_deg"}
    assert former.keys() <= parameters.keys()
    return {former.get(name, name): value for name, value in parameters.items()}


# Models and steps from outside


@model
class Tuned(Infomax):
    """A model from outside that derives from a built-in one."""

    name = "tuned"
    gain: float = number(1.0, low=0)

    def _scan(self, views):
        return self.gain * super()._scan(views)


class Bare:
    """A model from outside that does not derive from `Model`."""

    def fit(self, views):
        return self

    def scan(self, views):
        return views.mean(dim=1)


class Halve:
    """A step of encodings from outside."""

    def __call__(self, images):
        return images / 2


@pytest.fixture
def outside(monkeypatch):
    """Registries that forget afterwards what a test enters."""
    for registry in (MODELS, STEPS):
        monkeypatch.setattr(registry, "_registered", {})


@pytest.mark.parametrize("prefix", ["", "opponent-"])
def test_a_file_with_a_model_from_outside_needs_its_class_and_imports_nothing(prefix, tmp_path, outside, monkeypatch):
    path, name = tmp_path / "model", f"{prefix}{Tuned.__module__}:Tuned"
    learner = make_model(name, gain=3).fit(views(4))
    save(learner, path)
    assert load_model(path).model.attractive.gain == 3 if prefix else load_model(path).model.gain == 3
    assert torch.equal(load_model(path, expect=name).model.scan(views(2, 1)), learner.scan(views(2, 1)))

    monkeypatch.setattr(MODELS, "_registered", {})
    message = refuses(path)
    assert f"{Tuned.__module__}:Tuned" in message
    assert "--use" in message
    assert "damaged" not in message
    MODELS.find(f"{Tuned.__module__}:Tuned")  # as --use does
    load_model(path)


def test_a_file_has_the_class_of_a_registered_model_whatever_its_name(tmp_path, outside, monkeypatch):
    MODELS.register("mine", Tuned)
    save(make_model("mine gain=2").fit(views(4)), tmp_path / "model")
    assert load_model(tmp_path / "model", expect="mine").model.gain == 2
    monkeypatch.setattr(MODELS, "_registered", {})
    assert f"{Tuned.__module__}:Tuned" in refuses(tmp_path / "model")


def test_a_file_with_an_encoding_step_from_outside_needs_its_class(tmp_path, outside, monkeypatch):
    path, step = tmp_path / "model", f"{Halve.__module__}:Halve"
    encoding = Encoding.parse(f"grey | {step}")
    save(trained("infomax"), path, encoding=encoding)
    assert str(load_model(path).encoding) == str(encoding)
    monkeypatch.setattr(STEPS, "_registered", {})
    message = refuses(path)
    assert step in message
    assert "--use" in message
    assert "damaged" not in message


def test_a_model_that_does_not_derive_from_model_is_trained_but_not_saved(tmp_path):
    record = TrainedModel(model=Bare(), poses=np.zeros((2, 3)))
    with pytest.raises(SettingError, match="derive"):
        save_model(record, tmp_path / "model")
    assert list(tmp_path.iterdir()) == []


# Too little memory


@pytest.mark.parametrize(
    "error",
    [
        torch.cuda.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB"),
        MemoryError("Unable to allocate 2.00 GiB"),
        RuntimeError("[enforce fail at alloc_cpu.cpp:127] . DefaultCPUAllocator: can't allocate memory"),
    ],
    ids=lambda error: type(error).__name__,
)
@pytest.mark.parametrize("where", ["_read", "_trained"])
def test_too_little_memory_is_not_called_damage(saved, error, where, monkeypatch):
    def full(*_):
        raise error

    monkeypatch.setattr(files, where, full)
    with pytest.raises(SettingError, match="too little memory") as refusal:
        load_model(saved)
    assert str(saved) in str(refusal.value)
    assert "'cpu'" in str(refusal.value)
    assert "damaged" not in str(refusal.value)
