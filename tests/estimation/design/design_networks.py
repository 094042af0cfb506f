"""Networks of a few rangers and targets for tests of designs, and their covariance by one dense inverse."""

import numpy as np

from catseye.estimation.design.network import DesignNetwork, RangeVariance, TiedPoints


def few(seed=1, rangers=6, targets=9, triplets=2):
    """Rangers in a ring of 100 m, the last two ranging to each other, single targets and tied triples above them."""
    generator = np.random.default_rng(seed)
    count = rangers + targets + 3 * triplets
    points = np.zeros((count, 3))
    angle = np.arange(rangers)
    points[:rangers] = np.stack([100 * np.cos(angle), 100 * np.sin(angle), generator.normal(0, 1, rangers)], axis=1)
    points[rangers:] = generator.normal((0, 0, 20), 30, (count - rangers, 3))
    pairs = [(r, t) for r in range(rangers) for t in range(rangers, count) if generator.random() < 0.95]
    pairs += [(r, q) for r in (rangers - 2, rangers - 1) for q in (rangers - 2, rangers - 1) if q != r]
    information = np.repeat(np.eye(3)[None] / 0.01**2, count, axis=0)
    information[: rangers - 2] = np.eye(3) / 1e-4**2
    row = np.hstack([np.eye(3), -0.5 * np.eye(3), -0.5 * np.eye(3)])
    units = tuple(
        TiedPoints(tuple(rangers + targets + 3 * k + i for i in range(3)), row.T @ row / 5e-5**2)
        for k in range(triplets)
    )
    return DesignNetwork(
        points=points,
        rangers=np.arange(rangers),
        pairs=np.array(pairs),
        claim=RangeVariance(3e-5, 3e-7),
        information=information,
        u_zero=np.full(rangers, 1e-5),
        u_scale=3e-7,
        units=units,
    )


def dense_covariance(network):
    """Covariance of coordinates, zeros and scale by one inverse of the whole, row by row of the ranges."""
    count, rangers = len(network.points), len(network.rangers)
    normal = np.zeros((3 * count + rangers + 1,) * 2)
    for i, block in enumerate(network.information):
        normal[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += block
    for unit in network.units:
        at = np.concatenate([3 * i + np.arange(3) for i in unit.points])
        normal[np.ix_(at, at)] += unit.information
    normal[range(3 * count, 3 * count + rangers), range(3 * count, 3 * count + rangers)] += 1 / network.u_zero**2
    normal[-1, -1] += 1 / network.u_scale**2
    for ranger, target in network.pairs:
        here = network.rangers[ranger]
        along = network.points[target] - network.points[here]
        distance = np.linalg.norm(along)
        row = np.zeros(len(normal))
        row[3 * target : 3 * target + 3] += along / distance
        row[3 * here : 3 * here + 3] -= along / distance
        row[3 * count + ranger], row[-1] = 1.0, distance
        normal += np.outer(row, row) / (3e-5**2 + (3e-7 * distance) ** 2)
    scale = 1 / np.sqrt(np.diag(normal))
    return np.linalg.inv(normal * scale[:, None] * scale) * scale[:, None] * scale
