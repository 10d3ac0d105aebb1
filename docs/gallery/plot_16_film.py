"""
A film of a walk
================

A recorded walk becomes a film: the map with the path, what the agent sees, and the heading that it turns to. Name it ``walk.mp4``
instead for a smaller file (it needs the package imageio-ffmpeg). In a terminal: ``tussock play RUN --video walk.mp4``. Three moments
of the film are shown here.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
from PIL import Image

from tussock import Experiment, record_run, save_film

walk = Experiment(world="tiny", seed=2, route_length=2.0, start_offset=0.1)
run = Path(mkdtemp()) / "run"
record_run(walk, run)
steps = save_film(run / "recording.rrd", run / "walk.gif", steps_per_second=20)
figure, panels = plt.subplots(3, figsize=(8, 13.5), layout="constrained")
with Image.open(run / "walk.gif") as film:
    for panel, step in zip(panels, (0, steps // 2, steps - 1), strict=True):
        film.seek(step)
        panel.imshow(film.convert("RGB"))
        panel.set_axis_off()
