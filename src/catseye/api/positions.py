"""`locate`: positions of many targets from ranges to known stations."""

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
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.network.ranged_targets import RangedTargets
    from catseye.reduction.network.positions import LocatedTargets


@dataclass(frozen=True, eq=False, repr=False)
class PositionsResult(Result):
    """Positions of m targets, each from its own ranges to known stations.

    located   the recipe's answer
    paths     of the two tables; none where arrays were given
    """

    located: "LocatedTargets"
    paths: tuple[Path, ...] = ()

    @property
    def x(self) -> np.ndarray:
        """Coordinates (m, 3) m; nan where there are none."""
        return self.located.positions.x

    @property
    def covariance(self) -> np.ndarray:
        """Covariances (m, 3, 3) m², with the stations' part where it was given."""
        return self.located.positions.covariance

    @property
    def status(self) -> np.ndarray:
        """Texts (m,): "found", or the problem and its remedy."""
        return self.located.words

    @property
    def found(self) -> np.ndarray:
        """Mask (m,) of targets with a position."""
        return self.located.found

    @property
    def pvv(self) -> np.ndarray:
        """Sums (m,) of squared residuals in sigmas.

        nan where no solution was tried.
        """
        return self.located.positions.pvv

    @property
    def ranges(self) -> np.ndarray:
        """Number (m,) of ranges of each target."""
        return self.located.positions.ranges

    @property
    def p(self) -> np.ndarray:
        """Probabilities (m,) of residuals as large by chance, chi-square.

        nan for three ranges, which nothing checks.
        """
        return self.located.p

    @property
    def contradicting(self) -> np.ndarray:
        """Mask (m,) of targets whose ranges do not agree within their claims."""
        return self.located.contradicting

    @property
    def residual(self) -> np.ndarray:
        """Residuals (m, n) m, measured less computed; nan without a range."""
        return self.located.residual

    @property
    def redundancy(self) -> np.ndarray:
        """Share (m, n) of an error of each range that shows in its residual."""
        return self.located.redundancy

    @property
    def too_short(self) -> np.ndarray:
        """Lengths (m, n) m that three ranges lack to meet; nan where they do."""
        return self.located.too_short

    @property
    def closure(self) -> np.ndarray:
        """Each range (m, n) m less what the other stations' ranges predict.

        nan where they determine no point; `u_closure` is its standard uncertainty.
        """
        return self.located.closure[0]

    @property
    def u_closure(self) -> np.ndarray:
        """Standard uncertainties (m, n) m of the closures."""
        return self.located.closure[1]

    @property
    def other_x(self) -> np.ndarray | None:
        """Second solutions (m, 3) m; nan where the ranges exclude one, None if not asked for."""
        return None if self.located.other is None else self.located.other.x

    @property
    def other_covariance(self) -> np.ndarray | None:
        """Their covariances (m, 3, 3) m²."""
        return None if self.located.other is None else self.located.other.covariance

    def passages(self) -> "Sequence[Passage]":
        """Number and quality of the positions, second solutions, steps, agreement of the ranges."""
        from catseye.gateways.network.positions import positions_passages

        return positions_passages(self.located)

    def rows(self) -> list[str]:
        """Coordinates of a few targets as lines of text."""
        from catseye.gateways.network.positions import position_rows

        return position_rows(self.located)

    def to_object(self) -> dict[str, Any]:
        """Arrays in the order of the targets."""
        from catseye.gateways.network.positions import positions_object

        return positions_object(self.located)

    def tables(self) -> "dict[str, QTable]":
        """`positions`: a row a target; `ranges`: a row a range; `steps` of the notes' iteration."""
        from catseye.gateways.network.positions_tables import position_tables

        made: dict[str, QTable] = {}
        for table in position_tables(self.located):
            columns = table.quantities(self.located, [column.name for column in table.columns])
            if not made:
                columns["covariance"] = (self.covariance / MILLIMETRE**2, "mm2")
            made[table.file.removesuffix(".csv")] = quantities(columns)
        return made

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.network.positions_tables import positions_report

        return positions_report(self.located, when, self.inputs())

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye locate --out`."""
        from catseye.gateways.network.positions_tables import write_positions

        write_positions(self.located, directory, self.inputs(), progress)

    def figures(self) -> "dict[str, Figure]":
        """Plan and elevation of stations and targets with their ellipses."""
        from catseye.gateways.network.positions_figures import positions_figures

        return {name: drawn.figure for name, drawn in positions_figures(self.located).items()}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the two tables, by name."""
        return {path.name: digest_of(path) for path in self.paths}

    def sources(self) -> tuple[Path, ...]:
        """The two tables that were read."""
        return self.paths


@with_units
def locate(
    stations: Annotated[Any, In("m", text=True)],
    ranges: Annotated[Any, In("m", text=True)],
    sigma: Annotated[Any, In("m")] = None,
    *,
    near: Annotated[Any, In("m")] = None,
    both: bool = False,
    method: str = "least_squares",
    u_stations: Annotated[Any, In("m")] = None,
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
) -> PositionsResult:
    """Positions of many targets, each from its own ranges to known stations.

    stations   (n, 3) m, or a table stations.csv (docs/formats/positions.md)
    ranges     (m, n) m, nan where missing, (n,) is one target; or a table ranges.csv
    sigma      m, standard uncertainties of the ranges, independent: a number, (n,) or (m, n)
    near       (3,) or (m, 3) m: a point on the target's side of the stations' plane, where two mirror images fit alike
    both       the second solution, too: `other_x`. The first is on the side of `near`, else above the stations
    method     "least_squares", or "averaging": the notes' iteration for three ranges, which begins at `near`
    u_stations   m, standard uncertainties of the stations' coordinates: a number, (n,) or (n, 3); a table has its own
    sigma_mm, sigma_ppm   standard uncertainty of ranges without one: a + b D

    An uncertainty of the stations enters the covariance of each target; what targets have in common is known to
    `adjust` alone, which estimates stations, too.

    Raises InputError for shapes that do not join, for stations that are not finite, and for a table that cannot be
    used; ArgumentError for arguments that do not fit together.
    Source: [PARKER04] section 3.1; `catseye.estimation.network.positions`.

    >>> stations = [[0.0, 0, 0], [50, 0, 1], [0, 50, 2], [50, 50, 9]]
    >>> there = locate(stations, np.linalg.norm(np.array([20.0, 10, 30]) - stations, axis=1), 1e-4)
    >>> np.round(there.x, 6).tolist(), there.verdict.word
    ([[20.0, 10.0, 30.0]], 'good')
    """
    from catseye.reduction.network.positions import METHODS, located

    if method not in METHODS:
        raise ArgumentError(f"method = {method!r} (expected one of {', '.join(METHODS)})", "method")
    if method == "averaging" and near is None:
        raise ArgumentError("method averaging begins at a point off the stations' plane: near is missing", "near")
    read, paths = _read(stations, ranges, sigma, u_stations=u_stations, claim=(sigma_mm, sigma_ppm))
    found = located(
        read.x,
        read.ranges,
        read.sigma,
        near=near,
        both=both,
        averaging=method == "averaging",
        u_stations=read.u if np.any(read.u) else None,
        names=(read.stations, read.targets) if paths else None,
    )
    return PositionsResult(verdict=found.verdict, located=found, paths=paths)


def _read(
    stations: Any, ranges: Any, sigma: Any, *, u_stations: Any, claim: tuple[float | None, float | None]
) -> "tuple[RangedTargets, tuple[Path, ...]]":
    """Stations and ranges of two tables, or of arrays, and the paths that were read."""
    from catseye.records.network.claim import RangeClaim
    from catseye.records.network.ranged_targets import RangedTargets, read_ranged_targets

    claimed = RangeClaim.from_options(*claim)
    tables = [isinstance(each, str | os.PathLike) for each in (stations, ranges)]
    if all(tables):
        for name, value in (("sigma", sigma), ("u_stations", u_stations)):
            if value is not None:
                raise ArgumentError(f"{name} stands in the tables: give it there, not beside them", name)
        paths = (place_of(stations), place_of(ranges))
        return read_ranged_targets(*paths, claimed), paths
    if any(tables):
        raise ArgumentError("one of stations and ranges is a table (expected two tables, or two arrays)", "ranges")
    x, d = np.asarray(stations, dtype=float), np.atleast_2d(np.asarray(ranges, dtype=float))
    if sigma is None:
        if not claimed:
            raise ArgumentError("sigma is missing (expected one, m, or sigma_mm and sigma_ppm)", "sigma")
        u = claimed.of(d)
    else:
        u = np.asarray(sigma, dtype=float)
    return RangedTargets((), (), x, np.asarray(0.0 if u_stations is None else u_stations, dtype=float), d, u), ()
