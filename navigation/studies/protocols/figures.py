"""Figures of tables of walks, one line or box per model."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...intervals import positive_interval
from ...reports.drawing import (
    CURVE_COLOUR,
    GOOD_COLOUR,
    PATH_COLOUR,
    ROUTE_COLOUR,
    SOFT_COLOUR,
    canvas,
    empty_figure,
    from_zero,
    legend_above,
)
from ...sweeps.model_colours import model_colour, model_markers
from .protocol import Item, models_in

COLOURS = (ROUTE_COLOUR, GOOD_COLOUR, PATH_COLOUR, SOFT_COLOUR, CURVE_COLOUR)
MAX_TICKS = 8  # at the values themselves
MAX_COLUMNS = 3  # of heat maps


def lines_by_model(walks: pd.DataFrame, x: str, y: str, xlabel: str, ylabel: str, *, diagonal: bool = False) -> Figure:
    """The mean of one column against another, one line per model, with intervals over routes.

    Args:
        walks: One walk per row, with the columns "model" and "place".
        x: Column of the horizontal axis.
        y: Column of the vertical axis, which is never negative.
        xlabel: Label of the horizontal axis.
        ylabel: Label of the vertical axis.
        diagonal: Also draw where x equals y, which are then in one unit.

    Returns:
        The figure.
    """
    figure, axes = canvas((7.2, 3.4))
    axis = axes[0, 0]
    models = models_in(walks)
    for model, marker in zip(models, model_markers(models), strict=True):
        grouped = walks[(walks["model"] == model) & walks[y].notna()].groupby(x)
        found = {at: positive_interval(each[y].to_numpy(float), pd.factorize(each["place"])[0]) for at, each in grouped}
        mean, low, high = np.array([(each.value, each.low, each.high) for each in found.values()]).reshape(-1, 3).T
        style = {"fmt": f"-{marker}", "color": model_colour(model), "label": model}
        axis.errorbar(list(found), mean, yerr=[mean - low, high - mean], ms=5, lw=1.6, capsize=2, **style)
    if diagonal:
        ends = np.array([0.0, walks[x].max()])
        axis.plot(ends, ends, ":", color=SOFT_COLOUR, lw=1.2, label="as at the start")
    axis.set(xlabel=xlabel, ylabel=ylabel)
    if len(values := walks[x].dropna().unique()) <= MAX_TICKS:
        axis.set_xticks(np.sort(values))
    from_zero(axis)
    axis.grid(axis="y", color="#00000018")
    legend_above(axis)
    return figure


def boxes_by_model(walks: pd.DataFrame, y: str, ylabel: str) -> Figure:
    """Median, quartiles, lowest and highest value of a column, one box per model. walks: one walk per row."""
    models = models_in(walks)
    figure, axes = canvas((7.2, 3.0))
    axis = axes[0, 0]
    drawn = axis.boxplot(
        [walks.loc[walks["model"] == model, y].dropna().to_numpy(float) for model in models],
        whis=(0, 100),
        widths=0.5,
        patch_artist=True,
        tick_labels=models,
        medianprops={"lw": 1.8},
    )
    for model, box, middle in zip(models, drawn["boxes"], drawn["medians"], strict=True):
        colour = model_colour(model)
        box.set(facecolor=colour + "33", edgecolor=colour)
        middle.set_color(colour)
    axis.set_ylabel(ylabel)
    from_zero(axis)
    axis.grid(axis="y", color="#00000018")
    return figure


def means_by_model(intervals: pd.DataFrame, measure: str, label: str) -> Figure:
    """Means with their intervals, one bar per model; where most values are equal, as counts of rare events, boxes would show nothing.

    Args:
        intervals: A table of `intervals`.
        measure: One of its measures.
        label: Of the axis.
    """
    table = intervals[intervals["measure"] == measure].astype({"mean": float, "low": float, "high": float})
    figure, axes = canvas((7.2, 0.8 + 0.34 * len(table)))
    axis, places = axes[0, 0], np.arange(len(table))[::-1]
    ends = [table["mean"] - table["low"], table["high"] - table["mean"]]
    axis.barh(
        places,
        table["mean"],
        height=0.6,
        xerr=ends,
        color=[model_colour(each) + "55" for each in table["model"]],
        error_kw={"capsize": 2},
    )
    axis.set(yticks=places, yticklabels=table["model"], xlabel=label, ylim=(-0.55, len(table) - 0.45))
    axis.grid(axis="x", color="#00000018")
    return figure


def boxes(name: str, title: str, y: str, ylabel: str) -> Item:
    """The figure that `boxes_by_model` draws of a column of the table of walks."""
    caption = "Median, quartiles, lowest and highest of all walks."
    return Item(name, title, "walks", caption, lambda walks: boxes_by_model(walks, y, ylabel))


def heat_maps(table: pd.DataFrame, x: str, y: str, value: str, *, by: str) -> Figure:
    """A column against two others as colours, one map for each value of a third.

    Args:
        table: One row for each cell.
        x: Column of the horizontal axis.
        y: Column of the vertical axis.
        value: The column that is shown.
        by: Column of which each value has a map.

    Returns:
        The figure.
    """
    if table.empty:
        return empty_figure("not in this run")
    parts = [(label, part.pivot(index=y, columns=x, values=value)) for label, part in table.groupby(by)]
    columns = min(MAX_COLUMNS, len(parts))
    rows = -(-len(parts) // columns)
    figure, axes = canvas((7.2, 0.7 + 2.3 * rows), rows, columns)
    largest = float(table[value].max())
    for axis in axes.flat[len(parts) :]:
        axis.axis("off")
    for axis, (label, cells) in zip(axes.flat, parts, strict=False):
        image = axis.imshow(cells, cmap="viridis_r", vmin=0, vmax=largest, aspect="auto", origin="lower")
        axis.set_xticks(range(cells.shape[1]), [f"{each:g}" for each in cells.columns], rotation=90)
        axis.set_yticks(range(cells.shape[0]), [f"{each:g}" for each in cells.index])
        axis.set_title(f"{by.partition(' (')[0]} {label:g}")
        axis.set(xlabel=x, ylabel=y)
    figure.colorbar(image, ax=axes, label=value)
    return figure


def distances_over_steps(table: pd.DataFrame, by: str, dashed: str) -> Figure:
    """Distances (m) over steps. by: column of which each value has a colour; dashed: one whose second value has dashes."""
    figure, axes = canvas((7.2, 3.4))
    axis = axes[0, 0]
    for (label, lines), colour in zip(table.groupby(by), COLOURS, strict=False):
        for (_, line), style in zip(lines.groupby(dashed), ("-", "--"), strict=False):
            axis.plot(
                line["step"], line["distance (m)"], style, color=colour, lw=1.6, label=label if style == "-" else None
            )
    axis.set(xlabel="step", ylabel="distance (m)")
    from_zero(axis)
    axis.grid(axis="y", color="#00000018")
    legend_above(axis)
    return figure
