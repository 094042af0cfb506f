"""What the main job costs, beside what a user would pick instead; ratios of one run, medians of rounds.

python benchmarks/bench_reduce.py
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import build_network
from catseye.signal.detection.phase import detect

ROUNDS = 5
EXAMPLE = Path(__file__).parents[1] / "examples" / "night-01"


def seconds(work: Callable[[], object]) -> float:
    """Median wall time of a few rounds."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def show(rows: list[tuple[str, float]], ours: str) -> None:
    """A table of times and of ratios to ours."""
    base = dict(rows)[ours]
    for name, t in rows:
        sys.stdout.write(f"  {name:<58} {t * 1e3:9.1f} ms {t / base:8.1f} x\n")
    sys.stdout.write("\n")


def detection() -> None:
    """Samples to phasors."""
    frames = np.load(EXAMPLE / "frames.npy")
    angle = 2 * np.pi * np.arange(frames.shape[1]) / 64
    cosine, sine = np.cos(angle), np.sin(angle)
    size = frames.nbytes / 1e6
    sys.stdout.write(f"Detection of {len(frames)} buffers of {frames.shape[1]} samples ({size:.0f} MB)\n")
    ours = "catseye detect: phasor, uncertainty, harmonics, noise, clipping"
    show(
        [
            (ours, seconds(lambda: detect(frames, 64))),
            ("numpy sums of eq. 5.1 and 5.2: phasor alone", seconds(lambda: (frames @ cosine, frames @ sine))),
            ("numpy rfft: phasor and harmonics", seconds(lambda: np.fft.rfft(frames))),
            ("one read of the samples (the limit)", seconds(lambda: frames.max())),
        ],
        ours,
    )


def adjustment() -> None:
    """The network of night-01: 600 unknowns, correlated ranges."""
    campaign, settings = read_campaign(EXAMPLE), ReductionSettings()
    phases = measure_phases(campaign, settings)
    electronics, _ = follow_electronics(campaign, phases)
    network = build_network(campaign, phases, electronics, settings=settings)
    x0 = np.array(network.layout.start)
    free = np.array(network.layout.free)
    groups = [shot_group(network, name, x0)[0] for name in network.rangers] + network.priors
    factors = [np.linalg.cholesky(g.covariance) if g.covariance.ndim == 2 else np.sqrt(g.covariance) for g in groups]

    def whitened(y: np.ndarray) -> np.ndarray:
        x = x0.copy()
        x[free] = y
        parts = []
        for group, factor in zip(groups, factors, strict=True):
            v = group.observed - group.predict(x)[0]
            parts.append(np.linalg.solve(factor, v) if factor.ndim == 2 else v / factor)
        return np.concatenate(parts)

    def jacobian(y: np.ndarray) -> np.ndarray:
        x = x0.copy()
        x[free] = y
        rows = []
        for group, factor in zip(groups, factors, strict=True):
            full = -full_jacobian(group, x)
            rows.append(np.linalg.solve(factor, full) if factor.ndim == 2 else full / factor[:, None])
        return np.concatenate(rows)[:, free]

    sys.stdout.write(f"Adjustment of {sum(len(g.observed) for g in groups)} observations, {free.sum()} unknowns\n")
    ours = "catseye adjust: answer, covariance, every test statistic"
    with threadpool_limits(limits=1, user_api="blas"):
        show(
            [
                (ours, seconds(lambda: adjust(x0, groups, free=free))),
                (
                    "the same with rejection, cycles and air renewed",
                    seconds(lambda: adjust_coordinates(campaign, phases, electronics, settings=settings)),
                ),
                (
                    "scipy least_squares, analytic Jacobian: answer alone",
                    seconds(lambda: least_squares(whitened, x0[free], jac=jacobian, x_scale="jac")),
                ),
            ],
            ours,
        )


def whole() -> None:
    """The main job without its report."""
    sys.stdout.write("The main job: campaign read, samples to coordinates, pose, surface\n")
    ours = "read_campaign and reduce_epoch"
    show([(ours, seconds(lambda: reduce_epoch(read_campaign(EXAMPLE))))], ours)


if __name__ == "__main__":
    detection()
    adjustment()
    whole()
