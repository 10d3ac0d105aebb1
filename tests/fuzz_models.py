"""Model files, and anything given to models: used or refused. No code is run, and no memory is taken for what a file does not hold."""

import json
import os
import pickle

import numpy as np
import torch
from fuzzing import FOLDER, answer, damaged, damaged_json, holds, main
from hypothesis import example, given
from hypothesis import strategies as st
from safetensors.torch import load, save
from scenes import views
from small_models import small

from tussock.navigation.encoding import STEPS, Encoding
from tussock.navigation.models import MODELS
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.render import Eye

NAMES = [*MODELS.builtin, "opponent-perfect-memory", "opponent-mlp", "hemifields-infomax"]
H, W = 3, 8


def model_file(name: str) -> bytes:
    """The bytes of an undamaged model file."""
    path = FOLDER / "undamaged.safetensors"
    model = small(name).fit(views(4, h=H, w=W))
    encoding, eye = Encoding.named("edges", 2, 1), Eye(width=16, height=6)
    save_model(TrainedModel(model=model, encoding=encoding, eye=eye, poses=np.zeros((4, 3))), path)
    return path.read_bytes()


FILES = {name: model_file(name) for name in NAMES}


def used(path) -> None:
    """Load a model and scan with it, or see it refused."""
    saved = answer(path, lambda: load_model(path))
    if saved is None:
        return
    h, w = saved.model.shape
    scan = answer(None, lambda: saved.model.scan(views(2, h=h, w=w)))
    assert scan is None or (scan.shape == (2, w) and torch.isfinite(scan).all())
    if hasattr(saved.model, "match"):
        _, index = saved.model.match(torch.zeros(1, h, w))
        count = len(saved.poses) if saved.poses is not None else int(index.max()) + 1
        assert ((index >= 0) & (index < count)).all()
    answer(path, lambda: save_model(saved, path))


@holds(120)
@given(damaged(list(FILES.values())) | st.binary(max_size=200))
def model_files(data):
    path = FOLDER / "model.safetensors"
    path.write_bytes(data)
    used(path)


def parts(name: str):
    """The outer header of a model file, the inner one, and the tensors' bytes."""
    data = FILES[name]
    length = int.from_bytes(data[:8], "little")
    outer = json.loads(data[8 : 8 + length])
    return outer, json.loads(outer["__metadata__"]["tussock"]), data[8 + length :]


PARTS = {name: parts(name) for name in NAMES}


def file_of(outer, inner, rest: bytes) -> bytes:
    """The model file of such parts."""
    header = json.dumps(
        outer | {"__metadata__": {"tussock": inner if isinstance(inner, str) else json.dumps(inner)}}
    ).encode()
    return len(header).to_bytes(8, "little") + header + rest


HUGE = st.sampled_from(
    [0, -1, 10**9, 2**40, 2**62, 2**63, 1e30, float("nan"), True, None, "x", [], [10**9], [1e300, 5]]
)
FIELDS = {name: list(small(name).parameters) for name in NAMES}
parameters = st.sampled_from(NAMES).flatmap(
    lambda name: st.tuples(st.just(name), st.dictionaries(st.sampled_from(FIELDS[name]), HUGE))
)


@holds(160)
@given(st.sampled_from(NAMES).flatmap(lambda name: st.tuples(st.just(name), damaged_json(PARTS[name][1]))) | parameters.map(
    lambda found: (found[0], PARTS[found[0]][1] | {"parameters": PARTS[found[0]][1]["parameters"] | found[1]})))  # fmt: skip
@example(("rbm", "[" * 100_000))
@example(("rbm", '{"a":' * 100_000))
def model_headers(found):
    name, inner = found
    path = FOLDER / "header.safetensors"
    path.write_bytes(file_of(PARTS[name][0], inner, PARTS[name][2]))
    used(path)


TENSORS = {name: load(data) for name, data in FILES.items()}
DTYPES = [
    torch.float32,
    torch.float64,
    torch.float16,
    torch.bfloat16,
    torch.int64,
    torch.int32,
    torch.uint8,
    torch.bool,
    torch.float8_e4m3fn,
]
shapes = st.lists(st.sampled_from([0, 1, 2, 3, 8, 24]), max_size=4) | st.sampled_from(
    [[0, 2**31, 2**30], [0, 1, 2**40], [2**16], [1, 1, 2**16]]
)


