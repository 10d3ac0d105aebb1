"""What insects see: ultraviolet in place of red. Against what each ray meets, the other renderers, and views of people."""

import dataclasses

import attrs
import numpy as np
import pytest
from commands import tussock
from scenes import full_poses, hills, mesh_world, post, random_poses, random_texture, random_world, textured_world

from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_settings import experiment_of
from tussock.navigation.settings_table import read_settings
from tussock.render import Eye, lit, open_renderer
from tussock.render.images.folders import eye_of
from tussock.render.images.writing import write_database
from tussock.render.scanline import ScanlineRenderer
from tussock.world.errors import InputError, SettingError
from tussock.world.files import read_world, write_world
from tussock.world.flight import Flight
from tussock.world.light import Light
from tussock.world.scene import World
from tussock.world.textures import to_display, to_linear

INSECT = Eye(width=360, height=75, spectrum="insect plants=0.02 ground=0.2 stones=0.1 other=0.5")
HUMAN = Eye(width=360, height=75)


def display(share: float) -> int:
    """The value (0..255) in which a view shows a share of the light."""
    return int(np.rint(255 * to_display(np.array(share))))


def both(world: World, poses: np.ndarray, backend: str = "cpu") -> tuple[np.ndarray, np.ndarray]:
    """What people and insects see."""
    with open_renderer(world, HUMAN, backend) as human, open_renderer(world, INSECT, backend) as insect:
        return human.render(poses), insect.render(poses)


@pytest.mark.parametrize("world", ["tiny stone_density=4", "tiny hill_height=0.3 stone_density=4", "desert"])
def test_the_ultraviolet_of_each_pixel_is_that_of_the_triangle_its_ray_meets(world):
    world = World.generate(world, 3)
    poses = full_poses(world.field, 4)
    _, views = both(world, poses)
    with ScanlineRenderer(world, INSECT) as renderer:
        _, triangles = renderer.hits(poses)
    flat = world.ground is not None
    kind_of = np.array(world.plants.kinds)[world.plants.kind]
    expected = np.full(len(world.surfaces()[0]) + 1, display(0.2))
    expected[-1] = 255  # the sky
    for row, plant in enumerate(world.plants.of):
        shares = {"stone": 0.1, "pebble": 0.1}
        low = world.triangles[row, :, 2].max() < 0.01 if flat else row >= world.terrain.part[0]
        share = shares.get(kind_of[plant], 0.02) if plant >= 0 else 0.2 if low else 0.5
        shown, even = (float(to_linear(each[row, 1] / 255)) for each in (world.rgb, world.reflectance))
        expected[row] = display(min(1.0, share * shown / even))
    assert np.array_equal(views[..., 0], expected[triangles])
    assert len(np.unique(views[..., 0])) >= 4


@pytest.mark.parametrize("world", ["tussock-field", "hay-meadow", "woodland", "desert", "tiny hill_height=0.3"])
def test_the_share_of_the_ground_is_seen_in_each_world(world):
    world = World.generate(world, 1)
    middle = np.append(world.field.size / 2, 0.0)[None]
    for each in (world, world.flown(Flight.at(0.5))):
        views = []
        for share in (0.1, 0.8):
            eye = Eye(width=90, height=25, top=0.3, bottom=-0.8, spectrum=f"insect ground={share}")
            with open_renderer(each, eye) as renderer:
                views.append(renderer.render(middle)[0, ..., 0])
        changed = views[1] != views[0]
        assert changed[-5:].mean() > 0.3  # rows that look at the ground
        assert not changed[:3].any()


def test_each_spectrum_has_its_own_colours():
    world = World.generate("tiny", 3)
    shares = [0.02, 0.5, 0.02]
    views = []
    for share in shares:
        with open_renderer(world, attrs.evolve(HUMAN, spectrum=f"insect plants={share}")) as renderer:
            views.append(renderer.render(random_poses(2) * 0.2 + [2, 2, 0]))
    assert np.array_equal(views[0], views[2])
    assert not np.array_equal(views[0], views[1])


