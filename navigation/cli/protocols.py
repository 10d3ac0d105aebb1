"""The commands that re-run other published experiments. Heavy packages are imported where they are used."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from tussock.world.errors import InputError

from .options import WORLD, flags_of
from .sweeps import check_workers
from .terminal import message as say
from .terminal import progress

if TYPE_CHECKING:
    from ..studies.protocols import Protocol
    from ..sweeps.spec import Choice, Sweep


@dataclass
class ProtocolCommand:
    """Do a published experiment again."""

    PROTOCOL: ClassVar[str]
    world: Annotated[str | None, tyro.conf.arg(help=WORLD + " Default: that of the protocol.")] = None
    route: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="FILE")] = ()
    """A route through that world; give it several times, or several with commas between them. Default: generated routes."""
    worlds: int | None = None
    """How many generated worlds, or generated routes through a world that is given. Default: as many as in the original."""
    seed: int = 0
    """Seed of the first generated world and route, the others follow; and of all noise and first weights."""
    cull_back_faces: bool = False
    """See triangles only from their front, as the original Sussex renderer did."""
    quick: bool = False
    """A first look of some minutes: fewer worlds and starts."""
    scheduler: Annotated[str | None, tyro.conf.arg(metavar="tcp://HOST:PORT")] = None
    """A running Dask scheduler, whose workers do the runs. Default: workers on this machine, for this command alone."""
    workers: int | None = None
    """How many of these. Default: one a core."""
    out: Path | None = None
    """Folder for the runs and the report; runs that are finished there are not done again. Default: the protocol's name."""
    overwrite: bool = False
    """Replace the report of something else that the folder holds."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        from ..studies.protocols import PROTOCOLS
        from ..studies.protocols.replication import replicate
        from ..studies.thesis.report import check_report_folder

        protocol, out = PROTOCOLS[self.PROTOCOL], self.out or Path(self.PROTOCOL)
        self.check()
        sweep = self.sweep(protocol)
        about = self.about(protocol, sweep)
        check_report_folder(out, about, overwrite=self.overwrite)
        say(f"{len(sweep)} runs: {', '.join(f'{len(choices)} of {name}' for name, choices in sweep.axes.items())}")
        given = flags_of(self, type(self), leave_out=("scheduler", "workers", "out", "overwrite", "json", "route"))
        given = " ".join([given] * bool(given) + [shlex.join(["--route", str(route)]) for route in self.routes()])
        command = f"tussock replicate {self.PROTOCOL}{' ' * bool(given)}{given} --out {shlex.quote(str(out))}"
        with progress("walking", "runs", verbose=True) as report:
            return replicate(
                protocol, sweep, out, about=about, command=command, scheduler=self.scheduler, workers=self.workers, progress=report
            )  # fmt: skip

    def check(self) -> None:
        """Refuse flags that make no sense, alone or together. Raises InputError."""
        if self.worlds is not None and self.worlds < 1:
            raise InputError(f"--worlds {self.worlds}: give at least 1")
        if self.worlds is not None and self.route:
            raise InputError("--worlds are those of generated routes; give it, or --route")
        if self.route and self.world is None:
            raise InputError("--route leads through a world; give --world as well")
        check_workers(self.scheduler, self.workers)

    def routes(self) -> list[Path]:
        """The route files that were given."""
        return [Path(name) for given in self.route for name in given.split(",") if name]

    def sweep(self, protocol: "Protocol") -> "Sweep":
        """The runs, each checked. Raises InputError."""
        import dataclasses

        from ..studies.protocols import places

        count = self.worlds or (protocol.quick_worlds if self.quick else protocol.worlds)
        chosen: list[Choice] = places(self.world or protocol.world, self.routes(), seed=self.seed, count=count)
        sweep = protocol.sweep(chosen, quick=self.quick)
        sweep = dataclasses.replace(
            sweep, fixed=sweep.fixed | {"cull_back_faces": self.cull_back_faces, "seed": self.seed}
        )
        for run in sweep.runs():
            run.check()
        return sweep

    def about(self, protocol: "Protocol", sweep: "Sweep") -> dict[str, Any]:
        """What it is done with, in words."""
        from tussock.world.params import is_generated

        world, count = self.world or protocol.world, len(sweep.axes["place"])
        seeds = f"seed {self.seed}" if count == 1 else f"seeds {self.seed} to {self.seed + count - 1}"
        routes = ", ".join(map(str, self.routes())) or f"{count}, generated, {seeds}"
        return {
            "Paper": protocol.paper,
            "World": f"{world}, generated" if is_generated(world) else world,
            "Routes": routes,
            "Walks": f"{len(sweep):,}",
        } | {key: value for key, given, value in (
            ("Seed", bool(self.routes()), self.seed),
            ("Triangles", self.cull_back_faces, "seen from their front only"), ("Depth", self.quick, "a first look (--quick)"),
        ) if given}  # fmt: skip


@dataclass
class Ardin2016Command(ProtocolCommand):
    """Ardin et al. 2016: errors along a route, by perfect memory, a mushroom body, Infomax and chance."""

    PROTOCOL = "ardin2016"


@dataclass
class Baddeley2012Command(ProtocolCommand):
    """Baddeley et al. 2012: a route held in an Infomax network that saw each view once, against perfect memory."""

    PROTOCOL = "baddeley2012"


@dataclass
class Azevedo2025Command(ProtocolCommand):
    """Azevedo Amin et al. 2025: how far from a route agents walk that begin up to 5.5 m beside it."""

    PROTOCOL = "azevedo2025"


@dataclass
class Kagioulis2024Command(ProtocolCommand):
    """Kagioulis et al. 2024: whether knowing the order of the learned views helps to follow a route."""

    PROTOCOL = "kagioulis2024"


REPLICATIONS = {
    each.PROTOCOL: each for each in (Ardin2016Command, Baddeley2012Command, Azevedo2025Command, Kagioulis2024Command)
}
