"""Where models learn and scan: the devices of torch."""

from tussock.world.errors import SettingError, first_line


def chosen_device(device: str) -> str:
    """The name of a device; for "auto" it is "cuda" where torch has a GPU, else "cpu". All models learn at least as fast on a GPU."""
    if device != "auto":
        return device
    import torch

    return "cuda" if torch.cuda.is_available() else "cpu"


def check_device(device: str) -> None:
    """Refuse a device that torch cannot use here. Raises SettingError."""
    import torch

    try:
        torch.zeros(1, device=device).item()
    except (RuntimeError, AssertionError, TypeError) as error:
        raise SettingError(f"device {device!r} cannot be used here ({first_line(error)}); give cpu") from error
