"""The test bed: what its name stands for never changes, results repeat to the byte, and all ways to enter give the same."""

import dataclasses
import json
import math
import re
import shutil
from pathlib import Path

import attrs
import cv2
import numpy as np
import pytest
import torch
from commands import printed, tussock
from figure_laws import SAVE_FIGURE, not_drawn

from tussock.navigation.benchmark.definition import (
    BASE,
    BENCHMARK,
    BENCHMARKS,
    OF_ENTRY,
    QUICK,
    Benchmark,
    Condition,
    benchmark_of,
)
from tussock.navigation.benchmark.leaderboard import leaderboard, read_results
from tussock.navigation.benchmark.learners import enter_learner, tasks
from tussock.navigation.benchmark.models import enter, enter_named
from tussock.navigation.benchmark.results import Line, Result, interval_over_worlds, read_result, score
from tussock.navigation.cli.benchmark import BenchmarkCommand
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_keys import ROUTE_SETTINGS
from tussock.navigation.experiment_settings import TYPES, experiment_of, settings_of
from tussock.navigation.models import PerfectMemory, make_model
from tussock.navigation.scan import best_turn, scan_window
from tussock.navigation.sweeps.work import draw, learn, walk
from tussock.render.eye import Eye
from tussock.world.errors import InputError, SettingError

ROOT = Path(__file__).parents[1]
MEASURED, PAGE = ROOT / "docs" / "benchmark", ROOT / "docs" / "benchmark.md"

# Takes the place of the test bed: one tiny world.
TINY = Benchmark(
    name="tiny-1", worlds=(("tiny", 3),), noises_deg=(0.0, 20.0), displacements=(-0.1, 0.2),
    base=BASE.replace(eye=Eye(width=60, height=16, samples=1), training__spacing=0.1),
)  # fmt: skip
DIGESTS = {
    "tussock-2": "71c2f5d9b5c3f8504a8a885bacb00cdd88cd308d88832c1fb1288d99e0823757",
    "tussock-2-quick": "ad70ca16e4ff30954f4428cbdf4f993e16f8b7c8eae10edd59f8c47696666f72",
    "tussock-3": "4ff0abe6c54c06b3352f421a0f40744db30d6503c34c7402de73378b2c625af5",
    "tussock-3-quick": "7dcb05ed8e5b60a9ba204afe49628217ab3216514e646c960de7ccbbfde324dd",
}


@pytest.fixture(scope="module")
def entered(tmp_path_factory, cluster) -> tuple[Result, Path]:
    """Perfect memory, as the command enters it."""
    return enter_named(["perfect-memory"], tmp_path_factory.mktemp("entered"), benchmark=TINY, workers=cluster)[0]


def line(
    world: str = "tiny",
    seed: int = 0,
    noise: float = 0.0,
    offset: float = 0.0,
    deviation: float = 0.1,
    *,
    arrived: bool = True,
) -> Line:
    """A run that arrived, or one that was lost."""
    return Line(
        world=world, seed=seed, heading_noise_deg=noise, offset_m=offset, arrived=arrived, reason="arrived" if arrived else "lost",
        steps=9, mean_deviation_m=deviation, max_deviation_m=deviation, poor_steps=0, cause=None if arrived else "aliasing",
    )  # fmt: skip


def made_up(entry: str, *lines: Line, **more) -> Result:
    fields = {
        "benchmark": "made-up-1",
        "encoding": "foreground-mask",
        "tussock": "0",
        "processor": "made-up",
        "memory_bytes": 1_500_000,
        "times": {},
    }
    return Result(**{**fields, "entry": entry, "runs": list(lines), **more})


# What it asks


def test_nothing_in_it_changes_unnoticed(monkeypatch):
    """A change in what is asked takes a new name; the digest of the old name is never adapted."""
    opened, generate = {}, Experiment.open_world_and_route

    def open_once(run):  # the worlds of one are among those of the other
        key = run.world, run.seed, run.light, run.route_length
        return opened[key] if key in opened else opened.setdefault(key, generate(run))

    monkeypatch.setattr(Experiment, "open_world_and_route", open_once)
    assert {name: each.digest() for name, each in BENCHMARKS.items()} == DIGESTS
    assert len(opened) == 9


