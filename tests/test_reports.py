"""Reports as data: results on disk, claims over several runs, and what write_report leaves in a folder."""

import gc
import json
import math
import subprocess
import sys
import weakref
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from browser import WIDTHS, in_browser
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tussock.navigation.reports.claims import Claim, Decision, Spread, check_claims, count_outcomes
from tussock.navigation.reports.drawing import canvas
from tussock.navigation.reports.effects import MIN_UNITS, effect_size
from tussock.navigation.reports.maps import draw_map, map_axes
from tussock.navigation.reports.page import format_effects, format_spread, format_value
from tussock.navigation.reports.report import (
    Bullets,
    Cell,
    ClaimBox,
    ClaimTable,
    Command,
    Drawing,
    Report,
    Section,
    Table,
    Text,
    check_report_folder,
    write_report,
)
from tussock.navigation.reports.results import StudyResults, plain_json, read_results, write_results
from tussock.world.errors import FileError, SettingError
from tussock.world.scene import World

# Results on disk


def example() -> StudyResults:
    table = pd.DataFrame(
        {
            "x": [1, 2],
            "y": [0.1, float("nan")],
            "none": [float("nan")] * 2,
            "name": ["a", "b"],
            "yes": [True, False],
        }
    )
    return StudyResults(tables={"t": table}, numbers={"n": np.float64(0.1), "nan": math.nan, "several": (1, 2)})


def test_results_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "f.json"
    write_results(example(), path, "key")
    results = read_results(path, "key")
    assert results is not None
    pd.testing.assert_frame_equal(results.tables["t"], example().tables["t"])
    assert math.isnan(results.numbers.pop("nan"))
    assert results.numbers == {"n": 0.1, "several": [1, 2]}
    assert read_results(path, "another key") is None
    assert read_results(tmp_path / "missing.json", "key") is None


def test_results_of_earlier_versions_with_claims_in_them_can_be_read():
    saved = example().to_json() | {"claims": [{"key": "k", "holds": True}]}
    assert StudyResults.from_json(saved).numbers["n"] == 0.1


@pytest.mark.parametrize("damage", ["cut", "digit", "empty", "binary", "another shape"])
def test_damaged_results_are_noticed(tmp_path, damage):
    path = tmp_path / "f.json"
    write_results(example(), path, "key")
    whole = path.read_bytes()
    damaged = {
        "cut": whole[:-40],
        "digit": whole.replace(b"0.1", b"0.2"),
        "empty": b"",
        "binary": b"\xff\x00" * 9,
        "another shape": b"[1]",
    }
    path.write_bytes(damaged[damage])
    with pytest.raises(ValueError):  # noqa: PT011 (the message is that of the reader, whichever it is)
        read_results(path, "key")


def test_plain_json_has_no_nan_and_no_numpy():
    value = plain_json({"a": np.float32(1.5), "b": [float("nan"), np.int64(2)], "c": (float("inf"), True)})
    assert json.loads(json.dumps(value, allow_nan=False)) == {"a": 1.5, "b": [None, 2], "c": [None, True]}


# Claims


def claim(**changes) -> Claim:
    """A claim that the number x is at least 0.5; nan is not tested."""

    def decide(results: StudyResults) -> Decision:
        x = results.numbers["x"]
        return Decision({"x (deg)": x}, None if math.isnan(x) else x >= 0.5)

    texts = {"key": "large", "statement": "x is large.", "figure": "7", "test": "x is at least 0.5", "note": "A note."}
    return Claim(**texts | {"decide": decide, "published": {"x (deg)": 1.0}} | changes)


def outcome(*numbers: float, **changes):
    runs = [StudyResults(tables={}, numbers={"x": x}) for x in numbers]
    (result,) = check_claims([claim(**changes)], runs)
    return result


@pytest.mark.parametrize(
    ("numbers", "label", "style"),
    [
        ([1.0], "holds", "yes"),
        ([0.0], "does not hold", "no"),
        ([math.nan], "not tested", "untested"),
        ([math.nan, math.nan], "not tested", "untested"),
        ([1.0, 1.0], "holds in 2 of 2", "yes"),
        ([1.0, 0.0, math.nan], "holds in 1 of 2", "partly"),
        ([0.0, 0.0], "holds in none of 2", "no"),
        ([1.0, math.nan], "holds in 1 of 1", "yes"),
    ],
)
def test_labels_of_outcomes(numbers, label, style):
    assert (outcome(*numbers).label, outcome(*numbers).style) == (label, style)


@given(st.lists(st.floats(-1e6, 1e6) | st.just(math.nan), min_size=1, max_size=9))
def test_spreads_are_those_of_numpy(numbers):
    spread = outcome(*numbers).spreads["x (deg)"]
    known = [x for x in numbers if not math.isnan(x)]
    if known:
        assert np.allclose(spread, (np.median(known), min(known), max(known)))
    else:
        assert np.isnan(spread).all()


def test_published_numbers_may_depend_on_what_was_run():
    result = outcome(3.0, published=lambda results: {"x (deg)": 2 * results.numbers["x"]})
    assert result.rows == [("x (deg)", 6.0, Spread(3, 3, 3))]


