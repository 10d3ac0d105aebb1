"""Published protocols: the parameters of their sweeps, their measures by hand, and one replication from the command line."""

import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import WIDTHS, in_browser
from commands import printed, process_json, tussock

from tussock.navigation.cli.main import main
from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_settings import settings_of
from tussock.navigation.models.infomax import RATES
from tussock.navigation.models.mushroom_body import ARDIN2016 as ARDIN2016_BODY
from tussock.navigation.reports.claims import check_claims
from tussock.navigation.stopping import StoppingRules
from tussock.navigation.studies.protocols import (
    ARDIN2016,
    AZEVEDO2025,
    BADDELEY2012,
    KAGIOULIS2024,
    LEMOEL2020,
    PROTOCOLS,
    Protocol,
    prepared,
    routes_in,
)
from tussock.navigation.studies.protocols.ardin2016_published import share_of_the_way
from tussock.navigation.studies.protocols.azevedo2025 import of_walk
from tussock.navigation.studies.protocols.effects import over_routes
from tussock.navigation.studies.protocols.lemoel2020 import GRID, MEMORIES
from tussock.navigation.studies.protocols.lemoel2020 import of_walk as distance_from_nest
from tussock.navigation.studies.protocols.protocol import check_models, route_names
from tussock.navigation.sweeps.tables import compared_models
from tussock.navigation.sweeps.work import draw, learn, walk
from tussock.render.eye import Eye
from tussock.world.errors import SettingError
from tussock.world.files import write_world
from tussock.world.geometry import Route
from tussock.world.route_files import read_route, write_route
from tussock.world.scene import World

TINY = ("--quick", "--world", "tiny", "--worlds", "2")


def runs_of(protocol, quick=False):
    """The runs in two of its worlds."""
    return list(protocol.sweep(routes_in(protocol.world, [], count=2), quick=quick).experiments)


def values(runs, name):
    """The values of a setting, as a sweep's table has them."""
    return {settings_of(run)[name] for run in runs}


def features_of(run):
    """Columns and rows of what the models see."""
    (rows, columns), *_ = run.encoding.bounds(run.eye.height, run.eye.width)
    return columns, rows


