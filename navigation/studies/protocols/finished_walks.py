"""The walks of a protocol, as its folder holds them."""

import re
from pathlib import Path

import pandas as pd

from tussock.world.errors import SettingError

from ...experiment_keys import key_of
from ...sweeps.spec import Sweep
from ...sweeps.store import Store, read_steps, table_of
from .protocol import Protocol, check_models, route_names


def walks_of(protocol: Protocol, sweep: Sweep, out: Path) -> tuple[pd.DataFrame, dict[str, int]]:
    """Read the walks of a protocol from its folder.

    Args:
        protocol: The experiment.
        sweep: Its runs.
        out: The folder.

    Returns:
        One row per walk, ordered by model, with the columns of the protocol's `of_walk` and the model with its parameters as "spec"; and
        the number of runs that could not be made, by the reason.

    Raises:
        SettingError: Without any walk, and without one of some model.
    """
    keys = {key_of(run) for run in sweep.experiments}
    with Store(out, read_only=True) as store:
        rows = {key: row for key, row in store.rows().items() if key in keys}
        for (key, row), name in zip(rows.items(), route_names(rows.values()), strict=True):
            row["place"] = name
            if row["error"] is None:
                row |= protocol.of_walk(row, read_steps(store.steps(key)))
    reasons = [_kind_of(row["error"]) for row in rows.values() if row["error"] is not None]
    if len(reasons) == len(rows):
        raise SettingError(f"none of {len(rows)} runs could be made; the first: {reasons[0]}")
    table = table_of({key: row for key, row in rows.items() if row["error"] is None})
    models = list(dict.fromkeys(str(run.model) for run in sweep.experiments))
    check_models(table, models)
    order = table["model"].map({model: k for k, model in enumerate(models)})
    table = table.iloc[order.argsort(kind="stable")].assign(
        spec=lambda each: each["model"], model=lambda each: each["model"].str.split().str[0]
    )
    return table.reset_index(drop=True), {reason: reasons.count(reason) for reason in dict.fromkeys(reasons)}


def _kind_of(error: str) -> str:
    """An error without what differs between errors of one kind: the text in parentheses."""
    return re.sub(r" \([^()]*\)", "", error).replace(" m is", " is")
