"""How Sphinx makes the documentation site: `make docs`, without a network."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

import jupytext
import nbformat

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "tussock"
version = release = installed_version("tussock")
copyright = "the authors of tussock, MIT licence"  # Sphinx's name for it

extensions = [
    "myst_nb",  # myst_parser, and notebooks
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "reference_pages",  # of this folder
    "public_api",  # of this folder
]
exclude_patterns = [
    "_build",
    "jupyter_execute",
    "numbers",
    "gallery",
    "recipes/*.ipynb",
    "notebooks/*_without_solutions.ipynb",
]

# Markdown: pages are read on GitHub as well, so links are to files.
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # some pages begin a section two levels below the last

# Notebooks are made of the scripts in docs/notebooks, and run; see write_notebooks.
nb_execution_mode = "force"  # what a notebook shows depends on tussock, not on the notebook alone
nb_execution_timeout = 900
nb_execution_raise_on_error = True
nb_output_stderr = "remove"  # progress and remarks, which depend on how long it takes and where files are

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_class_signature = "separated"
napoleon_google_docstring, napoleon_numpy_docstring = True, False
napoleon_use_ivar = True

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "recipes",
    "filename_pattern": r"/\w+\.py$",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_memory": False,
    "capture_repr": (),
    "write_computation_times": False,  # that page would ask other sites for its style
    "abort_on_example_error": True,
}

html_theme = "furo"
html_title = f"tussock {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("config-inited", skip_notebooks_with_recipes)
    app.connect("builder-inited", lambda _: write_notebooks(HERE / "notebooks"))
    app.connect("source-read", offer_download)


def skip_notebooks_with_recipes(app: Any, config: Any) -> None:
    """Where the recipes are not run (`-D plot_gallery=0`), the notebooks are not run either."""
    if str(config.plot_gallery) in ("0", "False"):
        config.nb_execution_mode = "off"


def write_notebooks(folder: Path) -> None:
    """Write each script as a notebook without outputs, and those with solutions a second time without them, to be handed out.

    One that would be the same is left as it is, so that its page is not made again.
    """
    for script in folder.glob("*.py"):
        notebook = jupytext.read(script)
        for number, cell in enumerate(notebook.cells):
            cell.id = f"cell-{number}"  # by default they are random
        versions = {script.stem: notebook.cells}
        ends = [number for number, cell in enumerate(notebook.cells) if cell.source.startswith("## Solutions")]
        if ends:
            versions[f"{script.stem}_without_solutions"] = notebook.cells[: ends[0]]
        for name, cells in versions.items():
            file, text = folder / f"{name}.ipynb", nbformat.writes(nbformat.from_dict({**notebook, "cells": cells}))
            if not file.exists() or file.read_text(encoding="utf-8") != text:
                file.write_text(text, encoding="utf-8")


def offer_download(app: Any, page: str, source: list[str]) -> None:
    """Below the title of a notebook's page, a link to the notebook. In the notebook itself it would lead nowhere."""
    folder, _, name = page.rpartition("/")
    if folder != "notebooks" or name == "index":
        return
    notebook = nbformat.reads(source[0], as_version=4)
    title, _, text = notebook.cells[0].source.partition("\n")
    link = f"{{download}}`Download this notebook <{name}.ipynb>`, and read [how to run it](index.md)."
    notebook.cells[0].source = f"{title}\n\n{link}\n{text}"
    source[0] = nbformat.writes(notebook)
