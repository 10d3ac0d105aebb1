"""Two models in four worlds from three starts each, on all cores: how many arrive, and a report to read."""

from pathlib import Path

import pandas as pd

from tussock.navigation.sweeps.report import write_sweep_report
from tussock.navigation.sweeps.spec import read_sweep
from tussock.navigation.sweeps.sweep import run_sweep

SWEEP = """
[fixed]
world = "tiny"
size = "120x25"

[axes]
model = ["perfect-memory", "visual-compass"]
seed = { from = 0, to = 3 }
offset-m = [-0.1, 0.0, 0.1]
"""

if __name__ == "__main__":  # workers read this file, too
    path, out = Path("sweep.toml"), Path("sweep")
    path.write_text(SWEEP)
    run_sweep(read_sweep(path), out)
    print(pd.read_parquet(out / "runs.parquet").groupby("model")["arrived"].mean())
    write_sweep_report(out)
    print("look at", out / "report.html")
