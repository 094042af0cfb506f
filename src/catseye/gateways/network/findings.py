"""Findings on an adjusted network, shared by all outputs, in the axes of its own file."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY
from catseye.estimation.network.external import effects_at_ends
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, label, points_of
from catseye.estimation.quality.ellipsoid import Ellipsoid, ellipsoid, relative_covariance
from catseye.estimation.quality.reliability import (
    GlobalTest,
    bias_to_noise,
    checked,
    global_test,
    observation_tests,
    single_level,
    tau_critical,
    w_critical,
)

ROLES = ("from", "to", "third", "fourth")
STATIONED = ("distance", "direction", "angle", "azimuth")  # words in the names of kinds measured from a station
MEASURES = (
    "observed",
    "u",
    "residual",
    "standardised",
    "redundancy",
    "mdb",
    "estimated_error",
    "bias_to_noise",
    "effect",
)
NUMBER = re.compile(r"\d+")
COMPONENTS = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class ObservationTable:
    """All m observations of a network in file order, as columns; lengths in m, angles in rad.

    kinds             names of kinds, indexed by `kind`
    kind              (m,) int
    unit              (m,) "m", "rad" or "1"
    component         (m,) axis of the file, for one coordinate of a point or vector; else ""
    sign              (m,) -1 where the file's axis is opposite to this package's
    ends              (m, 4) rows of the points by role, from, to, third, fourth; -1 for none
    group, row        (m,) int: position in the network's groups
    active            (m,) bool: used in the adjustment
    checked           (m,) bool: an error in it would show by other observations
    bias_to_noise     (m,) largest effect of an error just not detectable on any result, in its standard uncertainties;
                      nan where unknown, as within correlated groups
    effect            (m,) m, largest movement of a named point by an error of the size of mdb, or nan
    observed, residual, u, redundancy, standardised, mdb, estimated_error   (m,) as in `GroupFit`; mdb is its
                      detectable_error; the last three are nan for unchecked observations, and all four without
                      an answer
    """

    kinds: tuple[str, ...]
    kind: np.ndarray
    unit: np.ndarray
    component: np.ndarray
    sign: np.ndarray
    ends: np.ndarray
    group: np.ndarray
    row: np.ndarray
    active: np.ndarray
    checked: np.ndarray
    observed: np.ndarray
    residual: np.ndarray
    u: np.ndarray
    redundancy: np.ndarray
    standardised: np.ndarray
    mdb: np.ndarray
    estimated_error: np.ndarray
    bias_to_noise: np.ndarray
    effect: np.ndarray

    def __len__(self) -> int:
        return len(self.kind)

    @cached_property
    def worst_first(self) -> np.ndarray:
        """Rows by falling |standardised|, (m,), untested ones last; by |residual| / u if none has a test."""
        size = np.abs(self.standardised)
        if not np.isfinite(size).any():
            size = np.abs(self.residual) / self.u
        return np.argsort(-np.nan_to_num(size, nan=-1.0), kind="stable")


def observation_table(solution: NetworkSolution) -> ObservationTable:
    """Observations of a solution, in file order where known, else group by group.

    solution   an adjusted network

    The sign of components along an axis opposite in the file is reversed, with all derived values.
    """
    network = solution.network
    kinds: dict[str, int] = {}
    effects = effects_at_ends(solution)
    parts = [_part(solution, g, kinds, effects[g]) for g in range(len(network.groups))]
    order = _file_order(network)
    joined = {
        name: np.concatenate([part[name] for part in parts])[order] if parts else np.zeros(0) for name in _COLUMNS
    }
    if not parts:
        joined |= {"ends": np.zeros((0, len(ROLES)), dtype=int), "component": np.zeros(0, dtype="U1")}
    return ObservationTable(kinds=tuple(kinds), **joined)


_COLUMNS = tuple(ObservationTable.__dataclass_fields__)[1:]


def _part(solution: NetworkSolution, g: int, kinds: dict[str, int], effect: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of one group, given the effects of undetected errors; its kinds are added to `kinds`."""
    group, fit = solution.network.groups[g], solution.fits[g]
    m = len(fit.residual)
    group_kind = getattr(group, "kind", "") if "kinds" not in type(group).__dict__ else ""  # else a kind per row
    names, at = (
        (np.array([group_kind]), np.zeros(m, dtype=int))
        if group_kind
        else np.unique(_row_texts(group, "kinds"), return_inverse=True)
    )
    code = np.array([kinds.setdefault(str(name), len(kinds)) for name in names], dtype=int)
    ends = np.full((m, len(ROLES)), -1)
    for role, end in enumerate(points_of(group)[: len(ROLES)]):
        ends[:, role] = end
    component, sign = _components(solution.network, getattr(group, "component", np.full(m, "")))
    computed = fit.detectable_error > 0.0  # zero without statistics
    tested_rows = fit.active & computed & checked(fit)
    independent = group.covariance.ndim == 1
    tested = np.where(tested_rows | (computed & ~fit.active), sign, np.nan)
    return {
        "kind": code[at],
        "unit": np.asarray(getattr(group, "units", np.full(m, getattr(group, "unit", "") or "1"))),
        "component": component,
        "sign": sign,
        "ends": ends,
        "group": np.full(m, g),
        "row": np.arange(m),
        "active": fit.active,
        "checked": tested_rows,
        "observed": sign * group.observed,
        "residual": sign * fit.residual,
        "u": fit.sigma,
        "redundancy": np.where(computed, fit.redundancy, np.nan),
        "standardised": tested * fit.standardised,
        "mdb": np.abs(tested) * fit.detectable_error,
        "estimated_error": tested * fit.estimated_error,
        "bias_to_noise": np.where(tested_rows & independent, bias_to_noise(fit.redundancy, NONCENTRALITY), np.nan),
        "effect": np.where(tested_rows, effect, np.nan),
    }


