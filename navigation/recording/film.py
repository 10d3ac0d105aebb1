"""A run's recording as a film: the map with the path, what the agent sees, and what it turns to, side by side.

Everything is read from the recording, so a film needs neither the world nor the model.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from tussock.world.atomic import replacing
from tussock.world.errors import FileError, MissingDependencyError, SettingError, first_line
from tussock.world.progress import Progress, printed

from .log import PATH_COLOUR, ROUTE_COLOUR
from .recorded_walk import RecordedWalk, read_walk

Frame = UInt8[np.ndarray, "h w 3"]

SIZE, MAP = (1280, 720), 720  # pixels: width and height of a frame, and of the map at its left
MARGIN, LINE = 16, 22  # pixels: around panels, and of a line of text
INK, PAPER, GRID, CHOSEN = (30, 30, 30), (250, 250, 248), (205, 205, 205), (20, 140, 60)
AROUND = 0.5  # m of the world around the route and the path
GIF_WIDTH, GIF_COLOURS = 640, 64  # pixels; a GIF is larger than a video


@dataclass(frozen=True)
class Film:
    """Draws the frames of a walk."""

    walk: RecordedWalk
    ground: Frame
    low: Float[np.ndarray, "2"]
    scale: float

    @classmethod
    def of(cls, walk: RecordedWalk) -> "Film":
        """The film of a walk, with its map drawn."""
        xy = np.concatenate([walk.route, walk.places])
        middle, reach = (xy.min(axis=0) + xy.max(axis=0)) / 2, np.ptp(xy, axis=0).max() / 2 + AROUND
        low, scale = middle - reach, MAP / (2 * reach)
        ground = np.full((MAP, MAP, 3), PAPER, np.uint8)
        film = cls(walk, ground, low, scale)
        order = walk.triangles[..., 2].max(axis=1).argsort(kind="stable") if len(walk.triangles) else []
        for k in order:  # lower ones first, so that higher ones cover them
            cv2.fillConvexPoly(ground, film._pixels(walk.triangles[k, :, :2]), walk.rgb[k].tolist(), cv2.LINE_AA, 4)
        cv2.polylines(ground, [film._pixels(walk.route)], False, (255, 255, 255), 7, cv2.LINE_AA, 4)
        cv2.polylines(ground, [film._pixels(walk.route)], False, ROUTE_COLOUR, 3, cv2.LINE_AA, 4)
        cv2.drawMarker(ground, tuple(film._pixels(walk.route[-1:])[0] // 16), ROUTE_COLOUR, cv2.MARKER_STAR, 26, 3)
        film._scale_bar()
        return film

    def _pixels(self, xy: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "n 2"]:
        """Places on the map, in sixteenths of a pixel, as OpenCV takes them."""
        found = (np.asarray(xy) - self.low) * self.scale
        return np.rint(np.column_stack([found[:, 0], MAP - found[:, 1]]) * 16).astype(np.int32)

    def _scale_bar(self) -> None:
        metres = max(
            length for length in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if length * self.scale < MAP / 3 or length == 0.1
        )
        right, y = MARGIN + round(metres * self.scale), MAP - MARGIN
        cv2.line(self.ground, (MARGIN, y), (right, y), (255, 255, 255), 6)
        cv2.line(self.ground, (MARGIN, y), (right, y), INK, 2)
        _write(self.ground, f"{metres:g} m", (MARGIN, y - 8))

    def frame(self, number: int) -> Frame:
        """The frame of the walk's k-th step."""
        walk, step = self.walk, int(self.walk.steps[number])
        image = np.full((SIZE[1], SIZE[0], 3), PAPER, np.uint8)
        map_ = image[:, :MAP]
        map_[:] = self.ground
        path = self._pixels(walk.places[: number + 1])
        ways = np.split(path, np.flatnonzero(~walk.walked[: number + 1])[1:])
        cv2.polylines(map_, ways, False, PATH_COLOUR, 3, cv2.LINE_AA, 4)
        cv2.circle(map_, tuple(path[0] // 16), 6, PATH_COLOUR, -1, cv2.LINE_AA)
        ends = self._pixels(
            np.stack([walk.places[number], walk.places[number] + walk.facing[number] * 34 / self.scale])
        )
        cv2.arrowedLine(map_, tuple(ends[0] // 16), tuple(ends[1] // 16), PATH_COLOUR, 4, cv2.LINE_AA, tipLength=0.4)
        left, wide, y = MAP + MARGIN, SIZE[0] - MAP - 2 * MARGIN, MARGIN + LINE
        _write(image, f"step {step}", (left, y))
        y += LINE
        if step in walk.views:
            view = walk.views[step]
            tall = min(max(1, round(wide * view.shape[0] / view.shape[1])), 200)
            _write(image, "what the agent sees: left, ahead, right", (left, y))
            y += 8
            image[y : y + tall, left : left + wide] = cv2.resize(view, (wide, tall), interpolation=cv2.INTER_AREA)
            y += tall + LINE + 4
        if step in walk.familiarity:
            _write(image, "familiarity of headings, and the one it turns to", (left, y))
            self._draw_familiarity(image[y + 8 : y + 208, left : left + wide], number)
            y += 208 + 2 * LINE
        now, most = 100 * walk.deviations[number], 100 * walk.deviations.max()
        _write(image, f"distance from the route: {now:.1f} cm, at most {most:.1f} cm", (left, y))
        self._draw_deviations(image[y + 8 : SIZE[1] - MARGIN, left : left + wide], number)
        return image

    def _draw_familiarity(self, panel: Frame, number: int) -> None:
        """The familiarity of headings, from left behind to right behind, as in the view above it."""
        tall, wide = panel.shape[:2]
        values, degrees = self.walk.familiarity[int(self.walk.steps[number])], self.walk.degrees
        x = np.rint((degrees + 180) / 360 * (wide - 1)).astype(int)
        for label, at in (("left 180", 0), ("90", 0.25), ("ahead", 0.5), ("90", 0.75), ("right 180", 1)):
            cv2.line(panel, (round(at * (wide - 1)), 0), (round(at * (wide - 1)), tall - LINE), GRID, 1)
            width = cv2.getTextSize(label, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 1)[0][0]
            _write(panel, label, (round(at * (wide - width)), tall - 4), 0.45)
        height = np.where(np.isfinite(values), values, 0) / max(float(np.nanmax(values, initial=0)), 1e-12)
        y = np.rint((1 - height) * (tall - LINE - 6) + 3).astype(int)
        cv2.polylines(panel, [np.column_stack([x, y]).astype(np.int32)], False, INK, 2, cv2.LINE_AA)
        turned = self.turn(number)
        if turned is not None:
            at = round((turned + 180) / 360 * (wide - 1))
            cv2.line(panel, (at, 0), (at, tall - LINE), CHOSEN, 2)

    def turn(self, number: int) -> float | None:
        """Degrees to the right by which the agent turned at a step; None where it did not walk there, as the heading before is unknown."""
        if not self.walk.walked[number]:
            return None
        before, now = (complex(*self.walk.facing[k]) for k in (number - 1, number))
        return -float(np.degrees(np.angle(now / before)))

    def _draw_deviations(self, panel: Frame, number: int) -> None:
        """The distance from the route so far, over the steps of the whole walk."""
        tall, wide = panel.shape[:2]
        walk = self.walk
        x = np.linspace(0, wide - 1, max(len(walk.steps), 2))[: number + 1]
        y = (1 - walk.deviations[: number + 1] / max(float(walk.deviations.max()), 1e-9)) * (tall - 4) + 2
        cv2.line(panel, (0, tall - 1), (wide, tall - 1), GRID, 1)
        cv2.polylines(panel, [np.rint(np.column_stack([x, y])).astype(np.int32)], False, PATH_COLOUR, 2, cv2.LINE_AA)


def _write(image: Frame, text: str, at: tuple[int, int], size: float = 0.55) -> None:
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, PAPER, 4, cv2.LINE_AA)
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, INK, 1, cv2.LINE_AA)


def save_film(
    recording: str | os.PathLike,
    film: str | os.PathLike,
    *,
    steps_per_second: float = 10.0,
    progress: Progress | None = None,
) -> int:
    """Write a recording as a film.

    Args:
        recording: A run's recording, the file recording.rrd in its folder.
        film: File to write: .mp4 (needs the package imageio-ffmpeg) or .gif.
        steps_per_second: Speed.
        progress: Called with how many steps are drawn, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        The number of frames.

    Raises:
        FileError: For another kind of file, a recording without a walk, or a film that could not be written.
        SettingError: For another speed.
        MissingDependencyError: Where imageio-ffmpeg is needed, and missing.
    """
    progress = printed(progress, "drawing", "steps")
    recording, film = Path(recording), Path(film)
    writers = {".mp4": _mp4, ".gif": _gif}
    if film.suffix.lower() not in writers:
        raise FileError(f"{film}: a film is written as .mp4 or .gif")
    if not 0.1 <= steps_per_second <= 100:
        raise SettingError(f"--steps-per-second {steps_per_second:g}: give a speed from 0.1 to 100")
    walk = read_walk(recording)
    drawn = Film.of(walk)
    with replacing(film) as partial, writers[film.suffix.lower()](partial, steps_per_second) as add:
        for number in range(len(walk.steps)):
            add(drawn.frame(number))
            progress(number + 1, len(walk.steps))
        for _ in range(max(1, round(steps_per_second))):  # the end stays for a second
            add(drawn.frame(len(walk.steps) - 1))
    return len(walk.steps)


@contextmanager
def _mp4(path: Path, rate: float) -> Iterator[Callable[[Frame], Any]]:
    """Write frames as H.264, which browsers and slides play."""
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            "a film as .mp4 needs imageio-ffmpeg: pip install imageio-ffmpeg; .gif needs nothing more"
        ) from error
    options: dict[str, Any] = {"fps": rate, "codec": "libx264", "quality": None, "bitrate": "0"}
    options["output_params"] = ["-crf", "28", "-preset", "slow", "-movflags", "+faststart"]
    writer = imageio_ffmpeg.write_frames(os.fspath(path), SIZE, **options)
    sent: list[int] = []
    try:
        writer.send(None)
        yield lambda frame: (writer.send(np.ascontiguousarray(frame)), sent.append(1))
        writer.close()
        if imageio_ffmpeg.count_frames_and_secs(os.fspath(path))[0] != len(sent):  # it does not say when it fails
            raise FileError(f"{path} could not be written in full; is there room on its disk?")
    except (RuntimeError, OSError) as error:
        raise FileError(f"ffmpeg could not write the film ({first_line(error)}); write a .gif instead") from error
    finally:
        writer.close()


@contextmanager
def _gif(path: Path, rate: float) -> Iterator[Callable[[Frame], Any]]:
    """Write frames as a GIF of half the size, in few colours."""
    from PIL import Image

    frames: list[Frame] = []
    size = (GIF_WIDTH, GIF_WIDTH * SIZE[1] // SIZE[0])
    yield lambda frame: frames.append(cv2.resize(frame, size, interpolation=cv2.INTER_AREA))
    # The same colours in all frames, so that what stays the same costs nothing.
    some = np.concatenate(frames[:: max(1, len(frames) // 5)])
    colours = Image.fromarray(some).quantize(GIF_COLOURS)
    images = [Image.fromarray(frame).quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames]
    images[0].save(
        path,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=10 * max(1, round(100 / rate)),
        loop=0,
        optimize=True,
    )
