"""How the results of published experiments read in README and docs: their tables and lines."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import pandas as pd
from measurement import Values, markdown

NAMES = {
    "perfect-memory": "perfect memory",
    "mushroom-body": "mushroom body",
    "spiking-mushroom-body": "spiking body",
    "infomax": "Infomax",
}


def thesis_table(values: Values) -> str:
    """Each claim of the thesis: published numbers, those obtained in each world, and in how many worlds it holds."""
    rows = []
    for key, claim in values["claims"].items():
        tested = [each for each in claim["holds"] if each is not None]
        obtained = (f"{label}: {spread(each)}" for label, each in claim["obtained"].items())
        holds = f"{sum(tested)} of {len(tested)}" if tested else f"not tested: {claim['reason']}"
        rows.append([f"`{key}`", listed(claim["published"]) or "-", "; ".join(obtained), effects(claim), holds])
    effect = "size of the effect in each world (95 % interval)"
    return markdown(["claim", "published", "obtained: median (lowest to highest)", effect, "holds in"], rows)


def thesis_count(values: Values) -> str:
    """How many claims hold in all worlds, in some, and in none."""
    counts = Counter(
        "not tested" if not tested else "hold in all worlds" if all(tested) else "in some" if any(tested) else "in none"
        for tested in ([each for each in claim["holds"] if each is not None] for claim in values["claims"].values())
    )
    order = ("hold in all worlds", "in some", "in none", "not tested")
    return f"of {counts.total()} claims " + ", ".join(f"{counts[each]} {each}" for each in order if counts[each])


def spread(obtained: Mapping[str, float | None]) -> str:
    """A number over several worlds."""
    median, low, high = (obtained[each] for each in ("median", "lowest", "highest"))
    return with_interval(median, *((None, None) if low == high else (low, high)))


def number(value: float | None, digits: int = 2) -> str:
    """A number as a table has it."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.0f}"


def with_interval(value: float | None, low: float | None, high: float | None, digits: int = 2) -> str:
    """A number with its 95 % interval, where it has one."""
    ends = (
        "" if low is None or high is None or math.isnan(low) else f" ({number(low, digits)} to {number(high, digits)})"
    )
    return number(value, digits) + ends


def table(values: Values, name: str) -> pd.DataFrame:
    """A table of the results."""
    kept = values["tables"][name]
    return pd.DataFrame(kept["data"], columns=kept["columns"])


def counted(values: Values) -> str:
    """How many claims hold."""
    holds = [claim["holds"] for claim in values["claims"].values()]
    tested = [each for each in holds if each is not None]
    untested = f", {len(holds) - len(tested)} not tested" if len(tested) < len(holds) else ""
    return f"{sum(tested)} of {len(holds)}{untested}"


def claims_table(values: Values) -> str:
    """Each claim: its test, the published numbers where there are any, the obtained ones, the effect, and whether it holds."""
    claims = values["claims"].values()
    published = any(claim["published"] for claim in claims)
    rows = []
    for claim in claims:
        holds = "not tested: " + claim["reason"] if claim["holds"] is None else "yes" if claim["holds"] else "no"
        numbers = [*([listed(claim["published"])] if published else []), listed(claim["obtained"]), effects(claim)]
        rows.append([claim["test"], *numbers, holds])
    columns = [*(["published"] if published else []), "obtained", "size of the effect (95 % interval)", "holds"]
    return markdown(["the claim holds if", *columns], rows)


def listed(numbers: Mapping[str, float]) -> str:
    return "; ".join(f"{label}: {number(value)}" for label, value in numbers.items())


def effects(claim: Mapping[str, Any]) -> str:
    known = [each for each in claim["effects"] if each]
    sizes = "; ".join(with_interval(each["value"], each["low"], each["high"]) for each in known)
    return f"{known[0]['label']}: {sizes}" if known else "-"


def of_models(values: Values, measure: str, digits: int = 1) -> dict[str, str]:
    """A number of each model with its interval over routes."""
    cells = {}
    for spec, measures in values["models"].items():
        each = measures[measure]
        cells[spec.split()[0]] = with_interval(each["value"], each["low"], each["high"], digits)
    return cells


def errors_by_start(values: Values) -> str:
    """Errors per walk of each model, by the displacement of its start."""
    by_start, errors = table(values, "by_displacement"), of_models(values, "resets")
    starts = [column for column in by_start.columns if column.endswith(" cm")]
    rows = [
        [NAMES.get(row["model"], row["model"]), *(number(row[start]) for start in starts), errors[row["model"]]]
        for _, row in by_start.iterrows()
    ]
    return markdown(["errors per walk, start at", *starts, "all (95 % interval)"], rows)


def errors_by_put_back(values: Values) -> str:
    """Errors per walk of each model, by where a lost agent is put back, and the mushroom body's share of the way to random."""
    rows, numbers = [], values["numbers"]
    by_model = table(values, "by_model")
    for put_back, some in by_model.groupby("put_back", sort=False):
        share = [
            numbers[f"share of the way from perfect memory to random, {put_back}{end}"]
            for end in ("", ", low", ", high")
        ]
        errors = [with_interval(row["errors a walk"], row["low"], row["high"], 1) for _, row in some.iterrows()]
        rows.append([f"put back {put_back}", *errors, with_interval(*share)])
    models = [NAMES.get(model, model) for model in by_model["model"].unique()]
    return markdown(["errors per walk (95 % interval)", *models, "share"], rows)


