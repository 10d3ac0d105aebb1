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

from tussock.render.compound import as_compound
from tussock.render.eye import Eye
from tussock.render.posture import Posture
from tussock.render.spectrum import as_spectrum
from tussock.world.errors import SettingError
from tussock.world.meshes.reading import MeshReading
from tussock.world.settings import shown

from .body import Body
from .content import label_of
from .displacement import Displacement
from .experiment import Experiment
from .experiment_fields import MODEL_SUFFIX
from .settings_table import FIELDS, TYPES, as_field, as_setting, fields_of, read_settings
from .stopping import StoppingRules
from .surroundings import OF_WORLDS, Surroundings
from .training_setup import TrainingSetup

if TYPE_CHECKING:
    from .encoding import Encoding
    from .models.files import TrainedModel

ON_LOST = {
    "next-waypoint": "reset",
    "nearest-point": "reset-nearest",
}  # names of the setting, by where an agent is put back


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
    return Experiment(
        **fields_of(given) | surroundings,
        encoding=_encoding(given, surroundings["eye"], trained),
        navigator=_navigator(given),
        training=TrainingSetup(**fields_of(given, "training")),
        body=Body(**fields_of(given, "body")),
        displacement=Displacement(**fields_of(given, "displacement")),
        stopping=StoppingRules(**fields_of(given, "stopping"), **_put_back(given)),
    )


def surroundings_of(settings: Mapping[str, Any]) -> Surroundings:
    """The surroundings that settings describe: the world, the route and the eye of `experiment_of`, and nothing else."""
    return Surroundings(**_surroundings(_given(settings), None))


def settings_of(experiment: Experiment) -> dict[str, Any]:
    """The settings that describe an experiment, by the names of TYPES; those that are derived from others are None."""
    from .encoding import describe_encoding

    eye, databases = experiment.eye, experiment.route_database is not None
    encoding, resize, blur = describe_encoding(experiment.encoding, eye)
    navigator, parameters = experiment.navigator, dict(experiment.navigator.parameters)
    scans = navigator.name == "scan"
    width, about = (parameters.pop("width", math.pi), parameters.pop("about", None)) if scans else (None, None)
    return read_settings(experiment) | {
        "world": None if databases else label_of(experiment.world, "world"),
        "size": f"{eye.width}x{eye.height}",
        "mask": None if eye.mask is None else eye.mask.source or str(eye.mask),
        "eye": None if eye.compound is None else eye.compound.source or str(eye.compound),
        "route": None if experiment.route is None else label_of(experiment.route, "route"),
        "encoding": encoding,
        "resize": resize,
        "blur": blur,
        "scan_deg": as_setting("scan_deg", width),
        "scan_about_deg": as_setting("scan_about_deg", about),
        "model": str(experiment.model),
        "on_lost": ON_LOST[experiment.stopping.put_back_at] if experiment.stopping.put_back else "stop",
        "navigator": str(dataclasses.replace(navigator, parameters=parameters)),
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


def _trained(given: Mapping[str, Any], models: "dict[Path, TrainedModel]") -> "TrainedModel | None":
    """The trained model that a setting names, if it does."""
    name = str(given.get("model", ""))
    if not name.endswith(MODEL_SUFFIX):
        return None
    from .models.files import load_model

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
    _check_databases(given)
    fields = {name: value for name, value in fields_of(given).items() if name in attrs.fields_dict(Surroundings)}
    fields["reading"] = MeshReading(**fields_of(given, "reading"))
    fields["posture"] = Posture(**fields_of(given, "posture"))
    checked = Surroundings(**fields)  # refuses databases that are not there, before they are asked for their eye
    return fields | {"eye": _eye(given, known, checked)}


def _check_databases(given: Mapping[str, Any]) -> None:
    """Refuse what contradicts image databases, by its flag. Raises SettingError."""
    if not given.keys() & {"route_database", "grid_database"}:
        return
    usual = default_settings() | {"world": None}
    for name, value in given.items():
        if FIELDS.get(name, "").partition(".")[0] in OF_WORLDS and value != usual[name]:
            flag = f"--{name.replace('_', '-')}"
            raise SettingError(
                f"{flag} and image databases: give one of the two, because the images take the place of a world"
            )


def _eye(given: Mapping[str, Any], known: Eye | None, surroundings: Surroundings) -> Eye:
    size = given.get("size") or (f"{known.width}x{known.height}" if known is not None else None)
    pixels = {} if size is None else dict(zip(("width", "height"), width_and_height(size), strict=True))
    kept = ("field", "side", "overlap", "mask", "known", "compound", "spectrum")
    fields: dict[str, Any] = {**pixels} if known is None else pixels | {name: getattr(known, name) for name in kept}
    fields |= fields_of(given, "eye")
    if fields.get("spectrum") is not None:
        fields["spectrum"] = as_spectrum(fields["spectrum"])
    if fields.get("compound") is not None:
        fields["compound"] = as_compound(fields["compound"])
        if surroundings.route_database is None:
            fields = fields["compound"].panorama() | fields
    if surroundings.route_database is None:
        eye = Eye(**fields)
    else:
        from tussock.render.images.folders import eye_of

        eye = eye_of(surroundings.route_database, surroundings.grid_database, fields)
    if known is not None and eye != known:
        raise SettingError(f"{given['model']} learned through another eye: {_differences(known, eye, given)}")
    return eye


def _differences(known: Eye, asked: Eye, given: Mapping[str, Any]) -> str:
    """In what two eyes differ, and what to do: leave out the given settings that make it so, or train anew."""
    flags = {field.removeprefix("eye."): name for name, field in FIELDS.items()} | {"width": "size", "height": "size"}
    differing = [each for each in attrs.fields(Eye) if getattr(known, each.name) != getattr(asked, each.name)]
    values = [
        [f"{each.name} {shown(getattr(eye, each.name), each.metadata)}" for each in differing] for eye in (known, asked)
    ]
    names = dict.fromkeys(flags[each.name] for each in differing if given.get(flags.get(each.name, "")) is not None)
    leave = f"leave out {', '.join('--' + name.replace('_', '-') for name in names)}, or " if names else ""
    return f"{', '.join(values[0])}, not {', '.join(values[1])}; {leave}train anew"


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
    flags = {"width": "scan_deg", "about": "scan_about_deg"}
    scan = {parameter: as_field(name, given[name]) for parameter, name in flags.items() if name in given}
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


def _put_back(given: Mapping[str, Any]) -> dict[str, Any]:
    """The stopping rules that say whether, and where, an agent that is lost is put back."""
    on_lost = given.get("on_lost", "stop")
    if on_lost not in ("stop", *ON_LOST.values()):
        raise SettingError(f"--on-lost {on_lost!r}: give stop, {' or '.join(ON_LOST.values())}")
    at = next((at for at, name in ON_LOST.items() if name == on_lost), None)
    return {} if at is None else {"put_back": True, "put_back_at": at}
