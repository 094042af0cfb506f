"""Network adjustment: start values, datum, solution, and a diagnosis in one line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import (
    COMPLETE,
    GroupFit,
    LeastSquaresSolution,
    SolverSettings,
    adjust,
)
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.least_squares.rows import ActiveRows, variances
from catseye.estimation.least_squares.status import ADVICE, CONVERGED, AdjustmentOutcome, Status
from catseye.estimation.network.datum import (
    Floating,
    datum_conditions,
    floating_motions,
    minimal_coordinates,
    motion_limit,
    to_datum,
    transformed,
    with_datum,
    with_reference,
)
from catseye.estimation.network.diagnosis import contradicted, diagnosed, floating_status, unconnected
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork
from catseye.estimation.observations.kinds import Linear, ObservationGroup

FEWEST_POINTS = 200  # above which exchanged points are tried only with the ranging engine
ROUNDS = 8  # cap: solve with minimal constraints, transform to the datum
TRIAL_ITERATIONS = 15  # cap of a trial without tests: a good correction converges soon
REACHED = 0.9  # of the variance factor: above it another start was no improvement

NO_DATUM = "the network floats ({motions}) without a datum; hold coordinates, mark datum points, \
or adjust it free (--datum free)"
WEAK_DATUM = "the datum's coordinates do not hold the network against {motions}; mark more of them"
NOT_SETTLED = "the network did not settle in its datum after {rounds} passes"
NOT_PLACED = "{points}; give some, or observe more"


@dataclass(frozen=True)
class NetworkSettings:
    """Settings of `adjust_network`.

    solver     of every solution; its choice of sparse or dense follows the engine
    diagnose   False: status "converged" or "not converged" only, without the cause
    """

    solver: SolverSettings = COMPLETE
    diagnose: bool = True


DIAGNOSED = NetworkSettings()


def adjust_network(
    network: ObservationNetwork,
    *,
    datum: str | None = None,
    active: Sequence[np.ndarray] | None = None,
    inflation: Sequence[np.ndarray] | None = None,
    alone: bool = False,
    start: NetworkSolution | None = None,
    settings: NetworkSettings = DIAGNOSED,
    engine: str | None = None,
) -> NetworkSolution:
    """Coordinates of a network with covariance, and a fit of every observation.

    network     points, parameters, observations
    datum       None as marked, or "free" or "fixed", see `with_datum`
    active      one (m,) bool a group: False leaves an observation out, but still predicts it
    inflation   one (m,) a group, a factor on its standard uncertainties (robust estimation); infinite leaves out
    alone       True: inflation of a correlated observation is added to its variance only, which reduces its
                correlations; False: they stay, as when a complete group is scaled
    start       an earlier solution of the same network, as start values
    settings    limit of steps, tests and diagnosis or not
    engine      "dense", "sparse" or "ranging" (pure ranging networks only); None: the fastest suitable one

    The status of the solution describes any failure and its place.

    Source: [FOERSTNER16] chapter 4; datum by S-transformation, [BAARDA73].
    """
    network = with_reference(with_datum(network, datum))
    if inflation is not None:
        finite = [np.isfinite(f) for f in inflation]
        active = finite if active is None else [a & k for a, k in zip(active, finite, strict=True)]
    diagnose = settings.solver.tests and settings.diagnose
    if engine in (None, "ranging"):
        from catseye.estimation.network.ranging_engine import adjusted_as_ranges

        solution = adjusted_as_ranges(
            network,
            active=active,
            inflation=inflation,
            start=start,
            solver=settings.solver,
            forced=engine is not None,
        )
        if solution is not None:
            return (
                replace(solution, status=diagnosed(solution, _trial if inflation is None else None))
                if diagnose
                else solution
            )
    problem = _Problem.of(network, start)
    if problem.missing:
        return problem.unanswered(
            Status(AdjustmentOutcome.NOT_PLACED, NOT_PLACED.format(points=_listed(problem.missing)))
        )
    sparse = None if engine is None else engine == "sparse"
    solver = replace(settings.solver, sparse=sparse)
    solution = problem.solve(active, (inflation, alone), solver)
    if diagnose and solution.answered:
        if start is None and contradicted(solution):
            solution = _from_observations(solution, active, (inflation, alone), solver)
        return replace(solution, status=diagnosed(solution, _trial if inflation is None else None))
    return solution


class FixedParts(NamedTuple):
    """Parts of a network near its solution that do not depend on the observed values.

    x            (n,) parameters of the solution
    free         (n,) bool: those that move
    groups       of the network, then one of priors if there are any
    conditions   (d, n) of the datum, see `datum_conditions`
    reference    (n,) of the conditions; nan where no coordinate is given, and for other parameters
    """

    x: np.ndarray
    free: np.ndarray
    groups: list[ObservationGroup]
    conditions: np.ndarray
    reference: np.ndarray


def fixed_parts(solution: NetworkSolution) -> FixedParts:
    """Parameters, groups and datum of a solved network."""
    points = solution.network.points
    problem = _Problem.of(solution.network, solution)
    n = points.xyz.size
    floating = problem._motions([ActiveRows.of(group, None) for group in problem.groups], problem.x0)
    datum = points.datum & problem.free[:n].reshape(-1, 3) & np.isfinite(points.xyz)
    conditions, _ = datum_conditions(floating, datum, points.xyz)
    reference = np.concatenate([points.xyz.ravel(), np.full(len(problem.x0) - n, np.nan)])
    return FixedParts(problem.x0, problem.free, problem.groups, conditions, reference)


def fits_near(
    network: ObservationNetwork, near: NetworkSolution, solver: SolverSettings = COMPLETE
) -> Callable[[Sequence[np.ndarray]], tuple[GroupFit, ...] | None]:
    """Function that refits a network near a solution with inflated sigmas, quickly.

    network   with its datum marked
    near      its solution, as start values
    solver    settings of each refit

    The function takes an inflation as `adjust_network` with `alone`, and returns one fit per group, or None without a
    solution. A minimal set of coordinates is fixed instead of the datum's conditions: that changes no residual and no
    test, and saves the search for the datum.
    """
    problem = _Problem.of(network, near)
    rows = [ActiveRows.of(group, None) for group in problem.groups]
    floating = problem._motions(rows, problem.x0)
    n = 3 * len(network.points.names)
    everywhere = problem.free[:n].reshape(-1, 3)
    conditions, _ = datum_conditions(floating, everywhere, problem.x0[:n].reshape(-1, 3))
    free = problem.free.copy()
    free[minimal_coordinates(conditions)] = False

    def solve(inflation: Sequence[np.ndarray]) -> tuple[GroupFit, ...] | None:
        _, added = problem._inflated(inflation, True)
        active = _padded([np.isfinite(f) for f in inflation], problem.groups, True)
        solution = adjust(problem.x0, problem.groups, free=free, active=active, extra_variance=added, solver=solver)
        return solution.fits[: len(network.groups)] if solution.status == CONVERGED else None

    return solve


def _from_observations(
    solution: NetworkSolution,
    active: Sequence[np.ndarray] | None,
    inflation: tuple[Sequence[np.ndarray] | None, bool],
    solver: SolverSettings,
) -> NetworkSolution:
    """Better of a solution and one started from the observations instead of the given coordinates.

    A poor start may end in another minimum, or in none. Fixed and datum coordinates stay as given.
    """
    points = solution.network.points
    replaceable = points.free & ~points.datum & np.isfinite(points.xyz)
    if not replaceable.any():
        return solution
    network = replace(solution.network, points=replace(points, xyz=np.where(replaceable, np.nan, points.xyz)))
    problem = _Problem.of(network, None)
    trial = problem if problem.missing else problem.solve(active, inflation, solver)
    if isinstance(trial, _Problem) or trial.status != CONVERGED or not trial.answered:
        return solution
    if solution.status == CONVERGED and trial.variance_factor > REACHED * solution.variance_factor:
        return solution
    moved = tuple(points.names[i] for i in np.flatnonzero(replaceable.any(axis=1)))
    return replace(trial, network=solution.network, approximate=solution.approximate, replaced=moved)


def _trial(network: ObservationNetwork, inflation: Sequence[np.ndarray] | None) -> NetworkSolution:
    """Trial adjustment of a copy: coordinates and variance factor, tests only with inflation."""
    large = len(network.points.names) >= FEWEST_POINTS
    weighed = inflation is not None
    solver = SolverSettings(tests=weighed) if weighed else SolverSettings(iterations=TRIAL_ITERATIONS, tests=False)
    settings = NetworkSettings(solver, diagnose=False)
    try:
        return adjust_network(
            network,
            inflation=inflation,
            alone=weighed,
            settings=settings,
            engine="ranging" if large and not weighed else None,
        )
    except EstimationError:  # large, and not a ranging network: a trial would take too long
        if weighed:
            raise
        return replace(
            _Problem.of(network, None).unanswered(Status(AdjustmentOutcome.NOT_TRIED)), variance_factor=np.inf
        )


def _listed(reasons: dict[str, str], most: int = 4) -> str:
    text = ", ".join(f"{name} ({why})" for name, why in list(reasons.items())[:most])
    return text + (f" and {len(reasons) - most} more" if len(reasons) > most else "")


@dataclass(frozen=True, eq=False)
class _Problem:
    """Network as one parameter vector."""

    network: ObservationNetwork
    x0: np.ndarray
    free: np.ndarray
    groups: list[ObservationGroup]
    found: tuple[str, ...]
    missing: dict[str, str]
    assumed: tuple[str, ...]
    replaced: tuple[str, ...]

    @classmethod
    def of(cls, network: ObservationNetwork, start: NetworkSolution | None) -> "_Problem":
        points, parameters = network.points, network.parameters
        values = np.array([p.start for p in parameters])
        found: tuple[str, ...] = ()
        missing: dict[str, str] = {}
        assumed: tuple[str, ...] = ()
        replaced: tuple[str, ...] = ()
        if start is not None:
            xyz, values = np.where(points.fixed, points.xyz, start.x), start.parameters
            found, assumed, replaced = start.approximate, start.assumed, start.replaced
        else:
            from catseye.estimation.network.approximate.start import approximate

            start_values = approximate(network)
            xyz, values, found = start_values.xyz, start_values.parameters, start_values.found
            missing, assumed, replaced = start_values.missing, start_values.assumed, start_values.replaced
        sigma = np.array([p.sigma for p in parameters])
        offset = 3 * len(points.names)
        with_prior = np.flatnonzero((sigma > 0.0) & np.isfinite(sigma))
        groups = list(network.groups)
        if len(with_prior):
            observed = np.array([parameters[k].start for k in with_prior])
            groups.append(
                Linear("priors", observed, sigma[with_prior] ** 2, offset + with_prior, np.eye(len(with_prior)))
            )
        free = np.concatenate([points.free.ravel(), sigma > 0.0])
        xyz = np.where(points.absent, 0.0, xyz)  # any value: no observation depends on it
        return cls(
            network=network,
            x0=np.concatenate([xyz.ravel(), values]),
            free=free,
            groups=groups,
            found=found,
            missing=missing,
            assumed=assumed,
            replaced=replaced,
        )

    @property
    def names(self) -> list[str]:
        """Names of all parameters."""
        axes = self.network.axis_names
        return [f"{axis} of {p}" for p in self.network.points.names for axis in axes] + [
            p.name for p in self.network.parameters
        ]

    def solve(
        self,
        active: Sequence[np.ndarray] | None,
        inflation: tuple[Sequence[np.ndarray] | None, bool],
        solver: SolverSettings,
    ) -> NetworkSolution:
        """Solution in its datum, in as many passes as needed."""
        points = self.network.points
        n = 3 * len(points.names)
        chosen = _padded(active, self.groups, True)
        larger, added = self._inflated(*inflation)
        rows = [ActiveRows.of(g, None if chosen is None else chosen[i]) for i, g in enumerate(self.groups)]
        x, iterations = self.x0, 0
        datum = points.datum & self.free[:n].reshape(-1, 3) & np.isfinite(points.xyz)
        solution: LeastSquaresSolution | None = None
        settled = False
        for _ in range(ROUNDS):
            floating = self._motions(rows, x)
            conditions, loose = datum_conditions(floating, datum, points.xyz)
            if loose.shape[1]:
                text = WEAK_DATUM if datum.any() else NO_DATUM
                status = unconnected(self.network, self._afloat(rows, x))
                return self.unanswered(
                    status or Status(AdjustmentOutcome.RANK_DEFICIENT, text.format(motions=floating.words(loose))), x
                )
            free_columns = self.free.copy()
            free_columns[minimal_coordinates(conditions)] = False
            solution = adjust(
                x,
                self.groups,
                free=free_columns,
                active=chosen,
                inflation=larger,
                extra_variance=added,
                names=self.names,
                solver=solver,
            )
            iterations += solution.iterations
            x = solution.x
            settled = not len(conditions)
            if not solution.solved or settled:
                break
            floating = self._floating(rows, x)
            if floating.motions.shape[1] != len(conditions):  # wrong from a poor start: repeat from here
                continue
            conditions, _ = datum_conditions(floating, datum, points.xyz)
            moved, t = to_datum(x, points.xyz.ravel(), floating.motions, conditions=conditions)
            x = x + moved
            u = np.sqrt(np.maximum(solution.q.diagonal()[:n][free_columns[:n]], 0.0)) if solver.tests else np.zeros(0)
            settled = bool(np.abs(moved[:n]).max() <= motion_limit(x[:n].reshape(-1, 3), points.existing, u))
            if settled and solver.tests:
                solution = replace(solution, q=transformed(solution.q, t, conditions))
            if settled:
                break
        assert solution is not None
        solution = replace(solution, x=x, iterations=iterations)
        if not settled and solution.status == CONVERGED:
            solution = replace(
                solution, status=Status(AdjustmentOutcome.NOT_CONVERGED, NOT_SETTLED.format(rounds=ROUNDS), ADVICE)
            )
        if len(solution.floating):
            status = unconnected(self.network, self._afloat(rows, x)) or floating_status(self.network, solution)
            return self.unanswered(status, solution.x)
        # sum of redundancy numbers, without rounding
        degrees = sum(int(r.active.sum()) for r in rows) - int(free_columns.sum())
        factor = sum(f.pvv for f in solution.fits) / degrees if degrees else float("nan")
        answer = self.answer(solution, solution.q, self._datum_words(floating, datum))
        return replace(answer, degrees_of_freedom=float(degrees), variance_factor=factor)

    def _floating(self, rows: list[ActiveRows], x: np.ndarray) -> Floating:
        absent = self.network.points.absent
        return floating_motions(rows, x, x[: absent.size].reshape(-1, 3), free=self.free, absent=absent)

    def _afloat(self, rows: list[ActiveRows], x: np.ndarray) -> Callable[[np.ndarray], bool]:
        """Predicate: True if given points (n,) bool can move together, the others ignored."""

        def afloat(piece: np.ndarray) -> bool:
            absent = self.network.points.absent | ~piece[:, None]
            xyz = x[: absent.size].reshape(-1, 3)
            try:
                return floating_motions(rows, x, xyz, free=self.free, absent=absent).motions.shape[1] > 0
            except np.linalg.LinAlgError:  # start too poor to decide
                return True

        return afloat

    def _motions(self, rows: list[ActiveRows], x: np.ndarray) -> Floating:
        """Floating motions at x.

        None if the start is too poor to determine them.
        """
        try:
            return self._floating(rows, x)
        except np.linalg.LinAlgError:
            return Floating(np.zeros((len(x), 0)), np.zeros((7, 0)), np.zeros(3), 1.0)

    def _inflated(
        self, inflation: Sequence[np.ndarray] | None, alone: bool
    ) -> tuple[list[np.ndarray] | None, list[np.ndarray] | None]:
        """Factors on standard uncertainties per group.

        With `alone`, variances to add instead.
        """
        factors = _padded(inflation, self.groups, 1.0)
        if factors is None or not alone:
            return factors, None
        finite = [np.where(np.isfinite(f), f, 1.0) for f in factors]
        return None, [variances(g) * (f**2 - 1.0) for g, f in zip(self.groups, finite, strict=True)]

    def _datum_words(self, floating: Floating, datum: np.ndarray) -> str:
        points = self.network.points
        fixed_count = int(np.sum(points.fixed))
        words = [f"{fixed_count} coordinates held"] if fixed_count else []
        if floating.motions.shape[1]:
            on = int(datum.any(axis=1).sum())
            words.append(f"inner constraints on {on} points against {floating.words()}")
        return "; ".join(words) or "held by observations and priors"

    def answer(self, solution: LeastSquaresSolution, q: Covariance, datum: str) -> NetworkSolution:
        absent = self.network.points.absent
        count = len(absent)
        fits = solution.fits[: len(self.network.groups)]
        factor, degrees = solution.variance_factor()
        covariance = q.blocks(3 * np.arange(count)) if count else np.zeros((0, 3, 3))
        return NetworkSolution(
            network=self.network,
            x=np.where(absent, np.nan, solution.x[: 3 * count].reshape(-1, 3)),
            covariance=np.where(absent[:, :, None] | absent[:, None, :], np.nan, covariance),
            parameters=solution.x[3 * count :],
            u_parameters=np.sqrt(np.maximum(q.diagonal()[3 * count :], 0.0)),
            status=solution.status,
            iterations=solution.iterations,
            fits=fits,
            variance_factor=factor,
            degrees_of_freedom=degrees,
            datum=datum,
            approximate=self.found,
            assumed=self.assumed,
            replaced=self.replaced,
            q=q,
        )

    def unanswered(self, status: Status, x: np.ndarray | None = None) -> NetworkSolution:
        """Solution without an answer: start or last values, residuals, no covariance."""
        at = self.x0 if x is None else x
        all_fixed = np.zeros(len(at), dtype=bool)
        solution = adjust(at, self.groups, free=all_fixed, solver=SolverSettings(tests=False, iterations=1))
        count = len(self.network.points.names)
        answer = self.answer(replace(solution, status=status), solution.q, "none")
        return replace(
            answer,
            covariance=np.full((count, 3, 3), np.nan),
            u_parameters=np.full(len(answer.u_parameters), np.nan),
            variance_factor=float("nan"),
            degrees_of_freedom=float("nan"),
        )


def _padded(
    arrays: Sequence[np.ndarray] | None, groups: Sequence[ObservationGroup], constant: float
) -> list[np.ndarray] | None:
    """One array per group: the given ones, then a constant for the priors' group."""
    if arrays is None:
        return None
    return [*arrays, *(np.full(len(g.observed), constant) for g in groups[len(arrays) :])]
