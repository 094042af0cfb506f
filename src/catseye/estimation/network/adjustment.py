"""A network adjusted: starts found, datum chosen, solved, and what went wrong said in one line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import (
    CONVERGED,
    GroupFit,
    LeastSquaresSolution,
    SolverSettings,
    adjust,
)
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.least_squares.rows import ActiveRows, variances
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
from catseye.estimation.network.diagnosis import contradicted, diagnosed, floating_text, unconnected
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork
from catseye.estimation.observations.kinds import Linear, ObservationGroup

FEWEST_POINTS = 200  # from which exchanged points are tried only where the ranging engine serves
PASSES = 8  # of solving with the fewest coordinates held and moving into the datum
REACHED = 0.9  # of the variance factor, from which another start reached nothing better

NO_DATUM = "rank deficient: the network floats ({motions}) and nothing holds it; hold coordinates, mark datum points, \
or adjust it free (--datum free)"
WEAK_DATUM = "rank deficient: the datum's coordinates do not hold the network against {motions}; mark more of them"
NOT_SETTLED = "not converged: the network does not come to rest in its datum after {passes} passes; \
check the starting coordinates"
NOT_PLACED = "no approximate coordinates: {points}; give some, or observe more"


@dataclass(frozen=True)
class NetworkSettings:
    """How far `adjust_network` goes.

    iterations   cap of Gauss-Newton steps of each pass
    tests        False leaves out covariance and test statistics
    diagnose     False leaves the status at "converged" or "not converged", without looking for the cause
    """

    iterations: int = 50
    tests: bool = True
    diagnose: bool = True


ALL_THE_WAY = NetworkSettings()


def adjust_network(
    network: ObservationNetwork,
    *,
    datum: str | None = None,
    active: Sequence[np.ndarray] | None = None,
    inflation: Sequence[np.ndarray] | None = None,
    alone: bool = False,
    start: NetworkSolution | None = None,
    settings: NetworkSettings = ALL_THE_WAY,
    engine: str | None = None,
) -> NetworkSolution:
    """The coordinates of a network with their covariance, and a fit per observation.

    network     points, parameters, observations
    datum       None as marked, or "free" or "fixed", see `with_datum`
    active      one (m,) bool a group: False leaves an observation out, but still predicts it
    inflation   one (m,) a group, a factor on its standard uncertainties (robust estimation); infinite leaves out
    alone       inflation of a correlated observation adds to its own variance and dilutes its correlations; else they
                stay, as when a whole group is scaled
    start       an earlier solution of the same network to begin from
    settings    cap of steps, whether tests and the cause of a failure are wanted
    engine      "dense", "sparse" or "ranging" (pure ranging networks only); the fastest that serves if None

    Returns a NetworkSolution whose status says what happened, and where.

    Source: [FOERSTNER16] chapter 4; datum by S-transformation, [BAARDA73].
    """
    network = with_reference(with_datum(network, datum))
    if inflation is not None:
        kept = [np.isfinite(f) for f in inflation]
        active = kept if active is None else [a & k for a, k in zip(active, kept, strict=True)]
    diagnose = settings.tests and settings.diagnose
    if engine in (None, "ranging"):
        from catseye.estimation.network.ranging_engine import adjusted_as_ranges

        solution = adjusted_as_ranges(
            network,
            active=active,
            inflation=inflation,
            start=start,
            iterations=settings.iterations,
            tests=settings.tests,
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
        return problem.unanswered(NOT_PLACED.format(points=_listed(problem.missing)))
    sparse = None if engine is None else engine == "sparse"
    solver = SolverSettings(settings.iterations, settings.tests, sparse)
    solution = problem.solve(active, (inflation, alone), solver)
    if diagnose and solution.answered:
        if start is None and contradicted(solution):
            solution = _from_observations(solution, active, (inflation, alone), solver)
        return replace(solution, status=diagnosed(solution, _trial if inflation is None else None))
    return solution


def fits_near(
    network: ObservationNetwork, near: NetworkSolution
) -> Callable[[Sequence[np.ndarray]], tuple[GroupFit, ...] | None]:
    """The fits of a network with its observations weighed otherwise, one solution after another, quickly.

    network   with its datum marked
    near      its solution, where each begins

    What is returned takes an inflation as `adjust_network` does, each observation's alone, and gives one fit a group;
    None where there is no answer. Coordinates are held against what floats, instead of the datum's conditions: that
    changes no residual and no test, and the datum is not looked for again and again.
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
        kept = _padded([np.isfinite(f) for f in inflation], problem.groups, True)
        solution = adjust(problem.x0, problem.groups, free=free, active=kept, extra_variance=added)
        return solution.fits[: len(network.groups)] if solution.status == CONVERGED else None

    return solve


