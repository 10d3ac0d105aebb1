"""The results of jobs.py: a line for each job, and the table and picture of docs/performance.md."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

DOCS = Path(__file__).parents[1] / "docs"
BEGIN, END = "<!-- jobs: begin -->", "<!-- jobs: end -->"
REST = "the rest"  # of the CPU time: interpreter, imports, compilation, the cluster, studies
COLOURS = {
    "generate": "tab:green",
    "route": "tab:olive",
    "train": "tab:blue",
    "walk": "tab:orange",
    "diagnose": "tab:red",
    "write": "tab:purple",
    REST: "0.8",
}


def best(rounds: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The quickest of some rounds, with the least memory of all."""
    return {**min(rounds, key=lambda each: each["seconds"]), "peak_bytes": min(each["peak_bytes"] for each in rounds)}


def line(job: Mapping[str, Any]) -> str:
    """A job in one line: seconds, CPU time and memory of each version, the ratios, and whether the results are equal."""
    parts = []
    for side in ("base", "new"):
        if side in job:
            each = best(job[side])
            took = f"{side} {each['seconds']:.1f} s, {each['cpu_seconds']:.1f} s of CPU, {each['peak_bytes'] / 1e6:,.0f} MB"
            parts.append(took)
    if "base" in job:
        base, new = best(job["base"]), best(job["new"])
        parts.append(
            f"{base['seconds'] / new['seconds']:.2f} times as fast ({base['cpu_seconds'] / new['cpu_seconds']:.2f} in CPU time)"
        )
        parts.append(job["results"])
    return f"{job['title']}: {'; '.join(parts)}"


def shares(each: Mapping[str, Any]) -> dict[str, float]:
    """The share of each stage in the CPU time, 0 to 1."""
    total = each["cpu_seconds"]
    found = {name: each["stages"].get(name, 0.0) / total for name in COLOURS if name != REST}
    return found | {REST: max(0.0, 1 - sum(found.values()))}


def draw(jobs: Sequence[Mapping[str, Any]], path: Path) -> None:
    """A bar for each job, stacked by the share of its stages in its CPU time."""
    figure, plot = plt.subplots(figsize=(7.2, 0.9 + 0.36 * len(jobs)), layout="constrained")
    each = [best(job["new"]) for job in jobs]
    names = [f"{job['title']}: {took['seconds']:.0f} s" for job, took in zip(jobs, each, strict=True)]
    left = [0.0] * len(jobs)
    for stage, colour in COLOURS.items():
        width = [100 * shares(took)[stage] for took in each]
        plot.barh(names, width, left=left, color=colour, label=stage)
        left = [a + b for a, b in zip(left, width, strict=True)]
    plot.tick_params(labelsize=8)
    plot.set(xlabel="% of the CPU time", xlim=(0, 100))
    plot.invert_yaxis()
    plot.spines[["top", "right"]].set_visible(False)
    figure.legend(
        *plot.get_legend_handles_labels(), loc="outside upper center", ncols=len(COLOURS), frameon=False, fontsize=8
    )
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def table(jobs: Sequence[Mapping[str, Any]]) -> list[str]:
    """The lines of the table: each job, with the other version in brackets."""
    head = (
        "job",
        "seconds (before)",
        "times as fast",
        "CPU seconds (before)",
        "peak memory, MB (before)",
        "results, against before",
    )
    rows = ["| " + " | ".join(head) + " |", "|---|---|---|---|---|---|"]
    for job in jobs:
        new = best(job["new"])
        old = best(job["base"]) if "base" in job else None
        cells = [job["title"]]
        for name, scale, form in (("seconds", 1, ",.1f"), ("cpu_seconds", 1, ",.1f"), ("peak_bytes", 1e-6, ",.0f")):
            before = "" if old is None else f" ({old[name] * scale:{form}})"
            cells.append(f"{new[name] * scale:{form}}{before}")
            if name == "seconds":
                cells.append("" if old is None else f"{old['seconds'] / new['seconds']:.1f}")
        rows.append("| " + " | ".join([*cells, job.get("results", "").partition("; ")[0]]) + " |")
    return rows


def write(jobs: Sequence[Mapping[str, Any]], docs: Path = DOCS) -> None:
    """Write the table into docs/performance.md, and the picture next to it."""
    draw(jobs, docs / "whole-jobs.svg")
    page = (docs / "performance.md").read_text()
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    days = sorted({job["at"][:10] for job in jobs})
    machines = sorted({job["machine"] for job in jobs})
    versions = sorted({job["before"] for job in jobs if "before" in job})
    before_is = f" Before: commit {', '.join(versions)}." if versions else ""
    lines = [f"Machine: {'; '.join(machines)}; measured on {', '.join(days)}.{before_is}", "", *table(jobs)]
    lines += ["", "![The share of each stage in the CPU time of each job](whole-jobs.svg)"]
    (docs / "performance.md").write_text(before + BEGIN + "\n" + "\n".join(lines) + "\n" + END + after)