def test_rows_have_every_label_once():
    result = outcome(1.0, published={"x (deg)": 4.0, "y": 5.0})
    assert result.rows == [("x (deg)", 4.0, Spread(1, 1, 1)), ("y", 5.0, None)]


def with_effect(units: int) -> Claim:
    """A claim that holds, with the mean of `units` numbers as its effect."""

    def decide(results: StudyResults) -> Decision:
        return Decision({"x": 1.0}, True, effect_size("mean", units, lambda rows: float(rows.mean()), of="routes"))

    return claim(decide=decide)


@pytest.mark.parametrize(
    ("results", "text"),
    [
        ([[1.0]] * 16 + [[0.0]] * 4 + [[math.nan]] * 2, "16 of 22 claims hold, 4 do not, 2 not tested"),
        ([[1.0], [0.0]], "1 of 2 claims holds, 1 does not"),
        ([[math.nan]], "none of 1 claims was tested"),
        (
            [[1.0, 1.0], [1.0, 0.0], [0.0, 0.0], [math.nan] * 2],
            "1 of 4 claims holds in all 2 runs, 1 in some, 1 in none, 1 not tested",
        ),
    ],
)
def test_outcomes_are_counted(results, text):
    assert count_outcomes([outcome(*numbers) for numbers in results]) == text


def test_a_quick_run_judges_only_what_it_can_test():
    runs = [StudyResults(tables={}, numbers={"x": 1.0})]
    cannot, can = check_claims([claim(not_quick="it is too short"), claim()], runs, quick=True)
    assert (cannot.label, cannot.style, cannot.reason) == ("not tested", "untested", "it is too short")
    assert cannot.obtained == [{"x (deg)": 1.0}]
    assert (can.label, can.reason) == ("holds", "")
    (whole,) = check_claims([claim(not_quick="it is too short")], runs)
    assert (whole.label, whole.reason) == ("holds", "")


@pytest.mark.parametrize(("units", "label"), [(MIN_UNITS - 1, "not tested"), (MIN_UNITS, "holds")])
def test_few_units_are_no_test_where_one_is_asked_for(units, label):
    runs = [StudyResults(tables={}, numbers={})]
    (result,) = check_claims([with_effect(units)], runs, few_units=False)
    assert result.label == label
    assert ("4 routes; the test needs 5" in result.reason) == (label == "not tested")
    assert check_claims([with_effect(units)], runs)[0].label == "holds"


# Effects


@pytest.mark.parametrize("units", [8, 15, 400])
def test_the_interval_of_an_effect_is_that_of_the_textbook(units):
    values = 3 + 2 * stats.norm.ppf((np.arange(units) + 0.5) / units)
    effect = effect_size("mean", units, lambda rows: float(values[rows].mean()), of="positions")
    assert effect.value == pytest.approx(3)
    half = stats.t.ppf(0.975, units - 1) * stats.sem(values)
    assert np.allclose([effect.low, effect.high], [effect.value - half, effect.value + half], atol=0.12 * half)


def test_there_is_no_interval_of_few_or_equal_units():
    for units, values in ((0, []), (4, [1.0, 2, 3, 4]), (9, [1.0] * 9)):
        numbers = np.array(values)
        effect = effect_size("mean", units, lambda rows, numbers=numbers: float(numbers[rows].mean()), of="routes")
        assert np.isnan([effect.low, effect.high]).all()
        assert np.isnan(effect.value) == (units == 0)


@pytest.mark.parametrize(
    ("units", "text"),
    [(4, "mean: 1.5 (4 routes: no interval)"), (9, "mean: 4 (1.69 to 5.98; 9 routes)")],
)
def test_effects_as_text(units, text):
    (result,) = check_claims([with_effect(units)], [StudyResults(tables={}, numbers={})])
    assert format_effects(result) == text
    assert result.evidence["effects"][0]["units"] == units


# Pages


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.5, "0.5"), (12.0, "12"), (110.4, "110"), (float("nan"), "–"), (True, "yes"), (None, "–"), ([20, 20], "20, 20")],
)
def test_values_as_text(value, text):
    assert format_value(value) == text


@pytest.mark.parametrize(
    ("spread", "text"),
    [(Spread(1, 1, 1), "1"), (Spread(2, 1, 3), "2 (1 to 3)"), (Spread(*[math.nan] * 3), "–"), (None, "–")],
)
def test_spreads_as_text(spread, text):
    assert format_spread(spread) == text


