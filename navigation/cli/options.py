"""What commands share: flags for the world, the eye, the route, what is learned, and how an agent walks.

A flag has the name of a setting (see `tussock.navigation.experiment_settings`), and its default is the experiment's.
"""

import dataclasses
import shlex
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import attrs
import tyro

from tussock.render.posture import Posture
from tussock.world.meshes.reading import MeshReading

from ..body import Body
from ..displacement import Displacement
from ..experiment import Experiment
from ..experiment_settings import TYPES, experiment_of, surroundings_of
from ..settings_table import degrees
from ..stopping import StoppingRules
from ..surroundings import Surroundings
from ..training_setup import TrainingSetup
from .command import Command

WORLD = (
    "A preset's name (tussock-field, meadow, scrub, tiny, hay-meadow, woodland, desert, orchard, arena), generated from a seed; its "
    "parameters may follow, as in 'tussock-field hill_height=0.5'. Or a file (.glb, .ply, .bin, .obj, ...). Or "
    "package.module:name of your own."
)


def default(kind: type, field: str) -> Any:
    """The default of a field of settings."""
    return attrs.fields_dict(kind)[field].default if attrs.has(kind) else getattr(kind, field)


@dataclass(kw_only=True)
class MeshOptions(Command):
    """How the file of a world is read."""

    up: str = default(MeshReading, "up")
    """The axis of the world's file that points up: x, y or z. auto: y for glTF, as its standard says, and z for all others."""
    unit: str = default(MeshReading, "unit")
    """The unit of the world's file: mm, cm, m, in or ft. auto: metres."""
    scale: float | None = default(MeshReading, "scale")
    """Metres in one unit of the world's file, in place of --unit."""
    strict: bool = default(MeshReading, "strict")
    """Refuse a world of which something would be lost, such as a texture that is not found; otherwise a warning names it."""

    def reading(self) -> MeshReading:
        """How these flags read a mesh. Raises SettingError."""
        return MeshReading(up=self.up, unit=self.unit, scale=self.scale, strict=self.strict)


