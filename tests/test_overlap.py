"""Images of which parts are unknown: every rotation against the loop over what both show, and work with databases of such images."""

import logging
import math
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from commands import printed, tussock
from scenes import random_poses, random_world, views

from tussock.navigation import overlap
from tussock.navigation.encoding import Encoding
from tussock.navigation.evaluation import heading_errors
from tussock.navigation.experiment import Experiment
from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.measures.image_difference import differences, differences_of_places, rotational, translational
from tussock.navigation.measures.place_recognition import recognise
from tussock.navigation.models import HEMIFIELDS, MODELS, OPPONENT, PerfectMemory, make_model
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.navigation.overlap import MIN_OVERLAP, Overlap
from tussock.navigation.tested_poses import poses_to_test, route_views_of
from tussock.navigation.training_setup import TrainingSetup
from tussock.render.eye import Eye
from tussock.render.images import Grid, read_database, write_database
from tussock.render.images.camera import Camera
from tussock.render.images.folders import eye_of
from tussock.render.images.importing import ImportSettings, import_database
from tussock.render.images.source import open_views
from tussock.render.renderer import open_renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds
from tussock.world.routes import generate_route
from tussock.world.scene import World

H, W = 5, 24
PARTIAL = ["perfect-memory", "visual-compass"]
GREY = "grey | resize 2"
EDGES = "grey | vertical-edges | resize 2 | normalise"


