"""Fields of view and masks: each model, encoding and command against hiding pixels of the turned view, one rotation after the other."""

import dataclasses
import json
import math
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from quick_cases import quick
from scenes import random_poses, random_world, views, world_of
from small_models import small

from tussock.navigation.cli.main import main
from tussock.navigation.encoding import PRESETS, Encoding
from tussock.navigation.encoding_steps import EncodingStep
from tussock.navigation.experiment import Experiment
from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.models import HEMIFIELDS, MODELS, OPPONENT, PerfectMemory, make_model
from tussock.navigation.models.base import Model
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.navigation.models.mushroom_body import receptive_fields
from tussock.navigation.models.spike_overlap import averaging, first_to_fire
from tussock.navigation.stopping import StopReason
from tussock.render.eye import Eye
from tussock.render.images.entries import stored_poses
from tussock.render.images.metadata import METADATA, read_metadata
from tussock.render.images.writing import write_database
from tussock.render.occlusion import covered_within
from tussock.render.renderer import open_renderer
from tussock.world.errors import FileError, SettingError
from tussock.world.geometry import Pose

NAMES = [
    *MODELS.builtin,
    *(
        prefix + name
        for prefix in (OPPONENT, HEMIFIELDS)
        for name in ("perfect-memory", "mlp", "mushroom-body", "random")
    ),
]
TURNING = {
    "mlp",
    "mlp-rotation",
    "mlp-mixture",
    "adaboost",
    "mushroom-body",
}  # they learn turned copies of their views too
RMS = {
    "perfect-memory",
    "chain",
    "window-memory",
    "visual-compass",
    "autoencoder",
}  # their familiarity is a root mean square over the pixels


