"""Sweep files: any text, any values for any setting, and damaged files."""

import string
from datetime import date

from fuzzing import FOLDER, NUMBERS, answer, damaged, holds, main
from hypothesis import example, given
from hypothesis import strategies as st

from tussock.navigation.experiment_settings import TYPES, experiment_of, settings_of
from tussock.navigation.sweeps.sweep_file import read_sweep

GOOD = b"""title = "a sweep"
[fixed]
world = "tiny"
size = "60x12"
[axes]
model = ["perfect-memory", "infomax units=20"]
seed = { from = 0, to = 3 }
offset-m = [-0.1, 0, 0.1]
learner = [{ encoding = "grey", every = 2 }, { encoding = "sky", every = 3 }]
"""

words = st.sampled_from(
    ["tiny", "rbm", "edges", "cpu", "60x12", "reset", "a.glb", "../x.csv", "m.safetensors", "", "grey | resize 3"]
)
scalars = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.integers(-2, 3)
    | st.floats()
    | words
    | st.dates()
    | st.text(max_size=5)
)
keys = st.sampled_from([*TYPES, "from", "to", "step", "count", "title", "offset-m"])
numbers = st.integers(-3, 3) | st.floats() | st.sampled_from([*NUMBERS, -(2**63), 10**400, 1e308, -1e308, 5e-324])
ranges = st.fixed_dictionaries({"from": numbers, "to": numbers}, optional={"step": numbers, "count": numbers})
values = ranges | st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3), max_leaves=6
)


def toml(value) -> str:
    """A value as TOML has it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        plain = string.ascii_letters + string.digits + " .|=/-_"
        return (
            '"' + "".join(c if c in plain else f"\\U{ord(c):08x}" for c in value if not 0xD800 <= ord(c) < 0xE000) + '"'
        )
    return (
        str(value).lower() if isinstance(value, bool) else value.isoformat() if isinstance(value, date) else str(value)
    )


def runs_of(data: bytes) -> None:
    """A sweep file is refused in one line that names it, or each of its runs is an experiment that follows from its settings."""
    path = FOLDER / "sweep.toml"
    path.write_bytes(data)
    sweep = answer(path, lambda: read_sweep(path))
    if sweep is not None:
        assert len(sweep) > 0
        for run in sweep.experiments[:50]:
            assert experiment_of(settings_of(run)) == run


@holds(150)
@given(damaged([GOOD]))
def damaged_files(data):
    runs_of(data)


@holds(100)
@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda text: text.encode("utf-8", "surrogatepass")))
@example(b"a = " + b"[" * 5000)
def any_bytes(data):
    runs_of(data)


@holds(300)
@given(st.dictionaries(keys, values, max_size=2), st.dictionaries(keys, values, min_size=1, max_size=4))
def any_values(fixed, axes):
    lines = ["[fixed]", *(f"{key} = {toml(value)}" for key, value in fixed.items())]
    lines += ["[axes]", *(f"{key} = {toml(value)}" for key, value in axes.items())]
    runs_of("\n".join(lines).encode())


if __name__ == "__main__":
    main()
