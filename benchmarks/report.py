"""Turns the JSON of pytest-benchmark into a table, the growth curves, and the numbers of docs/performance.md."""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
from rich.console import Console
from rich.table import Table

DOCS = Path(__file__).parents[1] / "docs"
HEAD = ("what", "median", "best round", "naive numpy, and by the median")
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


def figures(measured: dict) -> list[dict]:
    """The results: what each benchmark writes (see conftest.py), and seconds per item, in the median and in the best round."""
    rows = []
    for each in measured["benchmarks"]:
        info = each["extra_info"]
        rows.append(
            info | {"seconds": each["stats"]["median"] / info["items"], "best": each["stats"]["min"] / info["items"]}
        )
    return rows


def in_unit(seconds: float, unit: str) -> str:
    """A time per item as a text: in steps a second, s, or ms."""
    if unit == "steps a second":
        return f"{1 / seconds:,.0f} {unit}"
    return f"{seconds:.3g} s" if unit == "s" else f"{1000 * seconds:.3g} {unit}"


def cells(row: dict) -> tuple[str, str, str, str]:
    """A row of the table, in the order of HEAD."""
    naive = row["naive_seconds"]
    against = "" if naive is None else f"{1000 * naive:,.0f} ms, {naive / row['seconds']:,.0f} times"
    return row["name"], in_unit(row["seconds"], row["unit"]), in_unit(row["best"], row["unit"]), against


def draw(rows: list[dict], axis: str, path: Path) -> None:
    """The growth curves over `axis`, on logarithmic scales, next to linear growth."""
    figure, plot = plt.subplots(figsize=(5.2, 3.6), layout="constrained")
    curves: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row["curve"] and row["curve"][0] == axis:
            curves.setdefault(row["curve"][1], []).append((row["curve"][2], 1000 * row["seconds"]))
    if not curves:
        return
    for name, points in curves.items():
        x, y = zip(*sorted(points), strict=True)
        plot.loglog(x, y, "o-", label=name)
        plot.loglog(x, [y[0] * each / x[0] for each in x], ":", color="0.7", label="_linear")
    plot.set(xlabel=axis, ylabel="ms a view", ylim=(None, 3 * max(y for points in curves.values() for _, y in points)))
    plot.set_title("dotted: linear growth", fontsize=9, color="0.5")
    plot.legend(frameon=False)
    figure.savefig(path, metadata={"Date": None})


def main(paths: list[Path]) -> None:
    """Print the table, and write it into docs/performance.md."""
    parts = [json.loads(path.read_text()) for path in paths]
    rows = [row for part in parts for row in figures(part)]
    measured = parts[0]
    cpu = measured["machine_info"]["cpu"]
    machine = f"{cpu.get('brand_raw', measured['machine_info']['processor'])}, {cpu['count']} cores"
    table = Table(*HEAD, title=machine)
    for row in rows:
        table.add_row(*cells(row))
    Console(width=150).print(table)
    draw(rows, "triangles", DOCS / "growth-with-triangles.svg")
    draw(rows, "snapshots", DOCS / "growth-with-snapshots.svg")
    page = (DOCS / "performance.md").read_text()
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    lines = [f"Machine: {machine}.", "", "| " + " | ".join(HEAD) + " |", "|---|---|---|---|"]
    lines += ["| " + " | ".join(cells(row)) + " |" for row in rows]
    (DOCS / "performance.md").write_text(before + BEGIN + "\n" + "\n".join(lines) + "\n" + END + after)


if __name__ == "__main__":
    main([Path(argument) for argument in sys.argv[1:]])
