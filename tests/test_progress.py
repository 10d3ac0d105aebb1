"""Progress of long work: printed by default, silent on request, and a line now and then where there is no terminal."""

import numpy as np
import pytest

from tussock import no_progress
from tussock.navigation.cli import terminal
from tussock.navigation.encoding import Encoding
from tussock.navigation.evaluation import heading_field
from tussock.navigation.experiment_settings import experiment_of
from tussock.navigation.models import make_model
from tussock.navigation.training import training_views
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world import progress
from tussock.world.progress import PrintedProgress, in_words
from tussock.world.scene import World


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_a_line_comes_after_two_seconds_and_then_every_ten(clock, capsys):
    report = PrintedProgress("walking", "steps")
    printed_at = []
    for second in range(31):
        clock[0] = float(second)
        report(second * 2, 100)
        if capsys.readouterr().err:
            printed_at.append(second)
    assert printed_at == [3, 14, 25]


def test_a_line_says_how_much_how_fast_and_how_long(clock, capsys):
    report = PrintedProgress("walking", "runs")
    report(20, 80)  # as where a sweep goes on
    clock[0] = 10.0
    report(40, 80)
    assert capsys.readouterr().err == "walking: 40 of 80 runs, 2 a second, 20 s left\n"


def test_short_work_says_nothing_unless_its_end_is_wanted(clock, capsys):
    for to_the_end, lines in ((False, 0), (True, 1)):
        report = PrintedProgress("walking", "runs", to_the_end=to_the_end)
        clock[0] += 1.0
        report(1, 2)
        report(2, 2)
        assert len(capsys.readouterr().err.splitlines()) == lines


@pytest.mark.parametrize(("given", "said"), [({}, True), ({"progress": no_progress}, False)])
def test_scripts_hear_of_long_work_unless_they_ask_for_silence(given, said, monkeypatch, capsys):
    monkeypatch.setattr(PrintedProgress, "FIRST", 0.0)
    world, encoding = World.generate("tiny", 2), Encoding.parse("grey | normalise")
    with open_renderer(world, Eye(width=60, height=12), "cpu") as renderer:
        views, _ = training_views(encoding, renderer, np.array([[1.5, 1.5, 0.0]]))
        model = make_model("perfect-memory").fit(views)
        heading_field(model, encoding, renderer, np.full((600, 2), 1.5), **given)
    assert ("looking around: " in capsys.readouterr().err) == said


@pytest.mark.parametrize(("given", "said"), [({}, True), ({"progress": no_progress}, False)])
def test_a_walk_in_a_script_tells_of_learning_and_of_steps(given, said, monkeypatch, capsys):
    monkeypatch.setattr(PrintedProgress, "FIRST", 0.0)
    experiment_of({"world": "tiny", "seed": 2, "size": "60x12", "samples": 1, "encoding": "grey"}).run(**given)
    err = capsys.readouterr().err
    assert ("walking: " in err) == said
    assert ("learning: " in err) == said


def test_each_part_of_a_command_has_its_lines_in_a_pipe(clock, capsys):
    with terminal.progress_of_parts() as report:
        for part in ("learning", "walking"):
            for done in range(3):
                report(part, done, 2)
                clock[0] += 3.0
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "learning: 1 of 2, 0.333 a second, 3 s left",
        "walking: 1 of 2, 0.333 a second, 3 s left",
    ]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0, "0 s"), (89, "89 s"), (90, "2 min"), (5399, "90 min"), (5400, "1.5 h"), (90_000, "25.0 h")],
)
def test_a_duration_is_said_shortly(seconds, words):
    assert in_words(seconds) == words
