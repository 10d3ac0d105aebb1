"""Two models in four worlds from three starts each, on all cores: the share that arrives, and a report to read."""

from pathlib import Path

import pandas as pd

from tussock import Experiment, Eye, Sweep, run_sweep, write_sweep_report

base, out = Experiment(world="tiny", eye=Eye(width=120, height=25), threads=1), Path("sweep")
axes = {"model": ["perfect-memory", "visual-compass"], "seed": list(range(4)), "start_offset": [-0.1, 0.0, 0.1]}
run_sweep(Sweep.over("Do two models arrive?", base, axes), out)
print(pd.read_parquet(out / "runs.parquet").groupby("model")["arrived"].mean())
write_sweep_report(out)
print("look at", out / "report.html")
