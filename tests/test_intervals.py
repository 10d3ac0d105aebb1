"""Confidence intervals and tests over worlds: against closed forms and brute force, and how often they are right in simulations."""

import dataclasses
import tracemalloc
from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from tussock.navigation.intervals import (
    CONFIDENCE,
    MIN_WORLDS,
    mean_interval,
    positive_interval,
    share_difference_interval,
    share_interval,
)
from tussock.navigation.significance import holm, sign_flip_p


def ends(interval) -> list[float]:
    return [interval.low, interval.high]


def of_counts(having, runs):
    """Values and worlds of runs, from how many of each world's runs have what is counted."""
    values = np.concatenate([np.arange(n) < k for k, n in zip(having, runs, strict=True)]).astype(float)
    return values, np.repeat(np.arange(len(runs)), runs)


# Against closed forms and brute force


@pytest.mark.parametrize(("having", "worlds"), [(1, 7), (6, 11), (19, 20), (70, 400)])
def test_with_one_run_in_each_world_a_share_has_the_beta_interval(having, worlds):
    """With a flat prior, the share of independent runs has a beta distribution (Bayes 1763)."""
    values = (np.arange(worlds) < having).astype(float)
    expected = stats.beta.ppf([0.025, 0.975], having + 1, worlds - having + 1)
    assert np.allclose(ends(share_interval(values, np.arange(worlds))), expected, atol=0.002)


def test_the_interval_of_a_share_is_that_of_the_beta_binomial_model():
    """Its posterior by brute force, from scipy's distribution of the runs of each world."""
    having, runs = np.array([0, 3, 4, 1, 5, 2]), np.array([3, 4, 6, 2, 5, 9])
    mean, deviation = np.meshgrid((np.arange(300) + 0.5) / 300, (np.arange(60) + 0.5) / 60, indexing="ij")
    correlation = deviation**2
    a, b = mean * (1 / correlation - 1), (1 - mean) * (1 / correlation - 1)
    likelihood = np.prod([stats.betabinom.pmf(k, n, a, b) for k, n in zip(having, runs, strict=True)], axis=0)
    probability = likelihood.sum(axis=1).cumsum() / likelihood.sum()
    expected = np.interp([0.025, 0.975], probability, (np.arange(300) + 1) / 300)
    assert np.allclose(ends(share_interval(*of_counts(having, runs))), expected, atol=0.004)


@settings(max_examples=30)
@given(st.lists(st.integers(0, 4), min_size=MIN_WORLDS, max_size=12))
def test_a_share_and_its_complement_are_mirrored(having):
    values, worlds = of_counts(having, [4] * len(having))
    interval, mirrored = share_interval(values, worlds), share_interval(1 - values, worlds)
    assert np.allclose(ends(interval), [1 - mirrored.high, 1 - mirrored.low], atol=1e-9)
    assert 0 <= interval.low <= interval.value <= interval.high <= 1
    assert interval.low < interval.high
    twice = share_difference_interval(values, 1 - values, worlds)
    assert -1 <= twice.low <= twice.value <= twice.high <= 1
    other = share_difference_interval(1 - values, values, worlds)
    assert np.allclose(ends(twice), [-other.high, -other.low])


def test_a_share_of_all_runs_is_not_certain():
    """Also where every run of twelve worlds arrives."""
    interval = share_interval(*of_counts([9] * 12, [9] * 12))
    assert interval.value == interval.high == 1
    assert 0.8 < interval.low < 0.86
    difference = share_difference_interval(np.ones(108), np.zeros(108), np.repeat(np.arange(12), 9))
    assert difference.value == difference.high == 1
    assert difference.low < 0.8


def test_runs_that_are_alike_in_each_world_count_as_one():
    """More of them say hardly more."""
    having = np.array([1, 0, 1, 1, 0, 1, 0, 1, 1, 1])
    once, often = (share_interval(*of_counts(n * having, [n] * 10)) for n in (1, 50))
    assert 0.85 < (often.high - often.low) / (once.high - once.low) < 1.15


@pytest.mark.parametrize("runs", [1, 5])
def test_the_interval_of_a_mean_is_students(runs):
    """With equally many runs in each world it is that of the means of the worlds."""
    values = np.random.default_rng(0).normal(3, 1, (8, runs))
    expected = stats.t.interval(CONFIDENCE, 7, values.mean(), stats.sem(values.mean(axis=1)))
    assert np.allclose(ends(mean_interval(values.ravel(), np.repeat(np.arange(8), runs))), expected)