def test_the_digest_depends_on_worlds_noises_and_displacements():
    changes = [
        {"worlds": (("tiny", 4),)},
        {"noises_deg": (0.0, 21.0)},
        {"displacements": (-0.1, 0.1)},
        {"worlds": (("tiny grass_density=15", 3),)},
    ]
    digests = {dataclasses.replace(TINY, **change).digest() for change in [{}, *changes]}
    assert len(digests) == 1 + len(changes)


def test_the_digest_depends_on_every_setting_of_a_run(tmp_path):
    """So it changes with a default of the experiment that it relies on."""
    cv2.imwrite(str(tmp_path / "mask.png"), np.eye(2, dtype=np.uint8) * 255)
    changes = {
        "size": "60x12", "renderer": "auto", "samples": 2, "eye_height_m": 0.02, "top_deg": 50.0, "bottom_deg": -20.0, "resize": 2.0,
        "blur": 1.0, "spacing_m": 0.2, "every": 2, "learning_walk_m": 0.0, "parallel_views": 3, "device": "cpu:0", "threads": None,
        "step_m": 0.1, "scan_deg": 90.0, "scan_about_deg": 10.0, "on_lost": "reset", "waypoint_m": 0.2, "put_back_ahead_m": 0.3,
        "arrive_m": 0.2, "lost_m": 0.6, "patience_m": 2.0, "max_steps": 9, "field_deg": 270.0,
        "side": "left", "overlap_deg": 20.0, "eye": "ant", "spectrum": "insect", "mask": str(tmp_path / "mask.png"),
        "goal_walk_m": 1.0, "goal_views": 9, "goal_turns": 3.0, "goal_spread_deg": 20.0, "collisions": "slide", "body_radius_m": 0.01,
        "senses": "ant", "release_deg": 30.0, "displace_at": 0.4, "displace_m": 0.3,
        "test_change": "removed amount=0.2", "change_seed": 5,
        "gaze": "body", "body_length_m": 0.02, "pitch_noise_deg": 3.0, "roll_noise_deg": 3.0,
    }  # fmt: skip
    assert set(changes) == set(TYPES) - set(OF_ENTRY) - set(ROUTE_SETTINGS) - {
        "goal_only",
        "release_m",
    }  # which need others
    base = settings_of(TINY.base)
    digests = {
        dataclasses.replace(TINY, base=experiment_of(base | {name: value})).digest() for name, value in changes.items()
    }
    path = [{"world_seed": 5}, {"route_seed": 5}, {"route_length_m": 2.0}, {"cull_back_faces": True}]
    digests |= {dataclasses.replace(TINY, base=experiment_of(base | change)).digest() for change in path}
    assert len(digests | {TINY.digest()}) == len(changes) + len(path) + 1


def test_its_runs_are_all_combinations():
    assert BENCHMARK.name == "tussock-2"
    runs = BENCHMARK.sweep("random").experiments
    different = {(run.world, run.seed, run.body.heading_noise, run.start_offset) for run in runs}
    assert len(different) == len(runs) == len(BENCHMARK)
    assert {run.world for run in runs} == {"tussock-field", "meadow", "scrub"}
    assert {round(math.degrees(run.body.heading_noise)) for run in runs} == {0, 20, 40}
    assert all(run.seed >= 1000 for run in runs)
    assert len(QUICK) < len(BENCHMARK) / 5


def test_conditions_are_asked_in_each_world_from_each_displacement():
    benchmark = BENCHMARKS["tussock-3"]
    asked, runs = benchmark.asked(), benchmark.sweep("random").experiments
    assert len(asked) == len(set(asked)) == len(runs) == len(benchmark)
    names = [each.name for each in benchmark.conditions]
    for name in names:
        mine = [run for what, run in zip(asked, runs, strict=True) if what.condition == name]
        assert len(mine) == len(benchmark.worlds) * len(benchmark.displacements)
        assert {round(math.degrees(run.body.heading_noise)) for run in mine} == {20}
    for what, run in zip(asked, runs, strict=True):
        assert (what.world, what.seed, what.offset_m) == (run.world, run.seed, run.start_offset)
        assert (run.test_change is None) == (what.condition in ("", "hills", "296 degrees", "ant's eye"))
    assert [len(group) for group in benchmark.by_world()] == [9] * 6 + [3] * 6 * len(names)
    with pytest.raises(SettingError, match="did you mean 'tussock-3'"):
        benchmark_of("tusock-3")