def irregular(height: int, width: int) -> np.ndarray:
    """A pole, a body below, and holes."""
    visible = np.random.default_rng(5).random((height, width)) > 0.1
    visible[:, 3 : 3 + width // 8] = False
    visible[-1, width // 3 :] = False
    return visible


def visible_of(kind: str, height: int = 5, width: int = 24) -> np.ndarray:
    if kind == "irregular":
        return irregular(height, width)
    return Eye(width=width, height=height, field=math.radians(float(kind))).visible()


KINDS = ["270", "180", "296", "irregular"]


def mask_of(kind: str, normalised: bool) -> FeatureMask:
    return FeatureMask(torch.from_numpy(visible_of(kind)), normalised=normalised)


def hidden_at(view: np.ndarray, visible: np.ndarray, normalised: bool, gain: float = 1.0) -> np.ndarray:
    """What is seen of a view at every rotation, (w, h, w) in float64: turn, hide, normalise."""
    seen = []
    for k in range(view.shape[1]):
        turned = np.roll(view.astype(float), k, axis=1)
        pixels = turned[visible]
        if normalised:
            deviation = pixels.std()
            pixels = (pixels - pixels.mean()) / deviation if deviation > 1e-6 else pixels * 0
        image = np.zeros_like(turned)
        image[visible] = gain * pixels
        seen.append(image)
    return np.stack(seen)


@cache
def trained(name: str, kind: str, normalised: bool) -> Model:
    parameters = (
        {"smoothing_deg": 0.0, "overlap_deg": 8.0} if name.endswith("mushroom-body") and "spiking" not in name else {}
    )
    return small(name, **parameters).see(mask_of(kind, normalised)).fit(0.3 + views(12))


def queries() -> torch.Tensor:
    return 0.1 + torch.cat([views(3, 1), views(1)])


def by_brute_force(model: Model, view: np.ndarray, mask: FeatureMask) -> np.ndarray:
    """Familiarity of a view at every rotation: of each image with its hidden pixels 0 alone."""
    if hasattr(model, "left"):
        return by_brute_force(model.left, view, model.left.mask) + by_brute_force(model.right, view, model.right.mask)
    if hasattr(model, "attractive"):
        return by_brute_force(model.attractive, view, mask) - by_brute_force(model.repulsive, view, mask)
    visible = mask.visible.numpy()
    seen = hidden_at(view, visible, mask.normalised)
    if model.name == "mushroom-body":
        return np.array([mushroom_body(model, image, visible) for image in seen])
    if model.name == "spiking-mushroom-body":  # a twin whose views are rows of what is visible
        twin = type(model)(**model.parameters)
        twin.restore((1, mask.count), model.learned)
        rows = torch.tensor(seen[:, None, visible], dtype=torch.float32)
        return twin.scan(rows)[:, 0].numpy()
    if model.name == "spike-overlap":
        return np.array([spike_overlap(model, image, visible) for image in seen])
    twin = type(model)(**model.parameters)  # sees everything, and learned the same
    if model.name == "infomax":
        twin.units = mask.count
    twin.restore(tuple(visible.shape), model.learned)
    familiarity = twin.scan(torch.tensor(seen, dtype=torch.float32))[:, 0].numpy()
    return familiarity * np.sqrt(visible.size / visible.sum()) if model.name in RMS else familiarity


def mushroom_body(model: Model, image: np.ndarray, visible: np.ndarray) -> float:
    width = visible.shape[1]
    away = np.minimum(np.arange(width), width - np.arange(width)) * 360 / width
    reach = np.exp(-0.5 * (away / model.overlap_deg) ** 2) * (away <= 3 * model.overlap_deg)
    side_by_side = receptive_fields(model.columns, model.rows, *visible.shape).numpy()
    fields = sum(share * np.roll(side_by_side, k, axis=2) for k, share in enumerate(reach / reach.sum())) * visible
    shares = fields.sum(axis=(1, 2)).reshape(model.rows, model.columns)
    sums = (fields * image).sum(axis=(1, 2)).reshape(model.rows, model.columns)
    averages = np.divide(sums, shares, out=np.zeros_like(sums), where=shares > 0)
    output, contrasts = np.zeros_like(averages), np.zeros(model.rows)
    for row in range(model.rows):
        if shares[row].any():
            mean = np.average(averages[row], weights=shares[row])
            contrasts[row] = np.sqrt(np.average((averages[row] - mean) ** 2, weights=shares[row]))
            output[row] = np.where(shares[row] > 0, averages[row] - mean, 0)
    output /= (contrasts[:, None] + 0.02 * contrasts.max() + 1e-9) ** model.adaptation
    drive = output.ravel()[model.learned["wiring"].numpy()].sum(axis=1)
    firing = np.argsort(-drive, kind="stable")[: model.firing]
    return -float(model.learned["synapses"].numpy()[:, firing].mean(axis=1).min())


def spike_overlap(model: Model, image: np.ndarray, visible: np.ndarray) -> float:
    """Of one plane: the mean of what is visible of each field, 0 where nothing is."""
    rows, columns = (
        averaging(*each).numpy() for each in ((model.rows, image.shape[0]), (model.columns, image.shape[1]))
    )
    shares = rows @ visible @ columns.T
    sums = rows @ (image * visible) @ columns.T
    inputs = np.divide(sums, shares, out=np.zeros_like(sums), where=shares > 0).ravel()
    inputs = (inputs - inputs.mean()) / (inputs.std(ddof=1) + 1e-6)
    drive = (inputs[model.learned["wiring"].numpy()] * model.learned["weights"].numpy()).sum(axis=1).astype(np.float32)
    code = first_to_fire(torch.from_numpy(drive)[None], model.active)[0].numpy()
    if not code.any():
        return -1.0
    learned = model.learned["codes"].numpy()
    return float(((learned & code).sum(axis=1) / np.sqrt(learned.sum(axis=1) * code.sum())).max())


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("kind", quick(KINDS, "180", "irregular"))
@pytest.mark.parametrize("name", [name for name in NAMES if not name.endswith("random")])
def test_every_model_scans_as_if_each_turned_view_was_hidden_and_compared_alone(name, kind, normalised):
    model, mask = trained(name, kind, normalised), mask_of(kind, normalised)
    scan = model.scan(queries()).numpy()
    brute = np.stack([by_brute_force(model, view, mask) for view in queries().numpy()])
    wrong = np.abs(scan - brute) > 1e-3 * (1e-3 + np.ptp(brute))
    # Where two sums are equal but for rounding, either cell or vote may win.
    assert wrong.mean() <= (0.01 if name.endswith(("adaboost", "mushroom-body", "spike-overlap")) else 0)


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_what_is_hidden_at_a_rotation_makes_no_difference_there(name, kind, normalised):
    model, visible = trained(name, kind, normalised), visible_of(kind)
    scan = model.scan(queries())
    for k in (0, 1, 7, 23):
        hidden = torch.from_numpy(np.roll(~visible, -k, axis=1))  # of the unturned view
        other = torch.where(hidden, 9 * views(4, 8), queries())
        there = model.scan(other)
        assert torch.allclose(there[:, k], scan[:, k], rtol=1e-4, atol=1e-4)
        assert name == "opponent-random" or not torch.allclose(there, scan, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    "name", [name for name in NAMES if name not in TURNING and not name.startswith((OPPONENT, HEMIFIELDS))]
)
def test_what_is_hidden_while_learning_is_not_learned(name):
    hidden = torch.from_numpy(~visible_of("180"))
    learned = torch.where(hidden, 9 * views(12, 8), 0.3 + views(12))
    other = small(name).see(mask_of("180", True)).fit(learned)
    model = trained(name, "180", True)
    for key, tensor in model.learned.items():
        assert torch.allclose(other.learned[key].double(), tensor.double(), atol=1e-5)


def test_turned_copies_are_turned_behind_the_mask():
    # The classifier of the thesis learns turned copies: they are turned in full, then hidden.
    mask, learned = mask_of("irregular", True), views(12)
    model = small("mlp").see(mask).fit(learned)
    images, labels = small("mlp").training_data(learned)
    rows = np.stack([hidden_at(image, mask.visible.numpy(), True)[0][mask.visible] for image in images.numpy()])
    twin = small("mlp").fit(rows, labels.numpy())
    assert torch.allclose(
        mask.select(model.learned["weights0"].reshape(-1, 5, 24)), twin.learned["weights0"], atol=1e-4
    )
    assert not model.learned["weights0"].reshape(-1, 5, 24)[:, ~mask.visible].any()


def test_a_control_draws_other_numbers_for_other_visible_pixels():
    mask = mask_of("180", False)
    scan = make_model("random").see(mask).fit(views(3)).scan(views(20, 1))
    assert len(scan.unique()) > 0.99 * scan.numel()


@pytest.mark.parametrize("name", NAMES)
def test_a_mask_that_hides_nothing_makes_no_difference(name):
    whole = FeatureMask(torch.ones(5, 24, dtype=torch.bool))
    model, masked = small(name).fit(views(12)), small(name).see(whole).fit(views(12))
    if name.endswith(("random", "chain")):
        return  # numbers by another hash; what is a match, by another measure
    scan, other = model.scan(views(3, 1)), masked.scan(views(3, 1))
    if name in (
        "mushroom-body",
        OPPONENT + "mushroom-body",
    ):  # behind a mask contrast is that over the fields, not over the rotations
        assert torch.corrcoef(torch.stack([scan.flatten(), other.flatten()]))[0, 1] > 0.8
        return
    wrong = (scan - other).abs() > 1e-3 * (scan.max() - scan.min())
    assert wrong.float().mean() <= (0.02 if name == "adaboost" else 0)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_behind_a_mask_is_kept_in_a_file(name, tmp_path):
    model = trained(name, "irregular", True)
    save_model(TrainedModel(model=model), tmp_path / "model")
    loaded = load_model(tmp_path / "model").model
    assert loaded.mask == model.mask
    assert torch.equal(loaded.scan(queries()), model.scan(queries()))


def test_little_contrast_in_view_is_normalised_exactly():
    # One faint pixel in the field, and much contrast outside of it.
    visible = visible_of("180")
    view = 5 * views(1, 3).numpy()[0]
    view[:, 3:21] = 0.25
    view[2, 11] += 2e-4
    mask = FeatureMask(torch.from_numpy(visible), normalised=True)
    brute = hidden_at(view, visible, True)
    mean, factor = (each[0].numpy() for each in mask.statistics(torch.from_numpy(view)[None]))
    for k in range(24):
        seen = (np.roll(view.astype(float), k, axis=1) - mean[k]) * factor[k] * visible
        assert np.allclose(seen, brute[k], atol=1e-4)
    memory = PerfectMemory().see(mask).fit(torch.from_numpy(view)[None])
    assert memory.scan(torch.from_numpy(view)[None]).argmax() == 0
    flat = torch.where(torch.from_numpy(visible), 0.25, 5 * views(1, 3))
    assert mask.statistics(flat)[1][0, 0] == 0  # no contrast at all in view


def test_a_mask_is_told_before_training_and_to_models_that_mind_it():
    model = small("infomax").fit(views(4))
    with pytest.raises(SettingError, match="make a new model"):
        model.see(mask_of("180", True))
    assert model.see(None) is model
    with pytest.raises(SettingError, match="behind a mask"):
        small("infomax").see(mask_of("180", True)).fit(views(4, w=25))

    class Careless(PerfectMemory):
        takes_mask = False

    with pytest.raises(SettingError, match="Careless does not mind"):
        Careless().see(mask_of("180", True))
    with pytest.raises(SettingError, match="hides all"):
        FeatureMask(torch.zeros(3, 5, dtype=torch.bool))
    for name in NAMES:
        assert make_model(name).takes_mask


class Blank(EncodingStep):
    """The trap: columns outside of a field are blanked in the view, and turn with it."""

    def __init__(self, degrees: float):
        self.eye = {"height": 1, "field": math.radians(degrees)}

    def __call__(self, images):
        return images * Eye(width=images.shape[2], **self.eye).visible()[0]


@pytest.mark.parametrize("degrees", [270, 180, 90])
def test_a_turned_view_is_recognised_through_a_field_and_not_after_blanking(panoramas, degrees):
    field = Eye(width=120, height=30, field=math.radians(degrees))
    chain = Encoding.named("edges")
    blanking = Encoding((*chain.steps[:-1], Blank(degrees), chain.steps[-1]))
    encoded = chain.for_eye(field)
    memory, trapped = (
        PerfectMemory().see(encoded.mask).fit(encoded(panoramas)),
        PerfectMemory().fit(blanking(panoramas)),
    )
    for k in (30, 60, 90):  # the agent faces another way: it has to turn by k columns
        turned = np.roll(panoramas, -k, axis=2)
        assert memory.scan(encoded(turned)).argmax(dim=1).tolist() == [k] * 3
        if k == 60 and degrees < 270:  # of what it learned it sees nothing now, if it is blank that turns
            assert k not in trapped.scan(blanking(turned)).argmax(dim=1).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [270, 180, 90])
def test_a_walk_arrives_with_a_field_of_view_and_gets_lost_by_blanking(degrees):
    def walk(field: float, encoding: Encoding):
        return Experiment(
            world="meadow",
            seed=1,
            route_length=4.0,
            eye=Eye(width=180, height=40, field=math.radians(field)),
            encoding=encoding,
            start_offset=0.1,
            renderer="cpu",
        ).run()

    chain = Encoding.named("edges", resize=3)
    assert walk(degrees, chain).summary()["reason"] == "arrived"
    assert walk(360, Encoding((*chain.steps[:-1], Blank(degrees), chain.steps[-1]))).summary()["reason"] == "lost"


# What is built on them

TINY = {"world": "tiny", "seed": 3, "route_length": 1.0, "eye": Eye(width=60, height=15, field=math.radians(200))}


def test_failures_are_diagnosed_behind_a_mask():
    experiment = Experiment(**TINY, model="infomax", encoding="edges", start_offset=0.3)
    with experiment.opened() as trained:
        examined = [trained.diagnostics.examine([step])[0] for step, _ in experiment.steps(trained)]
        step, _ = next(experiment.steps(trained))
        failed = dataclasses.replace(step, failure=StopReason.LOST)
        diagnosis = trained.diagnostics.examine([failed])[0]
    assert examined
    assert diagnosis.recognised is not None
    assert diagnosis.nearest is not None


def test_what_is_close_behind_the_eye_does_not_cover_its_view():
    wall = np.array([[[-0.02, -9, -9], [-0.02, 9, -9], [-0.02, 0, 9]]])  # west of the eye
    world, field = world_of(wall, np.zeros((1, 3))), {"width": 72, "height": 30}
    east, west = Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, math.pi)
    whole = covered_within(world, Eye(**field), [east], 0.05)
    assert covered_within(world, Eye(**field, field=math.pi), [east], 0.05) == 0
    assert covered_within(world, Eye(**field, field=math.pi), [west], 0.05) == pytest.approx(2 * whole)