def test_the_interval_of_a_positive_mean_has_the_same_relative_width_to_both_sides():
    values = np.random.default_rng(0).gamma(2, 0.1, 12)
    plain, interval = (each(values, np.arange(12)) for each in (mean_interval, positive_interval))
    assert interval.value == plain.value
    assert np.isclose(interval.high / interval.value, interval.value / interval.low)
    assert np.isclose(np.log(interval.high / interval.value), plain.high / plain.value - 1)


def test_the_scale_of_values_does_not_matter():
    values, worlds = np.random.default_rng(1).gamma(2, 1, 40), np.arange(40) % 8
    for find in (mean_interval, positive_interval):
        assert np.allclose(ends(find(100 * values, worlds)), 100 * np.array(ends(find(values, worlds))))


@pytest.mark.parametrize("find", [share_interval, mean_interval, positive_interval])
def test_what_is_undetermined_is_nan(find):
    few = find(np.array([0.0, 1.0] * 20), np.arange(40) % (MIN_WORLDS - 1))
    assert few.value == 0.5
    assert np.isnan(ends(few)).all()
    assert np.isnan(
        [find(np.array([]), np.array([], dtype=int)).value, *ends(find(np.ones(1), np.zeros(1, int)))]
    ).all()


def test_means_that_do_not_differ_between_worlds_have_no_interval():
    """How much other worlds would differ is then unknown."""
    for find in (mean_interval, positive_interval):
        assert np.isnan(ends(find(np.array([0.1, 0.7] * 6), np.repeat(np.arange(6), 2)))).all()


def test_many_worlds_need_little_memory():
    tracemalloc.start()
    for find in (share_interval, mean_interval, positive_interval, sign_flip_p):
        find(np.ones(30_000), np.arange(30_000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2**25


# Tests


def test_the_p_value_is_that_of_all_exchanges():
    """By brute force, over exchanges of the two in each world; runs in a world are exchanged together."""
    differences, worlds = np.array([0.3, 0.1, -0.2, 0.5, 0.4, 0.2, 0.1]), np.array([0, 0, 1, 2, 3, 4, 4])
    totals = [abs(np.sum(differences * np.array(signs)[worlds])) for signs in product((1, -1), repeat=5)]
    expected = np.mean(np.array(totals) >= abs(differences.sum()) - 1e-9)
    assert sign_flip_p(differences, worlds) == sign_flip_p(-differences, worlds) == expected


def test_the_p_value_is_that_of_scipy():
    differences = np.random.default_rng(2).normal(0.4, 1, 12)
    test = stats.permutation_test((differences,), np.mean, permutation_type="samples", n_resamples=np.inf)
    assert np.isclose(sign_flip_p(differences, np.arange(12)), test.pvalue)


@pytest.mark.parametrize("worlds", [14, 90, 101, 2000])
def test_the_p_value_of_many_worlds_is_nearly_that_of_a_t_test(worlds):
    differences = np.random.default_rng(worlds).normal(0.15, 1, worlds)
    expected = stats.ttest_1samp(differences, 0).pvalue
    assert np.isclose(sign_flip_p(differences, np.arange(worlds)), expected, rtol=0.2, atol=0.01)


def test_models_that_do_the_same_do_not_differ():
    for worlds in (6, 50, 500):
        assert sign_flip_p(np.zeros(worlds), np.arange(worlds)) == 1
    assert np.isnan(sign_flip_p(np.ones(40), np.arange(40) % 4))  # too few worlds


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.5]) == [1, 1]
    assert holm([]) == []
    assert np.allclose(holm([float("nan"), 0.01]), [np.nan, 0.01], equal_nan=True)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20), st.floats(0.001, 0.2))
def test_holm_rejects_what_its_steps_reject(p_values, level):
    """Step by step, as the paper has it: the least p value against level / n, the next against level / (n - 1), until one is larger."""
    rejected, order = set(), np.argsort(p_values, kind="stable").tolist()
    for place, k in enumerate(order):
        if p_values[k] * (len(order) - place) > level:
            break
        rejected.add(k)
    assert {k for k, p in enumerate(holm(p_values)) if p <= level} == rejected


# How often they are right


# Worlds differ in difficulty: the runs of each have a share of their own, drawn from a beta distribution, and what is asked is its mean.
# Shares "near 0.05" are drawn from 0.02 to 0.08, since with so few runs the coverage of a single share jumps from one to the next.


@dataclasses.dataclass(frozen=True)
class Case:
    """A simulation of shares: near what, the correlation of the runs in one world, the number of worlds, and of runs in each."""

    share: float
    correlation: float
    worlds: int
    runs: int