def means(values: Values) -> str:
    """Means with their intervals over routes: a line per measure, a column per model."""
    intervals = table(values, "intervals")
    models = list(intervals["model"].unique())
    rows = [
        [measure, *(with_interval(row["mean"], row["low"], row["high"]) for _, row in some.iterrows())]
        for measure, some in intervals.groupby("measure", sort=False)
    ]
    return markdown(["mean (95 % interval)", *(NAMES.get(model, model) for model in models)], rows)


def apiaviz(values: Values) -> str:
    """Completed walks and deviation of each input, published and obtained."""
    rows = []
    for _, row in table(values, "by_input").iterrows():
        completed = f"{row['completed walks']:.0f} of {row['walks']:.0f}"
        share, deviation = (
            with_interval(row[name], row[f"{name}, low"], row[f"{name}, high"], digits)
            for name, digits in (("completed", 2), ("mean deviation (cm)", 1))
        )
        published = f"{row['completed of 40, published']:.0f} of 40 ({number(row['completed, published'])})"
        of_deviation = f"{number(row['mean deviation (cm), published'], 1)} cm"
        rows.append([row["input"], published, f"{completed}: {share}", of_deviation, f"{deviation} cm"])
    columns = ["input", "completed, published", "obtained", "mean deviation, published", "obtained"]
    return markdown(columns, rows)


def completed(values: Values) -> str:
    """Completed walks of each input, in a line."""
    rows = [row for _, row in table(values, "by_input").iterrows()]
    return ", ".join(f"{row['input']} {row['completed walks']:.0f} of {row['walks']:.0f}" for row in rows)


def strategies(values: Values) -> str:
    """Mean displacements of each strategy, and their differences from view-based orientation."""
    every = table(values, "differences")
    every = every[every["starts"] == "all starts"]
    numbers, rows = values["numbers"], []
    for name in table(values, "by_start")["strategy"].unique():
        cells = [name]
        for measure in every["measure"].unique():
            cells.append(number(numbers[f"{measure}, {name}"]))
            found = every[(every["measure"] == measure) & (every["strategy"] == name)]
            cells.append("-" if found.empty else _difference(found.iloc[0]))
        rows.append(cells)
    columns = [cell for measure in every["measure"].unique() for cell in (measure, "less view-based (95 % interval)")]
    return markdown(["strategy", *columns], rows)


def _difference(row: pd.Series) -> str:
    p = "under 0.001" if row["p (Holm)"] < 0.001 else f"{row['p (Holm)']:.3f}"
    return f"{with_interval(row.iloc[4], row['low'], row['high'])}, p {p}"


def by_distance(values: Values) -> str:
    """Mean displacement of each strategy by the distance of the start from the route."""
    by_start = table(values, "by_start")
    start, shown = "start beside the route (m)", (0, 0.25, 0.5, 1, 2, 3, 4, 5, 5.5)
    some = by_start[by_start[start].isin(shown)].pivot_table("mean displacement (m)", "strategy", start, sort=False)
    rows = [[name, *map(number, row)] for name, row in zip(some.index, some.to_numpy(), strict=True)]
    return markdown(["mean displacement (m), start beside the route", *(f"{each:g} m" for each in some.columns)], rows)


def distances_by_gain(values: Values) -> str:
    """Mean distance from the nest at the end, by the gain: a line for the mean over worlds, and its range."""
    by_gain = table(values, "gains").groupby("gain (degrees)", sort=True)["final_m"]
    rows = [["distance at the end: mean of six worlds (m)", *map(number, by_gain.mean())]]
    rows.append(
        [
            "lowest and highest of the worlds (m)",
            *(f"{number(low)} to {number(high)}" for low, high in zip(by_gain.min(), by_gain.max(), strict=True)),
        ]
    )
    return markdown(["gain (degrees)", *(f"{gain:,.0f}" for gain in by_gain.groups)], rows)


def distances_by_memory(values: Values) -> str:
    """Mean distance from the nest at the end of the release test, by memory and by how the views were learned."""
    release = table(values, "release").pivot_table("distance at the end (m)", "memories", "spread", sort=False)
    rows = [[memories, *map(number, row)] for memories, row in zip(release.index, release.to_numpy(), strict=True)]
    return markdown(
        ["memories", *(f"views within {spread:g} degrees of the nest (m)" for spread in release.columns)], rows
    )


def shares_by_release(values: Values) -> str:
    """Share of walks that come home, by what steers, the senses, and the distance of the start."""
    shares = table(values, "by_distance")
    rows = [[f"`{row.iloc[0]}`", row.iloc[1], *map(number, row.iloc[2:])] for _, row in shares.iterrows()]
    return markdown(["navigator", "senses", *shares.columns[2:]], rows)


def in_a_line(values: Values) -> str:
    """The size of each effect with its interval, and whether its claim holds."""
    parts = []
    for claim in values["claims"].values():
        holds = "not tested" if claim["holds"] is None else "holds" if claim["holds"] else "does not hold"
        parts.append(f"{effects(claim) if any(claim['effects']) else listed(claim['obtained'])}, {holds}")
    return "; ".join(parts)
