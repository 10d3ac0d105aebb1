"""Compound eyes: their matrix against an integral over rays, their turns against looking again, and what people write of them."""

import json
import math
from functools import cache
from pathlib import Path

import attrs
import numpy as np
import pytest
import torch
from commands import printed
from scenes import random_poses, random_world
from small_models import small
from test_fields import NAMES, by_brute_force

from tussock.navigation.cli.main import main
from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_settings import experiment_of, run_command
from tussock.navigation.models.files import TrainedModel, load_model, save_model
from tussock.navigation.models.perfect_memory import PerfectMemory
from tussock.render.compound import CompoundEye, as_compound
from tussock.render.eye import Eye, compound_eye
from tussock.render.images.writing import write_database
from tussock.render.ommatidia import EYES, LEFT, RIGHT, Ommatidia, named_eye, read_eye
from tussock.render.ommatidia_picture import draw_ommatidia
from tussock.render.receptors import receptors_of
from tussock.render.renderer import open_renderer
from tussock.world.errors import FileError, InputError, SettingError

SCATTERED = Ommatidia(
    np.radians([0, 10, 10, -40, 100.3, -170, 179.9, 33.3]),
    np.radians([0, 0, 20, 20, -5, 45, 0, 80]),
    np.radians([8, 8, 8, 12, 9, 10, 8, 15]),
    np.array([0, 1, 1, -1, 1, -1, 0, 0], np.int8),
)


