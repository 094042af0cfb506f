"""A series of epochs fitted: 2209 prisms in 300 epochs, beside a least squares of each prism in a loop.

python benchmarks/bench_structure.py [--quick] [--curves]

Places and functions of elevation, temperature and time with covariance. The limit reads the coordinates once.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

import limits
from catseye.estimation.harmonic.series import Spread, fit_harmonics
from harness import LIMIT, Contender, Curve, Row, main, raced

PRISMS, EPOCHS, SOME = 2209, 300, 40
GROWING = (50, 100, 200, 400, 800)  # epochs


@dataclass(frozen=True)
class Scene:
    """Observed places (t, p, 3), arms (p, 3), functions of each epoch (t, 4), variances (t, p, 3, 3), m and m2."""

    observed: np.ndarray
    arms: np.ndarray
    functions: np.ndarray
    points: np.ndarray


def scene(epochs: int) -> Scene:
    """Prisms that move with the sine and cosine of elevation and with temperature."""
    rng = np.random.default_rng(0)
    elevation, warm = rng.uniform(0.1, 1.5, epochs), rng.normal(size=epochs)
    functions = np.stack([np.ones(epochs), np.sin(elevation), np.cos(elevation), warm], axis=1)
    arms = rng.uniform(-50.0, 50.0, (PRISMS, 3))
    points = np.eye(3) * 1e-8 * rng.uniform(0.5, 2.0, (epochs, PRISMS, 1, 1))
    truth = rng.normal(size=(PRISMS, 3, 4)) * 1e-3
    exact = np.einsum("tk,pik->tpi", functions, truth)
    return Scene(exact + np.sqrt(points[..., 0, :1]) * rng.normal(size=exact.shape), arms, functions, points)


def fitted(s: Scene, own: int) -> np.ndarray:
    """Coefficients of each prism; the first `own` functions are its own, the others the body's."""
    body = s.functions[:, own:]
    found = fit_harmonics(s.observed, s.arms, body=body, own=s.functions[:, :own], spread=Spread(points=s.points))
    return np.asarray(found.own)


def looped(s: Scene, prisms: int) -> np.ndarray:
    """All functions of each prism by numpy's lstsq, (p, 3, 4)."""
    epochs = len(s.functions)
    answer = np.empty((prisms, 3, 4))
    for p in range(prisms):
        root = np.linalg.inv(np.linalg.cholesky(s.points[:, p]))
        design = (root @ np.einsum("tf,ij->tifj", s.functions, np.eye(3)).reshape(epochs, 3, -1)).reshape(
            3 * epochs, -1
        )
        alone = np.linalg.lstsq(design, (root @ s.observed[:, p, :, None]).ravel(), rcond=None)[0]
        answer[p] = alone.reshape(4, 3).T
    return answer


def rows(quick: bool) -> Iterator[Row]:
    """All functions of each prism, as the loop has them; then the body's functions in common."""
    s = scene(EPOCHS)
    words = s.observed.reshape(-1).view(np.int64)
    apart = float(np.abs(fitted(s, 4)[:SOME] - looped(s, SOME)).max())
    for title, own in (("series of epochs", 4), ("series of epochs, the body's functions in common", 1)):
        yield raced(
            title,
            f"{PRISMS} prisms, {EPOCHS} epochs, 4 functions with covariance",
            {
                "catseye": Contender(lambda own=own: fitted(s, own)),  # type: ignore[misc]
                "numpy lstsq, a prism at a time": Contender(lambda: looped(s, SOME), SOME / PRISMS),
                LIMIT: Contender(lambda: limits.read(words)),
            },
            quick=quick,
            clock=time.process_time,
            note=f"largest difference {apart:.0e} m" if own == 4 else "numpy: all functions of each, no covariance",
        )


def curves(quick: bool) -> Iterator[Curve]:
    """Seconds against epochs."""
    with threadpool_limits(limits=1):
        scenes = [scene(epochs) for epochs in GROWING]
        seconds = [limits.median_seconds(lambda s=s: fitted(s, 4), 3) for s in scenes]  # type: ignore[misc]
    yield Curve("series of epochs", f"{PRISMS} prisms", "epochs", GROWING, tuple(seconds))


if __name__ == "__main__":
    main(rows, curves)
