"""Trained models, and their files: safetensors with a JSON header that describes them. Nothing in such a file is ever run."""

import json
import os
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import safetensors
import torch
from jaxtyping import Float
from safetensors.torch import save

from tussock.render.eye import Eye
from tussock.world.atomic import replacing
from tussock.world.errors import FileError, SettingError, first_line
from tussock.world.settings import instance_of, settings
from tussock.world.specs import Spec

from ..devices import check_device, chosen_device
from ..encoding import OLD_NAMES, STEPS, Encoding
from ..feature_mask import FeatureMask
from .base import FamiliarityModel, Model
from .registry import MODELS, split_prefix
from .specs import find_model, make_model, present_names
from .two_memories import TwoMemories

HEADER, VERSION = "tussock", 1
VISIBLE = "mask.visible"  # the tensor of the mask of a model that does not see everything


@settings
class TrainedModel:
    """A trained model with the encoding, eye and poses of its training views. They are compared with those of the views that it is given.

    Attributes:
        model: The model.
        encoding: Of the views; None where it is not known.
        eye: That saw the views; None where it is not known.
        poses: (n, 3) Of the views, x and y (m) and heading (rad); None where they are not known.
    """

    model: FamiliarityModel = instance_of(FamiliarityModel, attrs.NOTHING, "a model with fit(views) and scan(views)")
    encoding: Encoding | None = instance_of(Encoding | None, None, "an Encoding or None")
    eye: Eye | None = instance_of(Eye | None, None, "an Eye or None")
    poses: Float[np.ndarray, "n 3"] | None = attrs.field(default=None, eq=attrs.cmp_using(eq=np.array_equal))

    def __attrs_post_init__(self):
        self.check()

    def check_eye(self, eye: Eye) -> None:
        """Refuse an eye that is not that of the training views, where that is known. Raises SettingError."""
        if self.eye is not None and self.eye != eye:
            raise SettingError(
                f"the model learned through another eye ({self.eye}) than this one ({eye}); use the same"
            )

    def check(self) -> None:
        """Refuse an untrained model, and poses that cannot be those of the views that it learned. Raises SettingError."""
        if isinstance(self.model, Model) and self.model.shape is None:
            raise SettingError(f"{self.model.name} has learned nothing yet; call fit(views) first")
        self._check_mask()
        poses: Any = self.poses
        if poses is None:
            return
        array = isinstance(poses, np.ndarray) and poses.dtype.kind == "f" and poses.ndim == 2 and poses.shape[1] == 3
        if not (array and np.isfinite(poses).all()):
            raise SettingError("poses are not (n, 3) finite numbers; give x and y (m) and heading (rad) of each view")
        learned = getattr(self.model, "learned", {})
        snapshots, index = learned.get("snapshots"), learned.get("index")  # which matches are looked up by
        if snapshots is not None and len(poses) != len(snapshots):
            raise SettingError(f"{len(poses)} poses for {len(snapshots)} snapshots; give the pose of each, or none")
        if index is not None and len(poses) <= int(index):
            raise SettingError(
                f"{len(poses)} poses, and it knows view {int(index)}; give the pose of each view, or none"
            )

    def _check_mask(self) -> None:
        """Refuse a model that was trained as if the eye saw more or less than it does. Raises SettingError."""
        mask = getattr(self.model, "mask", None)
        if self.encoding is not None and self.eye is not None and mask != self.encoding.for_eye(self.eye).mask:
            raise SettingError(
                f"the model was not trained for what this eye sees ({self.eye}); call model.see(encoding.for_eye(eye).mask) before fit"
            )


def save_model(trained: TrainedModel, path: str | os.PathLike) -> None:
    """Write a trained model. The same model gives the same bytes.

    Raises:
        SettingError: For a class that does not derive from `Model`, and where a model has learned more since `trained` was made.
        FileError: Where the file cannot be written.
    """
    model, encoding, eye = trained.model, trained.encoding, trained.eye
    check_can_be_saved(model)
    assert isinstance(model, Model)
    trained.check()
    model.check_learned(model.shape, model.learned)  # type: ignore[arg-type]
    header = {
        "version": VERSION,
        "model": model_in_files(model),
        "parameters": {key: value for key, value in model.parameters.items() if key != "device"},
        "shape": model.shape,
        "encoding": None if encoding is None else encoding.text_in_files(),
        "eye": None if eye is None else eye.plain(),
    }
    tensors = {f"learned.{key}": tensor.detach().cpu().contiguous() for key, tensor in model.learned.items()}
    if (mask := model.mask) is not None:
        header["mask"] = {"normalised": mask.normalised, "gain": mask.gain} | (
            {"partial": True} if mask.partial else {}
        )
        tensors[VISIBLE] = mask.visible.contiguous()
    if trained.poses is not None:
        tensors["poses"] = torch.tensor(trained.poses)
    with replacing(path) as partial:
        partial.write_bytes(save(tensors, {HEADER: json.dumps(header, default=lambda number: number.item())}))