def scattered(width: int = 120, **fields) -> Eye:
    """An eye of few ommatidia, over all directions."""
    whole = {"top": math.pi / 2, "bottom": -math.pi / 2}
    return Eye(
        **{"width": width, "height": width // 2, "samples": 2, "z": 0.05, "compound": SCATTERED, **whole, **fields}
    )


def directions(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)


def dense(eye: Eye, ommatidia: Ommatidia) -> np.ndarray:
    """The matrix (ommatidia, height, width) by its definition."""
    azimuth = np.pi - (np.arange(eye.width) + 0.5) * 2 * np.pi / eye.width
    elevation = eye.elevations()
    pixels = directions(*np.meshgrid(azimuth, elevation))
    angle = np.arccos(np.clip(directions(ommatidia.azimuth, ommatidia.elevation) @ pixels.reshape(-1, 3).T, -1, 1))
    deviation = ommatidia.acceptance[:, None] / math.sqrt(8 * math.log(2))
    weights = (
        np.exp(-0.5 * (angle / deviation) ** 2) * (angle <= 4 * deviation) * np.repeat(np.cos(elevation), eye.width)
    )
    return (weights / weights.sum(axis=1, keepdims=True)).reshape(-1, eye.height, eye.width)


def panoramas(eye: Eye, n: int = 3) -> np.ndarray:
    return np.random.default_rng(1).random((n, eye.height, eye.width), dtype=np.float32)


@pytest.mark.parametrize("width", [24, 120, 360])
def test_the_matrix_is_as_defined(width):
    eye = scattered(width)
    images = panoramas(eye)
    seen = receptors_of(eye).seen(images)
    assert np.abs(seen - np.einsum("khw,nhw->nk", dense(eye, SCATTERED), images)).max() < 2e-5


@pytest.mark.parametrize(("width", "turns"), [(24, 24), (120, 120), (360, 120), (600, 120), (484, 121), (250, 125)])
def test_turns_are_whole_columns_of_the_panorama(width, turns):
    """And turning the eye rolls what it sees, to the last bit."""
    eye = scattered(width)
    receptors, images = receptors_of(eye), panoramas(eye, 2)
    assert receptors.width == turns
    seen = receptors.images(images)
    for k in (1, 7, turns - 1):
        turned = np.roll(images, k * width // turns, axis=2)
        assert np.array_equal(receptors.images(turned), np.roll(seen, k, axis=2))


@cache
def through_rays(name: str) -> tuple[np.ndarray, np.ndarray]:
    """What ommatidia see in a world, 0..255, by the matrix, and by an integral over rays of their own."""
    world, poses = random_world(2, 3000), random_poses(3)
    eye, sharp = (
        compound_eye(name, z=0.05),
        Eye(width=4096, height=2048, top=np.pi / 2, bottom=-np.pi / 2, samples=1, z=0.05),
    )
    grey = Encoding.parse("grey | scale 1")
    with open_renderer(world, eye, "cpu") as coarse, open_renderer(world, sharp, "cpu") as fine:
        by_matrix = 255 * receptors_of(eye).seen(grey(coarse.render(poses)).numpy())
        rays = 255 * grey(fine.render(poses)).numpy()
    azimuth, elevation, acceptance, _ = named_eye(name)
    some = np.random.default_rng(3).choice(len(azimuth), 60, replace=False)
    share, around = (np.arange(200) + 0.5) / 200, 2 * np.pi * (np.arange(90) + 0.5) / 90
    away = np.sqrt(-2 * np.log(1 - share * (1 - np.exp(-8))))[:, None]  # standard deviations, equally likely, up to 4
    by_rays = np.empty((len(poses), len(some)))
    for place, k in enumerate(some):
        ahead = directions(azimuth[k], elevation[k])
        left = np.array([-np.sin(azimuth[k]), np.cos(azimuth[k]), 0])
        angle = away * acceptance[k] / math.sqrt(8 * math.log(2)) + 0 * around
        aside = np.cos(around)[:, None] * left + np.sin(around)[:, None] * np.cross(ahead, left)
        ray = np.cos(angle)[..., None] * ahead + np.sin(angle)[..., None] * aside
        column = ((np.pi - np.arctan2(ray[..., 1], ray[..., 0])) / (2 * np.pi) * sharp.width).astype(int) % sharp.width
        row = (
            ((np.pi / 2 - np.arcsin(ray[..., 2].clip(-1, 1))) / np.pi * sharp.height)
            .astype(int)
            .clip(0, sharp.height - 1)
        )
        weight = np.sinc(angle / np.pi)  # of the sphere, where the Gaussian is over the plane
        by_rays[:, place] = (rays[:, row, column] * weight).sum(axis=(1, 2)) / weight.sum()
    return by_matrix[:, some], by_rays


@pytest.mark.parametrize("name", ["ant", "fly ommatidia=200"])
def test_what_ommatidia_see_is_the_mean_over_rays(name):
    by_matrix, by_rays = through_rays(name)
    assert by_rays.std() > 10
    assert np.sqrt(((by_matrix - by_rays) ** 2).mean()) < 0.5  # of 255 grey levels


def test_a_turned_eye_sees_what_the_image_shows_at_that_turn():
    world, eye = random_world(4, 800), scattered(120)
    encoded = Encoding.named("sky").for_eye(eye)
    with open_renderer(world, eye, "cpu") as renderer:
        here = encoded(renderer.render([(0.1, 0.2, 0.3)]))[0]
        for k in (1, 30, 77):
            turned = encoded(renderer.render([(0.1, 0.2, 0.3 + 2 * np.pi * k / 120)]))[0]
            assert (torch.roll(here, k, dims=1) - turned).abs().max() < 0.01


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("name", [name for name in NAMES if not name.endswith("random")])
def test_every_model_scans_as_if_it_looked_at_each_turn(name, normalised):
    """Scans against turning the panorama, computing what each ommatidium sees, and comparing that alone."""
    eye = compound_eye("fly ommatidia=14", width=24, height=12)
    text = "grey | normalise" if normalised else "grey | scale 1"
    encoded = Encoding.parse(text).for_eye(eye)
    rng = np.random.default_rng(7)
    learned, others = (rng.integers(0, 256, (n, 12, 24, 4), dtype=np.uint8) for n in (12, 2))
    bodies = ("mushroom-body", "opponent-mushroom-body", "hemifields-mushroom-body")
    model = small(name, **({"smoothing_deg": 0.0, "overlap_deg": 8.0} if name in bodies else {}))
    model.see(encoded.mask).fit(encoded(learned))
    scans = model.scan(encoded(others)).numpy()
    wrong = []
    for scan, view in zip(scans, others, strict=True):
        for k in (0, 1, 7, 23):
            turned = encoded(np.roll(view, k, axis=1)[None])[0].numpy()
            alone = by_brute_force(model, turned, encoded.mask)[0]
            wrong.append(abs(scan[k] - alone) > 1e-3 * (1e-3 + np.ptp(scan)))
    # Where two sums are equal but for rounding, either cell or vote may win.
    assert np.mean(wrong) <= (0.13 if name.endswith(("adaboost", "mushroom-body", "spike-overlap")) else 0)


def test_models_files_and_experiments_keep_the_eye(tmp_path):
    eye = scattered(24, height=12)
    encoding = Encoding.named("grey")
    encoded = encoding.for_eye(eye)
    views = np.random.default_rng(1).integers(0, 256, (5, 12, 24, 4), dtype=np.uint8)
    model = PerfectMemory().see(encoded.mask).fit(encoded(views))
    save_model(TrainedModel(model=model, encoding=encoding, eye=eye), tmp_path / "m.safetensors")
    read = load_model(tmp_path / "m.safetensors")
    assert read.eye == eye
    assert np.array_equal(read.model.scan(encoded(views)), model.scan(encoded(views)))
    assert "compound" not in Eye().plain()
    assert "side" not in Eye().plain()


def test_a_walk_with_an_ants_eye_arrives_and_repeats_from_its_command(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    settings = {"world": "tiny", "route_length_m": 1.0, "eye": "ant", "samples": 1, "size": "240x48", "seed": 3}
    experiment = experiment_of(settings)
    walk = experiment.run().summary()
    assert walk["arrived"]
    command = run_command(experiment, "again")
    assert "--eye ant" in command
    again = printed(capfd, *command.split()[1:])
    assert again["steps"] == walk["steps"]
    assert again["mean_deviation_m"] == walk["mean_deviation_m"]
    assert json.loads(Path("again", "summary.json").read_text())["settings"]["eye"] == "ant"


def test_the_eyes_here_are_as_published():
    azimuth, elevation, acceptance, side = named_eye("ant")
    assert 420 <= (side == LEFT).sum() == (side == RIGHT).sum() <= 590
    reach = np.degrees(azimuth[side == LEFT])
    assert (reach.min(), reach.max()) == (pytest.approx(0, abs=4), pytest.approx(150, abs=4))
    apart = directions(azimuth, elevation)[side == LEFT]
    nearest = np.degrees(np.arccos((apart @ apart.T - 2 * np.eye(len(apart))).max(axis=1)))
    assert np.median(nearest) == pytest.approx(3.7, rel=0.1)
    assert np.degrees(acceptance).max() == pytest.approx(math.hypot(2.9, 2.3), abs=0.01)
    bee = named_eye("bee")
    assert (bee.side == LEFT).sum() == pytest.approx(5432, rel=0.05)  # facets of an eye: Seidl and Kaiser 1981
    assert len(named_eye("fly ommatidia=300").azimuth) == pytest.approx(600, rel=0.05)
    whole = named_eye("sphere ommatidia=500")
    assert len(whole.azimuth) == 500
    assert np.abs(directions(whole.azimuth, whole.elevation).mean(axis=0)).max() < 0.01
    for name in EYES:  # left and right mirror one another
        if name != "sphere":
            eyes = named_eye(name)
            left, right = (np.stack([eyes.azimuth, eyes.elevation])[:, eyes.side == one] for one in (LEFT, RIGHT))
            assert np.array_equal(left * [[-1], [1]], right)


def test_files_of_both_kinds_say_where_ommatidia_look(tmp_path):
    (tmp_path / "a.eye").write_text("0 0 0 0 0 1 0.1 0\n1 2 3 -2 0 0 0.2 0\n0,0,0,0,1,1,0.1,0\n\n")
    found = read_eye(tmp_path / "a.eye")
    assert np.degrees(found.azimuth).tolist() == pytest.approx([0, 90, 0])  # x is to the right
    assert np.degrees(found.elevation).tolist() == pytest.approx([0, 0, 45])
    assert found.acceptance.tolist() == [0.1, 0.2, 0.1]
    (tmp_path / "a.csv").write_text(
        "side,azimuth_deg,elevation_deg,acceptance_deg\nleft,90,0,5\nright,-90,10,5\n,0,0,6\n"
    )
    table = read_eye(tmp_path / "a.csv")
    assert np.degrees(table.azimuth).tolist() == pytest.approx([90, -90, 0])
    assert table.side.tolist() == [LEFT, RIGHT, 0]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.eye", "", ["empty"]),
        ("a.eye", "0 0 0 0 0 1 0.1\n", ["line 1", "7 values", "acceptance"]),
        ("a.eye", "0 0 0 0 0 1 0.1 0\n0 0 0 0 0 0 0.1 0\n", ["line 2", "direction is 0"]),
        ("a.eye", "0 0 0 0 0 1 0.1 0\n\n0 0 0 0 0 1 x 0\n", ["line 3", "'x'"]),
        ("a.eye", "0 0 0 0 0 1 -0.1 0\n", ["line 1", "acceptance"]),
        ("a.eye", "0 0 0 nan 0 1 0.1 0\n", ["line 1", "finite"]),
        ("a.csv", "azimuth_deg,elevation_deg\n1,2\n", ["line 1", "acceptance_deg"]),
        ("a.csv", "azimuth_deg,elevation_deg,acceptance_deg\n1,2\n", ["line 2", "2 values"]),
        ("a.csv", "azimuth_deg,elevation_deg,acceptance_deg\n1,95,3\n", ["line 2", "elevation is 95"]),
        ("a.csv", "azimuth_deg,elevation_deg,acceptance_deg,side\n1,5,3,up\n", ["line 2", "'up'"]),
        ("a.csv", "azimuth_deg,elevation_deg,acceptance_deg\n", ["no ommatidia"]),
    ],
)
def test_a_damaged_file_is_refused_with_its_line(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError) as refused:
        read_eye(tmp_path / name)
    assert all(word in str(refused.value) for word in [name, *words]), refused.value


def test_a_text_holds_an_eye(tmp_path):
    packed = CompoundEye.of(SCATTERED, "my.eye")
    again = as_compound(str(packed))
    assert again == packed
    for one, other in zip(again.ommatidia(), SCATTERED, strict=True):
        assert np.array_equal(one, other)
    assert "my.eye, 8 ommatidia" in repr(packed)
    assert as_compound("fly  ommatidia=700") == as_compound("fly ommatidia=700")
    with pytest.raises(SettingError, match="damaged"):
        as_compound("9" + str(packed))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"compound": "antt"}, ["did you mean 'ant'"]),
        ({"compound": "fly ommatidia=5"}, ["10 to 5000"]),
        ({"compound": "fly facets=50"}, ["facets"]),
        ({"compound": "no.eye"}, ["the eye 'no.eye' was not found"]),
        ({"compound": 3}, ["3", "file"]),
        ({"compound": "ant", "mask": np.ones((150, 720), bool)}, ["no mask"]),
        ({"compound": "ant", "top": 0.5}, ["elevations", "49.8"]),
        ({"compound": "ant", "field": 0.01}, ["no ommatidium"]),
    ],
)
def test_an_eye_that_cannot_be_is_refused(fields, words):
    with pytest.raises(InputError) as refused:
        Eye(**fields)
    assert all(word in str(refused.value) for word in words), refused.value


