"""Tables of numbers as text: their encoding, separator, decimal comma, comments and header are found from the text itself."""

import codecs
import csv
import io
import logging
import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .errors import FileError, InputError
from .route_columns import Column, find_columns, is_geographic, refuse_several_tracks, with_unit

logger = logging.getLogger(__name__)

SEPARATORS = (";", "\t", ",", " ")
COMMENTS = ("#", "%", "//")
EMPTY = ("", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "infinity")  # cells where a tracker lost the animal
MAX_PREAMBLE = 100  # lines about the recording, before the names of the columns
MAX_SUBHEADER = 5  # lines with other names and with units, below them
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?")
WORD = re.compile(
    r'"[^"]*"|[^\s\[(]*[\[(][^\])]*[\])]|\S+(?:\s+[\[(][^\])]*[\])])?'
)  # separated by spaces; units stay with names


@dataclass(frozen=True)
class TextTable:
    """Rows of cells.

    Attributes:
        names: Of the columns, or None where the text has none.
        line: Line of the names.
        rows: Cells of each row.
        lines: Line of each row.
        decimal_comma: Whether 1,5 is one and a half.
    """

    names: list[str] | None
    line: int
    rows: list[list[str]]
    lines: list[int]
    decimal_comma: bool

    def column(self, index: int, column: Column) -> Float[np.ndarray, " n"]:
        """The numbers in a column, nan in empty cells. Raises FileError for other text, with its line."""
        values = np.empty(len(self.rows))
        for row, cells in enumerate(self.rows):
            cell = cells[index] if index < len(cells) else ""
            values[row] = np.nan if cell.lower() in EMPTY else self._number(cell)
            if (np.isnan(values[row]) and cell.lower() not in EMPTY) or np.isinf(values[row]):
                raise FileError(f"line {self.lines[row]}: {self.refused(row, index, column)}")
        return values

    def refused(self, row: int, index: int, column: Column) -> str:
        """Why the cell of a row is not usable."""
        cell = self.rows[row][index] if index < len(self.rows[row]) else ""
        return f"{column.name} is {cell[:40]!r}; a route needs finite {column.unit}"

    def _number(self, cell: str) -> float:
        if self.decimal_comma and "." not in cell:
            cell = cell.replace(",", ".")
        try:
            return float(cell) if "_" not in cell else np.nan
        except ValueError:
            return np.nan


