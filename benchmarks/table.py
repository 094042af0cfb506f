"""Table of all rows as text and as docs/benchmarks.md, and the figure of the scaling curves."""

import importlib.metadata
import math
import os
import platform
import textwrap
import time
from collections.abc import Sequence
from pathlib import Path

from harness import LIMIT, Curve, Row, duration

PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
FIGURE = Path(__file__).parents[1] / "docs" / "pictures" / "scaling.svg"
PACKAGES = ("numpy", "scipy", "numba")

HEAD = """# Benchmarks

`make bench` wrote this page{when}; `make bench-guard` fails when a ratio of it falls by a third
(`benchmarks/baseline.json`, same run; a row that falls is measured twice more). Do not edit it by hand.

Every row is one hot path beside what a user would pick instead, and beside what the machine can do at most. All of a
row is measured in interleaved rounds of one process, BLAS on one thread; times are medians, and of processor time where
everything runs on one thread. **x** is how many times our time the alternative takes: above 1 ours is faster. **Of the
limit** is the least time that the machine needs for the same bytes or the same multiply-adds, over ours. **Spread** is
the quartile distance of the rounds' ratios over their median; differences below it mean nothing. Ratios carry over to
other machines better than times do.
"""

PEERS = """## Alternatives that are not in catseye's environment

They are measured where they are found, and named under the table where not: `pip install geodepy pyceres gtsam` for
Python's, and for `benchmarks/ceres_network.cpp` a C++ compiler with Ceres and Eigen (Debian: `libceres-dev`), found by
`CPLUS_INCLUDE_PATH`, `LIBRARY_PATH` and `LD_LIBRARY_PATH` where they are in no usual place.
"""


def machine(limits: dict[str, float], load: float) -> str:
    """Sentence about the machine, what it can do, and versions."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    return (
        f"Machine: {processor()}, {os.cpu_count()} cores, load {load:.1f} at the start. One thread reads "
        f"{limits['read_bytes_s'] / 1e9:.1f} GB/s, two {limits['read_by_two_bytes_s'] / 1e9:.1f}; one writes "
        f"{limits['write_bytes_s'] / 1e9:.1f} GB/s, does {limits['multiply_adds_s'] / 1e9:.1f} x 10⁹ fused "
        f"multiply-adds a second and {limits['roots_s'] / 1e9:.2f} x 10⁹ square roots with division; a flush of 16 KiB "
        f"to the disk takes {duration(limits['flush_s'])}. Python {platform.python_version()}, {versions}."
    )


def processor() -> str:
    """Model of the processor, as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def page(
    rows: Sequence[Row], curves: Sequence[Curve], *, limits: dict[str, float], load: float, took: float, date: str = ""
) -> str:
    """Text of docs/benchmarks.md.

    took   s of the whole run
    date   as YYYY-MM-DD; "" leaves it out
    """
    parts = [
        HEAD.format(when=f" on {date}" if date else ""),
        textwrap.fill(machine(limits, load) + f" The run took {took / 60.0:.1f} minutes.", 118) + "\n",
        "## Hot paths\n",
        "| hot path | work | ours | beside it | of the limit | spread |",
        "|---|---|---|---|---|---|",
        *(table_row(row) for row in rows),
        "",
        *notes(rows),
        *skips(rows),
        *(scaling(curves) if curves else []),
        PEERS.rstrip(),
    ]
    return "\n".join(parts) + "\n"


def table_row(row: Row) -> str:
    """Row of the Markdown table."""
    beside = "; ".join(f"{name} **{figures(ratio)} x**" for name, ratio in row.ratios().items() if name != LIMIT)
    share = row.ratios().get(LIMIT)
    cells = (
        row.path,
        row.what,
        duration(row.ours_s),
        beside or "-",
        "-" if share is None else figures(share),
        f"{100.0 * row.spread:.0f} %",
    )
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"


def figures(ratio: float) -> str:
    """Ratio with two digits, without exponent.

    >>> [figures(x) for x in (0.0012, 0.756, 1.04, 12.34, 3334.2)]
    ['0.0012', '0.76', '1.0', '12', '3300']
    """
    digits = float(f"{ratio:.2g}")
    return f"{digits:.1f}" if 1.0 <= digits < 10.0 else f"{digits:g}"


def notes(rows: Sequence[Row]) -> list[str]:
    """Lines of what rows note."""
    lines = [f"- {row.path}, {row.what}: {row.note}." for row in rows if row.note]
    return ["Notes\n", *lines, ""] if lines else []


def skips(rows: Sequence[Row]) -> list[str]:
    """Lines of alternatives that were not measured, each reason once."""
    paths: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for name, why in row.skipped.items():
            paths.setdefault((name, why), []).append(row.path)
    lines = [f"- {name}: {why} ({'; '.join(dict.fromkeys(found))})." for (name, why), found in paths.items()]
    return ["Not measured\n", *lines, ""] if lines else []


def scaling(curves: Sequence[Curve]) -> list[str]:
    """Section of the scaling curves."""
    lines = [
        "## Scaling\n",
        "Exponent of the best power through all sizes, with its standard uncertainty from the residuals, and between",
        "the two largest sizes, where what does not grow no longer counts.\n",
        "| hot path | grows with | exponent | at the end | from | to |",
        "|---|---|---|---|---|---|",
    ]
    for curve in curves:
        slope, u = curve.exponent()
        ends = (f"{curve.sizes[i]:g}: {curve.text(curve.values[i])}" for i in (0, -1))
        powers = f"{slope:.2f} ± {u:.2f} | {curve.last_exponent():.2f}"
        lines.append(f"| {curve.path}, {curve.what} | {curve.variable} | {powers} | {' | '.join(ends)} |")
    return [*lines, "", "![Time or memory against size, logarithmic](pictures/scaling.svg)\n"]


def draw(curves: Sequence[Curve], path: Path) -> None:
    """Write the figure: time of each curve against its size, memory where a curve has it, both logarithmic."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot
    from matplotlib.ticker import NullFormatter

    units = list(dict.fromkeys(curve.unit for curve in curves))
    with matplotlib.rc_context({"svg.hashsalt": "catseye", "font.size": 9}):
        drawing, axes = pyplot.subplots(
            1, len(units), figsize=(5.0 * len(units), 4.4), squeeze=False, gridspec_kw={"wspace": 0.3}
        )
        for unit, ax in zip(units, axes[0], strict=True):
            for curve in (each for each in curves if each.unit == unit):
                label = f"{curve.path}, {curve.what}: exponent {curve.last_exponent():.2f} at the end"
                ax.loglog(curve.sizes, curve.values, "o-", markersize=3.5, linewidth=1.2, label=label)
            ax.set_xlabel(" or ".join(dict.fromkeys(each.variable for each in curves if each.unit == unit)))
            ax.set_ylabel({"s": "time, s"}.get(unit, f"memory, {unit}"))
            values = [value for curve in curves if curve.unit == unit for value in curve.values]
            ax.set_ylim(10.0 ** math.floor(math.log10(min(values))), 10.0 ** math.ceil(math.log10(max(values))))
            ax.yaxis.set_major_formatter("{x:g}")
            ax.yaxis.set_minor_formatter(NullFormatter())
            ax.grid(True, which="major", linewidth=0.4)
            ax.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False)
        drawing.savefig(
            path,
            format=path.suffix[1:],
            bbox_inches="tight",
            metadata={"Date": None} if path.suffix == ".svg" else None,
        )
        pyplot.close(drawing)


def today() -> str:
    """Date in UTC."""
    return time.strftime("%Y-%m-%d", time.gmtime())
