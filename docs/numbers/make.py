"""Makes the numbers that README and docs print, from one list of measurements (measurements.py).

    python docs/numbers/make.py              all quick ones
    python docs/numbers/make.py --slow       all others
    python docs/numbers/make.py NAME ...     these
    python docs/numbers/make.py --pages      none; only write the pages again
    python docs/numbers/make.py --keep DIR NAME ...   work in this folder: runs that are finished there are not done again

Each is recorded in records/NAME.json: its values, and the command, commit, processor and day that they come from. The pages have marks,

    <!-- number: NAME.PART -->1.1 cm<!-- end of number -->

between which the record's text stands. Between `<!-- numbers: origin -->` and `<!-- end of numbers -->` stands where the numbers of
a page come from. Pictures are drawn into assets; their records have a digest of each.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import llvmlite.binding
from measurement import Measurement, NeedsSussex
from measurements import MEASUREMENTS

ROOT = Path(__file__).parents[2]
RECORDS = Path(__file__).parent / "records"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
NUMBER = re.compile(r"(<!-- number: ([\w-]+)\.([\w-]+) -->)(.*?)(<!-- end of number -->)", re.DOTALL)
ORIGIN = re.compile(r"(<!-- numbers: origin -->\n)(.*?)(<!-- end of numbers -->)", re.DOTALL)

Record = dict[str, Any]


def main() -> None:
    """Measure what is asked for, and write the pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MEASUREMENTS))
    parser.add_argument("--slow", action="store_true", help="those that take minutes, not the quick ones")
    parser.add_argument("--pages", action="store_true", help="measure nothing")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="a folder to work in, instead of one that is removed")
    options = parser.parse_args()
    if unknown := set(options.names) - MEASUREMENTS.keys():
        parser.error(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(MEASUREMENTS)}")
    quick_or_slow = [name for name, each in MEASUREMENTS.items() if each.slow == options.slow]
    for name in [] if options.pages else options.names or quick_or_slow:
        try:
            record(name, MEASUREMENTS[name], options.keep)
        except NeedsSussex as reason:
            print(f"{name}: left as it is; {reason}", file=sys.stderr)
    write_pages()


def record(name: str, measurement: Measurement, keep: Path | None = None) -> None:
    """Measure, and write the record. keep: a folder with runs that were finished earlier, and count as their own seconds say."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        values = measurement.measure(Path(keep or folder))
    seconds = values.pop("seconds", time.monotonic() - began)
    origin = {
        "command": measurement.command,
        "commit": commit(),
        "processor": llvmlite.binding.get_host_cpu_name(),
        "day": date.today().isoformat(),
        "seconds": round(seconds),
    }
    (RECORDS / f"{name}.json").write_text(json.dumps({"origin": origin, "values": values}, indent=1) + "\n")
    print(f"{name}: {seconds:.0f} s", file=sys.stderr)


def records() -> dict[str, Record]:
    """All records, by name."""
    return {path.stem: json.loads(path.read_text()) for path in sorted(RECORDS.glob("*.json"))}


def written(page: str, kept: Mapping[str, Record]) -> str:
    """The text of a page with the numbers of the records in it. Raises LookupError for a mark without a record or a text."""

    def number(mark: re.Match[str]) -> str:
        begin, name, part, _, end = mark.groups()
        return begin + MEASUREMENTS[name].texts[part](kept[name]["values"]) + end

    def origin(mark: re.Match[str]) -> str:
        lines = ["| numbers | command | commit | processor | day | seconds |", "|---|---|---|---|---|---|"]
        for name in sorted({number[2] for number in NUMBER.finditer(page)}):
            made = kept[name]["origin"]
            cells = (name, *(str(made[part]) for part in ("command", "commit", "processor", "day", "seconds")))
            lines.append(f"| {' | '.join(cells)} |")
        return mark[1] + "\n".join(lines) + "\n" + mark[3]

    return ORIGIN.sub(origin, NUMBER.sub(number, page))


def write_pages() -> None:
    """Write the numbers of all records into the pages."""
    kept = records()
    for path in PAGES:
        path.write_text(written(path.read_text(), kept))


def commit() -> str:
    """The commit that is checked out, with a + where files of the package differ from it."""

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    changed = git("status", "--porcelain", "--", "world", "render", "navigation")
    return git("rev-parse", "--short", "HEAD") + ("+" if changed else "")


if __name__ == "__main__":
    main()
