"""Encodings: laws of the ring, exact values, and their names."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import random_poses, random_world

from tussock.navigation import encoding_rounding
from tussock.navigation.block_means import block_means
from tussock.navigation.encoding import PRESETS, Encoding
from tussock.navigation.encoding_steps import Clahe, Grey, Normalise
from tussock.navigation.experiment import Experiment
from tussock.navigation.models import PerfectMemory
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError, SettingError

CHAINS = [
    "grey",
    "foreground-mask",
    "grey | blur 1.5",
    "grey | resize 3",
    "grey | sample 3",
    "foreground-mask | vertical-edges",
    "grey | normalise",
    "grey | invert",
    "green 0.5",
    "grey | resize 3 | widen 5",
    "grey | normalise | scale 0.25",
    "foreground-mask | blur 2 | vertical-edges | resize 3 | normalise",
]
LEVELS = 4096  # values are rounded to multiples of 1 / LEVELS
# With tiles, which turn with the eye.
EQUALISED = ["grey | clahe 2 4", "grey | invert | clahe 3.5 4 | resize 3", "foreground-mask | clahe 40 1"]


@pytest.fixture(scope="module")
def views():
    with open_renderer(random_world(), Eye(width=120, height=30, samples=1, z=0.05), "cpu") as renderer:
        return renderer.render(random_poses(6))


@pytest.mark.parametrize("chain", CHAINS)
def test_rolling_the_view_rolls_the_features(views, chain):
    encoding = Encoding.parse(chain)
    step = 3 if "3" in chain else 1
    rolled = encoding(np.roll(views, 5 * step, axis=2)).numpy()
    assert np.allclose(rolled, np.roll(encoding(views).numpy(), 5, axis=2), atol=1e-5)


@pytest.mark.parametrize("chain", EQUALISED)
def test_rolling_the_view_by_whole_tiles_rolls_the_equalised(views, chain):
    encoding = Encoding.parse(chain)
    tiles = int(encoding.steps[-1].tiles if "resize" not in chain else encoding.steps[-2].tiles)
    features = encoding(views).numpy()
    for turned in range(1, tiles + 1):
        rolled = encoding(np.roll(views, turned * 120 // tiles, axis=2)).numpy()
        away = np.abs(rolled - np.roll(features, turned * features.shape[2] // tiles, axis=2))
        assert away.max() < 1.01 / 255 + 1 / LEVELS
        assert away.mean() < 1e-5  # a level here and there, where the sum of four tiles' is midway between two


@pytest.mark.parametrize("chain", CHAINS + EQUALISED)
def test_a_chain_is_its_text(chain):
    assert str(Encoding.parse(chain)).removesuffix(" | resize 1") == chain
    assert Encoding.parse(str(Encoding.parse(chain))) == Encoding.parse(chain)


@pytest.mark.parametrize("chain", CHAINS + EQUALISED)
def test_a_batch_equals_its_views_one_by_one(views, chain):
    encoding = Encoding.parse(chain)
    assert np.allclose(encoding(views), np.concatenate([encoding(view[None]) for view in views]), atol=1e-6)


def rounded(images):
    return np.rint(np.asarray(images, dtype=np.float64) * LEVELS) / LEVELS


@pytest.mark.parametrize("chain", [each for each in CHAINS + EQUALISED if "scale" not in each])
def test_values_are_multiples_of_a_level_and_exact_to_it(views, chain):
    encoding = Encoding.parse(chain)
    features = encoding(views).numpy()
    assert np.array_equal(features, rounded(features))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(encoding_rounding, "LEVELS", 2**20)
        finer = encoding(views).numpy()
    assert np.abs(features - finer).max() < 0.51 / LEVELS


def test_scaling_comes_after_rounding_and_loses_nothing(views):
    features = Encoding.parse("grey | normalise")(views)
    assert np.array_equal(Encoding.parse("grey | normalise | scale 0.001")(views), features * np.float32(0.001))


def test_grey_is_opencvs_grey(views):
    theirs = np.stack([cv2.cvtColor(np.ascontiguousarray(view[..., :3]), cv2.COLOR_RGB2GRAY) for view in views])
    assert np.abs(Encoding.parse("grey")(views).numpy() * 255 - theirs).max() < 1.01


def test_samples_are_opencvs_default_resize(views):
    theirs = np.stack([cv2.resize(image, (30, 8)) for image in Grey()(views)])
    assert np.array_equal(Encoding.parse("grey | sample 4")(views).numpy(), rounded(theirs))


def test_sky_mask_is_alpha_and_its_estimate_from_colours_is_close(views):
    mask = Encoding.parse("foreground-mask")
    exact = mask(views).numpy()
    assert np.array_equal(exact, rounded(views[..., 3] / 255))
    estimated = mask(np.ascontiguousarray(views[..., :3])).numpy()
    assert np.abs(estimated - exact).mean() < 0.05


def test_resizing_averages_blocks():
    image = np.random.default_rng(0).integers(0, 256, (1, 12, 24, 3)).astype(np.uint8)
    means = Grey()(image).reshape(1, 4, 3, 8, 3).mean(axis=(2, 4))
    assert np.array_equal(Encoding.parse("grey | resize 3")(image), rounded(means))
    assert Encoding.parse("grey | resize 7")(image).shape == (1, 2, 4)  # rounded, at least four columns


@given(
    count=st.integers(1, 3),
    blocks=st.tuples(st.integers(1, 9), st.integers(4, 12)),
    size=st.tuples(st.integers(1, 12), st.integers(1, 12)),
    margin=st.integers(0, 2),
)
def test_means_of_blocks_are_numpys_to_the_last_bit(count, blocks, size, margin):
    shape = (count, blocks[0] * size[0], blocks[1] * size[1] + 2 * margin)
    images = np.random.default_rng(sum(shape)).standard_normal(shape).astype(np.float32)
    images = images[:, :, margin : shape[2] - margin]  # not contiguous, as after a blur
    theirs = images.reshape(count, blocks[0], size[0], blocks[1], size[1]).mean(axis=(2, 4), dtype=np.float32)
    assert block_means(images, *size).tobytes() == theirs.tobytes()


def test_edges_are_what_a_loop_finds(views):
    mask = views[..., 3].astype(float) / 255
    edges = Encoding.parse("foreground-mask | vertical-edges")(views).numpy()
    for column in range(120):
        assert np.array_equal(edges[..., column], rounded(abs(mask[..., (column + 1) % 120] - mask[..., column])))


def test_inverting_is_its_own_inverse_and_makes_white_black(views):
    grey = Encoding.parse("grey")(views)
    assert np.allclose(Encoding.parse("grey | invert")(views), 1 - grey, atol=1e-6)
    assert np.allclose(Encoding.parse("grey | invert | invert")(views), grey, atol=1e-6)


@pytest.mark.parametrize("columns", [1, 2, 5])
def test_every_nth_of_the_widened_pixels_is_one_of_a_coarser_view(views, columns):
    grey = Grey()(views)
    coarse = grey.reshape(*grey.shape[:2], -1, columns).mean(axis=3)
    widened = Encoding.parse(f"grey | widen {columns}")(views).numpy()
    assert np.abs(widened[..., ::columns] - coarse).max() < 0.51 / LEVELS


def test_scaling_a_normalised_view_sets_its_deviation(views):
    scaled = Encoding.parse("grey | normalise | scale 0.25")
    assert np.allclose(scaled(views).std(dim=(1, 2), correction=0), 0.25, atol=1e-5)
    shape, low, high = Encoding.parse("grey | normalise").bounds(30, 120)
    assert scaled.bounds(30, 120) == (shape, low / 4, high / 4)


@pytest.mark.parametrize(("clip", "tiles"), [(2, 4), (0.5, 5), (40, 2), (256, 3)])
def test_equalised_images_are_opencvs_of_the_ring_laid_out_thrice(views, clip, tiles):
    views = views[:, : 30 // tiles * tiles]  # else OpenCV makes other tiles
    levels = np.rint(Grey()(views) * 255).astype(np.uint8)
    thrice = cv2.createCLAHE(clip, (3 * tiles, tiles))
    theirs = np.stack([thrice.apply(np.tile(image, 3))[:, 120:240] for image in levels]) / np.float32(255)
    ours = Clahe(clip, tiles)(Grey()(views))
    assert np.abs(ours - theirs).max() < 1.01 / 255
    assert np.abs(ours - theirs).mean() < 1e-5  # a level here and there, by rounding
    # And, but near the seam, of the image as it is.
    once = np.stack([cv2.createCLAHE(clip, (tiles, tiles)).apply(image) for image in levels]) / np.float32(255)
    half = 60 // tiles
    assert np.abs(ours - once)[:, :, half : 120 - half].mean() < 1e-5
    assert np.abs(ours - once).max() > 0.01


def test_rows_that_are_no_whole_tiles_are_mirrored_below(views):
    cut = views[:, :29]
    mirrored = np.concatenate([cut, cut[:, [27, 26, 25]]], axis=1)
    whole = Encoding.parse("grey | clahe 2 4")(mirrored)
    assert np.array_equal(Encoding.parse("grey | clahe 2 4")(cut), whole[:, :29])


def test_equalising_spreads_a_ramp_as_far_as_the_limit_lets_it():
    ramp = np.broadcast_to(np.arange(96, 128, dtype=np.uint8)[:, None, None], (1, 32, 32, 3))
    spread = [np.ptp(Encoding.parse(f"grey | clahe {clip} 1")(ramp).numpy()) for clip in (1, 4, 256)]
    # Of 1024 pixels 32 have each level. A level holds 4 clip of them at most, what is clipped is dealt out to all 256 alike.
    assert np.allclose(
        spread, [31 * (4 * clip + (1024 - 32 * 4 * clip) / 256) / 1024 for clip in (1, 4)] + [31 / 32], atol=0.01
    )


def test_tiles_that_do_not_divide_the_columns_are_refused(views):
    with pytest.raises(InputError, match=r"clahe 2 7: 120 columns .* 7 equal tiles; give a divisor of 120"):
        Encoding.parse("grey | clahe 2 7")(views)


def test_normalised_images_have_mean_0_and_variance_1_and_blank_ones_are_0(views):
    features = Normalise()(Grey()(views))
    assert np.allclose(features.mean(axis=(1, 2)), 0, atol=1e-7)
    assert np.allclose(features.std(axis=(1, 2)), 1, atol=1e-6)
    assert (Encoding.parse("grey | normalise")(np.full((1, 4, 8, 3), 77, np.uint8)).numpy() == 0).all()


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_chains(name, views):
    encoding = Encoding.named(name, resize=3, blur=1)
    assert Encoding.parse(str(encoding)) == encoding
    assert encoding(views).shape == (6, 10, 40)
    assert encoding(views[:0]).shape == (0, 10, 40)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("edge", ("'edge'", "grey, sky, edges, green, uv, uv-green")),
        ("uv | resize 3", ("uv is a preset, which stands alone", "'ultraviolet 0.05'")),
        ("blur 2 | grey", ("'blur'", "after one that takes views")),
        ("grey | sharpen", ("'sharpen'", "blur, resize", "package.module:Class")),
        ("grey | grey", ("'grey'", "at the beginning only")),
        ("grey | blur", ("blur takes 1 number (sigma)", "'blur'")),
        ("grey | blur two", ("blur takes 1 number", "'blur two'")),
        ("grey | normalise 3", ("normalise takes no numbers", "'normalise 3'")),
        ("grey | resize 0.5", ("factor is 0.5", "from 1 to 1000")),
        ("grey | blur nan", ("sigma is nan", "over 0 to 100 (pixels)")),
        ("grey | widen 1.5", ("columns is 1.5", "whole number")),
        ("grey | scale 2", ("factor is 2.0", "over 0 to 1")),
        ("grey | invert 1", ("invert takes no numbers",)),
        ("grey | clahe 2", ("clahe takes 2 numbers (clip, tiles)", "'clahe 2'")),
        ("grey | clahe 0 8", ("clip is 0.0", "over 0 to 256")),
        ("grey | clahe nan 8", ("clip is nan",)),
        ("grey | clahe 2 0", ("tiles is 0.0", "from 1 to 256")),
        ("grey | clahe 2 2.5", ("tiles is 2.5", "whole number")),
        ("grey | clahe 2 nan", ("tiles is nan",)),
        ("grey | normalise | invert", ("invert takes values from 0 to 1", "before normalise")),
        ("grey | normalise | resize 2 | clahe 2 4", ("clahe takes values from 0 to 1",)),
        ("grey |", ("''", "known:")),
    ],
)
def test_an_invalid_chain_is_refused_with_its_text_and_the_remedy(text, parts):
    with pytest.raises(SettingError) as refused:
        Encoding.named(text)
    message = str(refused.value)
    assert repr(text) in message
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_a_chain_in_full_takes_no_resize_from_outside():
    with pytest.raises(SettingError, match="chain in full"):
        Encoding.named("grey | resize 3", resize=2)


@pytest.mark.parametrize("text", ["foreground-mask", "sky-mask", "grey | resize 1", "grey"])
def test_a_step_alone_is_printed_so_that_it_is_read_back_as_itself(text):
    encoding = Encoding.named(text)
    assert len(encoding.steps) == 1
    assert Encoding.named(str(encoding)) == Encoding.parse(str(encoding)) == encoding
    assert str(encoding) not in PRESETS  # which the command line would resize


def test_the_old_name_of_a_step_still_works():
    assert Encoding.parse("sky-mask | normalise") == Encoding.parse("foreground-mask | normalise")
    assert str(Encoding.parse("sky-mask | normalise")) == "foreground-mask | normalise"


@given(
    st.sampled_from([0, 255]),
    st.lists(st.sampled_from(["invert", "scale 0.5", "vertical-edges", "blur 0.7", "clahe 2 4"]), max_size=5),
)
def test_values_stay_within_the_bounds_of_the_chain(level, filters):
    view = np.full((1, 6, 8, 3), level, np.uint8)
    view[0, 2, 3] = 255 - level
    encoding = Encoding.parse(" | ".join(["grey", *filters]))
    shape, low, high = encoding.bounds(6, 8)
    features = encoding(view).numpy()
    assert features.shape[1:] == shape
    assert low - 1e-5 <= features.min()
    assert features.max() <= high + 1e-5


@given(st.integers(1, 12), st.integers(4, 40), st.sampled_from([3, 4]), st.integers(0, 255), st.sampled_from(CHAINS))
def test_any_view_gives_finite_features(height, width, channels, level, chain):
    features = Encoding.parse(chain)(np.full((2, height, width, channels), level, np.uint8))
    assert np.isfinite(features.numpy()).all()


@given(st.integers(1, 12), st.integers(1, 6), st.integers(1, 5), st.integers(0, 255))
def test_any_view_is_equalised_to_values_from_0_to_1(height, tiles, wide, level):
    view = np.full((2, height, tiles * wide, 3), level, np.uint8)
    features = Encoding.parse(f"grey | clahe 2 {tiles}")(view).numpy()
    assert features.shape == view.shape[:3]
    assert ((features >= 0) & (features <= 1)).all()


# As published

HEADS = "green 1 | centre-means 8 4 | invert | head-views 10 2 40 4 7 3"  # of 120 x 48: 30 columns of 12 degrees, of which a head sees 20


@pytest.fixture(scope="module")
def tall_views():
    with open_renderer(random_world(), Eye(width=120, height=48, samples=1, z=0.05), "cpu") as renderer:
        return renderer.render(random_poses(3))


def seen_by_a_head(view: np.ndarray) -> np.ndarray:
    """What a head sees that faces ahead, step by step as the published program does it: 80 of 120 columns, in blocks of 8 x 8."""
    green = np.where(view[..., 3] == 0, 255, view[..., 1])[:, 20:100].astype(float)
    means = np.array([[green[y + 2 : y + 6, x + 2 : x + 6].mean() for x in range(0, 80, 8)] for y in range(0, 48, 8)])
    equalised = cv2.createCLAHE(40.0, (4, 4)).apply(np.rint(255 - means).astype(np.uint8))
    return cv2.resize(equalised, (7, 3), interpolation=cv2.INTER_CUBIC)


def test_head_views_are_those_of_a_program_that_turns_the_head(tall_views):
    features = np.rint(255 * Encoding.parse(HEADS)(tall_views).numpy())
    assert features.shape == (3, 21, 30)
    for view, columns in zip(tall_views, features, strict=True):
        for k in range(30):  # turned left by 12 degrees k times
            expected = seen_by_a_head(np.roll(view, 4 * k, axis=1)).ravel()
            away = np.abs(columns[:, (15 - k) % 30] - expected)
            assert away.max() <= 12  # where a mean is midway between two levels, it may be rounded either way
            assert (away > 0).mean() < 0.2
    assert features.std() > 20


def test_head_views_turn_with_the_eye_to_the_last_bit(tall_views):
    encoding = Encoding.parse(HEADS)
    rolled = encoding(np.roll(tall_views, 4 * 7, axis=2)).numpy()
    assert np.array_equal(rolled, np.roll(encoding(tall_views).numpy(), 7, axis=2))


@pytest.mark.parametrize("degrees", [240, 300, 360])
def test_models_compare_one_head_view_at_each_rotation(tall_views, degrees):
    encoded = Encoding.parse(HEADS).for_eye(Eye(width=120, height=48, field=np.radians(degrees)))
    assert encoded.mask.visible.sum() == 21
    features = encoded(tall_views)
    scan = PerfectMemory().see(encoded.mask).fit(features[:2]).scan(features[2:])[0].numpy()
    views = Encoding.parse(HEADS)(tall_views).double().numpy()
    seen = np.stack([views[2, :, (15 - k) % 30] for k in range(30)])
    nearest = np.sqrt(((seen[:, None] - views[:2, :, 15]) ** 2).mean(axis=2)).min(axis=1)
    assert np.allclose(-scan, nearest, atol=1e-5)


def test_head_views_of_more_than_the_eye_sees_are_refused():
    with pytest.raises(SettingError, match="head-views shows 240 degrees, of which the eye does not see all"):
        Encoding.parse(HEADS).for_eye(Eye(width=120, height=48, field=np.radians(220)))


def test_green_is_the_green_channel_under_a_sky_of_any_brightness(tall_views):
    green = Encoding.parse("green 0.3")(tall_views).numpy()
    open_sky = tall_views[..., 3] == 0
    assert 0.05 < open_sky.mean() < 0.95
    assert np.array_equal(green[open_sky], np.full(open_sky.sum(), rounded(0.3)))
    assert np.array_equal(green[~open_sky], rounded(tall_views[..., 1][~open_sky] / 255))
    opaque = np.ascontiguousarray(tall_views[..., :3])
    assert np.array_equal(Encoding.parse("green 0.3")(opaque), rounded(opaque[..., 1] / 255))


def test_a_field_hides_centre_means_of_hidden_pixels_alone():
    visible = np.zeros((8, 24), bool)
    visible[2:6, 2:6] = True  # the central half of the first block
    shown = Encoding.parse("grey | centre-means 8 4").visible(visible)
    assert shown.tolist() == [[True, False, False, False, False, False]]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("green 1 | centre-means 6 2", ("block is 6", "multiple of 4")),
        ("green 1 | centre-means 8 1.5", ("every is 1.5", "whole number")),
        (
            "green 1 | head-views 74 2 40 8 36",
            ("head-views takes 6 numbers (columns, stride, clip, tiles, width, height)",),
        ),
        ("green 1 | head-views 74 2 40 8.5 36 10", ("tiles is 8.5", "whole number")),
        ("green 1 | normalise | head-views 74 2 40 8 36 10", ("head-views takes values from 0 to 1",)),
        ("green", ("green takes 1 number (sky)",)),
    ],
)
def test_an_invalid_chain_as_published_is_refused(text, parts):
    with pytest.raises(SettingError) as refused:
        Encoding.parse(text)
    assert all(part in str(refused.value) for part in parts), str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("green 1 | centre-means 8 7", "a width that 7 divides and a height that 8 divides"),
        ("green 1 | head-views 61 2 40 4 7 3", "more than all 120; give fewer"),
    ],
)
def test_views_that_are_too_small_for_a_chain_as_published_are_refused(text, message):
    with pytest.raises(SettingError, match=message):
        Encoding.parse(text)(np.zeros((1, 48, 120, 4), np.uint8))


# Green and ultraviolet


def test_the_ultraviolet_is_bright_in_the_sky_and_dark_elsewhere(views):
    covered = views[..., 3] / 255
    seen = Encoding.parse("ultraviolet 0.1 | scale 1")(views).numpy()
    assert np.abs(seen - (1 - 0.9 * covered)).max() < 2e-4
    green = Encoding.parse("green-channel | scale 1")(views).numpy()
    assert np.abs(green - views[..., 1] / 255).max() < 2e-4
    contrast = Encoding.parse("ultraviolet-green 0.1 | scale 1")(views).numpy()
    u, g = 1 - 0.9 * covered, views[..., 1] / 255
    assert np.abs(contrast - (u - g) / (u + g)).max() < 2e-4
    both = Encoding.parse("ultraviolet-and-green 0.1 | scale 1")(views).numpy()
    assert np.array_equal(both, np.concatenate([seen, green], axis=1))


def test_the_contrast_of_black_is_0_and_not_nan():
    black = np.zeros((1, 4, 8, 4), np.uint8)
    black[..., 3] = 255
    assert (Encoding.parse("ultraviolet-green 0 | scale 1")(black).numpy() == 0).all()


def test_a_walk_by_ultraviolet_arrives():
    for encoding in ("uv", "uv-green", "ultraviolet-and-green 0.05 | resize 3"):
        eye = Eye(width=180, height=40)
        walk = Experiment(world="tiny", seed=3, route_length=1.0, eye=eye, encoding=encoding).run().summary()
        assert walk["arrived"], encoding
