"""The folder of a sweep: every finished run, kept as soon as it is there, each exactly once."""

import io
import json
import sqlite3
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd
from filelock import FileLock, Timeout

from world.errors import InputError
from world.files import replacing

FINISHED, TABLE, LOCK = "finished.sqlite", "runs.parquet", ".lock"
TIMES = ("seconds", "learn_seconds")  # columns of the table that no two sweeps have alike


class Store:
    """The finished runs in a folder; use it in a `with` statement. While it is open to be written to, no other sweep may write.

    The table is SQLite's: a row that was added stays, and one that was not yet is not there at all, whatever ends the process.
    """

    def __init__(self, folder: Path, *, read_only: bool = False):
        self.folder, self.lock = folder, None
        path = folder / FINISHED
        if read_only:
            if not path.is_file():
                raise InputError(
                    f"{folder} holds no sweep ({FINISHED} is not there); give the folder that tussock sweep wrote"
                )
        else:
            self.lock = _locked(folder)
        try:
            self._database = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={'ro' if read_only else 'rwc'}", uri=True, timeout=60
            )
            if not read_only:
                with self._database:
                    self._database.execute(
                        "CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, row TEXT NOT NULL, steps BLOB)"
                    )
            self._database.execute("SELECT count(*) FROM runs").fetchone()
        except sqlite3.DatabaseError as error:
            self.close()
            raise _unusable(path, error) from error

    def finished(self) -> set[str]:
        """The keys of the runs that are finished."""
        return {key for (key,) in self._database.execute("SELECT key FROM runs")}

    def add(self, runs: Iterable[tuple[str, dict[str, Any], str]]) -> None:
        """Keep finished runs: the key, row and steps (CSV) of each. All of them, or, where that fails, none. Raises InputError."""
        try:
            with self._database:
                self._database.executemany(
                    "INSERT OR IGNORE INTO runs VALUES (?, ?, ?)",
                    [(key, json.dumps(row, default=str), zlib.compress(steps.encode())) for key, row, steps in runs],
                )
        except sqlite3.Error as error:
            raise _unusable(self.folder / FINISHED, error) from error

    def rows(self) -> dict[str, dict[str, Any]]:
        """The row of each finished run, by its key."""
        return {key: json.loads(row) for key, row in self._database.execute("SELECT key, row FROM runs")}

    def steps(self, key: str) -> str:
        """The steps of a finished run, as CSV."""
        (packed,) = self._database.execute("SELECT steps FROM runs WHERE key = ?", [key]).fetchone()
        return zlib.decompress(packed).decode()

    def close(self) -> None:
        """Let others write."""
        if hasattr(self, "_database"):
            self._database.close()
        if self.lock is not None:
            self.lock.release()

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, kind, error, at) -> None:
        self.close()


def _locked(folder: Path) -> FileLock:
    """Make the folder, for one sweep alone. Raises InputError where another one writes there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, timeout=0)
        lock.acquire()
    except Timeout:
        raise InputError(f"another sweep is writing to {folder}; wait for it, or give another --out") from None
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}); give another --out") from error
    return lock


def _unusable(path: Path, error: sqlite3.Error) -> InputError:
    """What went wrong with the database, as people can mend it."""
    if "full" in str(error):
        return InputError(
            f"{path}: no space is left; all runs kept before are intact: make room and give the same command again"
        )
    return InputError(f"{path} cannot be used ({error}); is it a file of tussock sweep's?")


def table_of(rows: dict[str, dict[str, Any]]) -> pd.DataFrame:
    """A row a run, in an order and with types that depend on the runs alone."""
    table = pd.DataFrame([{"key": key} | row for key, row in sorted(rows.items(), key=_in_order)], dtype=object)
    return table.astype({name: _type_of(values) for name, values in table.items()})


def _type_of(values: pd.Series) -> str:
    """The type of a column in which some values may be missing: whole numbers stay whole."""
    kinds = {type(value) for value in values if not pd.isna(value)}
    if kinds <= {str}:
        return "string"
    return "boolean" if kinds == {bool} else "Int64" if kinds == {int} else "float64"


def read_steps(text: str) -> pd.DataFrame:
    """The steps of a run, from CSV; what is empty is missing."""
    return pd.read_csv(io.StringIO(text))


def write_table(table: pd.DataFrame, folder: Path) -> Path:
    """Write the table of a sweep as parquet."""
    path = folder / TABLE
    with replacing(path) as partial:
        partial.write_bytes(table.to_parquet(index=False))
    return path


def _in_order(item: tuple[str, dict[str, Any]]) -> list[tuple]:
    """By the settings, in the order of the columns; numbers by size."""
    key, row = item
    values = [row[name] for name in row if name not in TIMES]
    return [(value is not None, isinstance(value, str), value if value is not None else 0) for value in [*values, key]]
