"""Sphinx: the documentation, built offline and opened offline."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
os.environ["COLUMNS"] = "88"  # help texts are as wide on every terminal

from agonic import verification
from agonic.attitude import evidence as attitude
from agonic.ellipsoid import solve
from agonic.health import evidence, mounting, outliers, readings, scale
from agonic.model import verdict
from agonic.recording import calibrated, parts
from agonic.version import __version__

project = "agonic"
author = "The agonic developers"
copyright = "2026, the agonic developers"
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "docstrings",
    "public_names",
    "sources",
    "house",
    "documents",
    "scoreboard",
    "results",
    "terminal",
    "notebooks",
]
exclude_patterns = ["_build", "_ext", "decisions/experiments"]
default_role = "py:obj"

myst_enable_extensions = ["deflist", "substitution"]
myst_heading_anchors = 4
myst_substitutions = {  # limits are quoted from the source
    name: value
    for module in (
        attitude,
        evidence,
        outliers,
        readings,
        scale,
        mounting,
        verification,
        calibrated,
        parts,
        solve,
        verdict,
    )
    for name, value in vars(module).items()
    if name.isupper() and isinstance(value, int | float)
}

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings give shapes and units, which types cannot

html_theme = "furo"
html_title = f"agonic {release}"
html_show_sourcelink = False
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["terminal.css", "house.css"]
html_js_files = ["copy-code.js"]
pygments_style = "tango"
pygments_dark_style = "github-dark"