def test_encodings_that_change_the_size_are_refused():
    for text in ("grey | resize 3", "grey | sample 2"):
        with pytest.raises(SettingError, match="leave resize out"):
            Encoding.parse(text).for_eye(scattered(24, height=12))
    with pytest.raises(SettingError, match="normalise"):
        Encoding.parse("foreground-mask | normalise | blur 1").for_eye(scattered(24, height=12))


def test_sides_of_eyes():
    both = Eye(width=36, height=2)
    left, right = (attrs.evolve(both, side=side).visible() for side in ("left", "right"))
    assert not (left & right).any()
    assert (left | right).all()
    assert left[0].tolist() == [True] * 18 + [False] * 18  # the left half of a panorama
    over = attrs.evolve(both, side="left", overlap=math.radians(40)).visible()
    assert over.sum() - left.sum() == 2 * 2  # 20 degrees further, of 10 degrees each
    gap = attrs.evolve(both, side="left", overlap=-math.radians(40)).visible()
    assert left.sum() - gap.sum() == 2 * 2
    eye = scattered(24, height=12)
    assert attrs.evolve(eye, side="left").ommatidia_in_field().tolist() == [
        True,
        True,
        True,
        False,
        True,
        False,
        True,
        True,
    ]
    assert attrs.evolve(eye, side="right").ommatidia_in_field().sum() == 3  # and that straight ahead
    mask = Encoding.named("grey").for_eye(attrs.evolve(eye, side="left")).mask
    assert mask is not None
    assert mask.count == 6