@dataclass
class ViewOptions(MeshOptions):
    """What world is seen, through what eye."""

    world: Annotated[str, tyro.conf.arg(help=WORLD)] = default(Surroundings, "world")
    world_seed: int | None = None
    """Seed of a generated world. Default: --seed."""
    ground: Annotated[str, tyro.conf.arg(metavar="flat|mesh")] = default(Surroundings, "ground")
    """flat: the eye is above z = 0, or above the hills of a generated world. mesh: it is above the ground of the world's mesh, as of a
    scan (docs/your-data.md)."""
    max_slope_deg: float = degrees(default(Surroundings, "max_slope"))
    """Steepest ground of a mesh that can be stood and walked on."""
    altitude_m: float | None = None
    """Fly: the height of the eye over z = 0. Default: as --ground says."""
    seed: int = default(Surroundings, "seed")
    """Seed of everything random: the world and route where they are generated, the model's start, the heading noise."""
    size: str | None = None
    """Columns x rows of a panorama; a pixel wider than a degree is averaged from several rays. Default: 720x150, or the model file's."""
    renderer: str = default(Surroundings, "renderer")
    """auto (cpu), cpu, cuda (an NVIDIA GPU, for many views at once), egl or osmesa."""
    samples: int | None = None
    """Rays along each side of a pixel. Default: 1 where a pixel is at most a degree wide, else 4."""
    eye_height_m: float | None = None
    """Height of the eye above the ground. Default: 0.01, or that of image databases."""
    top_deg: float | None = None
    """Elevation of a panorama's upper edge. Default: 60, or that of image databases."""
    bottom_deg: float | None = None
    """Elevation of its lower edge. Default: -15, or that of image databases."""
    field_deg: float | None = None
    """Horizontal field of view, centred ahead; the rest of the circle is hidden from the model. Default: 360, or the model file's."""
    side: Annotated[str | None, tyro.conf.arg(metavar="both|left|right")] = None
    """left: only what the left eye sees, from ahead over the left to behind. right: likewise. Default: both, or the model file's."""
    overlap_deg: float | None = None
    """Width of what both eyes see ahead, for --side; negative: of a gap between them. Default: 0, or the model file's."""
    mask: str | None = None
    """A picture of what the eye sees of the panorama: white where it sees, black where it does not. Default: all, or the model file's."""
    eye: Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE")] = None
    """A compound eye: ant, bee, 'fly ommatidia=700', 'sphere ommatidia=1000', or a file (.eye or .csv). Default: every pixel of the
    panorama, or the model file's."""
    spectrum: Annotated[str | None, tyro.conf.arg(metavar="human|insect")] = None
    """human: views show red, green and blue. insect: they show ultraviolet in place of red, for the encodings uv and uv-green;
    'insect ground=0.2' gives the share of it that the ground reflects, as of sand (docs/eyes.md). Default: human, or the model file's."""
    cull_back_faces: bool = default(Surroundings, "cull_back_faces")
    """See triangles only from their front, as the original Sussex renderer did."""
    light: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Sun and sky, with shadows: 'sun azimuth_deg=90 elevation_deg=30', overcast, or 'daylight latitude_deg=51 longitude_deg=0
    time=2026-06-21T10:30'. Azimuths are counter-clockwise from east. Default: the light in the world's colours, without shadows."""
    gaze: Annotated[str, tyro.conf.arg(metavar="level|body")] = default(Posture, "gaze")
    """level: the head keeps the eye level. body: the eye pitches and rolls with the ground beneath the body (--ground mesh, hills)."""
    body_length_m: float = default(Posture, "body_length")
    """Length over which the ground's slope tilts the body, for --gaze body."""
    pitch_noise_deg: float = degrees(default(Posture, "pitch_noise"))
    """Standard deviation of noise on the pitch of the eye; each pose has its own."""
    roll_noise_deg: float = degrees(default(Posture, "roll_noise"))
    """Standard deviation of noise on its roll."""

    def settings(self) -> dict[str, Any]:
        """The settings of a run that these flags give."""
        names = [each.name for each in dataclasses.fields(self) if each.name in TYPES]
        return {name: getattr(self, name) for name in names}

    def surroundings(self) -> Surroundings:
        """The world, the route and the eye that these flags describe."""
        return surroundings_of(self.settings())


@dataclass
class RouteOptions(ViewOptions):
    """What world is seen, through what eye, and a route through it."""

    ground: Annotated[str, tyro.conf.arg(metavar="flat|mesh|route")] = default(Surroundings, "ground")
    """flat: the eye is above z = 0, or above the hills of a generated world. mesh: it is above the ground of the world's mesh, as of a
    scan (docs/your-data.md). route: it flies at the heights of the route's points (column z_m)."""
    route: Path | None = None
    """A route file (.csv, .txt, .mat, .npy or AntWorld .bin); without it one is generated."""
    route_seed: int | None = None
    """Seed of a generated route. Default: --seed."""
    route_length_m: float = default(Surroundings, "route_length")
    """Length of a generated route."""
    headings: Annotated[str, tyro.conf.arg(metavar="auto|ccw|bearing|radians|path|as-is")] = default(
        Surroundings, "headings"
    )
    """How the headings of the route's file are meant. auto reads and checks them, path takes the direction to the next point, as-is leaves
    out the check. Also radians-bearing, clockwise, ccw-from-north, backwards, bearing-backwards."""
    columns: Annotated[str | None, tyro.conf.arg(metavar="x,y,heading")] = None
    """Names of the columns of the route's file in their order, as in 'x [mm],y [mm],-,heading'; - skips one. Default: those of the file."""
    smooth_m: float = default(Surroundings, "smooth")
    """Average the positions of the route's file along the path, with a Gaussian window of this standard deviation; 0 is none."""


