"""The pages that people read: HTML of one style, each a single file that needs nothing else."""

import base64
import io
from pathlib import Path
from typing import Any

import jinja2
import matplotlib
from matplotlib.figure import Figure
from PIL import Image

from tussock.world.atomic import replacing

DPI = 130


def page(template: str, **values: Any) -> str:
    """The HTML of one of the templates in this folder. Raises jinja2.UndefinedError for a value that it lacks."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tussock.navigation", "reports"), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.filters |= {"cell": cell, "spread": spread, "label": lambda label: label.replace("(deg)", "(°)")}
    return environment.get_template(template).render(**values)


def picture(figure: Figure, folder: Path, name: str) -> dict[str, Any]:
    """Draw a figure into NAME.png and NAME.svg of a folder; give the PNG for a page: image (base64), width and height (CSS pixels)."""
    data = io.BytesIO()
    figure.savefig(data, dpi=DPI, format="png")
    with replacing(folder / f"{name}.png") as partial:
        partial.write_bytes(data.getvalue())
    with matplotlib.rc_context({"svg.hashsalt": "tussock"}), replacing(folder / f"{name}.svg") as partial:
        figure.savefig(partial, format="svg", metadata={"Date": None})
    return embedded(data.getvalue())


def embedded(png: bytes) -> dict[str, Any]:
    """A PNG of DPI dots an inch as a page takes it: image (base64), width and height (CSS pixels)."""
    width, height = Image.open(io.BytesIO(png)).size
    return {
        "image": base64.b64encode(png).decode("ascii"), "width": round(width * 96 / DPI), "height": round(height * 96 / DPI),
    }  # fmt: skip


def cell(value: object) -> str:
    """A value as people read it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        if value != value:
            return "–"
        if (value == int(value) and abs(value) >= 10) or abs(value) >= 100:
            return f"{value:.0f}"
        return f"{value:.3g}"
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)


def spread(found: tuple[float, float, float]) -> str:
    """A number, and its range where there is one."""
    middle, low, high = found
    return cell(middle) if low == high or middle != middle else f"{cell(middle)} ({cell(low)} to {cell(high)})"