def test_a_result_says_what_an_entry_survives(tmp_path, cluster):
    """Without plants, a memory of skylines does not arrive; with all of them, and under clouds, it does."""
    conditions = (
        Condition(name="bare", changes={"test_change": "removed amount=1"}, noise_deg=0.0),
        Condition(name="cloudy", changes={"test_change": "clouds amount=1"}, noise_deg=0.0),
    )
    benchmark = dataclasses.replace(TINY, name="tiny-2", conditions=conditions, base=TINY.base.replace(light="sun"))
    ((result, path),) = enter_named(["perfect-memory"], tmp_path, benchmark=benchmark, workers=cluster)
    assert all(run.error is None for run in result.runs)
    scores = result.scores()["by_condition"]
    assert {name: score["runs"] for name, score in scores.items()} == {"": 4, "bare": 2, "cloudy": 2}
    assert scores["bare"]["arrived"] < scores["cloudy"]["arrived"] == 2
    assert [run.condition for run in read_result(path).runs] == [""] * 4 + ["bare"] * 2 + ["cloudy"] * 2
    header = leaderboard([result]).splitlines()[0]
    assert "| bare | cloudy |" in header
    with pytest.raises(SettingError, match="changes worlds after learning"):
        next(tasks(benchmark))
    with pytest.raises(SettingError, match="changes worlds after learning"):
        enter_learner(lambda env: None, "none", tmp_path / "policy", benchmark=benchmark)


# Results


def test_a_result_has_the_runs_and_what_follows_from_them(entered):
    result, path = entered
    content = json.loads(path.read_text())
    assert (path.parent.name, path.name) == ("results", "perfect-memory.json")
    assert (content["benchmark"], content["entry"]) == ("tiny-1", "perfect-memory")
    assert content["encoding"] == "foreground-mask | vertical-edges | normalise"
    assert content["memory_bytes"] > 0
    assert set(content["times"]) == {"learn_seconds", "walk_seconds"}
    asked = [(noise, offset) for noise in TINY.noises_deg for offset in TINY.displacements]
    assert [(run["heading_noise_deg"], run["offset_m"]) for run in content["runs"]] == asked
    arrived = [run["arrived"] for run in content["runs"]]
    assert content["totals"]["runs"] == 4
    assert content["totals"]["arrived"] == sum(arrived)
    assert content["by_noise_deg"]["20"]["arrived"] == sum(arrived[2:])
    assert content["by_displacement_m"]["-0.1"]["arrived"] == arrived[0] + arrived[2]
    assert list(content["by_preset"]) == ["tiny"]
    assert read_result(path, {TINY.name: TINY}) == result


def test_a_second_time_gives_the_same_bytes_but_for_the_times(entered, tmp_path):
    def without_times(path):
        return re.sub(r'"times": \{[^}]*\}', "", path.read_text())

    ((_, again),) = enter_named(["perfect-memory"], tmp_path, benchmark=TINY, workers=1)  # in a process of its own
    assert without_times(again) == without_times(entered[1])
    before = again.read_bytes()
    enter_named(["perfect-memory "], tmp_path, benchmark=TINY)  # every run is kept: nothing is left to do
    assert again.read_bytes() == before


