"""The commands that repeat published experiments on published images. Heavy packages are imported where they are used."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from .command import Command
from .options import flags_of
from .terminal import message, progress


@dataclass(kw_only=True)
class Knight2019Command(Command):
    """Knight et al. 2019: headings recovered from published images of six outdoor routes, by perfect memory and Infomax."""

    database: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """The published images: a clone of BrainsOnBoard/sussex_library_square_data, after git lfs pull. See docs/protocols.md."""
    seed: int = 0
    """Seed of the first weights of Infomax."""
    out: Path = Path("knight2019")
    """Folder for the report."""
    overwrite: bool = False
    """Replace the report of something else in the folder."""

    def run(self) -> dict[str, Any]:
        from ..reports.report import check_report_folder
        from ..studies.protocols import KNIGHT2019
        from ..studies.protocols.library_square import present_sets
        from ..studies.protocols.replication import measure_images

        about = {"Paper": KNIGHT2019.paper, "Images": str(self.database), "Seed": self.seed}
        check_report_folder(self.out, about, overwrite=self.overwrite)
        message(f"{len(present_sets(self.database))} of 24 sets of images")
        given = flags_of(self, type(self), leave_out=("database", "out", "overwrite", "json"))
        words = [
            "tussock replicate knight2019 --database",
            shlex.quote(str(self.database)),
            given,
            f"--out {shlex.quote(str(self.out))}",
        ]
        with progress("comparing", "sets", verbose=True) as report:
            return measure_images(
                KNIGHT2019,
                self.database,
                self.out,
                seed=self.seed,
                about=about,
                command=" ".join(filter(None, words)),
                progress=report,
            )
