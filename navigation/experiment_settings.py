"""An experiment as flat settings: names with units and plain values, as sweep files, tables of runs and summaries hold them.

    {"world": "meadow", "seed": 7, "size": "720x150", "model": "infomax", "heading_noise_deg": 10.0, ...}

`experiment_of` and `settings_of` are each other's inverse. The flags of `tussock run` have the same names.
"""

import dataclasses
import math
import shlex
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs

from tussock.render.eye import Eye
from tussock.world.errors import SettingError
from tussock.world.meshes.reading import MeshReading

from .body import Body
from .content import label_of
from .experiment import MODEL_SUFFIX, Experiment
from .stopping import StoppingRules
from .surroundings import Surroundings
from .training_setup import TrainingSetup

if TYPE_CHECKING:
    from .encoding import Encoding
    from .models.files import TrainedModel

# Types of the settings, in the order of a table's columns. To add one: a field of `Experiment` or of the settings that it
# consists of; its name here (and in WALK_SETTINGS of experiment_keys.py if it changes only the walk); both directions in
# `experiment_of` and `settings_of`; and a flag of `RunOptions` in cli/options.py. It is part of the key of a run from then on, so
# no runs are added to earlier folders of sweeps.
TYPES: dict[str, Any] = {
    "world": str | None, "world_seed": int | None, "up": str, "unit": str, "scale": float | None, "strict": bool,
    "ground": str, "max_slope_deg": float,
    "seed": int, "size": str | None, "renderer": str, "samples": int | None,
    "eye_height_m": float, "top_deg": float, "bottom_deg": float, "field_deg": float | None, "mask": str | None,
    "cull_back_faces": bool, "route": Path | None,
    "route_seed": int | None, "route_length_m": float, "headings": str, "columns": str | None, "smooth_m": float,
    "encoding": str | None, "resize": float | None, "blur": float,
    "spacing_m": float, "every": int, "learning_walk_m": float, "device": str, "model": str, "threads": int | None, "step_m": float,
    "offset_m": float, "heading_noise_deg": float, "scan_deg": float | None, "scan_about_deg": float | None, "on_lost": str,
    "waypoint_m": float, "arrive_m": float, "lost_m": float, "patience_m": float, "max_steps": int | None, "navigator": str,
    "route_database": Path | None, "grid_database": Path | None,
}  # fmt: skip


def experiment_of(settings: Mapping[str, Any], models: "dict[Path, TrainedModel] | None" = None) -> Experiment:
    """The experiment that settings describe; those that are left out are as by default.

    Args:
        settings: Values by the names of TYPES.
        models: Trained models by their files; those that are read are added, so that many experiments read a file once.

    Raises:
        InputError: For an unknown name, and for what an experiment refuses.
    """
    given = _given(settings)
    trained = _trained(given, {} if models is None else models)
    surroundings = _surroundings(given, trained.eye if trained is not None else None)
    names = {"start_offset": "offset_m", "model": "model", "device": "device"}
    return Experiment(
        **surroundings,
        **{field: given[name] for field, name in names.items() if name in given},
        encoding=_encoding(given, surroundings["eye"], trained),
        navigator=_navigator(given),
        training=TrainingSetup(**_values(given, spacing="spacing_m", every="every", learning_walk="learning_walk_m")),
        body=Body(**_values(given, step_length="step_m", heading_noise="heading_noise_deg")),
        stopping=_stopping(given),
    )


def surroundings_of(settings: Mapping[str, Any]) -> Surroundings:
    """The surroundings that settings describe: the world, the route and the eye of `experiment_of`, and nothing else."""
    return Surroundings(**_surroundings(_given(settings), None))