@dataclass
class SourceOptions(RouteOptions):
    """Where views come from, a world or image databases, and what is kept of them."""

    world: Annotated[str | None, tyro.conf.arg(help=f"{WORLD} Default: {default(Surroundings, 'world')}.")] = None
    route_database: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Image database of a route, in place of a world and a route: its images are learned. See docs/images-only.md."""
    grid_database: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Image database of the views around that route: what is seen at a position is the image taken nearest to it."""
    encoding: str | None = None
    """edges (the default), grey, sky, green, uv or uv-green; or a chain, such as 'foreground-mask | vertical-edges | resize 6'."""
    resize: float | None = None
    """Factor by which a view's width and height are reduced. Default: so that the width is 120."""
    blur: float = 0.0
    """Standard deviation (pixels of the view) of Gaussian smoothing before all else; 0 is none."""

    def experiment(self) -> Experiment:
        """The experiment that these flags describe. Raises InputError."""
        return experiment_of(self.settings())


@dataclass
class LearningOptions(SourceOptions):
    """What is learned along the route."""

    spacing_m: float = default(TrainingSetup, "spacing")
    """Distance between route views; those of an image database are as they are."""
    every: int = default(TrainingSetup, "every")
    """Learn every N-th route view."""
    learning_walk_m: float = 0.0
    """Also learn views displaced to both sides by up to this, each facing the route a little ahead; 0 is none."""
    parallel_views: int = default(TrainingSetup, "parallel_views")
    """In place of the learning walk's views, learn N at each position, spread over its reach and facing along the route. 0: its own."""
    goal_walk_m: float = default(TrainingSetup, "goal_walk")
    """Also learn views on a spiral about the end of the route, from 0.1 m to this far away, that face the end; 0 is none."""
    goal_turns: float = default(TrainingSetup, "goal_turns")
    """Number of turns of this spiral."""
    goal_views: int = default(TrainingSetup, "goal_views")
    """Number of views on this spiral."""
    goal_spread_deg: float = degrees(default(TrainingSetup, "goal_spread"))
    """These views face up to this much beside the end of the route, at random."""
    goal_only: bool = default(TrainingSetup, "goal_only")
    """Learn only the views of --goal-walk-m, and none along the route."""
    device: str = default(Experiment, "device")
    """Where the model learns and scans: cpu, cuda, another device of torch's, or auto: a GPU where there is one."""


@dataclass
class ModelOptions(LearningOptions):
    """What learns."""

    model: str = default(Experiment, "model")
    """A model's name (see tussock models), or a file that tussock train wrote: it knows its views, encoding and size.
    Parameters may follow the name, as in 'mushroom-body inputs=10 cells=20000' or 'mlp hidden_layer_sizes=100,50'.
    A model of your own is package.module:Class."""
    threads: int | None = None
    """Threads to draw, learn and match with. Default: one per core. What networks learn depends on it in its last digits."""
    use: str = ""
    """Classes of your own that the file of a model needs, as package.module:Class; several with commas between them."""

    def experiment(self) -> Experiment:
        """The experiment that these flags describe. Raises InputError."""
        import_used(self.use)
        return super().experiment()


@dataclass
class ChangeOptions(ModelOptions):
    """What learns, and what differs in the world when it is tested."""

    test_change: Annotated[str | None, tyro.conf.arg(metavar="CHANGE")] = None
    """What differs in the world after learning: 'removed amount=0.2', 'wind amount=0.5 direction_deg=90', moved, added, grown, mown,
    object, sun, clouds, eye-raised or eye-turned (docs/changes.md); several with | between them. Default: nothing."""
    change_seed: int | None = None
    """Seed of this change. Default: --seed."""


