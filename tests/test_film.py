"""Films of recorded walks: what they show is what was recorded."""

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from tussock.navigation.experiment import Experiment
from tussock.navigation.recording.film import SIZE, Film, save_film
from tussock.navigation.recording.playback import play
from tussock.navigation.recording.recorded_walk import read_walk
from tussock.navigation.recording.run_folder import record_run
from tussock.render.eye import Eye
from tussock.world.errors import FileError, MissingDependencyError, SettingError


def experiment(navigator: str) -> Experiment:
    return Experiment(
        world="tiny", seed=2, eye=Eye(width=72, height=15), route_length=1.0, start_offset=0.1, navigator=navigator
    )


@pytest.fixture(scope="module", params=["scan", "path-integration"])
def run(request, tmp_path_factory):
    """A recorded run, and the same walk as it was walked."""
    folder = tmp_path_factory.mktemp("film") / "run"
    record_run(experiment(request.param), folder)
    return folder, experiment(request.param).run()


def test_the_walk_is_read_as_it_was_walked(run):
    folder, walk = run
    read = read_walk(folder / "recording.rrd")
    assert read.steps.tolist() == list(range(len(walk)))
    assert np.allclose(read.places, walk.xy, atol=1e-5)
    assert np.allclose(read.deviations, walk.column("deviation_m"))
    turned = np.radians(walk.column("heading_deg")) + np.radians(walk.column("turn_deg"))
    assert np.allclose(read.facing, np.column_stack([np.cos(turned), np.sin(turned)]), atol=1e-5)
    assert set(read.views) == set(range(len(walk)))
    assert read.views[0].shape == (15, 72, 3)
    assert len(read.familiarity) == sum(looks > 1 for looks in walk.column("looks"))
    assert np.allclose(np.array(experiment("scan").open_world_and_route()[1].xy), read.route, atol=1e-5)


def test_the_green_line_is_at_the_most_familiar_heading(run):
    read = read_walk(run[0] / "recording.rrd")
    drawn = Film.of(read)
    for number in sorted(read.familiarity)[1:]:  # of path integration none
        turn = drawn.turn(number)
        within = np.abs(read.degrees) <= 90  # the scan's window
        best = read.degrees[within][read.familiarity[number][within].argmax()]
        assert turn is not None
        assert abs(turn - best) <= 360 / 72  # a column; the turn is to the peak between columns


def test_a_film_has_a_frame_for_each_step(run, tmp_path):
    folder, walk = run
    done: list[tuple[int, int]] = []
    for name in ("walk.mp4", "walk.gif"):
        steps = save_film(
            folder / "recording.rrd", tmp_path / name, steps_per_second=5, progress=lambda *at: done.append(at)
        )
        assert steps == len(walk)
    assert done[-1] == (len(walk), len(walk))
    frames, _ = imageio_ffmpeg.count_frames_and_secs(tmp_path / "walk.mp4")
    assert frames == len(walk) + 5
    with Image.open(tmp_path / "walk.gif") as film:
        assert film.n_frames <= len(walk) + 5  # equal ones at the end are one
        assert film.size == (SIZE[0] // 2, SIZE[1] // 2)
    assert {path.name for path in tmp_path.iterdir()} == {"walk.mp4", "walk.gif"}


def test_the_path_grows_from_frame_to_frame(run):
    drawn = Film.of(read_walk(run[0] / "recording.rrd"))
    first, last = drawn.frame(0), drawn.frame(len(run[1]) - 1)
    red = [int(((image[:, :720] == (235, 60, 50)).all(axis=2)).sum()) for image in (first, last)]
    assert red[1] > red[0] > 0


def test_no_line_is_drawn_where_the_agent_was_carried(tmp_path):
    carried = experiment("scan").replace(displacement__left=0.3, displacement__at=0.5)
    record_run(carried, tmp_path / "run")
    read = read_walk(tmp_path / "run" / "recording.rrd")
    moved = [k for k, displaced in enumerate(carried.run().column("displaced")) if displaced]
    assert np.flatnonzero(~read.walked).tolist() == [0, *moved]
    assert Film.of(read).turn(moved[0]) is None


def test_a_very_flat_eye_is_filmed(tmp_path):
    flat = experiment("scan").replace(eye=Eye(width=1440, height=1), encoding="grey | resize 20", route_length=0.5)
    record_run(flat, tmp_path / "run")
    save_film(tmp_path / "run" / "recording.rrd", tmp_path / "walk.gif")


def test_wrong_names_and_files_are_refused(run, tmp_path, monkeypatch):
    recording = run[0] / "recording.rrd"
    with pytest.raises(FileError, match=r"\.mp4 or \.gif"):
        save_film(recording, tmp_path / "walk.avi")
    with pytest.raises(SettingError, match="speed"):
        save_film(recording, tmp_path / "walk.gif", steps_per_second=0)
    with pytest.raises(SettingError, match="one of them"):
        play(run[0], web=True, video=tmp_path / "walk.gif")
    (tmp_path / "other.rrd").write_bytes(b"no recording")
    with pytest.raises(FileError, match=r"other\.rrd is not a recording"):
        save_film(tmp_path / "other.rrd", tmp_path / "walk.gif")
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingDependencyError, match="pip install imageio-ffmpeg"):
        save_film(recording, tmp_path / "walk.mp4")
    assert {path.name for path in tmp_path.iterdir()} == {"other.rrd"}
