"""The metadata of an image database: YAML as OpenCV's FileStorage writes it.

OpenCV reads it. It is not written by OpenCV, whose writer loses text such as "true" and None, and whose versions write different
bytes, nor by PyYAML, which writes the text "1e5" as OpenCV reads a number.
"""

import json
import os
import re
from pathlib import Path
from typing import Any

import cv2

from tussock.world.atomic import replacing
from tussock.world.errors import FileError

from .pictures import check_content

METADATA = "database_metadata.yaml"

MAX_BYTES = 10**7
MAX_DEPTH = 1000  # levels of nesting; OpenCV's parser overflows its stack somewhere above 10,000
PLAIN = re.compile(r"[A-Za-z_]([A-Za-z0-9_ -]*[A-Za-z0-9_])?")  # text that YAML reads as text without quotes ..
NOT_TEXT = ("true", "false", "null", "nan", "inf", "yes", "no", "on", "off", "y", "n")  # .. except for these
MATRIX = {"rows", "cols", "dt", "data"}  # keys of a matrix, which OpenCV marks with a tag


def read_metadata(path: Path) -> dict[str, Any]:
    """Read a metadata file.

    Returns:
        What it has under its root: nested dicts and lists of text, numbers and None.

    Raises:
        FileError: The file is missing or damaged; the message names the line if it is known.
    """
    if not os.path.isfile(path):  # unlike Path.is_file, False for names that are too long
        raise FileError(f"there is no {path}; an image database is a folder that contains this file")
    root = read_storage(path).get("metadata")
    if not isinstance(root, dict):
        raise FileError(f"{path} has no 'metadata'; give the metadata of a database")
    return root


def group_in(metadata: dict[str, Any], *names: str) -> dict[str, Any]:
    """A group of metadata, or one inside it; empty where the metadata have anything else there."""
    for name in names:
        inner = metadata.get(name)
        metadata = inner if isinstance(inner, dict) else {}
    return metadata


def read_storage(path: Path) -> dict[str, Any]:
    """Read a file of OpenCV's FileStorage: YAML, JSON or XML. Raises FileError; the message names the line if it is known."""
    if not os.path.isfile(path):
        raise FileError(f"{path} cannot be read: there is no such file; give YAML, JSON or XML, as OpenCV writes it")
    check_content(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError(f"it is larger than {MAX_BYTES:,} bytes")
        return _parse(path.read_text(encoding="utf-8-sig"))
    except (ValueError, OSError, SystemError, cv2.error) as error:
        match = re.search(r"\((\d+)\): ([^'\n]+)", str(error.__cause__ or error))
        line, reason = (f", line {match[1]}", match[2]) if match else ("", str(error).splitlines()[0])
        raise FileError(f"{path}{line} cannot be read as YAML, as OpenCV writes it ({reason}); repair it") from error


def write_metadata(path: Path, metadata: dict[str, Any]) -> None:
    """Write a metadata file. Raises FileError if reading would not return the same metadata."""
    text = "%YAML:1.0\n---\n" + "\n".join(_block({"metadata": metadata}, "")) + "\n"
    try:
        same = repr(_parse(text).get("metadata")) == repr(metadata)  # repr, because nan is not equal to itself
    except (ValueError, SystemError, cv2.error):
        same = False
    if not same:
        raise FileError(f"{path}: OpenCV's YAML cannot hold this metadata; use plain names, text and numbers")
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="")


def _parse(text: str) -> dict[str, Any]:
    """All that a text holds. Raises ValueError, cv2.error or, as cv2 sometimes does, SystemError."""
    if not text.lstrip().startswith(
        ("%", "{", "<")
    ):  # YAML without its first line, which readers of BoB robotics do not need
        text = f"%YAML:1.0\n---\n{text}"
    text = re.sub(
        r"(?m)^( *)- (?=\[)", r"\1  - ", text
    )  # other writers of YAML do not indent lists of lists, as Kalibr's T_cam_imu
    depth = max(len(line) - len(line.lstrip(" ")) + line.count("-") + line.count(":") for line in text.split("\n"))
    if depth + sum(map(text.count, "[{<")) > MAX_DEPTH:
        raise ValueError("nested too deeply")
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)  # its nodes do not outlive it
    root = _value(storage.root())
    if not isinstance(root, dict):
        raise ValueError("it has no names")
    return root


def _value(node: Any) -> Any:
    if node.isMap():
        return {key: _value(node.getNode(key)) for key in node.keys()}  # noqa: SIM118 (not a dict)
    if node.isSeq():
        return [_value(node.at(i)) for i in range(node.size())]
    if node.isInt():
        return int(node.real())
    if node.isReal():
        return node.real()
    return node.string() if node.isString() else None


def _block(values: dict[str, Any], indent: str) -> list[str]:
    """Lines of a map."""
    lines = []
    for key, value in values.items():
        if isinstance(value, dict) and value:
            tag = " !!opencv-matrix" if set(value) == MATRIX else ""
            lines += [f"{indent}{key}:{tag}", *_block(value, indent + "   ")]
        else:
            lines.append(f"{indent}{key}: {_flow(value)}")
    return lines


def _flow(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key}: {_flow(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[ " + ", ".join(map(_flow, value)) + " ]"
    if isinstance(value, str):
        plain = PLAIN.fullmatch(value) and value.lower() not in NOT_TEXT
        return value if plain else json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):
        return repr(value).replace("inf", ".Inf").replace("nan", ".Nan")
    return "null" if value is None else str(int(value))
