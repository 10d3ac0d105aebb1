"""The figures of the protocols' reports, from tables of walks."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...reports.plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from ..thesis.drawing import GOOD_COLOUR, SOFT_COLOUR, canvas
from .protocol import by_model

COLOURS = (ROUTE_COLOUR, GOOD_COLOUR, PATH_COLOUR, SOFT_COLOUR, CURVE_COLOUR)
MARKS = "osD^v"


def curves(walks: pd.DataFrame, x: str, y: str, xlabel: str, ylabel: str, *, equal: bool = False) -> Figure:
    """The mean of y against x, a line a model, with standard errors. equal: draw where both are equal (x and y in the same unit)."""
    figure, axes = canvas((7.2, 3.4))
    for model, colour, mark in zip(by_model(walks), COLOURS, MARKS, strict=False):
        grouped = walks[walks["model"] == model].groupby(x)[y]
        mean, error = grouped.mean().astype(float), grouped.sem().fillna(0).astype(float)
        axes[0, 0].errorbar(
            mean.index.to_numpy(float),
            mean,
            yerr=error,
            fmt=f"-{mark}",
            color=colour,
            label=model,
            ms=5,
            lw=1.6,
            capsize=2,
        )
    if equal:
        ends = np.array([0.0, walks[x].max()])
        axes[0, 0].plot(ends, ends, ":", color=SOFT_COLOUR, lw=1.2, label="as at the start")
    axes[0, 0].set(xlabel=xlabel, ylabel=ylabel)
    axes[0, 0].set_ylim(bottom=0)
    axes[0, 0].grid(axis="y", color="#00000018")
    axes[0, 0].legend(frameon=False, fontsize=8, ncols=4, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


def boxes(walks: pd.DataFrame, y: str, ylabel: str) -> Figure:
    """Median, quartiles, least and most of y, a box a model."""
    models = by_model(walks)
    figure, axes = canvas((7.2, 3.0))
    drawn = axes[0, 0].boxplot(
        [walks.loc[walks["model"] == model, y].dropna().to_numpy(float) for model in models], whis=(0, 100), widths=0.5,
        patch_artist=True, tick_labels=models, medianprops={"lw": 1.8},
    )  # fmt: skip
    for k, (box, median) in enumerate(zip(drawn["boxes"], drawn["medians"], strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        box.set(facecolor=colour + "33", edgecolor=colour)
        median.set_color(colour)
    axes[0, 0].set_ylabel(ylabel)
    axes[0, 0].set_ylim(bottom=0)
    axes[0, 0].grid(axis="y", color="#00000018")
    return figure
