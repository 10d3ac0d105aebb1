"""What the figures of all reports are drawn with: colours, axes, curves, box plots, panoramas, and image files."""

import base64
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Num
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image as PillowImage

from tussock.world.atomic import replacing

from .layout import fit_texts

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,  # of which a telephone shows half
    "axes.titlesize": "medium",
    "svg.hashsalt": "tussock",  # the same bytes each time
}
ROUTE_COLOUR, PATH_COLOUR, CURVE_COLOUR = "#2f6bff", "#e6352b", "#333333"
GOOD_COLOUR, SOFT_COLOUR = "#2b8a6f", "#9aa3ad"
WIDE, TALL = (7.2, 2.9), (7.2, 5.6)  # inches
HANDLE, CHARACTER = 0.5, 0.08  # inches that a line and a letter take in a legend
DPI = 130


@dataclass(frozen=True, kw_only=True)
class Image:
    """An image as a page embeds it.

    Attributes:
        data: PNG in base64.
        width: Width in the page (CSS pixels).
        height: Height in the page (CSS pixels).
    """

    data: str
    width: int
    height: int


def save_figure(figure: Figure, folder: Path, name: str) -> Image:
    """Write a figure as NAME.png and NAME.svg into a folder; give the PNG for a page."""
    fit_texts(figure)
    png = io.BytesIO()
    figure.savefig(png, dpi=DPI, format="png")
    with replacing(folder / f"{name}.png") as partial:
        partial.write_bytes(png.getvalue())
    with replacing(folder / f"{name}.svg") as partial:
        figure.savefig(partial, format="svg", metadata={"Date": None})
    width, height = (round(pixels * 96 / DPI) for pixels in PillowImage.open(png).size)
    return Image(data=base64.b64encode(png.getvalue()).decode("ascii"), width=width, height=height)


def save_picture(figure: Figure, path: str | os.PathLike) -> None:
    """Write a figure as one file, .png or .svg."""
    fit_texts(figure)
    with replacing(path) as partial:
        figure.savefig(partial, dpi=120, format=Path(path).suffix.lstrip(".").lower())


def canvas(size: tuple[float, float] = WIDE, rows: int = 1, columns: int = 1, **options) -> tuple[Figure, np.ndarray]:
    """A figure of a size (inches) and its axes, an array (rows, columns)."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for each in axes.flat:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def empty_figure(reason: str) -> Figure:
    """A figure with the reason why there is nothing to draw."""
    figure, axes = canvas((7.2, 1.2))
    axes[0, 0].axis("off")
    axes[0, 0].text(0.5, 0.5, reason, ha="center", va="center")
    return figure


def legend_above(axes: Axes) -> None:
    """Explain what is drawn above the figure, where it covers no data, in as many columns as fit."""
    handles, labels = axes.get_legend_handles_labels()
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    column = HANDLE + CHARACTER * max(map(len, labels))
    columns = max(1, int(figure.get_figwidth() / column))
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False, fontsize="small")


def from_zero(axes: Axes) -> None:
    """Let a vertical axis begin at zero and end above all data, also those of axes that share it and those drawn later.

    `set_ylim(bottom=0)` would fix its end as well, at the data drawn so far.
    """
    axes.axhline(0, lw=0).sticky_edges.y.append(0)
    axes.autoscale_view(scalex=False)
    if (
        axes.get_ylim()[0] < 0 == axes.dataLim.y0 == axes.dataLim.y1
    ):  # everything is zero: matplotlib puts that in the middle
        axes.set_ylim(0, 1, auto=True)


def label_errors(axes: Axes, label: str = "error (degrees)") -> None:
    """Make a vertical axis one of errors, from zero."""
    axes.set_ylabel(label)
    from_zero(axes)


def draw_over_circle(
    axes: Axes, degrees, values, label: str | None = None, colour: str = CURVE_COLOUR, **style
) -> None:
    """Draw a curve over all rotations, from behind (-180) over ahead to behind (180); 0 is the set heading."""
    axes.plot(degrees, values, color=colour, lw=1.4, label=label, **style)
    axes.axvline(0, color=ROUTE_COLOUR, lw=0.9, zorder=0)
    axes.set(xlim=(-180, 180), xticks=range(-180, 181, 90), xlabel="degrees left of the set heading")


def draw_lines(axes: Axes, x, curves: Mapping[str, tuple], ylabel: str = "error (degrees)") -> None:
    """Draw several lines of errors over one axis. curves: values, colour and style, by label."""
    for label, (values, colour, style) in curves.items():
        axes.plot(x, values, style, color=colour, label=label, ms=4, lw=1.5)
    label_errors(axes, ylabel)
    axes.grid(axis="y", color="#00000018")


def draw_panorama(axes: Axes, view: Num[np.ndarray, "h w *channels"], title: str = "") -> None:
    """Draw a view (h, w, 3 or 4) or a feature image (h, w), 360 degrees wide, ahead in the middle."""
    image = view[..., :3] if view.ndim == 3 else view
    axes.imshow(image, extent=(180, -180, 0, 75), cmap="gray", aspect="auto", interpolation="nearest")
    axes.set(xticks=range(-180, 181, 90), xlim=(180, -180), yticks=[], xlabel="degrees left of straight ahead")
    axes.set_title(title)
