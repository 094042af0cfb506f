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
    "commands",
    "docstrings",
    "drawings",
    "gallery",
    "glossary",
    "myst_nb",
    "python_reference",
    "references",
    "section_table",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build", "_templates", "extensions"]
templates_path = ["_templates"]
default_role = "code"
language = "en"
highlight_language = "text"
nitpicky = True
nitpick_ignore_regex = [
    ("py:obj", ".*"),  # code in a docstring is a link where it names something, and code where it does not
    ("py:.*", r"(?!catseye\.).*"),  # of other packages: no page here
]

autodoc_default_options = {"member-order": "bysource"}
autodoc_typehints = "none"
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
add_module_names = False
toc_object_entries_show_parents = "hide"

myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

mathjax_path = "mathjax/tex-svg.js"
mathjax3_config = {"options": {"enableMenu": False}, "loader": {"load": []}}

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_line_continuation_character = "\\"

html_theme = "pydata_sphinx_theme"
html_title = f"catseye {release}"
html_favicon = "_static/icon.svg"
html_static_path = ["_static"]
html_css_files = ["catseye.css"]
html_js_files = ["catseye.js"]
html_copy_source = False
html_show_sourcelink = False
html_show_search_summary = False  # would be fetched, which a browser refuses where pages are opened from disk
html_context = {"default_mode": "auto"}
html_theme_options = {
    "logo": {"image_light": "_static/logo.svg", "image_dark": "_static/logo-dark.svg", "alt_text": "catseye"},
    "icon_links": [],
    "show_nav_level": 1,
    "navigation_depth": 3,
    "navigation_with_keys": False,
    "search_bar_text": "Search",
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["footer-version"],
    "footer_end": [],
}
html_sidebars = {"index": []}


def setup(app):
    """Know the names of plain texts that Pygments does not colour."""
    from pygments.lexers.special import TextLexer

    app.add_lexer("csv", TextLexer)