def report(draw, **changes) -> Report:
    """A report with a block of every kind."""
    result = outcome(1.0)
    shown = [
        Drawing(names=("curve", "view"), draw=draw, alt="a curve", caption="A caption."),
        ClaimBox(result),
        Command("tussock study <x>"),
    ]
    table = Table(columns=["a", "b"], rows=[["1 < 2", Cell(text="3", note="(2 to 4)", bold=True)]], caption="A table.")
    blocks = [
        Section(
            title="Summary",
            anchor="summary",
            blocks=[ClaimTable(outcomes=[result], links={"large": ("fig", "Figure 7")})],
        ),
        Section(title="Part", anchor="part", blocks=[Section(title="Fig", anchor="fig", blocks=shown)]),
        table,
        Text("Some text", anchor="text"),
        Bullets(["first", "second"]),
    ]
    fields = {
        "title": "T & Co",
        "lead": "Lead.",
        "about": {"World": "w"},
        "footer": "The end.",
        "results": {"n": math.nan},
    }
    return Report(**fields | {"blocks": blocks} | changes)


def draw_two():
    for _ in range(2):
        figure, axes = canvas((2, 1))
        axes[0, 0].plot([0, 1])
        yield figure


def test_a_report_has_figures_json_and_one_page(tmp_path):
    done = []
    results = write_report(report(draw_two), tmp_path, lambda *numbers: done.append(numbers))
    assert results == json.loads((tmp_path / "results.json").read_text()) == {"n": None}
    names = ["curve.png", "curve.svg", "view.png", "view.svg"]
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == names
    assert done == [(0, 1)]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 2
    for text in (
        "<h1>T &amp; Co</h1>",
        "<h2>Part</h2>",
        "<h3>Fig</h3>",
        "1 &lt; 2",
        "tussock study &lt;x&gt;",
        "x (°)",
    ):
        assert text in page
    for text in ("A caption.", "A table.", "x is large.", "Test: x is at least 0.5. A note.", "Figure 7", "The end."):
        assert text in page
    for anchor in ("summary", "part", "fig", "text", "claim-large"):
        assert page.count(f'id="{anchor}"') == 1


def test_the_main_result_is_on_the_first_screen(tmp_path):
    write_report(report(draw_two, headline="15 of 30 arrived."), tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.index("<h1>") < page.index("15 of 30 arrived.") < page.index("<dl>")


def draw_wide():
    for _ in range(2):
        figure, axes = canvas()
        axes[0, 0].plot([0, 1])
        yield figure


def test_a_tap_shows_figures_at_their_full_size_on_a_telephone(tmp_path):
    write_report(report(draw_wide), tmp_path)
    page, tapped = tmp_path / "report.html", tmp_path / "tapped.html"
    tap = """<script>addEventListener("load", () => document.querySelectorAll(".image").forEach(each => each.click()));</script>"""
    tapped.write_text(page.read_text(encoding="utf-8").replace("</body>", f"{tap}</body>"), encoding="utf-8")
    assert in_browser(page, WIDTHS[0], tmp_path)["wide"] == []
    assert set(in_browser(tapped, WIDTHS[0], tmp_path)["wide"]) == {"IMG."}
    assert in_browser(tapped, WIDTHS[1], tmp_path)["wide"] == []


def test_the_same_report_has_the_same_bytes(tmp_path):
    for folder in ("a", "b"):
        write_report(report(draw_two), tmp_path / folder)
    for path in (tmp_path / "a").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes(), path


def test_drawing_leaves_the_style_of_matplotlib_as_it_was(tmp_path):
    before = dict(matplotlib.rcParams)
    write_report(report(draw_two), tmp_path)
    assert dict(matplotlib.rcParams) == before
    imports = "import tussock.navigation.reports.report, tussock.navigation.reports.maps"
    script = f"import matplotlib as m; before = dict(m.rcParams); {imports}; assert dict(m.rcParams) == before"
    subprocess.run([sys.executable, "-c", script], check=True)


def test_maps_keep_no_world_in_memory():
    world = World.generate("tiny", 1)
    alive = weakref.ref(world)
    xy = np.array([(0.0, 0.0), (1.0, 1.0)])
    figure, axes = map_axes(xy)
    draw_map(axes[0, 0], world, xy)
    assert axes[0, 0].images
    del figure, axes, world
    gc.collect()
    assert alive() is None


def test_a_page_has_the_reason_in_place_of_figures_that_cannot_be_drawn(tmp_path):
    def draw():
        raise SettingError("there is no world 'gone.glb'")

    write_report(report(draw), tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "There is no figure: there is no world &#39;gone.glb&#39;." in page
    assert "data:image" not in page


def test_a_report_that_fails_leaves_no_page(tmp_path):
    def draw():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write_report(report(draw), tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_a_folder_with_another_report_is_refused(tmp_path):
    about = {"World": "w", "Seed": 1}
    check_report_folder(tmp_path / "new", about)
    write_report(report(draw_two, results={"about": about}), tmp_path)
    check_report_folder(tmp_path, about)
    with pytest.raises(FileError, match=r"something else \(Seed\)"):
        check_report_folder(tmp_path, about | {"Seed": 2})
    check_report_folder(tmp_path, about | {"Seed": 2}, overwrite=True)
    (tmp_path / "results.json").write_text("damaged")
    with pytest.raises(FileError, match=r"something else \(World, Seed\)"):
        check_report_folder(tmp_path, about)
    with pytest.raises(FileError, match="is a file"):
        check_report_folder(Path(__file__), about)
