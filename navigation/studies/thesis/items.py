"""What a figure or table of the thesis's report is."""

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd
from matplotlib.figure import Figure

from ...reports.results import StudyResults
from .study_data import StudyData

Draw = Callable[[StudyResults, StudyData], Figure]


@dataclass(frozen=True, kw_only=True)
class Item:
    """A figure or table of the thesis, made again.

    Attributes:
        number: Its number in the thesis, several with commas between them; a word for what is not in the thesis.
        study: Name of the study that it shows.
        title: Heading.
        caption: Text below a figure or above a table; a figure's may contain names of the study's numbers in braces.
        draw: Draws a figure from the study's results and views.
        rows: Makes a table from the study's results; columns are headings.
    """

    number: str
    study: str
    title: str
    caption: str
    draw: Draw | None = None
    rows: Callable[[StudyResults], pd.DataFrame] | None = None

    @property
    def numbers(self) -> list[str]:
        """All numbers by which it may be called: for 7, 8 these are "7, 8", "7" and "8"."""
        return list(dict.fromkeys([self.number, *self.number.split(", ")]))

    @property
    def name(self) -> str:
        """Stable name of its files and of its anchor in the page."""
        kind = "table" if self.draw is None else "figure"
        return f"{kind}-{self.number.replace(', ', '-').replace('.', '-').replace(' ', '-')}"

    @property
    def label(self) -> str:
        """Its number as the page shows it."""
        if not self.number[0].isdigit():
            return "Beyond the figures"
        return f"{'Table' if self.draw is None else 'Figure'} {self.number}"


def figure(number: str, study: str, title: str) -> Callable[[Draw], Item]:
    """Decorator: turns a function that draws a figure into an item of the report. The function's docstring is the caption."""

    def item(draw: Draw) -> Item:
        return Item(number=number, study=study, title=title, caption=" ".join((draw.__doc__ or "").split()), draw=draw)

    return item