def settings_of(experiment: Experiment) -> dict[str, Any]:
    """The settings that describe an experiment, by the names of TYPES; those that are derived from others are None."""
    from .encoding import describe_encoding

    training, body, stopping = experiment.training, experiment.body, experiment.stopping
    encoding, resize, blur = describe_encoding(experiment.encoding, experiment.eye)
    navigator, parameters = experiment.navigator, dict(experiment.navigator.parameters)
    scans = navigator.name == "scan"
    width, about = (parameters.pop("width", math.pi), parameters.pop("about", None)) if scans else (None, None)
    return _settings_of_surroundings(experiment) | {
        "encoding": encoding,
        "resize": resize,
        "blur": blur,
        "spacing_m": training.spacing,
        "every": training.every,
        "learning_walk_m": training.learning_walk,
        "device": experiment.device,
        "model": str(experiment.model),
        "threads": experiment.threads,
        "step_m": body.step_length,
        "offset_m": experiment.start_offset,
        "heading_noise_deg": degrees(body.heading_noise),
        "scan_deg": None if width is None else degrees(width),
        "scan_about_deg": None if about is None else degrees(about),
        "on_lost": "reset" if stopping.put_back else "stop",
        "waypoint_m": stopping.waypoint_spacing,
        "arrive_m": stopping.arrival_radius,
        "lost_m": stopping.max_deviation,
        "patience_m": stopping.patience,
        "max_steps": stopping.max_steps,
        "navigator": str(dataclasses.replace(navigator, parameters=parameters)),
        "route_database": None if experiment.route_database is None else str(experiment.route_database),
        "grid_database": None if experiment.grid_database is None else str(experiment.grid_database),
    }


def _settings_of_surroundings(surroundings: Surroundings) -> dict[str, Any]:
    eye, reading = surroundings.eye, surroundings.reading
    return {
        "world": None if surroundings.route_database is not None else label_of(surroundings.world, "world"),
        "world_seed": surroundings.world_seed,
        "up": reading.up,
        "unit": reading.unit,
        "scale": reading.scale,
        "strict": reading.strict,
        "ground": surroundings.ground,
        "max_slope_deg": degrees(surroundings.max_slope),
        "seed": surroundings.seed,
        "size": f"{eye.width}x{eye.height}",
        "renderer": surroundings.renderer,
        "samples": eye.samples,
        "eye_height_m": eye.z,
        "top_deg": degrees(eye.top),
        "bottom_deg": degrees(eye.bottom),
        "field_deg": degrees(eye.field),
        "mask": None if eye.mask is None else eye.mask.source or str(eye.mask),
        "cull_back_faces": surroundings.cull_back_faces,
        "route": None if surroundings.route is None else label_of(surroundings.route, "route"),
        "route_seed": surroundings.route_seed,
        "route_length_m": surroundings.route_length,
        "headings": surroundings.headings,
        "columns": surroundings.columns,
        "smooth_m": surroundings.smooth,
    }


@cache
def default_settings() -> dict[str, Any]:
    """The settings of an experiment that is as by default in everything."""
    return settings_of(Experiment())


def run_command(experiment: Experiment, out: str) -> str:
    """The command that does the run of an experiment alone, to the last bit."""
    defaults, words = default_settings(), []
    for name, value in settings_of(experiment).items():
        if value is not None and value != defaults[name]:
            flag = f"--{name.replace('_', '-')}"
            words += [flag] if value is True else [flag, str(value)]
    return shlex.join(["tussock", "run", *words, "--out", out])


def degrees(angle: float) -> float:
    """An angle (rad) in degrees: the number that was given, where it was given in degrees."""
    value = math.degrees(angle)
    candidates = (round(value, 9), value, math.nextafter(value, math.inf), math.nextafter(value, -math.inf))
    return next((each for each in candidates if math.radians(each) == angle), value)


def _values(given: Mapping[str, Any], **names: str) -> dict[str, Any]:
    """Those settings that are given, by the names of the fields that they are for; angles in radians."""
    return {
        field: math.radians(given[name]) if name.endswith("_deg") else given[name]
        for field, name in names.items()
        if name in given
    }


def _trained(given: Mapping[str, Any], models: "dict[Path, TrainedModel]") -> "TrainedModel | None":
    """The trained model that a setting names, if it does."""
    from .models.files import load_model

    name = str(given.get("model", ""))
    if not name.endswith(MODEL_SUFFIX):
        return None
    path = Path(name)
    if path not in models:
        models[path] = load_model(path, device=given.get("device", "cpu"))
    return models[path]


