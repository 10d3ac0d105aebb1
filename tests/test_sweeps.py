"""Sweeps: what a file asks for, the same table from any cluster, and nothing lost whatever is killed."""

import dataclasses
import io
import itertools
import json
import os
import re
import shlex
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import tracemalloc
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager, redirect_stdout
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
from browser import WIDTHS, in_browser
from commands import TUSSOCK, Process, printed, process_json, tussock
from figure_laws import SAVE_FIGURE, not_drawn
from PIL import Image
from scale import fill, sweep_file

from tussock.navigation.cli.main import main
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_keys import Keys, key_of, route_key, training_key, views_key
from tussock.navigation.experiment_settings import TYPES, experiment_of, settings_of
from tussock.navigation.failures import Diagnostics
from tussock.navigation.models import PerfectMemory
from tussock.navigation.models import files as model_files
from tussock.navigation.models.files import TrainedModel, save_model
from tussock.navigation.reports.report import Drawing
from tussock.navigation.sweeps.recordings import record_again
from tussock.navigation.sweeps.report import arrivals, write_sweep_report
from tussock.navigation.sweeps.spec import Sweep
from tussock.navigation.sweeps.store import TIMES, Finished, Store, read_steps, table_of
from tussock.navigation.sweeps.sweep import (
    MAX_SMALL_TOGETHER,
    MAX_TOGETHER,
    finished_run,
    run_sweep,
    side_by_side,
)
from tussock.navigation.sweeps.sweep_file import read_sweep
from tussock.navigation.sweeps.work import Walked, draw, learn, walk
from tussock.navigation.sweeps.worst import learned_pose, walk_section
from tussock.navigation.trajectory import Trajectory
from tussock.render.eye import Eye
from tussock.world.errors import InputError, SettingError

HEAD = '[fixed]\nworld = "tiny"\nsize = "60x12"\nspacing-m = 0.1\n'
SWEEP = HEAD + '[axes]\nmodel = ["perfect-memory", "infomax"]\nseed = { from = 0, to = 3 }\noffset-m = [-0.1, 0, 0.1]\n'
MANY = HEAD + "[axes]\nseed = { from = 0, to = 29 }\n"