def test_memories_of_one_side_walk():
    for side in ("left", "right"):
        fields = {"eye": Eye(width=90, height=20, side=side, overlap=math.radians(30)), "world": "tiny", "seed": 3}
        walk = Experiment(route_length=1.0, **fields).run().summary()
        assert walk["steps"] > 5


def test_the_picture_shows_each_ommatidium_in_its_place(tmp_path, capfd):
    eye = compound_eye("fly ommatidia=100")
    view = np.zeros((eye.height, eye.width, 4), np.uint8)
    view[..., 3] = 255
    view[:, : eye.width // 2, 0] = 200  # the left half of the world is red
    picture = draw_ommatidia(view, eye)
    width = picture.shape[1]
    ahead = slice(width // 4 - 40, width // 4 + 40)
    assert np.median(picture[:, ahead, 0]) == 200
    assert picture[200:520, width // 2 + 160 : -160, 0].max() < 2
    ant = draw_ommatidia(np.full((120, 600, 4), 255, np.uint8), compound_eye("ant"))
    assert (ant[:, :60] == 0).all()  # it does not see what is behind
    found = printed(
        capfd,
        "view",
        "--world",
        "tiny",
        "--eye",
        "ant",
        "--size",
        "240x48",
        "--samples",
        "1",
        "--out",
        str(tmp_path / "a.png"),
    )
    assert found["width"] == width


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--eye", "antt"], "did you mean 'ant'"),
        (["--eye", "ant", "--resize", "3"], "leave resize out"),
        (["--eye", "ant", "--top-deg", "20"], "elevations"),
        (["--side", "up"], "left"),
    ],
)
def test_commands_refuse_in_one_line(flags, words, capfd, tmp_path):
    with pytest.raises(SystemExit) as end:
        main(["run", "--world", "tiny", *flags, "--out", str(tmp_path / "run")])
    assert end.value.code == 2
    error = capfd.readouterr().err.strip().splitlines()[-1]
    assert words in error
    assert list(tmp_path.iterdir()) == []


def test_learners_get_what_ommatidia_see():
    gymnasium = pytest.importorskip("gymnasium")
    eye = compound_eye("ant", width=240, height=48, samples=1)
    name = "tussock.navigation.rl.environment:tussock/RouteFollowing-v0"
    env = gymnasium.make(name, world="tiny", world_seed=3, length=1.0, eye=eye, encoding="grey")
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    assert (np.asarray(seen) != 0).sum() <= len(named_eye("ant").azimuth)
    with pytest.raises(SettingError, match="give one, such as grey"):
        gymnasium.make(name, world="tiny", length=1.0, eye=eye)


def test_image_databases_are_seen_through_ommatidia(tmp_path, capfd):
    views = ["--world", "tiny", "--seed", "3", "--size", "180x60", "--top-deg", "90", "--bottom-deg", "-30"]
    printed(capfd, "database", "route", *views, "--route-length-m", "1", "--out", str(tmp_path / "route"))
    printed(capfd, "database", "grid", *views, "--spacing-m", "0.2", "--out", str(tmp_path / "grid"))
    databases = ["--route-database", str(tmp_path / "route"), "--grid-database", str(tmp_path / "grid")]
    plain, ant = (printed(capfd, "evaluate", *databases, *flags)["mean_error_deg"] for flags in ([], ["--eye", "ant"]))
    assert ant < 20
    assert ant != plain


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"acceptance": np.full(8, 3.7)}, "acceptance angle is 211"),
        ({"azimuth": np.full(8, np.nan)}, "azimuth is nan"),
        ({"elevation": np.full(8, 2.0)}, "elevation"),
        ({"side": np.full(8, 7, np.int8)}, "side is 7"),
        ({"side": np.zeros(3, np.int8)}, "arrays"),
    ],
)
def test_ommatidia_that_cannot_be_are_refused(change, words):
    with pytest.raises(SettingError, match=words):
        CompoundEye.of(SCATTERED._replace(**change))


