"""Drawings of the conventions: made anew by each build, from the scripts in docs/reference/drawings.

A script has `DRAWINGS`, names of files with the functions that draw them. They are written as SVG beside the scripts,
before pages are read; git ignores them.
"""

import sys
from importlib import import_module
from pathlib import Path

from sphinx.application import Sphinx

SCRIPTS = ("kelvin", "telescope", "mirror")
FOLDER = Path(__file__).resolve().parents[1] / "reference" / "drawings"


def draw(folder: Path = FOLDER) -> list[Path]:
    """Write every drawing to a folder; its files."""
    if str(FOLDER) not in sys.path:
        sys.path.append(str(FOLDER))
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    written = []
    with mpl.rc_context(import_module("ink").SETTINGS):
        for script in SCRIPTS:
            for name, made in import_module(script).DRAWINGS.items():
                figure = made()
                figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
                plt.close(figure)
                written.append(folder / f"{name}.svg")
    return written


def setup(app: Sphinx) -> dict[str, bool]:
    """Draw when the build begins."""
    app.connect("builder-inited", lambda app: draw())
    return {"parallel_read_safe": True, "parallel_write_safe": True}
