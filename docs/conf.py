"""Settings of the documentation, built by `make docs`: strict, offline, every cell of every page executed."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "extensions"))
sys.path.insert(0, str(HERE.parent / "src"))

from catseye.version import __version__  # noqa: E402

project = "catseye"
author = "the catseye authors"
copyright = author
version = release = __version__

extensions = [
    "command_line",
    "gallery",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build", "extensions", "README.md"]
templates_path = []
default_role = "code"
language = "en_GB"
highlight_language = "text"
nitpicky = False

myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

mathjax_path = "mathjax/tex-svg.js"
mathjax3_config = {"options": {"enableMenu": False}, "loader": {"load": []}}

copybutton_prompt_text = "$ "
copybutton_line_continuation_character = "\\"

html_theme = "pydata_sphinx_theme"
html_title = f"catseye {release}"
html_static_path = ["_static"]
html_show_sourcelink = False
html_theme_options = {"icon_links": [], "show_nav_level": 2, "navigation_with_keys": False}
