"""The HTML page of a report: one file that needs no other."""

from collections.abc import Mapping
from typing import Any

import jinja2

from .claims import Outcome, Spread
from .effects import MIN_UNITS, Effect


def render_page(report: Any, images: Mapping[Any, Any]) -> str:
    """The HTML of a report.

    Args:
        report: A `Report`.
        images: For the names of each of its drawings, a list of images, or the reason why there are none.

    Returns:
        The page.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tussock.navigation", "reports"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "value": format_value,
        "spread": format_spread,
        "label": format_label,
        "effects": format_effects,
    }
    return environment.get_template("page.html").render(report=report, images=images)


def format_value(value: object) -> str:
    """A value as text: numbers with three digits, nan and None as a dash."""
    if value is None or value != value:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if (value == int(value) and abs(value) >= 10) or abs(value) >= 100 else f"{value:.3g}"
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)


def format_spread(spread: Spread | None) -> str:
    """A number over several runs as text: the median, and its range where runs differ."""
    if spread is None or spread.lowest == spread.highest:
        return format_value(spread and spread.median)
    if spread.median != spread.median:
        return format_value(None)
    return f"{format_value(spread.median)} ({format_value(spread.lowest)} to {format_value(spread.highest)})"


def format_label(label: str) -> str:
    """The label of a number as text."""
    return label.replace("(deg)", "(°)")


def format_effects(outcome: Outcome) -> str:
    """The sizes of an effect in all runs as text, with their intervals and the number of units."""
    effects = outcome.known_effects
    return f"{format_label(effects[0].label)}: {'; '.join(map(_format_effect, effects))}" if effects else ""


def _format_effect(effect: Effect) -> str:
    units = f"{effect.units:,} {effect.of if effect.units != 1 else effect.of.removesuffix('s')}"
    if effect.low != effect.low:
        alike = "all alike, " if effect.units >= MIN_UNITS else ""
        return f"{format_value(effect.value)} ({units}: {alike}no interval)"
    return f"{format_value(effect.value)} ({format_value(effect.low)} to {format_value(effect.high)}; {units})"