def check_can_be_saved(model: FamiliarityModel) -> None:
    """Refuse a model whose class knows no way to be saved. Raises SettingError."""
    if not isinstance(model, Model):
        raise SettingError(
            f"a {type(model).__name__} cannot be saved; derive it from tussock.navigation.models.base.Model"
        )


def load_model(path: str | os.PathLike, *, expect: str | None = None, device: str = "cpu") -> TrainedModel:
    """Read a trained model.

    A file names the class of its model and the steps of its encoding, but imports no code. A class from outside must be registered,
    an entry point of an installed package, or imported by its name before.

    Args:
        path: The file.
        expect: Name of the model that it must hold; None means any.
        device: Where the model scans; "auto" is a GPU where there is one.

    Raises:
        FileError: For a file that is not a model file, is damaged, or holds another model than `expect`.
        SettingError: For a device that cannot be used, or has too little memory.
    """
    device = chosen_device(device)
    check_device(device)
    expected = None if expect is None else model_in_files(make_model(expect))
    path = Path(path)
    try:
        header, tensors = _read(path)
        if header.get("version") != VERSION:
            raise FileError(
                f"{path} is a model file of version {header.get('version')}, this is version {VERSION}; train it anew"
            )
        trained = _trained(path, header, tensors, device)
        if expected is not None and header["model"] != expected:
            raise FileError(f"{path} holds a model {header['model']!r}, not {expect!r}; give another file")
        return trained
    except FileError:
        raise
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError, ValueError) as error:
        if _is_out_of_memory(error):
            raise SettingError(
                f"{path}: too little memory on device {device!r} ({first_line(error)}); free some, or give another device"
            ) from error
        raise FileError(f"{path} is damaged, or of another version ({first_line(error)}); train it anew") from error


def _read(path: Path) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
    """Header and tensors of a file. Raises FileError for anything but a model file."""
    if not os.path.isfile(path):  # False for names too long, too
        raise FileError(f"there is no model file {path}")
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})[HEADER])
            if not isinstance(header, dict):
                raise ValueError("its header is not an object")
            return header, {key: file.get_tensor(key).clone() for key in file.keys()}  # noqa: SIM118
    except (safetensors.SafetensorError, KeyError, ValueError, RecursionError) as error:
        raise FileError(
            f"{path} is not a model file of tussock ({first_line(error)}); make one with tussock train"
        ) from error


def _trained(path: Path, header: dict[str, Any], tensors: dict[str, torch.Tensor], device: str) -> TrainedModel:
    """The trained model that header and tensors describe. Raises errors of many kinds where they are damaged."""
    name, text = header["model"], header["encoding"]
    _check_known(path, name, text)
    height, width = header["shape"]
    target = find_model(name, importing=False)
    given = {key: tuple(value) if isinstance(value, list) else value for key, value in header["parameters"].items()}
    model = Spec(name, target, present_names(target, given)).make(device=device)
    poses = tensors.pop("poses", None)
    visible = tensors.pop(VISIBLE, None)
    if (visible is None) != (header.get("mask") is None):
        raise ValueError("its mask is incomplete")
    if visible is not None:
        model.see(FeatureMask(visible, **header["mask"]))
    model.restore((height, width), {key.removeprefix("learned."): tensor for key, tensor in tensors.items()})
    scan = model.scan(torch.zeros(1, height, width))  # tensors that do not fit together fail here
    if scan.shape != (1, width):
        raise ValueError("its numbers make no scan")
    if poses is not None and not poses.is_floating_point():
        raise ValueError(f"its poses are {poses.dtype}")
    return TrainedModel(
        model=model,
        encoding=None if text is None else Encoding.parse(text, importing=False),
        eye=None if header["eye"] is None else Eye(**header["eye"]),
        poses=None if poses is None else poses.double().numpy(),
    )


def model_in_files(model: Model) -> str:
    """The name of a model's class in a file."""
    if isinstance(model, TwoMemories):
        return model.prefix + model_in_files(model.first)
    return MODELS.name_in_files(type(model))


def _check_known(path: Path, model: str, encoding: str | None) -> None:
    """Refuse a file that needs classes from outside that are not known in this process. Raises FileError."""
    steps = [] if encoding is None else [part.split()[0] for part in encoding.split("|")]
    needed = [(MODELS, split_prefix(model)[1]), *((STEPS, OLD_NAMES.get(step, step)) for step in steps)]
    for registry, name in needed:
        if name not in registry:
            raise FileError(
                f"{path} needs the {registry.kind} {name!r}, which is not known here; install its package, or name it with "
                f"--use {name}"
            )


def _is_out_of_memory(error: Exception) -> bool:
    """Whether an error means too little memory, on a GPU or on the CPU, where torch raises no class of its own."""
    return isinstance(error, MemoryError | torch.cuda.OutOfMemoryError) or "DefaultCPUAllocator" in str(error)
