"""Derivative of a criterion with respect to all places, by one adjoint.

A criterion J of the covariance Q = N^-1 has dJ = tr(G dQ) = -tr(M dN) with M = Q G Q. A range with row h and weight w
adds w h h' to N, so that dJ = -sum of (dw h'M h + 2 w h'M dh). Only those blocks of M are formed that a range meets.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.estimation.design.network import DesignPrediction


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Value of a criterion and its derivatives with respect to the covariance.

    value     m^2
    blocks    (n, 3, 3) derivatives G by the points' covariances, symmetric
    columns   (n, 3, m) F, and
    weights   (m,) of a further part G = F diag(weights) F'; None without it
    explicit  (n, 3) derivative with respect to the places at constant covariance; None: none
    """

    value: float
    blocks: Array
    columns: Array | None = None
    weights: Array | None = None
    explicit: Array | None = None


def gradient(prediction: DesignPrediction, sensitivity: Sensitivity) -> Array:
    """Derivatives (n, 3) of a criterion with respect to the places.

    prediction    of the network
    sensitivity   of the criterion there

    Source: derivative of an inverse, d(N^-1) = -N^-1 dN N^-1, and the chain rule; derived above.
    """
    network, sights = prediction.network, prediction.sights
    unit, d, w = sights.unit, sights.distance, sights.weight
    ranger, target = network.pairs.T
    difference, scale_part, square = _adjoint_rows(prediction, sensitivity)
    along = np.sum(unit * difference, axis=1)
    across = (difference - unit * along[:, None]) / d[:, None]
    slopes = -(sights.slope * square)[:, None] * unit - 2.0 * w[:, None] * (across + scale_part[:, None] * unit)
    result = np.zeros(network.points.shape, dtype=slopes.dtype)
    np.add.at(result, target, slopes)
    np.add.at(result, network.rangers[ranger], -slopes)
    return result if sensitivity.explicit is None else result + sensitivity.explicit


def _adjoint_rows(prediction: DesignPrediction, sensitivity: Sensitivity) -> tuple[Array, Array, Array]:
    """Products of M and each range's row.

    Target's less ranger's coordinates (m, 3), scale (m,), and the whole square h'M h (m,).
    """
    network, sights = prediction.network, prediction.sights
    unit, d = sights.unit, sights.distance
    ranger, target = network.pairs.T
    border, lower, diagonal_blocks = _adjoint(prediction, sensitivity.blocks)
    count, three = len(network.rangers), np.arange(3)
    zero, scale = 3 * count + ranger, 4 * count
    here = 3 * ranger[:, None] + three
    other = network.ranger_of[target] >= 0
    column = network.column[target][:, None] + three
    place = np.where(other[:, None], column, 0)
    inner = np.where(other[:, None], 0, column)

    def to_target(columns: Array) -> Array:
        """Rows of the target's coordinates at a column of the border each, (m, 3)."""
        result = border[place, columns[:, None]]
        if len(lower):
            result = np.where(other[:, None], result, lower[inner, columns[:, None]])
        return result

    at_zero, at_scale = to_target(zero), to_target(np.full(len(ranger), scale))
    at_here = np.stack([to_target(here[:, k]) for k in range(3)], axis=2)  # (m, 3 target, 3 ranger)
    itself = np.where(
        other[:, None, None], border[place[:, :, None], place[:, None, :]], diagonal_blocks[np.where(other, 0, target)]
    )
    mine = border[here[:, :, None], here[:, None, :]]
    zero_here, scale_here = border[here, zero[:, None]], border[here, scale]
    v_target = _times(itself - at_here, unit) + at_zero + d[:, None] * at_scale
    v_ranger = _times(np.swapaxes(at_here, 1, 2) - mine, unit) + zero_here + d[:, None] * scale_here
    v_zero = np.sum((at_zero - zero_here) * unit, axis=1) + border[zero, zero] + d * border[zero, scale]
    v_scale = np.sum((at_scale - scale_here) * unit, axis=1) + border[zero, scale] + d * border[scale, scale]
    difference = v_target - v_ranger
    square = np.sum(unit * difference, axis=1) + v_zero + d * v_scale
    if sensitivity.columns is None or sensitivity.weights is None:
        return difference, v_scale, square
    points, others = prediction.across(sensitivity.columns)
    apart = points[target] - points[network.rangers[ranger]]
    row = np.einsum("mk,mkc->mc", unit, apart) + others[ranger] + d[:, None] * others[-1]
    weighted = row * sensitivity.weights
    return (
        difference + np.einsum("mkc,mc->mk", apart, weighted),
        v_scale + weighted @ others[-1],
        square + np.sum(row * weighted, axis=1),
    )


def _adjoint(prediction: DesignPrediction, blocks: Array) -> tuple[Array, Array, Array]:
    """Blocks of M = Q G Q, G of the points' own blocks: border (s, s), eliminated by border (3e, s), own (n, 3, 3)."""
    network, gain, border = prediction.network, prediction.gain, prediction.border
    size, count, three = len(border), len(network.rangers), np.arange(3)
    order = np.concatenate([rows.ravel() for rows, _ in network.batches] or [np.zeros(0, dtype=int)])
    weighted = np.einsum("sta,tab->stb", gain.reshape(size, -1, 3), blocks[order]).reshape(size, -1)
    middle = weighted @ gain.T
    first = (3 * np.arange(count))[:, None, None]
    middle[first + three[:, None], first + three] += blocks[network.rangers]
    adjoint = border @ middle @ border
    raised = adjoint @ gain
    lower = -raised.T
    diagonal_blocks = np.empty(blocks.shape, dtype=adjoint.dtype)
    low = 0
    for (rows, _), inverse in zip(network.batches, prediction.inverse, strict=True):
        number, width = inverse.shape[:2]
        part = slice(low, low + number * width)
        diagonal = np.zeros(inverse.shape, dtype=adjoint.dtype)
        for k in range(rows.shape[1]):
            diagonal[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = blocks[rows[:, k]]
        turned = inverse @ diagonal
        near = gain[:, part].reshape(size, number, width).transpose(1, 2, 0)
        far = prediction.carried[:, part].reshape(size, number, width).transpose(1, 0, 2)
        lower[part] -= (turned @ np.swapaxes(far, 1, 2)).reshape(number * width, size)
        mixed = turned @ (near @ far)
        block = near @ raised[:, part].reshape(size, number, width).transpose(1, 0, 2)
        block = block + turned @ inverse + mixed + np.swapaxes(mixed, 1, 2)
        for k in range(rows.shape[1]):
            diagonal_blocks[rows[:, k]] = block[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        low += number * width
    diagonal_blocks[network.rangers] = adjoint[first + three[:, None], first + three]
    return adjoint, lower, diagonal_blocks


def _times(matrices: Array, vectors: Array) -> Array:
    """Products (m, 3) of matrices (m, 3, 3) and vectors (m, 3)."""
    return np.asarray(np.einsum("mab,mb->ma", matrices, vectors))
