"""A million positions from 18 known stations, beside what a user would pick instead.

python benchmarks/bench_positions.py [--quick]

gtsam and pyceres are compared where they are installed; they, and scipy, solve a sample and count per target. The limit
adds up what one target needs at least: its multiply-adds and roots, reading its ranges and writing its answer.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.optimize import least_squares

import limits
from catseye.estimation.network.positions.dispatch import positions
from harness import LIMIT, Contender, Row, main, missing, raced

TARGETS, PLAIN, SAMPLE = 1_000_000, 50_000, 100
SIGMA = 5e-5  # m
ANSWER = 14  # float64 of each target: 113 bytes


def site(targets: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Twelve stations on the ground in a ring of 110 m, six on an arm 60 m up; targets between; their ranges."""
    rng = np.random.default_rng(18)
    turn, arm = np.arange(12) * np.pi / 6, np.arange(6) * np.pi / 3
    ground = np.stack([110 * np.cos(turn), 110 * np.sin(turn), rng.uniform(-3, 6, 12)], axis=1)
    above = np.stack([20 * np.cos(arm), 20 * np.sin(arm), rng.uniform(56, 64, 6)], axis=1)
    stations = np.concatenate([ground, above])
    x = np.stack([*rng.uniform(-50, 50, (2, targets)), rng.uniform(5, 45, targets)], axis=1)
    d = np.empty((targets, 18))
    for i, s in enumerate(stations):
        d[:, i] = np.linalg.norm(x - s, axis=1) + SIGMA * rng.normal(size=targets)
    return stations, np.round(x, 1), d  # peers start within a decimetre


def scipy_lm(stations: np.ndarray, starts: np.ndarray, d: np.ndarray) -> np.ndarray:
    """One call a target, analytic Jacobian, covariance from it."""
    answer = np.empty_like(starts)
    for t, start in enumerate(starts):
        fit = least_squares(
            lambda p, t=t: (np.sqrt(np.sum((p - stations) ** 2, axis=1)) - d[t]) / SIGMA,
            start,
            jac=lambda p: (p - stations) / (SIGMA * np.sqrt(np.sum((p - stations) ** 2, axis=1)))[:, None],
            method="lm",
        )
        np.linalg.inv(fit.jac.T @ fit.jac)
        answer[t] = fit.x
    return answer


def ceres(stations: np.ndarray, starts: np.ndarray, d: np.ndarray) -> np.ndarray:
    """One problem, a residual block a target with analytic Jacobian; positions only, no covariance."""
    import pyceres

    class Ranges(pyceres.CostFunction):
        def __init__(self, measured: np.ndarray) -> None:
            pyceres.CostFunction.__init__(self)
            self.measured = measured
            self.set_num_residuals(len(stations))
            self.set_parameter_block_sizes([3])

        def Evaluate(self, parameters, residuals, jacobians):  # type: ignore[no-untyped-def]
            delta = parameters[0] - stations
            r = np.sqrt(np.einsum("ij,ij->i", delta, delta))
            residuals[:] = (r - self.measured) / SIGMA
            if jacobians is not None:
                jacobians[0][:] = (delta / (SIGMA * r)[:, None]).ravel()
            return True

    answer = [start.copy() for start in starts]
    costs = [Ranges(row) for row in d]
    options = pyceres.SolverOptions()
    options.num_threads = 1
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_QR
    for x, cost in zip(answer, costs, strict=True):
        problem = pyceres.Problem()
        problem.add_residual_block(cost, None, [x])
        pyceres.solve(options, problem, pyceres.SolverSummary())
    return np.array(answer)


def factor_graph(stations: np.ndarray, starts: np.ndarray, d: np.ndarray) -> np.ndarray:
    """One graph of all targets with the stations held to 10 nm, each target's covariance from its marginal."""
    import gtsam

    graph, values, count = gtsam.NonlinearFactorGraph(), gtsam.Values(), len(stations)
    held, noise = gtsam.noiseModel.Isotropic.Sigma(3, 1e-8), gtsam.noiseModel.Isotropic.Sigma(1, SIGMA)
    for i, s in enumerate(stations):
        graph.add(gtsam.PriorFactorPoint3(i, s, held))
        values.insert(i, s)
    for t, start in enumerate(starts):
        values.insert(count + t, start)
        for i in range(count):
            graph.add(gtsam.RangeFactor3(i, count + t, d[t, i], noise))
    result = gtsam.GaussNewtonOptimizer(graph, values).optimize()
    marginals = gtsam.Marginals(graph, result)
    for t in range(len(starts)):
        marginals.marginalCovariance(count + t)
    return np.array([result.atPoint3(count + t) for t in range(len(starts))])


