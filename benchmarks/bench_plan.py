"""Monte Carlo runs of a plan, beside one adjustment after the other and beside scipy's least squares.

python benchmarks/bench_plan.py [--quick] [--curves]

All draw the same runs of the feed arm's network, solve them in the same free datum and give coordinates with their
variances; scipy gets the derivatives of our own observations. The limit is the arithmetic of one run: three times its
derivatives, its normal equations, a Cholesky factor and its inverse.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import limits
from catseye.estimation.network.adjustment import NetworkSettings, adjust_network
from catseye.estimation.network.model import NetworkPoints, NetworkSolution, ObservationNetwork
from catseye.estimation.network.monte_carlo import NetworkSimulation
from catseye.estimation.network.plan import predicted
from catseye.estimation.observations.kinds import Distances
from catseye.records.network.any_file import read_network
from harness import LIMIT, Contender, Curve, Row, main, raced

FEED_ARM = Path(__file__).parents[1] / "examples" / "networks" / "feed-arm.toml"
RUNS, BATCHED, SINGLE = 10_000, 1000, 10  # of the row, of one timing in batches, and one by one
SLOPE = 12  # multiply-adds of a range's length and derivatives
ROUNDS_OF_A_RUN = 3  # predictions: at the plan, after the first step, after the second


class Scipy:
    """The network of a simulation for `scipy.optimize.least_squares`: whitened residuals over what moves."""

    def __init__(self, simulation: NetworkSimulation) -> None:
        self.parts, self.moving = simulation.parts, simulation.moving
        size, observed = len(self.parts.x), [g.observed for g in self.parts.groups]
        self.own = len(simulation.network.groups)
        self.observed, self.sigma = observed, [np.sqrt(g.covariance) for g in self.parts.groups]
        self.rows = sum(map(len, observed))
        held = np.where(np.isfinite(self.parts.reference), self.parts.reference, 0.0)
        self.conditions = 1e5 * self.parts.conditions[:, self.moving]  # of the datum, as strong as ranges of 10 um
        self.reference, self.place = held[self.moving], np.full(size + 1, len(self.moving))
        self.place[self.moving] = np.arange(len(self.moving))

    def solve(self, observed: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Parameters that move, and their variances."""
        measured = [*observed, *self.observed[self.own :]]

        def full(x: np.ndarray) -> np.ndarray:
            whole = self.parts.x.copy()
            whole[self.moving] = x
            return whole

        def residuals(x: np.ndarray) -> np.ndarray:
            at = full(x)
            triples = zip(self.parts.groups, measured, self.sigma, strict=True)
            v = [(group.predict(at)[0] - o) / s for group, o, s in triples]
            return np.concatenate([*v, self.conditions @ (x - self.reference)])

        def jacobian(x: np.ndarray) -> np.ndarray:
            at, first = full(x), 0
            a = np.zeros((self.rows + len(self.conditions), len(self.moving) + 1))
            for group, s in zip(self.parts.groups, self.sigma, strict=True):
                m, slopes = len(s), group.predict(at)[1]
                np.add.at(
                    a,
                    (first + np.arange(m)[:, None], self.place[np.broadcast_to(group.columns, slopes.shape)]),
                    slopes / s[:, None],
                )
                first += m
            a[first:, :-1] = self.conditions
            return a[:, :-1]

        fit = least_squares(residuals, self.parts.x[self.moving], jac=jacobian, method="lm", x_scale="jac")
        whole = np.linalg.inv(fit.jac.T @ fit.jac)
        return fit.x, np.diag(whole) - np.sum((whole @ self.conditions.T) ** 2, axis=1)


def one_by_one(simulation: NetworkSimulation, runs: int) -> list[NetworkSolution]:
    """Every run adjusted by itself, with its tests, as before there were batches."""
    drawn = simulation.draw(0, runs)
    solved = []
    for r in range(runs):
        pairs = zip(simulation.network.groups, drawn.observed, strict=True)
        groups = tuple(replace(group, observed=o[r]) for group, o in pairs)  # type: ignore[type-var]
        solved.append(adjust_network(replace(simulation.network, groups=groups)))
    return solved


