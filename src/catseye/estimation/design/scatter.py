"""Scatter of a planned network: the truth drawn from the priors, measured with noise, and solved, many times."""

from collections.abc import Callable

import numpy as np

from catseye.aliases import Array
from catseye.estimation.design.network import LEAST_U_SCALE, LEAST_U_ZERO, DesignNetwork, DesignPrediction

ITERATIONS = 4  # steps with the matrix of the nominal places: each takes away all but a ten-thousandth of an error
ROWS = 2_000_000  # of ranges times runs, at once


def drawn_errors(
    prediction: DesignPrediction, runs: int, *, seed: int, progress: Callable[[int], None] | None = None
) -> Array:
    """Errors (runs, n, 3) m of the estimated places of a planned network.

    prediction   of the network
    runs         number of simulated measurements
    seed         of the generator
    progress     called with the runs done

    In every run the points, zeros and the scale are drawn from their priors, ranges are the true distances with them
    and with noise as claimed, and the non-linear estimate starts from the nominal places.
    """
    generator = np.random.default_rng(seed)
    chunk = max(1, ROWS // max(len(prediction.network.pairs), 1))
    errors = np.empty((runs, *prediction.network.points.shape))
    for low in range(0, runs, chunk):
        high = min(low + chunk, runs)
        errors[low:high] = _runs(prediction, high - low, generator)
        if progress is not None:
            progress(high)
    return errors


def _runs(prediction: DesignPrediction, runs: int, generator: np.random.Generator) -> Array:
    network, count = prediction.network, len(prediction.network.rangers)
    shifts = _drawn_shifts(network, runs, generator)
    u_others = np.append(np.maximum(network.u_zero, LEAST_U_ZERO), max(network.u_scale, LEAST_U_SCALE))
    others = generator.normal(size=(count + 1, runs)) * u_others[:, None]
    noise = generator.normal(size=(len(network.pairs), runs)) / np.sqrt(prediction.sights.weight)[:, None]
    observed = _ranges(network, shifts, others)[0] + noise
    x, y = np.zeros_like(shifts), np.zeros_like(others)
    ranger, target = network.pairs.T
    for _ in range(ITERATIONS):
        computed, distance, unit = _ranges(network, x, y)
        weighted = (observed - computed) * prediction.sights.weight[:, None]
        along = unit * weighted[:, None, :]
        right = -np.einsum("nij,njr->nir", network.information, x)
        np.add.at(right, target, along)
        np.add.at(right, network.rangers[ranger], -along)
        for unit_ in network.units:
            rows = list(unit_.points)
            right[rows] -= (unit_.information @ x[rows].reshape(-1, runs)).reshape(len(rows), 3, runs)
        lower = -y / u_others[:, None] ** 2
        np.add.at(lower, ranger, weighted)
        lower[-1] += np.sum(weighted * distance, axis=0)
        step, others_step = prediction.across(right, lower)
        x, y = x + step, y + others_step
    return np.asarray(np.moveaxis(x - shifts, 2, 0))


def _ranges(network: DesignNetwork, shifts: Array, others: Array) -> tuple[Array, Array, Array]:
    """Ranges and distances (m, runs), and unit vectors (m, 3, runs), of shifted points (n, 3, runs)."""
    ranger, target = network.pairs.T
    at = network.rangers[ranger]
    along = (network.points[target] - network.points[at])[:, :, None] + shifts[target] - shifts[at]
    distance = np.sqrt(np.sum(along * along, axis=1))
    return distance * (1.0 + others[-1]) + others[ranger], distance, along / distance[:, None, :]


def _drawn_shifts(network: DesignNetwork, runs: int, generator: np.random.Generator) -> Array:
    """Shifts (n, 3, runs) m of the points from their nominal places, by their priors and ties."""
    shifts = np.empty((*network.points.shape, runs))
    border = np.zeros((len(network.rangers), 3, 3))
    for rows, tie in ((network.rangers[:, None], border), *network.batches):
        blocks = tie.copy()
        for k in range(rows.shape[1]):
            blocks[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += network.information[rows[:, k]]
        root = np.linalg.cholesky(np.linalg.inv(blocks))
        drawn = root @ generator.normal(size=(*root.shape[:2], runs))
        shifts[rows.ravel()] = drawn.reshape(-1, 3, runs)
    return shifts
