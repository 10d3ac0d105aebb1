"""A report as data, and writing it: figures, one JSON file, and one HTML page that needs no other file."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import matplotlib
import pandas as pd
from matplotlib.figure import Figure

from tussock.world.atomic import replacing
from tussock.world.errors import FileError, InputError
from tussock.world.progress import Progress, no_progress

from .claims import Outcome
from .drawing import STYLE, Image, save_figure
from .page import format_value, render_page
from .results import plain_json

REPORT, RESULTS, FIGURES = "report.html", "results.json", "figures"


@dataclass(frozen=True)
class Text:
    """A paragraph.

    Attributes:
        text: Plain text.
        style: Name of a style of the page: "soft", "note" or none.
        anchor: Name by which links reach it.
    """

    kind: ClassVar = "text"
    text: str
    style: str = ""
    anchor: str = ""


@dataclass(frozen=True)
class Command:
    """A command line to copy."""

    kind: ClassVar = "command"
    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of short texts."""

    kind: ClassVar = "bullets"
    lines: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: Its value.
        note: A remark behind it, in grey.
        bold: Whether both are bold.
    """

    text: str
    note: str = ""
    bold: bool = False


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table.

    Attributes:
        columns: Headings.
        rows: Texts or cells, as many in a row as there are columns.
        caption: A sentence above the table.
    """

    kind: ClassVar = "table"
    columns: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    caption: str = ""

    @classmethod
    def of(cls, frame: pd.DataFrame, caption: str = "") -> "Table":
        """A data frame as a table."""
        rows = [[format_value(plain_json(value)) for value in row] for row in frame.to_numpy(dtype=object)]
        return cls(columns=[name.rstrip() for name in frame.columns], rows=rows, caption=caption)


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """One or more figures with one caption.

    Attributes:
        names: Names of the figures' files, without endings.
        draw: Draws the figures. Where it raises InputError, the page shows the reason in place of the figures.
        alt: What the figures show, for readers who cannot see them.
        caption: Text below the figures.
    """

    kind: ClassVar = "drawing"
    names: tuple[str, ...]
    draw: Callable[[], Iterable[Figure]]
    alt: str
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class ClaimTable:
    """All claims, with their numbers, outcomes, and links to what shows them.

    Attributes:
        outcomes: The tested claims.
        links: Anchor and label of the section that shows a claim, by the claim's key.
    """

    kind: ClassVar = "claims"
    outcomes: Sequence[Outcome]
    links: Mapping[str, tuple[str, str]]


@dataclass(frozen=True)
class ClaimBox:
    """One claim with its numbers and outcome, below the figure that shows it."""

    kind: ClassVar = "claim"
    outcome: Outcome


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a report.

    Attributes:
        title: Heading.
        anchor: Name by which links reach it.
        blocks: Its parts, from top to bottom; sections among them are subsections.
    """

    kind: ClassVar = "section"
    title: str
    anchor: str
    blocks: Sequence["Block"]


Block = Section | Text | Command | Bullets | Table | Drawing | ClaimTable | ClaimBox


@dataclass(frozen=True, kw_only=True)
class Report:
    """A report.

    Attributes:
        title: Heading of the page.
        lead: What the report is about, in a sentence.
        about: What was studied, by label, for the head of the page.
        blocks: The page's content.
        footer: Text at the end of the page.
        results: Everything in numbers, for the JSON file.
        results_file: Name of the JSON file.
        headline: The main result in a sentence, above everything else; empty for none.
    """

    title: str
    lead: str
    about: Mapping[str, Any]
    blocks: Sequence[Block]
    footer: str
    results: dict[str, Any]
    results_file: str = field(default=RESULTS)
    headline: str = ""


def write_report(report: Report, folder: Path, progress: Progress = no_progress) -> dict[str, Any]:
    """Write a report's figures (PNG and SVG), JSON file and page.

    Args:
        report: The report.
        folder: Folder to write to; it is made where it is missing.
        progress: Called with the numbers of figures drawn and of all figures.

    Returns:
        The content of the JSON file.
    """
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    drawings, images = list(_drawings(report.blocks)), {}
    for done, drawing in enumerate(drawings):
        progress(done, len(drawings))
        images[drawing.names] = _draw(drawing, folder / FIGURES)
    results = plain_json(report.results)
    with replacing(folder / report.results_file) as partial:
        partial.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    page = render_page(report, images)
    with replacing(folder / REPORT) as partial:  # last, so that a folder with a page has everything
        partial.write_text(page, encoding="utf-8")
    return results


def _drawings(blocks: Sequence[Block]) -> Iterator[Drawing]:
    for block in blocks:
        if isinstance(block, Drawing):
            yield block
        elif isinstance(block, Section):
            yield from _drawings(block.blocks)


def _draw(drawing: Drawing, folder: Path) -> list[Image] | str:
    """The images of a drawing, or the reason why there are none."""
    with matplotlib.rc_context(STYLE):
        try:
            return [save_figure(each, folder, name) for name, each in zip(drawing.names, drawing.draw(), strict=True)]
        except InputError as error:
            return str(error)


def check_report_folder(folder: Path, about: Mapping[str, Any], *, overwrite: bool = False) -> None:
    """Refuse, before long work, a folder that holds another report.

    Args:
        folder: Folder of the new report.
        about: What the new report is about.
        overwrite: Whether another report may be replaced.

    Raises:
        FileError: The folder is a file, or holds a report about something else.
    """
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file; give a folder for the report")
    results = folder / RESULTS
    if overwrite or not (results.exists() or (folder / REPORT).exists()):
        return
    try:
        before = json.loads(results.read_text(encoding="utf-8"))["about"]
    except (OSError, ValueError, KeyError, TypeError):
        before = {}
    different = [key for key in {**before, **about} if before.get(key) != plain_json(about.get(key))]
    if different:
        raise FileError(
            f"{folder} holds a report of something else ({', '.join(different)}); give another folder, or overwrite it"
        )
