"""The commands that repeat published experiments that need neither a world nor images. Heavy packages are imported where they are used."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .command import Command
from .options import flags_of
from .terminal import progress


@dataclass(kw_only=True)
class Stone2017Command(Command):
    """Stone et al. 2017: path integration by the central complex, on 1,000 random flights at five levels of noise."""

    seed: int = 0
    """Seed of the flights and of all noise."""
    quick: bool = False
    """A first look: 100 flights, and fewer levels of noise."""
    out: Path = Path("stone2017")
    """Folder for the report."""
    overwrite: bool = False
    """Replace the report of something else in the folder."""

    def run(self) -> dict[str, Any]:
        from ..reports.report import check_report_folder
        from ..studies.protocols import STONE2017
        from ..studies.protocols.replication import compute

        about: dict[str, Any] = {"Paper": STONE2017.paper, "World": "none", "Seed": self.seed}
        if self.quick:
            about["Depth"] = "a first look (--quick)"
        check_report_folder(self.out, about, overwrite=self.overwrite)
        given = flags_of(self, type(self), leave_out=("out", "overwrite", "json"))
        words = ["tussock replicate stone2017", given, f"--out {shlex.quote(str(self.out))}"]
        with progress("flying", "parts", verbose=True) as report:
            return compute(
                STONE2017,
                self.out,
                seed=self.seed,
                quick=self.quick,
                about=about,
                command=" ".join(filter(None, words)),
                progress=report,
            )
