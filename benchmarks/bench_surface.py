"""Paraboloids through 2209 prisms at 200 epochs, beside a loop over scipy.

python benchmarks/bench_surface.py [--quick] [--curves]

All six parameters of each epoch with covariance and deviations, one thread. A user would write least_squares for each
epoch, with its own numerical or an analytic Jacobian, and the covariance from it; it solves a sample and counts an
epoch. The limit is 60 multiply-adds a prism in each of two iterations.
"""

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import limits
from catseye.estimation.shapes.surface_series import fit_series
from harness import LIMIT, Contender, Curve, Row, main, raced
from surface_scene import OWN, PLACES

EPOCHS, SAMPLE = 200, 10
GROWING = (10, 30, 100, 300, 1000)  # epochs
F, SIGMA = 60.0, 5e-5
FREE = ("vertex", "axis", "focal-length")
ITERATIONS = 2  # at least, the second to see that nothing changes
POINT_COST = 60  # multiply-adds of a prism in an iteration: deviation, 6 derivatives, 27 of the normal equations


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


def rows(quick: bool) -> Iterator[Row]:
    """A surface at each epoch."""
    points, variance = night(EPOCHS), np.full(len(PLACES), SIGMA**2)
    few = points[:SAMPLE]

    def ours(epochs: np.ndarray, compiled: bool):  # type: ignore[no-untyped-def]
        return fit_series(epochs, variance, OWN, focal_length=F, free=FREE, compiled=compiled).require_converged()

    fitted, peer = ours(points, True), by_scipy(few, True)
    off = np.abs(fitted.parameters[:SAMPLE] - peer) / np.sqrt(np.einsum("tii->ti", fitted.covariance[:SAMPLE]))
    work, share = limits.multiply_add_work(POINT_COST * len(PLACES) * EPOCHS * ITERATIONS)
    yield raced(
        "surface fits",
        f"{len(PLACES)} prisms, {EPOCHS} epochs, six parameters with covariance",
        {
            "catseye": Contender(lambda: ours(points, True)),
            "scipy least_squares (lm), analytic Jacobian": Contender(lambda: by_scipy(few, True), SAMPLE / EPOCHS),
            "scipy least_squares (lm), its own Jacobian": Contender(lambda: by_scipy(few, False), SAMPLE / EPOCHS),
            "catseye, plain numpy": Contender(lambda: ours(few, False), SAMPLE / EPOCHS),
            LIMIT: Contender(work, share),
        },
        quick=quick,
        clock=time.process_time,
        note=f"largest difference to scipy {off.max():.0e} of a standard uncertainty",
    )


def curves(quick: bool) -> Iterator[Curve]:
    """Seconds against epochs."""
    points, variance = night(GROWING[-1]), np.full(len(PLACES), SIGMA**2)
    with threadpool_limits(limits=1):
        seconds = [
            limits.median_seconds(
                lambda n=n: fit_series(points[:n], variance, OWN, focal_length=F, free=FREE, compiled=True),  # type: ignore[misc]
                3,
            )
            for n in GROWING
        ]
    yield Curve("surface fits", f"{len(PLACES)} prisms", "epochs", GROWING, tuple(seconds))


if __name__ == "__main__":
    main(rows, curves)
