"""The folder of a sweep: every finished run, kept as soon as it is there, each exactly once."""

import io
import json
import os
import sqlite3
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from filelock import FileLock, Timeout

from tussock.world.atomic import replacing
from tussock.world.errors import DiskFullError, FileError

FINISHED, TABLE, ABOUT, LOCK = "finished.sqlite", "runs.parquet", "sweep.json", ".lock"
_TABLES = """
    BEGIN;
    CREATE TABLE runs (
        key TEXT PRIMARY KEY, settings TEXT NOT NULL UNIQUE, row TEXT NOT NULL, steps BLOB NOT NULL, again INTEGER NOT NULL
    );
    CREATE INDEX unfinished ON runs (key) WHERE again; -- otherwise all steps are read to find out which runs are finished
    COMMIT;
"""
_COLUMNS = ("key", "settings", "row", "steps", "again")
TIMES = ("seconds", "learn_seconds")  # columns of the table that no two sweeps have alike
PATIENCE = 60  # s that a sweep waits for a reader of its folder
PART = 1000  # rows that are in memory as objects, which take ten times as much as columns
KINDS = {
    pa.null(): pd.StringDtype(),
    pa.string(): pd.StringDtype(),
    pa.bool_(): pd.BooleanDtype(),
    pa.int64(): pd.Int64Dtype(),
}  # know missing values


@dataclass(frozen=True, kw_only=True)
class Finished:
    """A run to be kept.

    Attributes:
        key: Of everything that decides it.
        settings: As its row has them.
        row: Of the table.
        steps: Its trajectory as CSV.
        again: It could not be done now, and is to be tried again another time.
    """

    key: str
    settings: dict[str, Any]
    row: dict[str, Any]
    steps: str
    again: bool = False


class Store:
    """The finished runs in a folder; use it in a `with` statement. While it is open to be written to, no other sweep may write.

    A row is either added completely or not at all, whatever ends the process (SQLite). There is one row per set of settings: if a
    file that they name has changed, the new run replaces the old one.
    """

    def __init__(self, folder: Path, *, read_only: bool = False):
        self.folder, self.lock = folder, None
        path = folder / FINISHED
        if read_only:
            if not path.is_file():
                raise FileError(
                    f"{folder} holds no sweep ({FINISHED} is not there); give the folder that tussock sweep wrote"
                )
        else:
            self.lock = _locked(folder)
        try:
            # A reader, too, has to clean up after a writer that was killed, where it may write.
            mode = "rwc" if not read_only else "rw" if os.access(path, os.W_OK) and os.access(folder, os.W_OK) else "ro"
            self._database = sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, timeout=PATIENCE)
            if not (read_only or self._database.execute("SELECT 1 FROM sqlite_master").fetchone()):
                self._database.executescript(_TABLES)
            self._database.execute(f"SELECT {', '.join(_COLUMNS)} FROM runs LIMIT 1").fetchone()
        except sqlite3.DatabaseError as error:
            self.close()
            raise _unusable(path, error) from error

    def check_settings(self, names: Iterable[str]) -> None:
        """Refuse to add to runs that have other settings than these: another version did them. Raises FileError."""
        for (settings,) in self._read("SELECT settings FROM runs LIMIT 1"):
            if set(json.loads(settings)) != set(names):
                raise FileError(
                    f"{self.folder} holds runs of another version of tussock, which do not compare; give another --out "
                    "(tussock report still reads them)"
                )

    def finished(self) -> set[str]:
        """The keys of the runs that are finished, without those to be tried again."""
        return {key for (key,) in self._read("SELECT key FROM runs EXCEPT SELECT key FROM runs WHERE again")}

    def add(self, runs: Iterable[Finished]) -> None:
        """Keep finished runs: all of them, or, where that fails, none. Raises FileError."""
        try:
            with self._database:
                self._database.executemany("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?)", map(_packed, runs))
        except sqlite3.Error as error:
            raise _unusable(self.folder / FINISHED, error) from error

    def rows(self) -> dict[str, dict[str, Any]]:
        """The row of each finished run, by its key. Where there may be very many, `table` takes a tenth of the memory."""
        return dict(self._rows())

    def row(self, key: str) -> dict[str, Any]:
        """The row of a finished run."""
        ((row,),) = self._read("SELECT row FROM runs WHERE key = ?", key)
        return json.loads(row)

    def table(self) -> pd.DataFrame:
        """The rows of all finished runs; see `table_of`."""
        return _table(self._rows())

    def _rows(self) -> Iterator[tuple[str, dict[str, Any]]]:
        key, part = "", [("", "")]
        while part:  # in parts, between which a sweep can write
            part = list(self._read("SELECT key, row FROM runs WHERE key > ? ORDER BY key LIMIT ?", key, PART))
            for key, row in part:
                yield key, json.loads(row)

    def steps(self, key: str) -> str:
        """The steps of a finished run, as CSV."""
        ((packed,),) = self._read("SELECT steps FROM runs WHERE key = ?", key)
        return zlib.decompress(packed).decode()

    def _read(self, query: str, *values: str | int) -> Iterator[tuple]:
        """What the database answers. Raises FileError where it is damaged."""
        try:
            yield from self._database.execute(query, values)
        except sqlite3.Error as error:
            raise _unusable(self.folder / FINISHED, error) from error

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