@holds(160)
@given(st.sampled_from(NAMES), st.data())
def model_tensors(name, data):
    tensors, inner = dict(TENSORS[name]), dict(PARTS[name][1])
    key = data.draw(st.sampled_from(list(tensors)))
    if data.draw(st.booleans()):
        shape = data.draw(shapes)
        value = data.draw(st.sampled_from([0, 1, -1, 3, 1e9, 1e18, 1e38, 9e15]))
        tensors[key] = torch.full(shape, value).to(data.draw(st.sampled_from(DTYPES)))
        if len(shape) >= 2:
            inner["shape"] = shape[-2:]
    else:
        tensors[key] = tensors[key].to(data.draw(st.sampled_from(DTYPES)))
    path = FOLDER / "tensors.safetensors"
    path.write_bytes(save(tensors, {"tussock": json.dumps(inner)}))
    used(path)


class Runs:
    """What runs a command where it is unpickled."""

    def __reduce__(self):
        return os.system, (f"touch {FOLDER}/was-run",)


@holds(15)
@given(st.integers(0, 5), st.booleans())
def pickles(protocol, zipped):
    path = FOLDER / "pickle.safetensors"
    if zipped:
        torch.save(Runs(), path)
    else:
        path.write_bytes(pickle.dumps(Runs(), protocol=protocol))
    used(path)
    assert not (FOLDER / "was-run").exists()


words = st.sampled_from([*STEPS.builtin, "", "nonsense", "1e400", "nan", "-1", "1", "2.5", "1000", "0", "|", "|", " "])
chains = st.lists(words, max_size=8).map(" ".join) | st.text(max_size=30)
good = st.lists(
    st.sampled_from(["blur 0.5", "blur 7", "resize 2", "resize 999", "sample 1.7", "vertical-edges", "normalise"]),
    max_size=4,
)


first_steps = st.sampled_from(["grey", "foreground-mask", "sky-mask"])


@holds(120)
@given(chains | st.builds(lambda first, rest: " | ".join([first, *rest]), first_steps, good), st.data())
def encodings(text, data):
    encoding = answer(None, lambda: Encoding.parse(text))
    answer(None, lambda: Encoding.named(text, data.draw(st.floats()), data.draw(st.floats())))
    shape = data.draw(
        st.lists(st.integers(0, 9), max_size=2).map(lambda s: (2, 5, 12, 3) if len(s) < 2 else (1, *s, 4))
        | st.lists(st.integers(0, 5), max_size=5)
    )
    dtype = data.draw(st.sampled_from([np.uint8, np.uint8, np.uint8, np.float32, np.int64, bool]))
    if encoding is not None:
        assert answer(None, lambda: Encoding.parse(str(encoding))) == encoding
        images = answer(None, lambda: encoding(np.ones(shape, dtype)))
        assert images is None or (images.ndim == 3 and torch.isfinite(images).all())


numbers = st.sampled_from([0.0, 1.0, -1.0, 1e-30, 1e6, 1e12, 1e18, 1e38, float("nan"), float("inf")])


@holds(120)
@given(st.sampled_from(NAMES), st.data())
def models_on_anything(name, data):
    def tensor() -> torch.Tensor:
        shape = data.draw(
            st.sampled_from([(2, H, W), (1, 1, 4), (3, 1, 5), (1, H, W), (2, H, 1), (2, 1, 2)])
            | st.lists(st.integers(0, 4), max_size=4)
        )
        found = torch.tensor(np.random.default_rng(0).normal(size=tuple(shape)), dtype=torch.float32) * data.draw(
            numbers
        )
        return found.to(data.draw(st.sampled_from([torch.float32] * 4 + DTYPES[1:8])))

    model, training = small(name), tensor()
    if answer(None, lambda: model.fit(training)) is None:
        return
    for seen in (tensor(), training[:1], training[:1] * 1e18):
        scan = answer(None, lambda seen=seen: model.scan(seen))
        assert scan is None or (scan.shape == (len(seen), seen.shape[2]) and torch.isfinite(scan).all())
        if hasattr(model, "match"):
            answer(None, lambda seen=seen: model.match(seen))
        if hasattr(model, "follow") and seen.ndim == 3 and len(seen):
            answer(None, lambda seen=seen: model.follow().look(seen[0], np.ones(seen.shape[2], bool)))
    if hasattr(model, "partial_fit"):
        answer(None, lambda: model.partial_fit(tensor()))


@holds(120)
@given(parameters)
def model_parameters(found):
    name, given_ = found
    given_ = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in given_.items()
        if key not in ("device",)
    }
    big = any(
        isinstance(v, int | float) and v > 1e5
        for value in given_.values()
        for v in (value if isinstance(value, tuple) else [value])
    )
    model = answer(None, lambda: small(name, **given_))
    if model is not None and not big:  # what it learns would be as large as was asked for
        answer(None, lambda: model.fit(views(3, h=H, w=W)))


if __name__ == "__main__":
    main()