def written(folder: Path, text: str, name: str = "sweep.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def table(out: Path) -> pd.DataFrame:
    """The table of a sweep, times aside."""
    return pd.read_parquet(out / "runs.parquet").drop(columns=list(TIMES))


@pytest.fixture(scope="module")
def swept(tmp_path_factory) -> Path:
    """The folder of a whole sweep, with workers that it started itself."""
    folder = tmp_path_factory.mktemp("swept")
    result = process_json("sweep", written(folder, SWEEP), "--out", folder / "out", "--record", "worst:1")
    assert (result["runs"], result["done_before"], result["could_not_run"]) == (24, 0, 0)
    return folder / "out"


@pytest.fixture(scope="module")
def reported(swept) -> dict:
    """What the command that reports the sweep prints."""
    output = io.StringIO()
    with redirect_stdout(output):
        main(["report", str(swept), "--json"])
    return json.loads(output.getvalue())


# Runs and their table


def test_the_table_has_one_row_per_run_in_the_order_of_the_settings(swept):
    rows = table(swept)
    assert len(rows) == len(set(rows["key"])) == 24
    assert rows["seed"].tolist() == sorted(rows["seed"])
    assert set(rows["model"]) == {"perfect-memory", "infomax"}
    assert rows["error"].isna().all()
    assert rows["arrived"].mean() > 0.5
    assert (rows["reason"] == "arrived").tolist() == rows["arrived"].tolist()


def test_every_column_of_the_table_is_explained(swept):
    pages = "".join(
        (Path(__file__).parents[1] / "docs" / f"{name}.md").read_text() for name in ("sweeps", "trajectory")
    )
    results = set(table(swept).columns) - set(TYPES)
    assert [name for name in results if not re.search(rf"^\| .*`{name}`.* \|", pages, re.MULTILINE)] == []


def test_the_command_of_a_row_repeats_its_run_alone(capfd, swept, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for row in table(swept).iloc[[0, -1]].to_dict("records"):
        _, *arguments = shlex.split(row["command"])
        alone = printed(capfd, *arguments)
        names = ("arrived", "steps", "mean_deviation_m", "mean_error_deg", "poor_steps")
        assert all(alone[name] == row[name] for name in names)
        with Store(swept, read_only=True) as store:
            assert Path(arguments[-1], "trajectory.csv").read_text() == store.steps(row["key"])


def test_the_worst_runs_are_recorded(swept):
    rows = table(swept)
    (recorded,) = rows[rows["recording"].notna()].to_dict("records")
    assert (swept / recorded["recording"]).is_file()
    worst = rows.sort_values(["arrived", "mean_deviation_m"], ascending=[True, False]).iloc[0]
    assert recorded["key"] == worst["key"]
    assert (
        recorded["recording"]
        == f"worst/{worst['model'].replace(' ', '-').replace('=', '-')}-{worst['key']}/recording.rrd"
    )


def test_a_second_time_nothing_is_done_and_new_choices_of_an_axis_are_added(capfd, swept, cluster, tmp_path):
    out = shutil.copytree(swept, tmp_path / "out")
    before = (out / "runs.parquet").read_bytes()
    again = ["--out", out, "--scheduler", cluster]
    assert printed(capfd, "sweep", written(tmp_path, SWEEP), *again)["done_before"] == 24
    assert (out / "runs.parquet").read_bytes() == before
    other = written(tmp_path, SWEEP.replace("[-0.1, 0, 0.1]", "[-0.1, 0, 0.15]"))
    result = printed(capfd, "sweep", other, *again)
    assert (result["runs"], result["done_before"]) == (24, 16)
    assert len(table(out)) == 32


def test_another_cluster_gives_the_same_table(capfd, swept, cluster, tmp_path):
    """The last digits too: the runs that tell the models, the seeds and the starts apart."""
    part = SWEEP.replace("to = 3", "to = 1").replace("[-0.1, 0, 0.1]", "[0, 0.1]")
    printed(capfd, "sweep", written(tmp_path, part), "--out", tmp_path / "out", "--scheduler", cluster)
    here = table(tmp_path / "out").drop(columns="recording")
    there = table(swept).drop(columns="recording")
    there = there[there["key"].isin(here["key"])].reset_index(drop=True)
    assert len(here) == 8
    pd.testing.assert_frame_equal(here, there, check_exact=True)


def test_a_run_that_cannot_be_done_is_a_row_with_the_reason(capfd, cluster, tmp_path):
    path = written(tmp_path, HEAD + "[axes]\noffset-m = [0, 40.0]\n")
    result = printed(capfd, "sweep", path, "--out", tmp_path / "out", "--scheduler", cluster)
    assert result["could_not_run"] == 1
    rows = table(tmp_path / "out").set_index("offset_m")
    assert "outside the world" in rows.loc[40.0, "error"]
    assert rows.loc[0.0, "arrived"]


def test_the_table_does_not_depend_on_the_order_in_which_runs_finish():
    rows = {
        str(k): {"seed": k % 5, "model": "ab"[k % 2], "route": None if k % 3 else "r", "error": None} for k in range(20)
    }
    shuffled = dict(np.random.default_rng(0).permutation(list(rows.items())).tolist())
    assert table_of(shuffled).equals(table_of(rows))


def test_the_table_does_not_depend_on_the_parts_in_which_rows_are_read(monkeypatch):
    """Where a whole part has no value, or only whole numbers of a column of numbers, and where runs have no results."""
    rows = {
        f"{k:02}": {"seed": k, "scale": None if k < 7 else k / 2, "unit": k if k < 9 else k / 2}
        | (
            {"arrived": k > 12, "steps": k, "cause": "corner" if k == 15 else None, "error": None}
            if k > 3
            else {"error": "no world"}
        )
        for k in range(20)
    }
    whole = table_of(rows)
    assert whole["steps"].dtype == "Int64"
    assert [whole[name].dtype for name in ("scale", "unit")] == ["float64"] * 2
    assert list(whole) == ["key", *rows["10"]]
    monkeypatch.setattr("tussock.navigation.sweeps.store.PART", 3)
    pd.testing.assert_frame_equal(table_of(dict(reversed(rows.items()))), whole)


def test_the_table_of_many_runs_takes_a_fraction_of_the_memory_of_their_rows(tmp_path, monkeypatch):
    monkeypatch.setattr("tussock.navigation.sweeps.store.PART", 100)
    with Store(tmp_path) as store:
        settings = settings_of(ALONE)
        store.add([kept(str(seed), settings | {"seed": seed}, mean_deviation_m=seed / 7) for seed in range(3000)])
        peaks = {}
        for read in (store.table, store.rows, store.table):
            tracemalloc.start()
            assert len(read()) == 3000
            peaks[read.__name__] = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
    assert peaks["table"] < peaks["rows"] / 4


def test_no_steps_are_read_to_find_out_which_runs_are_finished(tmp_path):
    with Store(tmp_path) as store:
        plans = []
        store._database.set_trace_callback(plans.append)
        store.finished()
        store._database.set_trace_callback(None)
        (query,) = plans
        steps = [row[3] for row in store._database.execute(f"EXPLAIN QUERY PLAN {query}")]
    scans = [step for step in steps if step.startswith(("SCAN", "SEARCH"))]
    assert len(scans) == 2
    assert all("INDEX" in scan for scan in scans)


# Runs that walk together

ALONE = Experiment(world="tiny", eye=Eye(width=60, height=12), model="random", threads=1)


def walked(runs: list[Experiment]) -> list[Walked | Exception]:
    """The results of runs that walk together."""
    drawn = draw(runs[0], runs[0].open_world_and_route())
    with drawn.renderer:
        return walk(runs, learn(runs[0], drawn))


def test_runs_that_walk_together_have_the_results_that_they_have_alone():
    changes = [
        {},
        {"start_offset": 0.1, "body__heading_noise": 0.3},
        {"body__step_length": 0.08, "stopping__max_steps": 7},
        {"body__heading_noise": 0.6, "stopping__put_back": True, "stopping__max_deviation": 0.2},
        {"stopping__arrival_radius": 0.4, "stopping__patience": 0.5},
    ]
    runs = [ALONE.replace(**change) for change in changes]
    assert len({training_key(run) for run in runs}) == 1
    together, alone = walked(runs), [walked([run])[0] for run in runs]
    assert [each.steps for each in together] == [each.steps for each in alone]
    assert [each.results for each in together] == [each.results for each in alone]
    assert len({each.steps for each in together}) == len(runs)


def test_a_sweep_may_keep_some_columns_of_the_steps(monkeypatch, tmp_path, cluster):
    """The numbers are those of all columns; what is wrong with poor steps is not looked for, as nothing would tell of it."""
    axes = {"start_offset": [0.0, 0.1], "body__heading_noise": [1.0]}
    sweep = Sweep.over("", ALONE, axes)
    run_sweep(sweep, tmp_path / "all", workers=cluster)
    monkeypatch.setattr(Diagnostics, "examine", None)
    run_sweep(dataclasses.replace(sweep, columns=("goal_m", "x_m")), tmp_path / "some", workers=cluster)
    whole, part = table(tmp_path / "all"), table(tmp_path / "some")
    for name in ("key", "steps", "mean_deviation_m", "goal_m", "reason"):
        assert whole[name].tolist() == part[name].tolist()
    assert (part["poor_steps"] == 0).all()
    assert (whole["poor_steps"] > 0).all()
    with Store(tmp_path / "all", read_only=True) as stored, Store(tmp_path / "some", read_only=True) as fewer:
        for key in whole["key"]:
            pd.testing.assert_frame_equal(
                read_steps(fewer.steps(key)), read_steps(stored.steps(key))[["goal_m", "x_m"]]
            )


def test_more_runs_walk_together_where_views_are_small():
    axes = {"start_offset": np.linspace(-1, 1, 192).tolist()}
    for eye, most in ((ALONE.eye, MAX_TOGETHER), (Eye(width=60, height=10, samples=2), MAX_SMALL_TOGETHER)):
        runs = {str(k): run for k, run in enumerate(Sweep.over("", ALONE.replace(eye=eye), axes).experiments)}
        sizes = list(map(len, side_by_side(runs, 1)))
        assert most / 2 < max(sizes) <= most
        assert sum(sizes) == 192


@pytest.mark.parametrize("kind", [InputError, ZeroDivisionError])
def test_a_run_that_fails_or_cannot_start_does_not_stop_those_beside_it(monkeypatch, kind):
    def add(self, step, diagnosis=None, add=Trajectory.add):
        if len(self) == 1 and step.deviation > 0.15:
            raise kind("too far")
        add(self, step, diagnosis)

    runs = [ALONE.replace(start_offset=offset, stopping__max_steps=3) for offset in (0.0, 40.0, 0.25, 0.05)]
    expected = [walked([run])[0].steps for run in (runs[0], runs[3])]
    monkeypatch.setattr(Trajectory, "add", add)
    good, outside, failed, other = walked(runs)
    assert [good.steps, other.steps] == expected
    assert "outside the world" in outside.refused
    assert isinstance(failed, InputError if kind is InputError else RuntimeError)
    assert str(failed) == "too far"


def test_views_are_drawn_once_for_all_models_and_worlds_opened_once(monkeypatch, tmp_path, cluster):
    done = []
    for name in ("training_views", "open_world"):
        method = getattr(Experiment, name)
        monkeypatch.setattr(
            Experiment, name, lambda *given, name=name, method=method: done.append(name) or method(*given)
        )
    axes = {"model": ["perfect-memory", "random"], "seed": [0, 1], "start_offset": [0.0, 0.1]}
    assert run_sweep(Sweep.over("", ALONE, axes), tmp_path, workers=cluster)["could_not_run"] == 0
    assert sorted(done) == ["open_world"] * 2 + ["training_views"] * 2


@pytest.mark.parametrize("workers", [1, 2, 7])
def test_runs_of_one_model_are_split_into_parts_one_world_after_the_other(workers):
    axes = {"model": ["perfect-memory", "random"], "seed": range(3), "start_offset": np.linspace(-1, 1, 45).tolist()}
    runs = {str(k): run for k, run in enumerate(Sweep.over("", ALONE, axes).experiments)}
    parts = side_by_side(runs, workers)
    assert sorted(key for part in parts for key in part) == sorted(runs)
    assert all(len({training_key(runs[key]) for key in part}) == 1 for part in parts)
    assert max(map(len, parts)) <= MAX_TOGETHER
    worlds = [runs[part[0]].seed for part in parts]
    assert worlds == sorted(worlds)
    few = side_by_side(dict(list(runs.items())[:20]), workers)
    assert len(few) >= workers  # nobody is idle


# Sweep files

REFUSED: list[tuple[str, int | None, list[str]]] = [  # the text, the line that the message names, what else it holds
    ("", None, ["[axes]"]),
    ("[axes]\n", None, ["[axes]"]),
    ("[axes\n", None, ["TOML", "']'", "line 1"]),
    ("[axes]\nseed = [1]\n[axis]\n", 3, ["'axis'", "[fixed]", "[axes]"]),
    ("title = 3\n[axes]\nseed = [1]\n", 1, ["title", "text"]),
    ("[fixed]\nmodle = 'rbm'\n[axes]\nseed = [1]\n", 2, ["'modle'", "did you mean model?"]),
    ("[axes]\nseed = [1]\nstep-m = []\n", 3, ["step-m", "at least one value", "range"]),
    ("[axes]\nseed = [1, 2.5]\n", 2, ["seed", "2.5", "whole number"]),
    ("[axes]\nseed = [\n  1,\n  'two',\n]\n", 2, ["seed", "'two'", "whole number"]),
    ('[axes]\nmodel = [\n  "rbm",\n  "rbn",\n]\n', 4, ["'rbn'", "perfect-memory"]),
    ("[axes]\nseed = [1, 1]\n", 2, ["seed", "twice"]),
    ("[axes]\nseed = { from = 3, to = 1 }\n", 2, ["range", "3"]),
    ("[axes]\nseed = { from = 0, to = 1e9, step = 1e-9 }\n", 2, ["range", "1e-09"]),
    ("[axes]\nseed = { to = 1 }\n", 2, ["range", "from = 0, to = 19"]),
    ("[fixed]\nseed = 3\n[axes]\nseed = [1]\n", 4, ["seed", "fixed", "leave one out"]),
    ("[fixed]\nscan-deg = 400\n[axes]\nseed = [1]\n", 2, ["scan-deg is 400; give", "to 360 (degrees)"]),
    ("[fixed]\non-lost = 'cry'\n[axes]\nseed = [1]\n", 2, ["'cry'", "reset or reset-nearest"]),
    ("[fixed]\nworld = 'there-is-none.glb'\n[axes]\nseed = [1]\n", 2, ["there-is-none.glb"]),
    ("[axes]\nworld = ['tiny', 'tiny field_width=900']\n", 2, ["'tiny field_width=900'", "field_width", "900"]),
    ("[axes]\nseed = {from=0, to=9999}\noffset-m = {from=0, to=1, count=9999}\n", None, ["99,990,000 runs", "1,000,000"]),
    ("[axes]\nseed = {from=0, to=1e308}\n", 2, ["range"]),
    ("[axes]\noffset-m = {from=-1e308, to=1e308, count=3}\n", 2, ["range"]),
    ("[axes]\noffset-m = {from=0, to=1, step=5e-324}\n", 2, ["range"]),
    (f"[axes]\nseed = {{from=0, to=1{'0' * 400}}}\n", 2, ["range"]),
    (f"[axes]\noffset-m = [1{'0' * 400}]\n", 2, ["offset-m", "1000"]),
    ("[axes]\n" + "".join(f"{name} = {{from=1, to=999}}\n" for name in ("seed", "route-seed", "every")), None, ["997,002,999 runs"]),
    ("[axes]\noffset-m = [0]\noffset_m = [0.1, 0.2]\n", 2, ["offset_m", "twice"]),
    ("[axes]\nrenderer = ['cpu', 'gpu']\n", 2, ["'gpu'", "osmesa"]),
    ("[axes]\nroute-length-m = [1, 0.05]\n", 2, ["route-length-m is 0.05; give"]),
    ("[fixed]\nnavigator = 'scan width=9'\n[axes]\nseed = [1]\n", 2, ["Scan: width is 9 rad"]),
    ("[fixed]\nunit = 'mm'\nworld = 'tiny'\n[axes]\nseed = [1]\n", 2, ["unit", "generated", "leave them out"]),
    ("[fixed]\nworld = 'w.obj'\nup = 'y'\n[axes]\nscale = [1, 2]\nunit = ['auto', 'cm']\n", 6, ["scale 1", "'cm'", "one of the two"]),
    ("[fixed]\nworld = 'w.obj'\n[axes]\nup = ['y', 'w']\n", 4, ["up is 'w'; give"]),
    ("[fixed]\nroute = '.'\n[axes]\nseed = [1]\n", 2, ["route"]),
    ("[axes]\nwho = [{model = 'rbm'}, {encoding = 'grey'}]\n", 2, ["who", "the same", "model"]),
    ("[fixed]\nsize = '720x150'\n[axes]\nsamples = [1, 64]\n", 4, ["720 x 150", "64"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "line", "words"), REFUSED)
def test_a_file_that_cannot_be_run_is_refused_with_its_line(text, line, words, tmp_path):
    path = written(tmp_path, text)
    (tmp_path / "w.obj").write_text("v 0 0 0\n")
    with pytest.raises(InputError) as refused:
        read_sweep(path)
    message = str(refused.value)
    assert message.startswith(str(path) if line is None else f"{path}, line {line}: ")
    assert all(word in message for word in words), message
    assert "\n" not in message


def test_a_sweep_reads_the_file_of_a_world_as_it_says(tmp_path):
    for name, lines in (
        ("mm.obj", "v 0 0 0\nv 4000 0 0\nv 0 0 -2000\nv 4000 1000 0\n"),
        ("m.obj", "v 0 0 0\nv 4 0 0\nv 0 2 0\nv 4 0 1\n"),
    ):
        (tmp_path / name).write_text(f"{lines}f 1 2 3\nf 1 2 4\n")
    worlds = (
        "{world='mm.obj', up='y', unit='mm'}, {world='m.obj', up='z', unit='m'}, {world='m.obj', up='z', unit='cm'}"
    )
    sweep = read_sweep(written(tmp_path, f"[axes]\nworld = [{worlds}]\n"))
    other, same, small = (experiment.open_world().triangles for experiment in sweep.experiments)
    assert np.allclose(other, same)
    assert np.allclose(small * 100, same)
    fixed = "[fixed]\nworld = 'mm.obj'\nup = 'y'\n"
    scaled = read_sweep(written(tmp_path, f"{fixed}[axes]\nscale = [0.001, 0.0005]\n")).experiments
    assert np.allclose(scaled[0].open_world().triangles, same)
    assert np.allclose(scaled[1].open_world().triangles, same / 2)


def test_a_sweep_is_all_combinations_of_its_choices(tmp_path):
    path = written(
        tmp_path,
        HEAD + "[axes]\nlearner = [{model = 'rbm', encoding = 'grey'}, {model = 'chain', encoding = 'sky'}]\n"
        "offset_m = {from = -0.2, to = 0.2, count = 3}\nseed = {from = 3, to = 7, step = 2}\nscan-deg = [90]\n",
    )
    sweep = read_sweep(path)
    runs = [settings_of(run) for run in sweep.experiments]
    assert [(run["model"], run["encoding"], run["offset_m"], run["seed"]) for run in runs[:4]] == [
        ("rbm", "grey", -0.2, 3), ("rbm", "grey", -0.2, 5), ("rbm", "grey", -0.2, 7), ("rbm", "grey", 0.0, 3),
    ]  # fmt: skip
    assert (len(sweep), runs[-1]["model"], runs[-1]["seed"]) == (18, "chain", 7)
    assert {(run["world"], run["size"], run["scan_deg"], run["threads"]) for run in runs} == {
        ("tiny", "60x12", 90.0, 1)
    }
    assert str(sweep) == "2 of learner, 3 of offset_m, 3 of seed, 1 of scan_deg"


def test_parts_that_runs_share_are_checked_once_and_put_together_right(tmp_path, monkeypatch):
    """Also where the choices of an axis change the walk and other things, and the axes of walks are not the last ones."""
    text = (
        HEAD + "offset-m = 0.05\n[axes]\nstep-m = [0.05, 0.1]\nmodel = ['random', 'infomax']\n"
        "who = [{encoding = 'grey', lost-m = 0.4}, {encoding = 'sky', lost-m = 0.3}]\nheading-noise-deg = [0, 5, 10, 20]\n"
    )
    made = []
    monkeypatch.setattr(
        "tussock.navigation.sweeps.sweep_file.experiment_of", lambda *given: made.append(0) or experiment_of(*given)
    )
    sweep = read_sweep(written(tmp_path, text))
    fixed = {"world": "tiny", "size": "60x12", "spacing_m": 0.1, "offset_m": 0.05, "threads": 1}
    axes = {"step_m": (0.05, 0.1), "model": ("random", "infomax"), "who": (("grey", 0.4), ("sky", 0.3))}
    given = [
        fixed | {"step_m": step, "model": model, "encoding": who[0], "lost_m": who[1], "heading_noise_deg": noise}
        for step, model, who, noise in itertools.product(*axes.values(), (0.0, 5.0, 10.0, 20.0))
    ]
    assert list(sweep.experiments) == [experiment_of(each) for each in given]
    assert len(made) <= 2 * 2 + 2 * 2 * 4
    keys = Keys()
    for run in sweep.experiments:
        assert keys.run(run) == key_of(run)
        assert keys.shared(run) == (route_key(run), views_key(run), training_key(run))


def test_keys_of_experiments_that_are_gone_are_not_mistaken_for_those_of_others():
    keys = Keys()
    for millimetres in range(1, 300):  # an eye is made where one before it was in memory
        change = {"eye__z": millimetres / 1000}
        assert keys.run(ALONE.replace(**change)) == key_of(ALONE.replace(**change))


@pytest.mark.parametrize(
    ("fixed", "eye"),
    [
        ('size = "60x12"\nsamples = 64', Eye(width=60, height=12, samples=64)),
        ("top-deg = -20\nbottom-deg = -60", Eye(top=np.radians(-20), bottom=np.radians(-60))),
    ],
)
def test_settings_of_a_file_are_checked_together(tmp_path, fixed, eye):
    """With the defaults of the others, each of them would be refused."""
    sweep = read_sweep(written(tmp_path, f"[fixed]\n{fixed}\n[axes]\nseed = [1, 2]\n"))
    assert [run.eye for run in sweep.experiments] == [eye, eye]


def test_files_that_a_sweep_names_are_found_from_everywhere(tmp_path, monkeypatch):
    (tmp_path / "route.csv").write_text("x_m,y_m\n0,0\n1,1\n")
    written(tmp_path, "[fixed]\nroute = 'route.csv'\n[axes]\nseed = [1]\n")
    monkeypatch.chdir(tmp_path)
    (run,) = read_sweep(Path("sweep.toml")).experiments
    assert run.route == tmp_path / "route.csv"
    Image.fromarray(np.pad(np.zeros((10, 20), np.uint8), 20, constant_values=255)).save(tmp_path / "mask.png")
    path = written(tmp_path, "[fixed]\nmask = 'mask.png'\n[axes]\nseed = [1]\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (run,) = read_sweep(path).experiments
    assert run.eye.masked


def test_a_file_that_is_named_like_a_choice_changes_no_run(tmp_path, monkeypatch):
    path = written(tmp_path, HEAD + "[axes]\nmodel = ['infomax', 'random']\nencoding = ['grey', 'edges']\n")
    before = [key_of(run) for run in read_sweep(path).experiments]
    for name in ("infomax", "random", "grey", "tiny", "60x12"):
        (tmp_path / name).write_text("something else")
    monkeypatch.chdir(tmp_path)
    assert [key_of(run) for run in read_sweep(path).experiments] == before


def test_the_file_of_a_model_is_read_once_for_all_runs(tmp_path, monkeypatch):
    eye = Eye(width=60, height=12)
    model = PerfectMemory().fit(experiment_of({}).encoding(np.zeros((1, 12, 60, 4), np.uint8)))
    save_model(TrainedModel(model=model, encoding=None, eye=eye, poses=None), tmp_path / "m.safetensors")
    loaded, load = [], model_files.load_model
    monkeypatch.setattr(model_files, "load_model", lambda path, **more: loaded.append(path) or load(path, **more))
    text = "[fixed]\nmodel = 'm.safetensors'\nresize = 6\n[axes]\nseed = {from = 0, to = 49}\noffset-m = [0, 0.1]\n"
    sweep = read_sweep(written(tmp_path, text))
    assert len({key_of(run) for run in sweep.experiments}) == 100
    assert {run.eye for run in sweep.experiments} == {eye}
    assert loaded == [tmp_path / "m.safetensors"]


# The folder of a sweep


def kept(key: str, settings: dict, *, again: bool = False, **row) -> Finished:
    return Finished(key=key, settings=settings, row=settings | row, steps="x_m\n0\n", again=again)


def test_equal_settings_have_one_row_the_newest(tmp_path):
    with Store(tmp_path) as store:
        store.add([kept("a", {"route": "r.csv"}, steps=1), kept("b", {"route": "s.csv"}, steps=2)])
        store.add([kept("c", {"route": "r.csv"}, steps=3)])  # the file holds another route now
        assert {key: row["steps"] for key, row in store.rows().items()} == {"b": 2, "c": 3}


def test_a_run_that_failed_is_a_row_and_is_tried_again(tmp_path):
    run = Experiment(world="tiny")
    first = finished_run(run, "a", InputError("no EGL on this machine"))
    with Store(tmp_path) as store:
        store.add([first])
        assert store.finished() == set()
        assert store.rows()["a"]["error"] == "no EGL on this machine"
        store.add([finished_run(run, "a", Walked(results={"arrived": True}, steps="", seconds=1, learn_seconds=1))])
        assert store.finished() == {"a"}
        assert store.rows()["a"]["error"] is None
        outside = Walked(refused="the start is outside", results={}, steps="", seconds=0, learn_seconds=1)
        store.add([finished_run(run, "b", outside)])
        assert store.finished() == {"b"}  # of the same settings; and it stays outside


@pytest.mark.parametrize("damage", ["middle", "columns", "killed"])
def test_a_damaged_folder_is_refused_in_one_line(tmp_path, damage, swept):
    out = shutil.copytree(swept, tmp_path / "out")
    path = out / "finished.sqlite"
    if damage == "middle":
        whole = bytearray(path.read_bytes())
        whole[4096:-4096] = b"\xa5" * (len(whole) - 8192)
        path.write_bytes(whole)
    elif damage == "columns":
        path.unlink()
        with closing(sqlite3.connect(path)) as database:
            database.execute("CREATE TABLE runs (key TEXT)")
    else:  # in the middle of a transaction
        script = (
            "import os, sqlite3, sys; d = sqlite3.connect(sys.argv[1]); d.execute('PRAGMA cache_size=1')\n"
            "d.execute('UPDATE runs SET row = hex(zeroblob(100000))'); os._exit(0)"
        )
        subprocess.run([sys.executable, "-c", script, path], check=True)
        assert (out / "finished.sqlite-journal").stat().st_size > 0
    if damage == "killed":  # what was finished before is all there
        with Store(out, read_only=True) as store:
            assert len(store.rows()) == 24
        return
    with (
        pytest.raises(InputError, match=r"finished\.sqlite cannot be used") as refused,
        Store(out, read_only=True) as store,
    ):
        store.rows()
    assert "\n" not in str(refused.value)


def test_a_folder_that_another_sweep_writes_to_is_refused(capfd, tmp_path):
    path, out = written(tmp_path, MANY), tmp_path / "out"
    with Store(out):
        code, _, err = tussock(capfd, "sweep", path, "--out", out)
    assert code == 2
    assert f"another sweep is writing to {out}" in err.splitlines()[-1]
    assert "--out" in err.splitlines()[-1]


def test_a_recording_of_another_walk_is_removed(swept, tmp_path):
    with Store(swept, read_only=True) as store:
        row = next(iter(store.rows().values()))
    run = experiment_of({name: row[name] for name in TYPES})
    record_again(run, row, tmp_path / "here")
    assert (tmp_path / "here" / "recording.rrd").exists()
    for _ in range(2):  # the second time, too
        with pytest.raises(InputError, match=r"another result \(steps\)"):
            record_again(run, row | {"steps": row["steps"] + 1}, tmp_path / "here")
        assert not (tmp_path / "here").exists()


@pytest.fixture
def old_folder(tmp_path) -> Path:
    """The folder of a sweep as version 0.1 left it: it knew no navigators, and its rows had no encoding by default."""
    out, left_out = tmp_path / "old", "navigator"
    out.mkdir()
    with closing(sqlite3.connect(out / "finished.sqlite")) as database:
        database.execute(
            "CREATE TABLE runs (key TEXT PRIMARY KEY, settings TEXT NOT NULL UNIQUE, row TEXT NOT NULL, steps BLOB NOT NULL, "
            "again INTEGER NOT NULL)"
        )
        for seed in range(3):
            run = experiment_of({"world": "tiny", "size": "60x12", "threads": 1, "seed": seed})
            settings = {name: value for name, value in settings_of(run).items() if name != left_out} | {
                "encoding": None
            }
            row = settings | {
                "arrived": seed > 0, "reason": "arrived" if seed else "lost", "steps": 2, "mean_deviation_m": 0.1, "max_deviation_m": 0.2,
                "mean_error_deg": 5.0, "resets": 0, "cause": None if seed else "corner", "poor_steps": 1, "n_views": 9, "route_m": 3.0,
                "memory_bytes": 100, "occlusion_steps": 0, "off_the_catchment_steps": 0, "aliasing_steps": 0, "corner_steps": 1,
                "unlearned_direction_steps": 0, "unexplained_steps": 0, "error": None, "command": f"tussock run --seed {seed}",
                "seconds": 1.0, "learn_seconds": 1.0,
            }  # fmt: skip
            steps = (
                "step,x_m,y_m,heading_deg,turn_deg,familiarity,deviation_m,along_m,error_deg,match,place,reset,reason,covered,"
                "nearest_view_m,recognised_view_m,turning_deg,cause\n"
                "0,1.5,1.5,90.0,60.0,0.9,0.1,0.0,60.0,3,,,,0.0,0.1,0.1,70.0,corner\n"
                "1,1.5,1.55,150.0,0.0,0.9,0.2,0.05,5.0,3,,,lost,,,,,\n"
            )
            values = (f"key{seed}", json.dumps(settings), json.dumps(row), zlib.compress(steps.encode()), 0)
            database.execute("INSERT INTO runs VALUES (?, ?, ?, ?, ?)", values)
        database.commit()
    return out


def test_a_folder_of_an_older_version_is_refused_for_more_runs(capfd, old_folder, tmp_path):
    before = (old_folder / "finished.sqlite").read_bytes()
    code, _, err = tussock(capfd, "sweep", written(tmp_path, MANY), "--out", old_folder)
    assert code == 2
    last = err.splitlines()[-1]
    assert all(word in last for word in (str(old_folder), "another version", "--out", "tussock report"))
    assert (old_folder / "finished.sqlite").read_bytes() == before
    assert not (old_folder / "runs.parquet").exists()


def test_a_folder_of_an_older_version_is_still_reported(capfd, old_folder):
    result = printed(capfd, "report", old_folder, "--worst", 1)
    assert (result["runs"], result["could_not_run"]) == (3, 0)
    assert result["arrived"] == pytest.approx(2 / 3)
    assert "corner" in Path(result["report"]).read_text()


# Processes that are killed, and disks that are full


def finished(out: Path) -> int:
    """How many runs a folder holds so far."""
    try:
        with closing(sqlite3.connect(f"{(out / 'finished.sqlite').as_uri()}?mode=ro", uri=True)) as database:
            return database.execute("SELECT count(*) FROM runs").fetchone()[0]
    except sqlite3.OperationalError:
        return 0


@contextmanager
def running(path: Path, out: Path, *words, runs: int = 3) -> Iterator[Process]:
    """A sweep that has finished some of its runs, but not all."""
    command = [TUSSOCK, "sweep", str(path), "--out", str(out), "--json", *words]
    with Process(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        while finished(out) < runs:
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)
        yield process


@contextmanager
def scheduler(workers: int) -> Iterator[tuple[str, subprocess.Popen]]:
    """A Dask scheduler and workers, started as people start them."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    dask, quiet = Path(TUSSOCK).with_name("dask"), {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    local = ["--no-dashboard", "--host", "127.0.0.1"]
    started = [subprocess.Popen([dask, "scheduler", *local, "--port", address.rpartition(":")[2]], **quiet)]
    started += [subprocess.Popen([dask, "worker", address, "--nthreads", "1", *local], **quiet) for _ in range(workers)]
    try:
        while True:
            try:
                socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2])), timeout=1).close()
                break
            except ConnectionRefusedError:
                assert started[0].poll() is None
                time.sleep(0.1)
        yield address, started[0]
    finally:
        for each in started:
            children = psutil.Process(each.pid).children(recursive=True) if each.poll() is None else []
            for process in [each, *children]:
                process.kill()
            each.wait()


@pytest.mark.slow
def test_a_killed_worker_loses_nothing_and_all_listen_on_this_machine_only(tmp_path):
    with running(written(tmp_path, MANY), tmp_path / "out") as process:
        below = psutil.Process(process.pid).children(recursive=True)
        workers = [each for each in below if "tussock.navigation.sweeps.work" in " ".join(each.parent().cmdline())]
        listening = [
            c.laddr.ip
            for each in [psutil.Process(process.pid), *workers]
            for c in each.net_connections()
            if c.status == "LISTEN"
        ]
        workers[0].kill()
        out, err = process.communicate()
    assert process.returncode == 0, err
    assert set(listening) == {"127.0.0.1"}
    assert json.loads(out)["runs"] == 30
    assert sorted(table(tmp_path / "out")["seed"]) == list(range(30))
    assert "Traceback" not in err


@pytest.mark.slow
def test_a_killed_scheduler_is_reported_and_the_same_command_goes_on(capfd, tmp_path):
    path, out = written(tmp_path, MANY), tmp_path / "out"
    with scheduler(workers=1) as (address, process), running(path, out, "--scheduler", address) as sweep:
        process.kill()
        _, err = sweep.communicate()
    assert sweep.returncode == 2
    assert all(word in err.splitlines()[-1] for word in ("scheduler is gone", "are kept", "the same command"))
    assert "Traceback" not in err
    before = finished(out)
    assert process_json("sweep", path, "--out", out)["done_before"] == before >= 3
    assert sorted(table(out)["seed"]) == list(range(30))


@pytest.mark.slow
@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_an_interrupted_sweep_keeps_what_is_done_and_ends_its_workers(tmp_path, how, code):
    path, out = written(tmp_path, MANY), tmp_path / "out"
    with running(path, out) as process:
        below = psutil.Process(process.pid).children(recursive=True)
        os.killpg(process.pid, how) if how == signal.SIGINT else process.send_signal(how)  # Ctrl-C reaches all of them
        _, err = process.communicate()
    assert process.returncode == code
    assert "Traceback" not in err
    _, alive = psutil.wait_procs(below, timeout=30)
    assert not alive
    before = finished(out)
    with Store(out) as store:  # the folder is free again
        assert len(store.finished()) == before >= 3


@pytest.mark.slow
def test_a_full_disk_is_reported_and_with_room_the_sweep_goes_on(small_disk, tmp_path):
    path, out = written(tmp_path, MANY), small_disk / "out"
    done = subprocess.run([TUSSOCK, "sweep", path, "--out", out], capture_output=True, text=True)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "no space" in done.stderr.lower()
    before = finished(out)
    subprocess.run(["mount", "-o", "remount,size=20m", small_disk], check=True)
    assert process_json("sweep", path, "--out", out)["done_before"] == before > 0
    assert sorted(table(out)["seed"]) == list(range(30))


@pytest.mark.slow
def test_a_scheduler_with_workers_started_by_hand_gives_the_same_table(swept, tmp_path):
    with scheduler(workers=2) as (address, _):
        process_json("sweep", written(tmp_path, SWEEP), "--out", tmp_path / "out", "--scheduler", address)
    by_hand, here = table(tmp_path / "out").drop(columns="recording"), table(swept).drop(columns="recording")
    pd.testing.assert_frame_equal(by_hand, here, check_exact=True)


def test_a_scheduler_that_is_not_there_is_reported(capfd, tmp_path, monkeypatch):
    monkeypatch.setattr("tussock.navigation.sweeps.sweep.SECONDS", 0.5)
    flags = ["--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9"]
    code, _, err = tussock(capfd, "sweep", written(tmp_path, SWEEP), *flags)
    assert code == 2
    last = err.splitlines()[-1]
    assert all(word in last for word in ("no Dask scheduler", "tcp://127.0.0.1:9", "dask scheduler"))


# Reports


def test_the_report_of_a_sweep_stands_by_itself(swept, reported):
    html = Path(reported["report"]).read_text()
    results = json.loads(Path(reported["results"]).read_text())
    assert reported["runs"] == results["runs"] == 24
    assert reported["arrived"] == table(swept)["arrived"].mean()
    assert set(results["by"]) == {"model", "offset (m)", "seed"}
    for choices in results["by"].values():
        assert sum(choice["runs"] for choice in choices.values()) == 24
        assert all(choice["arrived"]["low"] is None for choice in choices.values())  # there are too few worlds
    assert results["worlds"] == table(swept)["seed"].nunique() < 5
    assert "no interval" in html
    split = results["by"]["offset (m)"]
    for label, part in table(swept).groupby("offset_m"):
        assert {model: each["runs"] for model, each in split[f"{label:g}"]["split"].items()} == dict(
            part["model"].value_counts()
        )
    assert not any("split" in each for each in results["by"]["model"].values())
    assert "24 runs, all completed" in html
    assert html.count("data:image/png;base64,") == 3 + 2 * 5
    assert 'src="http' not in html
    assert all(row["command"] in html for row in table(swept).to_dict("records") if row["key"] in results["worst"])
    anchors = ["by-model", "by-offset_m", "by-seed", "pairs", "causes", "worst"]
    assert all(f'id="{anchor}"' in html for anchor in [*anchors, *(f"walk-{key}" for key in results["worst"])])


def test_the_title_of_a_sweep_is_that_of_its_page(tmp_path, monkeypatch):
    path = written(tmp_path, 'title = "Who arrives?"\n' + SWEEP)
    fill(path, tmp_path / "out", 24)
    run_sweep(read_sweep(path), tmp_path / "out")  # of which nothing is missing
    monkeypatch.setattr(SAVE_FIGURE, not_drawn)
    write_sweep_report(tmp_path / "out", worst=0)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<title>Who arrives?</title>" in page
    (tmp_path / "out" / "sweep.json").write_text("damaged")
    write_sweep_report(tmp_path / "out", worst=0)
    assert "<h1>Sweep out</h1>" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_the_first_screen_of_a_sweep_counts_arrivals(swept, reported):
    page, runs = Path(reported["report"]).read_text(encoding="utf-8"), table(swept)
    counts = [int(runs.loc[runs["model"] == model, "arrived"].sum()) for model in ("infomax", "perfect-memory")]
    head = f"{sum(counts)} of 24 arrived: infomax {counts[0]} of 12, perfect-memory {counts[1]} of 12."
    assert page.index(head) < page.index("<dl>")


def test_arrivals_tell_choices_apart():
    runs = pd.DataFrame({"model": ["rbm units=2", "rbm units=2", "chain"], "arrived": [True, False, True], "one": 1})
    assert arrivals(runs, ["model"]) == "2 of 3 arrived: rbm 1 of 2, chain 1 of 1"
    alike = runs.assign(model=["rbm units=2", "rbm units=2", "rbm units=3"])
    assert arrivals(alike, ["model"]) == "2 of 3 arrived: rbm units=2 1 of 2, rbm units=3 1 of 1"
    assert arrivals(runs, []) == arrivals(runs, ["one"]) == "2 of 3 arrived"


def test_a_walk_whose_world_is_gone_has_a_reason_in_place_of_figures(swept):
    with Store(swept, read_only=True) as store:
        key, row = next(iter(store.rows().items()))
        section = walk_section(1, key, row | {"world": "gone.glb"}, read_steps(store.steps(key)), swept)
    drawing = next(block for block in section.blocks if isinstance(block, Drawing))
    with pytest.raises(InputError, match=r"gone\.glb"):
        list(drawing.draw())


def test_an_axis_with_very_many_choices_is_reported_in_ranges(tmp_path, monkeypatch):
    """The page and the numbers stay small. An interval of a range is that of its runs."""
    fill(sweep_file(tmp_path, 200), tmp_path / "out", 200)
    with monkeypatch.context() as without_figures:
        without_figures.setattr(SAVE_FIGURE, not_drawn)
        whole = write_sweep_report(tmp_path / "out", worst=0)["by"]["offset (m)"]
    monkeypatch.setattr("tussock.navigation.sweeps.statistics.MAX_CHOICES", 9)
    monkeypatch.setattr("tussock.navigation.sweeps.statistics.RANGES", 3)
    ranges = write_sweep_report(tmp_path / "out", worst=0)["by"]["offset (m)"]
    labels = list(whole)
    assert list(ranges) == [f"{labels[a]} to {labels[b]}" for a, b in ((0, 3), (4, 6), (7, 9))]
    with Store(tmp_path / "out", read_only=True) as store:
        table = store.table()
    first = table[table["offset_m"] < -0.06]
    assert ranges[f"{labels[0]} to {labels[3]}"]["runs"] == len(first) == 80
    assert ranges[f"{labels[0]} to {labels[3]}"]["arrived"]["value"] == first["arrived"].mean()
    assert "a range of successive ones" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize("hidden", [set(), {0}, {0, 1, 5}])
def test_the_pose_of_a_learned_view_counts_views_without_contrast_out(monkeypatch, hidden):
    """Also where all views before it are without contrast. No more are drawn than it takes."""
    drawn = []

    def training_views(encoding, renderer, poses, warn):
        drawn.append(len(poses))
        learned = poses[[pose[0] // 3 not in hidden for pose in poses]]
        if not len(learned):
            raise SettingError("none")
        return None, learned

    monkeypatch.setattr("tussock.navigation.sweeps.worst.training_views", training_views)
    poses = np.arange(30.0).reshape(10, 3)
    kept = [k for k in range(10) if k not in hidden]
    with ALONE.open_renderer(ALONE.open_world()) as renderer:
        for number, k in enumerate(kept):
            drawn.clear()
            assert np.array_equal(learned_pose(number, ALONE, renderer, poses), poses[[k]])
            assert sum(drawn) == k + 1


@pytest.mark.parametrize("width", WIDTHS)
def test_a_browser_shows_the_report_without_errors(reported, tmp_path, width):
    shown = in_browser(Path(reported["report"]), width, tmp_path)
    assert shown == {"width": width, "wide": [], "broken": 0, "small": 0, "images": 3 + 2 * 5}


def test_a_folder_without_a_sweep_has_no_report(capfd, tmp_path):
    code, _, messages = tussock(capfd, "report", tmp_path)
    assert (code, len(messages.splitlines())) == (2, 1)
    assert "holds no sweep" in messages
