"""Figure style and SVG output, drawn without a display."""

import io
import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from catseye.errors import InputError
from catseye.interruption import deferred

logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it announces its font cache on stderr
with deferred():  # its first import writes that cache under a lock file
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

__all__ = [
    "BAD",
    "FAINT",
    "GRID",
    "INK",
    "SERIES",
    "STYLE",
    "Figure",
    "Svg",
    "mpl",
    "nice",
    "picture_file",
    "styled",
    "svg",
    "svgs",
]

PICTURES = (".svg", ".pdf", ".png")
PICTURES_TEXT = "a name that ends in .svg, .pdf or .png"
DPI = 200.0  # of a PNG: sharp on paper
INK, FAINT, GRID, BAD = "#22303c", "#6b7883", "#e3e8ec", "#c8323c"
SERIES = ("#1f5a99", "#d9641e", "#1e8e74", "#8a5fa8", "#b08a1e", "#6f8fa8")
STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.color": INK,
    "svg.fonttype": "path",
    "svg.hashsalt": "catseye",
}


@contextmanager
def styled() -> Iterator[None]:
    """Apply catseye's figure style within the block, ignoring user settings."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


class Svg(str):
    """SVG text of a figure, with the figure itself for other formats."""

    figure: Figure


def svg(figure: Figure) -> Svg:
    """Figure as SVG text, reproducible byte for byte."""
    stream = io.StringIO()
    with styled():
        FigureCanvasSVG(figure).print_svg(stream, metadata={"Date": None, "Creator": None})
    text = Svg(stream.getvalue())
    text.figure = figure
    return text


def refuse_picture(path: Path, option: str) -> None:
    """Raise InputError for a name that `picture_file` cannot write."""
    suffix = path.suffix.lower()
    if path.is_dir():
        raise InputError(f"{option} {path}: is a directory (expected the name of a file)")
    if suffix not in PICTURES:
        raise InputError(f"{option} {path}: unknown figure format {suffix or 'nothing'!r} (expected {PICTURES_TEXT})")


def picture_file(text: Svg, path: Path, option: str, *, mark: str) -> bytes:
    """Figure in the format of the file's suffix, marked as catseye's.

    path     .svg, .pdf or .png
    option   command option that named the file, for messages
    mark     text that identifies the file as catseye's

    Raises InputError for another suffix.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    refuse_picture(path, option)
    suffix, stream = path.suffix.lower(), io.BytesIO()
    if suffix == ".svg":
        return text.replace("<svg ", f"<!-- {mark} -->\n<svg ", 1).encode("utf-8")
    with styled():
        if suffix == ".pdf":
            about = {"Creator": mark, "Producer": None, "CreationDate": None}
            FigureCanvasPdf(text.figure).print_pdf(stream, metadata=about)
        else:
            text.figure.set_dpi(DPI)
            FigureCanvasAgg(text.figure).print_png(stream, metadata={"Software": mark})
    return stream.getvalue()


def svgs(figures: Mapping[str, Figure]) -> dict[str, str]:
    """Each figure as SVG text, under the same name."""
    return {name: svg(figure) for name, figure in figures.items()}


def nice(value: float) -> float:
    """Largest 1, 2 or 5 times a power of ten not above the value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step <= value / power * (1 + 1e-9)))
