"""`adjust`, `plan`, `compare` and `locate`: points from ranges, angles, heights and vectors between them."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.estimation.network.model import ObservationNetwork
    from catseye.estimation.network.positions.dispatch import Positions
    from catseye.gateways.network.comparison import ComparedEpochs
    from catseye.gateways.network.findings import Findings
    from catseye.gateways.network.plan import PlanFindings
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.network import AdjustedNetwork

NETWORKS = ".toml, .dat (STAR*NET), .gkf (GNU Gama), or a folder with points.csv and ranges.csv"


@dataclass(frozen=True, eq=False, repr=False)
class AdjustmentResult(Result):
    """A network adjusted: n points and m observations, in the axes and the order of its file.

    names                of the points
    x                    (n, 3) m; nan where a coordinate is absent: nobody gave it and nothing measures it
    covariances          (n, 3, 3) m² of each point; `covariance` is that of all together; nan likewise
    u                    (n, 3) m, standard uncertainties
    status               "converged", or what is wrong and what to do
    variance_factor      [pvv] / degrees of freedom, expectation 1; nan where nothing is redundant
    degrees_of_freedom   observations less unknowns, the datum's conditions added
    residuals            (m,) observed less predicted, m or rad
    standardised         (m,) residual over its standard uncertainty; nan where nothing checks the observation
    redundancy           (m,) share of an error that shows in its residual
    suspects             rows of observations that the tests reject, worst first: named, not removed
    likely               rows that one-by-one data snooping would leave out
    findings             everything else, told
    treated              the solution beneath, and how observations were treated
    path                 that was read; None where a network was given
    """

    names: tuple[str, ...]
    x: np.ndarray
    covariances: np.ndarray
    u: np.ndarray
    status: str
    variance_factor: float
    degrees_of_freedom: float
    residuals: np.ndarray
    standardised: np.ndarray
    redundancy: np.ndarray
    suspects: np.ndarray
    likely: np.ndarray
    findings: "Findings"
    treated: "AdjustedNetwork"
    path: Path | None

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of all coordinates, (3n, 3n) m², x, y, z of each point in turn; computed when asked for."""
        axes = self.findings.network.axes  # a signed permutation: an unknown row leaves the others known
        at, n = np.argmax(np.abs(axes), axis=0), len(self.names)
        sign = np.tile(axes[at, np.arange(3)], n)
        rows = (3 * np.arange(n)[:, None] + at).ravel()
        block = self.findings.solution.block(self.names)[np.ix_(rows, rows)]
        return np.asarray(np.outer(sign, sign) * block * self.findings.factor)

    def passages(self) -> "Sequence[Passage]":
        """The network, its points, the fit, the checks, and what was left out."""
        from catseye.gateways.network.summary import passages, treatment_passages

        return [*passages(self.findings), *treatment_passages(self.treated, self.findings)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye adjust --json`."""
        from catseye.gateways.network.objects import network_object

        return network_object(self.findings, self.treated)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a point; `observations`: a row an observation, in its own unit, which stands beside it."""
        points = {
            "point": (self.names, ""),
            **{axis: (self.x[:, k], "m") for k, axis in enumerate(self.findings.network.axis_names)},
            **{
                f"u_{axis}": (self.u[:, k] / MILLIMETRE, "mm")
                for k, axis in enumerate(self.findings.network.axis_names)
            },
            "covariance": (self.covariances / MILLIMETRE**2, "mm2"),
        }
        table = self.findings.table
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

        return {name: drawn.figure for name, drawn in network_figures(self.findings).items()}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye adjust --out`; EstimationError where there is no answer to write."""
        require_answer(self)
        from catseye.gateways.network.files import write_network

        write_network(self.findings, directory, self.inputs(), progress=progress, treated=self.treated)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the network's file or tables."""
        return _hashes(self.path)

    def sources(self) -> tuple[Path, ...]:
        """The network's file or folder."""
        return () if self.path is None else (self.path,)


@with_units
def adjust(
    network: "str | os.PathLike[str] | ObservationNetwork",
    *,
    datum: str | None = None,
    reject: bool = False,
    robust: str | None = None,
    components: str | None = None,
    scale_by_variance_factor: bool = False,
    level: Annotated[Any, In("", one=True)] = 0.05,
    relative: Sequence[tuple[str, str]] = (),
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
    progress: Progress | None = None,
) -> AdjustmentResult:
    """A network by least squares, every observation used as claimed unless asked otherwise.

    network      file or folder (docs/formats/network.md), an example's name, or what `load` gave
    datum        "free": inner constraints on the marked points; "fixed": marked points held; None: as the file marks it
    reject       leave out observations that the tests reject, one by one
    robust       or weigh them: "huber", "danish" and so on, as `catseye adjust --robust`
    components   estimate the claims themselves: "rangers" or "groups"
    scale_by_variance_factor   multiply covariances by the variance factor; tau tests
    level        of the tests, of all single ones together
    relative     pairs of points whose relative ellipsoid is wanted
    sigma_mm, sigma_ppm   standard uncertainty of a range of ranges.csv that has none: a + b D, in quadrature
    progress     called with (what, done, of how many)

    A network without an answer is a result, too: its verdict is "failed", `status` says why and what to do, and
    `catseye.save` refuses it. Raises InputError for a file that cannot be used and EstimationError for a name that is
    not in the network.

    >>> answer = adjust("networks/ground-ring")
    >>> answer.verdict.word, answer.x.shape == (len(answer.names), 3)
    ('good', True)
    """
    from catseye.gateways.network.findings import findings
    from catseye.gateways.network.summary import verdict
    from catseye.reduction.network import adjusted

    read, path = _network_of(network, sigma_mm, sigma_ppm)
    treated = adjusted(
        read, datum=datum, reject=reject, robust=robust, level=level, components=components, progress=progress
    )
    told = findings(treated.solution, scaled=scale_by_variance_factor, level=level, pairs=relative)
    return AdjustmentResult(
        verdict(told),
        told.names,
        told.x,
        told.covariance,
        told.u,
        told.solution.status,
        told.solution.variance_factor,
        told.solution.degrees_of_freedom,
        told.table.residual,
        told.table.standardised,
        told.table.redundancy,
        told.suspects,
        np.flatnonzero(told.in_table(treated.likely)),
        told,
        treated,
        path,
    )


@dataclass(frozen=True, eq=False, repr=False)
class ComparisonResult(Result):
    """Movements of k common points between two epochs, in the axes of the first epoch's file.

    names           of the common points
    displacement    (k, 3) m, second epoch less first
    covariances     (k, 3, 3) m² of each displacement
    u               (k, 3) m
    p               (k,) chance of a displacement as large if the point stands still
    words           (k) "moved", "stable", "held", "undecided" or "not checked"
    compared        everything else
    first, second   the epochs
    """

    names: tuple[str, ...]
    displacement: np.ndarray
    covariances: np.ndarray
    u: np.ndarray
    p: np.ndarray
    words: tuple[str, ...]
    compared: "ComparedEpochs"
    first: AdjustmentResult
    second: AdjustmentResult

    def passages(self) -> "Sequence[Passage]":
        """Movements and assumptions."""
        from catseye.gateways.network.comparison import comparison_passages

        return comparison_passages(self.compared)

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
        from catseye.gateways.network.comparison_report import comparison_figures

        return {name: drawn.figure for name, drawn in comparison_figures(self.compared).items()}

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
    first: "str | os.PathLike[str] | ObservationNetwork | AdjustmentResult",
    second: "str | os.PathLike[str] | ObservationNetwork | AdjustmentResult",
    *,
    points: Sequence[str] | None = None,
    level: Annotated[Any, In("", one=True)] = 0.05,
    scale_by_variance_factor: bool = False,
    progress: Progress | None = None,
) -> ComparisonResult:
    """Movements between two epochs of a network.

    first, second   networks as for `adjust`, or what it gave
    points          names to compare; all common ones without
    level           of the tests
    scale_by_variance_factor   multiply covariances by the variance factor of both epochs together; F tests

    Every common point is in the answer, with displacement, covariance and test; one that moved so far that it may be
    another point under the same name makes the verdict doubtful. A coordinate absent in either epoch is nan.

    Raises EstimationError where an epoch has no answer or the two have too little in common.
    """
    from catseye.estimation.deformation.comparison import ComparisonOptions
    from catseye.estimation.deformation.comparison import compare as moved_between
    from catseye.gateways.network.comparison import ComparedEpochs, comparison_verdict

    epochs = [
        each if isinstance(each, AdjustmentResult) else adjust(each, level=level, progress=progress)
        for each in (first, second)
    ]
    for epoch in epochs:
        require_answer(epoch)
    solutions = [epoch.findings.solution for epoch in epochs]
    chosen = ComparisonOptions(level=level, scale_by_variance_factor=scale_by_variance_factor)
    moved = moved_between(*solutions, points=points, options=chosen)
    compared = ComparedEpochs(epochs[0].findings, epochs[1].findings, moved)
    return ComparisonResult(
        comparison_verdict(compared),
        tuple(compared.deformation.names),
        compared.displacement,
        compared.covariance,
        compared.u,
        compared.deformation.p,
        tuple(compared.verdicts),
        compared,
        epochs[0],
        epochs[1],
    )