def test_a_recording_a_view_and_an_observation_show_what_is_visible(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    visible = TINY["eye"].visible()
    flags = ["--world", "tiny", "--seed", "3", "--size", "60x15", "--field-deg", "200"]
    main(["view", *flags, "--alpha"])
    image = cv2.imread("view.png", cv2.IMREAD_UNCHANGED)
    assert not image[~visible].any()
    assert image[visible].any(axis=1).all()
    gymnasium = pytest.importorskip("gymnasium")
    name = "tussock.navigation.rl.environment:tussock/RouteFollowing-v0"
    task = {"world": "tiny", "world_seed": 3, "length": 1.0, "eye": TINY["eye"], "renderer": "cpu"}
    for encoding in (None, "foreground-mask | vertical-edges | normalise"):
        with gymnasium.make(name, encoding=encoding, render_mode="rgb_array", **task) as env:
            seen, _ = env.reset(seed=1)
            assert env.observation_space.contains(seen)
            assert not seen[~visible].any()
            assert seen[visible].any()
            assert not env.render()[~visible.repeat(12, axis=0).repeat(12, axis=1)].any()
            learned, _ = env.unwrapped.training_views()
            assert not learned[:, ~visible].any()


def test_a_run_with_a_field_is_recorded_and_repeats(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("mask.png", np.where(irregular(15, 60), 255, 0).astype(np.uint8))
    walk = ["--world", "tiny", "--seed", "3", "--route-length-m", "1"]
    flags = [*walk, "--size", "60x15", "--resize", "1", "--mask", "mask.png"]
    main(["train", *flags, "--field-deg", "300", "--learning-walk-m", "0.2", "--out", "model.safetensors"])
    main(["run", *flags, "--field-deg", "300", "--learning-walk-m", "0.2", "--out", "one"])
    Path("mask.png").unlink()  # the file of the model keeps it
    main(["run", *walk, "--model", "model.safetensors", "--out", "two"])
    one, two = (Path(run, "trajectory.csv").read_text() for run in ("one", "two"))
    assert one == two
    settings = json.loads(Path("two", "summary.json").read_text())["settings"]
    assert settings["field_deg"] == 300.0
    assert settings["mask"].startswith("60x15:")


def test_a_database_keeps_the_eye_and_whole_panoramas(tmp_path):
    visible = np.random.default_rng(0).random((100, 700)) > 0.5  # a text longer than OpenCV reads at once
    eye = Eye(width=700, height=100, mask=visible, field=math.pi)
    with open_renderer(random_world(), eye, "cpu") as renderer:
        database, _ = write_database(tmp_path / "database", renderer, random_poses(2))
        assert write_database(tmp_path / "database", renderer, random_poses(2))[1] == 0
        views = renderer.render(stored_poses(random_poses(2)))
    kept = read_metadata(tmp_path / "database" / METADATA)["tussock"]["eye"]
    assert Eye(**kept | {"samples": None}) == eye
    assert (database.views()[0] == views[0]).all()


# Encodings

CHAINS = [
    *(str(Encoding.named(name, resize=3, blur=blur)) for name in PRESETS for blur in (0.0, 1.5)),
    "grey | resize 3.5",
    "grey | sample 3",
    "grey | sample 4 | widen 5",
    "foreground-mask | vertical-edges",
    "grey | invert | resize 3 | normalise | scale 0.25",
]


@pytest.fixture(scope="module")
def panoramas():
    with open_renderer(random_world(), Eye(width=120, height=30, samples=1, z=0.05), "cpu") as renderer:
        return renderer.render(random_poses(3))


@pytest.mark.parametrize("kind", [*KINDS, "90"])
@pytest.mark.parametrize("chain", CHAINS)
def test_visible_features_are_made_of_visible_pixels_alone(panoramas, chain, kind):
    visible = visible_of(kind, 30, 120)
    eye = Eye(width=120, height=30, mask=visible)
    if kind == "irregular" and "blur" in chain:
        with pytest.raises(SettingError, match="leaves no pixel"):
            Encoding.parse(chain).for_eye(eye)
        return
    encoding = Encoding.parse(chain).for_eye(eye)
    assert encoding.mask is not None
    garbage = np.random.default_rng(0).integers(0, 256, panoramas.shape, dtype=np.uint8)
    other = np.where(visible[..., None], panoramas, garbage)
    assert torch.equal(encoding.mask.select(encoding(other)), encoding.mask.select(encoding(panoramas)))
    assert torch.equal(encoding.seen(other), encoding.seen(panoramas))
    # Nothing is given away: every other feature does depend on a hidden pixel.
    if "blur" not in chain:
        changes = (encoding(other) != encoding(panoramas)).any(dim=0)
        assert (changes | encoding.mask.visible).float().mean() > 0.97


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("chain", ["foreground-mask | vertical-edges | resize 5 | normalise", "grey | resize 5"])
def test_an_encoded_view_is_matched_as_the_masked_and_encoded_turned_view(panoramas, chain, kind):
    visible = visible_of(kind, 30, 120) | (np.arange(30)[:, None] < 10) & (kind == "irregular")
    encoding = Encoding.parse(chain).for_eye(Eye(width=120, height=30, mask=visible))
    memory = PerfectMemory().see(encoding.mask).fit(encoding(panoramas[:2]))
    learned = [encoding.seen(panoramas[i : i + 1])[0].double() for i in range(2)]
    scan, match = memory.match(encoding(panoramas[2:]))
    for k in range(24):
        turned = np.where(visible[..., None], np.roll(panoramas[2:], 5 * k, axis=2), 0)  # what the turned eye sees
        seen = encoding.seen(turned.astype(np.uint8))[0].double()
        rms = [float((seen - each)[encoding.mask.visible].square().mean().sqrt()) for each in learned]
        assert math.isclose(-scan[0, k], min(rms), abs_tol=1e-5)
        assert math.isclose(rms[match[0, k]], min(rms), abs_tol=1e-5)


def test_a_full_field_is_no_field(panoramas):
    eye, chain = Eye(width=120, height=30, field=2 * math.pi), Encoding.named("edges", resize=3)
    assert eye == Eye(width=120, height=30)
    assert chain.for_eye(eye) == chain.for_eye(Eye(width=120, height=30, mask=np.ones((30, 120), bool)))
    assert chain.for_eye(eye).mask is None
    assert torch.equal(chain.for_eye(eye)(panoramas), chain(panoramas))


@pytest.mark.parametrize(
    ("chain", "message"),
    [
        ("grey | clahe 2 4", "clahe makes each pixel of hidden ones too"),
        ("grey | normalise | widen 3", "put widen before it"),
        ("grey | normalise | normalise", "put normalise before it"),
        ("grey | blur 30", "leaves no pixel"),
    ],
)
def test_steps_that_need_the_whole_view_are_refused(chain, message):
    with pytest.raises(SettingError, match=message):
        Encoding.parse(chain).for_eye(Eye(width=120, height=30, field=math.pi))


def test_a_sky_that_is_estimated_from_the_whole_view_is_refused(panoramas):
    chain = Encoding.named("edges")
    assert chain(panoramas[..., :3]) is not None
    with pytest.raises(SettingError, match="hidden parts too"):
        chain.for_eye(Eye(width=120, height=30, field=math.pi))(panoramas[..., :3])


# The eye


def test_columns_that_are_partly_outside_of_the_field_are_hidden():
    for field, columns in ((360, 24), (359, 22), (296, 18), (270, 18), (180, 12), (90, 6), (30, 2)):
        visible = visible_of(str(field))
        assert (visible == visible[0]).all()
        assert visible[0].sum() == columns
        assert np.flatnonzero(visible[0]).tolist() == list(range(12 - columns // 2, 12 + columns // 2))
    with pytest.raises(SettingError, match="nothing is visible"):
        Eye(width=24, height=5, field=math.radians(29))


def test_masks_are_equal_by_their_pixels(tmp_path):
    visible = irregular(30, 120)
    cv2.imwrite(str(tmp_path / "mask.png"), visible.astype(np.uint8) * 255)
    eye, other = Eye(width=120, height=30, mask=visible), Eye(width=120, height=30, mask=tmp_path / "mask.png")
    assert eye == other
    assert hash(eye) == hash(other)
    assert (other.visible() == visible).all()
    assert other.mask.source == str(tmp_path / "mask.png")
    assert Eye(**other.plain()) == eye
    assert len(repr(eye)) < 300
    assert eye != Eye(width=120, height=30)
    assert "mask" not in Eye().plain()
    both = Eye(width=120, height=30, mask=visible, field=math.pi)
    assert (both.visible() == visible & Eye(width=120, height=30, field=math.pi).visible()).all()


def test_a_pixel_of_a_smaller_eye_sees_where_all_of_the_picture_does(tmp_path):
    picture = np.full((60, 240), 255, np.uint8)
    picture[7, 100] = 0
    picture[30:, 200:] = 100
    cv2.imwrite(str(tmp_path / "mask.png"), picture)
    hidden = ~Eye(width=120, height=30, mask=tmp_path / "mask.png").visible()
    assert np.argwhere(hidden[:15]).tolist() == [[3, 50]]
    assert hidden[15:, 100:].all()
    assert not hidden[15:, :100].any()
    assert (~Eye(width=100, height=30, mask=tmp_path / "mask.png").visible()[:15]).sum() == 2  # which it touches
    larger = ~Eye(width=480, height=120, mask=tmp_path / "mask.png").visible()
    assert larger[:60].sum() == 4


def test_masks_that_cannot_be_used_are_refused(tmp_path):
    (tmp_path / "text.png").write_text("white")
    (tmp_path / "pointer.png").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    for given, message in (
        (np.zeros((30, 120), bool), "nothing is visible"),
        (np.ones((30, 121), bool), "shape"),
        (np.ones((30, 120)), "booleans"),
        (3, "give a picture"),
        ("120x31:eNo=", "damaged"),
        ("30000x30000:eNo=", "damaged"),
        (str(Eye(width=24, height=5, mask=irregular(5, 24)).mask), "of 24x5 pixels"),
    ):
        with pytest.raises(SettingError, match=message):
            Eye(width=120, height=30, mask=given)
    for path, message in (
        (tmp_path / "none.png", "there is no mask"),
        (tmp_path / "text.png", "cannot be read"),
        (tmp_path / "pointer.png", "git lfs pull"),
    ):
        with pytest.raises(FileError, match=message):
            Eye(width=120, height=30, mask=path)
