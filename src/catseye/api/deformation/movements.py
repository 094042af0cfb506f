"""`movements`: of points between two epochs, from changes of range and approximate coordinates."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.reduction.deformation.movements import MeasuredMovements


@dataclass(frozen=True, eq=False, repr=False)
class MovementsResult(Result):
    """Movements of n points from changes of their ranges.

    measured   the recipe's answer: movements, covariance, tests of constraints and changes
    paths      of the tables and the constraints
    """

    measured: "MeasuredMovements"
    paths: tuple[Path, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the points, in the order of their table."""
        return self.measured.changes.points

    @property
    def displacement(self) -> np.ndarray:
        """Movements (n, 3) m, after less before; nan where undetermined."""
        return self.measured.displacement

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (3n, 3n) m² of all movements."""
        return self.measured.covariance

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m."""
        return self.measured.u

    @property
    def p(self) -> np.ndarray:
        """Probability (n,) of such a movement of a point at rest."""
        return self.measured.p

    @property
    def words(self) -> tuple[str, ...]:
        """Verdicts on the points.

        "moved", "at rest", "held" or "undetermined".
        """
        return self.measured.words

    @property
    def constraints(self) -> dict[str, float]:
        """Probability by chance of what contradicts each constraint, by its name.

        nan where nothing checks it.
        """
        return {test.name: test.p for test in self.measured.tests}

    def passages(self) -> "Sequence[Passage]":
        """Movements, constraints, air, changes."""
        from catseye.gateways.deformation.objects import movement_passages

        return movement_passages(self.measured)

    def rows(self) -> list[str]:
        """Movements of a few points as lines of text."""
        from catseye.gateways.deformation.objects import movement_rows

        return movement_rows(self.measured)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye movements --json`."""
        from catseye.gateways.deformation.objects import movements_object

        return movements_object(self.measured)

    def tables(self) -> "dict[str, QTable]":
        """`movements`, a row a point; `changes`, a row a line; `constraints`."""
        from catseye.gateways.deformation.tables import CHANGES, CONSTRAINTS, MOVEMENTS

        tables = (MOVEMENTS, CHANGES, CONSTRAINTS) if self.measured.tests else (MOVEMENTS, CHANGES)
        return {
            table.file.removesuffix(".csv"): quantities(
                table.quantities(self.measured, [column.name for column in table.columns])
            )
            for table in tables
        }

    def figures(self) -> "dict[str, Figure]":
        """Plan and elevation with displacements and their ellipses."""
        from catseye.gateways.deformation.figures import movement_figures

        return {name: drawn.figure for name, drawn in movement_figures(self.measured).items()}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.deformation.files import movements_report

        return movements_report(self.measured, when, self.inputs())

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye movements --out`."""
        from catseye.gateways.deformation.files import write_movements

        write_movements(self.measured, directory, self.inputs(), progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the files that were read, by name."""
        return {path.name: digest_of(path) for path in self.paths}

    def sources(self) -> tuple[Path, ...]:
        """The files that were read."""
        return self.paths


@with_units
def movements(
    before: "str | os.PathLike[str]",
    after: "str | os.PathLike[str]",
    points: "str | os.PathLike[str]",
    *,
    constraints: "str | os.PathLike[str] | None" = None,
    air_ppm: Annotated[Any, In("ppm", one=True)] = 0.0,
    level: Annotated[Any, In("", one=True)] = 0.05,
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
) -> MovementsResult:
    """Movements of points between two epochs, from changes of range and approximate coordinates.

    before, after   tables of ranges of the same lines (docs/formats/movements.md)
    points          table of approximate coordinates of stations and points, with standard uncertainties
    constraints     file of constraints: which points move together, in a plane, along a line, or not at all
    air_ppm         standard uncertainty of the change of the air's index from epoch to epoch, common to all lines, ppm
    level           of the tests
    sigma_mm, sigma_ppm   standard uncertainty of ranges without one: a + b D

    The zero of a ranger cancels; of its scale remains the share of the change, 1 nm of a millimetre a ppm. Stations are
    taken not to move: where they do, `compare` adjusts both epochs as networks.

    Raises InputError for a file that cannot be used, ArgumentError for a level or an uncertainty out of range.
    Source: [PARKER04] 3.2.4 and 3.2.5.

    >>> example = [f"movements/{name}.csv" for name in ("before", "after", "points")]
    >>> found = movements(*example, constraints="movements/constraints.toml", air_ppm=0.5)
    >>> found.verdict.word, found.words[found.names.index("FA1")]
    ('good', 'moved')
    """
    from catseye.records.files.reading import read_record
    from catseye.records.network.claim import RangeClaim
    from catseye.records.network.movement_constraints import MovementConstraints
    from catseye.records.network.range_changes import read_range_changes
    from catseye.reduction.deformation.movements import measured_movements

    if not 0.0 < level < 1.0:
        raise ArgumentError(f"level = {level:g} (expected a probability between 0 and 1)", "level")
    if not 0.0 <= air_ppm <= 1000.0:
        raise ArgumentError(f"air_ppm = {air_ppm:g} (expected 0 to 1000)", "air_ppm")
    paths = [place_of(item) for item in (before, after, points)]
    changes = read_range_changes(paths[0], paths[1], paths[2], RangeClaim.from_options(sigma_mm, sigma_ppm))
    rules = None
    if constraints is not None:
        paths.append(place_of(constraints))
        rules = read_record(paths[-1], MovementConstraints)
    answer = measured_movements(changes, rules, air_ppm=float(air_ppm), level=float(level))
    return MovementsResult(verdict=answer.verdict, measured=answer, paths=tuple(paths))
