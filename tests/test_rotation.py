"""The rotation engine against a loop that rolls the view."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tussock.navigation.models import spectra
from tussock.navigation.models.filter_bank import FilterBank, NearestFilters
from tussock.navigation.scan import best_turn, scan_window
from tussock.navigation.threads import threads
from tussock.world.errors import InputError
from tussock.world.geometry import turn_of_columns, wrap_angle

sizes = st.tuples(st.integers(1, 4), st.integers(1, 5), st.integers(1, 6), st.integers(4, 15))


def random_images(n: int, h: int, w: int, seed: int) -> torch.Tensor:
    return torch.randn(n, h, w, generator=torch.Generator().manual_seed(seed))


def rolled(views: torch.Tensor) -> torch.Tensor:
    """Every view at every rotation (n, w, h, w), in float64."""
    return torch.stack([torch.roll(views.double(), k, dims=-1) for k in range(views.shape[-1])], dim=1)


def by_rolling(views: torch.Tensor, filters: torch.Tensor, biases: torch.Tensor) -> torch.Tensor:
    """Responses (n, w, m) from rolled views, in float64."""
    return torch.einsum("nkhw,mhw->nkm", rolled(views), filters.double()) + biases.double()


@given(sizes, st.integers(0, 1000))
def test_responses_equal_rolling_and_summing(size, seed):
    n, m, h, w = size
    views, filters, biases = random_images(n, h, w, seed), random_images(m, h, w, seed + 1), torch.arange(float(m))
    expected = by_rolling(views, filters, biases)
    assert torch.allclose(FilterBank(filters).responses(views).double(), expected - biases, atol=1e-4)
    assert torch.allclose(FilterBank(filters, biases).responses(views).double(), expected, atol=1e-4)


@given(sizes, st.integers(0, 1000), st.data())
def test_the_nearest_filter_is_the_one_with_the_least_response(size, seed, data):
    n, m, h, w = size
    first = data.draw(st.integers(0, m - 1))
    among = slice(first, data.draw(st.integers(first + 1, m)))
    views, filters, biases = random_images(n, h, w, seed), random_images(m, h, w, seed + 1), torch.arange(float(m))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spectra, "FILTERS", data.draw(st.integers(1, m)))
        patch.setattr(spectra, "VIEWS", data.draw(st.integers(1, n)))
        least, index, _ = NearestFilters(filters, biases).nearest(views, torch.zeros(n), among).parts
    expected = by_rolling(views, filters, biases)
    assert torch.allclose(least.double(), expected[..., among].amin(dim=2), atol=1e-4)
    assert ((index >= among.start) & (index < among.stop)).all()
    assert torch.allclose(least.double(), expected.gather(2, index[..., None])[..., 0], atol=1e-4)


@given(sizes, st.integers(0, 1000), st.data())
def test_it_is_doubtful_where_another_response_is_as_low_within_the_tolerance(size, seed, data):
    n, m, h, w = size
    views, filters = random_images(n, h, w, seed), random_images(m, h, w, seed + 1)
    copies = filters.repeat(data.draw(st.integers(1, 90)), 1, 1)[torch.randperm(m)] if m > 1 else filters
    filters = torch.cat([filters, copies])
    biases = torch.arange(float(len(filters))) / len(filters)
    tolerance = torch.full((n,), data.draw(st.floats(0.01, 2)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spectra, "FILTERS", data.draw(st.integers(1, m)))
        nearest = NearestFilters(filters, biases).nearest(views, tolerance)
    above = by_rolling(views, filters, biases)
    above -= above.amin(dim=2, keepdim=True)
    for inside, surely in ((tolerance - 1e-3, True), (tolerance + 1e-3, False)):
        doubtful = (above <= inside[:, None, None]).sum(dim=2) > 1
        assert (nearest.doubtful[doubtful] if surely else ~nearest.doubtful[~doubtful]).all()


def test_filters_that_are_added_and_left_out_across_tiles():
    # More than two tiles of filters, in steps that end inside a panel, and others added to the same beginning.
    views, filters = random_images(3, 2, 10, 0), random_images(150, 2, 10, 1)
    biases = torch.arange(150.0)
    expected = by_rolling(views, filters, biases)
    beginning = NearestFilters(filters[:5], biases[:5])
    other = beginning.appended(-filters[:40], biases[:40])  # stored where the next ones would be
    combined = beginning
    for first, last in pairwise((5, 21, 64, 100, 130, 150)):
        combined = combined.appended(filters[first:last], biases[first:last])
    expected_of_other = by_rolling(views, torch.cat([filters[:5], -filters[:40]]), torch.cat([biases[:5], biases[:40]]))
    nothing = torch.zeros(3)
    assert torch.equal(other.nearest(views, nothing).index, expected_of_other.argmin(dim=2))
    for some in (slice(None), slice(3), slice(17, 140), slice(63, 64), slice(64, 129), slice(149, 150)):
        least, index, _ = combined.nearest(views, nothing, some).parts
        assert torch.equal(index, expected[..., some].argmin(dim=2) + (some.start or 0))
        assert torch.allclose(least.double(), expected[..., some].amin(dim=2), atol=1e-4)


@pytest.mark.parametrize(
    ("height", "width", "m"), [(1, 1, 1), (2, 2, 70), (3, 7, 5), (2, 8, 65), (5, 10, 20), (4, 90, 130)]
)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_compiled_responses_equal_those_of_torch_and_of_any_number_of_threads(height, width, m, dtype, monkeypatch):
    monkeypatch.setattr(spectra, "SMALL", 0)
    views, filters = random_images(5, height, width, 0).to(dtype), random_images(m, height, width, 1).to(dtype)
    biases, among = torch.arange(float(m)).to(dtype), slice(m // 4, m)
    tolerance = 1e-10 if dtype == torch.float64 else 1e-3
    (chunk,) = spectra.Spectra(filters).chunks(views, biases, among)
    results = []
    for number in (1, 2, 3):
        with threads(number):
            responses = chunk.responses()
            assert torch.allclose(responses, chunk.by_torch(), atol=tolerance)
            results.append((responses, chunk.absolute()))
    assert torch.allclose(results[0][1], results[0][0].abs().sum(dim=2), rtol=1e-5)
    assert all(torch.equal(one, first) for result in results for one, first in zip(result, results[0], strict=True))


@pytest.mark.parametrize(("n", "m", "width"), [(1, 600, 8), (32, 40, 36), (32, 1, 64), (1, 40, 121), (32, 600, 90)])
def test_threads_and_batches_change_responses_by_no_more_than_the_stated_rounding(n, m, width):
    views, filters = random_images(n, 5, width, m + n), random_images(m, 5, width, m + n + 1)
    sizes = views.flatten(start_dim=1).norm(dim=1)[:, None, None] * filters.flatten(start_dim=1).norm(dim=1)
    tolerance = 1e-6 * width**0.5 * sizes
    expected = by_rolling(views, filters, torch.zeros(m))
    before = torch.get_num_threads()
    try:
        for number in (1, 2, 5):
            torch.set_num_threads(number)
            bank, nearest = FilterBank(filters), NearestFilters(filters, torch.zeros(m))
            together, least = bank.responses(views), nearest.nearest(views, torch.zeros(n)).least
            assert torch.equal(bank.responses(views), together)  # the same threads and batch: the same bytes
            assert torch.equal(nearest.nearest(views, torch.zeros(n)).least, least)
            for responses in (together, torch.cat([bank.responses(view[None]) for view in views])):
                assert ((responses - expected).abs() <= tolerance).all()
            assert ((least - expected.amin(dim=2)).abs() <= tolerance.amax(dim=2)).all()
    finally:
        torch.set_num_threads(before)


def test_the_best_turn_is_left_for_low_rotations_and_right_for_high_ones():
    familiarity = np.zeros((2, 36))
    familiarity[0, 2] = familiarity[1, 34] = 1
    assert np.allclose(np.degrees(best_turn(familiarity)), [20, -20])


def test_interpolation_finds_the_top_of_a_parabola_between_columns():
    turns = turn_of_columns(np.arange(36), 36)
    for top in np.radians([3.0, -41.5, 174.0]):
        away = wrap_angle(turns - top)
        assert np.isclose(best_turn(-(away**2)[None])[0], top, atol=1e-9)
        assert abs(best_turn(-(away**2)[None], interpolate=False)[0] - top) <= np.radians(5.01)


def test_a_flat_scan_goes_straight_on():
    assert best_turn(np.zeros((1, 36)), scan_window(36, np.pi)) == 0


@given(st.integers(4, 200), st.floats(0.01, 2 * np.pi), st.floats(-np.pi, np.pi))
def test_a_window_holds_the_rotations_within_half_its_angle(width, angle, centre):
    window = scan_window(width, angle, centre)
    away = np.abs(wrap_angle(turn_of_columns(np.arange(width), width) - centre))
    assert window.any()
    assert window[away < angle / 2 - 1e-6].all()
    assert (away[window] <= max(angle / 2, np.pi / width) + 1e-6).all()


@given(st.integers(0, 1000))
def test_the_chosen_rotation_lies_in_the_window(seed):
    familiarity = np.random.default_rng(seed).normal(size=(3, 24))
    windows = np.stack([scan_window(24, np.pi / 2, centre) for centre in (0.0, 2.0, -3.0)])
    columns = np.round(best_turn(familiarity, windows, interpolate=False) * 24 / (2 * np.pi)).astype(int) % 24
    assert windows[np.arange(3), columns].all()
    assert (familiarity[np.arange(3), columns] == np.where(windows, familiarity, -9).max(axis=1)).all()


@pytest.mark.parametrize("angle", [0, -1, 7, np.nan])
def test_a_scan_of_no_angle_is_refused(angle):
    with pytest.raises(InputError, match="scan"):
        scan_window(36, angle)


def test_gradients_of_responses_equal_those_of_rolling():
    views, filters, biases = random_images(2, 3, 8, 0), random_images(4, 3, 8, 1), random_images(1, 1, 4, 2)[0, 0]
    filters.requires_grad_(), biases.requires_grad_()
    expected = torch.autograd.grad(by_rolling(views, filters, biases).square().sum(), (filters, biases))
    gradients = torch.autograd.grad(FilterBank(filters, biases).responses(views).square().sum(), (filters, biases))
    assert all(torch.allclose(a, b, rtol=1e-4, atol=1e-3) for a, b in zip(gradients, expected, strict=True))