def _given(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that are not left out. Raises SettingError for an unknown name."""
    if unknown := [name for name in settings if name not in TYPES]:
        raise SettingError(f"{unknown[0]!r} is not a setting of a run; see tussock run --help")
    return {name: value for name, value in settings.items() if value is not None}


def _surroundings(given: Mapping[str, Any], known: Eye | None) -> dict[str, Any]:
    """The fields of `Surroundings`. known: the eye that a model was trained with."""
    names = (
        "world",
        "world_seed",
        "ground",
        "cull_back_faces",
        "route",
        "route_seed",
        "headings",
        "columns",
        "seed",
        "renderer",
        "threads",
    )
    databases = {name: Path(given[name]) for name in ("route_database", "grid_database") if name in given}
    if databases and "world" in given:
        raise SettingError(
            "--world and image databases: give one of the two, because the images take the place of a world"
        )
    fields: dict[str, Any] = {name: given[name] for name in names if name in given} | databases
    fields["reading"] = MeshReading(**_values(given, up="up", unit="unit", scale="scale", strict="strict"))
    fields |= _values(given, route_length="route_length_m", max_slope="max_slope_deg", smooth="smooth_m")
    Surroundings(**fields)  # refuses databases that are not there, before they are asked for their eye
    return fields | {"eye": _eye(given, known, **databases)}


def _eye(
    given: Mapping[str, Any], known: Eye | None, route_database: Path | None = None, grid_database: Path | None = None
) -> Eye:
    size = given.get("size") or (f"{known.width}x{known.height}" if known is not None else None)
    pixels = {} if size is None else dict(zip(("width", "height"), width_and_height(size), strict=True))
    names = {"samples": "samples", "z": "eye_height_m", "top": "top_deg", "bottom": "bottom_deg"}
    fields = pixels if known is None else pixels | {"field": known.field, "mask": known.mask, "known": known.known}
    fields |= _values(given, **names, field="field_deg", mask="mask")
    if route_database is None:
        eye = Eye(**fields)
    else:
        from tussock.render.images.folders import eye_of

        eye = eye_of(route_database, grid_database, fields)
    if known is not None and eye != known:
        raise SettingError(
            f"{given['model']} learned through another eye ({known}) than is asked for ({eye}); "
            "give the same --size, --samples, --eye-height-m, --top-deg, --bottom-deg, --field-deg and --mask, or none"
        )
    return eye


def width_and_height(size: str) -> tuple[int, int]:
    """Columns and rows from a text such as 720x150. Raises SettingError."""
    width, cross, height = size.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise SettingError(f"size {size!r}: give columns x rows, for example 720x150")
    return int(width), int(height)


def _encoding(given: Mapping[str, Any], eye: Eye, trained: "TrainedModel | None") -> "Encoding":
    from .encoding import PRESETS, Encoding, automatic_resize

    known = trained.encoding if trained is not None else None
    own = [name for name in ("encoding", "resize", "blur") if given.get(name)]
    if known is not None and not own:
        return known
    name = given.get("encoding", attrs.fields(Experiment).encoding.default)
    automatic = automatic_resize(eye) if name in PRESETS else 1.0
    encoding = Encoding.named(name, resize=given.get("resize", automatic), blur=given.get("blur", 0.0))
    if known is not None and encoding != known:
        raise SettingError(
            f"{given['model']} learned views encoded as {str(known)!r}, these settings ask for {str(encoding)!r}; leave out "
            f"{', '.join('--' + each for each in own)}"
        )
    return encoding


def _navigator(given: Mapping[str, Any]) -> Any:
    from .steering import NAVIGATORS

    spec = NAVIGATORS.spec(given.get("navigator", attrs.fields(Experiment).navigator.default))
    scan = _values(given, width="scan_deg", about="scan_about_deg")
    if scan and spec.name != "scan":
        raise SettingError(
            f"--scan-deg and --scan-about-deg are for the navigator scan; leave them out with {spec.name!r}"
        )
    if twice := scan.keys() & spec.parameters.keys():
        raise SettingError(
            f"the navigator's {', '.join(sorted(twice))} is also given by --scan-deg or --scan-about-deg; give it once"
        )
    if scan.get("width") == math.pi:  # as by default
        del scan["width"]
    return dataclasses.replace(spec, parameters={**spec.parameters, **scan})


def _stopping(given: Mapping[str, Any]) -> StoppingRules:
    on_lost = given.get("on_lost", "stop")
    if on_lost not in ("stop", "reset"):
        raise SettingError(f"--on-lost {on_lost!r}: give stop or reset")
    rules = _values(
        given, arrival_radius="arrive_m", max_deviation="lost_m", patience="patience_m", waypoint_spacing="waypoint_m"
    )
    return StoppingRules(**rules, max_steps=given.get("max_steps"), put_back=on_lost == "reset")
