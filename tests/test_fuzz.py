"""Nothing that people can give breaks anything: see fuzzing.py. Here every property is tried a little, the same in each run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
GENEROUS = 600  # seconds; only what hangs takes so long


@pytest.mark.parametrize("file", ["fuzz_files", "fuzz_databases"])
def test_anything_is_used_or_refused(file):
    paths = os.pathsep.join([str(HERE.parent), str(HERE), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", str(HERE / f"{file}.py")],
        env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, errors="replace", timeout=GENEROUS,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr[-5000:]
    assert "holds" in run.stdout
