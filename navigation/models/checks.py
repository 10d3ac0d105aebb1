"""What models refuse: views and learned numbers that cannot be used."""

from collections.abc import Mapping

import torch
from jaxtyping import Float32

from tussock.world.errors import SettingError

# Columns of a view. At the upper limit the engine's matrices for the inverse transform take 67 MB each.
MIN_COLUMNS, MAX_COLUMNS = 4, 8192
MAX_VALUE = 1e12  # of a view, or learned: sums of squares over whole views stay far from the largest float32

Images = Float32[torch.Tensor, "n h w"]


def check_training(views: Images, partial: bool = False) -> None:
    """Refuse views that no model can learn; see `check_values`. Raises SettingError."""
    if views.ndim != 3 or len(views) == 0:
        raise SettingError(f"a model learns from at least one view (n, h, w), got shape {tuple(views.shape)}")
    if views.shape[1] < 1 or not MIN_COLUMNS <= views.shape[2] <= MAX_COLUMNS:
        raise SettingError(
            f"views of {views.shape[2]} x {views.shape[1]} pixels; give {MIN_COLUMNS} to {MAX_COLUMNS} columns and at least one row"
        )
    check_values(views, partial)
    if partial and bool(views.isnan().flatten(start_dim=1).all(dim=1).any()):
        raise SettingError("a view shows nothing that is known; leave it out")


def check_scan(views: Images, shape: tuple[int, ...] | None, partial: bool = False) -> None:
    """Refuse views that a model trained on images of `shape` (None: not trained) cannot scan. Raises SettingError."""
    if shape is None:
        raise SettingError("this model has learned nothing yet; call fit(views) first")
    if views.ndim != 3 or tuple(views.shape[1:]) != tuple(shape):
        raise SettingError(
            f"this model learned views of shape {tuple(shape)}, got {tuple(views.shape[1:])}; encode both in the same way"
        )
    check_values(views, partial)


def check_form(
    name: str,
    learned: Mapping[str, torch.Tensor],
    expected: Mapping[str, tuple[int | None, ...]],
    dtypes: Mapping[str, torch.dtype | None],
) -> None:
    """Refuse tensors that a model learns by other names, in other shapes (None: of any size) or types. Raises SettingError."""
    if learned.keys() != expected.keys():
        raise SettingError(f"{name}: it learns {', '.join(expected)}, not {', '.join(learned) or 'nothing'}")
    for key, tensor in learned.items():
        fits = tensor.ndim == len(expected[key]) and all(
            want in (None, size) and size > 0 for want, size in zip(expected[key], tensor.shape, strict=True)
        )
        if not fits:
            raise SettingError(f"{name}: {key} has shape {tuple(tensor.shape)}, not {expected[key]}")
        if (dtype := dtypes.get(key, torch.float32)) not in (None, tensor.dtype):
            raise SettingError(f"{name}: {key} has type {tensor.dtype}, not {dtype}")


def check_bounded(name: str, learned: Mapping[str, torch.Tensor], partial: bool) -> None:
    """Refuse learned numbers that are not finite or over MAX_VALUE; see `check_values`. Raises SettingError."""
    for key, tensor in learned.items():
        if tensor.is_floating_point() and not all_bounded(tensor, partial):
            raise SettingError(
                f"{name}: the {key} are not finite, or over {MAX_VALUE:g}; if they grew without bound, give a lower rate"
            )


def check_familiarity(name: str, familiarity: torch.Tensor) -> None:
    """Refuse familiarity that is not finite. Raises SettingError."""
    if not torch.isfinite(familiarity).all():
        raise SettingError(
            f"{name}: familiarity is beyond float32 (did training end with large weights?); scale the views"
        )


def check_values(views: Images, partial: bool = False) -> None:
    """Refuse views that are not float32, and values that are not finite or over MAX_VALUE. Raises SettingError.

    Args:
        views: (n, h, w)
        partial: Whether values may be nan, which are unknown.
    """
    if views.dtype != torch.float32:
        raise SettingError(f"views are float32, got {views.dtype}; give views.float()")
    if not all_bounded(views, partial):
        valid = (views.abs() <= MAX_VALUE) | (views.isnan() & partial)
        bad = int(valid.flatten(start_dim=1).all(dim=1).int().argmin())
        raise SettingError(f"view {bad} holds values that are not finite, or over {MAX_VALUE:g}; check the encoding")


def all_bounded(tensor: torch.Tensor, partial: bool = False) -> bool:
    """Whether all values are finite and within MAX_VALUE; of partial tensors, those that are not nan."""
    if tensor.numel() == 0:
        return True
    tensor = tensor.nan_to_num(posinf=torch.inf, neginf=-torch.inf) if partial else tensor
    least, greatest = tensor.aminmax()
    return float(least) >= -MAX_VALUE and float(greatest) <= MAX_VALUE  # both are nan if a value is
