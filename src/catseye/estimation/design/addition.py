"""Predicted covariance of a network with one ranger more, by a low-rank update."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.estimation.design.network import LEAST_U_ZERO, DesignNetwork, DesignPrediction


@dataclass(frozen=True, eq=False)
class AddedRanger:
    """Prediction of a network with one ranger more, for criteria of the network's own points.

    network      without it
    covariance   (n, 3, 3) m^2, of the network's points
    base         prediction without it
    product      (n, 3, c) covariance of coordinates with its c ranges, without it
    lower        (R + 1, c) of zeros and scale with them
    inverse      (c, c) 1/m^2, inverse covariance of its ranges as predicted without it
    """

    network: DesignNetwork
    covariance: Array
    base: DesignPrediction
    product: Array
    lower: Array
    inverse: Array

    def across(self, columns: Array) -> tuple[Array, Array]:
        """Products (n, 3, m) of the covariance and columns (n, 3, m) of coordinates, and (R + 1, m) of the others."""
        points, others = self.base.across(columns)
        flat = self.product.reshape(-1, self.product.shape[-1])
        share = self.inverse @ (flat.T @ columns.reshape(len(flat), -1))
        return points - (flat @ share).reshape(columns.shape), others - self.lower @ share


def with_ranger(
    prediction: DesignPrediction, place: Array, targets: NDArray[np.int64], *, u: Array, u_zero: float
) -> AddedRanger | DesignPrediction:
    """DesignPrediction with a ranger at a place that ranges to some targets.

    place     (3,) m
    targets   rows of the points, each once
    u         (3,) m, prior of its coordinates
    u_zero    m, of its zero

    Its own coordinates and zero enter as correlated errors of its ranges, which gives the same as to estimate them.
    Source: update of a covariance by further observations, Q - Q H' (R + H Q H')^-1 H Q.
    """
    network = prediction.network
    if not len(targets):
        return prediction
    along = network.points[targets] - place
    distance = np.sqrt(np.sum(along**2, axis=1))
    unit = along / distance[:, None]
    count = len(targets)
    columns = np.zeros((len(network.points), 3, count))
    columns[targets, :, np.arange(count)] = unit
    others = np.zeros((len(network.rangers) + 1, count))
    others[-1] = distance
    product, lower = prediction.across(columns, others)
    predicted = np.einsum("mk,mkc->mc", unit, product[targets]) + distance[:, None] * lower[-1]
    along_u = unit * np.asarray(u)
    total = predicted + along_u @ along_u.T + max(u_zero, LEAST_U_ZERO) ** 2 + np.diag(network.claim.variance(distance))
    inverse = np.linalg.inv(0.5 * (total + total.T))
    covariance = prediction.covariance - (product @ inverse) @ np.swapaxes(product, 1, 2)
    return AddedRanger(
        network=network, covariance=covariance, base=prediction, product=product, lower=lower, inverse=inverse
    )
