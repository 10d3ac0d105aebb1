"""What is wrong with an image database: files, names, positions, headings, and the axes of a grid."""

import logging
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.errors import FileError
from tussock.world.geometry import wrap_angle
from tussock.world.headings import CONVENTIONS, diagnose

from .database import assembled, check_kind, guessed_metadata, is_outside, stated_metadata
from .entries import ENTRIES, FRAME, read_entries
from .flow import grid_axes_error
from .folders import MASK_SUFFIX
from .inspection import Inspection, Problem, inspected
from .lens_metadata import stated_unwrapping
from .metadata import METADATA, group_in
from .pictures import SUFFIXES, check_content

logger = logging.getLogger(__name__)

POSITION_NAME = re.compile(r"_([+-]\d+)_([+-]\d+)_([+-]\d+)\.\w+$")  # mm
MAX_OFF_PATH = np.radians(60)  # a heading farther than this from the path on both sides is wrong ..
MAX_MEDIAN = np.radians(20)  # .. unless half of them are farther than this: then the positions jitter
REACHES = (1, 2, 4)  # rows over which the direction of the path is taken


def check_database(folder: str | os.PathLike, headings: str = "auto") -> list[Problem]:
    """All that is wrong with the database in a folder. What is only assumed about it is logged.

    Args:
        folder: The folder.
        headings: How its headings are meant, as `read_database` takes it; as-is leaves out their check.

    Raises:
        FileError: The folder has no entries file.
        SettingError: For an unknown convention of headings.
    """
    folder = Path(folder)
    if not (folder / ENTRIES).is_file():
        begun = (folder / METADATA).is_file()
        hint = (
            "if it was interrupted, the same command completes it" if begun else "give the folder of an image database"
        )
        raise FileError(f"there is no {folder / ENTRIES}; {hint}")
    problems: list[Problem] = []
    metadata: dict[str, Any] | None = {}
    try:
        metadata = stated_metadata(folder)
        if metadata is not None:
            check_kind(folder, metadata)
    except FileError as error:
        problems.append(Problem("damaged-metadata", METADATA, str(error)))
    try:
        entries = read_entries(folder / ENTRIES)
    except FileError as error:
        return [*problems, Problem("damaged-entries", ENTRIES, str(error))]
    if metadata is None:
        metadata = guessed_metadata(folder, entries.columns)
    try:
        inspection = inspected(assembled(folder, entries, metadata, headings), headings)
    except FileError as error:  # about the video
        return [*problems, Problem("unreadable-video", METADATA, str(error))]
    return problems + [problem for check in CHECKS for problem in check(inspection)]


def check_files(inspection: Inspection) -> Iterator[Problem]:
    """Rows without an image, with that of another row, with one outside or a damaged one; images without a row."""
    folder, lines = inspection.database.folder, {}
    if inspection.database.frames is not None:
        yield from _missing_frames(inspection)
        return
    for row, name in enumerate(inspection.database.names):
        where = inspection.line(row)
        if name is None:
            yield Problem("missing-image", where, "the row names no image")
        elif name in lines:
            yield Problem("row-twice", where, f"{name} is in line {lines[name]} already")
        elif is_outside(folder, name):
            yield Problem("name-leaves-folder", where, f"{name!r} is not in the folder; it was not opened")
        elif not os.path.isfile(folder / name):
            yield Problem("missing-image", where, f"there is no {name}")
        elif inspection.shapes[row] is None:
            yield Problem("unreadable-image", name, _why_unreadable(folder / name))
        lines.setdefault(name, inspection.database.lines[row])
    mask = group_in(inspection.database.metadata, "tussock", "eye").get("mask")
    if isinstance(mask, str) and mask.endswith(MASK_SUFFIX) and not os.path.isfile(folder / mask):
        yield Problem("missing-mask", METADATA, f"there is no {mask}, which is the mask of its eye")
    for path in sorted(folder.iterdir()):
        if (
            path.suffix.lower() in SUFFIXES
            and not path.name.startswith(".")
            and path.name not in lines
            and path.name != mask
        ):
            yield Problem("unlisted-image", path.name, "no row names it")


def _missing_frames(inspection: Inspection) -> Iterator[Problem]:
    """Rows of frames that the video does not have."""
    numbers = inspection.database.frames or ()
    for row, number in enumerate(numbers):
        if inspection.shapes[row] is None:
            what = f"{FRAME} is {number}; the video ends before it"
            yield Problem("missing-frame", inspection.line(row), what)