@dataclass(frozen=True, eq=False, repr=False)
class PlanResult(Result):
    """A network before it is measured: n points.

    names         of the points
    u             (n, 3) m, predicted standard uncertainties
    covariances   (n, 3, 3) m² predicted
    mean_u        m, root mean square over the points that matter
    planned       everything else: weak directions, worth of observations, candidates, schedule, scatter on paper
    path          that was read; None where a network was given
    """

    names: tuple[str, ...]
    u: np.ndarray
    covariances: np.ndarray
    mean_u: float
    planned: "PlanFindings"
    path: Path | None

    def passages(self) -> "Sequence[Passage]":
        """Worth, weak points, single points of failure, what to measure next."""
        from catseye.gateways.network.plan import plan_passages

        return plan_passages(self.planned)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye plan --json`."""
        from catseye.gateways.network.plan import plan_object

        return plan_object(self.planned)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a point; `candidates`: further ranges, the best first."""
        axes = self.planned.findings.network.axis_names
        points = {
            "point": (self.names, ""),
            **{f"u_{axis}": (self.u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate(axes)},
            "longest_axis": (self.planned.plan.weakest / MILLIMETRE, "mm"),
        }
        further = self.planned.plan.candidates
        columns = {
            "from": ([c.from_ for c in further], ""),
            "to": ([c.to for c in further], ""),
            "gain": ([1e6 * c.gain for c in further], "um"),
            "mean_u": ([1e3 * c.mean_u for c in further], "mm"),
        }
        return {"points": quantities(points), "candidates": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """Plan and elevation with the predicted ellipsoids."""
        from catseye.gateways.network.figures import network_figures

        drawn = network_figures(self.planned.findings)
        return {name: drawn[name].figure for name in ("plan", "elevation") if name in drawn}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye plan --out`."""
        from catseye.gateways.network.plan import write_plan

        write_plan(self.planned, directory, self.inputs(), progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the network's file or tables."""
        return _hashes(self.path)

    def sources(self) -> tuple[Path, ...]:
        """The network's file or folder."""
        return () if self.path is None else (self.path,)


