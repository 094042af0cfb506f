"""Paraboloids through 2209 prisms at a thousand epochs, beside a loop over scipy; medians of interleaved rounds.

python benchmarks/bench_surface.py [--epochs 1000]

All six parameters of each epoch with covariance and deviations. The peer is what a user would write: least_squares a
epoch with its own numerical or an analytic Jacobian, covariance from it; it solves a sample and counts an epoch.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from catseye.estimation.shapes.surface_series import fit_series
from surface_scene import OWN, PLACES

ROUNDS, SAMPLE = 5, 20
F, SIGMA = 60.0, 5e-5
FREE = ("vertex", "axis", "focal-length")


def night(epochs: int) -> np.ndarray:
    """The site's prisms with panels of 68 um and noise, the dish moved by some mm and seconds an epoch."""
    rng = np.random.default_rng(9)
    turns = Rotation.from_rotvec(np.column_stack([rng.normal(size=(epochs, 2)) * 5e-5, np.zeros(epochs)]))
    moved = np.einsum("tij,kj->tki", turns.as_matrix(), PLACES) + rng.normal(size=(epochs, 1, 3)) * 5e-3
    moved[:, :, 2] += 6.8e-5 * rng.normal(size=len(PLACES))
    return moved + SIGMA * rng.normal(size=moved.shape)


def parts(p: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    turn = Rotation.from_rotvec([p[3], p[4], 0.0]).as_matrix()
    local = (points - p[:3]) @ turn
    return turn, local, np.sum(local[:, :2] ** 2, axis=1)


def deviation(p: np.ndarray, points: np.ndarray) -> np.ndarray:
    _, local, r2 = parts(p, points)
    f = F + p[5]
    return (local[:, 2] - r2 / (4 * f)) / np.sqrt(1 + r2 / (4 * f * f))


def jacobian(p: np.ndarray, points: np.ndarray) -> np.ndarray:
    turn, local, r2 = parts(p, points)
    f = F + p[5]
    cos = 1 / np.sqrt(1 + r2 / (4 * f * f))
    normal = np.column_stack([-local[:, :2] / (2 * f), np.ones(len(points))]) * cos[:, None] @ turn.T
    turned = np.cross(points - p[:3], normal)[:, :2]
    return np.column_stack([-normal, -turned, r2 / (4 * f * f) * cos])


def by_scipy(points: np.ndarray, analytic: bool) -> np.ndarray:
    found = np.empty((len(points), 6))
    for t, epoch in enumerate(points):
        fit = least_squares(
            deviation, np.zeros(6), jac=jacobian if analytic else "2-point", args=(epoch,), x_scale="jac", method="lm"
        )
        np.linalg.inv(fit.jac.T @ fit.jac) * SIGMA**2
        found[t] = fit.x
    return found


def race(contenders: dict[str, tuple[Callable[[], object], int]]) -> dict[str, float]:
    """Seconds an epoch of each, the median of rounds in which every one has its turn."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for work, _ in contenders.values():
        work()  # compiled, loaded, memory touched
    for _ in range(ROUNDS):
        for name, (work, count) in contenders.items():
            start = time.perf_counter()
            work()
            times[name].append((time.perf_counter() - start) / count)
    return {name: statistics.median(t) for name, t in times.items()}


def main() -> None:
    """Times, ratios, and that all agree."""
    parser = argparse.ArgumentParser(description="Paraboloids through 2209 prisms at many epochs.")
    parser.add_argument("--epochs", type=int, default=1000)
    epochs = parser.parse_args().epochs
    points, variance = night(epochs), np.full(len(PLACES), SIGMA**2)
    few = points[:SAMPLE]
    ours = "catseye, compiled, one thread"
    contenders: dict[str, tuple[Callable[[], object], int]] = {
        ours: (lambda: fit_series(points, variance, OWN, focal_length=F, free=FREE, compiled=True), epochs),
        "catseye, plain numpy": (
            lambda: fit_series(few, variance, OWN, focal_length=F, free=FREE, compiled=False),
            SAMPLE,
        ),
        "scipy least_squares (lm), analytic Jacobian": (lambda: by_scipy(few, True), SAMPLE),
        "scipy least_squares (lm), its own Jacobian": (lambda: by_scipy(few, False), SAMPLE),
    }
    with threadpool_limits(limits=1, user_api="blas"):
        cost = race(contenders)
        found = fit_series(points, variance, OWN, focal_length=F, free=FREE, compiled=True).require_converged()
        peer = by_scipy(few, True)
    off = np.abs(found.parameters[:SAMPLE] - peer) / np.sqrt(np.einsum("tii->ti", found.covariance[:SAMPLE]))
    sys.stdout.write(f"{len(PLACES)} prisms, {epochs} epochs, six parameters, covariance, deviations\n")
    for name, seconds in cost.items():
        sys.stdout.write(f"  {name:<46} {1e3 * seconds:9.3f} ms an epoch {seconds / cost[ours]:9.1f} x\n")
    sys.stdout.write(f"  all epochs, {ours}: {cost[ours] * epochs:.2f} s\n")
    sys.stdout.write(f"  largest difference to scipy: {off.max():.1e} of a standard uncertainty\n")


if __name__ == "__main__":
    main()
