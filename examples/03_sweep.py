"""Two models in four worlds from three starts each, on all cores: the share that arrives, and a report to read."""

from pathlib import Path

import pandas as pd

from tussock import Experiment, Eye
from tussock.navigation.sweeps.report import write_sweep_report
from tussock.navigation.sweeps.spec import Sweep
from tussock.navigation.sweeps.sweep import run_sweep

AXES = {
    "model": [{"model": name} for name in ("perfect-memory", "visual-compass")],
    "seed": [{"seed": seed} for seed in range(4)],
    "offset_m": [{"start_offset": offset} for offset in (-0.1, 0.0, 0.1)],
}

if __name__ == "__main__":  # the workers import this file
    base, out = Experiment(world="tiny", eye=Eye(width=120, height=25), threads=1), Path("sweep")
    run_sweep(Sweep.over("Do two models arrive?", base, AXES), out)
    print(pd.read_parquet(out / "runs.parquet").groupby("model")["arrived"].mean())
    write_sweep_report(out)
    print("look at", out / "report.html")
