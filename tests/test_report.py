"""The replication of the thesis from the command line: its report in a browser, its numbers, and interruptions."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import matplotlib
import pytest
from browser import WIDTHS, in_browser
from commands import Process
from figure_laws import check_figure

from tussock.navigation.cli.main import main
from tussock.navigation.cli.studies import ThesisCommand
from tussock.navigation.reports.drawing import STYLE
from tussock.navigation.studies.thesis.figures import FIGURES
from tussock.navigation.studies.thesis.report import ITEMS
from tussock.navigation.studies.thesis.studies import STUDIES

TINY = ("--quick", "--world", "tiny", "--size", "72x15", "--spacing-m", "0.04")
CLAIMS = {
    "idf-minimum", "visual-compass-near", "error-grows-with-distance", "mean-biased-by-outliers", "error-grows-with-frequency",
    "flat-then-rises-with-resize", "smoothing-helps", "middle-resolution-best", "classifier-accurate", "few-views-work",
    "whole-route-fails", "perfect-memory-beside", "lbfgs-for-few", "adam-for-the-route", "corners-change-faster", "worse-in-corners",
    "more-corner-views-help", "longer-training-helps", "longer-training-broadens", "failures-point-backwards", "narrower-scans-help",
    "full-scan-solved",
}  # fmt: skip


def tussock(*arguments) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "tussock", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def test_every_claim_is_shown_by_one_item():
    claims = [claim for study in STUDIES.values() for claim in study.claims]
    assert {claim.key for claim in claims} == CLAIMS
    for claim in claims:
        assert sum(claim.figure in item.numbers for item in ITEMS) == 1, claim.key
    names = [item.name for item in ITEMS]
    assert len(names) == len(set(names))


@pytest.fixture(scope="module")
def replication(tmp_path_factory) -> Path:
    """A whole replication, interrupted once."""
    out = tmp_path_factory.mktemp("thesis") / "report"
    command = [sys.executable, "-m", "tussock", "replicate", "thesis", *TINY, "--out", str(out), "--json"]
    with Process(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("resolution: done"):
                break
        time.sleep(1)  # into the next study
        process.send_signal(signal.SIGTERM)
        process.communicate()
        assert process.returncode == 143
    assert not (out / "report.html").exists()
    done = tussock("replicate", "thesis", *TINY, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("kept from before") == 4
    assert done.stderr.count("done in") == 4
    assert set(json.loads(done.stdout)["claims"]) == CLAIMS
    return out


@pytest.mark.slow
def test_results_hold_published_and_obtained_numbers(replication):
    text = (replication / "results.json").read_text()
    results = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert set(results["claims"]) == CLAIMS
    studies = results["seeds"]["0"]
    assert list(studies) == list(STUDIES)
    for study in studies.values():
        assert study.keys() == {"published", "obtained", "holds", "tables"}
    assert studies["resolution"]["published"]["sampled"]["median_error_deg"][9] == 25.247
    assert studies["confidence"]["published"]["narrower-scans-help"]["180 degrees, in the conclusion (deg)"] == 17
    for key, claim in results["claims"].items():
        assert claim["obtained"], key
        assert all(
            spread["lowest"] is None or spread["lowest"] <= spread["median"] <= spread["highest"]
            for spread in claim["obtained"].values()
        )
        assert len(claim["holds"]) == 1
    assert studies["corners"]["holds"].keys() == {"corners-change-faster", "worse-in-corners", "more-corner-views-help"}


@pytest.mark.slow
def test_the_page_is_self_contained_and_has_everything(replication):
    page = (replication / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert page.index('id="summary"') < page.index('id="setting"')
    anchors = set(re.findall(r'id="([^"]+)"', page))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= anchors
    for item in ITEMS:
        assert f": {item.title}</h3>".replace("'", "&#39;") in page
    assert {f"claim-{key}" for key in CLAIMS} <= anchors
    assert page.count("data:image/png;base64,") == len(FIGURES)
    figures = sorted(path.name for path in (replication / "figures").iterdir())
    assert len(figures) == 2 * len(FIGURES)
    assert sum(name.endswith(".svg") for name in figures) == len(FIGURES)


@pytest.mark.slow
def test_the_first_screen_counts_the_claims_and_a_quick_run_judges_few(replication):
    page = (replication / "report.html").read_text(encoding="utf-8")
    claims = json.loads((replication / "results.json").read_text())["claims"]
    untested = [key for key, claim in claims.items() if claim["holds"] == [None]]
    assert all(claims[key]["reason"] for key in untested)
    assert len(untested) >= 16
    head = page[: page.index("<dl>")]
    assert re.search(rf"\d+ of {len(CLAIMS)} claims hold", head)
    assert f"{len(untested)} not tested." in head
    assert claims["visual-compass-near"]["effects"][0]["units"] == 12


@pytest.mark.slow
def test_every_figure_can_be_read_and_its_axes_fit_its_data(replication):
    command = ThesisCommand(quick=True, world="tiny", size="72x15", spacing_m=0.04, out=replication)
    runs, data = command.runs(tuple(STUDIES))
    for item in FIGURES:
        assert item.draw is not None
        with matplotlib.rc_context(STYLE):
            check_figure(item.draw(runs[0][item.study], data))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.slow
def test_a_browser_shows_it_without_errors(replication, tmp_path, width):
    shown = in_browser(replication / "report.html", width, tmp_path)
    assert shown == {"width": width, "wide": [], "broken": 0, "small": 0, "images": len(FIGURES)}


@pytest.mark.slow
def test_a_second_run_does_nothing_again_and_changes_no_byte(replication):
    before = {path.name: path.read_bytes() for path in (replication / "results.json", replication / "report.html")}
    done = tussock("replicate", "thesis", *TINY, "--out", replication)
    assert done.returncode == 0
    assert done.stderr.count("kept from before") == len(STUDIES)
    assert {name: (replication / name).read_bytes() for name in before} == before


@pytest.mark.slow
def test_a_report_of_something_else_is_not_replaced(replication, capsys):
    with pytest.raises(SystemExit) as end:
        main(["replicate", "thesis", *TINY, "--seed", "3", "--out", str(replication)])
    assert end.value.code == 2
    assert "holds a report of something else (Seeds)" in capsys.readouterr().err


@pytest.mark.slow
def test_another_study_does_not_replace_a_report(replication, capsys):
    with pytest.raises(SystemExit) as end:
        main(["study", "setting", *TINY, "--out", str(replication)])
    assert end.value.code == 2
    assert "holds a report of something else (Studies)" in capsys.readouterr().err


@pytest.mark.slow
def test_one_figure_alone(replication, tmp_path):
    page = (replication / "report.html").read_text(encoding="utf-8")
    assert (
        "tussock study frequency --figure &#39;14&#39; --world tiny --size 72x15 --spacing-m 0.04 --quick --out figure-14"
        in page
    )
    done = tussock("study", "frequency", "--figure", "14", *TINY, "--out", tmp_path / "one", "--json")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in sorted((tmp_path / "one" / "figures").iterdir())] == [
        "figure-14.png",
        "figure-14.svg",
    ]
    alone, whole = (
        json.loads((folder / "results.json").read_text())["seeds"]["0"]["frequency"]
        for folder in (tmp_path / "one", replication)
    )
    for each in (alone, whole):
        del each["obtained"]["seconds"]
    assert alone == whole


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["study", "nonsense"], "unknown study 'nonsense'; give one of setting"),
        (["study", "setting", "--figure", "99", *TINY], "no figure '99' in this study; it has 4, 5"),
        (["study", "setting", "--grid-database", "g"], "go together"),
        (["study", "setting", "--seeds", "0"], "give at least 1"),
        (["study", "setting", "--grid-database", "g", "--route-database", "r"], "g"),
        (["study", "setting", "--spacing-m", "-1", *TINY[:5]], "spacing -1 m does not fit"),
        (["study", "setting", "--spacing-m", "1", *TINY[:5]], "route views"),
        (["replicate", "thesis", "--out", __file__], "is a file"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]
    assert not (tmp_path / "study" / "report.html").exists()