def _row_texts(group: object, name: str) -> np.ndarray:
    """Texts of a group's rows, (m,); the group's name for foreign kinds."""
    texts = getattr(group, name, None)
    return np.asarray(texts) if texts is not None else np.full(len(group.observed), group.name)  # type: ignore[attr-defined]


def _components(network: ObservationNetwork, component: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Components in the file's names, and their signs."""
    called, sign = component.astype("U8"), np.ones(len(component))
    for k, name in enumerate(COMPONENTS):
        mine = component == name
        if mine.any():
            j = int(np.argmax(np.abs(network.axes[k])))
            called[mine], sign[mine] = network.axis_names[j], network.axes[k, j]
    return called, sign


def in_file_axes(network: ObservationNetwork, x: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates or displacements (n, 3) and covariances (n, 3, 3) in the axes of the network's file.

    By exchange and sign, not by a product: an unknown coordinate does not affect the others.
    """
    at = np.argmax(np.abs(network.axes), axis=0)
    sign = network.axes[at, np.arange(3)]
    return sign * x[:, at], np.outer(sign, sign) * covariance[:, at[:, None], at]


def _file_order(network: ObservationNetwork) -> np.ndarray:
    """Rows of all groups in file order; unchanged if a group has no places in the file."""
    total = sum(len(g.observed) for g in network.groups)
    if len(network.groups) < 2 or len(network.places) != len(network.groups) or not all(network.places):
        return np.arange(total)
    rank: dict[str, int] = {}
    keys = []
    for place in (place for places in network.places for place in places):
        words = NUMBER.sub("", place)
        keys.append((rank.setdefault(words, len(rank)), *map(int, NUMBER.findall(place))))
    return np.array([i for i, _ in sorted(enumerate(keys), key=itemgetter(1))], dtype=int)


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
class Findings:
    """Findings on a solution, in the axes of its file.

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

    @property
    def network(self) -> ObservationNetwork:
        return self.solution.network

    @property
    def names(self) -> tuple[str, ...]:
        return self.network.points.names

    @property
    def answered(self) -> bool:
        """True if there are coordinates, valid within their covariance."""
        return self.solution.status.usable

    @cached_property
    def u(self) -> np.ndarray:
        """Standard uncertainties of the coordinates, (n, 3) m."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

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


def findings(
    solution: NetworkSolution,
    *,
    scaled: bool = False,
    level: float = 0.05,
    pairs: Sequence[tuple[str, str]] = (),
) -> Findings:
    """Findings on a solution.

    solution   an adjusted network, with an answer or without
    scaled     multiply covariances by the variance factor, and test observations against it (tau tests)
    level      of the chi-square test, and of all tests of single observations together
    pairs      pairs of points, by name, for relative ellipsoids

    Raises EstimationError for a name that is not in the network, and if `scaled` without redundancy.
    """
    factor = solution.variance_factor if scaled else 1.0
    if scaled and not np.isfinite(factor) and np.isfinite(solution.covariance).any():
        raise EstimationError(
            f"the variance factor is unknown ({solution.degrees_of_freedom:g} degrees of freedom); "
            "do not scale the claimed uncertainties"
        )
    x, covariance = in_file_axes(solution.network, solution.x, solution.covariance * factor)
    table = observation_table(solution)
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
    return Findings(
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
    return Relative(*pair, distance, u, covariance, ellipsoid(covariance))
