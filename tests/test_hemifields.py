"""Memories of both hemifields: against two models behind the masks of the left and the right side, and mirrored worlds."""

import json
import math

import attrs
import numpy as np
import pytest
import safetensors
import torch
from commands import printed
from safetensors.torch import save_file
from scenes import views
from small_models import small
from test_fields import irregular

from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.models import HEMIFIELDS, MODELS, OPPONENT, PerfectMemory, hemifields, make_model, opponent
from tussock.navigation.models.base import Model, memory_bytes, model, recognises, score
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.navigation.models.hemifield_memories import MAX_PIXELS, Hemifields
from tussock.render.eye import Eye, compound_eye
from tussock.world.errors import FileError, SettingError

TAKES_MASK = [name for name in MODELS.builtin if MODELS.find(name).takes_mask]
DRAWS_NOTHING = ("visual-compass", "perfect-memory", "chain", "window-memory")  # so a mirrored one is the same model
EYES = {
    "all": Eye(width=24, height=6),
    "field": Eye(width=24, height=6, field=math.radians(200)),
    "mask": Eye(width=24, height=6, mask=irregular(6, 24)),
    "sphere": compound_eye("sphere ommatidia=14 acceptance_deg=40", width=24, height=12),
    "fly": compound_eye("fly ommatidia=14", width=24, height=12),
}


def pictures(eye: Eye, n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (n, eye.height, eye.width, 4), dtype=np.uint8)


@pytest.mark.parametrize("kind", EYES)
@pytest.mark.parametrize("name", TAKES_MASK)
def test_both_hemifields_are_the_sum_of_models_that_see_one_side_each(name, kind):
    # Without a mask, views are normalised before they are halved: then it is not the same.
    eye, text = EYES[kind], "grey" if kind == "all" else "grey | normalise | scale 0.5"
    encoded = Encoding.parse(text).for_eye(eye)
    learned, others = (encoded(pictures(eye, n, seed)) for n, seed in ((6, 1), (3, 2)))
    both = small(HEMIFIELDS + name).see(encoded.mask).fit(learned)
    scans, scores, size = 0, 0, 0
    for side in ("left", "right"):
        one = Encoding.parse(text).for_eye(attrs.evolve(eye, side=side))
        model = small(name).see(one.mask).fit(one(pictures(eye, 6, 1)))
        scans, scores = scans + model.scan(one(pictures(eye, 3, 2))), scores + model.score(one(pictures(eye, 3, 2)))
        size += model.memory_bytes
    assert torch.equal(both.scan(others), scans)
    assert torch.equal(both.score(others), scores)
    assert both.memory_bytes == size


@pytest.mark.parametrize("width", [4, 5, 24, 25])
def test_the_middle_column_of_an_odd_width_belongs_to_both(width):
    left, right = (Hemifields.mask_of(side, None, (2, width)).visible[0].tolist() for side in ("left", "right"))
    half = width // 2
    assert left == [True] * (half + width % 2) + [False] * half
    assert right == [False] * half + [True] * (half + width % 2)


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("width", [24, 25])
@pytest.mark.parametrize("name", DRAWS_NOTHING)
def test_a_mirrored_world_mirrors_the_familiarity(name, width, masked):
    visible = torch.from_numpy(irregular(5, width))
    masks = [FeatureMask(each, normalised=True) if masked else None for each in (visible, visible.flip(1))]
    here, there = (small(HEMIFIELDS + name).see(mask) for mask in masks)
    here.fit(views(8, 0, 5, width))
    there.fit(views(8, 0, 5, width).flip(2))
    queries = views(4, 1, 5, width)
    scan, mirrored = here.scan(queries), there.scan(queries.flip(2))
    turned = torch.cat(
        [mirrored[:, :1], mirrored[:, 1:].flip(1)], dim=1
    )  # a turn to the left is one to the right there
    assert torch.allclose(turned, scan, atol=1e-5)
    assert not torch.allclose(mirrored, scan, atol=1e-3)
    for side, other in (("left", "right"), ("right", "left")):
        one, mirror = getattr(here, side).scan(queries), getattr(there, other).scan(queries.flip(2))
        assert torch.allclose(torch.cat([mirror[:, :1], mirror[:, 1:].flip(1)], dim=1), one, atol=1e-5)