def least_time(ranges: np.ndarray) -> Callable[[], float]:
    """Seconds that arithmetic, reading and writing take at least, one after another.

    A range costs 32 multiply-adds or the like, 10 in the start and 22 in the evaluation, and a root with its division.
    """
    targets, stations = ranges.shape
    block = limits.BLOCK.copy()
    work, share = limits.multiply_add_work(32.0 * stations * targets)
    turns = 1000
    root_share = len(block) * turns / (stations * targets)
    words = ranges.reshape(-1).view(np.int64)

    def measure() -> float:
        once = [
            limits.median_seconds(job, 1)
            for job in (
                work,
                lambda: limits.roots(block, turns),
                lambda: limits.read(words),
                lambda: np.empty((targets, ANSWER)).fill(0.0),
            )
        ]
        return once[0] / share + once[1] / root_share + once[2] + once[3]

    return measure


def rows(quick: bool) -> Iterator[Row]:
    """All ranges measured; each with a sigma of its own; a tenth and a third of them missing."""
    stations, starts, d = site(TARGETS)
    sigma = np.full(len(stations), SIGMA)
    few = slice(0, SAMPLE)
    base = positions(stations, d[few], sigma, compiled=True).require_found().x
    peers = {"scipy least_squares (lm)": scipy_lm}
    skipped = missing("pyceres", "gtsam")
    peers |= {
        name: solve
        for name, module, solve in (
            ("pyceres, positions alone", "pyceres", ceres),
            ("gtsam with marginals", "gtsam", factor_graph),
        )
        if module not in skipped
    }
    apart = max(float(np.abs(solve(stations, starts[few], d[few]) - base).max()) for solve in peers.values())
    bound = Contender(least_time(d), timed=True)
    plain = Contender(lambda: positions(stations, d[:PLAIN], sigma, compiled=False), PLAIN / TARGETS)
    yield raced(
        "positions",
        f"{TARGETS:.0e} targets from {len(stations)} stations, covariance, one thread",
        {
            "catseye": Contender(lambda: positions(stations, d, sigma)),
            "numpy, structure of arrays": plain,
            **{
                name: Contender(lambda solve=solve: solve(stations, starts[few], d[few]), SAMPLE / TARGETS)  # type: ignore[misc]
                for name, solve in peers.items()
            },
            LIMIT: bound,
        },
        quick=quick,
        clock=time.process_time,
        note=f"largest difference to the others {apart * 1e9:.2g} nm",
        skipped=skipped,
    )
    yield raced(
        "positions, two threads",
        "the same",
        {"catseye": Contender(lambda: positions(stations, d, sigma, threads=2)), "numpy, structure of arrays": plain},
        quick=quick,
        clock=time.perf_counter,
    )
    lot = np.random.default_rng(1).random(d.shape)
    for name, ranges, u in (
        ("a sigma for each range", d, np.broadcast_to(sigma, d.shape).copy()),
        ("a third of the ranges missing", np.where(lot < 1 / 3, np.nan, d), sigma),
    ):
        yield raced(
            "positions",
            name,
            {
                "catseye": Contender(lambda r=ranges, u=u: positions(stations, r, u)),  # type: ignore[misc]
                "numpy, structure of arrays": Contender(
                    lambda r=ranges[:PLAIN], u=u[:PLAIN] if u.ndim == 2 else u: positions(  # type: ignore[misc]
                        stations, r, u, compiled=False
                    ),
                    PLAIN / TARGETS,
                ),
                LIMIT: bound,
            },
            quick=quick,
            clock=time.process_time,
        )


if __name__ == "__main__":
    main(rows)
