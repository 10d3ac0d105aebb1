"""What a figure of the report is."""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from ...reports.findings import Findings
from .material import Material

Draw = Callable[[Findings, Material], Figure]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A figure of the report. number: the thesis's, or a word. caption: may hold names of the study's numbers in braces."""

    number: str
    study: str
    title: str
    caption: str
    draw: Draw


PICTURES: list[Picture] = []


def picture(number: str, study: str, title: str, caption: str) -> Callable[[Draw], Draw]:
    """Add a drawing to the report, in the order they are written."""

    def add(draw: Draw) -> Draw:
        PICTURES.append(Picture(number=number, study=study, title=title, caption=" ".join(caption.split()), draw=draw))
        return draw

    return add