@pytest.mark.parametrize("name", [name for name in TAKES_MASK if name != "random"])
def test_what_is_on_one_side_changes_the_memory_of_that_side_alone(name):
    changed = views(3, 1)
    changed[:, :, 12:] = views(3, 2)[:, :, 12:]
    unsmoothed = (
        {"smoothing_deg": 0.0} if name == "mushroom-body" else {}
    )  # else it also looks at headings next to this one
    both = small(HEMIFIELDS + name, **unsmoothed).fit(views(6))
    assert torch.equal(both.left.score(views(3, 1)), both.left.score(changed))
    assert not torch.equal(both.right.score(views(3, 1)), both.right.score(changed))


@pytest.mark.parametrize("name", TAKES_MASK)
def test_another_size_is_learned_as_by_a_new_model(name):
    model = small(HEMIFIELDS + name).fit(views(4)).fit(views(4, 0, 5, 25))
    new = small(HEMIFIELDS + name).fit(views(4, 0, 5, 25))
    assert torch.equal(model.scan(views(2, 1, 5, 25)), new.scan(views(2, 1, 5, 25)))


def test_views_of_another_shape_and_another_mask_are_refused():
    mask = FeatureMask(torch.ones(5, 24, dtype=torch.bool), normalised=True)
    both = small("hemifields-infomax").see(mask)
    with pytest.raises(SettingError, match="behind a mask"):
        both.fit(views(3, 0, 5, 25))
    both.fit(views(3)).see(mask)
    with pytest.raises(SettingError, match="another mask"):
        both.see(None)
    for bad in (views(2, 0, 5, 25), views(2, 0, 4, 24)):
        for refuse in (both.scan, both.score, both.partial_fit):
            with pytest.raises(SettingError, match="shape"):
                refuse(bad)


@model
class Unaware(PerfectMemory):
    """A model that does not mind masks."""

    takes_mask = False


class Bare:
    """A model from outside without `see`: familiarity is the mean of each column."""

    def fit(self, views):
        self.level = views.mean()

    def scan(self, views):
        return (views - self.level).mean(dim=1)


class Seeing(Bare):
    """The same of what it sees."""

    memory_bytes = 7
    mask = None

    def see(self, mask):
        self.mask = mask

    def fit(self, views):
        super().fit(views if self.mask is None else self.mask.images(views))


def test_a_model_that_does_not_mind_masks_is_refused_in_one_line():
    for name in ("Unaware", "Bare"):
        with pytest.raises(SettingError, match=f"{name} does not mind") as refusal:
            make_model(f"{HEMIFIELDS}{__name__}:{name}")
        assert "\n" not in str(refusal.value)
        make_model(f"{OPPONENT}{__name__}:{name}")
    for twice in (opponent, hemifields):
        for inner in (PerfectMemory(), Seeing()):
            with pytest.raises(SettingError, match="two memories already"):
                twice(hemifields(inner))
    with pytest.raises(SettingError, match="two memories already"):
        hemifields(opponent(PerfectMemory()))


def test_an_eye_that_sees_one_side_is_refused():
    for side, other in (("left", "right"), ("right", "left")):
        mask = Encoding.parse("grey").for_eye(Eye(width=24, height=6, side=side)).mask
        for each in (small("hemifields-infomax"), hemifields(Seeing())):
            with pytest.raises(SettingError, match=f"nothing to the {other} of straight ahead"):
                each.see(mask)
            assert each.mask is None