@with_units
def plan(
    network: "str | os.PathLike[str] | ObservationNetwork",
    *,
    datum: str | None = None,
    interest: Sequence[str] | None = None,
    budget_s: Annotated[Any, In("s", one=True)] = None,
    shot_s: Annotated[Any, In("s", one=True)] = 5.0,
    most: Annotated[Any, In("", whole=True)] = 20,
    runs: Annotated[Any, In("", whole=True)] = 0,
    seed: Annotated[Any, In("", whole=True)] = 1,
    air_ppm: Annotated[Any, In("ppm", one=True)] = 0.0,
    station_ppm: Annotated[Any, In("ppm", one=True)] = 0.0,
    refraction: Annotated[Any, In("", one=True)] = 0.0,
    blunders_percent: Annotated[Any, In("percent", one=True)] = 0.0,
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
    progress: Progress | None = None,
) -> PlanResult:
    """A network before it is measured: what it will be worth, where it is weak, what to measure next.

    network    as for `adjust`; observed values are not used, and may be missing: an empty cell, no column `distance`,
               no value in TOML. What of a sigma grows with the distance follows the planned one
    datum      as for `adjust`
    interest   points that matter; all that are not held without
    budget_s   time of every ranger for further ranges, s: gives a schedule
    shot_s     time of one range, s
    most       further ranges to list
    runs       times to measure the network on paper, with the generator of `seed` and
    air_ppm, station_ppm   scale errors of all ranges together and of each station's (1 sigma)
    refraction             spread of the coefficient k of refraction (1 sigma)
    blunders_percent       share of gross errors, which are then searched for and left out
    sigma_mm, sigma_ppm    as for `adjust`
    progress   called with (what, done, of how many)

    Raises InputError for a file that cannot be used and EstimationError where the network floats.
    """
    from catseye.estimation.network.plan import plan as planned
    from catseye.estimation.network.plan import schedule
    from catseye.gateways.network.findings import findings
    from catseye.gateways.network.plan import PlanFindings, plan_verdict
    from catseye.reduction.network import monte_carlo_scatter

    read, path = _network_of(network, sigma_mm, sigma_ppm, planned=True)
    worth = planned(read, datum=datum, interest=interest, most=most)
    picked = () if budget_s is None else schedule(worth, budget_s=budget_s, shot_s=shot_s)
    scatter = None
    if runs:
        scatter = monte_carlo_scatter(
            worth.solution.network,
            runs=runs,
            seed=seed,
            air_ppm=air_ppm,
            station_ppm=station_ppm,
            refraction=refraction,
            blunders=blunders_percent / 100.0,
            progress=progress,
        )
    told = PlanFindings(findings(worth.solution), worth, picked, scatter)
    return PlanResult(
        plan_verdict(told), told.findings.names, told.findings.u, told.findings.covariance, worth.mean_u, told, path
    )