def body(height: int, width: int) -> np.ndarray:
    """A robot that covers what is below on both sides of behind, and a pole on the right."""
    known = np.ones((height, width), bool)
    known[height // 2 :, : width // 12] = known[height // 2 :, -width // 12 :] = False
    known[:, 18 * width // 24 : 19 * width // 24] = False
    return known


KNOWN = {
    "body": body(H, W),
    "270": Eye(width=W, height=H, field=math.radians(270)).visible(),
    "180": Eye(width=W, height=H, field=math.pi).visible(),
}


def partly(kind: str, n: int, seed: int) -> torch.Tensor:
    """Views that are unknown where a mask, turned in each by another number of columns, says so."""
    unknown = np.stack([np.roll(~KNOWN[kind], 5 * k + seed, axis=1) for k in range(n)])
    return (0.3 + views(n, seed)).masked_fill(torch.from_numpy(unknown), torch.nan)


def by_brute_force(view: np.ndarray, memory: np.ndarray, visible: np.ndarray, normalised: bool) -> np.ndarray:
    """The mean square difference at every rotation, one after the other; inf where the overlap is too small."""
    squares = []
    for k in range(view.shape[1]):
        turned = np.roll(view, k, axis=1)
        ours = visible & ~np.isnan(memory)
        both = ours & ~np.isnan(turned)
        if both.sum() < MIN_OVERLAP * ours.sum() or not both.any():
            squares.append(np.inf)
            continue
        one, other = turned[both].astype(float), memory[both].astype(float)
        if normalised:
            one, other = (each - each.mean() for each in (one, other))
            if max(one.std(), other.std()) < 1e-6:
                squares.append(np.inf)
                continue
            one, other = (each / each.std() if each.std() > 1e-6 else 0 * each for each in (one, other))
        squares.append(np.square(one - other).mean())
    return np.array(squares)


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("field", [2 * math.pi, math.radians(200)])
@pytest.mark.parametrize("kind", KNOWN)
def test_every_rotation_is_compared_over_what_both_show(kind, field, normalised):
    visible = Eye(width=W, height=H, field=field).visible()
    mask = FeatureMask(torch.from_numpy(visible), normalised=normalised, gain=0.5, partial=True)
    queries, memories = partly(kind, 3, 1), partly(kind, 4, 2)
    for image in (queries[2], memories[3]):  # no contrast
        image[:] = torch.where(image.isnan(), torch.nan, 0.7)
    found = Overlap(memories, mask).squared(queries).numpy()
    for n, view in enumerate(queries.numpy()):
        for m, memory in enumerate(memories.numpy()):
            expected = 0.25 * by_brute_force(view, memory, visible, normalised)
            assert np.array_equal(np.isinf(found[n, :, m]), np.isinf(expected))
            assert np.allclose(found[n, :, m], expected, atol=1e-9)
    assert np.isinf(found[:2, :, :3]).any() == (kind == "180" or (kind == "270" and field < 6))


@pytest.mark.parametrize("kind", KNOWN)
@pytest.mark.parametrize("normalised", [False, True])
def test_what_both_show_agrees_at_one_place_whatever_each_faces(kind, normalised):
    mask, whole = FeatureMask(torch.ones(H, W, dtype=torch.bool), normalised=normalised, partial=True), views(1)[0]
    unknown = torch.from_numpy(~KNOWN[kind])
    memory = PerfectMemory().see(mask).fit(whole.masked_fill(unknown, torch.nan)[None])
    for k in (3, 5, 20):
        turned = torch.roll(whole, -k, dims=1).masked_fill(unknown, torch.nan)
        scan = memory.scan(turned[None])[0]
        assert scan.argmax() == k
        assert abs(scan[k]) < 1e-6


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("name", PARTIAL)
def test_a_model_recognises_the_nearest_of_what_it_can_compare(name, normalised, monkeypatch, tmp_path):
    monkeypatch.setattr("tussock.navigation.overlap.BLOCK", 3)
    monkeypatch.setattr("tussock.navigation.models.perfect_memory.BLOCK", 3)
    mask = FeatureMask(torch.ones(H, W, dtype=torch.bool), normalised=normalised, partial=True)
    learned, query = partly("180", 8, 0), partly("180", 1, 3)
    model = make_model(name).see(mask).fit(learned)
    kept = learned if name == "perfect-memory" else learned[-1:]
    squares = np.stack(
        [by_brute_force(query[0].numpy(), each, mask.visible.numpy(), normalised) for each in kept.numpy()]
    )
    scan, index = (each[0].numpy() for each in model.match(query))
    least = squares.min(axis=0)
    compared = np.isfinite(least)
    assert np.allclose(scan[compared], -np.sqrt(least[compared]), atol=1e-6)
    assert (scan[~compared] == scan[compared].min()).all()
    assert compared.all() == (name == "perfect-memory")
    if name == "perfect-memory":
        assert np.array_equal(index[compared], squares.argmin(axis=0)[compared])
    save_model(TrainedModel(model=model), tmp_path / "model")
    loaded = load_model(tmp_path / "model").model
    assert loaded.mask == mask
    assert torch.equal(loaded.scan(query), model.scan(query))
    model.see(mask).fit(views(2))  # nothing unknown
    masked = make_model(name).see(FeatureMask(mask.visible, normalised=normalised)).fit(views(2))
    assert torch.allclose(model.scan(views(1, 5)), masked.scan(views(1, 5)), atol=1e-5)


def test_models_that_need_whole_images_name_the_one_that_does_not():
    mask = FeatureMask(torch.ones(H, W, dtype=torch.bool), partial=True)
    for name in [*MODELS.builtin, OPPONENT + "perfect-memory", HEMIFIELDS + "perfect-memory"]:
        if name in PARTIAL:
            make_model(name).see(mask)
            continue
        with pytest.raises(SettingError, match="give perfect-memory") as refusal:
            make_model(name).see(mask)
        assert "\n" not in str(refusal.value)
    with pytest.raises(SettingError, match="not finite"):
        PerfectMemory().fit(partly("body", 2, 0))  # not told
    with pytest.raises(SettingError, match="nothing that is known"):
        PerfectMemory().see(mask).fit(torch.full((1, H, W), torch.nan))
    memory = PerfectMemory().see(mask).fit(partly("body", 2, 0))
    lone = torch.full((1, H, W), torch.nan)
    lone[0, 0, 0] = 1.0
    with pytest.raises(SettingError, match="too little"):
        memory.scan(lone)


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("kind", [*KNOWN, "rendered"])
def test_differences_are_those_of_perfect_memory(kind, normalised):
    """With a field or a mask of rendered views too, which perfect memory compares in another way."""
    visible = torch.from_numpy(KNOWN["body"])
    mask = FeatureMask(visible, normalised=normalised, partial=kind != "rendered")
    queries, learned = (views(3, 1), views(4, 2)) if kind == "rendered" else (partly(kind, 3, 1), partly(kind, 4, 2))
    found = differences(queries, learned, mask)
    scan = PerfectMemory().see(mask).fit(learned).scan(queries).numpy()
    compared = np.isfinite(found.min(axis=1))
    assert np.allclose(found.min(axis=1)[compared], -scan[compared], atol=1e-5)
    for n in range(3):
        for m in range(4):
            expected = by_brute_force(queries[n].numpy(), learned[m].numpy(), visible.numpy(), normalised)
            assert np.allclose(found[n, m] ** 2, expected, atol=1e-9)


# Encodings


@pytest.mark.parametrize("chain", [GREY, EDGES, "grey | blur 1 | resize 3", "grey | sample 3 | widen 2 | normalise"])
def test_features_are_known_that_are_made_of_known_pixels_alone(chain):
    known = body(30, 120)
    encoding = Encoding.parse(chain).for_eye(Eye(width=120, height=30, known=known))
    with open_renderer(random_world(), Eye(width=120, height=30, samples=1, z=0.05), "cpu") as renderer:
        whole = renderer.render(random_poses(2))
    turned = np.stack([known, np.roll(known, 31, axis=1)])
    garbage = np.random.default_rng(0).integers(0, 256, whole.shape, dtype=np.uint8)
    images = encoding(whole, turned)
    assert torch.equal(
        encoding(np.where(turned[..., None], whole, garbage), turned).nan_to_num(9), images.nan_to_num(9)
    )
    assert 0.4 < images.isfinite().float().mean() < 0.9
    assert torch.equal(encoding(whole[:1]).nan_to_num(9), images[:1].nan_to_num(9))  # as it was recorded


# Databases

EYE = Eye(width=120, height=30, samples=2)


def recorded(folder: Path, source: Path, known: np.ndarray) -> None:
    """What a camera records that never shows some pixels: they are black; imported with and without their mask."""
    painted = folder / f"painted-{source.name}"
    shutil.copytree(source, painted)
    for path in painted.glob("*.png"):
        image = cv2.imread(str(path))
        image[~known] = 0
        cv2.imwrite(str(path), image)
    cv2.imwrite(str(folder / "mask.png"), np.where(known, 255, 0).astype(np.uint8))
    camera = Camera(lens="panorama", top=EYE.top, bottom=EYE.bottom)
    for name, mask in (("known", folder / "mask.png"), ("naive", None)):
        import_database(folder / f"{name}-{source.name}", painted, None, camera, ImportSettings(mask=mask))


@pytest.fixture(scope="module")
def databases(tmp_path_factory) -> Path:
    folder, world = tmp_path_factory.mktemp("recorded"), World.generate("tiny", 0)
    route = generate_route(world, 0, 2.0)
    low, high = route.xy.min(axis=0) - 0.25, route.xy.max(axis=0) + 0.25
    with open_renderer(world, EYE, "cpu") as renderer:
        write_database(folder / "route", renderer, route.resampled(0.05).poses)
        write_database(folder / "grid", renderer, Grid.over(Bounds(*low.tolist(), *high.tolist()), 0.1))
    for name in ("route", "grid"):
        recorded(folder, folder / name, body(EYE.height, EYE.width))
    return folder


def experiment(folder: Path, kind: str, **fields) -> Experiment:
    fields = {"encoding": GREY, "training": TrainingSetup(learning_walk=0.0)} | fields
    return Experiment(route_database=folder / f"{kind}route", grid_database=folder / f"{kind}grid", **fields)


def median_error_deg(experiment: Experiment) -> float:
    world, route = experiment.open_world_and_route()
    poses = poses_to_test(experiment, world, route, grid=None, within=0.15)
    with experiment.open_renderer(world) as renderer:
        model = experiment.train(renderer, route).model.model
        errors = heading_errors(model, experiment.encoding, renderer, route_views_of(experiment, route), poses)
    return errors.median_error_deg


@pytest.mark.parametrize("encoding", [GREY, EDGES])
def test_headings_are_recovered_that_the_naive_comparison_gets_wrong(databases, encoding):
    whole, known, naive = (
        median_error_deg(experiment(databases, kind, encoding=encoding)) for kind in ("", "known-", "naive-")
    )
    assert whole < 6
    assert known < 6
    assert naive > 30


def test_a_walk_over_images_with_unknown_parts_arrives(databases):
    walk = {"training": TrainingSetup(learning_walk=0.3), "start_offset": 0.1}
    assert experiment(databases, "known-", **walk).run().summary()["reason"] == "arrived"


def test_known_pixels_turn_with_their_image(databases):
    grid = read_database(databases / "known-grid")
    pose = grid.poses[[7]]
    with open_views(databases / "known-route", databases / "known-grid") as source:
        assert source.eye.mask is None
        assert np.array_equal(source.known(pose)[0], body(EYE.height, EYE.width))
        for turn in (1.0, -2.5):
            turned = pose + [[0, 0, turn]]
            assert not source.render(turned)[~source.known(turned)].any()
            assert (source.render(turned)[source.known(turned)] > 0).mean() > 0.9
        assert np.array_equal(
            source.training.known(read_database(databases / "known-route").poses)[5], source.known(pose)[0]
        )
    with open_views(databases / "route") as source:
        assert source.known(pose) is None


def test_rows_that_are_covered_all_around_are_a_mask(databases, tmp_path):
    known = np.ones((EYE.height, EYE.width), bool)
    known[-5:] = False
    recorded(tmp_path, databases / "route", known)
    eye = eye_of(tmp_path / "known-route")
    assert eye.known is None
    assert np.array_equal(eye.visible(), known)


def test_other_models_and_worlds_are_refused_and_the_eye_is_kept(databases, tmp_path, capfd):
    with pytest.raises(SettingError, match=r"infomax .* give perfect-memory"):
        experiment(databases, "known-", model="infomax")
    with pytest.raises(SettingError, match="drawn all around"):
        Experiment(world="tiny", eye=Eye(width=24, height=5, known=KNOWN["body"]))
    flags = [
        "--route-database",
        databases / "known-route",
        "--grid-database",
        databases / "known-grid",
        "--encoding",
        GREY,
    ]
    printed(capfd, "train", *flags, "--learning-walk-m", 0, "--out", tmp_path / "model.safetensors")
    kept = load_model(tmp_path / "model.safetensors")
    assert np.array_equal(kept.eye.known.visible(), body(EYE.height, EYE.width))
    assert kept.model.learned["snapshots"].isnan().any()
    result = printed(capfd, "evaluate", *flags[:4], "--model", tmp_path / "model.safetensors")
    assert result["median_error_deg"] < 8
    code, _, err = tussock(capfd, "compare", *flags, "--models", "perfect-memory,mlp")
    assert code == 2
    assert "give perfect-memory" in err.splitlines()[-1]


def test_rotations_that_are_not_compared_are_told_once(caplog):
    overlap._remark.cache_clear()
    encoding = Encoding.parse(GREY).for_eye(
        Eye(width=120, height=30, known=Eye(width=120, height=30, field=math.pi).visible())
    )
    with caplog.at_level(logging.WARNING):
        encoding.remark_on_overlap()
        encoding.remark_on_overlap()
        Encoding.parse(GREY).for_eye(Eye(width=120, height=30, known=body(30, 120))).remark_on_overlap()
    # Of 30 columns, 12 must be shared: rotations by up to 18 to both sides.
    assert [record.message for record in caplog.records if "at 23 of 60 rotations" in record.message]
    assert len(caplog.records) == 1


# Measures


@pytest.mark.parametrize("field", [360.0, 200.0])
def test_rotational_and_translational_functions_of_what_is_seen(databases, field):
    """Of recorded images with unknown parts, and of the views of an eye with a field, against the loop."""
    kind = "known-" if field == 360 else ""
    whole = eye_of(databases / f"{kind}route")
    eye = Eye(**whole.plain() | {"field": math.radians(field)})
    encoding = Encoding.parse(EDGES)
    encoded = encoding.for_eye(eye)
    with open_views(databases / f"{kind}route", databases / f"{kind}grid", eye) as source:
        references = read_database(databases / "route").poses[10:11]
        (found,) = rotational(source, encoding, references, [0.1])
        wanted = encoded.at(source.training, references)[0].numpy()
        curves = []
        for side in (0.1, -0.1):
            x, y, heading = references[0]
            pose = np.array([[x - side * np.sin(heading), y + side * np.cos(heading), heading]])
            view = encoded.at(source, pose)[0].numpy()
            curves.append(np.sqrt(by_brute_force(view, wanted, encoded.mask.visible.numpy(), True)))
        assert np.allclose(found.curve, np.mean(curves, axis=0), atol=1e-6)
        assert [each.minimum for each in found.valleys] == pytest.approx([curve.min() for curve in curves], abs=1e-6)
        assert [each.depth for each in found.valleys] == pytest.approx([np.ptp(curve) for curve in curves], abs=1e-6)
        left = translational(source, encoding, references, 0.1, steps=1)["left"]
        assert sorted(left.curve) == pytest.approx(sorted([0, curves[0][0], curves[1][0]]), abs=1e-6)
        difference, _ = differences_of_places(encoding, source, source.poses[:4], references)
        expected = [
            by_brute_force(encoded.at(source, pose[None])[0].numpy(), wanted, encoded.mask.visible.numpy(), True)
            for pose in source.poses[:4]
        ]
        assert np.allclose(difference[:, 0] ** 2, np.min(expected, axis=1), atol=1e-9)


def test_a_place_that_is_not_compared_is_not_recognised():
    places = np.arange(3.0)[:, None] * [1, 0]
    difference = np.full((3, 3), np.inf)
    difference[0, 0] = 0.1
    found = recognise(difference, places, places, 0.5)
    assert found.correct.tolist() == [True, False, False]
    assert found.recall_at[1] == pytest.approx(1 / 3)
    assert found.area == pytest.approx(1 / 3)


@pytest.mark.parametrize("command", ["ridf", "place", "catchment"])
def test_commands_measure_what_is_seen(databases, tmp_path, capfd, command):
    recorded_flags = [
        "--route-database",
        databases / "known-route",
        "--grid-database",
        databases / "known-grid",
        "--encoding",
        EDGES,
    ]
    world = ["--world", "tiny", "--size", "90x20", "--route-length-m", 2, "--field-deg", 200]
    for flags in (recorded_flags, world):
        within = {"catchment": ["--within-m", 0.3], "ridf": ["--displacements-m", "0,0.1", "--apart-m", 1]}.get(
            command, []
        )
        result = printed(capfd, command, *flags, *within, "--out", tmp_path / "a.png")
        if command == "ridf":
            assert result["rotational"]["0 m"]["minimum"] < 1e-5
            assert result["rotational"]["0.1 m"]["median_error_deg"] < 12
        if command == "place":
            assert result["precision_recall_area"] > 0.6  # of the naive comparison 0.003
