"""Trained models on disk: safetensors, with a JSON header that says what they are. Nothing in such a file is ever run."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import attrs
import numpy as np
import safetensors
import torch
from jaxtyping import Float
from safetensors.torch import save

from tussock.render.eye import Eye
from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from ..encoding import Encoding
from . import make_model
from .base import FamiliarityModel, Model, check_device

HEADER, VERSION = "tussock", 1


@dataclass(frozen=True, kw_only=True)
class TrainedModel:
    """What a model file holds: the model, and the encoding, eye and poses (n, 3) of the views it learned, where they are known."""

    model: FamiliarityModel
    encoding: Encoding | None
    eye: Eye | None
    poses: Float[np.ndarray, "n 3"] | None


def save_model(
    model: Model, path: str | os.PathLike, *, encoding: Encoding | None = None, eye: Eye | None = None,
    poses: Float[np.ndarray, "n 3"] | None = None,
) -> None:  # fmt: skip
    """Write a trained model; the same model gives the same bytes.

    encoding, eye: of the views it learned, so that it is not given others. poses: where these were taken.
    """
    if model.shape is None:
        raise InputError(f"{path}: this model has learned nothing yet; fit it before it is saved")
    model.check_learned(model.shape, model.learned)
    if poses is not None:
        check_poses(path, model, poses)
    device_free = {key: value for key, value in model.parameters.items() if key != "device"}
    header = {
        "version": VERSION, "model": model.name, "parameters": device_free, "shape": model.shape,
        "encoding": None if encoding is None else str(encoding), "eye": None if eye is None else attrs.asdict(eye),
    }  # fmt: skip
    tensors = {f"learned.{key}": tensor.detach().cpu().contiguous() for key, tensor in model.learned.items()}
    if poses is not None:
        tensors["poses"] = torch.tensor(poses)
    with replacing(path) as partial:
        partial.write_bytes(save(tensors, {HEADER: json.dumps(header, default=lambda number: number.item())}))


def check_poses(path: str | os.PathLike, model: Model, poses: np.ndarray) -> None:
    """Refuse poses that are not those of the views a trained model learned. Raises InputError."""
    if not (poses.ndim == 2 and poses.shape[1] == 3 and np.isfinite(poses).all()):
        raise InputError(f"{path}: its poses are not (n, 3) finite numbers; train it anew")
    snapshots, last = model.learned.get("snapshots"), model.learned.get("index")  # which matches are looked up by
    if snapshots is not None and len(poses) != len(snapshots):
        raise InputError(f"{path}: {len(poses)} poses for {len(snapshots)} snapshots; give the pose of each, or none")
    if last is not None and len(poses) <= int(last):
        raise InputError(f"{path}: {len(poses)} poses, and it knows view {int(last)}; give the pose of each, or none")


def first_line(error: Exception) -> str:
    """What an exception says, without the lines that only programmers read."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def load_model(path: str | os.PathLike, *, expect: str | None = None, device: str = "cpu") -> TrainedModel:
    """Read a trained model. Raises InputError for what is no such file, is damaged, or holds another model than `expect`."""
    path = Path(path)
    if not os.path.isfile(path):  # False for names too long, too
        raise InputError(f"there is no model file {path}")
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})[HEADER])
            if not isinstance(header, dict):
                raise ValueError("its header is no object")
            tensors = {key: file.get_tensor(key).clone() for key in file.keys()}  # noqa: SIM118
    except (safetensors.SafetensorError, KeyError, ValueError, RecursionError) as error:
        raise InputError(
            f"{path} is no model file of tussock's ({first_line(error)}); make one with tussock train"
        ) from error
    if header.get("version") != VERSION:
        raise InputError(
            f"{path} is a model file of version {header.get('version')}, this is version {VERSION}; train it anew"
        )
    if expect is not None and header.get("model") != expect:
        raise InputError(f"{path} holds a model {header.get('model')!r}, not {expect!r}")
    check_device(device)
    poses = tensors.pop("poses", None)
    learned = {key.removeprefix("learned."): tensor for key, tensor in tensors.items()}
    try:
        height, width = header["shape"]
        parameters = {
            key: tuple(value) if isinstance(value, list) else value for key, value in header["parameters"].items()
        }
        model = make_model(header["model"], **parameters, device=device)
        model.check_parameters()
        model.restore((height, width), learned)
        scan = model.scan(torch.zeros(1, height, width))  # what does not fit together shows here
        if scan.shape != (1, width) or not torch.isfinite(scan).all():
            raise ValueError("its numbers make no scan")
        encoding = None if header["encoding"] is None else Encoding.parse(header["encoding"])
        eye = None if header["eye"] is None else Eye(**header["eye"])
        if poses is not None and not poses.is_floating_point():
            raise ValueError(f"its poses are {poses.dtype}")
        where = None if poses is None else poses.double().numpy()
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError, ValueError) as error:
        raise InputError(f"{path} is damaged, or of another version ({first_line(error)}); train it anew") from error
    if where is not None:
        check_poses(path, model, where)
    return TrainedModel(model=model, encoding=encoding, eye=eye, poses=where)