@dataclass(frozen=True, eq=False, repr=False)
class PositionsResult(Result):
    """Positions of m targets, each from its own ranges to known stations.

    x             (m, 3) m; nan where there is none
    covariance    (m, 3, 3) m², of stations without uncertainty; nan likewise
    status        (m,) text: "found", or what is wrong and what to do
    found         (m,) bool
    pvv           (m,) sum of squared residuals in sigmas; nan where none was tried
    ranges        (m,) int, used for each
    """

    x: np.ndarray
    covariance: np.ndarray
    status: np.ndarray
    found: np.ndarray
    pvv: np.ndarray
    ranges: np.ndarray

    def passages(self) -> "Sequence[Passage]":
        """Number and quality of the positions, and the status of the first that failed."""
        from catseye.gateways.network.summary import quantity
        from catseye.gateways.writers.passage import Passage

        count, total = int(self.found.sum()), len(self.found)
        text = f"{count} of {total} targets found"
        if count:
            u = np.sqrt(np.einsum("nii->n", self.covariance[self.found]) / 3.0)
            usual, worst = quantity(float(np.median(u)), "m"), quantity(float(u.max()), "m")
            text += f"; a coordinate is usually known to {usual}, of the worst to {worst} (1σ, stations taken as exact)"
        first = np.flatnonzero(~self.found)
        rest = [Passage("The others", f"first target {first[0]}: {self.status[first[0]]}.")] if len(first) else []
        return [Passage("Positions", text + "."), *rest]

    def to_object(self) -> dict[str, Any]:
        """Arrays in the order of the targets."""
        names = ("x", "covariance", "status", "found", "pvv", "ranges")
        return {"verdict": self.verdict.to_object(), **{name: getattr(self, name) for name in names}}

    def tables(self) -> "dict[str, QTable]":
        """`positions`: a row a target."""
        u = np.sqrt(np.einsum("nii->ni", self.covariance))
        columns = {
            **{axis: (self.x[:, k], "m") for k, axis in enumerate("xyz")},
            **{f"u_{axis}": (u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate("xyz")},
            "covariance": (self.covariance / MILLIMETRE**2, "mm2"),
            "ranges": (self.ranges, ""),
            "status": (self.status, ""),
        }
        return {"positions": quantities(columns)}


@with_units
def locate(
    stations: Annotated[Any, In("m")],
    ranges: Annotated[Any, In("m")],
    sigma: Annotated[Any, In("m")],
    *,
    near: Annotated[Any, In("m")] = None,
) -> PositionsResult:
    """Positions of many targets, each by least squares from its ranges to known stations.

    stations   (n, 3) m, known: for stations with an uncertainty, and for what they have in common, `adjust` a network
    ranges     (m, n) m, nan where missing; (n,) is one target
    sigma      m, standard uncertainties of the ranges, independent: a number, (n,) or (m, n)
    near       (3,) or (m, 3) m: a point on the target's side of the stations' plane, where two mirror images fit alike

    Raises InputError for shapes that do not join and for stations that are not finite.
    Source: `catseye.estimation.network.positions.dispatch`.

    >>> stations = [[0.0, 0, 0], [50, 0, 1], [0, 50, 2], [50, 50, 9]]
    >>> there = locate(stations, np.linalg.norm(np.array([20.0, 10, 30]) - stations, axis=1), 1e-4)
    >>> np.round(there.x, 6).tolist(), there.verdict.word
    ([[20.0, 10.0, 30.0]], 'good')
    """
    from catseye.estimation.network.positions.dispatch import positions
    from catseye.estimation.network.positions.status import PositionStatus

    s = np.asarray(stations, dtype=float)
    d = np.atleast_2d(np.asarray(ranges, dtype=float))
    u = np.asarray(sigma, dtype=float)
    placed = positions(s, d, np.full(d.shape[1], float(u)) if u.ndim == 0 else u, near=near)
    found = placed.status == PositionStatus.FOUND
    words = np.array([placed.text(k) if not good else "found" for k, good in enumerate(found)])
    return PositionsResult(
        _positions_verdict(placed, found, words), placed.x, placed.covariance, words, found, placed.pvv, placed.ranges
    )


def _positions_verdict(placed: "Positions", found: np.ndarray, words: np.ndarray) -> Any:
    """Good where all were found and something checks them."""
    from catseye.gateways.writers.verdict import Verdict

    lost = np.flatnonzero(~found)
    if not found.any():
        return Verdict("failed", f"no target was found; target 0: {words[0]}" if len(words) else "there is no target")
    if len(lost):
        return Verdict(
            "doubtful", f"{len(lost)} of {len(found)} targets were not found; target {lost[0]}: {words[lost[0]]}"
        )
    if not (placed.degrees_of_freedom > 0).all():
        return Verdict("doubtful", "some targets have three ranges only, which nothing checks")
    return Verdict("good", "every target was found, and its ranges agree with each other")


def require_answer(result: AdjustmentResult) -> AdjustmentResult:
    """The adjustment itself, or EstimationError where it has no answer."""
    if not result.findings.answered:
        raise EstimationError(f"{result.path or result.findings.network.source or 'the network'}: {result.status}")
    return result


def _network_of(
    network: "str | os.PathLike[str] | ObservationNetwork",
    sigma_mm: float | None,
    sigma_ppm: float | None,
    *,
    planned: bool = False,
) -> "tuple[ObservationNetwork, Path | None]":
    """The network itself and the path it was read from."""
    from catseye.estimation.network.model import ObservationNetwork
    from catseye.records.network.any_file import read_network

    if isinstance(network, ObservationNetwork):
        return network, None
    path = place_of(network)
    if not path.exists():
        raise InputError(f"{path}: missing (expected {NETWORKS})")
    return read_network(path, sigma_mm=sigma_mm, sigma_ppm=sigma_ppm, planned=planned), path


def _hashes(path: Path | None) -> dict[str, str]:
    from catseye.gateways.network.files import input_hashes

    return {} if path is None else input_hashes(path)