def ring(targets: int, stations: int = 12) -> NetworkSolution:
    """Targets ranged from a ring of stations, all free."""
    rng = np.random.default_rng(targets)
    turn = 2.0 * np.pi * np.arange(stations) / stations
    ground = np.stack([100.0 * np.cos(turn), 100.0 * np.sin(turn), 30.0 * rng.uniform(-1, 1, stations)], axis=1)
    xyz = np.concatenate([ground, rng.uniform(-50, 50, (targets, 3)) + np.array([0.0, 0.0, 50.0])])
    pairs = np.stack(np.meshgrid(np.arange(stations), stations + np.arange(targets), indexing="ij"), -1).reshape(-1, 2)
    m = len(pairs)
    ranges = Distances("ranges", np.zeros(m), np.full(m, 2.5e-9), 3 * pairs[:, 0], 3 * pairs[:, 1])
    datum = np.zeros(xyz.shape, dtype=bool)
    datum[:stations] = True
    points = NetworkPoints(tuple(f"P{i}" for i in range(len(xyz))), xyz, np.zeros_like(datum), datum)
    return adjust_network(
        predicted(ObservationNetwork(points, (), (ranges,))), settings=NetworkSettings(diagnose=False)
    )


def arithmetic(simulation: NetworkSimulation) -> float:
    """Multiply-adds of one run at least."""
    k = len(simulation.moving)
    groups = simulation.parts.groups
    products = sum(len(g.observed) * g.columns.shape[-1] * (g.columns.shape[-1] + 1) // 2 for g in groups)
    rows = sum(len(g.observed) for g in groups)
    return ROUNDS_OF_A_RUN * SLOPE * rows + products + k**3 / 6 + k**3 / 6 + k**2


def rows(quick: bool) -> Iterator[Row]:
    """Runs without blunders."""
    solution = adjust_network(predicted(read_network(FEED_ARM)))
    simulation = NetworkSimulation.of(solution, seed=1)
    peer, drawn, few = Scipy(simulation), simulation.draw(0, SINGLE), range(SINGLE)
    batch = simulation.batches.solve(drawn.observed)
    others = [peer.solve([o[r] for o in drawn.observed]) for r in few]
    u = np.sqrt(batch.variance)
    apart = max(float(np.abs((x - batch.x[r, simulation.moving]) / u[r]).max()) for r, (x, _) in enumerate(others))
    of_u = max(float(np.abs(np.sqrt(v) / u[r] - 1.0).max()) for r, (_, v) in enumerate(others))
    work, share = limits.multiply_add_work(RUNS * arithmetic(simulation))
    contenders = {
        "catseye": Contender(lambda: simulation.run(0, BATCHED, adjust_network), BATCHED / RUNS),
        "catseye, one run after the other": Contender(lambda: one_by_one(simulation, SINGLE), SINGLE / RUNS),
        "scipy least_squares (lm), a call a run": Contender(
            lambda: [peer.solve([o[r] for o in drawn.observed]) for r in few], SINGLE / RUNS
        ),
        LIMIT: Contender(work, share),
    }
    yield raced(
        "plan, Monte Carlo",
        f"{RUNS} runs of the feed arm, {len(simulation.moving)} parameters, one thread",
        contenders,
        quick=quick,
        clock=time.process_time,
        note=f"largest difference to scipy {apart:.1g} u; of u {of_u:.1g}",
    )


def curves(quick: bool) -> Iterator[Curve]:
    """One run against the number of parameters, in batches and by itself."""
    sizes, together, alone = [], [], []
    for targets in (6, 12, 25, 50, 100, 180)[: 4 if quick else 6]:
        simulation = NetworkSimulation.of(ring(targets), seed=1)
        runs = max(2, min(400, math.ceil(2e8 / len(simulation.moving) ** 3)))
        sizes.append(float(len(simulation.moving)))
        together.append(limits.median_seconds(lambda s=simulation, n=runs: s.run(0, n, adjust_network)) / runs)  # type: ignore[misc]
        alone.append(limits.median_seconds(lambda s=simulation: one_by_one(s, 2), 3) / 2)  # type: ignore[misc]
    for what, values in (("in batches", together), ("by itself", alone)):
        yield Curve("plan, one Monte Carlo run", what, "parameters", tuple(sizes), tuple(values))


if __name__ == "__main__":
    main(rows, curves)
