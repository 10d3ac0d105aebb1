"""What a study finds: tables, numbers and verdicts; and keeping them on disk, whole or not at all."""

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from tussock.world.atomic import replacing


@dataclass(frozen=True, kw_only=True)
class Claim:
    """What the thesis claims, and whether it holds here.

    key: stable name. statement: the claim. figure: number of the figure that shows it. published, obtained: numbers by the same
    labels, units in them; a published one is missing where the thesis only draws it. holds: going by `test`, in words; None where
    there is nothing to go by, as for corners on a straight route.
    """

    key: str
    statement: str
    figure: str
    published: dict[str, float]
    obtained: dict[str, float]
    test: str
    holds: bool | None
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What a study found.

    tables: by name. numbers: single results by stable names. claims: verdicts on the thesis's.
    """

    tables: dict[str, pd.DataFrame]
    numbers: dict[str, Any]
    claims: list[Claim] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """As plain JSON; numbers that are not finite become null."""
        return {
            "numbers": plain(self.numbers),
            "claims": [plain(dataclasses.asdict(claim)) for claim in self.claims],
            "tables": {name: plain(table.to_dict("split", index=False)) for name, table in self.tables.items()},
        }

    @classmethod
    def from_json(cls, kept: dict[str, Any]) -> "Findings":
        """The inverse of `to_json`; null becomes nan in tables."""
        tables = {name: pd.DataFrame(table["data"], columns=table["columns"]) for name, table in kept["tables"].items()}
        return cls(tables=tables, numbers=kept["numbers"], claims=[Claim(**claim) for claim in kept["claims"]])


def plain(value: Any) -> Any:
    """A value as JSON has it: no numpy, no tuples, no numbers that are not finite."""
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_findings(findings: Findings, path: Path, key: str) -> None:
    """Write findings with the key of what they were found in, and a digest that shows damage."""
    text = json.dumps(findings.to_json())
    digest = hashlib.sha256((key + text).encode()).hexdigest()
    with replacing(path) as partial:
        partial.write_text(json.dumps({"key": key, "digest": digest, "findings": text}))


def read_findings(path: Path, key: str) -> Findings | None:
    """Findings from a file, or None where it is not there or belongs to another key. Raises ValueError for a damaged one."""
    if not path.exists():
        return None
    try:
        whole = json.loads(path.read_text(encoding="utf-8"))
        text = whole["findings"]
        digest = hashlib.sha256((whole["key"] + text).encode()).hexdigest()
        if digest != whole["digest"]:
            raise ValueError("it does not hold what was written")
        return Findings.from_json(json.loads(text)) if whole["key"] == key else None
    except (KeyError, TypeError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(str(error)) from error