def coverage_of_share(case: Case, repeats: int) -> float:
    """How often (%) the interval contains the mean share of all worlds."""

    @cache
    def ends_of(*having):  # the order of worlds does not matter
        return ends(share_interval(*of_counts(having, [case.runs] * case.worlds)))

    rng, inside = np.random.default_rng(0), 0
    for share in rng.uniform(case.share - 0.03, case.share + 0.03, repeats):
        total = 1 / case.correlation - 1
        having = rng.binomial(case.runs, rng.beta(share * total, (1 - share) * total, case.worlds))
        low, high = ends_of(*sorted(having.tolist()))
        inside += low <= share <= high
    return 100 * inside / repeats


def coverage_of_mean(find, draw, worlds, repeats=1500) -> float:
    """How often (%) the interval of worlds' means contains 1, the mean that they are drawn with."""
    rng, number = np.random.default_rng(0), np.arange(worlds)
    intervals = [find(draw(rng, worlds), number) for _ in range(repeats)]
    return 100 * float(np.mean([each.low <= 1 <= each.high for each in intervals]))


def coverage_of_difference(one: Case, other: Case, repeats: int) -> float:
    """How often (%) the interval contains the difference of two mean shares, where the same worlds are difficult for both."""
    rng, inside, worlds = np.random.default_rng(0), 0, np.repeat(np.arange(one.worlds), one.runs)
    for _ in range(repeats):
        difficulty = stats.norm.cdf(rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], one.worlds)).T
        values = []
        for case, quantile in zip((one, other), difficulty, strict=True):
            total = 1 / case.correlation - 1
            shares = stats.beta.ppf(quantile, case.share * total, (1 - case.share) * total)
            values.append((rng.random((case.worlds, case.runs)) < shares[:, None]).ravel().astype(float))
        interval = share_difference_interval(*values, worlds)
        inside += interval.low <= one.share - other.share <= interval.high
    return 100 * inside / repeats


GRID = [
    Case(share, correlation, worlds, runs)
    for runs in (4, 9)
    for worlds in (5, 10, 20)
    for correlation in (0.05, 0.15, 0.4)
    for share in (0.05, 0.5, 0.95)
]


@pytest.mark.parametrize(
    "case",
    [
        Case(0.05, 0.15, 5, 4),
        Case(0.5, 0.4, 5, 4),
        Case(0.95, 0.15, 5, 4),
        Case(0.05, 0.15, 10, 4),
        Case(0.95, 0.15, 20, 4),
    ],
    ids=str,
)
def test_the_interval_of_a_share_contains_it_as_often_as_stated(case):
    assert 93 <= coverage_of_share(case, 3000) <= 97


@pytest.mark.slow
def test_the_interval_of_a_share_contains_it_as_often_as_stated_in_the_whole_grid():
    """Up to cases with five worlds that hardly differ, or differ very much, which no interval can know from five worlds."""
    covered = {case: coverage_of_share(case, 1500) for case in GRID}
    assert 94 < np.mean(list(covered.values())) < 96
    assert np.mean([93 <= each <= 97 for each in covered.values()]) > 0.85
    assert all(91.5 < each < 99 for each in covered.values()), covered


@pytest.mark.parametrize("worlds", [5, 10, 20])
@pytest.mark.parametrize(
    ("shape", "least"), [(11, 93), (4, 93), (1, 92)]
)  # of gamma distributions; 1 is the exponential
def test_the_interval_of_a_positive_mean_contains_it_as_often_as_stated(shape, least, worlds):
    assert least <= coverage_of_mean(positive_interval, lambda rng, n: rng.gamma(shape, 1 / shape, n), worlds) <= 97


@pytest.mark.parametrize("worlds", [5, 10, 20])
def test_the_interval_of_a_mean_difference_contains_it_as_often_as_stated(worlds):
    def draw(rng, n):
        return 1 + rng.gamma(1, 1, n) - rng.gamma(4, 0.25, n)

    assert 92 <= coverage_of_mean(mean_interval, draw, worlds) <= 97


@pytest.mark.parametrize("worlds", [6, 12])
def test_models_that_are_alike_differ_as_rarely_as_stated(worlds):
    """The p value is at most 0.05 in at most 5 % of comparisons, however skewed the distributions are."""
    rng, number = np.random.default_rng(0), np.repeat(np.arange(worlds), 3)
    p_values = []
    for _ in range(1500):
        ease = rng.gamma(1, 1, worlds)[number]
        p_values.append(sign_flip_p(ease * (rng.gamma(1, 1, len(ease)) - rng.gamma(1, 1, len(ease))), number))
    assert 0.02 < np.mean(np.array(p_values) <= 0.05) < 0.06