def test_navigators_without_a_model_and_databases_refuse_a_compound_eye(tmp_path):
    with pytest.raises(SettingError, match="compound eye"):
        Experiment(world="tiny", eye=scattered(24, height=12), navigator="home-vector")
    with (
        open_renderer(random_world(1, 50), scattered(24, height=12), "cpu") as renderer,
        pytest.raises(SettingError, match="no compound eye"),
    ):
        write_database(tmp_path / "d", renderer, random_poses(2))
    assert list(tmp_path.iterdir()) == []


def test_a_panorama_that_is_too_coarse_or_too_low_is_remarked(caplog):
    receptors_of(compound_eye("ant", width=60, height=12))
    assert "imprecise" in caplog.text
    caplog.clear()
    receptors_of(compound_eye("ant", top=math.radians(50)))
    assert "look at the edge" in caplog.text
    caplog.clear()
    receptors_of(compound_eye("ant"))
    receptors_of(compound_eye("fly ommatidia=50"))
    assert caplog.text == ""


def test_few_ommatidia_are_discs():
    one = Ommatidia(np.zeros(1), np.zeros(1), np.full(1, math.radians(20)), np.zeros(1, np.int8))
    eye = compound_eye(one, top=math.pi / 2, bottom=-math.pi / 2, width=120, height=60)
    picture = draw_ommatidia(np.full((60, 120, 4), 200, np.uint8), eye)
    shown = np.argwhere(picture[..., 3] > 0)
    assert np.ptp(shown[:, 1]) == pytest.approx(1440 * 20 / 360, abs=3)
    assert shown.mean(axis=0) == pytest.approx([360, 720], abs=2)


def test_tables_in_quotes_and_with_semicolons(tmp_path):
    (tmp_path / "a.csv").write_text('"azimuth_deg";"elevation_deg";"acceptance_deg"\n"10";"0";"5"\n')
    assert np.degrees(read_eye(tmp_path / "a.csv").azimuth) == pytest.approx([10])
    (tmp_path / "a.csv").write_text("azimuth_deg,azimuth_deg,elevation_deg,acceptance_deg\n1,2,3,4\n")
    with pytest.raises(FileError, match="more than one column azimuth_deg"):
        read_eye(tmp_path / "a.csv")
    (tmp_path / "a.eye").write_text("0 0 0 1e200 0 1e200 0.1 0\n")
    assert np.degrees(read_eye(tmp_path / "a.eye").azimuth) == pytest.approx([-45])
