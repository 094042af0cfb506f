"""Encoder counts of 18 rangers for 10^5 points each, beside what a user would write instead.

python benchmarks/bench_pointing.py [--quick]

Ours takes a thread a processor and writes into the caller's array, the others take one thread and new memory. The limit
reads the points and writes as much, on one thread, too.
"""

from collections.abc import Iterator

import numpy as np
from numba import njit

from catseye.geometry.mirror.pointing import MirrorStation, aim, counts
from harness import LIMIT, Contender, Row, main, raced

RANGERS, POINTS = 18, 100_000


def scene() -> tuple[MirrorStation, np.ndarray]:
    """Twelve rangers on a ring of 120 m and six in the air, points all over the telescope."""
    rng = np.random.default_rng(5)
    turn = np.arange(RANGERS) * 2.0 * np.pi / 12
    ground = np.stack([120 * np.cos(turn), 120 * np.sin(turn), np.where(np.arange(RANGERS) < 12, 0.0, 70.0)], axis=1)
    alpha = np.stack([np.pi / 2 + turn, *rng.normal(0.0, 1e-3, (2, RANGERS))], axis=1)
    offset = np.array([0.0, 0.247, 0.0]) + rng.normal(0.0, 1e-3, (RANGERS, 3))
    station = MirrorStation(
        ground, alpha, offset, rng.normal(0, 5e-4, (RANGERS, 2)), rng.integers(-5000, 5000, (RANGERS, 2))
    )
    points = np.stack([*rng.uniform(-60, 60, (2, POINTS)), rng.uniform(5, 110, POINTS)], axis=1)
    return station, points


def whole_arrays(station: MirrorStation, points: np.ndarray) -> np.ndarray:
    """The transformation as a numpy user writes it: one array expression a step."""
    mirror = (points - station.scan_point[:, None]) @ np.swapaxes(station.mirror_from_ground, -1, -2)
    x, y, z = mirror[..., 0], mirror[..., 1], mirror[..., 2]
    theta = np.arctan2(y, x)
    theta = np.where(theta < -np.pi / 2, theta + 2 * np.pi, theta)
    phi = np.arccos(z / np.sqrt(x**2 + y**2 + z**2))
    na = 1e5 * theta / (2 * np.pi) + station.zeros[:, :1]
    return np.stack([na, 1e5 * phi / (4 * np.pi) + station.zeros[:, 1:]], axis=-1)


def scipy_rotations(station: MirrorStation, points: np.ndarray) -> np.ndarray:
    """The same through scipy's rotations, one ranger at a time."""
    from scipy.spatial.transform import Rotation

    answer = np.empty((RANGERS, len(points), 2))
    for i in range(RANGERS):
        mirror = Rotation.from_matrix(station.mirror_from_ground[i]).apply(points - station.scan_point[i])
        theta = np.arctan2(mirror[:, 1], mirror[:, 0])
        answer[i, :, 0] = 1e5 * np.where(theta < -np.pi / 2, theta + 2 * np.pi, theta) / (2 * np.pi)
        answer[i, :, 1] = 1e5 * np.arctan2(np.hypot(mirror[:, 0], mirror[:, 1]), mirror[:, 2]) / (4 * np.pi)
    return answer + station.zeros[:, None]


@njit(cache=True, error_model="numpy")
def _write_only(matrix, points, out):
    """The machine's limit for this size: the points read and the answers written, nothing computed."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j, 0] = points[j, 0] + matrix[i, 0, 0]
            out[i, j, 1] = points[j, 1] + points[j, 2]


def stream(station: MirrorStation, points: np.ndarray) -> np.ndarray:
    out = np.empty((RANGERS, len(points), 2))
    _write_only(station.mirror_from_ground, points, out)
    return out


def plain(station: MirrorStation, points: np.ndarray) -> np.ndarray:
    found = aim(station[:, None], points)
    return np.stack([found.azimuth_counts, found.elevation_counts], axis=-1)


def rows(quick: bool) -> Iterator[Row]:
    """Counts of every ranger for every point, and the derivatives' plain form."""
    station, points = scene()
    own = np.empty((RANGERS, POINTS, 2))
    base = counts(station[:, None], points, out=own)
    apart = max(float(np.abs(form(station, points) - base).max()) for form in (whole_arrays, scipy_rotations, plain))
    yield raced(
        "mirror pointing",
        f"{RANGERS} rangers to {POINTS:.0e} points, counts",
        {
            "catseye": Contender(lambda: counts(station[:, None], points, out=own)),
            "numpy, whole arrays": Contender(lambda: whole_arrays(station, points)),
            "scipy rotations, a ranger at a time": Contender(lambda: scipy_rotations(station, points)),
            "catseye, plain numpy, with ranges": Contender(lambda: plain(station, points)),
            LIMIT: Contender(lambda: stream(station, points)),
        },
        quick=quick,
        note=f"counts agree to {apart:.0e}",
    )


if __name__ == "__main__":
    main(rows)