@pytest.mark.parametrize("light", [None, Light(), Light(clouds=1.0)])
def test_green_blue_and_what_is_covered_are_as_people_see_them(light):
    textures = [random_texture(1), random_texture(2, alpha="mask")]
    generated, hilly = World.generate("tiny", 3), World.generate("tiny hill_height=0.3", 3)
    for world in (generated, hilly, textured_world(textures), textured_world(textures, colours=True), random_world()):
        world = world if light is None else lit(world, light)
        human, insect = both(world, full_poses(world.field, 3))
        assert np.array_equal(human[..., 1:], insect[..., 1:])
        assert not np.array_equal(human[..., 0], insect[..., 0])


def test_textures_have_no_pattern_in_the_ultraviolet():
    world = textured_world([random_texture(1), random_texture(2)])
    _, views = both(world, random_poses(4))
    assert set(np.unique(views[..., 0])) == {255, display(0.5), display(0.2)}
    painted = textured_world([random_texture(1)], colours=True)
    _, views = both(painted, random_poses(4))
    assert set(np.unique(views[..., 0])) == {255, display(0.5), display(0.2)}


def test_sun_and_shadow_are_those_of_a_white_world():
    """Where all reflects the same share, the ultraviolet is that share of the light in a world that is white everywhere."""
    world = World.generate("tiny", 3)
    ground = dataclasses.replace(world.ground, rgb=(255, 255, 255))
    white = dataclasses.replace(
        world, rgb=np.full_like(world.rgb, 255), reflectance=None, ground=ground, sky_rgb=(255, 255, 255)
    )
    eye = Eye(width=360, height=75, spectrum="insect plants=1 ground=1 stones=1 other=1")
    poses = full_poses(world.field, 3)
    with open_renderer(lit(world, Light()), eye) as one, open_renderer(lit(white, Light()), HUMAN) as other:
        assert np.array_equal(one.render(poses)[..., 0], other.render(poses)[..., 0])


@pytest.mark.parametrize("light", [None, Light()])
def test_the_renderers_agree(backend, light):
    worlds = [World.generate("tiny", 1), textured_world([random_texture(1), random_texture(2)])]
    for world in worlds if light is None else [lit(world, light) for world in worlds]:
        poses = full_poses(world.field, 3)
        views, exact = (both(world, poses, name)[1].astype(int) for name in (backend, "cpu"))
        assert (np.abs(views - exact).max(axis=-1) > 8).mean() < 0.02


def test_a_mesh_reflects_one_share_before_and_after_a_change():
    world = mesh_world(hills(), post(1, 1, 0), post(2, 3, 0), post(4, 2, 0))
    gone = world.changed("removed amount=0.5")
    for each in (world, gone):
        _, views = both(each, full_poses(world.field, 2))
        assert set(np.unique(views[..., 0])) == {255, display(0.5)}


def test_encodings_take_the_ultraviolet_that_views_show():
    world = World.generate("tiny", 3)
    with open_renderer(world, INSECT) as renderer:
        views = renderer.render(full_poses(world.field, 3))
    u, g = views[..., 0] / 255, views[..., 1] / 255

    def seen(text: str) -> np.ndarray:
        return Encoding.parse(text).for_eye(INSECT)(views).numpy()

    assert np.abs(seen("ultraviolet 0.05 | scale 1") - u).max() < 2e-4
    assert np.abs(seen("ultraviolet-green 0.05 | scale 1") - (u - g) / (u + g)).max() < 2e-4
    assert np.abs(seen("ultraviolet-and-green 0.05 | scale 1") - np.concatenate([u, g], axis=1)).max() < 2e-4
    edges = "foreground-mask | vertical-edges | normalise"
    assert np.array_equal(seen(edges), Encoding.parse(edges).for_eye(HUMAN)(views).numpy())
    narrow = Eye(width=360, height=75, spectrum="insect", field=3.0)
    encoding = Encoding.named("uv").for_eye(narrow)
    assert encoding.mask is not None
    assert np.array_equal(encoding(views), encoding(views[..., :3]))  # nothing is estimated from the whole view
    with pytest.raises(SettingError, match=r"ultraviolet 0.9 says what .* --spectrum 'insect plants=0.9"):
        Encoding.parse("ultraviolet 0.9 | scale 1").for_eye(INSECT)


