"""Numbers and words that people give: eyes, poses, routes, parameters of worlds, and the command line."""

import contextlib
import dataclasses
import io
import os

import attrs
import numpy as np
from fuzzing import FOLDER, VALUES, answer, holds, main
from hypothesis import example, given
from hypothesis import strategies as st
from scenes import random_world

from tussock.navigation.cli.main import main as tussock
from tussock.render import Eye, open_renderer
from tussock.world.geometry import Route
from tussock.world.params import WorldParams
from tussock.world.routes import generate_route
from tussock.world.scene import World

odd = (
    st.floats()
    | st.integers()
    | st.sampled_from([0, -0.0, 1, 4, 90.5, 1e-300, 5e-324, 1e7, 1e18, 1e30, 1e300, 2**31, 2**62, None, "x", True])
)


@holds(120)
@given(st.dictionaries(st.sampled_from([field.name for field in attrs.fields(Eye)]), odd))
def eyes(numbers):
    eye = answer(None, lambda: Eye(**numbers))
    if eye is not None and eye.width * eye.height < 10**6:
        assert np.isfinite(eye.elevations(eye.rays)).all()


WORLD = random_world(1)
RENDERERS = [
    open_renderer(WORLD, Eye(width=16, height=6, samples=samples, z=z, top=top, bottom=-top), "cpu")
    for samples, z, top in ((1, 0.01, 1.0), (2, 0.0, np.pi / 2), (1, float(WORLD.triangles[5, 1, 2]), 1e-9))
]
on_corners = st.sampled_from(WORLD.triangles[:, :, :2].reshape(-1, 2).astype(float).tolist())
on_edges = st.sampled_from(WORLD.triangles[:, :2, :2].astype(float).mean(axis=1).tolist())
inside = st.sampled_from(WORLD.triangles[:, :, :2].astype(float).mean(axis=1).tolist())
places = on_corners | on_edges | inside | st.sampled_from([[3.0, 3.0], [-3.0, 0.0], [0.0, 0.0]])
poses = st.lists(
    st.tuples(places, st.floats() | st.floats(-9, 9)).map(lambda at: [*at[0], at[1]])
    | st.lists(odd, min_size=3, max_size=3),
    max_size=4,
)


@holds(160)
@given(poses | st.lists(st.lists(odd, max_size=4), max_size=4) | VALUES, st.sampled_from(RENDERERS))
@example([[1e30, 0, 0]], RENDERERS[0])
@example([[0, 0, 1e300]], RENDERERS[0])
@example([[1e7, -1e7, 1e7]], RENDERERS[1])
def views(at, renderer):
    views = answer(None, lambda: renderer.render(at))
    if views is not None:
        assert views.shape[1:] == (6, 16, 4)
        assert np.array_equal(views, np.concatenate([renderer.render([pose]) for pose in at] or [views]))


