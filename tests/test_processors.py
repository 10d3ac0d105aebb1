"""The same decisions on every processor: what libraries compute differently on others changes no step of a walk."""

import os
import subprocess
import sys

import pytest
from processors import LIBRARIES, SETTINGS

# The first walks of the test bed, and a digest of their poses.
WALKS = """
import hashlib, sys
from tussock.navigation.benchmark import QUICK

model, count, threads = sys.argv[1:]
poses = hashlib.sha256()
for run in QUICK.sweep(model).experiments[: int(count)]:
    walk = run.replace(threads=int(threads)).run()
    poses.update(repr([walk.column(name) for name in ("x_m", "y_m", "heading_deg")]).encode())
print(poses.hexdigest())
"""


def digest(model: str, count: int, threads: int = 1, **settings: str) -> str:
    arguments = [sys.executable, "-c", WALKS, model, str(count), str(threads)]
    done = subprocess.run(arguments, env=os.environ | settings, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()[-1]


@pytest.mark.slow
@pytest.mark.parametrize("model", ["perfect-memory", "chain"])
def test_older_instructions_change_no_step(model):
    assert digest(model, 1, 2, **LIBRARIES) == digest(model, 1)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["perfect-memory", "chain"])
def test_no_setting_of_the_processor_changes_a_step_of_the_test_bed(model):
    expected = digest(model, 4)
    differing = [name for name, settings in SETTINGS.items() if digest(model, 4, **settings) != expected]
    assert differing == []
    assert digest(model, 4, threads=2) == expected
