"""The rotation engine against a loop that rolls the view."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tussock.navigation.models import filter_bank
from tussock.navigation.models.filter_bank import FilterBank
from tussock.navigation.scan import best_turn, scan_window
from tussock.world.errors import InputError
from tussock.world.geometry import turn_of_columns, wrap_angle

sizes = st.tuples(st.integers(1, 4), st.integers(1, 5), st.integers(1, 6), st.integers(4, 15))


@given(sizes, st.integers(0, 1000))
def test_responses_equal_rolling_and_summing(size, seed):
    n, m, h, w = size
    random = torch.Generator().manual_seed(seed)
    views, filters = torch.randn(n, h, w, generator=random), torch.randn(m, h, w, generator=random)
    rolled = torch.stack([torch.roll(views, k, dims=-1) for k in range(w)], dim=-1)  # (n, h, w, k)
    biases = torch.randn(m, generator=random)
    expected = torch.einsum("nhwk,mhw->nkm", rolled, filters)
    assert torch.allclose(FilterBank(filters).responses(views), expected, atol=1e-4)
    assert torch.allclose(FilterBank(filters, biases).responses(views), expected + biases, atol=1e-4)


def test_blocks_change_nothing(monkeypatch):
    views, filters = torch.randn(3, 4, 12), torch.randn(50, 4, 12)
    whole = FilterBank(filters).responses(views)
    monkeypatch.setattr(filter_bank, "BLOCK", 16)
    bank = FilterBank(filters)
    assert len(list(bank.chunks(views))) == 4
    assert torch.allclose(bank.responses(views), whole, atol=1e-5)


@pytest.mark.parametrize("width", [8, 16, 36, 64, 90, 121])
@pytest.mark.parametrize("m", [1, 7, 40, 127, 600])
@pytest.mark.parametrize("n", [1, 5, 32])
def test_responses_do_not_depend_on_the_number_of_threads(width, m, n):
    random = torch.Generator().manual_seed(m + n)
    views, filters = torch.randn(n, 5, width, generator=random), torch.randn(m, 5, width, generator=random)
    threads = torch.get_num_threads()
    try:
        responses = []
        for number in (1, 2, 3, 8):
            torch.set_num_threads(number)
            responses.append(FilterBank(filters).responses(views).contiguous().numpy().tobytes())
    finally:
        torch.set_num_threads(threads)
    assert len(set(responses)) == 1


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


def test_responses_can_be_learned_from():
    """Their gradient is that of the loop that rolls the view."""
    views = torch.randn(2, 3, 8)
    filters, biases = torch.randn(4, 3, 8, requires_grad=True), torch.randn(4, requires_grad=True)
    rolled = torch.stack([torch.roll(views, k, dims=-1) for k in range(8)], dim=-1)
    slow = torch.einsum("nhwk,mhw->nkm", rolled, filters) + biases
    expected = torch.autograd.grad(slow.square().sum(), (filters, biases))
    found = torch.autograd.grad(FilterBank(filters, biases).responses(views).square().sum(), (filters, biases))
    assert all(torch.allclose(a, b, rtol=1e-4, atol=1e-3) for a, b in zip(found, expected, strict=True))
