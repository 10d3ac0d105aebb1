"""The documentation site: it builds without a warning, needs nothing from elsewhere, and can be read on a telephone and on a desk."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from browser import WIDTHS, in_browser

ROOT = Path(__file__).parents[1]
PAGES = [
    "index",
    "first-hour",
    "worlds",
    "steering",
    "reference/worlds",
    "reference/commands",
    "reference/python",
    "recipes/index",
    "references",
    "notebooks/index",
    "notebooks/practical",
    "notebooks/own_data",
    "notebooks/own_model_and_navigator",
]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The built site. The recipes are not run here, but by `make docs`."""
    folder = tmp_path_factory.mktemp("site")
    for name in ("docs", "assets", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("_build", "recipes"))
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "--fail-on-warning",
        "--keep-going",
        "-q",
        "-D",
        "plot_gallery=0",
        "-b",
        "html",
    ]
    done = subprocess.run([*command, "docs", "built"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "built"


def test_a_broken_link_fails(site):
    docs = site.parent / "docs"
    page = docs / "glossary.md"
    kept = page.read_text()
    page.write_text(kept + "\n[nowhere](nowhere.md)\n")
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "-q", "-D", "plot_gallery=0", "-b", "html"]
    done = subprocess.run([*command, "docs", "broken"], cwd=docs.parent, capture_output=True, text=True)
    page.write_text(kept)
    assert done.returncode != 0
    assert "nowhere" in done.stderr


def test_no_page_asks_another_site_for_anything(site):
    for page in site.rglob("*.html"):
        asked = re.findall(
            r'<(?:script|img|iframe|source)[^>]+src="(?:https?:)?//[^"]+"|<link[^>]+href="https?://[^"]+"',
            page.read_text(),
        )
        assert asked == [], page
    for style in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(?:https?:)?//", style.read_text()), style


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("page", PAGES)
def test_a_page_can_be_read(site, page, width):
    path = site / f"{page}.html"
    shown = in_browser(path, width, path.parent)
    assert (shown["wide"], shown["broken"], shown["small"]) == ([], 0, 0)


def test_the_search_knows_the_pages(site):
    index = (site / "searchindex.js").read_text()
    assert all(f'"{page}"' in index for page in PAGES)