def test_a_model_from_python_gets_what_the_command_gives_it(entered, tmp_path):
    class Foreign:
        """Not one of the project's classes: it only has the methods of a model."""

        def __init__(self, seed):
            assert seed == 3

        def fit(self, views):
            self.memory = PerfectMemory().fit(views)
            return self

        def scan(self, views):
            return self.memory.scan(views)

    named, _ = entered
    foreign, path = enter(Foreign, "my memory", tmp_path, benchmark=TINY)
    assert path.name == "my-memory.json"
    assert foreign.memory_bytes is None
    assert list(foreign.runs) == list(named.runs)
    own, _ = enter(lambda seed: make_model("perfect-memory", seed=seed), "own", tmp_path, benchmark=TINY)
    assert own.memory_bytes == named.memory_bytes
    assert own.scores() == named.scores()


def test_a_learner_gets_what_the_command_gives_it(entered, tmp_path):
    """The same model acts in the environment: the same starts and, for the runs that have some, the same noise."""
    looks = []

    def learned(env):
        views, _ = env.training_views(learning_walk=0.2, spacing=0.1)
        memory = PerfectMemory().fit(torch.from_numpy(views))

        def act(observation, look):
            looks.append(look)
            familiarity = memory.scan(torch.from_numpy(observation)[None]).numpy()
            return np.array([best_turn(familiarity, scan_window(60, np.pi))[0] / np.pi, 1.0])

        return act

    named, _ = entered
    learner, _ = enter_learner(learned, "learner", tmp_path, benchmark=TINY)
    assert looks.count(0) == len(TINY)
    assert len({run.steps for run in named.runs}) > 1
    for run, other in zip(named.runs, learner.runs, strict=True):
        deviations = {name: getattr(run, name) for name in ("mean_deviation_m", "max_deviation_m")}
        for name, value in deviations.items():  # a turn comes as a share of half a turn, which rounds it
            assert np.isclose(value, getattr(other, name), rtol=0, atol=1e-9)
        assert attrs.evolve(other, **deviations) == attrs.evolve(run, poor_steps=None, cause=None)
    assert learner.encoding == named.encoding
    assert learner.scores()["totals"]["poor_steps"] is None


def test_a_learner_may_see_the_panorama(tmp_path):
    def learned(env):
        assert env.observation_space.shape == (16, 60, 3)
        return lambda observation, look: np.array([0.0, 1.0])

    result, path = enter_learner(learned, "ahead", tmp_path, encoding=None, benchmark=TINY)
    assert path.name == "ahead-panorama.json"
    assert result.encoding == "panorama"
    assert len({id(task.settings) for task in tasks(TINY)}) == 2


def test_runs_that_cannot_be_done_have_not_arrived(tmp_path, cluster):
    ((result, _),) = enter_named(["infomax rate=1e6"], tmp_path, benchmark=TINY, workers=cluster)
    totals = result.scores()["totals"]
    assert (totals["arrived"], totals["could_not_run"], totals["mean_deviation_m"]) == (0, 4, None)
    assert "rate" in (result.runs[0].error or "")
    assert result.memory_bytes is None


def test_shares_are_of_all_runs_and_deviations_of_those_that_arrived():
    lines = [line(deviation=0.1), line(deviation=0.3), line(deviation=5.0, arrived=False), line(deviation=0.2)]
    assert score(lines) == {"runs": 4, "arrived": 3, "arrived_share": 0.75, "mean_deviation_m": pytest.approx(0.2)}
    totals = made_up("it", *lines).scores()["totals"]
    assert (totals["reasons"], totals["causes"]) == ({"lost": 1}, {"aliasing": 1})


def test_the_interval_is_over_worlds_and_not_over_runs():
    def over(count, arrives):
        low, high = interval_over_worlds(
            [
                line(seed=seed, offset=offset, arrived=arrives(seed, offset))
                for seed in range(count)
                for offset in (0.1, -0.1)
            ]
        )
        return low, high

    low, high = over(100, lambda seed, offset: seed % 2 == 0)
    # of a hundred worlds, as a binomial's normal approximation has it; 200 independent runs would give 0.43 and 0.57
    assert low == pytest.approx(0.5 - 1.96 * 0.05, abs=0.015)
    assert high == pytest.approx(0.5 + 1.96 * 0.05, abs=0.015)
    closer, nearer = over(100, lambda seed, offset: offset > 0)  # every world has the same share
    assert nearer - closer < 0.75 * (high - low)


