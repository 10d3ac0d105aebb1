"""
A sweep in Python, with progress
================================

Noise on every turn, in four worlds, on all cores. A sweep that was interrupted goes on where it ended.
"""

from math import radians
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import pandas as pd

from tussock import Experiment, Eye, Sweep, run_sweep

noise = [0, 10, 20, 40]
base = Experiment(world="tiny", eye=Eye(width=120, height=25), threads=1)
axes = {"body__heading_noise": [radians(each) for each in noise], "seed": list(range(4)), "start_offset": [-0.1, 0.1]}
out = Path(mkdtemp()) / "sweep"
run_sweep(Sweep.over("Noise", base, axes), out, progress=lambda done, total: print(f"{done} of {total}", end="\r"))
runs = pd.read_parquet(out / "runs.parquet")
runs.groupby("heading_noise_deg")["mean_deviation_m"].mean().mul(100).plot(marker="o")
plt.xticks(noise)
plt.xlabel("noise on every turn (standard deviation, degrees)")
plt.ylabel("mean distance from the route (cm)")