@pytest.mark.parametrize("mask", [None, FeatureMask(torch.from_numpy(irregular(5, 24)))])
def test_a_model_from_outside_needs_see_as_well(mask):
    both = make_model(f"{HEMIFIELDS}{__name__}:Seeing").see(mask)
    both.fit(views(5))
    expected = 0
    for side in ("left", "right"):
        one = Seeing()
        one.see(Hemifields.mask_of(side, mask, (5, 24)))
        one.fit(views(5))
        expected = expected + one.scan(views(3, 1))
    assert torch.equal(both.scan(views(3, 1)), expected)
    assert torch.equal(score(both, views(3, 1)), expected[:, 0])
    assert memory_bytes(both) == 14
    assert recognises(both)


@pytest.mark.parametrize("name", TAKES_MASK)
def test_a_file_is_read_back_to_the_byte_and_learns_on(name, tmp_path):
    eye = EYES["mask"]
    encoding = Encoding.parse("grey | normalise")
    encoded = encoding.for_eye(eye)
    learned = encoded(pictures(eye, 5, 1))
    both = small(HEMIFIELDS + name).see(encoded.mask).fit(learned)
    save_model(TrainedModel(model=both, encoding=encoding, eye=eye, poses=np.zeros((5, 3))), tmp_path / "one")
    loaded = load_model(tmp_path / "one", expect=HEMIFIELDS + name)
    save_model(loaded, tmp_path / "again")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "again").read_bytes()
    assert (type(loaded.model), str(loaded.model)) == (type(both), str(both))
    others = encoded(pictures(eye, 3, 2))
    assert torch.equal(loaded.model.scan(others), both.scan(others))
    if hasattr(both, "partial_fit"):
        at_once = small(HEMIFIELDS + name).see(encoded.mask).fit(torch.cat([learned, others]))
        assert torch.equal(loaded.model.partial_fit(others).scan(others), at_once.scan(others))


@pytest.mark.parametrize("shape", [[10**9, 24], [MAX_PIXELS, 4], [5, 26], [5, 22], [10, 12]])
def test_a_file_of_another_shape_is_refused(shape, tmp_path):
    path = tmp_path / "model"
    save_model(TrainedModel(model=small("hemifields-infomax").fit(views(4))), path)
    with safetensors.safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["tussock"])
        tensors = {key: file.get_tensor(key).clone() for key in file.keys()}  # noqa: SIM118 (it is no dict)
    save_file(tensors, path, {"tussock": json.dumps(header | {"shape": shape})})
    with pytest.raises(FileError, match=str(path)):
        load_model(path)


def test_the_memories_of_a_file_are_not_those_of_an_opponent(tmp_path):
    save_model(TrainedModel(model=small("hemifields-infomax").fit(views(4))), tmp_path / "model")
    with pytest.raises(FileError, match="'hemifields-infomax', not 'opponent-infomax'"):
        load_model(tmp_path / "model", expect="opponent-infomax")


def test_the_class_of_a_spec_is_kept_by_experiments():
    both = hemifields(PerfectMemory())
    assert isinstance(both, Model)
    assert str(Experiment(world="tiny", model=both).model) == "hemifields-perfect-memory"


@pytest.mark.parametrize("fields", [{}, {"field": math.radians(270)}, {"compound": "ant"}])
def test_a_walk_arrives(fields):
    size = {"width": 240, "height": 48, "samples": 1} if fields.get("compound") else {"width": 90, "height": 20}
    settings = {"world": "tiny", "seed": 3, "route_length": 1.0, "encoding": "grey | normalise"}
    walk = Experiment(model="hemifields-perfect-memory", eye=Eye(**size, **fields), **settings).run().summary()
    assert walk["arrived"]


def test_commands_train_and_evaluate(capfd, tmp_path):
    route = ["--world", "tiny", "--size", "72x15", "--route-length-m", "1", "--spacing-m", "0.1"]
    text, file = "hemifields-infomax traversals=2", str(tmp_path / "m.safetensors")
    assert printed(capfd, "train", *route, "--learning-walk-m", "0", "--model", text, "--out", file)["model"] == text
    of_file, of_name = (printed(capfd, "evaluate", *route, "--model", each) for each in (file, text))
    assert of_file["model"] == of_name["model"] == text
    assert of_file["median_error_deg"] == of_name["median_error_deg"]