def _from_observations(
    solution: NetworkSolution,
    active: Sequence[np.ndarray] | None,
    inflation: tuple[Sequence[np.ndarray] | None, bool],
    solver: SolverSettings,
) -> NetworkSolution:
    """The better of a solution and one that begins where the observations put the points, not the given coordinates.

    A poor start may end in another minimum, or in none. What is held or in the datum stays as it is given.
    """
    points = solution.network.points
    begun = points.free & ~points.datum & np.isfinite(points.xyz)
    if not begun.any():
        return solution
    network = replace(solution.network, points=replace(points, xyz=np.where(begun, np.nan, points.xyz)))
    problem = _Problem.of(network, None)
    trial = problem if problem.missing else problem.solve(active, inflation, solver)
    if isinstance(trial, _Problem) or trial.status != CONVERGED or not trial.answered:
        return solution
    if solution.status == CONVERGED and trial.variance_factor > REACHED * solution.variance_factor:
        return solution
    moved = tuple(points.names[i] for i in np.flatnonzero(begun.any(axis=1)))
    return replace(trial, network=solution.network, approximate=solution.approximate, replaced=moved)


def _trial(network: ObservationNetwork, inflation: Sequence[np.ndarray] | None) -> NetworkSolution:
    """A trial of a copy: coordinates and variance factor; tests only where single observations are weighed."""
    large = len(network.points.names) >= FEWEST_POINTS
    weighed = inflation is not None
    settings = NetworkSettings(iterations=50 if weighed else 15, tests=weighed, diagnose=False)
    try:
        return adjust_network(
            network,
            inflation=inflation,
            alone=weighed,
            settings=settings,
            engine="ranging" if large and not weighed else None,
        )
    except EstimationError:  # large, and of another kind: it would take too long to try
        if weighed:
            raise
        return replace(_Problem.of(network, None).unanswered("not tried"), variance_factor=np.inf)


def _listed(reasons: dict[str, str], most: int = 4) -> str:
    text = ", ".join(f"{name} ({why})" for name, why in list(reasons.items())[:most])
    return text + (f" and {len(reasons) - most} more" if len(reasons) > most else "")


