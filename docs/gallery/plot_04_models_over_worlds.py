"""
Three models in six worlds
==========================

A sweep on all cores: each model walks in each world from three starts. Intervals are over worlds.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import pandas as pd

from tussock import Experiment, Eye, Sweep, run_sweep
from tussock.navigation.intervals import share_interval

base = Experiment(world="tiny", eye=Eye(width=120, height=25), threads=1)
axes = {
    "model": ["perfect-memory", "infomax", "random"],
    "seed": list(range(6)),
    "start_offset": [-0.1, 0.0, 0.1],
}
out = Path(mkdtemp()) / "sweep"
run_sweep(Sweep.over("Three models", base, axes), out)
runs = pd.read_parquet(out / "runs.parquet")
for model, of_model in runs.groupby("model", sort=False):
    share = share_interval(of_model["arrived"].to_numpy(float), of_model["seed"].to_numpy())
    plt.plot(model, share.value, "o")
    plt.vlines(model, share.low, share.high)
plt.ylim(-0.05, 1.05)
plt.ylabel("share of walks that arrive, 95 % interval over worlds")
