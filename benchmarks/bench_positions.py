"""A million positions from 18 known stations, beside what a user would pick instead; medians of interleaved rounds.

python benchmarks/bench_positions.py

gtsam and pyceres are compared where they are installed; they, and scipy, solve a sample and count per target.
"""

import importlib.util
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from numba import njit
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from catseye.estimation.network.positions.dispatch import positions

ROUNDS = 7
TARGETS, SAMPLE = 1_000_000, 500
SIGMA = 5e-5  # m


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
    kept = [Ranges(row) for row in d]
    options = pyceres.SolverOptions()
    options.num_threads = 1
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_QR
    for x, cost in zip(answer, kept, strict=True):
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


@njit(error_model="numpy", fastmath={"contract"})
def _multiply_adds(a: np.ndarray, times: int) -> None:
    for _ in range(times):
        for i in range(len(a)):
            x = a[i]
            p, q, r, s = x, x, x, x  # four chains hide the latency
            for _ in range(16):
                p, q, r, s = p * x + 0.5, q * x + 0.4, r * x + 0.3, s * x + 0.2
            a[i] = 0.5 + 1e-30 * (p + q + r + s)


@njit(error_model="numpy")
def _roots(a: np.ndarray, times: int) -> None:
    for _ in range(times):
        for i in range(len(a)):
            a[i] = 1.5 / np.sqrt(a[i])


@njit(error_model="numpy", fastmath=True)
def _read(d: np.ndarray) -> float:
    total = 0.0
    for i in range(len(d)):
        total += d[i]
    return total


def race(contenders: dict[str, tuple[Callable[[], object], int]]) -> dict[str, float]:
    """Seconds per target of each, the median of rounds in which every one has its turn."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for name in contenders:
        contenders[name][0]()  # compiled, loaded, memory touched
    for _ in range(ROUNDS):
        for name, (work, count) in contenders.items():
            start = time.perf_counter()
            work()
            times[name].append((time.perf_counter() - start) / count)
    return {name: statistics.median(t) for name, t in times.items()}


def main() -> None:
    """Rates, ratios, what the machine could do at most, and that all agree."""
    stations, starts, d = site(TARGETS)
    sigma = np.full(18, SIGMA)
    each = np.broadcast_to(sigma, d.shape).copy()
    lot = np.random.default_rng(1).random(d.shape)
    tenth, third = np.where(lot < 0.1, np.nan, d), np.where(lot < 1 / 3, np.nan, d)
    few = slice(0, SAMPLE)
    ours, block = "catseye, compiled, one thread", np.linspace(1.0, 2.0, 1024)
    contenders: dict[str, tuple[Callable[[], object], int]] = {
        ours: (lambda: positions(stations, d, sigma), TARGETS),
        "catseye, compiled, two threads": (lambda: positions(stations, d, sigma, threads=2), TARGETS),
        "catseye, compiled, a sigma for each range": (lambda: positions(stations, d, each), TARGETS),
        "catseye, compiled, a tenth of the ranges missing": (lambda: positions(stations, tenth, sigma), TARGETS),
        "catseye, compiled, a third of the ranges missing": (lambda: positions(stations, third, sigma), TARGETS),
        "catseye, plain numpy": (lambda: positions(stations, d[:100_000], sigma, compiled=False), 100_000),
        "scipy least_squares (lm)": (lambda: scipy_lm(stations, starts[few], d[few]), SAMPLE),
    }
    peers = {"pyceres": ("pyceres, positions only", ceres), "gtsam": ("gtsam, with marginals", factor_graph)}
    for module, (name, solve) in peers.items():
        if importlib.util.find_spec(module):
            contenders[name] = (lambda solve=solve: solve(stations, starts[few], d[few]), SAMPLE)  # type: ignore[misc]
        else:
            sys.stdout.write(f"  {module}: not installed\n")
    bounds: dict[str, tuple[Callable[[], object], int]] = {
        "fma": (lambda: _multiply_adds(block, 200), 64 * 1024 * 200),
        "root": (lambda: _roots(block, 1000), 1024 * 1000),
        "read": (lambda: _read(d.ravel()), TARGETS),
        "write": (lambda: np.empty((TARGETS, 14)).fill(0.0), TARGETS),  # 113 bytes of answer
    }
    with threadpool_limits(limits=1, user_api="blas"):
        cost = race(contenders | bounds)
        base = positions(stations, d[few], sigma, compiled=True).require_found().x
        answers = {"scipy": scipy_lm(stations, starts[few], d[few])}
        for module, (_, solve) in peers.items():
            if importlib.util.find_spec(module):
                answers[module] = solve(stations, starts[few], d[few])
    sys.stdout.write(f"Positions of {TARGETS} targets from 18 known stations, with covariance and status\n")
    for name in contenders:
        sys.stdout.write(f"  {name:<52} {1e-6 / cost[name]:10.4f} M targets/s {cost[name] / cost[ours]:10.1f} x\n")
    for name, x in answers.items():
        sys.stdout.write(f"  largest difference to {name}: {np.abs(x - base).max() * 1e9:.3f} nm\n")
    # a range: start 10 and evaluation 22 multiply-adds or the like, a root and its division
    arithmetic = 18 * (32 * cost["fma"] + cost["root"])
    sys.stdout.write(
        f"  the machine, one thread: {1e-9 / cost['fma']:.1f} G multiply-adds/s, "
        f"{cost['root'] * 1e9:.2f} ns a root with division,\n  {144e-9 / cost['read']:.1f} GB/s read, "
        f"{cost['write'] * 1e9:.1f} ns to write one answer to new memory\n"
        f"  its bound: arithmetic {1e-6 / arithmetic:.1f} M targets/s; with reading and writing, one after the other, "
        f"{1e-6 / (arithmetic + cost['read'] + cost['write']):.1f} M targets/s\n"
    )


if __name__ == "__main__":
    main()