@dataclass(frozen=True, eq=False)
class _Problem:
    """The network as one vector of parameters."""

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

            begin = approximate(network)
            xyz, values, found = begin.xyz, begin.parameters, begin.found
            missing, assumed, replaced = begin.missing, begin.assumed, begin.replaced
        sigma = np.array([p.sigma for p in parameters])
        offset = 3 * len(points.names)
        known = np.flatnonzero((sigma > 0.0) & np.isfinite(sigma))
        groups = list(network.groups)
        if len(known):
            observed = np.array([parameters[k].start for k in known])
            groups.append(Linear("priors", observed, sigma[known] ** 2, offset + known, np.eye(len(known))))
        free = np.concatenate([points.free.ravel(), sigma > 0.0])
        xyz = np.where(points.absent, 0.0, xyz)  # any value: no observation depends on it
        return cls(network, np.concatenate([xyz.ravel(), values]), free, groups, found, missing, assumed, replaced)

    @property
    def names(self) -> list[str]:
        """What each parameter is called."""
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
        """The solution in its datum, in as many passes as it takes."""
        points = self.network.points
        n = 3 * len(points.names)
        chosen = _padded(active, self.groups, True)
        larger, added = self._inflated(*inflation)
        rows = [ActiveRows.of(g, None if chosen is None else chosen[i]) for i, g in enumerate(self.groups)]
        x, taken = self.x0, 0
        datum = points.datum & self.free[:n].reshape(-1, 3) & np.isfinite(points.xyz)
        solution: LeastSquaresSolution | None = None
        settled = False
        for _ in range(PASSES):
            floating = self._motions(rows, x)
            conditions, loose = datum_conditions(floating, datum, points.xyz)
            if loose.shape[1]:
                text = WEAK_DATUM if datum.any() else NO_DATUM
                status = unconnected(self.network, self._afloat(rows, x))
                return self.unanswered(status or text.format(motions=floating.words(loose)), x)
            held = self.free.copy()
            held[minimal_coordinates(conditions)] = False
            solution = adjust(
                x,
                self.groups,
                free=held,
                active=chosen,
                inflation=larger,
                extra_variance=added,
                names=self.names,
                solver=solver,
            )
            taken += solution.iterations
            x = solution.x
            settled = not len(conditions)
            if not solution.solved or settled:
                break
            floating = self._floating(rows, x)
            if floating.motions.shape[1] != len(conditions):  # told wrongly from a poor start: once more from here
                continue
            conditions, _ = datum_conditions(floating, datum, points.xyz)
            moved, t = to_datum(x, points.xyz.ravel(), floating.motions, conditions=conditions)
            x = x + moved
            u = np.sqrt(np.maximum(solution.q.diagonal()[:n][held[:n]], 0.0)) if solver.tests else np.zeros(0)
            settled = bool(np.abs(moved[:n]).max() <= motion_limit(x[:n].reshape(-1, 3), points.existing, u))
            if settled and solver.tests:
                solution = replace(solution, q=transformed(solution.q, t, conditions))
            if settled:
                break
        assert solution is not None
        solution = replace(solution, x=x, iterations=taken)
        if not settled and solution.status == CONVERGED:
            solution = replace(solution, status=NOT_SETTLED.format(passes=PASSES))
        if len(solution.floating):
            status = unconnected(self.network, self._afloat(rows, x)) or floating_text(self.network, solution)
            return self.unanswered(status, solution.x)
        degrees = sum(int(r.active.sum()) for r in rows) - int(held.sum())  # the sum of redundancies, without rounding
        factor = sum(f.pvv for f in solution.fits) / degrees if degrees else float("nan")
        answer = self.answer(solution, solution.q, self._datum_words(floating, datum))
        return replace(answer, degrees_of_freedom=float(degrees), variance_factor=factor)

    def _floating(self, rows: list[ActiveRows], x: np.ndarray) -> Floating:
        absent = self.network.points.absent
        return floating_motions(rows, x, x[: absent.size].reshape(-1, 3), free=self.free, absent=absent)

    def _afloat(self, rows: list[ActiveRows], x: np.ndarray) -> Callable[[np.ndarray], bool]:
        """Tells of some points (n,) bool whether they can move as a whole, the others left out of sight."""

        def afloat(piece: np.ndarray) -> bool:
            absent = self.network.points.absent | ~piece[:, None]
            xyz = x[: absent.size].reshape(-1, 3)
            try:
                return floating_motions(rows, x, xyz, free=self.free, absent=absent).motions.shape[1] > 0
            except np.linalg.LinAlgError:  # too poor a start to tell
                return True

        return afloat

    def _motions(self, rows: list[ActiveRows], x: np.ndarray) -> Floating:
        """Motions at x that nothing holds; none where the start is too poor to tell them."""
        try:
            return self._floating(rows, x)
        except np.linalg.LinAlgError:
            return Floating(np.zeros((len(x), 0)), np.zeros((7, 0)), np.zeros(3), 1.0)

    def _inflated(
        self, inflation: Sequence[np.ndarray] | None, alone: bool
    ) -> tuple[list[np.ndarray] | None, list[np.ndarray] | None]:
        """Factors on standard uncertainties, one array a group; or, `alone`, variances to add instead."""
        factors = _padded(inflation, self.groups, 1.0)
        if factors is None or not alone:
            return factors, None
        finite = [np.where(np.isfinite(f), f, 1.0) for f in factors]
        return None, [variances(g) * (f**2 - 1.0) for g, f in zip(self.groups, finite, strict=True)]

    def _datum_words(self, floating: Floating, datum: np.ndarray) -> str:
        points = self.network.points
        held = int(np.sum(points.fixed))
        words = [f"{held} coordinates held"] if held else []
        if floating.motions.shape[1]:
            on = int(datum.any(axis=1).sum())
            words.append(f"inner constraints on {on} points against {floating.words()}")
        return "; ".join(words) or "held by observations and priors"

    def answer(self, solution: LeastSquaresSolution, q: Covariance, datum: str) -> NetworkSolution:
        absent = self.network.points.absent
        count = len(absent)
        own = solution.fits[: len(self.network.groups)]
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
            fits=own,
            variance_factor=factor,
            degrees_of_freedom=degrees,
            datum=datum,
            approximate=self.found,
            assumed=self.assumed,
            replaced=self.replaced,
            q=q,
        )

    def unanswered(self, status: str, x: np.ndarray | None = None) -> NetworkSolution:
        """No answer: the start, or where it stopped, with residuals and no covariance."""
        at = self.x0 if x is None else x
        nothing = np.zeros(len(at), dtype=bool)
        solution = adjust(at, self.groups, free=nothing, solver=SolverSettings(tests=False, iterations=1))
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
    given: Sequence[np.ndarray] | None, groups: Sequence[ObservationGroup], rest: float
) -> list[np.ndarray] | None:
    """One array a group: those given, then for the priors' group all the same."""
    if given is None:
        return None
    return [*given, *(np.full(len(g.observed), rest) for g in groups[len(given) :])]
