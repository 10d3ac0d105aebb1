"""The commands that re-run published experiments, one for each registered protocol. Heavy packages are imported where they are used."""

import ast
import shlex
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from tussock.world.errors import SettingError
from tussock.world.meshes.reading import MeshReading

from .command import WorkerOptions
from .options import WORLD, MeshOptions, flags_of
from .terminal import message, progress

if TYPE_CHECKING:
    from ..studies.protocols import Protocol
    from ..sweeps.spec import Change, Sweep


@dataclass
class ProtocolCommand(WorkerOptions, MeshOptions):
    """Do a published experiment again."""

    PROTOCOL: ClassVar[str]
    world: Annotated[str | None, tyro.conf.arg(help=WORLD + " Default: that of the protocol.")] = None
    route: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="FILE")] = ()
    """A route through that world, or a folder of routes; give it several times, or with commas in between. Default: generated routes."""
    worlds: int | None = None
    """Number of generated worlds, or of generated routes through a given world. Default: that of the original."""
    seed: int = 0
    """Seed of the first generated world and route, the others follow; and of all noise and first weights."""
    cull_back_faces: bool = False
    """See triangles only from their front, as the original Sussex renderer did."""
    as_published: bool = False
    """The procedure of the original in every detail that is known, where the protocol has such a variant (docs/protocols.md)."""
    quick: bool = False
    """A first look of some minutes: fewer worlds and starts."""
    out: Path | None = None
    """Folder for the runs and the report; runs that are finished there are not done again. Default: the protocol's name."""
    overwrite: bool = False
    """Replace the report of something else in the folder."""

    def run(self) -> dict[str, Any]:
        workers = self.started_workers()
        from ..reports.report import check_report_folder
        from ..studies.protocols import prepared
        from ..studies.protocols.replication import replicate

        protocol = self.protocol()
        out = self.out or Path(protocol.name)
        self.check()
        routes = self.choices(protocol)
        sweep = self.sweep(protocol, routes)
        about = self.about(protocol, sweep)
        check_report_folder(out, about, overwrite=self.overwrite)
        sweep = self.sweep(protocol, prepared(protocol, routes, out))
        message(f"{len(sweep)} runs: {sweep}")
        with progress("walking", "runs", verbose=True) as report:
            command = self.command(out)
            return replicate(protocol, sweep, out, about=about, command=command, workers=workers, progress=report)

    def protocol(self) -> "Protocol":
        """The protocol of this command, or its variant. Raises SettingError for something else of that name, and without a variant."""
        from ..studies.protocols import PROTOCOLS, Protocol

        protocol = PROTOCOLS.find(self.PROTOCOL)
        if not isinstance(protocol, Protocol):
            raise SettingError(
                f"{self.PROTOCOL!r} is a {type(protocol).__name__}; give the name of a Protocol (tussock.navigation.studies.protocols)"
            )
        if not self.as_published:
            return protocol
        if protocol.as_published is None:
            raise SettingError(f"--as-published: {self.PROTOCOL} has no such variant; leave it out")
        return protocol.as_published

    def check(self) -> None:
        """Refuse flags that make no sense, alone or together. Raises SettingError."""
        if self.worlds is not None and self.worlds < 1:
            raise SettingError(f"--worlds {self.worlds}: give at least 1")
        if self.worlds is not None and self.route:
            raise SettingError("--worlds is for generated routes; give it, or --route")
        if self.route and self.world is None:
            raise SettingError("--route leads through a world; give --world as well")
        self.chosen_workers()

    def routes(self) -> list[Path]:
        """The given route files and folders."""
        return [Path(name) for given in self.route for name in given.split(",") if name]

    def choices(self, protocol: "Protocol") -> "list[Change]":
        """The worlds with one route each, as they are given. Raises InputError."""
        from ..studies.protocols import route_files, routes_in

        count = self.worlds or (protocol.quick_worlds if self.quick else protocol.worlds)
        world, reading = self.world or protocol.world, self.reading()
        files = route_files(self.routes(), protocol.route_names, Path(world) if Path(world).is_file() else None)
        routes: list[Change] = routes_in(world, files, seed=self.seed, count=count)
        return routes if reading == MeshReading() else [{**each, "reading": reading} for each in routes]

    def sweep(self, protocol: "Protocol", routes: "list[Change]") -> "Sweep":
        """The runs on routes, each checked. Raises InputError."""
        return protocol.sweep(routes, quick=self.quick, cull_back_faces=self.cull_back_faces, seed=self.seed)

    def about(self, protocol: "Protocol", sweep: "Sweep") -> dict[str, Any]:
        """The choices made, for the head of the report."""
        from tussock.world.params import is_generated

        world, count = self.world or protocol.world, len(sweep.axes["route"])
        seeds = f"seed {self.seed}" if count == 1 else f"seeds {self.seed} to {self.seed + count - 1}"
        about: dict[str, Any] = {
            "Paper": protocol.paper,
            "World": f"{world}, generated" if is_generated(world) else world,
            "Routes": ", ".join(map(str, self.routes())) or f"{count}, generated, {seeds}",
            "Walks": f"{len(sweep) * (2 if protocol.both_ways else 1):,}",
        }
        if self.as_published:
            about["Variant"] = "as published"
        if self.route:
            about["Seed"] = self.seed
        if self.cull_back_faces:
            about["Triangles"] = "seen from their front only"
        if self.quick:
            about["Depth"] = "a first look (--quick)"
        return about

    def command(self, out: Path) -> str:
        """The command line that repeats this replication."""
        given = flags_of(self, type(self), leave_out=("scheduler", "workers", "out", "overwrite", "json", "route"))
        routes = [shlex.join(["--route", str(route)]) for route in self.routes()]
        return " ".join(
            filter(None, [f"tussock replicate {self.PROTOCOL}", given, *routes, f"--out {shlex.quote(str(out))}"])
        )


def protocol_commands(given: str = "") -> dict[str, type[ProtocolCommand]]:
    """A command for each registered protocol, and for `given` where it is a `package.module:NAME`."""
    from ..studies.protocols import PROTOCOLS

    return {name: _command(name) for name in [*PROTOCOLS.names, *[given] * (":" in given)]}


def _command(name: str) -> type[ProtocolCommand]:
    return type("ProtocolCommand", (ProtocolCommand,), {"PROTOCOL": name, "__doc__": sentence_of(name)})


def sentence_of(name: str) -> str:
    """What a protocol is about: the first line of its module's docstring. The module is read, not imported, as that takes long."""
    from ..studies.protocols import PROTOCOLS

    where = PROTOCOLS.where(name)
    if where is None:
        return getattr(PROTOCOLS.find(name), "question", name)
    module = where.partition(":")[0]
    try:
        spec = find_spec(module)
        source = getattr(spec and spec.loader, "get_source", lambda module: None)(module)
        return (ast.get_docstring(ast.parse(source or "")) or name).partition("\n")[0]
    except Exception:  # a package that does not work is reported when it is used; it must not break the help
        return name
