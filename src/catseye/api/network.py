"""`adjust` and `compare`: points from ranges, angles, heights and vectors between them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack, overload

import numpy as np

from catseye.aliases import Progress
from catseye.api.network_source import hashes_of, network_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import ArgumentError, EstimationError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.api.network_source import NetworkSource
    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.reduction.network.adjusted import AdjustedNetwork
    from catseye.reduction.network.comparison import ComparedEpochs
    from catseye.reduction.network.treatment import AdjustmentOptions


@dataclass(frozen=True, eq=False, repr=False)
class AdjustmentResult(Result):
    """Adjusted network of n points and m observations.

    In the axes and the order of its file.

    adjusted   the recipe's answer: solution, observations, tests, treatment
    path       that was read; None where a network or arrays were given
    """

    adjusted: "AdjustedNetwork"
    path: Path | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the points, in the order of the file."""
        return self.adjusted.names

    @property
    def x(self) -> np.ndarray:
        """Coordinates (n, 3) m.

        nan where a coordinate is absent: nobody gave it and nothing measures it.
        """
        return self.adjusted.x

    @property
    def covariances(self) -> np.ndarray:
        """Covariances (n, 3, 3) m² of each point.

        nan where a coordinate is absent; `covariance` is that of all points together.
        """
        return self.adjusted.covariance

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m."""
        return self.adjusted.u

    @property
    def status(self) -> str:
        """Status: "converged", or the problem and its remedy."""
        return self.adjusted.solution.status

    @property
    def variance_factor(self) -> float:
        """Variance factor [pvv] / degrees of freedom, expectation 1.

        nan where nothing is redundant.
        """
        return self.adjusted.solution.variance_factor

    @property
    def degrees_of_freedom(self) -> float:
        """Observations less unknowns, the datum's conditions added."""
        return self.adjusted.solution.degrees_of_freedom

    @property
    def residuals(self) -> np.ndarray:
        """Residuals (m,), observed less predicted, m or rad."""
        return self.adjusted.table.residual

    @property
    def standardised(self) -> np.ndarray:
        """Residuals (m,) over their standard uncertainties.

        nan where nothing checks the observation.
        """
        return self.adjusted.table.standardised

    @property
    def redundancy(self) -> np.ndarray:
        """Share (m,) of an error that shows in its residual."""
        return self.adjusted.table.redundancy

    @property
    def suspects(self) -> np.ndarray:
        """Rows of observations that the tests reject, worst first."""
        return self.adjusted.suspects

    @property
    def likely(self) -> np.ndarray:
        """Rows that one-by-one data snooping would leave out."""
        return self.adjusted.likely

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of all coordinates, (3n, 3n) m².

        x, y, z of each point in turn; computed on first use.
        """
        axes = self.adjusted.network.axes  # a signed permutation: an unknown row leaves the others known
        at, n = np.argmax(np.abs(axes), axis=0), len(self.names)
        sign = np.tile(axes[at, np.arange(3)], n)
        rows = (3 * np.arange(n)[:, None] + at).ravel()
        block = self.adjusted.solution.block(self.names)[np.ix_(rows, rows)]
        return np.asarray(np.outer(sign, sign) * block * self.adjusted.factor)

    def passages(self) -> "Sequence[Passage]":
        """Sentences on network, points, parameters, fit, checks and treatment."""
        from catseye.gateways.network.summary import passages, treatment_passages

        return [*passages(self.adjusted), *treatment_passages(self.adjusted)]

    def rows(self) -> list[str]:
        """Coordinates of a small network as lines of text."""
        from catseye.gateways.network.summary import point_rows

        return point_rows(self.adjusted)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye adjust --json`."""
        from catseye.gateways.network.objects import network_object

        return network_object(self.adjusted)

    def to_json(self) -> str:
        """JSON of the command on one line, made in pieces."""
        from catseye.gateways.network.objects import network_json

        return "".join(network_json(self.adjusted)).rstrip("\n")

    def tables(self) -> "dict[str, QTable]":
        """`points`, a row a point; `observations`, a row an observation.

        An observation is in its own unit, which stands beside it.
        """
        axes = self.adjusted.network.axis_names
        points = {
            "point": (self.names, ""),
            **{axis: (self.x[:, k], "m") for k, axis in enumerate(axes)},
            **{f"u_{axis}": (self.u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate(axes)},
            "covariance": (self.covariances / MILLIMETRE**2, "mm2"),
            "u_position": (self.adjusted.u_position / MILLIMETRE, "mm"),
            "ellipse_major": (self.adjusted.ellipse.major / MILLIMETRE, "mm"),
            "ellipse_minor": (self.adjusted.ellipse.minor / MILLIMETRE, "mm"),
            "ellipse_bearing": (self.adjusted.ellipse.bearing / DEGREE, "deg"),
        }
        table = self.adjusted.table
        ends = [*self.names, ""]
        columns = {
            "kind": ([table.kinds[k] for k in table.kind], ""),
            "from": ([ends[i] for i in table.ends[:, 0]], ""),
            "to": ([ends[i] for i in table.ends[:, 1]], ""),
            "unit": (table.unit, ""),
            "observed": (table.observed, ""),
            "u": (table.u, ""),
            "residual": (self.residuals, ""),
            "standardised": (self.standardised, ""),
            "redundancy": (self.redundancy, ""),
            "mdb": (table.mdb, ""),
            "used": (table.active, ""),
        }
        return {"points": quantities(points), "observations": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """The figures of the report: plan, elevation, residuals, redundancy."""
        from catseye.gateways.network.figures import network_figures

        return {name: drawn.figure for name, drawn in network_figures(self.adjusted).items()}

    @property
    def answered(self) -> bool:
        """True if there are coordinates, valid within their covariance."""
        return self.adjusted.answered

    def require_answer(self) -> None:
        """Raise EstimationError where the adjustment has no answer."""
        if not self.adjusted.answered:
            network = self.path or self.adjusted.network.source or "the network"
            raise EstimationError(f"{network}: {self.status}")

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        self.require_answer()
        from catseye.gateways.network.report import network_report

        return network_report(self.adjusted, when, self.inputs())

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye adjust --out`; EstimationError where there is no answer to write."""
        self.require_answer()
        from catseye.gateways.network.files import write_network

        write_network(self.adjusted, directory, self.inputs(), progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the network's file or tables."""
        return hashes_of(self.path)

    def sources(self) -> tuple[Path, ...]:
        """The network's file or folder."""
        return () if self.path is None else (self.path,)


class _AdjustOptions(TypedDict, total=False):
    """Keywords of `adjust`, for type checkers."""

    points: Sequence[str] | None
    datum: str | None
    reject: bool
    robust: str | None
    components: str | None
    scale_by_variance_factor: bool
    level: Any
    power: Any
    mdb_level: Any
    iterations: Any
    relative: Sequence[tuple[str, str]]
    sigma_mm: Any
    sigma_ppm: Any
    progress: Progress | None


@overload
def adjust(network: "NetworkSource", later: None = None, **options: Unpack[_AdjustOptions]) -> AdjustmentResult: ...


@overload
def adjust(
    network: "NetworkSource", later: "NetworkSource", **options: Unpack[_AdjustOptions]
) -> "ComparisonResult": ...


@with_units
def adjust(
    network: "NetworkSource",
    later: "NetworkSource | None" = None,
    *,
    points: Sequence[str] | None = None,
    datum: str | None = None,
    reject: bool = False,
    robust: str | None = None,
    components: str | None = None,
    scale_by_variance_factor: bool = False,
    level: Annotated[Any, In("", one=True)] = 0.05,
    power: Annotated[Any, In("", one=True)] = 0.8,
    mdb_level: Annotated[Any, In("", one=True)] = 0.001,
    iterations: Annotated[Any, In("", whole=True)] = None,
    relative: Sequence[tuple[str, str]] = (),
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
    progress: Progress | None = None,
) -> "AdjustmentResult | ComparisonResult":
    """Least-squares adjustment of a network, or comparison of two epochs.

    Every observation is used as claimed unless an argument says otherwise.

    network      file or folder (docs/formats/network.md), an example's name, what `load` gave, or a mapping of the
                 columns of points.csv and ranges.csv: {"points": {...}, "ranges": {...}}, mappings of arrays or
                 QTables; lengths with a unit, or in m
    later        the same network at a later epoch: the answer is then that of `compare`, both adjusted alike
    points       names to compare between the two epochs; None: all common ones
    datum        "free": inner constraints on the marked points; "fixed": marked points held; None: as the file marks it
    reject       leave out observations that the tests reject, one by one
    robust       or weigh them: "huber", "l1", "biweight", "igg3" or "geman_mcclure"
    components   estimate the claims themselves: "rangers" or "groups"
    scale_by_variance_factor   multiply covariances by the variance factor; tau tests
    level        of the tests, of all single ones together
    power        probability of finding an error of the size of `mdb`, or a displacement of the size of `detectable`
    mdb_level    level of the test of one observation that `mdb` refers to
    iterations   cap of the Gauss-Newton steps of every solution, 1 or more; None: 50
    relative     pairs of points whose relative ellipsoid is wanted
    sigma_mm, sigma_ppm   standard uncertainty of a range of ranges.csv that has none: a + b D
    progress     called with (what, done, of how many)

    A network without an answer is a result, too: its verdict is "failed", `status` says why and what to do, and
    `catseye.save` refuses it; two epochs without an answer are refused. Raises InputError for a file or a column that
    cannot be used, ArgumentError for arguments that do not fit together, and EstimationError for a name that is not in
    the network.

    >>> answer = adjust("networks/ground-ring")
    >>> answer.verdict.word, answer.x.shape == (len(answer.names), 3)
    ('good', True)
    """
    from catseye.estimation.least_squares.adjustment import COMPLETE
    from catseye.reduction.network.treatment import AdjustmentOptions

    if points is not None and later is None:
        raise ArgumentError("points needs a later epoch to compare with", "points")
    options = AdjustmentOptions(
        datum=datum,
        reject=reject,
        robust=robust,
        components=components,
        scale_by_variance_factor=scale_by_variance_factor,
        level=level,
        power=power,
        mdb_level=mdb_level,
        relative=tuple(relative),
        solver=COMPLETE if iterations is None else replace(COMPLETE, iterations=iterations),
    )
    first = _adjusted(network, sigma_mm, sigma_ppm, options=options, progress=progress)
    if later is None:
        return first
    second = _adjusted(later, sigma_mm, sigma_ppm, options=options, progress=progress)
    return compare(
        first,
        second,
        points=points,
        level=level,
        power=power,
        scale_by_variance_factor=scale_by_variance_factor,
        progress=progress,
    )


def _adjusted(
    network: "NetworkSource",
    sigma_mm: float | None,
    sigma_ppm: float | None,
    *,
    options: "AdjustmentOptions",
    progress: Progress | None,
) -> AdjustmentResult:
    from catseye.reduction.network.adjusted import adjusted

    read, path = network_of(network, sigma_mm, sigma_ppm)
    answer = adjusted(read, options, progress=progress)
    return AdjustmentResult(verdict=answer.verdict, adjusted=answer, path=path)


@dataclass(frozen=True, eq=False, repr=False)
class ComparisonResult(Result):
    """Movements of k common points between two epochs.

    In the axes of the first epoch's file.

    compared        the recipe's answer: displacements, tests, both adjustments
    first, second   the epochs
    """

    compared: "ComparedEpochs"
    first: AdjustmentResult
    second: AdjustmentResult

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the common points."""
        return tuple(self.compared.deformation.names)

    @property
    def displacement(self) -> np.ndarray:
        """Displacements (k, 3) m, second epoch less first."""
        return self.compared.displacement

    @property
    def covariances(self) -> np.ndarray:
        """Covariances (k, 3, 3) m² of each displacement."""
        return self.compared.covariance

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (k, 3) m."""
        return self.compared.u

    @property
    def p(self) -> np.ndarray:
        """Probability (k,) of such a displacement by chance."""
        return self.compared.deformation.p

    @property
    def words(self) -> tuple[str, ...]:
        """Verdicts on the points.

        "moved", "stable", "held", "undecided" or "not checked".
        """
        return tuple(self.compared.verdicts)

    def passages(self) -> "Sequence[Passage]":
        """Movements and assumptions."""
        from catseye.gateways.network.comparison import comparison_passages

        return comparison_passages(self.compared)

    def rows(self) -> list[str]:
        """No further lines for a terminal."""
        return []

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye adjust A B --json`."""
        from catseye.gateways.network.comparison import comparison_object

        return comparison_object(self.compared)

    def tables(self) -> "dict[str, QTable]":
        """`displacements`: a row a common point."""
        axes = self.compared.first.network.axis_names
        columns = {
            "point": (self.names, ""),
            **{f"d{axis}": (self.displacement[:, k] / MILLIMETRE, "mm") for k, axis in enumerate(axes)},
            **{f"u_d{axis}": (self.u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate(axes)},
            "p": (self.p, ""),
            "word": (self.words, ""),
        }
        return {"displacements": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """Plan and elevation with displacements and their ellipses."""
        from catseye.gateways.network.comparison_figures import comparison_figures

        return {name: drawn.figure for name, drawn in comparison_figures(self.compared).items()}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.network.comparison_report import comparison_report

        return comparison_report(self.compared, when, self.inputs())

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye adjust A B --out`."""
        from catseye.gateways.network.files import write_comparison

        write_comparison(self.compared, directory, self.inputs(), progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of both networks' files, with the number of the epoch before their names."""
        epochs = enumerate((self.first, self.second), start=1)
        return {f"{k}: {name}": digest for k, epoch in epochs for name, digest in epoch.inputs().items()}

    def sources(self) -> tuple[Path, ...]:
        """Both networks' files or folders."""
        return (*self.first.sources(), *self.second.sources())


@with_units
def compare(
    first: "NetworkSource | AdjustmentResult",
    second: "NetworkSource | AdjustmentResult",
    *,
    points: Sequence[str] | None = None,
    level: Annotated[Any, In("", one=True)] = 0.05,
    power: Annotated[Any, In("", one=True)] = 0.8,
    scale_by_variance_factor: bool = False,
    progress: Progress | None = None,
) -> ComparisonResult:
    """Movements between two epochs of a network.

    first, second   networks as for `adjust`, or what it gave
    points          names to compare; all common ones without
    level           of the tests
    power           with which they find a displacement of the detectable size
    scale_by_variance_factor   multiply covariances by the variance factor of both epochs together; F tests

    Every common point is in the answer, with displacement, covariance and test; one that moved so far that it may be
    another point under the same name makes the verdict doubtful. A coordinate absent in either epoch is nan.

    Raises EstimationError where an epoch has no answer or the two have too little in common.
    """
    from catseye.reduction.network.comparison import compared

    epochs = [
        each if isinstance(each, AdjustmentResult) else adjust(each, level=level, progress=progress)
        for each in (first, second)
    ]
    for epoch in epochs:
        epoch.require_answer()
    found = compared(
        epochs[0].adjusted,
        epochs[1].adjusted,
        points=points,
        level=level,
        power=power,
        scale_by_variance_factor=scale_by_variance_factor,
    )
    return ComparisonResult(verdict=found.verdict, compared=found, first=epochs[0], second=epochs[1])


def write_template(directory: Path) -> None:
    """Write tables to begin a network with.

    points.csv, ranges.csv and a README that explains them.

    directory   to be made
    """
    from catseye.gateways.examples import copy_example

    copy_example("networks/template", directory)
