"""A view gives the same bytes whatever batch it is in: alone, or among others. Walks side by side are then the walks alone."""

import numpy as np
import pytest
import torch
from quick_cases import quick
from scenes import views
from small_models import small

from tussock.navigation.encoding import PRESETS, Encoding
from tussock.navigation.feature_mask import FeatureMask
from tussock.navigation.models import HEMIFIELDS, MODELS, OPPONENT
from tussock.navigation.threads import threads

NAMES = [*MODELS.builtin, OPPONENT + "infomax", HEMIFIELDS + "infomax"]
PARAMETERS = {"infomax": {"units": 150}}


def visible(height: int, width: int) -> torch.Tensor:
    mask = torch.ones(height, width, dtype=torch.bool)
    mask[:, : width // 4] = mask[0, : width // 2] = False
    return mask


@pytest.mark.parametrize(
    ("h", "w", "normalised"),
    quick([(3, 7, None), (3, 7, False), (3, 7, True), (5, 24, True), (25, 90, None)], (3, 7, True), (25, 90, None)),
    ids=["small", "small, masked", "small, masked and normalised", "masked and normalised", "like a route"],
)
@pytest.mark.parametrize("name", NAMES)
def test_a_view_is_scanned_to_the_same_bytes_in_every_batch(name, h, w, normalised):
    mask = None if normalised is None else FeatureMask(visible(h, w), normalised=normalised)
    with threads(1):
        model = small(name, **PARAMETERS.get(name, {})).see(mask).fit(views(12, 0, h, w))
        seen = views(64, 1, h, w)
        functions = [getattr(model, each) for each in ("scan", "score", "match") if hasattr(model, each)]
        for function in functions:
            whole = function(seen)
            for n in (*range(1, 10), 16, 17, 33, 63):
                for start in (0, 64 - n):
                    some = slice(start, start + n)
                    assert all(
                        torch.equal(part, of_all[some])
                        for part, of_all in zip(listed(function(seen[some])), listed(whole), strict=True)
                    ), f"{n} views from {start}"


def listed(result: torch.Tensor | tuple) -> list[torch.Tensor]:
    return [result] if isinstance(result, torch.Tensor) else list(result)


@pytest.mark.parametrize(
    "chain", [*PRESETS, "grey | blur 1.5 | resize 2.5 | widen 3 | scale 0.5", "grey | clahe 2 6 | normalise"]
)
@pytest.mark.parametrize("resize", [1, 3])
def test_a_view_is_encoded_to_the_same_bytes_in_every_batch(chain, resize):
    seen = np.random.default_rng(0).integers(0, 256, (17, 19, 90, 4), dtype=np.uint8)
    encoding = Encoding.named(chain, resize=resize if chain in PRESETS else 1)
    whole = encoding(seen)
    for n in range(1, 17):
        assert torch.equal(encoding(seen[1 : n + 1]), whole[1 : n + 1])