def test_there_is_no_interval_of_few_worlds(tmp_path):
    lines = [line(seed=seed, offset=offset) for seed in range(4) for offset in (0.1, -0.1)]
    result = made_up("it", *lines, encoding="panorama")
    assert result.scores()["totals"]["arrived_share_95"] is None
    (tmp_path / "it.json").write_text(result.to_json())
    assert read_result(tmp_path / "it.json") == result
    assert "| no interval |" in leaderboard([result])


# What is refused


def test_results_of_another_version_are_not_replaced(entered, tmp_path):
    (tmp_path / "results").mkdir()
    path = Path(shutil.copy(entered[1], tmp_path / "results"))
    before = path.read_bytes()
    for other in (dataclasses.replace(TINY, name="tiny-2"), dataclasses.replace(TINY, name="tiny-1-quick")):
        with pytest.raises(InputError, match=r"holds a result of tiny-1 .+ give another --out"):
            enter_named(["perfect-memory"], tmp_path, benchmark=other)
        with pytest.raises(InputError, match="holds a result of tiny-1 "):
            enter(lambda seed: make_model("random", seed=seed), "Perfect memory", tmp_path, benchmark=other)
    with pytest.raises(InputError, match="Perfect memory"):  # another entry, whose file would have this name
        enter(lambda seed: make_model("random", seed=seed), "Perfect memory", tmp_path, benchmark=TINY)
    assert path.read_bytes() == before


def test_results_that_do_not_compare_are_refused_before_the_first_run(tmp_path, monkeypatch):
    def run_none(*given, **settings):
        raise AssertionError("a run has begun")

    monkeypatch.setattr("tussock.navigation.benchmark.models.run_sweep", run_none)
    monkeypatch.setattr("tussock.navigation.experiment.Experiment.open_world_and_route", run_none)
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "it.json").write_text(made_up("it", line()).to_json())
    refusal = r"it\.json holds a result of made-up-1 .+ this would be one of tussock-2.+; give another --out"
    for quick in (False, True):
        with pytest.raises(InputError, match=refusal):
            BenchmarkCommand(model="random", out=tmp_path, quick=quick).run()
    with pytest.raises(InputError, match="one of tiny-1"):
        enter(lambda seed: make_model("random", seed=seed), "other", tmp_path, benchmark=TINY)
    (tmp_path / "results" / "it.json").write_text("{}")
    with pytest.raises(InputError, match=r"it\.json is not a result"):
        enter(lambda seed: make_model("random", seed=seed), "other", tmp_path, benchmark=TINY)


def test_a_report_of_the_runs_and_any_name_of_an_entry_are_possible(capfd, entered, tmp_path, monkeypatch):
    monkeypatch.setattr(SAVE_FIGURE, not_drawn)
    out = shutil.copytree(entered[1].parents[1], tmp_path / "out")
    enter(lambda seed: make_model("random", seed=seed), "results", out, benchmark=TINY)
    assert printed(capfd, "report", out, "--worst", 0)["runs"] == len(TINY)
    assert (out / "report.json").exists()
    enter(lambda seed: make_model("random", seed=seed), "report", out, benchmark=TINY)
    names = ["perfect-memory", "report", "results"]
    assert [result.entry for result in read_results(out)] == names
    assert [result.entry for result in read_results(out / "results")] == names


def test_a_damaged_result_is_refused(entered, tmp_path):
    text, path = entered[1].read_text(), tmp_path / "bad.json"
    for bad in ("{}", "[1]", text[:-9]):
        path.write_text(bad)
        refuses(path, "is not a result of tussock benchmark")
    path.write_text(text.replace('"arrived": true', '"arrived": false', 1))
    refuses(path, "do not follow")
    with pytest.raises(InputError, match="not the 4 of tiny-1"):
        read_result(entered[1], {TINY.name: dataclasses.replace(TINY, noises_deg=(0.0, 10.0))})


