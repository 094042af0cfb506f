"""Free ranging networks by block elimination, beside what a user would pick instead.

python benchmarks/bench_network.py [--quick] [--curves]

All start from the same coordinates, 1 cm off, and stop at their own criterion, set so tight that the predicted ranges
agree with ours to the share of a sigma in the note; what a motion of the whole network does not change, all may choose.
Ours counts everything from the arrays of the network to the answer; Ceres its Solve alone, the problem being built;
gtsam its optimiser, the graph being built. One thread each. The C++ Ceres is compiled where g++ finds its headers and
libraries (CPLUS_INCLUDE_PATH, LIBRARY_PATH, LD_LIBRARY_PATH). The limit is the multiply-adds of the elimination, 15 for
each pair of stations and target, in the two eliminations that Gauss-Newton needs at least from such a start.
"""

import functools
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_array
from threadpoolctl import threadpool_limits

import limits
from catseye.estimation.least_squares.adjustment import COMPLETE
from catseye.estimation.network.multilateration.gauss_newton import adjust_ranges
from catseye.estimation.network.multilateration.network import RangingNetwork
from catseye.estimation.network.multilateration.terms import PointPriors
from harness import LIMIT, Contender, Curve, Row, main, missing, raced

HERE = Path(__file__).parent
SMALL, LARGE, HUGE = (18, 2209), (40, 20_000), (60, 100_000)
GROWING = (100, 300, 1000, 3000, 10_000, 30_000)  # targets of 18 stations
PAIR_COST, ELIMINATIONS = 15, 2  # multiply-adds of a pair of stations and a target; matrices built
Solver = Callable[[], tuple[float, np.ndarray]]
WANTING = "no C++ compiler with its headers and libraries was found"
QUICKLY = "not in quick mode"
NO_LIBRARY = 127  # status of a program whose libraries are not found


def network(size: tuple[int, int], seen: float = 1.0) -> RangingNetwork:
    """Stations in a ring of 110 m, targets on and above the dish within; 50 um + 0.5 ppm; starts 1 cm off."""
    s, t = size
    rng = np.random.default_rng(s)
    turn = 2 * np.pi * np.arange(s) / s
    stations = np.stack([110 * np.cos(turn), 110 * np.sin(turn), rng.uniform(-2, 6, s)], axis=1)
    targets = np.stack([*rng.uniform(-50, 50, (2, t)), rng.uniform(10, 80, t)], axis=1)
    target, station = np.divmod(np.arange(s * t), s)
    if seen < 1.0:
        kept = rng.random(s * t) < seen
        station, target = station[kept], target[kept]
    distance = np.linalg.norm(targets[target] - stations[station], axis=1)
    sigma = 5e-5 + 5e-7 * distance
    distance += sigma * rng.standard_normal(len(sigma))
    stations += 0.01 * rng.standard_normal(stations.shape)
    targets += 0.01 * rng.standard_normal(targets.shape)
    datum = np.ones((s, 3), dtype=bool)
    return RangingNetwork(stations, targets, station, target, distance, sigma, datum_stations=datum)


def predicted(stations: np.ndarray, targets: np.ndarray, net: RangingNetwork) -> np.ndarray:
    """Distances of the network's ranges."""
    return np.linalg.norm(targets[net.target] - stations[net.station], axis=1)


# --- the alternatives: each call answers with its seconds and its predicted distances


@functools.cache
def build_ceres(folder: Path) -> Path | None:
    """The driver beside this file, compiled; None where Ceres, its libraries or a compiler are missing."""
    program = folder / "ceres_network"
    command = ["g++", "-std=c++17", "-O3", "-march=native", "-I/usr/include/eigen3", str(HERE / "ceres_network.cpp")]
    try:
        done = subprocess.run([*command, "-o", str(program), "-lceres", "-lglog"], capture_output=True, check=False)
    except FileNotFoundError:
        return None
    if done.returncode:
        return None
    trial = subprocess.run([program], capture_output=True, check=False)
    return None if trial.returncode == NO_LIBRARY else program


