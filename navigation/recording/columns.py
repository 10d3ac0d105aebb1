"""Values of many steps as columns for rerun. Its own converters copy every image twice, and take a chart at a time."""

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import pyarrow as pa
import rerun as rr
from jaxtyping import Float32, UInt8

from tussock.render.eye import Eye


def image_columns(
    eye: Eye, views: Sequence[UInt8[np.ndarray, "height width channels"]]
) -> Iterable[rr.ComponentColumn]:
    """Views as the eye sees them, RGB, without the format of the images.

    Args:
        eye: The eye.
        views: (n) Views, RGBA or RGB.
    """
    rgb = np.empty((len(views), eye.height, eye.width, 3), dtype=np.uint8)
    for view, image in zip(views, rgb, strict=True):
        if view.shape[2] == 4:
            cv2.cvtColor(view, cv2.COLOR_RGBA2RGB, dst=image)  # a tenth of the time of numpy's view[..., :3]
        else:
            image[:] = view
    pixels = eye.hide(rgb).reshape(-1)
    offsets = np.arange(len(views) + 1, dtype=np.int32) * rgb[0].size
    return rr.Image.columns(
        buffer=pa.ListArray.from_arrays(offsets, pixels, type=rr.components.ImageBuffer.arrow_type())
    )


def bar_chart_columns(charts: Float32[np.ndarray, "n width"]) -> Iterable[rr.ComponentColumn]:
    """Bar charts, without their abscissa.

    Args:
        charts: (n, width) Their values.
    """
    return rr.BarChart.columns(values=_tensors(charts))


def heat_map_columns(maps: Float32[np.ndarray, "n h w"], down: str, right: str) -> Iterable[rr.ComponentColumn]:
    """Heat maps.

    Args:
        maps: (n, h, w) Their values.
        down: What their rows are.
        right: What their columns are.
    """
    return rr.Tensor.columns(data=_tensors(maps, (down, right)))


def _tensors(values: Float32[np.ndarray, " n *shape"], names: Sequence[str] = ()) -> pa.StructArray:
    """Arrays (n) of one shape, as rerun keeps them, with names of their dimensions."""
    count, shape = len(values), values.shape[1:]
    kind = rr.components.TensorData.arrow_type()
    numbers = kind.field("buffer").type
    code = [field.name for field in numbers].index("F32")
    rows = np.arange(count + 1, dtype=np.int32)
    children = [pa.nulls(0, field.type) for field in numbers]
    flat = values.reshape(-1)
    children[code] = pa.ListArray.from_arrays(
        rows * (values[0].size if count else 0), flat, type=numbers.field(code).type
    )
    codes = pa.py_buffer(np.full(count, code, dtype=np.int8))
    buffers = pa.Array.from_buffers(numbers, count, [None, codes, pa.py_buffer(rows)], children=children)
    sizes = np.tile(np.array(shape, dtype=np.uint64), count)
    shapes = pa.ListArray.from_arrays(rows * len(shape), sizes, type=kind.field("shape").type)
    kinds = kind.field("names").type
    named = pa.array([list(names)] * count, kinds) if names else pa.nulls(count, kinds)
    return pa.StructArray.from_arrays([shapes, named, buffers], fields=list(kind))
