"""Results of a study: tables and numbers, as JSON and in files that show damage."""

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.atomic import replacing


@dataclass(frozen=True, kw_only=True)
class StudyResults:
    """What a study computes.

    Attributes:
        tables: Tables by name.
        numbers: Single results by name.
    """

    tables: dict[str, pd.DataFrame]
    numbers: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Numbers and tables as plain JSON."""
        tables = {name: plain_json(table.to_dict("split", index=False)) for name, table in self.tables.items()}
        return {"numbers": plain_json(self.numbers), "tables": tables}

    @classmethod
    def from_json(cls, saved: dict[str, Any]) -> "StudyResults":
        """The inverse of `to_json`; null becomes nan."""
        tables = {name: _table(**table) for name, table in saved["tables"].items()}
        numbers = {name: math.nan if value is None else value for name, value in saved["numbers"].items()}
        return cls(tables=tables, numbers=numbers)


def _table(columns: list[str], data: list[list[Any]]) -> pd.DataFrame:
    table = pd.DataFrame(data, columns=columns)
    only_null = table.columns[table.isna().all()]
    return table.astype(dict.fromkeys(only_null, float))


def plain_json(value: Any) -> Any:
    """A value as JSON can hold it: numpy numbers become Python's, tuples become lists, nan and infinity become None."""
    if isinstance(value, dict):
        return {str(key): plain_json(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_json(each) for each in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_results(results: StudyResults, path: Path, key: str) -> None:
    """Write results with a digest that shows damage.

    Args:
        results: The results of a study.
        path: File to write.
        key: Digest of what the results were computed from.
    """
    text = json.dumps(results.to_json())
    with replacing(path) as partial:
        partial.write_text(json.dumps({"key": key, "digest": _digest(key, text), "findings": text}))


def read_results(path: Path, key: str) -> StudyResults | None:
    """Read results that `write_results` wrote.

    Args:
        path: File to read.
        key: The key that they were written with.

    Returns:
        The results, or None where there is no such file or it belongs to another key.

    Raises:
        ValueError: The file is damaged.
    """
    if not path.exists():
        return None
    try:
        saved = json.loads(path.read_text(encoding="utf-8"))
        if saved["digest"] != _digest(saved["key"], saved["findings"]):
            raise ValueError("its content does not match its digest")
        return StudyResults.from_json(json.loads(saved["findings"])) if saved["key"] == key else None
    except (KeyError, TypeError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(str(error)) from error


def _digest(key: str, text: str) -> str:
    return hashlib.sha256((key + text).encode()).hexdigest()