def ceres(program: Path, folder: Path, net: RangingNetwork) -> Solver:
    """One round of Ceres: seconds in Solve, predicted distances."""
    s, t, m = len(net.stations), len(net.targets), len(net.distance)
    problem, answer = folder / f"{s}x{t}.problem", folder / f"{s}x{t}.answer"
    with problem.open("wb") as out:
        np.array([s, t, m, 3, 0], dtype=np.int64).tofile(out)
        for values in (net.stations, net.targets, net.station, net.target, net.distance, 1 / net.sigma):
            values.tofile(out)

    def one() -> tuple[float, np.ndarray]:
        done = subprocess.run([program, problem, answer, "1"], capture_output=True, check=True, text=True)
        x = np.fromfile(answer).reshape(-1, 3)
        return float(done.stdout.split()[0]), predicted(x[:s], x[s:], net)

    return one


def scipy_sparse(net: RangingNetwork) -> Solver:
    """One round of scipy's sparse least squares with analytic Jacobian (trust region, lsmr)."""
    s, m = len(net.stations), len(net.distance)
    columns = np.concatenate([net.station[:, None] * 3 + np.arange(3), (s + net.target)[:, None] * 3 + np.arange(3)], 1)
    start = np.concatenate([net.stations, net.targets]).ravel()

    def along(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        points = x.reshape(-1, 3)
        difference = points[s + net.target] - points[net.station]
        return difference, np.linalg.norm(difference, axis=1)

    def residual(x: np.ndarray) -> np.ndarray:
        return (along(x)[1] - net.distance) / net.sigma

    def jacobian(x: np.ndarray) -> csr_array:
        difference, length = along(x)
        u = difference / (length * net.sigma)[:, None]
        values = np.concatenate([-u, u], axis=1).ravel()
        return csr_array((values, columns.ravel(), np.arange(m + 1) * 6), shape=(m, len(start)))

    def one() -> tuple[float, np.ndarray]:
        began = time.process_time()
        fit = least_squares(residual, start, jac=jacobian, method="trf", tr_solver="lsmr", ftol=1e-9, xtol=1e-12)
        return time.process_time() - began, along(fit.x)[1]

    return one


def gtsam(net: RangingNetwork) -> Solver:
    """One round of gtsam's Levenberg-Marquardt; a prior of 1 m holds the datum, which the ranges do not feel."""
    import gtsam as library

    s, t = len(net.stations), len(net.targets)
    graph, start = library.NonlinearFactorGraph(), library.Values()
    noise = [library.noiseModel.Isotropic.Sigma(1, x) for x in net.sigma]
    for i, (a, b, d) in enumerate(zip(net.station.tolist(), net.target.tolist(), net.distance.tolist(), strict=True)):
        graph.add(library.RangeFactor3(a, s + b, d, noise[i]))
    loose = library.noiseModel.Isotropic.Sigma(3, 1.0)
    for i, x in enumerate(np.concatenate([net.stations, net.targets])):
        start.insert(i, x)
        if i < s:
            graph.add(library.PriorFactorPoint3(i, x, loose))
    parameters = library.LevenbergMarquardtParams()
    parameters.setLinearSolverType("MULTIFRONTAL_CHOLESKY")
    parameters.setRelativeErrorTol(1e-9)

    def one() -> tuple[float, np.ndarray]:
        began = time.process_time()
        answer = library.LevenbergMarquardtOptimizer(graph, start, parameters).optimize()
        seconds = time.process_time() - began
        x = np.array([answer.atPoint3(i) for i in range(s + t)])
        return seconds, predicted(x[:s], x[s:], net)

    return one


# --- the rows


def ours(net: RangingNetwork, *, tests: bool, engine: str = "numba") -> Contender:
    """Our adjustment, from arrays to answer."""
    return Contender(
        lambda: adjust_ranges(net, engine=engine, solver=replace(COMPLETE, tests=tests)).require_converged()
    )


def others(
    size: tuple[int, int], net: RangingNetwork, folder: Path, *, quick: bool
) -> tuple[dict[str, Solver], dict[str, str]]:
    """Alternatives by name, and those that are left out with the reason."""
    found, skipped = {}, missing("gtsam")
    if size == HUGE:
        return {}, dict.fromkeys(
            ("C++ Ceres", "scipy least_squares, sparse", "gtsam"), "half a minute and more at this size"
        )
    program = None if quick else build_ceres(folder)
    if program is not None:
        found["C++ Ceres, dense Schur, Solve alone"] = ceres(program, folder, net)
    else:
        skipped["C++ Ceres"] = QUICKLY if quick else WANTING
    if size != SMALL:
        return found, skipped | dict.fromkeys(("scipy least_squares, sparse", "gtsam"), "minutes at this size")
    found["scipy least_squares, sparse, lsmr"] = scipy_sparse(net)
    if quick:
        skipped["gtsam"] = QUICKLY
    elif "gtsam" not in skipped:
        found["gtsam, Levenberg-Marquardt"] = gtsam(net)
    return found, skipped


def least_time(net: RangingNetwork) -> Contender:
    """The machine's limit."""
    s, t = len(net.stations), len(net.targets)
    work, share = limits.multiply_add_work(0.5 * s * (s + 1) * t * PAIR_COST * ELIMINATIONS)
    return Contender(work, share)


def compare(size: tuple[int, int], folder: Path, *, quick: bool) -> Iterator[Row]:
    """Ours and the alternatives on one full network: solving alone, then with every statistic."""
    net = network(size)
    solution = adjust_ranges(net, engine="numba").require_converged()
    reference = predicted(solution.stations, solution.targets, net)
    solvers, skipped = others(size, net, folder, quick=quick)
    off = max((float(np.abs((solve()[1] - reference) / net.sigma).max()) for solve in solvers.values()), default=0.0)
    timed = {name: Contender(functools.partial(first, solve), timed=True) for name, solve in solvers.items()}
    fast = {name: contender for name, contender in timed.items() if name.startswith("C++")}
    bound = {LIMIT: least_time(net)}
    what = f"{size[0]} stations, {size[1]} targets"
    for title, tests, note in (
        ("free network", False, f"{solution.iterations} iterations; ranges agree to {off:.0e} sigma"),
        ("free network with covariances and tests", True, "others: solving alone"),
    ):
        plain = {"numpy, the same elimination": ours(net, tests=tests, engine="numpy")} if size == SMALL else {}
        yield raced(
            title,
            what,
            {"catseye": ours(net, tests=tests), **plain, **(fast if tests else timed), **bound},
            quick=quick,
            clock=time.process_time,
            note=note,
            skipped=skipped,
        )


def first(solve: Solver) -> float:
    """Seconds of a solver's call."""
    return solve()[0]


def variants(size: tuple[int, int], *, quick: bool) -> Row:
    """Incomplete visibility, zeros and scales, priors beside the plain full network; ratios near 1 are good."""
    net, part = network(size), network(size, 0.7)
    s, free = size[0], np.full(size[0], np.inf)
    rng = np.random.default_rng(2)
    cut = rng.choice(size[1], size[1] // 2, replace=False)
    priors = {
        "station_priors": PointPriors(np.arange(s), net.stations, np.tile(1e-4 * np.eye(3), (s, 1, 1))),
        "target_priors": PointPriors(cut, net.targets[cut], np.tile(1e-4 * np.eye(3), (len(cut), 1, 1))),
    }
    kinds = {
        "70 % of the ranges": part,
        "zeros free": replace(net, zero_sigma=free),
        "zeros and scales free": replace(net, zero_sigma=free, scale_sigma=free),
        "zeros and scales with priors": replace(net, zero_sigma=np.full(s, 1e-3), scale_sigma=np.full(s, 1e-6)),
        "priors of all stations and half the targets": replace(net, **priors),
        "datum of all points": replace(net, datum_targets=np.ones((size[1], 3), dtype=bool)),
    }
    return raced(
        "variants of the free network",
        f"{size[0]} stations, {size[1]} targets, all statistics",
        {"catseye": ours(net, tests=True), **{f"ours, {name}": ours(one, tests=True) for name, one in kinds.items()}},
        quick=quick,
        clock=time.process_time,
        note="our own variants, smaller is better",
    )


def rows(quick: bool) -> Iterator[Row]:
    """Three sizes, two in quick mode; then variants of the smallest."""
    with tempfile.TemporaryDirectory() as name:
        for size in (SMALL, LARGE) if quick else (SMALL, LARGE, HUGE):
            yield from compare(size, Path(name), quick=quick)
    if not quick:
        yield variants(SMALL, quick=quick)


def curves(quick: bool) -> Iterator[Curve]:
    """Seconds against targets, all statistics included."""
    with threadpool_limits(limits=1):
        seconds = [
            limits.median_seconds(ours(network((18, targets)), tests=True).work, 3 if quick else 7)
            for targets in GROWING
        ]
    yield Curve("free network with covariances and tests", "18 stations", "targets", GROWING, tuple(seconds))


if __name__ == "__main__":
    main(rows, curves)