HUGE = 10**400  # json reads it; a float cannot hold it


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"runs": []}, "no runs"),
        ({"runs": 3}, "is not a result"),
        ({"runs": [3]}, "is not a result"),
        ({"entry": 5}, "entry is 5"),
        ({"entry": "two\nlines"}, "entry is 'two.+nlines'"),
        ({"benchmark": None}, "benchmark is None"),
        ({"tussock": ["0"]}, "tussock is "),
        ({"memory_bytes": "x"}, "memory_bytes is 'x'"),
        ({"memory_bytes": True}, "memory_bytes is True"),
        ({"memory_bytes": HUGE}, "memory_bytes is 1000"),
        ({"times": {"learn_seconds": "long"}}, "'long'"),
        ({"times": None}, "is not a result"),
    ],
)
def test_wrong_types_in_a_result_are_refused(tmp_path, wrong, match):
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(json.loads(made_up("it", line()).to_json()) | wrong))
    refuses(path, match)


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"arrived": HUGE}, "arrived is 1000"),
        ({"arrived": 1}, "arrived is 1"),
        ({"mean_deviation_m": HUGE}, "mean_deviation_m is 1000"),
        ({"mean_deviation_m": float("inf")}, "mean_deviation_m is inf"),
        ({"mean_deviation_m": None}, "do not follow"),
        ({"seed": [1]}, "seed is "),
        ({"heading_noise_deg": "much"}, "heading_noise_deg is 'much'"),
        ({"world": 3}, "world is 3"),
        ({"poor_steps": "few"}, "poor_steps is 'few'"),
    ],
)
def test_wrong_types_in_a_run_are_refused(tmp_path, wrong, match):
    content = json.loads(made_up("it", line(), line(offset=0.1)).to_json())
    content["runs"][1] |= wrong
    (tmp_path / "bad.json").write_text(json.dumps(content))
    refuses(tmp_path / "bad.json", match)


def refuses(path, match):
    with pytest.raises(InputError, match=match) as refused:
        read_result(path)
    assert "\n" not in str(refused.value)
    assert str(path) in str(refused.value)


def test_a_folder_in_place_of_a_result_is_refused(tmp_path):
    (tmp_path / "bad.json").mkdir()
    refuses(tmp_path / "bad.json", "is not a result")


@pytest.mark.parametrize(
    ("flags", "match"),
    [
        ({}, "give --model"),
        ({"model": "random", "leaderboard": Path("x")}, "give --model"),
        ({"model": "telepathy"}, "unknown model"),
        ({"model": "memory.safetensors"}, r"memory\.safetensors.+tussock models"),
        ({"model": "random", "encoding": "colour"}, "unknown encoding"),
        ({"model": "random", "workers": 0}, "at least 1"),
        ({"leaderboard": Path("nowhere")}, "holds no results"),
    ],
)
def test_flags_that_make_no_sense_are_refused(tmp_path, flags, match):
    with pytest.raises(InputError, match=match):
        BenchmarkCommand(out=tmp_path / "out", **flags).run()
    assert not (tmp_path / "out").exists()


# The leaderboard


def test_the_best_are_first():
    half = [line(deviation=0.1), line(arrived=False)]
    entries = [
        made_up("worse", *[line(arrived=False)] * 2, memory_bytes=None),
        made_up("farther off", line(deviation=0.3), line(deviation=0.1)),
        made_up("half", *half),
        made_up("nearer", line(deviation=0.1), line(deviation=0.2)),
    ]
    table, against_next = leaderboard(entries).split("\n\n")
    rows = table.splitlines()
    assert rows[0] == "| entry | arrived | 95 % (2 runs, 1 world) | off the route | noise 0 | tiny | memory |"
    assert [row.split("`")[1] for row in rows[2:]] == ["nearer", "farther off", "half", "worse"]
    assert rows[2] == "| `nearer`, `foreground-mask` | 100 % | no interval | 15.0 cm | 100 % | 100 % | 1.5 MB |"
    assert rows[5] == "| `worse`, `foreground-mask` | 0 % | no interval |  | 0 % | 0 % |  |"
    each = [[cell.strip() for cell in row.split("|")[2:-1]] for row in against_next.splitlines()[2:]]
    name = "`{}`, `foreground-mask`".format
    assert each[1] == [name("half"), "50 %", "no interval", "1, 0", "–", ""]


