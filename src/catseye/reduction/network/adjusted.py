"""Adjusted network: coordinates, tests of its observations and verdict, in the axes of its own file.

Source: [PARKER04] sections 3.1.2, 3.2.1 and 3.2.3 (stations and targets from ranges alone).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.aliases import Progress
from catseye.errors import EstimationError
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, label
from catseye.estimation.quality.ellipsoid import (
    Ellipse,
    Ellipsoid,
    confidence_scale,
    contained_probability,
    ellipsoid,
    horizontal_ellipse,
    point_uncertainty,
    relative_covariance,
)
from catseye.estimation.quality.reliability import (
    TOO_LARGE,
    TOO_SMALL,
    GlobalTest,
    global_test,
    observation_tests,
    single_level,
    tau_critical,
    too_good,
    w_critical,
)
from catseye.reduction.network.observations import (
    USUAL,
    Detectability,
    ObservationTable,
    in_file_axes,
    observation_table,
)
from catseye.reduction.network.treatment import AdjustmentOptions, Treatment, treated
from catseye.reduction.network.words import NAMED, listed, quantity
from catseye.verdict import Verdict

CONFIDENCE = 0.95  # probability of the region beside the standard one
UNIT = 300.0  # times too large: above the geometric mean of 100 and 1000, mm for m is the likely cause
STATIONED = ("distance", "direction", "angle", "azimuth")  # words in the names of kinds measured from a station


@dataclass(frozen=True, eq=False)
class Relative:
    """Relative position of two points and its uncertainty, in the axes of the file.

    first, second   names
    distance        m
    u_distance      m, its standard uncertainty
    covariance      (3, 3) m^2 of the vector from the first to the second
    ellipsoid       its standard ellipsoid
    """

    first: str
    second: str
    distance: float
    u_distance: float
    covariance: np.ndarray
    ellipsoid: Ellipsoid


@dataclass(frozen=True, eq=False)
class AdjustedNetwork:
    """Network adjusted and tested, in the axes of its file.

    solution      adjusted network
    x             (n, 3) m; nan where a coordinate is absent
    covariance    (n, 3, 3) m^2, times the variance factor where `scaled`; nan in rows and columns of absent coordinates
    factor        applied to the covariances and squared uncertainties; 1 unless `scaled`
    scaled        True if the variance factor was applied
    ellipsoid     standard ellipsoids of the points
    table         observations
    test          test of single observations: "w" with the claimed sigmas, "tau" where `scaled`
    statistic, p  (m,) in the order of `table`, the p-value corrected for their number; nan without a test
    suspects      rows of `table` that the tests reject, worst first
    global_test   chi-square test of the variance factor against 1
    level         of `global_test`, and of all single tests together
    level_single  of a single test; nan if nothing is tested
    relative      between the requested pairs of points
    critical      |statistic| above which an observation is suspect; nan if nothing is tested
    treatment     of its observations; None where nothing treated them, as in a plan
    detectability   level and power of the table's minimal detectable biases
    """

    solution: NetworkSolution
    x: np.ndarray
    covariance: np.ndarray
    factor: float
    scaled: bool
    ellipsoid: Ellipsoid
    table: ObservationTable
    test: str
    statistic: np.ndarray
    p: np.ndarray
    suspects: np.ndarray
    global_test: GlobalTest
    level: float
    level_single: float
    critical: float
    relative: tuple[Relative, ...] = ()
    treatment: Treatment | None = None
    detectability: Detectability = USUAL

    @property
    def network(self) -> ObservationNetwork:
        return self.solution.network

    @property
    def names(self) -> tuple[str, ...]:
        return self.network.points.names

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the adjustment."""
        return _verdict(self)

    @cached_property
    def likely(self) -> np.ndarray:
        """Rows of `table` that data snooping would leave out, or did."""
        return np.flatnonzero(self.in_table(self.treatment.likely)) if self.treatment else np.zeros(0, dtype=int)

    @property
    def answered(self) -> bool:
        """True if there are coordinates, valid within their covariance."""
        return self.solution.status.usable

    @cached_property
    def u(self) -> np.ndarray:
        """Standard uncertainties of the coordinates, (n, 3) m."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    @cached_property
    def u_position(self) -> np.ndarray:
        """Helmert's point errors, (n,) m: root of the sum of the coordinates' variances."""
        return point_uncertainty(self.covariance)

    @cached_property
    def ellipse(self) -> Ellipse:
        """Standard ellipses (n,) of the points in plan, bearings clockwise from north."""
        return horizontal_ellipse(self.solution.covariance * self.factor)

    def coverage(self, dimensions: int) -> tuple[float, float]:
        """Probability that a standard ellipsoid (3) or ellipse (2) contains its point, and the factor for CONFIDENCE.

        nan where a variance factor without redundancy was applied.
        """
        degrees = self.solution.degrees_of_freedom if self.scaled else np.inf
        if not degrees > 0.0:
            return float("nan"), float("nan")
        factor = confidence_scale(CONFIDENCE, dimensions, degrees)
        return contained_probability(1.0, dimensions, degrees), factor

    @cached_property
    def coordinates(self) -> np.ndarray:
        """Mask (n, 3) of existing coordinates, in the axes of the file."""
        return np.asarray((self.network.points.absent @ np.abs(self.network.axes)) == 0.0)

    @cached_property
    def u_parameters(self) -> np.ndarray:
        """Standard uncertainties of the parameters, (p,), with the variance factor where `scaled`."""
        return self.solution.u_parameters * np.sqrt(self.factor)

    @cached_property
    def stations(self) -> np.ndarray:
        """Mask (n,) of points from which something was measured."""
        is_station = np.zeros(len(self.names), dtype=bool)
        table = self.table
        sighted = np.array([any(word in kind for word in STATIONED) for kind in table.kinds], dtype=bool)
        start = table.ends[:, 0] if len(table) else np.zeros(0, dtype=int)
        is_station[start[(start >= 0) & sighted[table.kind]]] = True
        return is_station

    @cached_property
    def observation_counts(self) -> np.ndarray:
        """Number of active observations of each point, (n,)."""
        count = np.zeros(len(self.names), dtype=int)
        for end in self.table.ends[self.table.active].T:
            count += np.bincount(end[end >= 0], minlength=len(count))
        return count

    @cached_property
    def _row_of(self) -> np.ndarray:
        """Row in the table of each observation, counted through the groups."""
        row = np.empty(len(self.table), dtype=int)
        row[self._start[self.table.group] + self.table.row] = np.arange(len(self.table))
        return row

    @cached_property
    def _start(self) -> np.ndarray:
        return np.cumsum([0, *(len(f.residual) for f in self.solution.fits)])

    def row_of(self, group: int, row: int) -> int:
        """Row in the table of a row of a group."""
        return int(self._row_of[self._start[group] + row])

    def in_table(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """Array (m,) in table order from one array per group."""
        return np.concatenate([[], *parts])[self._start[self.table.group] + self.table.row]

    def label(self, row: int) -> str:
        """Label of an observation: its kind, points and place in the file."""
        component = str(self.table.component[row])
        text = label(self.network, int(self.table.group[row]), int(self.table.row[row]))
        return f"{component} of {text}" if component else text

    def kind(self, row: int) -> str:
        return self.table.kinds[self.table.kind[row]]


def adjusted(
    network: ObservationNetwork,
    options: AdjustmentOptions | None = None,
    *,
    progress: Progress | None = None,
) -> AdjustedNetwork:
    """Network adjusted as its options say, with tests and verdict.

    network    from `records.network.any_file.read_network`
    options    treatment of the observations, tests and solver; None: every observation as claimed
    progress   called with (what, done, of how many)

    Raises EstimationError for an unknown method, for a name that is not in the network, and where a network without an
    answer is to be treated.
    """
    options = options or AdjustmentOptions()
    solution, treatment = treated(network, options, progress=progress)
    return adjusted_network(
        solution,
        scaled=options.scale_by_variance_factor,
        level=options.level,
        pairs=options.relative,
        treatment=treatment,
        detectability=options.detectability,
    )


def adjusted_network(
    solution: NetworkSolution,
    *,
    scaled: bool = False,
    level: float = 0.05,
    pairs: Sequence[tuple[str, str]] = (),
    treatment: Treatment | None = None,
    detectability: Detectability = USUAL,
) -> AdjustedNetwork:
    """Adjusted network with tests and verdict, from its solution.

    solution    with an answer or without
    scaled      multiply covariances by the variance factor, and test observations against it (tau tests)
    level       of the chi-square test, and of all tests of single observations together
    pairs       pairs of points, by name, for relative ellipsoids
    treatment   of the observations
    detectability   level and power of the minimal detectable biases

    Raises EstimationError for a name that is not in the network, and if `scaled` without redundancy.
    """
    factor = solution.variance_factor if scaled else 1.0
    if scaled and not np.isfinite(factor) and np.isfinite(solution.covariance).any():
        raise EstimationError(
            f"the variance factor is unknown ({solution.degrees_of_freedom:g} degrees of freedom); "
            "do not scale the claimed uncertainties"
        )
    x, covariance = in_file_axes(solution.network, solution.x, solution.covariance * factor)
    table = observation_table(solution, detectability)
    tau = scaled and solution.degrees_of_freedom > 1.0
    tests = observation_tests(solution.fits, level=level, known_sigma=not tau)
    offset = np.cumsum([0, *(len(f.residual) for f in solution.fits)])
    at = offset[table.group] + table.row
    p, statistic = (
        np.where(table.checked, np.concatenate([[], *parts])[at], np.nan) for parts in (tests.adjusted, tests.statistic)
    )
    suspects = np.flatnonzero(p < level)
    count = int(np.count_nonzero(table.checked))
    single = single_level(level, count) if count else np.nan
    limit = np.nan
    if count:
        limit = tau_critical(single, solution.degrees_of_freedom) if tau else w_critical(single)
    degrees = solution.degrees_of_freedom
    return AdjustedNetwork(
        solution=solution,
        x=x,
        covariance=covariance,
        factor=factor,
        scaled=scaled,
        ellipsoid=ellipsoid(covariance),
        table=table,
        test="tau" if tau else "w",
        statistic=statistic * table.sign,
        p=p,
        suspects=suspects[np.argsort(-np.abs(statistic[suspects]), kind="stable")],
        global_test=global_test(solution.variance_factor * degrees, degrees if np.isfinite(degrees) else 0.0, level),
        level=level,
        level_single=single,
        critical=limit,
        relative=tuple(_relative(solution, pair, factor) for pair in pairs),
        treatment=treatment,
        detectability=detectability,
    )


def _relative(solution: NetworkSolution, pair: tuple[str, str], factor: float) -> Relative:
    """Vector between two points in their common coordinates; nan without an answer."""
    strange = [name for name in pair if name not in solution.index]
    if strange:
        raise EstimationError(f"point {strange[0]!r} is not in the network (expected one of its names)")
    rows = [solution.index[name] for name in pair]
    vector, covariance = solution.x[rows[1]] - solution.x[rows[0]], np.full((3, 3), np.nan)
    if solution.answered:
        covariance = relative_covariance(solution.block(pair)) * factor
    (vector,), (covariance,) = in_file_axes(solution.network, vector[None], covariance[None])
    common = np.flatnonzero(np.isfinite(vector))
    distance = float(np.linalg.norm(vector[common]))
    unit = vector[common] / distance if distance > 0.0 else np.full(len(common), np.nan)
    u = float(np.sqrt(np.maximum(unit @ covariance[np.ix_(common, common)] @ unit, 0.0))) if len(common) else np.nan
    return Relative(
        first=pair[0],
        second=pair[1],
        distance=distance,
        u_distance=u,
        covariance=covariance,
        ellipsoid=ellipsoid(covariance),
    )


def _verdict(network: AdjustedNetwork) -> Verdict:
    """Verdict on the adjustment, with reasons."""
    status, overall = network.solution.status, network.global_test
    if not network.answered:
        return Verdict("failed", f"no answer: {status}")
    if status != CONVERGED or network.network.doubts:
        reasons = [*network.network.doubts[:NAMED], *([status] if status != CONVERGED else [])]
        return Verdict("doubtful", "; ".join(reasons))
    sides = network.solution.assumed if network.network.points.fixed.any() else ()
    if sides:  # the side of a free network is a convention
        text = f"the side on which these points lie is undetermined; a mirror image fits as well: {listed(sides)}"
        return Verdict("doubtful", f"{text}; give approximate coordinates, or measure a zenith angle or a height")
    if not np.isfinite(overall.p):
        return Verdict("doubtful", "unchecked: no redundancy, so no error would show")
    if overall.outcome == TOO_LARGE:
        more = 100.0 * (np.sqrt(overall.factor) - 1.0)
        text = f"the observations scatter {more:.0f} % more than their uncertainties claim"
        return Verdict("doubtful", f"{text}; {suspects_words(network) or 'no single observation stands out'}")
    if len(network.suspects):
        text = "the network agrees overall with the claimed uncertainties, single observations do not"
        return Verdict("doubtful", f"{text}; {suspects_words(network)}")
    if undecided := _undecided(network):
        return Verdict("doubtful", undecided)
    if too_good(overall.factor * network.solution.degrees_of_freedom, network.solution.degrees_of_freedom):
        return Verdict("doubtful", _too_good(network))
    if overall.outcome == TOO_SMALL:
        less = 100.0 * (1.0 - np.sqrt(overall.factor))
        text = f"better than claimed: the observations scatter {less:.0f} % less than their uncertainties claim"
    else:
        text = "the observations agree with each other as their uncertainties claim"
    unchecked, out = int(np.sum(network.table.active & ~network.table.checked)), int(np.sum(~network.table.active))
    text += f", {out} left out" if out else ""
    return Verdict("good", text + (f", but {unchecked} of them are not checked by others" if unchecked else ""))


def _undecided(network: AdjustedNetwork) -> str:
    """Contradicting observations on which points rest, in words; "" without.

    They have almost no weight, so that a variance factor near 0 says nothing of their uncertainties.
    """
    treatment, table = network.treatment, network.table
    if treatment is None:
        return ""
    rows = np.flatnonzero(network.in_table(treatment.undecided))
    if not (table.active & ~table.checked)[rows].any():
        return ""
    text = f"{len(rows)} of {len(table)} observations contradict each other, and which are wrong cannot be decided"
    if 2 * len(rows) > len(table):
        return f"{text}: look for an error that they share, such as a constant, a unit or the air"
    return f"{text}, first {network.label(int(rows[0]))}"


def _too_good(network: AdjustedNetwork) -> str:
    """Explanation of a variance factor too small for chance, with the factor of the sigmas."""
    factor = network.global_test.factor
    times = 1.0 / np.sqrt(factor) if factor > 0.0 else np.inf
    less = 100.0 * (1.0 - np.sqrt(factor))
    text = f"the observations scatter {less:.0f} % less than their uncertainties claim, too little for chance "
    text += f"(variance factor {factor:.3g}): the uncertainties are "
    text += f"about {times:.2g} times too large" if np.isfinite(times) else "not those of these observations"
    if times >= UNIT:
        return f"{text}; most likely their unit: sigmas in mm typed as m, or in the wrong column"
    return f"{text}; most likely their unit, or the claim of another instrument"


def suspects_words(network: AdjustedNetwork) -> str:
    """Number of suspects and the first, in words."""
    count = len(network.suspects)
    if not count:
        return ""
    noun = "observation is" if count == 1 else "observations are"
    return f"{count} {noun} suspect, first {observation_words(network, int(network.suspects[0]))}"


def observation_words(network: AdjustedNetwork, row: int) -> str:
    """Observation, residual and test in words.

    network   adjusted
    row       of its table
    """
    table, unit = network.table, str(network.table.unit[row])
    words = f"{network.label(row)}: residual {quantity(table.residual[row], unit)}"
    if np.isfinite(network.statistic[row]):
        words += f", {abs(network.statistic[row]):.2f} of its standard uncertainties"
        words += f", as if it were wrong by {quantity(table.estimated_error[row], unit)}"
    return words
