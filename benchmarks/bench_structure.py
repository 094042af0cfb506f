"""A series of epochs fitted: 2209 prisms in 1000 epochs, against one small least squares for each prism in a loop.

python benchmarks/bench_structure.py [PRISMS EPOCHS]
"""

import sys
import time

import numpy as np

from catseye.estimation.harmonic.series import Spread, fit_harmonics


def main(prisms: int = 2209, epochs: int = 1000) -> None:
    """Seconds, and how far the two ways lie apart."""
    rng = np.random.default_rng(0)
    elevation, warm = rng.uniform(0.1, 1.5, epochs), rng.normal(size=epochs)
    rows = np.stack([np.ones(epochs), np.sin(elevation), np.cos(elevation), warm], axis=1)
    arms = rng.uniform(-50.0, 50.0, (prisms, 3))
    points = np.eye(3) * 1e-8 * rng.uniform(0.5, 2.0, (epochs, prisms, 1, 1))
    truth = rng.normal(size=(prisms, 3, 4)) * 1e-3
    seen = np.einsum("tk,pik->tpi", rows, truth) + np.sqrt(points[..., 0, :1]) * rng.normal(size=(epochs, prisms, 3))
    for title, own in (("a place of each, the body's functions", 1), ("all functions of each", 4)):
        begun = time.perf_counter()
        found = fit_harmonics(seen, arms, body=rows[:, own:], own=rows[:, :own], spread=Spread(points=points))
        sys.stdout.write(f"{title}: {time.perf_counter() - begun:.2f} s for {prisms} prisms in {epochs} epochs" + "\n")
    some = min(prisms, 200)
    begun = time.perf_counter()
    apart = 0.0
    for p in range(some):
        root = np.linalg.inv(np.linalg.cholesky(points[:, p]))
        design = (root @ np.einsum("tf,ij->tifj", rows, np.eye(3)).reshape(epochs, 3, -1)).reshape(3 * epochs, -1)
        alone = np.linalg.lstsq(design, (root @ seen[:, p, :, None]).ravel(), rcond=None)[0]
        apart = max(apart, float(np.abs(found.own[p] - alone.reshape(4, 3).T).max()))
    loop = (time.perf_counter() - begun) * prisms / some
    sys.stdout.write(
        f"numpy's lstsq in a loop over prisms: {loop:.2f} s (from {some}); apart by {apart:.1e} m at most" + "\n"
    )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
