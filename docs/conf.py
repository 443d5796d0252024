"""How the documentation's site is built: `make docs`."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = PROJECT["name"]
version = release = PROJECT["version"]
author = "the perceptron-emu developers"
copyright = author  # noqa: A001 # the name that Sphinx reads

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
source_suffix = {".md": "myst-nb"}
exclude_patterns = ["pictures"]
html_theme = "furo"
html_title = f"perceptron-emu {version}"
html_show_sourcelink = False

myst_heading_anchors = 4  # pages link to one another's headings, as they do where the repository is read
myst_enable_extensions = ["colon_fence"]

nb_execution_mode = "force"  # pages with a kernelspec are notebooks: run as they are written, and an error is an error
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_google_docstring = False
suppress_warnings = ["autodoc.mocked_object", "ref.python"]
nitpicky = False