@holds(120)
@given(st.lists(st.lists(odd, max_size=4), max_size=5) | poses, odd)
def routes(points, spacing):
    try:
        points = np.array(points, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return  # no array
    route = answer(None, lambda: Route(points))
    answer(None, lambda: Route.through(points[..., :2]))
    if route is not None and isinstance(spacing, int | float):
        assert np.isfinite(route.length)
        if route.length < 1e4 or not 0 < spacing < 1:
            answer(None, lambda: route.resampled(spacing))


@holds(120)
@given(st.dictionaries(st.sampled_from(list(WorldParams().to_dict())), VALUES))
def parameters(values):
    params = answer(None, lambda: WorldParams(**values))
    assert params is None or WorldParams(**params.to_dict()) == params


TINY = World.generate("tiny", 0)
small = st.sampled_from([0.5, 1.0, 2.0]) | odd.filter(lambda length: isinstance(length, int | float))


@holds(15)
@given(odd, small, st.none() | st.tuples(odd.filter(lambda x: isinstance(x, int | float)), st.floats(0, 3)))
def generated_routes(seed, length, goal):
    answer(None, lambda: generate_route(TINY, seed, length, goal))


@holds(15)
@given(st.floats(0, 1e7), st.floats(0, 1e7))
@example(1e7, 1e7)
@example(0.0, 0.0)
def routes_in_fields(width, depth):
    field = TINY.field._replace(x_max=TINY.field.x_min + width, y_max=TINY.field.y_min + depth)
    if width * depth < 25 or width * depth > 1e5:
        answer(None, lambda: generate_route(dataclasses.replace(TINY, field=field), 0, 0.5))


texts = st.text(max_size=8) | st.sampled_from(
    ["nan", "inf", "-inf", "1e300", "-1", "0", "1e-300", "1,1", "nan,nan", "1,1,nan", "1e308,1,1", "4x1", "8x3", "0x0", "²x³", "٣x٤",
     "99999x99999", "1x", "9" * 5000, "9" * 5000 + "x1", "a" * 5000, "\ud800", "tiny", "/", ".", "", "-", "--", "x.glb", "é.csv", "true"]
)  # fmt: skip
FLAGS = {
    "view": ["--seed", "--size", "--renderer", "--samples", "--eye-height-m", "--top-deg", "--bottom-deg", "--at", "--out", "--world"],
    "route": ["--seed", "--route-seed", "--length-m", "--goal", "--out", "--world", "--picture"],
    "world": ["--seed", "--preset", "--out"],
    "evaluate": ["--spacing-m", "--every", "--learning-walk-m", "--blur", "--resize", "--encoding", "--model", "--device", "--grid-m",
                 "--within-m", "--scan-deg", "--size", "--route"],
    "run": ["--step-m", "--offset-m", "--heading-noise-deg", "--scan-deg", "--scan-about-deg", "--on-lost", "--arrive-m", "--lost-m",
            "--patience-m", "--max-steps", "--seed"],
    "train": ["--out", "--model", "--size"],
    "compare": ["--models", "--offset-m"],
    "database grid": ["--spacing-m", "--from-m", "--to-m", "--size", "--out"],
    "database route": ["--spacing-m", "--route", "--out"],
    "database check": [""],
    "play": ["", "--screenshot"],
    "nonsense": [""],
}  # fmt: skip
(FOLDER / "r.csv").write_text("x_m,y_m\n0.5,0.5\n1,0.5\n")
QUICK = {
    "world": ["--out", "w.glb", "--preset", "tiny"], "view": ["--world", "tiny", "--size", "8x3"],
    "route": ["--world", "tiny", "--length-m", "1"],
    "run": ["--world", "tiny", "--size", "16x4", "--route", "r.csv", "--spacing-m", "0.2", "--overwrite", "--max-steps", "2"],
    "database grid": ["--out", "g", "--size", "8x3", "--world", "tiny", "--spacing-m", "2"],
    "database route": ["--out", "d", "--size", "8x3", "--world", "tiny", "--route", "r.csv", "--spacing-m", "0.3"],
}  # fmt: skip
LEARN = [
    "--world",
    "tiny",
    "--size",
    "16x4",
    "--route",
    "r.csv",
    "--spacing-m",
    "0.2",
    "--encoding",
    "grey",
    "--resize",
    "1",
]


@holds(24)
@given(st.sampled_from(list(FLAGS)).flatmap(lambda command: st.tuples(
    st.just(command), st.dictionaries(st.sampled_from(FLAGS[command]), texts, min_size=1, max_size=2))))  # fmt: skip
def command_line(found):
    command, flags = found
    given_ = [word for flag, text in flags.items() for word in ([flag, text] if flag else [text])]
    if any("9" * 99 in text or "99999" in text for text in flags.values()) and command in ("compare", "train"):
        return
    os.chdir(FOLDER)
    for name in ("g", "d"):
        if not os.path.islink(name) and os.path.isdir(name):
            for file in os.listdir(name):
                os.unlink(os.path.join(name, file))
    said = io.StringIO()
    code = 0
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            tussock(
                [
                    *command.split(),
                    *QUICK.get(command, LEARN if command in ("evaluate", "train", "compare") else []),
                    *given_,
                ]
            )
        except SystemExit as stop:
            code = stop.code or 0
    assert code in (0, 1, 2), said.getvalue()
    assert "Traceback" not in said.getvalue()


if __name__ == "__main__":
    main()