def _why_unreadable(path: Path) -> str:
    try:
        check_content(path)
    except FileError:
        return "it is only a pointer of Git LFS, not the image itself; run git lfs pull in its repository"
    return "it is not an image of 8 bits, or not complete"


def check_sizes(inspection: Inspection) -> Iterator[Problem]:
    """Images of another size than most of them, or most of them of another size than the metadata has."""
    sizes = [None if shape is None else f"{shape[1]} x {shape[0]}" for shape in inspection.shapes]
    usual = None if inspection.usual_shape is None else "{1} x {0}".format(*inspection.usual_shape)
    resolution = _numbers(inspection.database.metadata, "camera", "resolution")
    stated = resolution and f"{resolution[0]:g} x {resolution[1]:g}"
    if stated and usual and stated != usual:
        yield Problem("image-size", METADATA, f"the resolution is {stated}, most images are {usual}")
    for size, name in dict.fromkeys(zip(sizes, inspection.database.names, strict=True)):
        if size and size != usual:
            yield Problem("image-size", name or "", f"it is {size}, most images are {usual}")


def check_names(inspection: Inspection) -> Iterator[Problem]:
    """Positions in the names of images (mm) that differ from those in their rows."""
    database = inspection.database
    matches = [POSITION_NAME.search(name or "") for name in database.names]
    named = np.array([[float(n) for n in match.groups()] if match else [np.nan] * 3 for match in matches])
    named, given = named.reshape(-1, 3), np.column_stack([database.poses[:, :2], database.z]) * 1e3
    differs = np.abs(named - given) > 1  # False for nan
    rows, heights = np.flatnonzero(differs[:, :2].any(axis=1)).tolist(), np.flatnonzero(differs[:, 2]).tolist()
    if rows:
        swapped = np.abs(named[rows][:, [1, 0]] - given[rows, :2]).max(axis=1) <= 1
        hint = "; x and y are exchanged" if swapped.mean() > 0.9 else ""
        first = "X {:g}, Y {:g}".format(*given[rows[0], :2])
        what = f"{len(rows)} rows have another position than the names of their images, the first at {first}{hint}"
        yield Problem("place-differs-from-name", inspection.line(rows[0]), what)
    if heights:
        row = heights[0]
        first = f"the first {given[row, 2]:g} instead of {named[row, 2]:g}"
        what = f"{len(heights)} rows have another Z than the names of their images, {first}"
        yield Problem("height-differs-from-name", inspection.line(row), what)


def check_headings(inspection: Inspection) -> Iterator[Problem]:
    """Headings of a route that follow another convention, or single ones that do not lead along it.

    Headings that have nothing to do with the path, such as those of a drone that faces north all the time, are logged as a remark.
    """
    if inspection.database.kind != "route" or inspection.headings == "as-is":
        return
    poses = inspection.database.poses
    without = np.flatnonzero(np.isfinite(poses[:, :2]).all(axis=1) & np.isnan(poses[:, 2]))
    if len(without):
        where = f"{inspection.database.folder}, {inspection.line(int(without[0]))}"
        logger.warning(
            "%s: %d of %d rows have no heading; --headings path takes the path's", where, len(without), len(poses)
        )
    diagnosis = diagnose(poses, inspection.headings if inspection.headings in CONVENTIONS else "bearing")
    if diagnosis.kind == "convention":
        yield Problem("heading-convention", ENTRIES, f"{diagnosis}; {diagnosis.flags}")
    elif str(diagnosis):
        logger.warning("%s: %s", inspection.database.folder, diagnosis)
    else:
        yield from _single_headings(inspection, _off_path(poses))


def _single_headings(inspection: Inspection, off: Float[np.ndarray, " n"]) -> Iterator[Problem]:
    """Headings that are wrong among right ones. Several in succession are a manoeuvre, such as a robot that backs up: a remark."""
    if np.nanmedian(np.r_[off, np.nan, 0]) > MAX_MEDIAN:
        return
    wrong = off > MAX_OFF_PATH  # False for nan
    alone = wrong & ~(np.r_[False, wrong[:-1]] & np.r_[wrong[1:], False])
    alone &= ~(np.r_[False, (wrong & ~alone)[:-1]] | np.r_[(wrong & ~alone)[1:], False])
    rows, others = np.flatnonzero(alone).tolist(), np.flatnonzero(wrong & ~alone).tolist()
    if rows:
        degrees = np.degrees(off[rows[0]])
        what = f"{len(rows)} headings are over 60 degrees off the path, the first by {degrees:.0f}"
        yield Problem("heading-off-path", inspection.line(rows[0]), what)
    if others:
        where = f"{inspection.database.folder}, {inspection.line(others[0])}"
        logger.warning(
            "%s: %d successive headings are over 60 degrees off the path; does it turn or back up?", where, len(others)
        )


