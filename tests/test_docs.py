"""The Python of the documentation runs as it is printed. README.md and docs/benchmark.md have tests of their own."""

import ast
import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tussock.navigation.models import MODELS
from tussock.navigation.studies.protocols import PROTOCOLS

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize(
    "page",
    [
        "eyes",
        *(pytest.param(page, marks=pytest.mark.slow) for page in ("changes", "environment", "failures", "models")),
    ],
)
def test_the_snippets_of_a_page_run(page, tmp_path):
    snippets = re.findall(r"```python\n(.+?)```", (DOCS / f"{page}.md").read_text(), flags=re.DOTALL)
    done = subprocess.run([sys.executable, "-c", "\n".join(snippets)], cwd=tmp_path, capture_output=True, text=True)
    assert snippets
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("recipe", sorted((DOCS / "gallery").glob("*.py")), ids=lambda path: path.stem)
def test_a_recipe_is_short_and_says_what_it_shows(recipe):
    """`make docs` runs them all."""
    source = recipe.read_text()
    title, code = ast.parse(source).body[0], ast.parse(source).body[1:]
    assert isinstance(title, ast.Expr)
    imports = sum(isinstance(each, ast.Import | ast.ImportFrom) for each in code)
    statements = [each for each in ast.walk(ast.Module(code, [])) if isinstance(each, ast.stmt)]
    assert len(statements) - imports <= 20


def test_the_walk_that_is_to_fail_in_the_first_hour_does():
    recorded = json.loads((DOCS / "numbers" / "records" / "lost.json").read_text())
    command = recorded["origin"]["command"].strip("`")
    assert f"    {command} --out lost\n" in (DOCS / "first-hour.md").read_text()
    assert recorded["values"]["reason"] == "lost"


def test_the_papers_of_all_models_and_protocols_are_listed():
    rows = [line for line in (DOCS / "references.md").read_text().splitlines() if line.startswith("| ")]
    papers = [getattr(MODELS.find(name), "paper", "") for name in MODELS.builtin]
    papers += [PROTOCOLS.find(name).paper for name in PROTOCOLS.builtin]
    for paper in "; ".join(papers).split("; "):
        year = re.search(r"\b(19|20)\d\d\b", paper)
        if year is not None and "thesis" not in paper:
            first = paper.split()[0].rstrip(",")
            assert any(first in row.partition("(")[0] and f"({year.group()})" in row for row in rows), paper


def test_the_reference_has_every_flag_setting_and_parameter(tmp_path, monkeypatch):
    sys.path.insert(0, str(DOCS))
    try:
        import reference_pages
    finally:
        sys.path.remove(str(DOCS))
    monkeypatch.setattr(reference_pages, "_texts", cache(reference_pages._texts))  # of each class once, not once a flag
    reference_pages.write_pages(tmp_path)
    pages = {path.stem: path.read_text() for path in tmp_path.iterdir()}
    assert set(pages) == {"commands", "settings", "worlds"}
    empty = [row for page in pages.values() for row in page.splitlines() if re.search(r"\| +\|$", row)]
    assert empty == []  # each says what it means
    assert all(
        f"`--{name.replace('_', '-')}`" in pages["commands"]
        for name in ("navigator", "steps_per_second", "goal_walk_m")
    )
    assert "| `tree_gaps` | Share of the horizon without trees. | share of the horizon | 0 to 0.95 |" in pages["worlds"]
