"""A recorded walk, read from its recording."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from tussock.world.errors import FileError, first_line

from .viewer import TIMELINE


@dataclass(frozen=True, kw_only=True)
class RecordedWalk:
    """A walk as it was recorded.

    Attributes:
        steps: (n,) Numbers of the steps, in their order.
        places: (n, 2) Where the agent looked (m).
        facing: (n, 2) Unit vectors to where it turned then.
        deviations: (n,) Distance from the route (m).
        walked: (n,) Whether it walked there from the step before; not at the first step, and where it was carried or put back.
        views: What it saw, by the number of the step.
        familiarity: Of all headings, from left to right, above the least one, by the number of the step.
        degrees: (rotations,) Of these headings to the right of where it faced; empty where it does not scan.
        route: (k, 2) The route (m).
        triangles: (m, 3, 3) Of the world (m).
        rgb: (m, 3) Their colours.
    """

    steps: Int[np.ndarray, " n"]
    places: Float[np.ndarray, "n 2"]
    facing: Float[np.ndarray, "n 2"]
    deviations: Float[np.ndarray, " n"]
    walked: Bool[np.ndarray, " n"]
    views: dict[int, UInt8[np.ndarray, "h w 3"]]
    familiarity: dict[int, Float[np.ndarray, " rotations"]]
    degrees: Float[np.ndarray, " rotations"]
    route: Float[np.ndarray, "k 2"]
    triangles: Float[np.ndarray, "m 3 3"]
    rgb: UInt8[np.ndarray, "m 3"]


def read_walk(recording: Path) -> RecordedWalk:
    """Read what a film shows. Raises FileError for a file that is not a recording of a walk."""
    try:
        timed, constant = _contents(recording)
        # Of a walk that was killed, the last steps may not have all columns.
        steps = np.array(
            sorted(timed["/world/agent:Arrows3D:origins"].keys() & timed["/deviation/m:Scalars:scalars"].keys())
        )
        if len(steps) == 0:
            raise ValueError("it has no step")
        format_ = constant["/view:Image:format"][0]
        shape = (format_["height"].as_py(), format_["width"].as_py(), 3)
    except (KeyError, ValueError, RuntimeError, OSError) as error:
        raise FileError(
            f"{recording} is not a recording of a walk ({first_line(error)}); give the folder of a run"
        ) from error

    def rows(name: str, columns: int) -> Float[np.ndarray, "n columns"]:
        return np.array([_numbers(timed[name][k])[:columns] for k in steps.tolist()], dtype=float)

    facing = rows("/world/agent:Arrows3D:vectors", 2)
    degrees = constant.get("/familiarity:BarChart:abscissa")
    charts = {} if degrees is None else timed.get("/familiarity:BarChart:values", {})
    others = timed.get("/familiarity/not_compared:BarChart:values", {})  # it is 0 in one of the two
    path = timed.get("/world/path:LineStrips3D:strips", {})
    triangles, rgb = _mesh(constant)
    return RecordedWalk(
        steps=steps,
        places=rows("/world/agent:Arrows3D:origins", 2),
        facing=facing / np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9),
        deviations=rows("/deviation/m:Scalars:scalars", 1)[:, 0],
        views={k: _numbers(pixels).reshape(shape) for k, pixels in timed.get("/view:Image:buffer", {}).items()},
        familiarity={k: _chart(values) + (_chart(others[k]) if k in others else 0) for k, values in charts.items()},
        degrees=_chart(degrees) if charts else np.empty(0),
        walked=np.array([k in path for k in steps.tolist()]),
        route=_numbers(constant["/world/route:LineStrips3D:strips"]).reshape(-1, 3)[:, :2],
        triangles=triangles,
        rgb=rgb,
    )


def _mesh(constant: dict[str, Any]) -> tuple[Float[np.ndarray, "m 3 3"], UInt8[np.ndarray, "m 3"]]:
    """The triangles of the world, and their colours; none where only images were seen."""
    if "/world/mesh:Mesh3D:vertex_positions" not in constant:
        return np.empty((0, 3, 3)), np.empty((0, 3), np.uint8)
    corners = _numbers(constant["/world/mesh:Mesh3D:vertex_positions"]).astype(float)
    rgba = _numbers(constant["/world/mesh:Mesh3D:vertex_colors"])[::3]  # as 0xRRGGBBAA, one for each corner
    return corners.reshape(-1, 3, 3), np.stack([rgba >> shift & 255 for shift in (24, 16, 8)], axis=1).astype(np.uint8)


def _contents(recording: Path) -> tuple[dict[str, dict[int, Any]], dict[str, Any]]:
    """The columns of a recording, as arrays of arrow: by step, and those that stay the same."""
    from rerun.chunk import RrdReader

    timed: dict[str, dict[int, Any]] = {}
    constant: dict[str, Any] = {}
    for chunk in RrdReader(recording).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        for name in (each for each in names if ":" in each):
            found = [row.values if row.is_valid else None for row in batch.column(names.index(name))]
            if TIMELINE in names:
                when = batch.column(names.index(TIMELINE)).cast("int64").to_pylist()
                by_step = timed.setdefault(f"{chunk.entity_path}:{name}", {})
                by_step.update({k: values for k, values in zip(when, found, strict=True) if values is not None})
            elif found[0] is not None:
                constant[f"{chunk.entity_path}:{name}"] = found[0]
    return timed, constant


def _numbers(values: Any) -> np.ndarray:
    """The numbers in lists of lists, of arrow, one after the other."""
    while hasattr(values, "flatten") and values.type.num_fields:
        values = values.flatten()
    return values.to_numpy(zero_copy_only=False)


def _chart(values: Any) -> Float[np.ndarray, " rotations"]:
    """The values of a bar chart."""
    return np.array(values[0]["buffer"].value.as_py(), dtype=float)
