"""Shared by the fuzz_*.py files: damage to files of any kind, and running properties under a limit of memory.

`python tests/fuzz_files.py world_files routes --examples 20000` searches for defects; test_fuzz.py tries each property on a few examples.
They run in a process of their own, without the type checks of the tests, so a failure here is one that users would meet.
"""

import argparse
import faulthandler
import json
import re
import resource
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from tussock.world.errors import InputError

T = TypeVar("T")
PROPERTIES: dict[str, tuple[Callable, int]] = {}

MEMORY = 3 * 2**30  # bytes that properties may take beyond those at the start
FOLDER = Path(tempfile.mkdtemp(prefix="fuzz-"))  # holds the input of a failure afterwards

NUMBERS = (0, 1, 2, 3, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1)
TOKENS = (
    b"0", b"-1", b"1e300", b"-1e18", b"nan", b"inf", b"1e400", b"2147483648", b"4611686018427387904", b"99999999999999999999", b"0.5",
    b"", b"null", b"true", b'"x"', b"[]", b"{}", b"[[[0]]]", b"\xff", b"\0", b"\n", b",", b"-", b"end_header", b"../..",
)  # fmt: skip
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.sampled_from([*NUMBERS, -1, 10**400, 10**9]) | st.floats() | st.text(max_size=5),
    lambda each: st.lists(each, max_size=4) | st.dictionaries(st.text(max_size=5), each, max_size=3),
    max_leaves=5,
)  # fmt: skip


@st.composite
def damaged(draw, whole: Sequence[bytes]) -> bytes:
    """One of some files with bytes changed, inserted, cut or repeated, numbers overwritten, or words and numbers of text exchanged."""
    data = bytearray(draw(st.sampled_from(whole)))
    for _ in range(draw(st.integers(1, 3))):
        near = draw(st.sampled_from([40, 400, len(data)]))
        at, length = draw(st.integers(0, min(near, len(data)))), draw(st.integers(0, 40))
        kind = draw(st.sampled_from(["flip", "insert", "cut", "end", "repeat", "number", "word", "word"]))
        if kind == "flip" and at < len(data):
            data[at] = draw(st.integers(0, 255))
        elif kind == "insert":
            data[at:at] = draw(st.binary(max_size=8) | st.sampled_from(TOKENS))
        elif kind == "cut":
            del data[at : at + length]
        elif kind == "end":
            del data[at:]
        elif kind == "repeat":
            data[at:at] = data[at : at + length] * draw(st.integers(1, 9))
        elif kind == "number":
            size = draw(st.sampled_from([4, 8]))
            data[at : at + size] = (draw(st.sampled_from(NUMBERS)) % 2 ** (8 * size)).to_bytes(size, "little")
        elif kind == "word":
            words = list(re.finditer(rb"-?[\d.]+(?:e-?\d+)?|[A-Za-z_]+", bytes(data[:4000])))
            if words:
                start, stop = draw(st.sampled_from(words)).span()
                data[start:stop] = draw(st.sampled_from(TOKENS))
    return bytes(data)


@st.composite
def damaged_json(draw, tree: Any) -> Any:
    """JSON with values exchanged, keys left out, or lists made longer, in a few places."""
    tree = json.loads(json.dumps(tree))
    for _ in range(draw(st.integers(1, 3))):
        entries = [
            (holder, key)
            for holder in _holders(tree)
            for key in (holder if isinstance(holder, dict) else range(len(holder)))
        ]
        if not entries:
            break
        holder, key = draw(st.sampled_from(entries))
        how = draw(st.sampled_from(["value", "value", "drop", "more"]))
        if how == "value":
            holder[key] = draw(VALUES)
        elif how == "drop":
            del holder[key]
        elif isinstance(holder, list):
            holder.extend(holder[key : key + 1] * draw(st.sampled_from([1, 3, 1000])))
        else:
            holder[draw(st.text(max_size=5))] = draw(VALUES)
    return tree


def _holders(tree: Any) -> list:
    """All lists and objects in JSON, the tree first."""
    if not isinstance(tree, dict | list):
        return []
    return [
        tree,
        *(holder for each in (tree.values() if isinstance(tree, dict) else tree) for holder in _holders(each)),
    ]


def answer(names: str | Path | None, ask: Callable[[], T]) -> T | None:
    """The result of `ask`, or None where it refuses with one line that contains `names`; anything else is a defect."""
    try:
        return ask()
    except InputError as error:
        message = str(error)
    assert "\n" not in message, message
    assert names is None or str(names) in message, message
    return None


def holds(examples: int) -> Callable[[Callable], Callable]:
    """Decorator: register a property under its name, with the number of examples that it is tried on by default.

    Those of a file that another one imports are left out: they are tried where that file runs.
    """

    def enter(run: Callable) -> Callable:
        if run.__module__ == "__main__":
            PROPERTIES[run.__name__] = run, examples
        return run

    return enter


def _address_space() -> int:
    """Size of the address space of this process (bytes)."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def main() -> None:
    """Run the properties that the command line names, or all."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", choices=[*PROPERTIES, []])
    parser.add_argument("--examples", type=int, default=None, help="of each property; default: few")
    parser.add_argument("--random", action="store_true", help="other examples in each run")
    arguments = parser.parse_args()
    faulthandler.enable()
    limit = _address_space() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    failed = []
    for name in arguments.names or PROPERTIES:
        run, few = PROPERTIES[name]
        chosen = settings(
            max_examples=arguments.examples or few, derandomize=not arguments.random, database=None, deadline=None,
            suppress_health_check=list(HealthCheck), print_blob=False,
        )  # fmt: skip
        try:
            chosen(run)()
        except BaseException:
            sys.excepthook(*sys.exc_info())
            failed.append(name)
        print(f"{name}: {'fails' if name in failed else 'holds'}", flush=True)
    sys.exit(bool(failed))