def test_spectra_are_texts_in_one_form():
    assert Eye(spectrum=" human ").spectrum == "human"
    assert Eye(spectrum="insect ground=0.06  plants=0.1").spectrum == "insect plants=0.1"
    assert read_settings(Experiment(eye=Eye(spectrum="insect")))["spectrum"] == "insect"
    assert "spectrum" not in Eye().plain()
    for wrong, message in (
        ("human ground=0.2", "takes no parameters"),
        ("bird", "unknown spectrum 'bird'; give human, insect"),
        ("insect bark=0.1", "bark"),
        ("insect plants=2", "plants"),
        (3, "spectrum is 3"),
        ("", "unknown spectrum ''"),
    ):
        with pytest.raises(SettingError, match=message):
            Eye(spectrum=wrong)


def test_a_world_that_was_read_with_its_light_is_refused(tmp_path):
    write_world(lit(World.generate("tiny", 1), Light()), tmp_path / "lit.glb")
    with pytest.raises(SettingError, match="give --light"):
        open_renderer(read_world(tmp_path / "lit.glb"), INSECT)


def test_image_databases_say_which_spectrum_they_show(tmp_path):
    world = World.generate("tiny", 1)
    for name, eye in (("human", HUMAN), ("insect", INSECT)):
        with open_renderer(world, eye) as renderer:
            write_database(tmp_path / name, renderer, random_poses(2) * 0.1 + [2, 2, 0])
        assert eye_of(tmp_path / name).spectrum == eye.spectrum
    with pytest.raises(SettingError, match="spectrum 'human', not 'insect'"):
        eye_of(tmp_path / "human", None, {"spectrum": "insect"})
    with pytest.raises(InputError, match="different eyes: spectrum"):
        eye_of(tmp_path / "human", tmp_path / "insect")
    same = {
        "spectrum": "insect  plants=.02 ground=0.2 stones=0.1 other=0.5",
        "route_database": str(tmp_path / "insect"),
    }
    assert experiment_of(same | {"grid_database": str(tmp_path / "insect")}).eye.spectrum == INSECT.spectrum
    metadata = tmp_path / "human" / "database_metadata.yaml"
    metadata.write_text(metadata.read_text().split("tussock:")[0])  # as others write it
    assert eye_of(tmp_path / "human", None, {"spectrum": "insect"}).spectrum == "insect"
    assert eye_of(tmp_path / "human").spectrum == "human"


def test_a_trained_model_keeps_the_spectrum(tmp_path, capfd):
    model, world = tmp_path / "model.safetensors", ("--world", "tiny", "--route-length-m", "1")
    flags = ("--size", "90x25", "--encoding", "uv", "--spectrum", "insect ground=0.2")
    assert tussock(capfd, "train", *world, *flags, "--out", model)[0] == 0
    assert experiment_of({"model": str(model), "world": "tiny"}).eye.spectrum == "insect ground=0.2"
    code, _, error = tussock(capfd, "run", *world, "--model", model, "--spectrum", "human", "--out", tmp_path / "run")
    assert code == 2
    assert error.strip().endswith(
        "spectrum 'insect ground=0.2', not spectrum 'human'; leave out --spectrum, or train anew"
    )


def test_commands_see_as_insects_do(tmp_path, capfd):
    view = ("view", "--world", "tiny", "--size", "90x25", "--spectrum")
    code, _, error = tussock(capfd, *view, "insect", "--out", tmp_path / "view.png")
    assert (code, error) == (0, "renderer: cpu\n")
    code, _, error = tussock(capfd, *view, "fish", "--out", tmp_path / "no.png")
    assert code == 2
    assert error.strip().endswith("give human, insect, or 'insect ground=0.2'")
    walk = Experiment(
        world="tiny", seed=3, route_length=1.0, eye=Eye(width=180, height=40, spectrum="insect"), encoding="uv"
    )
    assert walk.run().summary()["arrived"]