@dataclass
class RunOptions(ChangeOptions):
    """What a model learns, and how an agent walks: everything that decides a run."""

    learning_walk_m: float = default(TrainingSetup, "learning_walk")
    """Also learn views displaced to both sides by up to this, each facing the route a little ahead; 0 is the thesis's training."""
    step_m: float = default(Body, "step_length")
    """Length of a step."""
    offset_m: float = default(Experiment, "start_offset")
    """Start this far to the left of the route (negative: right)."""
    heading_noise_deg: float = degrees(default(Body, "heading_noise"))
    """Standard deviation of the noise on every turn."""
    collisions: Annotated[str, tyro.conf.arg(metavar="pass|stop|slide")] = default(Body, "collisions")
    """What plants and stones do to a step: let it pass through, stop it where the body touches one, or let it slide along."""
    body_radius_m: float = default(Body, "radius")
    """Radius of the body, which may not enter what it touches."""
    senses: str = default(Experiment, "senses")
    """How well the agent measures its heading and the distance it walks: ideal, robot, svo-gtsam, stankiewicz-webb, ant or bee, with their
    published noise, or dorsal-rim, a compass in the sky (docs/light.md); parameters may follow, as in 'ant compass_deg=10 speed=0.2'."""
    release_m: float = default(Experiment, "release")
    """Start this far from the end of the route, facing it, in place of the start of the route; 0 is there."""
    release_deg: float = degrees(default(Experiment, "release_direction"))
    """Direction of the world, counter-clockwise from east, in which --release-m lies from the end of the route."""
    displace_at: float = default(Displacement, "at")
    """Carry the agent to the side after this share of the route; see --displace-m."""
    displace_m: float = default(Displacement, "left")
    """How far, to the left of the route (negative: right). 0: it is not carried."""
    scan_deg: float | None = None
    """Width of the scan. Default: 180."""
    scan_about_deg: float | None = None
    """Centre the scan on this direction of the world instead of the present heading."""
    on_lost: Annotated[str, tyro.conf.arg(metavar="stop|reset|reset-nearest")] = "stop"
    """stop, or reset: put the agent back on the route at the waypoint after the furthest one reached, and count it. reset-nearest: the
    same, at the nearest point of the route."""
    waypoint_m: float = default(StoppingRules, "waypoint_spacing")
    """Distance along the route between these waypoints."""
    put_back_ahead_m: float | None = default(StoppingRules, "put_back_ahead")
    """With --on-lost reset: put back this far ahead of the nearest point of the route, in place of a waypoint."""
    arrive_m: float = default(StoppingRules, "arrival_radius")
    """Arrived within this distance of the route's end."""
    lost_m: float = default(StoppingRules, "max_deviation")
    """Lost beyond this distance from the route."""
    patience_m: float = default(StoppingRules, "patience")
    """Stuck after walking this far without getting farther along the route."""
    max_steps: int | None = None
    """Limit of steps. Default: as many as three times the route's length needs."""
    navigator: str = default(Experiment, "navigator")
    """What steers, with parameters after its name, as in 'lateral gain=4': scan (to the most familiar heading), stepped-scan, lateral,
    opponent, oscillator, familiarity-modulated, cast-and-surge, homing, average-landmark-vector, image-gradient, home-vector,
    path-integration, central-complex, blend or loop-breaker (docs/steering.md). One of your own is package.module:Class."""


def import_used(names: str) -> None:
    """Import the classes that --use names, so that files of models may need them. Raises SettingError where one cannot be imported."""
    if names:
        from ..encoding import STEPS
        from ..models import MODELS

        for name in filter(None, map(str.strip, names.split(","))):
            for registry in (MODELS, STEPS):
                registry.find(name)


def flags_of(options: object, kind: type, leave_out: Collection[str] = ()) -> str:
    """The flags that give options, those of the fields of `kind` that are not as by default, as they are typed."""
    words = []
    for each in dataclasses.fields(kind):
        value = getattr(options, each.name)
        if each.name in leave_out or value == each.default:
            continue
        flag = f"--{each.name.replace('_', '-')}"
        words += [flag] if value is True else [flag, str(value)]
    return shlex.join(words)