def decode(data: bytes) -> str:
    """Text in UTF-8, UTF-16 or an 8-bit encoding, with \\n at the ends of lines. Raises FileError for what is not text."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    elif len(data) > 3 and data[1:200:2].count(0) > 0.8 * len(data[1:200:2]):
        text = data.decode("utf-16-le", errors="replace")
    else:
        text = data.decode("utf-8-sig", errors="replace")
    odd = sum(not (each.isprintable() or each in "\t\n\r\f") for each in text[:4000])
    if "\0" in text or odd > 0.1 * len(text[:4000]):
        raise FileError(
            "it is neither text nor a kind of binary file that is known; give .csv, .mat, .npy or AntWorld .bin"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_table(text: str, columns: list[str] | None = None) -> TextTable:
    """Read a table of numbers.

    Args:
        text: The text.
        columns: Names of its columns in their order; None takes them from its first line, or the comment before its first line.

    Raises:
        FileError: Where it has no columns x and y.
    """
    lines = text.split("\n")
    used = [number for number, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    comments = [number for number in range(used[0] if used else len(lines)) if lines[number].strip()]
    first = lines[used[0]] if used else ""
    kinds = [
        (separator, comma) for separator in SEPARATORS for comma in (False, True) if not (comma and separator == ",")
    ]
    numeric = next((kind for kind in kinds if _is_numeric(split_line(first, kind[0]), kind[1])), None)
    if numeric is not None:
        separator, comma = numeric
        header, line = columns, 0
        if columns is None and comments:  # names in the comment before the numbers, as numpy.savetxt writes them
            line = comments[-1]
            header = next(
                (cells for each in SEPARATORS if _has_xy(cells := split_line(_bare(lines[line]), each))), None
            )
        return TextTable(header, line + 1, *_rows(lines, used[0], separator), comma)
    named = _named(lines, used, comments)
    line, separator = named or (used[0] if used else 0, None)
    if separator is None and columns is not None:  # names that mean nothing: as many as there are in the next line
        second = lines[used[1]] if len(used) > 1 else ""
        separator = next((kind[0] for kind in kinds if _is_numeric(split_line(second, kind[0]), kind[1])), None)
    separator = separator or ","
    header = columns or split_line(_bare(lines[line]), separator)
    has_data = columns is not None and named is None and any(map(NUMBER.fullmatch, split_line(first, separator)))
    rows, numbers = _rows(lines, line + (not has_data), separator)
    header, rows, numbers = _below_names(header, rows, numbers)
    if (
        columns is None and rows and all(len(cells) == len(header) + 1 and cells[-1] for cells in rows)
    ):  # R's write.table
        logger.warning("each row has one cell more than there are names; the first is taken as the number of the row")
        header = ["", *header]
    comma = separator != "," and any(re.fullmatch(r"[-+]?\d*,\d+", cell) for cells in rows[:100] for cell in cells)
    return TextTable(header, line + 1, rows, numbers, comma)


def _bare(line: str) -> str:
    """A line without the characters that make it a comment."""
    return line.strip().lstrip("#%/ \t") if line.lstrip().startswith(COMMENTS) else line


def _named(lines: list[str], used: list[int], comments: list[int]) -> tuple[int, str] | None:
    """The line with names of columns, and their separator: the first line, the comment before it, or one below a text on the recording."""
    for number in [*used[:1], *comments[-1:], *used[1:MAX_PREAMBLE]]:
        for separator in SEPARATORS:
            names = split_line(_bare(lines[number]), separator)
            if _has_xy(names) and (
                number in used or not used or len(names) == len(split_line(lines[used[0]], separator))
            ):
                return number, separator
    return None


def _below_names(
    names: list[str], rows: list[list[str]], numbers: list[int]
) -> tuple[list[str], list[list[str]], list[int]]:
    """Names with the units of the lines below them, and the rows without these lines."""
    begin = 0
    while begin < min(MAX_SUBHEADER, len(rows)) and not any(map(NUMBER.fullmatch, rows[begin])):
        begin += 1
    if begin == len(rows):
        begin = 0
    for cells in rows[:begin]:
        names = [with_unit(name, cell) for name, cell in zip(names, cells, strict=False)] + names[len(cells) :]
    return names, rows[begin:], numbers[begin:]


def _rows(lines: list[str], begin: int, separator: str) -> tuple[list[list[str]], list[int]]:
    """Cells of the lines from `begin`, without comments and empty lines, and their numbers from 1."""
    rows, numbers = [], []
    kept = ("" if line.lstrip().startswith(COMMENTS) else line for line in lines[begin:])
    if separator == " ":
        cells_and_numbers = ((split_line(line, " "), number) for number, line in enumerate(kept, begin + 1))
    else:
        reader = csv.reader((line + "\n" for line in kept), delimiter=separator, skipinitialspace=True)
        cells_and_numbers = ((cells, begin + reader.line_num) for cells in reader)
    for cells, number in cells_and_numbers:
        cells = [cell.strip() for cell in cells]
        if len(cells) > 1 or any(cells):
            rows.append(cells)
            numbers.append(number)
    while rows and not any(rows[-1]):  # as spreadsheets leave them
        rows.pop()
    return rows, numbers[: len(rows)]


def split_line(line: str, separator: str) -> list[str]:
    """Cells of one line."""
    if separator == " ":
        return [cell.strip('"') for cell in WORD.findall(line)]
    return [
        cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=separator, skipinitialspace=True), [])
    ]


def _is_numeric(cells: list[str], comma: bool) -> bool:
    """Whether cells are at least two numbers, or empty."""
    number = r"[-+]?(\d+,?\d*|,\d+)([eE][-+]?\d+)?" if comma else r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"
    numbers = [bool(re.fullmatch(number, cell)) for cell in cells]
    return sum(numbers) >= 2 and all(one or cell.lower() in EMPTY for one, cell in zip(numbers, cells, strict=True))


def _has_xy(cells: list[str]) -> bool:
    """Whether names of columns contain x and y; also where they contain them twice, or in a wrong unit, which is refused later."""
    try:
        return {"x", "y"} <= find_columns(cells).keys()
    except InputError:
        return True


def columns_of(table: TextTable) -> dict[str, tuple[int, Column]]:
    """Index and meaning of the columns of a route in a table. Raises FileError where x or y is missing."""
    if table.names is None:
        count, row = len(table.rows[0]), " ".join(table.rows[0])[:60]
        example = ",".join((["x", "y", "heading"] + ["-"] * count)[:count]) if count > 1 else "x,y"
        raise FileError(
            f"line {table.lines[0]}: the columns have no names; give them, as --columns {example} (in their order, - skips one; "
            f"the line is {row!r})"
        )
    try:
        found = find_columns(table.names)
    except FileError as error:
        raise FileError(f"line {table.line}: {error}") from error
    if not {"x", "y"} <= found.keys():
        header = ",".join(table.names)[:200]
        if is_geographic(table.names):
            raise FileError(
                f"line {table.line}: the columns are {header!r}, in degrees on the globe; convert them to metres (UTM)"
            )
        raise FileError(
            f"line {table.line}: the columns are {header!r}; a route needs x_m,y_m,heading_deg, or --columns with names in their order"
        )
    refuse_several_tracks(
        table.names,
        lambda index: [row[index] for row in table.rows if index < len(row) and row[index].lower() not in EMPTY],
    )
    return found
