"""Sweeps with real processes: what a file asks for, the same table from any cluster, and nothing lost whatever is killed."""

import json
import os
import shlex
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
from browser import WIDTHS, in_browser

from tussock.navigation.cli.run_options import RunOptions
from tussock.navigation.reports.report import Drawing
from tussock.navigation.sweeps.spec import read_sweep
from tussock.navigation.sweeps.store import TIMES, Finished, Store, read_steps, table_of
from tussock.navigation.sweeps.sweep import finished_run, record_again
from tussock.navigation.sweeps.work import Walked, lesson_key, options_of, path_key, run_key
from tussock.navigation.sweeps.worst import walk_section
from tussock.world.errors import InputError

BIN = Path(sys.executable).parent
TUSSOCK = str(BIN / "tussock")
HEAD = '[fixed]\nworld = "tiny"\nsize = "60x12"\n'
SWEEP = HEAD + '[axes]\nmodel = ["perfect-memory", "rbm"]\nseed = { from = 0, to = 3 }\noffset-m = [-0.1, 0, 0.1]\n'
MANY = HEAD + "[axes]\nseed = { from = 0, to = 29 }\n"


def written(folder: Path, text: str, name: str = "sweep.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def sweep(path: Path, out: Path, *words) -> dict:
    """What `tussock sweep` prints; it succeeds."""
    done = subprocess.run([TUSSOCK, "sweep", path, "--out", out, "--json", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def table(out: Path) -> pd.DataFrame:
    """The table of a sweep, times aside."""
    return pd.read_parquet(out / "runs.parquet").drop(columns=list(TIMES))


def finished(out: Path) -> int:
    """How many runs a folder holds so far."""
    try:
        return (
            sqlite3.connect(f"{(out / 'finished.sqlite').as_uri()}?mode=ro", uri=True)
            .execute("SELECT count(*) FROM runs")
            .fetchone()[0]
        )
    except sqlite3.OperationalError:
        return 0


@contextmanager
def going_on(path: Path, out: Path, *words, runs: int = 3) -> Iterator[subprocess.Popen]:
    """A sweep that has finished some of its runs, but not all."""
    command = [TUSSOCK, "sweep", str(path), "--out", str(out), "--json", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            while finished(out) < runs:
                assert process.poll() is None, process.communicate()
                time.sleep(0.05)
            yield process
        finally:
            if process.poll() is None:
                process.kill()


@pytest.fixture(scope="module")
def swept(tmp_path_factory) -> Path:
    """The folder of a whole sweep on a local cluster."""
    folder = tmp_path_factory.mktemp("swept")
    said = sweep(written(folder, SWEEP), folder / "out", "--record", "worst:1")
    assert (said["runs"], said["done_before"], said["could_not_run"]) == (24, 0, 0)
    return folder / "out"


def test_a_row_a_run_in_the_order_of_the_settings(swept):
    rows = table(swept)
    assert len(rows) == len(set(rows["key"])) == 24
    assert rows["seed"].tolist() == sorted(rows["seed"])
    assert set(rows["model"]) == {"perfect-memory", "rbm"}
    assert rows["error"].isna().all()
    assert rows["arrived"].mean() > 0.5
    assert (rows["reason"] == "arrived").tolist() == rows["arrived"].tolist()


def test_the_command_of_a_row_repeats_its_run_alone(swept, tmp_path):
    for row in table(swept).iloc[[0, -1]].to_dict("records"):
        words = shlex.split(row["command"])
        done = subprocess.run([TUSSOCK, *words[1:], "--json"], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        alone = json.loads(done.stdout)
        assert all(
            alone[name] == row[name]
            for name in ("arrived", "steps", "mean_deviation_m", "mean_error_deg", "poor_steps")
        )
        with Store(swept, read_only=True) as store:
            assert (tmp_path / words[-1] / "trajectory.csv").read_text() == store.steps(row["key"])


def test_the_worst_are_recorded(swept):
    rows = table(swept)
    (recorded,) = rows[rows["recording"].notna()].to_dict("records")
    assert (swept / recorded["recording"]).is_file()
    worst = rows.sort_values(["arrived", "mean_deviation_m"], ascending=[True, False]).iloc[0]
    assert recorded["key"] == worst["key"]


def test_done_again_nothing_is_done_and_more_of_an_axis_adds(swept, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(swept, out)
    before = (out / "runs.parquet").read_bytes()
    assert sweep(written(tmp_path, SWEEP), out)["done_before"] == 24
    assert (out / "runs.parquet").read_bytes() == before
    said = sweep(written(tmp_path, SWEEP.replace("[-0.1, 0, 0.1]", "[-0.1, 0, 0.15]")), out)
    assert (said["runs"], said["done_before"]) == (24, 16)
    assert len(table(out)) == 32


def test_a_scheduler_with_workers_started_by_hand_gives_the_same_table(swept, tmp_path):
    with scheduler(workers=2) as (address, _):
        sweep(written(tmp_path, SWEEP), tmp_path / "out", "--scheduler", address)
    by_hand, here = table(tmp_path / "out").drop(columns="recording"), table(swept).drop(columns="recording")
    by_hand.to_parquet(tmp_path / "a.parquet")
    here.to_parquet(tmp_path / "b.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


@contextmanager
def scheduler(workers: int) -> Iterator[tuple[str, subprocess.Popen]]:
    """A Dask scheduler and workers, started as people start them."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    local = ["--no-dashboard", "--host", "127.0.0.1"]
    started = [subprocess.Popen([BIN / "dask", "scheduler", *local, "--port", address.rpartition(":")[2]], **quiet)]
    started += [
        subprocess.Popen([BIN / "dask", "worker", address, "--nthreads", "1", *local], **quiet) for _ in range(workers)
    ]
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


def test_a_killed_worker_loses_nothing_and_all_listen_here_only(tmp_path):
    with going_on(written(tmp_path, MANY), tmp_path / "out") as process:
        below = psutil.Process(process.pid).children(recursive=True)
        workers = [each for each in below if any("spawn_main" in word for word in each.cmdline())]
        listening = [
            c.laddr.ip
            for each in [psutil.Process(process.pid), *workers]
            for c in each.net_connections()
            if c.status == "LISTEN"
        ]
        workers[0].kill()
        said, err = process.communicate()
    assert process.returncode == 0, err
    assert set(listening) == {"127.0.0.1"}
    assert json.loads(said)["runs"] == 30
    assert sorted(table(tmp_path / "out")["seed"]) == list(range(30))
    assert "Traceback" not in err


def test_a_killed_scheduler_is_said_and_the_same_command_goes_on(tmp_path):
    path, out = written(tmp_path, MANY), tmp_path / "out"
    with scheduler(workers=1) as (address, process), going_on(path, out, "--scheduler", address) as going:
        process.kill()
        _, err = going.communicate()
    assert going.returncode == 2
    assert err.splitlines()[-1].startswith("tussock: the scheduler is gone; all runs that were finished are kept")
    assert "Traceback" not in err
    before = finished(out)
    assert sweep(path, out)["done_before"] == before >= 3
    assert sorted(table(out)["seed"]) == list(range(30))


@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_an_interrupted_sweep_keeps_what_is_done_and_ends_its_workers(tmp_path, how, code):
    path, out = written(tmp_path, MANY), tmp_path / "out"
    with going_on(path, out) as process:
        below = psutil.Process(process.pid).children(recursive=True)
        os.killpg(process.pid, how) if how == signal.SIGINT else process.send_signal(how)  # Ctrl-C reaches all of them
        _, err = process.communicate()
    assert process.returncode == code
    assert "Traceback" not in err
    _, alive = psutil.wait_procs(below, timeout=30)
    assert not alive
    before = finished(out)
    with Store(out) as store:  # nobody holds the folder any more
        assert len(store.finished()) == before >= 3


def test_two_sweeps_into_one_folder_at_once_are_refused(tmp_path):
    path, out = written(tmp_path, MANY), tmp_path / "out"
    with going_on(path, out):
        done = subprocess.run([TUSSOCK, "sweep", path, "--out", out], capture_output=True, text=True)
    assert done.returncode == 2
    assert (
        done.stderr.splitlines()[-1]
        == f"tussock: another sweep is writing to {out}; wait for it, or give another --out"
    )


def test_a_full_disk_is_said_and_with_room_the_sweep_goes_on(small_disk, tmp_path):
    path, out = written(tmp_path, MANY), small_disk / "out"
    done = subprocess.run([TUSSOCK, "sweep", path, "--out", out], capture_output=True, text=True)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "no space" in done.stderr.lower()
    before = finished(out)
    subprocess.run(["mount", "-o", "remount,size=20m", small_disk], check=True)
    assert sweep(path, out)["done_before"] == before > 0
    assert sorted(table(out)["seed"]) == list(range(30))


def test_a_run_that_cannot_be_done_is_a_row_that_says_why(tmp_path):
    path = written(tmp_path, HEAD + "[axes]\noffset-m = [0, 40.0]\n")
    assert sweep(path, tmp_path / "out")["could_not_run"] == 1
    rows = table(tmp_path / "out").set_index("offset_m")
    assert "outside the world" in rows.loc[40.0, "error"]
    assert rows.loc[0.0, "arrived"]


REFUSED = [
    ("", "has no [axes]"),
    ("[axes]\n", "has no [axes]"),
    ("[axes\n", "is not TOML: Expected ']' at the end of a table declaration (at line 1, column 6)"),
    ("[axes]\nseed = [1]\n[axis]\n", "line 3: unknown 'axis'; a sweep has title, [fixed] and [axes]"),
    ("title = 3\n[axes]\nseed = [1]\n", "line 1: title is a text"),
    ("[fixed]\nmodle = 'rbm'\n[axes]\nseed = [1]\n", "line 2: 'modle' is no setting of a run; did you mean model?"),
    ("[axes]\nseed = [1]\nstep-m = []\n", "line 3: step-m is a list with something in it, or a range"),
    ("[axes]\nseed = [1, 2.5]\n", "line 2: seed is 2.5; give a whole number"),
    ("[axes]\nseed = [\n  1,\n  'two',\n]\n", "line 2: seed is 'two'; give a whole number"),
    ('[axes]\nmodel = [\n  "rbm",\n  "rbn",\n]\n', "line 4: unknown model 'rbn'; known:"),
    ("[axes]\nseed = [1, 1]\n", "line 2: seed has the same choice twice"),
    ("[axes]\nseed = { from = 3, to = 1 }\n", "line 2: the range"),
    ("[axes]\nseed = { from = 0, to = 1e9, step = 1e-9 }\n", "line 2: the range"),
    ("[axes]\nseed = { to = 1 }\n", "line 2: a range is { from = 0, to = 19 }"),
    ("[fixed]\nseed = 3\n[axes]\nseed = [1]\n", "line 4: seed is set here and in fixed seed; leave one out"),
    ("[fixed]\nscan-deg = 400\n[axes]\nseed = [1]\n", "line 2: a scan of 400 degrees"),
    ("[fixed]\non-lost = 'cry'\n[axes]\nseed = [1]\n", "line 2: --on-lost 'cry'"),
    ("[fixed]\nworld = 'there-is-none.glb'\n[axes]\nseed = [1]\n", "line 2: there is no world"),
    ("[axes]\nworld = ['tiny', 'tiny field_width=900']\n", "line 2: world 'tiny field_width=900': field_width is 900"),
    ("[axes]\nseed = {from=0, to=9999}\noffset-m = {from=0, to=1, count=9999}\n", "asks for 99,990,000 runs; ask for 1,000,000 at most"),
    ("[axes]\nseed = {from=0, to=1e308}\n", "line 2: the range"),
    ("[axes]\noffset-m = {from=-1e308, to=1e308, count=3}\n", "line 2: the range"),
    ("[axes]\noffset-m = {from=0, to=1, step=5e-324}\n", "line 2: the range"),
    (f"[axes]\nseed = {{from=0, to=1{'0' * 400}}}\n", "line 2: a range is"),
    (f"[axes]\noffset-m = [1{'0' * 400}]\n", "line 2: offset-m is 1000"),
    ("[axes]\n" + "".join(f"{name} = {{from=1, to=99999}}\n" for name in ("seed", "world-seed", "route-seed", "every")), "asks for 99,9"),
    ("[axes]\noffset-m = [0]\noffset_m = [0.1, 0.2]\n", "line 2: offset_m is there twice; leave one out"),
    ("[axes]\nrenderer = ['cpu', 'gpu']\n", "line 2: unknown renderer 'gpu'"),
    ("[axes]\nroute-length-m = [1, 0.05]\n", "line 2: a route of 0.05 m"),
    ("[fixed]\nroute = '.'\n[axes]\nseed = [1]\n", "line 2: there is no route"),
    ("[axes]\nwho = [{model = 'rbm'}, {encoding = 'grey'}]\n", "line 2: all choices of who set the same: model"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_cannot_be_run_is_refused_with_its_line(text, message, tmp_path):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as refused:
        read_sweep(path)
    assert str(refused.value).startswith(str(path))
    assert message in str(refused.value)


def test_a_sweep_file_is_all_combinations_of_its_choices(tmp_path):
    path = written(
        tmp_path,
        HEAD + "[axes]\nlearner = [{model = 'rbm', encoding = 'grey'}, {model = 'chain', encoding = 'sky'}]\n"
        "offset_m = {from = -0.2, to = 0.2, count = 3}\nseed = {from = 3, to = 7, step = 2}\nscan-deg = [90]\n",
    )
    runs = list(read_sweep(path).runs())
    assert [(run.model, run.encoding, run.offset_m, run.seed) for run in runs[:4]] == [
        ("rbm", "grey", -0.2, 3), ("rbm", "grey", -0.2, 5), ("rbm", "grey", -0.2, 7), ("rbm", "grey", 0.0, 3),
    ]  # fmt: skip
    assert (len(runs), runs[-1].model, runs[-1].seed) == (18, "chain", 7)
    assert {(run.world, run.size, run.scan_deg, run.threads) for run in runs} == {("tiny", "60x12", 90.0, 1)}


def test_keys_tell_apart_what_is_different_and_nothing_else(tmp_path):
    first = RunOptions(world="tiny", world_seed=1, seed=2, route_seed=1)
    assert run_key(first) == run_key(RunOptions(world="tiny", world_seed=1, seed=2, route_seed=1))
    noisy = RunOptions(world="tiny", world_seed=1, seed=2, route_seed=1, heading_noise_deg=3.0)
    assert run_key(noisy) != run_key(first)
    assert lesson_key(noisy) == lesson_key(first)
    other = RunOptions(world="tiny", world_seed=1, seed=3, route_seed=1)
    assert lesson_key(other) != lesson_key(first)
    assert path_key(other) == path_key(first)
    route = tmp_path / "route.csv"
    keys = set()
    for text in ("x_m,y_m\n0,0\n1,1\n", "x_m,y_m\n0,0\n1,2\n"):
        route.write_text(text)
        keys.add(run_key(RunOptions(world="tiny", route=route)))
    assert len(keys) == 2  # it is the content of a file that counts, wherever it lies


def kept(key: str, settings: dict, *, again: bool = False, **row) -> Finished:
    return Finished(key=key, settings=settings, row=settings | row, steps="x_m\n0\n", again=again)


def test_settings_have_one_row_the_newest(tmp_path):
    with Store(tmp_path) as store:
        store.add([kept("a", {"route": "r.csv"}, steps=1), kept("b", {"route": "s.csv"}, steps=2)])
        store.add([kept("c", {"route": "r.csv"}, steps=3)])  # the file holds another route now
        assert {key: row["steps"] for key, row in store.rows().items()} == {"b": 2, "c": 3}


def test_what_could_not_be_done_is_a_row_and_tried_again(tmp_path):
    run = RunOptions(world="tiny")
    first = finished_run(run, "a", InputError("no EGL on this machine"))
    with Store(tmp_path) as store:
        store.add([first])
        assert store.finished() == set()
        assert store.rows()["a"]["error"] == "no EGL on this machine"
        store.add([finished_run(run, "a", Walked(found={"arrived": True}, steps="", seconds=1, learn_seconds=1))])
        assert store.finished() == {"a"}
        assert store.rows()["a"]["error"] is None
        outside = Walked(refused="the start is outside", found={}, steps="", seconds=0, learn_seconds=1)
        store.add([finished_run(run, "b", outside)])
        assert store.finished() == {"b"}  # of the same settings; and it stays outside


def test_files_of_a_sweep_are_found_from_everywhere(tmp_path, monkeypatch):
    (tmp_path / "route.csv").write_text("x_m,y_m\n0,0\n1,1\n")
    written(tmp_path, "[fixed]\nroute = 'route.csv'\n[axes]\nseed = [1]\n")
    monkeypatch.chdir(tmp_path)
    (run,) = read_sweep(Path("sweep.toml")).runs()
    assert run.route == tmp_path / "route.csv"


@pytest.mark.parametrize("damage", ["middle", "columns", "killed"])
def test_a_damaged_folder_is_said_in_one_line(tmp_path, damage, swept):
    out = tmp_path / "out"
    shutil.copytree(swept, out)
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
    done = subprocess.run([TUSSOCK, "report", out, "--worst", "0"], capture_output=True, text=True)
    if damage == "killed":
        assert done.returncode == 0, done.stderr  # what was finished before is all there
    else:
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        assert "finished.sqlite cannot be used" in done.stderr


def test_a_recording_of_another_walk_does_not_stay(swept, tmp_path):
    with Store(swept, read_only=True) as store:
        row = next(iter(store.rows().values()))
    run = options_of(row)
    record_again(run, row, tmp_path / "here")
    assert (tmp_path / "here" / "recording.rrd").exists()
    for _ in range(2):  # the second time, too
        with pytest.raises(InputError, match=r"went another way \(steps\)"):
            record_again(run, row | {"steps": row["steps"] + 1}, tmp_path / "here")
        assert not (tmp_path / "here").exists()


def test_the_table_does_not_depend_on_the_order_in_which_runs_finish():
    rows = {
        str(k): {"seed": k % 5, "model": "ab"[k % 2], "route": None if k % 3 else "r", "error": None} for k in range(20)
    }
    shuffled = dict(np.random.default_rng(0).permutation(list(rows.items())).tolist())
    assert table_of(shuffled).equals(table_of(rows))


def test_the_report_of_a_sweep_has_everything(swept):
    done = subprocess.run([TUSSOCK, "report", swept, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    html = Path(result["report"]).read_text()
    results = json.loads(Path(result["results"]).read_text())
    assert result["runs"] == results["runs"] == 24
    assert result["arrived"] == table(swept)["arrived"].mean()
    assert set(results["by"]) == {"model", "offset (m)", "seed"}
    for choices in results["by"].values():
        assert sum(choice["runs"] for choice in choices.values()) == 24
        assert all(
            choice["arrived"]["low"] <= choice["arrived"]["value"] <= choice["arrived"]["high"]
            for choice in choices.values()
        )
    assert "24 runs, all completed" in html
    assert html.count("data:image/png;base64,") == 3 + 2 * 5
    assert 'src="http' not in html
    assert all(row["command"] in html for row in table(swept).to_dict("records") if row["key"] in results["worst"])
    anchors = ["by-model", "by-offset_m", "by-seed", "pairs", "causes", "worst"]
    assert all(f'id="{anchor}"' in html for anchor in [*anchors, *(f"walk-{key}" for key in results["worst"])])


def test_a_walk_whose_world_is_gone_has_a_reason_in_place_of_figures(swept):
    with Store(swept, read_only=True) as store:
        key, row = next(iter(store.rows().items()))
        section = walk_section(1, key, row | {"world": "gone.glb"}, read_steps(store.steps(key)), swept)
    drawing = next(block for block in section.blocks if isinstance(block, Drawing))
    with pytest.raises(InputError, match=r"gone\.glb"):
        list(drawing.draw())


@pytest.mark.parametrize("width", WIDTHS)
def test_a_browser_shows_the_report_without_errors(swept, tmp_path, width):
    subprocess.run([TUSSOCK, "report", swept], capture_output=True, check=True)
    shown = in_browser(swept / "report.html", width, tmp_path)
    assert shown == {"width": width, "wide": [], "broken": 0, "small": 0, "images": 3 + 2 * 5}


def test_a_folder_without_a_sweep_has_no_report(tmp_path):
    done = subprocess.run([TUSSOCK, "report", tmp_path], capture_output=True, text=True)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "holds no sweep" in done.stderr


def test_a_scheduler_that_is_not_there_is_said(tmp_path):
    path = written(tmp_path, SWEEP)
    done = subprocess.run(
        [TUSSOCK, "sweep", path, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(
        "tussock: no Dask scheduler answers at tcp://127.0.0.1:9; start one with"
    )
