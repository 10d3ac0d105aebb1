"""stone2017: home vectors by noisy senses against their law, and the command with its page."""

import json

import numpy as np
import pytest

from tussock.navigation.cli.main import main
from tussock.navigation.sense_models import as_senses
from tussock.navigation.senses import Senses
from tussock.navigation.studies.outbound_paths import random_flights
from tussock.navigation.studies.protocols import STONE2017
from tussock.navigation.studies.protocols import stone2017 as module
from tussock.navigation.studies.sensed_paths import errors_of_senses

STEPS = np.array([10, 100])
STRAIGHT = np.full((2000, 100), 0.7)


def errors(headings=STRAIGHT, step=0.5, **senses):
    return errors_of_senses(Senses(**senses), headings, step, STEPS, np.random.default_rng(0))


def test_ideal_senses_make_no_error():
    ways = random_flights(5, 100, np.random.default_rng(1)).heading
    exact = errors(ways)
    assert exact.distance.max() < 1e-9
    assert (exact.path_length == [5.0, 50.0]).all()
    assert (exact.end_distance <= exact.path_length + 1e-9).all()


def test_odometer_noise_grows_with_the_root_of_a_straight_way():
    noisy = errors(odometry=0.2)
    assert np.sqrt((noisy.distance**2).mean(axis=0)) == pytest.approx(0.2 * np.sqrt([5.0, 50.0]), rel=0.05)
    assert np.abs(noisy.angle).max() < 1e-9  # before it is negative, which is 50 standard deviations away


def test_compass_noise_shortens_the_vector_and_averages_out_to_the_side():
    deviation, seconds = 0.5, 0.5 / 0.25
    noisy = errors(compass=deviation, speed=0.25)
    variance = deviation**2 * seconds
    shorter = 50 * (1 - np.exp(-variance / 2))
    assert np.median(noisy.distance[:, 1]) == pytest.approx(shorter, rel=0.1)
    angles = np.sqrt((noisy.angle**2).mean(axis=0))
    assert angles[1] < 0.5 * angles[0]


def test_drift_adds_up():
    noisy = errors(compass_drift=0.05, speed=0.5)
    angles = np.sqrt((noisy.angle**2).mean(axis=0))
    # of a random walk of n equal steps, the direction of the sum varies as a third of the last heading
    assert angles[1] == pytest.approx(0.05 * np.sqrt(100 / 3), rel=0.1)
    assert angles[1] > 2 * angles[0]


def test_published_senses_are_ordered_by_their_noise():
    ways = random_flights(100, 100, np.random.default_rng(1)).heading
    medians = [
        np.median(errors_of_senses(as_senses(name).make(), ways, 1.0, STEPS, np.random.default_rng(2)).distance[:, 1])
        for name in ("ideal", "svo-gtsam", "robot", "ant")
    ]
    assert medians == sorted(medians)
    assert medians[0] < 1e-9


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(module, "QUICK_PATHS", 12)
    monkeypatch.setattr(module, "STEPS", (50, 200))
    monkeypatch.setattr(module, "QUICK_HOME_STEPS", 200)


def test_errors_are_those_of_the_flights_and_the_same_seed_gives_the_same(small):
    results, again = (STONE2017.measure(3, True, lambda done, total: None) for _ in range(2))
    assert results.to_json() == again.to_json()
    assert results.to_json() != STONE2017.measure(4, True, lambda done, total: None).to_json()
    table = results.tables["errors"]
    assert list(table["steps out"]) == [50, 200] * 3
    assert (table["low quartile"] <= table["error / end distance"]).all()
    assert (table["error / end distance"] <= table["high quartile"]).all()
    assert (table["path length"] >= table["end distance"]).all()
    assert set(results.tables["senses"]["senses"]) == {
        "ideal", "robot", "svo-gtsam", "stankiewicz-webb", "ant", "bee",
    }  # fmt: skip
    worse = table[table["noise"] == 0.3]["error"].to_numpy() > table[table["noise"] == 0.1]["error"].to_numpy()
    assert worse.all()


def test_claims_can_fail(small):
    results = STONE2017.measure(0, True, lambda done, total: None)
    errors, homing = results.tables["errors"], results.tables["homing"]
    good = {"error / end distance": 0.01, "error": errors["noise"] + 1.0}
    results.tables["errors"] = errors.assign(**good)
    results.tables["homing"] = homing.assign(**{"came within 20 units": 1.0, "distance in the search": 5.0})
    assert [claim.decide(results).holds for claim in STONE2017.claims] == [True] * 4
    results.tables["errors"] = errors.assign(**{"error / end distance": 0.2, "error": 1.0})
    results.tables["homing"] = homing.assign(**{"came within 20 units": 0.9, "distance in the search": 30.0})
    assert [claim.decide(results).holds for claim in STONE2017.claims] == [False] * 4


def test_command_writes_its_page(small, tmp_path, capsys):
    main(["replicate", "stone2017", "--quick", "--out", str(tmp_path), "--json"])
    assert set(json.loads(capsys.readouterr().out)["claims"]) == {claim.key for claim in STONE2017.claims}
    page = (tmp_path / "report.html").read_text()
    assert {item.name for item in STONE2017.items} <= {text.partition('"')[0] for text in page.split('id="')}
    assert "tussock replicate stone2017 --quick" in page
