"""Tables and files of located targets."""

from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.network.positions import FORMAT, positions_object, positions_passages
from catseye.gateways.network.positions_figures import positions_figures
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import Card, ResultReport
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.table_report import PartOfReport, report_table, table_report
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.network.positions import LocatedTargets

if TYPE_CHECKING:
    from collections.abc import Mapping

    from catseye.aliases import Progress

PAGE = "positions.md"


def _second(located: LocatedTargets, k: int) -> np.ndarray | None:
    return None if located.other is None else located.other.x[:, k]


def _u(located: LocatedTargets, k: int) -> np.ndarray:
    return np.sqrt(located.positions.covariance[:, k, k]) / MILLIMETRE


def _place(k: int) -> Column[LocatedTargets]:
    return Column(f"{'xyz'[k]}_m", "m", f"{'xyz'[k]} of the target", lambda f: f.positions.x[:, k], ".8f")


def _uncertainty(k: int) -> Column[LocatedTargets]:
    axis = "xyz"[k]
    return Column(f"u_{axis}_mm", "mm", f"standard uncertainty of {axis}", lambda f: _u(f, k), ".6f")


def _image(k: int) -> Column[LocatedTargets]:
    axis = "xyz"[k]
    return Column(
        f"other_{axis}_m", "m", f"{axis} of the second solution, with `--both`", lambda f: _second(f, k), ".8f"
    )


POSITIONS = Table[LocatedTargets](
    "positions.csv",
    PAGE,
    (
        Column("target", "", "name", lambda f: f.target_names),
        *(_place(k) for k in range(3)),
        *(_uncertainty(k) for k in range(3)),
        Column("ranges", "", "number of its ranges", lambda f: f.positions.ranges),
        Column("p", "", "probability of its residuals by chance; empty for three ranges", lambda f: f.p, ".6g"),
        *(_image(k) for k in range(3)),
        Column("status", "", "`found`, or the problem and its remedy", lambda f: f.words),
    ),
)


def _pairs(located: LocatedTargets) -> tuple[np.ndarray, np.ndarray]:
    target, station = np.nonzero(np.isfinite(located.ranges))
    return target, station


RANGES = Table[LocatedTargets](
    "ranges.csv",
    PAGE,
    (
        Column("station", "", "name", lambda f: np.array(f.station_names)[_pairs(f)[1]]),
        Column("target", "", "name", lambda f: np.array(f.target_names)[_pairs(f)[0]]),
        Column("distance_m", "m", "measured", lambda f: f.ranges[_pairs(f)], ".8f"),
        Column("u_mm", "mm", "its u, with the part of its station", lambda f: f.sigma[_pairs(f)] / MILLIMETRE, ".6f"),
        Column("residual_mm", "mm", "measured less computed", lambda f: f.residual[_pairs(f)] / MILLIMETRE, ".6f"),
        Column(
            "closure_mm",
            "mm",
            "measured less predicted by the ranges of the other stations; empty where these determine no point",
            lambda f: f.closure[0][_pairs(f)] / MILLIMETRE,
            ".6f",
        ),
        Column("u_closure_mm", "mm", "its standard uncertainty", lambda f: f.closure[1][_pairs(f)] / MILLIMETRE, ".6f"),
        Column(
            "too_short_mm",
            "mm",
            "length that it lacks to meet the two others of its target; empty where three meet, no column where all do",
            lambda f: f.too_short[_pairs(f)] / MILLIMETRE if np.isfinite(f.too_short).any() else None,
            ".6f",
        ),
        Column(
            "redundancy", "", "share of an error that shows in the residual", lambda f: f.redundancy[_pairs(f)], ".6f"
        ),
    ),
)


def _taken(located: LocatedTargets) -> tuple[np.ndarray, np.ndarray]:
    """Target and step, from 0, of each step that was taken."""
    iteration = located.iteration
    assert iteration is not None
    target, step = np.nonzero((np.arange(len(iteration.differences))[:, None] < iteration.iterations).T)
    return target, step


def _average(located: LocatedTargets, k: int) -> np.ndarray:
    target, step = _taken(located)
    assert located.iteration is not None
    return np.asarray(located.iteration.averages[step, target, k])


def _difference(located: LocatedTargets) -> np.ndarray:
    target, step = _taken(located)
    assert located.iteration is not None
    return np.asarray(located.iteration.differences[step, target])


def _averaged(k: int) -> Column[LocatedTargets]:
    return Column(f"{'xyz'[k]}_m", "m", f"{'xyz'[k]} of the average", lambda f: _average(f, k), ".12f")


STEPS = Table[LocatedTargets](
    "steps.csv",
    PAGE,
    (
        Column("target", "", "name", lambda f: np.array(f.target_names)[_taken(f)[0]]),
        Column("step", "", "number, from 1", lambda f: _taken(f)[1] + 1),
        *(_averaged(k) for k in range(3)),
        Column("difference_m", "m", "distance of the new value from the old", _difference, ".6e"),
    ),
)


def position_tables(located: LocatedTargets) -> tuple[Table[LocatedTargets], ...]:
    """Tables of an answer, the main one first."""
    return (POSITIONS, RANGES) if located.iteration is None else (POSITIONS, RANGES, STEPS)


def positions_report(located: LocatedTargets, when: datetime, inputs: "Mapping[str, str]") -> ResultReport:
    """Report of located targets.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    total, lines = len(located.found), int(np.isfinite(located.ranges).sum())
    factor, bad = located.variance_factor, int(located.contradicting.sum())
    first, *more_tables = (report_table(table, located) for table in position_tables(located))
    figures = {name: (drawn.figure, drawn.caption) for name, drawn in positions_figures(located).items()}
    return table_report(
        "Positions of targets",
        f"{total} targets from {lines} ranges of {len(located.stations)} known stations",
        located.verdict,
        cards=[
            Card("Found", f"{int(located.found.sum())} of {total}", "targets with a position"),
            Card("Variance factor", f"{factor:.3g}" if np.isfinite(factor) else "unknown", "of all residuals"),
            Card("Contradicting", str(bad), f"targets whose ranges disagree, level {located.level:g} for all"),
        ],
        passages=positions_passages(located),
        parts=[
            PartOfReport("Targets", [first], figures),
            *(PartOfReport(table.key.capitalize(), [table]) for table in more_tables),
        ],
        when=when,
        inputs=inputs,
    )


def write_positions(
    located: LocatedTargets, directory: Path, inputs: "Mapping[str, str]", progress: "Progress | None" = None
) -> None:
    """Write report, tables, JSON and figures, and the provenance with their hashes.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    """
    when = datetime.now(UTC)
    files: Files = {
        **{table.file: partial(table.pieces, located) for table in position_tables(located)},
        "result.json": lambda: json_page(positions_object(located)),
        "report.html": lambda: report_page(positions_report(located, when, inputs)),
        **{f"{name}.svg": partial(svg, drawn.figure) for name, drawn in positions_figures(located).items()},
    }
    provenance = {"format": FORMAT, "made_by": "catseye locate"}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
