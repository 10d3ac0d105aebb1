"""How Sphinx makes the documentation site: `make docs`, without a network."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "tussock"
version = release = installed_version("tussock")
copyright = "the authors of tussock, MIT licence"  # Sphinx's name for it

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "reference_pages",  # of this folder
    "public_api",  # of this folder
]
exclude_patterns = ["_build", "numbers", "gallery"]

# Markdown: pages are read on GitHub as well, so links are to files.
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # some pages begin a section two levels below the last

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