def test_ardin_is_as_published():
    runs = runs_of(ARDIN2016)
    assert ARDIN2016.worlds == 15
    assert len(runs) == 2 * 4 * 10
    for name, value in {
        "spacing_m": 0.1, "step_m": 0.1, "scan_deg": 120, "lost_m": 0.2, "arrive_m": 0.2, "max_steps": 1000, "on_lost": "reset",
        "route_length_m": 8, "learning_walk_m": 0,
    }.items():  # fmt: skip
        assert values(runs, name) == {value}, name
    assert sorted(values(runs, "offset_m")) == [-0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25]
    bodies = {str(run.model): run.make_model() for run in runs if run.model.name == "mushroom-body"}.values()
    assert [(each.columns * each.rows, each.cells, each.inputs) for each in bodies] == [(360, 20_000, 10)]
    assert all(each.parameters.items() >= ARDIN2016_BODY.items() for each in bodies)
    assert {model.split()[0] for model in values(runs, "model")} == {
        "perfect-memory",
        "mushroom-body",
        "infomax",
        "random",
    }
    assert features_of(runs[0]) == (360 // 2, 10)  # a column every 2 degrees ..
    steps = [step.name for step in runs[0].encoding.steps]
    assert steps[:3] == ["grey", "invert", "clahe"]
    assert runs[0].encoding.steps[-1].columns == 180 / 36  # .. each as wide as one of 36


def test_baddeley_is_as_published():
    runs = runs_of(BADDELEY2012)
    assert values(runs, "size") == {"360x68"}
    assert features_of(runs[0]) == (90, 17)
    assert np.isclose(np.degrees(runs[0].eye.top - runs[0].eye.bottom), 68)
    (infomax,) = {str(run.model): run.make_model() for run in runs if run.model.name == "infomax"}.values()
    assert (infomax.units, infomax.traversals) == (None, 1)  # as many as inputs; one pass
    assert RATES[infomax.rate](1530, 1530) == 0.01 / 1530


def test_azevedo_is_as_published():
    runs = runs_of(AZEVEDO2025)
    assert AZEVEDO2025.worlds == 75
    assert len(runs) == 2 * 4 * 45
    assert values(runs, "route_length_m") == {20}
    navigators = [run.navigator.make(model=run.make_model()) for run in runs[:: len(runs) // 8]][:4]
    assert [type(each).__name__ for each in navigators] == ["Scan", "FamiliarityModulated", "CastAndSurge", "Lateral"]
    assert [np.degrees(navigators[k].width) for k in (0, 2)] == pytest.approx([160, 160])
    assert np.degrees(navigators[1].wide) == pytest.approx(160)
    assert len(values(runs, "world_seed")) == 2
    offsets = sorted(values(runs, "offset_m"))
    assert len(offsets) == 45
    assert (offsets[0], offsets[22], offsets[-1]) == (-5.5, 0, 5.5)
    rules = runs[0].stopping
    assert rules.max_deviation > 40 * 2**0.5  # no walk is ended for being far
    assert rules.patience > rules.max_steps * runs[0].body.step_length


def test_kagioulis_is_as_published():
    runs = runs_of(KAGIOULIS2024)
    assert KAGIOULIS2024.worlds == 20
    assert len({(run.world_seed, run.route_seed) for run in runs}) == 2
    for name, value in {"scan_deg": 360, "step_m": 0.05, "lost_m": 0.3, "on_lost": "reset"}.items():
        assert values(runs, name) == {value}, name
    assert runs[0].stopping.patience / runs[0].body.step_length == 10
    assert np.isclose(runs[0].stopping.waypoint_spacing / runs[0].training.spacing, 5)
    assert features_of(runs[0]) == (360, 80)  # a column a degree ..
    assert Encoding.parse("grey | widen 2").steps[-1] in runs[0].encoding.steps  # .. of 2 degrees, as of 180
    assert "blur" in {step.name for step in runs[0].encoding.steps}


@pytest.mark.parametrize("protocol", list(map(PROTOCOLS.find, PROTOCOLS.builtin)), ids=lambda protocol: protocol.name)
def test_quick_runs_are_some_of_all_runs(protocol):
    whole, quick = (runs_of(protocol, quick) for quick in (False, True))
    assert set(quick) <= set(whole)
    assert protocol.quick_worlds < protocol.worlds
    names = [item.name for item in protocol.items]
    assert len(names) == len(set(names))
    assert {claim.figure for claim in protocol.claims} <= set(names)
    assert PROTOCOLS.find(protocol.name) is protocol


def holds(protocol, results):
    """Whether each claim of a protocol holds, by its key."""
    return {each.claim.key: each.holds[0] for each in check_claims(protocol.claims, [results])}


def walks(**columns):
    """A table of walks; columns that are not given are equal in all."""
    table = pd.DataFrame(columns)
    plain = {
        "place": "a",
        "arrived": True,
        "steps": 80,
        "mean_deviation_m": 0.1,
        "mean_error_deg": 10.0,
        "offset_m": 0.05,
        "resets": 0,
    }
    return table.assign(**{name: value for name, value in plain.items() if name not in columns})


ARDIN_MODELS = ["perfect-memory", "mushroom-body", "infomax", "random"]


def test_ardin_by_hand():
    results = ARDIN2016.measure(walks(
        model=np.repeat(ARDIN_MODELS, 4), offset_m=[0.05, -0.05, 0.25, -0.25] * 4,
        resets=[0, 1, 1, 2, 1, 1, 2, 2, 3, 4, 5, 6, 20, 22, 24, 30], place=["a", "b"] * 8,
    ))  # fmt: skip
    table = results.tables["by_displacement"].set_index("model")
    assert list(table.columns) == ["5 cm", "25 cm", "all"]
    assert table.loc["perfect-memory"].tolist() == [0.5, 1.5, 1.0]
    assert table.loc["random"].tolist() == [21, 27, 24]
    assert results.tables["by_route"].set_index("place")["infomax"].tolist() == [4, 5]
    *_, body_close = check_claims(ARDIN2016.claims, [results])
    assert body_close.obtained == [{"share of the way from perfect memory to random": pytest.approx(0.5 / 23)}]
    assert holds(ARDIN2016, results) == {"random-worst": True, "perfect-best": True, "body-close": True}


@pytest.mark.parametrize(
    ("resets", "expected"),
    [
        ([1, 2, 9, 8], {"random-worst": False, "perfect-best": True, "body-close": False}),
        ([2, 1, 3, 99], {"random-worst": True, "perfect-best": False, "body-close": True}),
    ],
)
def test_ardins_claims_can_fail(resets, expected):
    assert holds(ARDIN2016, ARDIN2016.measure(walks(model=ARDIN_MODELS, resets=resets))) == expected


def test_an_effect_over_routes_counts_every_walk():
    table = walks(model=["a", "b"] * 4, place=["x"] * 4 + ["y"] * 4, resets=[0, 2, 0, 4, 1, 7, np.nan, 9])
    effect = over_routes("b minus a", table, "resets", lambda mean: mean["b"] - mean["a"])
    assert (effect.value, effect.units, effect.of) == (pytest.approx(5.5 - 1 / 3), 2, "routes")
    many = pd.concat(
        [table.assign(place=f"route {k}", resets=table["resets"] + (table["model"] == "b") * k) for k in range(9)]
    )
    effect = over_routes("b minus a", many, "resets", lambda mean: mean["b"] - mean["a"])
    assert effect.low < effect.value < effect.high


def test_baddeley_by_hand():
    models = np.repeat(["perfect-memory", "infomax", "random"], 4)
    results = BADDELEY2012.measure(
        walks(model=models, resets=[0, 0, 0, 0, 0, 0, 4, 2, 9, 9, 9, 9], arrived=[True] * 11 + [False])
    )
    table = results.tables["by_model"].set_index("model")
    assert table["arrived without an error"].tolist() == [1, 0.5, 0]
    assert table["errors a walk"].tolist() == [0, 1.5, 9]
    assert table["arrived"].tolist() == [1, 1, 0.75]
    assert table["mean deviation (cm)"].tolist() == pytest.approx([10, 10, 10])
    assert list(holds(BADDELEY2012, results).values()) == [True, False, True]


def test_kagioulis_by_hand():
    models = ["perfect-memory"] * 2 + ["chain"] * 2
    results = KAGIOULIS2024.measure(
        walks(model=models, resets=[4, 0, 1, 2], mean_error_deg=[10.0, 20, 30, 2], place=["a", "b"] * 2)
    )
    table = results.tables["by_model"].set_index("model")
    assert table["mean absolute angular error (°)"].tolist() == [15, 16]
    assert table["trial-fail count"].tolist() == [2, 1.5]
    assert holds(KAGIOULIS2024, results) == {"sequence-lowers-error": False, "sequence-fails-less": True}
    assert results.tables["by_route"].set_index("place").loc["b", "failures, chain"] == 2


@pytest.mark.parametrize(("failures", "held"), [([2, 1, 3, 1, 2, 1], True), ([1, 0, 0, 0, 0, 0], False)])
def test_a_sequence_helps_only_where_its_interval_says_so(failures, held):
    models = ["perfect-memory"] * 6 + ["chain"] * 6
    table = walks(model=models, resets=failures + [0] * 6, mean_error_deg=[5.0] * 12, place=list("abcdef") * 2)
    assert holds(KAGIOULIS2024, KAGIOULIS2024.measure(table))["sequence-fails-less"] is held


def test_azevedos_displacement_of_a_walk_by_hand():
    row = {"route_m": 10.0}
    steps = pd.DataFrame({"along_m": [0.0, 9.6, 9.8, 10.0, 10.0], "deviation_m": [4.0, 1.0, 2.0, 3.0, 99.0]})
    results = of_walk(row, steps)  # what comes after its end does not count
    assert results == {"displacement_m": 2.5, "last_displacement_m": 2.0}
    short = of_walk(row, steps.iloc[:1])
    assert short["displacement_m"] == 4
    assert np.isnan(short["last_displacement_m"])


def test_a_route_has_the_length_that_it_has(tmp_path):
    """What does not fit is shorter than asked for, in a world from a file as well."""
    write_world(World.generate("tiny", seed=1), tmp_path / "world.glb")
    for world in ("tiny", str(tmp_path / "world.glb")):
        run = Experiment(
            world=world, eye=Eye(width=36, height=8), route_length=20.0, seed=1, stopping=StoppingRules(max_steps=1)
        )
        path = run.open_world_and_route()
        assert path[1].length < 5
        assert walk([run], learn(run, draw(run, path)))[0].results["route_m"] == path[1].length


def test_routes_with_the_same_file_name_have_different_names():
    rows = [
        {"route": route, "route_seed": 4}
        for route in ("/a/route.csv", "/b/route.csv", "/b/other.csv", None, "/a/route.csv")
    ]
    assert route_names(rows) == ["/a/route.csv", "/b/route.csv", "other", "route 4", "/a/route.csv"]


def azevedo_walks(**columns):
    """A table of walks by view-based orientation, where no other navigator is given."""
    return walks(**{"model": "perfect-memory", "navigator": "scan width_deg=160"} | columns)


def test_azevedo_by_hand():
    table = azevedo_walks(offset_m=[-2.0, 2, -4, 4, 0]).assign(
        displacement_m=[1.0, 3, 5, 7, 0.5], last_displacement_m=[1.0, np.nan, np.nan, 4, 0.5]
    )
    results = AZEVEDO2025.measure(table)
    rows = results.tables["by_start"].drop(columns="strategy").to_numpy().tolist()
    assert rows == [[0, 1, 0.5, 0.5, 1], [2, 2, 2, 1, 0.5], [4, 2, 6, 4, 0.5]]
    untested = {"cast-and-surge-converges": None, "cast-and-surge-ends-closer": None}
    assert holds(AZEVEDO2025, results) == {"no-approach": True} | untested
    assert results.numbers["share that got to the last 5 %, view-based orientation"] == 0.6
    back = AZEVEDO2025.measure(table.assign(displacement_m=[7.0, 7, 1, 1, 9]))
    assert holds(AZEVEDO2025, back)["no-approach"] is False
    one = AZEVEDO2025.measure(table[:1])
    assert holds(AZEVEDO2025, one)["no-approach"] is None


@pytest.mark.parametrize(("cast", "expected"), [(1.0, True), (3.0, False)])
def test_azevedos_strategies_are_compared_within_worlds(cast, expected):
    """Twelve worlds, in which agents stay farther from the route the higher the seed; casting takes 1 m off that, or adds 1 m."""
    names = ["lateral gain=8.0", "cast-and-surge", "scan width_deg=160"]
    rows = [
        {"place": f"route {seed}", "navigator": name, "offset_m": offset, "displacement_m": seed + away}
        for seed in range(12)
        for name, away in zip(names, (2.0 + (-0.2) ** (seed % 2), cast, 2.0), strict=True)
        for offset in (-3.0, 1.0, 2.0)
    ]
    table = pd.DataFrame(rows).assign(model="perfect-memory", arrived=False, steps=9)
    table["last_displacement_m"] = table["displacement_m"].where(table["offset_m"] > 0)
    results = AZEVEDO2025.measure(table)
    assert list(dict.fromkeys(results.tables["walks"]["model"])) == [
        "view-based orientation",
        "cast and surge",
        "lateral",
    ]
    differences = results.tables["differences"].set_index(["starts", "measure", "strategy"])
    row = differences.loc["all starts", "mean displacement (m)", "cast and surge"]
    assert (row["worlds"], row["less view-based orientation"]) == (12, cast - 2)
    assert row["p (Holm)"] == pytest.approx(2 * 2 / 2**12)  # of both signs, and of two strategies
    second = differences.loc["starts within 2 m, first 10 worlds", "mean displacement (m)", "cast and surge"]
    assert second["worlds"] == 10
    (within,) = {int(n) for n in results.tables["second"]["walks"]}
    assert within == 10 * 2  # of each strategy
    decided = holds(AZEVEDO2025, results)
    assert decided["cast-and-surge-converges"] is expected
    assert decided["cast-and-surge-ends-closer"] is expected


def test_a_protocol_of_several_navigators_compares_these():
    table = walks(
        spec="perfect-memory",
        model="perfect-memory",
        navigator=["scan", "cast-and-surge"] * 6,
        world="tiny",
        seed=0,
        route=None,
        route_seed=np.repeat(range(6), 2),
        world_seed=np.repeat(range(6), 2),
        mean_deviation_m=[0.3, 0.1] * 6,
    )
    compared = compared_models(table, "navigator")
    deviation = {name: each["mean_deviation_m"]["value"] for name, each in compared["navigators"].items()}
    assert deviation == {"scan": pytest.approx(0.3), "cast-and-surge": pytest.approx(0.1)}
    (pair,) = compared["pairs"]
    assert (pair["first"], pair["second"], pair["better"]["mean_deviation_m"]) == ("cast-and-surge", "scan", 6)
    assert list(compared_models(table)["models"]) == ["perfect-memory"]


@pytest.fixture(scope="module")
def replication(tmp_path_factory, cluster) -> Path:
    out = tmp_path_factory.mktemp("protocols") / "kagioulis"
    output = io.StringIO()
    with redirect_stdout(output):
        main(["replicate", "kagioulis2024", *TINY, "--scheduler", cluster, "--out", str(out), "--json"])
    result = json.loads(output.getvalue())
    assert (result["runs"], result["done_before"], result["could_not_run"]) == (4, 0, 0)
    assert set(result["claims"]) == {"sequence-lowers-error", "sequence-fails-less"}
    return out


def test_results_are_those_of_the_runs(replication):
    results = json.loads(
        (replication / "results.json").read_text(), parse_constant=lambda word: pytest.fail(f"{word} is not JSON")
    )
    runs = pd.read_parquet(replication / "runs.parquet")
    table = pd.DataFrame(
        results["tables"]["by_model"]["data"], columns=results["tables"]["by_model"]["columns"]
    ).set_index("model")
    for model in ("perfect-memory", "chain"):
        mean = runs[runs["model"] == model][["resets", "mean_error_deg"]].mean()
        assert table.loc[model, "trial-fail count"] == pytest.approx(mean["resets"])
        assert table.loc[model, "mean absolute angular error (°)"] == pytest.approx(mean["mean_error_deg"])
    assert results["parameters"]["Step"] == {"published": "5 cm", "here": "5 cm"}


def test_the_page_is_self_contained_and_has_everything(replication):
    page = (replication / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    anchors = re.findall(r'id="([^"]+)"', page)
    assert len(anchors) == len(set(anchors))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(anchors)
    assert {item.name for item in KAGIOULIS2024.items} <= set(anchors)
    assert (
        page.index('id="summary"')
        < page.index('id="results"')
        < page.index('id="differences"')
        < page.index('id="again"')
    )
    drawn = [item.name for item in KAGIOULIS2024.items if item.draw]
    assert page.count("data:image/png;base64,") == len(drawn)
    files = sorted(f"{name}.{kind}" for name in drawn for kind in ("png", "svg"))
    assert sorted(path.name for path in (replication / "figures").iterdir()) == files
    assert "tussock replicate kagioulis2024 --world tiny --worlds 2 --quick --out" in page


@pytest.mark.parametrize("width", WIDTHS)
def test_a_browser_shows_the_page_without_errors(replication, tmp_path, width):
    shown = in_browser(replication / "report.html", width, tmp_path)
    images = sum(item.draw is not None for item in KAGIOULIS2024.items)
    assert shown == {"width": width, "wide": [], "broken": 0, "small": 0, "images": images}


def test_a_second_run_does_nothing_again_and_changes_no_byte(replication, capsys):
    names = ("report.html", "results.json", "runs.parquet")
    before = {name: (replication / name).read_bytes() for name in names}
    main(["replicate", "kagioulis2024", *TINY, "--out", str(replication), "--json"])
    assert json.loads(capsys.readouterr().out)["done_before"] == 4
    assert {name: (replication / name).read_bytes() for name in names} == before


def test_a_report_of_something_else_is_not_replaced(replication, capsys):
    with pytest.raises(SystemExit) as end:
        main(["replicate", "kagioulis2024", *TINY, "--seed", "3", "--out", str(replication)])
    assert end.value.code == 2
    assert "holds a report of something else (Routes)" in capsys.readouterr().err


def test_given_routes_through_a_given_world():
    chosen = routes_in("world.bin", [Path("a.csv"), Path("b.csv")], seed=2)
    assert [choice["route"].name for choice in chosen] == ["a.csv", "b.csv"]
    generated = routes_in("tiny", [], seed=2, count=3)
    assert [(choice["world_seed"], choice["route_seed"]) for choice in generated] == [(2, 2), (3, 3), (4, 4)]
    assert [choice["route_seed"] for choice in routes_in("world.bin", [], seed=2, count=2)] == [2, 3]


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ("--route a.csv", "give --world as well"),
        ("--world tiny --route a.csv --worlds 2", "give it, or --route"),
        ("--worlds 0", "give at least 1"),
        ("--workers 0", "give at least 1"),
        ("--workers 1 --scheduler tcp://127.0.0.1:1", "give one of the two"),
        ("--world tiny --route nowhere.csv", "there is no route nowhere.csv"),
        ("--world nowhere.bin", "there is no world 'nowhere.bin'"),
        ("--world 'tiny field_width=0'", "field_width"),
    ],
)
def test_bad_input_is_one_line(flags, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(["replicate", "ardin2016", *shlex.split(flags)])
    assert end.value.code == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]
    assert not (tmp_path / "ardin2016").exists()


def test_a_table_without_walks_of_a_model_is_refused():
    with pytest.raises(SettingError, match="no walk with random"):
        check_models(walks(model=["chain"]), ["chain", "random"])


def test_a_protocol_is_checked_when_it_is_made():
    fields = {name: getattr(ARDIN2016, name) for name in Protocol.__annotations__}
    for change, message in (
        ({"worlds": 0}, "worlds is 0"),
        ({"axes": {}}, 'no axis "model"'),
        (
            {"items": ARDIN2016.items[:1]},
            "'perfect-best' is shown by 'by-model'; give one of its items: by-displacement",
        ),
    ):
        with pytest.raises(SettingError, match=message):
            Protocol(**fields | change)


# Protocols from outside

PROTOCOL = '''"""Nobody 2030: whether perfect memory arrives."""

from tussock.navigation.experiment import Experiment
from tussock.navigation.reports.claims import Claim, Decision
from tussock.navigation.reports.results import StudyResults
from tussock.navigation.studies.protocols import Item, Parameter, Protocol
from tussock.render.eye import Eye


def measure(walks):
    return StudyResults(tables={"walks": walks[["model", "arrived"]]}, numbers={"arrived": walks["arrived"].mean()})


def decide(results):
    return Decision({"share that arrived": results.numbers["arrived"]}, results.numbers["arrived"] > 0)


NOBODY2030 = Protocol(
    name="nobody2030",
    title="Arrivals",
    paper="Nobody (2030).",
    question="Does perfect memory arrive?",
    experiment=Experiment(eye=Eye(width=60, height=12), route_length=2.0),
    axes={"model": ["perfect-memory"]},
    world="tiny",
    worlds=3,
    quick_worlds=1,
    parameters=(Parameter("View", "unknown", "60 x 12"),),
    differences=("Everything.",),
    measure=measure,
    claims=(Claim(key="arrives", statement="It arrives.", figure="walks", test="one walk arrives", decide=decide),),
    items=(Item(name="walks", title="Walks", caption="All.", table="walks"),),
)
'''


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """A folder on Python's path with packages, and entry points: one that works, one of a missing module, one that crashes."""
    for name, text in {
        "antlab/__init__.py": "",
        "antlab/protocol.py": PROTOCOL,
        "antlab-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: antlab\nVersion: 1\n",
        "antlab-1.dist-info/entry_points.txt": "[tussock.protocols]\nnobody2030 = antlab.protocol:NOBODY2030\n"
        "broken = antlab.gone:X\ncrashing = crashlab.protocol:X\n",
        "crashlab/__init__.py": "raise RuntimeError\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    paths = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    return tmp_path


@pytest.fixture
def found(package, monkeypatch) -> Iterator[Path]:
    """The same folder, also on the path of this process."""
    monkeypatch.syspath_prepend(package)
    monkeypatch.chdir(package)
    monkeypatch.setattr(PROTOCOLS, "_registered", {})
    vars(PROTOCOLS).pop("_installed", None)  # entry points are found once
    yield package
    vars(PROTOCOLS).pop("_installed", None)
    for name in [name for name in sys.modules if name.partition(".")[0] == "antlab"]:
        del sys.modules[name]


def is_replicated(result: dict, name: str, folder: Path) -> None:
    """Whether the command that printed a result has replicated the protocol of the package, under this name."""
    assert (result["runs"], result["claims"]["arrives"]["holds"]) == (1, "holds")
    page = (folder / "nobody2030" / "report.html").read_text(encoding="utf-8")
    assert f"tussock replicate {name} --quick --out nobody2030" in page


@pytest.mark.slow
def test_a_protocol_of_another_package_can_be_replicated(package):
    """Its workers find it as well."""
    name = "nobody2030"
    is_replicated(process_json("replicate", name, "--quick", "--workers", 1, cwd=package), name, package)


def test_a_protocol_of_another_package_can_be_given_by_its_location(found, cluster, capfd):
    name = "antlab.protocol:NOBODY2030"
    is_replicated(printed(capfd, "replicate", name, "--quick", "--scheduler", cluster), name, found)


def test_help_lists_every_protocol_with_its_sentence_and_imports_none(package):
    script = (
        "import sys\nfrom tussock.navigation.cli.main import main\n"
        "try: main(['replicate', '--help'])\nexcept SystemExit: pass\n"
        "print('HEAVY', {'pandas', 'torch', 'matplotlib', 'antlab.protocol'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert "HEAVY set()" in done.stdout, done.stderr
    text = " ".join(done.stdout.replace("│", " ").split())
    assert "nobody2030 Nobody 2030: whether perfect memory arrives." in text
    assert (
        "ardin2016 Ardin et al. 2016: errors along a route, by perfect memory, a mushroom body, Infomax and chance."
        in text
    )
    assert "broken" in text
    assert "crashing" in text


@pytest.mark.parametrize(
    ("name", "messages"),
    [
        ("json:dumps", ["json:dumps", "function", "Protocol"]),
        ("antlab.protocol:GONE", ["antlab.protocol:GONE", "cannot be imported"]),
        ("nowhere:X", ["nowhere:X", "cannot be imported", "package.module"]),
        ("broken", ["broken", "antlab.gone", "repair"]),
    ],
)
def test_something_else_than_a_protocol_is_one_line(found, capfd, name, messages):
    code, _, err = tussock(capfd, "replicate", name, "--quick")
    assert code == 2
    assert len(err.splitlines()) == 1
    assert all(message in err for message in messages), err


def test_a_protocol_that_a_script_registers_is_a_command(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(PROTOCOLS, "_registered", {})
    PROTOCOLS.register("mine", ARDIN2016)
    with pytest.raises(SystemExit):
        main(["replicate", "--help"])
    assert "How often does an agent leave a route" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        main(["replicate", "mine", "--worlds", "0", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    assert "--worlds 0" in capsys.readouterr().err


# As published


def test_ardin_as_published_is_as_published():
    protocol = ARDIN2016.as_published
    runs = runs_of(protocol)
    assert protocol.worlds == 15
    assert len(runs) == 2 * 4 * 2 * 11
    for name, value in {
        "spacing_m": 0.1, "step_m": 0.1, "scan_deg": 120, "lost_m": 0.2, "arrive_m": 0.2, "max_steps": 1000, "field_deg": 296,
        "route_length_m": 8, "learning_walk_m": 0,
    }.items():  # fmt: skip
        assert values(runs, name) == {value}, name
    assert values(runs, "on_lost") == {"reset", "reset-nearest"}
    assert sorted(values(runs, "offset_m")) == [-0.25, -0.2, -0.15, -0.1, -0.05, 0, 0.05, 0.1, 0.15, 0.2, 0.25]
    assert features_of(runs[0]) == (180, 36 * 10)  # a view of 36 x 10 at every second degree
    (body,) = {str(run.model): run.make_model() for run in runs if run.model.name == "spiking-mushroom-body"}.values()
    assert (body.mask.count, body.cells, body.inputs) == (360, 20_000, 10)
    assert runs[0].navigator.parameters["refine"] is False


def test_routes_as_published_are_steps_of_10_cm_in_even_degrees(tmp_path):
    path = tmp_path / "curved.csv"
    angles = np.linspace(0, 1.2, 90)
    write_route(Route.through(0.5 + 2 * np.column_stack([np.cos(angles), np.sin(angles)])), path)
    plain = routes_in("tiny", [path])
    (laid,) = prepared(ARDIN2016.as_published, plain, tmp_path)
    assert laid["route"] == tmp_path / "routes" / "01-curved.csv"
    route, given = read_route(laid["route"]), read_route(path)
    steps = np.diff(route.xy, axis=0)
    assert np.allclose(np.hypot(*steps.T), 0.1)
    degrees = np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
    assert np.allclose(degrees / 2, np.rint(degrees / 2), atol=1e-6)
    assert given.nearest(route.xy)[0].max() < 0.03
    assert prepared(ARDIN2016, plain, tmp_path / "none") == plain
    assert not (tmp_path / "none").exists()


def published_walks(errors: dict[str, list[float]], put_back=("reset", "reset-nearest")) -> pd.DataFrame:
    """Walks of each model with these errors, one on each route."""
    rows = [
        {"model": model, "resets": value, "place": f"route {k}", "on_lost": on_lost}
        for model, of_model in errors.items()
        for on_lost in put_back
        for k, value in enumerate(of_model)
    ]
    table = pd.DataFrame(rows)
    return walks(**{name: table[name] for name in table})


def test_ardin_as_published_by_hand():
    protocol = ARDIN2016.as_published
    errors = {"perfect-memory": [0, 2], "spiking-mushroom-body": [4, 6], "infomax": [5, 9], "random": [20, 22]}
    results = protocol.measure(published_walks(errors))
    table = results.tables["by_model"].set_index(["model", "put_back"])
    assert table.loc[("infomax", "at the nearest point"), "errors a walk"] == 7
    assert table["low"].isna().all()  # of two routes
    share = "share of the way from perfect memory to random, at the next waypoint"
    assert results.numbers[share] == 4 / 20
    assert np.isnan(results.numbers[f"{share}, low"])
    assert holds(protocol, results) == {"random-worst": True, "perfect-best": True, "body-close": False}
    untested = check_claims(protocol.claims, [results], few_units=False)
    assert [each.label for each in untested] == ["not tested"] * 3  # two routes are too few
    assert [each.known_effects[0].value for each in untested] == [12 + 2, 5 - 1, 4 / 20]  # as the means say
    close = protocol.measure(published_walks(errors | {"spiking-mushroom-body": [1, 2]}))
    assert holds(protocol, close)["body-close"] is True
    worst = protocol.measure(published_walks(errors | {"infomax": [30, 40]}))
    assert holds(protocol, worst)["random-worst"] is False


def test_the_interval_of_a_share_is_over_routes():
    random = np.random.default_rng(1)
    difficulty = random.uniform(0, 10, 12)
    errors = {
        "perfect-memory": difficulty,
        "spiking-mushroom-body": difficulty + 5,
        "infomax": difficulty,
        "random": difficulty + 20,
    }
    table = published_walks(errors, ["reset"]).rename(columns={"resets": "errors"})
    value, low, high = share_of_the_way(table)
    assert (value, low, high) == pytest.approx((0.25, 0.25, 0.25))  # the same on each route, however difficult
    errors["spiking-mushroom-body"] = difficulty + random.uniform(0, 10, 12)
    value, low, high = share_of_the_way(published_walks(errors, ["reset"]).rename(columns={"resets": "errors"}))
    assert low < value < high
    assert 0.05 < high - low < 0.3  # about 2 x 1.96 x (10 / 12 ** 0.5) / 12 ** 0.5 / 20


@pytest.mark.parametrize("name", ["baddeley2012", "azevedo2025"])
def test_a_protocol_without_a_variant_refuses_as_published_in_one_line(name, capsys, tmp_path):
    with pytest.raises(SystemExit) as end:
        main(["replicate", name, "--as-published", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"--as-published: {name} has no such variant" in line


def test_le_moel_is_as_published():
    runs = list(LEMOEL2020.sweep(routes_in(LEMOEL2020.world, [], count=1)).experiments)
    grid, ring = ([run for run in runs if run.stopping.max_steps == steps] for steps in (320, 150))
    assert len(grid) * LEMOEL2020.worlds == 22_680
    assert len(ring) == 3 * 2 * 10  # memories, gazes, agents
    for name, value in {
        "step_m": 0.2, "heading_noise_deg": 10, "eye_height_m": 0.02, "size": "72x15", "goal_views": 25, "goal_only": True,
    }.items():  # fmt: skip
        assert values([grid[0], ring[-1]], name) == {value}, name
    assert {run.training.goal_walk for run in grid} == {0.5, 2, 8}
    assert {run.release for run in grid} == {0.001, 1, 2, 4, 8, 16, 32}
    assert {run.release for run in ring} == {5}
    steered = [navigator.make(model=None) for navigator in {run.navigator for run in grid}]
    assert {(round(np.degrees(each.baseline)), round(np.degrees(each.gain))) for each in steered} == {
        (baseline, gain) for baseline in (0, 45, 90, 135, 180) for gain in (0, 10, 100, 1_000, 10_000, 100_000)
    }
    world, route = runs[0].open_world_and_route()
    assert all(world.field.contains(*run.start(route)[:2]) for run in runs)


def test_distance_from_the_nest_by_hand():
    steps = pd.DataFrame({"goal_m": [5.0, 4.0, 3.0]})
    of_grid = distance_from_nest({"max_steps": 4}, steps)  # it left the world at its third look
    assert of_grid == {"final_m": 3.0, "mean_m": pytest.approx(3.6)}
    ring = pd.DataFrame({"goal_m": np.arange(151.0)})
    of_ring = distance_from_nest({"max_steps": 150}, ring)
    assert of_ring["final_m"] == np.mean(range(121, 151))
    assert [of_ring[f"at_{step}"] for step in (0, 10, 150)] == [0, 10, 150]
    assert len(of_ring) == 2 + 16


def moel_walks(both=1.0, attractive=3.0, spread=1.5, middle=1.0, ends=4.0):
    """Walks of the release test and the grid, in five worlds, at distances that are given."""
    ring = {"both": (both, spread), "attractive": (attractive, 3.0), "repulsive": (9.0, 9.0)}
    common = {"model": "perfect-memory", "mean_m": 2.0, "release_deg": 0.0}
    navigators = {name: text for text, name in MEMORIES.items()}
    rows = []
    for world in range(5):
        where = common | {"place": f"world {world}"}
        for name, finals in ring.items():
            for gaze, final in zip((0.0, 135.0), finals, strict=True):
                rows.append(
                    where
                    | {"navigator": navigators[name], "goal_spread_deg": gaze, "max_steps": 150, "release_m": 5.0, "goal_walk_m": 2.0,
                       "final_m": final, "at_0": 5.0, "at_150": final}
                )  # fmt: skip
        for text, (_, gain) in GRID.items():
            final = ends if gain in (0, 100_000) else middle
            rows.append(
                where
                | {
                    "navigator": text,
                    "goal_spread_deg": 0.0,
                    "max_steps": 320,
                    "release_m": 0.001,
                    "goal_walk_m": 2.0,
                    "final_m": final,
                }
            )
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("changed", "fails"),
    [
        ({}, None),
        ({"both": 2.5}, "stays"),
        ({"attractive": 0.5}, "repulsive-helps"),
        ({"spread": 2.5}, "spread-gaze"),
        ({"ends": 0.5}, "gain-in-the-middle"),
    ],
)
def test_each_claim_of_le_moel_can_fail(changed, fails):
    results = LEMOEL2020.measure(moel_walks(**changed))
    assert holds(LEMOEL2020, results) == {claim.key: claim.key != fails for claim in LEMOEL2020.claims}
    for item in LEMOEL2020.items:
        if item.draw is not None:
            assert item.draw(results.tables[item.table]).axes