def _packed(run: Finished) -> tuple[str, str, str, bytes, bool]:
    """A run as a row of the database."""
    steps = zlib.compress(run.steps.encode(), level=1)  # of digits: higher levels gain 3 % in three times the time
    return run.key, json.dumps(run.settings), json.dumps(run.row), steps, run.again


def _locked(folder: Path) -> FileLock:
    """Make the folder, for one sweep alone. Raises FileError where another one writes there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, timeout=0)
        lock.acquire()
    except Timeout:
        raise FileError(f"another sweep is writing to {folder}; wait for it, or give another --out") from None
    except OSError as error:
        raise FileError(f"{folder} cannot be written ({error.strerror}); give another --out") from error
    return lock


def _unusable(path: Path, error: sqlite3.Error) -> FileError:
    """What is wrong with the database, and what to do."""
    if "full" in str(error):
        return DiskFullError(
            f"{path}: no space is left; all runs kept before are intact: make room and give the same command again"
        )
    return FileError(f"{path} cannot be used ({error}); is it a file of tussock sweep's?")


def table_of(rows: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """One row per run, in an order and with types that depend on the runs alone: sorted by the settings, in the order of the columns."""
    return _table(rows.items())


def _table(rows: Iterable[tuple[str, Mapping[str, Any]]]) -> pd.DataFrame:
    parts, longest, rows = [pa.table({})], {}, iter(rows)
    while part := [{"key": key, **row} for key, row in islice(rows, PART)]:
        parts.append(pa.table({name: [row.get(name) for row in part] for name in dict.fromkeys(chain(*part))}))
        longest = max(longest, *part, key=len)
    table = pa.concat_tables(parts, promote_options="permissive")
    table = table.select(list(dict.fromkeys([*longest, *table.column_names])))  # some runs have no results
    frame = table.to_pandas(types_mapper=KINDS.get, ignore_metadata=True)
    order = [name for name in frame if name not in ("key", *TIMES)] + ["key"]
    varied = [name for name in order if len(frame) > 1 and frame[name].nunique(dropna=False) > 1]
    return frame.sort_values(varied, na_position="first", ignore_index=True) if varied else frame


def read_steps(text: str) -> pd.DataFrame:
    """The steps of a run, from CSV; what is empty is missing."""
    return pd.read_csv(io.StringIO(text))


def write_table(table: pd.DataFrame, folder: Path) -> Path:
    """Write the table of a sweep as parquet."""
    path = folder / TABLE
    with replacing(path) as partial:
        partial.write_bytes(table.to_parquet(index=False))
    return path


def write_title(title: str, folder: Path) -> None:
    """Keep the title of a sweep for its report."""
    with replacing(folder / ABOUT) as partial:
        partial.write_text(json.dumps({"title": title}) + "\n", encoding="utf-8")


def read_title(folder: Path) -> str | None:
    """The title of a sweep; None where its folder has none, as those of older versions."""
    try:
        title = json.loads((folder / ABOUT).read_text(encoding="utf-8"))["title"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return title if isinstance(title, str) else None
