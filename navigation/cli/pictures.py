"""The commands that make panoramas and image databases of pictures. Heavy packages are imported where they are used."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.world.errors import SettingError

from ..experiment_settings import width_and_height
from .command import Command
from .terminal import held_messages, progress
from .worlds import numbers

if TYPE_CHECKING:
    from tussock.render.images.camera import Camera
    from tussock.render.images.unwrapping import Unwrapping


@dataclass(kw_only=True)
class CameraOptions(Command):
    """How panoramas are made of pictures."""

    size: str | None = None
    """Columns x rows of a panorama. Default: as many as the ring has, up to 720 columns; of panoramas, as they are."""
    lens: str = "auto"
    """What the pictures are: ring, fisheye, omnidirectional, panorama or equirectangular. auto: panorama where they are at least twice as
    wide as high, else ring."""
    centre: Annotated[str | None, tyro.conf.arg(metavar="X,Y")] = None
    """Centre of the ring (pixels from the top left). Default: found in the pictures, as both radii."""
    inner_px: float | None = None
    """Radius of the ring's inner circle (pixels)."""
    outer_px: float | None = None
    """Radius of the ring's outer circle (pixels)."""
    offset_deg: float = 0.0
    """Where ahead is in the picture: clockwise from up, or to the right of the middle of a panorama."""
    flip: bool = False
    """The ring's outer circle is the upper edge of the panorama, as under a mirror; without it, the inner one is."""
    mirrored: bool = False
    """The picture is mirrored: clockwise in it is to the left, as in a picture of the sky that has ahead at its top."""
    calibration: Path | None = None
    """OpenCV's calibration (YAML, JSON or XML) of a fisheye lens (K, D) or an omnidirectional one (xi, K, D)."""
    looking: str = "up"
    """What the middle of a calibrated lens's picture shows: up, down or ahead."""
    top_deg: float | None = None
    """Elevation of the panorama's upper edge. Default: 60."""
    bottom_deg: float | None = None
    """Elevation of its lower edge. Default: -15."""
    field_deg: float | None = None
    """Horizontal field of pictures whose columns are a part of a panorama, about ahead. Default: 360. The rest is unknown."""
    every: int | None = None
    """Every N-th picture, row or frame."""
    format: str = "png"
    """png, or jpg."""
    quality: int = 80
    """Of jpg: 1 to 100."""

    def camera(self) -> "Camera":
        """The camera that these flags describe. Raises SettingError."""
        from tussock.render.images.camera import Camera

        centre = None if self.centre is None else numbers(self.centre, "--centre", "X,Y", "320,240")
        width, height = (None, None) if self.size is None else width_and_height(self.size)
        top, bottom = (None if each is None else math.radians(each) for each in (self.top_deg, self.bottom_deg))
        return Camera(
            lens=self.lens,
            calibration=self.calibration,
            looking=self.looking,
            centre=centre,
            inner=self.inner_px,
            outer=self.outer_px,
            offset=math.radians(self.offset_deg),
            flip=self.flip,
            mirrored=self.mirrored,
            top=top,
            bottom=bottom,
            width=width,
            height=height,
            field=None if self.field_deg is None else math.radians(self.field_deg),
        )


@dataclass(kw_only=True)
class UnwrapCommand(CameraOptions):
    """Make panoramas of the pictures of a panoramic lens: a picture, a folder of pictures, or a video."""

    source: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="in", metavar="IN")]
    """A picture, a folder of pictures, or a video."""
    out: Path
    """File to write (.png or .jpg) for a picture; a new folder for several."""
    picture: Path | None = None
    """Also draw the ring on the first picture, into this file (.png), to see whether it was found."""

    def run(self) -> dict[str, Any]:
        from tussock.render.images.panoramas import unwrap_files

        if self.format not in ("png", "jpg") or not 1 <= self.quality <= 100:
            raise SettingError(f"--format {self.format} --quality {self.quality}: give png, or jpg and 1 to 100")
        with progress("unwrapping", "pictures") as report:
            unwrapping, count = unwrap_files(
                self.source,
                self.out,
                self.camera(),
                1 if self.every is None else self.every,
                f".{self.format}",
                self.quality,
                self.picture,
                report,
            )
        return {"out": str(self.out), "panoramas": count} | described(unwrapping)


@dataclass(kw_only=True)
class DatabaseImportCommand(CameraOptions):
    """Make an image database of pictures or a video, and a table of where they were taken."""

    source: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="in", metavar="IN")]
    """A folder of pictures, a video, or a database whose images need unwrapping."""
    out: Path
    """Folder to write; one that was interrupted is completed."""
    track: Path | None = None
    """Table (text) with x, y and headings, and filename, frame or time. Default: the entries of the database IN."""
    columns: str | None = None
    """What its columns hold, where their names do not tell: x=East,y=North,heading=Yaw,filename=Photo; or names of all columns in order,
    as x,y,-,filename."""
    headings: str = "auto"
    """How its headings are meant: ccw, bearing, radians, path (along the path) or as-is. auto: by the name of the column."""
    unit: str | None = None
    """mm, cm, m, in or ft, of positions whose columns have no unit. Default: m."""
    kind: str | None = None
    """route or grid. Default: route, or that of the database IN."""
    start_s: float | None = None
    """Time in the table at which the video begins. Default: that of its first row."""
    eye_height_m: float | None = None
    """Height of the eye above z = 0. Default: that of the table, or 0."""
    mask: Path | None = None
    """Picture that is white where the eye sees and black where it is covered, of the size of the pictures or of the panoramas."""

    def run(self) -> dict[str, Any]:
        from tussock.render.images.importing import ImportSettings, import_database

        settings = ImportSettings(
            kind=self.kind,
            columns=self.columns,
            unit=self.unit,
            headings=self.headings,
            every=self.every,
            start=self.start_s,
            height=self.eye_height_m,
            mask=self.mask,
            format=self.format,
            quality=self.quality,
        )
        with progress("importing", "images") as report, held_messages() as let_go:

            def reached(done: int, total: int) -> None:
                let_go(True)
                report(done, total)

            database, written = import_database(self.out, self.source, self.track, self.camera(), settings, reached)
            let_go(written > 0)  # what is assumed was printed when the images were written
        eye = database.metadata["tussock"]["eye"]
        return {
            "database": str(self.out),
            "type": database.kind,
            "images": len(database),
            "written": written,
            "size": f"{eye['width']}x{eye['height']}",
            "mask": eye.get("mask"),
        }


def described(unwrapping: "Unwrapping") -> dict[str, Any]:
    """How panoramas were made, for a result."""
    import attrs

    lens = attrs.asdict(unwrapping.lens)
    known = {name: lens[name] for name in ("centre", "inner", "outer") if name in lens}
    kind = type(unwrapping.lens).__name__.lower()
    return {"lens": kind, **known, "size": f"{unwrapping.width}x{unwrapping.height}"}