def test_each_entry_is_tested_against_the_others():
    """Eight worlds, in which one entry always arrives and two never do: all exchanges but two give a smaller difference."""
    seeds = range(8)
    good = made_up("good", *[line(seed=seed) for seed in seeds])
    bad, worse = (made_up(name, *[line(seed=seed, arrived=False) for seed in seeds]) for name in ("bad", "worse"))
    *_, first, second = leaderboard([worse, good, bad]).splitlines()
    cells = [cell.strip() for cell in first.split("|")[1:-1]]
    assert cells[2:] == [
        "100 %",
        cells[3],
        "8, 0",
        f"{3 * 2 / 2**8:.2g}",
        "`bad`, `foreground-mask`, `worse`, `foreground-mask`",
    ]
    assert cells[3].endswith("to 100 %")
    assert [cell.strip() for cell in second.split("|")[3:-1]] == ["0 %", "-34 % to 34 %", "0, 0", "1", ""]


def test_results_of_two_versions_are_not_mixed(tmp_path):
    for name in ("one-1", "one-2"):
        (tmp_path / f"{name}.json").write_text(made_up("it", line(), benchmark=name).to_json())
    with pytest.raises(InputError, match="one-1 and one-2, which do not compare"):
        read_results(tmp_path)


def test_results_of_other_runs_under_one_name_are_not_mixed(tmp_path):
    for name, noise in (("one", 0.0), ("two", 20.0)):
        (tmp_path / f"{name}.json").write_text(made_up(name, line(noise=noise)).to_json())
    with pytest.raises(InputError, match="made-up-1 whose runs are not the same"):
        read_results(tmp_path)


def test_the_page_shows_the_table_of_the_results_in_its_folder():
    results = read_results(MEASURED)
    assert {result.benchmark for result in results} == {BENCHMARK.name}
    assert leaderboard(results) in PAGE.read_text()
    assert {"perfect-memory", "infomax", "mushroom-body", "visual-compass", "random"} <= {
        result.entry for result in results
    }


def test_the_command_prints_the_table(capfd):
    code, out, _ = tussock(capfd, "benchmark", "--leaderboard", MEASURED)
    assert code == 0
    assert out.strip() == leaderboard(read_results(MEASURED)).strip()


def test_the_command_enters_a_model(capfd, tmp_path, cluster, monkeypatch):
    monkeypatch.setattr("tussock.navigation.benchmark.definition.QUICK", TINY)
    result = printed(capfd, "benchmark", "--model", "random", "--quick", "--scheduler", cluster, "--out", tmp_path)
    assert result["results"] == [str(tmp_path / "results" / "random.json")]
    assert result["table"] == leaderboard(read_results(tmp_path))


@pytest.mark.slow
def test_a_measured_result_is_obtained_again():
    """To a centimetre: another processor may round differently, and a walk of 160 steps depends on that."""
    measured = read_result(MEASURED / "perfect-memory.json")
    run = next(BENCHMARK.by_world())[1]
    then = measured.runs[1]
    assert (run.world, run.seed, run.body.heading_noise, run.start_offset) == ("tussock-field", 1000, 0.0, 0.0)
    assert then.asked == ("", "tussock-field", 1000, 0.0, 0.0)
    trained = learn(run, draw(run, run.open_world_and_route()))
    with trained.renderer:
        now = walk([run], trained)[0].results
    assert now["arrived"] == then.arrived
    assert now["mean_deviation_m"] == pytest.approx(then.mean_deviation_m, abs=0.01)


def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tussock.navigation.benchmark.QUICK", TINY)
    examples = re.findall(r"```python\n(.+?)```", PAGE.read_text(), flags=re.DOTALL)
    names = set()
    for example in examples:
        here: dict = {}
        exec(example, here)
        names.add(here["path"].name)
    assert names == {"mean-view.json", "memory-in-the-environment.json"}
    assert len(read_results(tmp_path / "quick")) == 2
