"""What the fields of an experiment are made of: encodings, models and navigators from their names, specs and files."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tussock.world.errors import FileError, SettingError
from tussock.world.specs import Spec

if TYPE_CHECKING:
    from .models.files import TrainedModel

MODEL_SUFFIX = ".safetensors"  # of files of trained models


def as_encoding(value: Any, experiment: Any = None) -> Any:
    """An encoding from a preset's name or a chain; a preset reduces the view of the eye to about FINE_WIDTH columns."""
    from .encoding import PRESETS, Encoding, automatic_resize

    if isinstance(value, Encoding):
        return value
    if not isinstance(value, str):
        raise SettingError(f"encoding is {value!r}; give a preset's name, a chain or an Encoding")
    return Encoding.named(value, resize=automatic_resize(experiment.eye) if value in PRESETS else 1.0)


def as_model(value: Any) -> Any:
    """A model from its spec, its file or an untrained one."""
    if isinstance(value, Path) or (isinstance(value, str) and value.endswith(MODEL_SUFFIX)):
        if not Path(value).is_file():
            raise FileError(f"there is no model file {value}; check the name")
        return Path(value)
    if isinstance(value, Spec):
        return value
    from .models import MODELS, model_spec
    from .models.base import Model
    from .models.two_memories import TwoMemories

    if isinstance(value, Model) and (value.shape is not None or value.seed or value.device != "cpu"):
        raise SettingError(
            f"{value!r} has learned, or has a seed or device; give an untrained model, and seed and device to the experiment"
        )
    return model_spec(str(value)) if isinstance(value, str | TwoMemories) else MODELS.spec_of(value)


def as_navigator(value: Any) -> Any:
    """A navigator from its spec."""
    from .steering import NAVIGATORS

    if isinstance(value, str):
        return NAVIGATORS.spec(value)
    if isinstance(value, Spec | type):
        return value if isinstance(value, Spec) else NAVIGATORS.spec_of(value)
    raise SettingError(f"navigator is {value!r}; give a spec, such as 'scan', or a class")


def check_matches(experiment: Any, trained: "TrainedModel") -> None:
    """Refuse a trained model that learned through another eye or encoding than an experiment has. Raises SettingError."""
    trained.check_eye(experiment.eye)
    if trained.encoding is not None and trained.encoding != experiment.encoding:
        raise SettingError(
            f"{experiment.model} learned views encoded as {str(trained.encoding)!r}, this experiment has {str(experiment.encoding)!r}; use "
            "the same"
        )


def check_start(experiment: Any) -> None:
    """Refuse flags of which one makes the other useless. Raises SettingError."""
    lost, carried = experiment.stopping.max_deviation, experiment.displacement.left
    if experiment.release and experiment.start_offset:
        raise SettingError("--offset-m is from the start of the route, --release-m from its end: give one of the two")
    if abs(carried) > lost and not experiment.stopping.put_back:
        raise SettingError(
            f"--displace-m {carried:g} is farther than --lost-m {lost:g}, where every walk ends: give a larger --lost-m"
        )
    if experiment.ground == "route" and experiment.body.collisions != "pass":
        raise SettingError(
            f"--collisions {experiment.body.collisions}: obstacles are known at one height; fly with --altitude-m, or leave it out"
        )
    if experiment.route_database is not None and experiment.test_change is not None:
        raise SettingError(
            f"--test-change {str(experiment.test_change)!r}: images show the world as it was when they were taken; leave it out"
        )
    if experiment.route_database is not None and experiment.body.collisions != "pass":
        raise SettingError(f"--collisions {experiment.body.collisions}: images have no obstacles; leave it out")