def heading_convention_error(poses: Float[np.ndarray, "n 3"]) -> str | None:
    """A sentence if the headings of a database's route follow its path in another convention than bearings, with that convention.

    None if they follow the path, if they have nothing to do with it, and if that is undetermined.
    """
    diagnosis = diagnose(poses, "bearing")
    return str(diagnosis) if diagnosis.kind == "convention" else None


def _off_path(poses: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Angle between each heading and the path (rad), nan where there is none.

    The path of a row has the directions from the segment before it to that after it, and those of longer chords around it: the
    nearest counts, so that neither turns nor jitter of the positions count.
    """
    off = np.full(len(poses), np.nan)
    for reach in REACHES:
        x, y = poses[:, 0], poses[:, 1]
        chord = np.column_stack([x[reach:] - x[:-reach], y[reach:] - y[:-reach]])
        along = np.where(np.hypot(*chord.T) > 1e-6, np.arctan2(chord[:, 1], chord[:, 0]), np.nan)
        none = np.full(min(reach, len(poses)), np.nan)
        before, after = np.r_[none, along], np.r_[along, none]
        turn, from_before, from_after = (
            wrap_angle(each) for each in (after - before, poses[:, 2] - before, after - poses[:, 2])
        )
        between = np.abs(from_before) + np.abs(from_after) <= np.abs(turn) + 1e-6
        off = np.fmin(off, np.where(between, 0.0, np.fmin(np.abs(from_before), np.abs(from_after))))
    return off


def check_extent(inspection: Inspection) -> Iterator[Problem]:
    """Fewer rows than there should be, or a grid that is not where its metadata puts it."""
    metadata, poses = inspection.database.metadata, inspection.database.poses
    views = _numbers(metadata, "tussock", "views", at_least=1)
    size = _numbers(metadata, "grid", "size") if inspection.database.kind == "grid" else None
    expected = views[0] if views else np.prod(size) if size else 0
    if len(poses) < expected:
        what = f"{len(poses)} rows of {expected:.0f}; if it was interrupted, the same command completes it"
        yield Problem("rows-missing", ENTRIES, what)
    begin, spacing = _numbers(metadata, "grid", "beginAtMM"), _numbers(metadata, "grid", "separationMM")
    if not (size and begin and spacing):
        return
    with np.errstate(all="ignore"):  # the metadata may hold any number
        index = (poses[:, :2] * 1e3 - begin[:2]) / np.where(np.array(spacing[:2]) > 0, spacing[:2], 1)
    inside = (np.abs(index - np.rint(index)) < 0.01) & (index > -0.5) & (index < np.array(size[:2]) - 0.5)
    wrong = np.flatnonzero(~inside.all(axis=1) & np.isfinite(index).all(axis=1)).tolist()
    if wrong:
        x, y = poses[wrong[0], :2] * 1e3
        what = f"{len(wrong)} rows are not in the grid of {METADATA}, the first at X {x:g}, Y {y:g}"
        yield Problem("grid-metadata", inspection.line(wrong[0]), what)


def check_unwrapping(inspection: Inspection) -> Iterator[Problem]:
    """Raw pictures without a way to unwrap them."""
    if inspection.needs_unwrapping and inspection.usual_shape is not None:
        try:
            height, width = inspection.usual_shape[:2]
            stated_unwrapping(inspection.database.metadata, height, width, Path(METADATA))
        except FileError as error:
            yield Problem("needs-unwrapping", METADATA, str(error))


def check_axes(inspection: Inspection) -> Iterator[Problem]:
    """Axes of a grid that are exchanged, mirrored or turned, as its views show."""
    database = inspection.database
    if database.kind == "grid" and not inspection.needs_unwrapping:
        usable = [shape is not None and shape[:2] == inspection.usual_shape for shape in inspection.shapes]
        if error := grid_axes_error(database, np.flatnonzero(usable)):
            yield Problem("grid-axes", ENTRIES, error)


def _numbers(metadata: dict[str, Any], group: str, name: str, at_least: int = 2) -> list[float] | None:
    """Numbers from metadata, or None where there are not enough, or anything else."""
    values = group_in(metadata, group).get(name)
    values = values if isinstance(values, list) else [values]
    numbers = [float(value) for value in values if isinstance(value, int | float) and np.isfinite(value)]
    return numbers if len(numbers) == len(values) >= at_least else None


CHECKS = (check_files, check_sizes, check_unwrapping, check_names, check_headings, check_extent, check_axes)
