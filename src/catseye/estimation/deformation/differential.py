"""Point movements from range changes, with approximate stations and points.

Optionally constrained.

A change of range is the exact difference of two distances, without linearisation: with P the point's and S the
station's approximate position, change = |P + dx - S| - |P - S|. An error e of a position changes the predicted change
by (u' - u).e, u and u' the unit vectors before and after, about |dx across| |e| / distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.shapes.rigid_body import motion_columns

DETERMINED = "determined"
UNDETERMINED = "undetermined: {rank} of {count} directions observed by {channels} channels"
NOT_CONVERGED = "not converged: the change is too large for a movement near the approximate position"
ITERATIONS = 30
STEP = 1e-12  # of the mean distance: rounding limit
RANK = 1e-10  # of the largest eigenvalue of the scaled normal matrix


@dataclass(frozen=True, eq=False)
class GroupMovements:
    """Movements of one group of n points with q free parameters, for any batch of epochs (...).

    displacement            (..., n, 3) m; nan where undetermined
    covariance              (..., 3n, 3n) m^2, sum of the three below
    noise                   (..., 3n, 3n) m^2, from the range changes
    approximation           (..., 3n, 3n) m^2, from the approximate coordinates, common to all epochs
    violation               (..., 3n, 3n) m^2, from movement in directions that the constraint excludes
    parameters              (..., q), coefficients of the columns of `basis`
    parameters_covariance   (..., q, q), from the range changes
    basis                   (3n, q)
    sensitivity_points      (..., 3n, 3n) d displacement / d approximate points
    sensitivity_stations    (..., 3n, 3s) d displacement / d approximate stations
    resolution              (..., 3n, 3n) H, response to a small true movement; (H - 1) times a movement that violates
                            the constraint is its bias
    common                  (..., c) estimates of the common errors, in their standard uncertainties
    common_covariance       (..., c, c)
    residual                (..., n, s) m, observed minus predicted change; nan for missing channels
    pvv                     (...) weighted sum of squares, the common errors' own among them
    degrees_of_freedom      (...) channels less parameters
    rank                    (...) of q
    status                  (...) text: "determined", or the reason why not
    """

    displacement: np.ndarray
    covariance: np.ndarray
    noise: np.ndarray
    approximation: np.ndarray
    violation: np.ndarray
    parameters: np.ndarray
    parameters_covariance: np.ndarray
    basis: np.ndarray
    sensitivity_points: np.ndarray
    sensitivity_stations: np.ndarray
    resolution: np.ndarray
    common: np.ndarray
    common_covariance: np.ndarray
    residual: np.ndarray
    pvv: np.ndarray
    degrees_of_freedom: np.ndarray
    rank: np.ndarray
    status: np.ndarray

    def bias(self, movement: np.ndarray) -> np.ndarray:
        """Bias (..., n, 3) m of the result for a true movement (n, 3) m outside the constraint."""
        movement = np.asarray(movement, dtype=float)
        reported = (self.resolution @ movement.ravel()).reshape(*self.resolution.shape[:-2], -1, 3)
        return reported - movement


def change_of_range(stations: np.ndarray, points: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Exact change (..., s) m of the distances from stations to moving points.

    stations       (s, 3) m
    points         (..., 3) m, before
    displacement   (..., 3) m

    (2 a + dx).dx / (|a| + |a + dx|), a from the station to the point: free of cancellation.

    >>> change_of_range(np.zeros((1, 3)), np.array([3.0, 0.0, 0.0]), np.array([0.0, 4.0, 0.0]))
    array([2.])
    """
    arm = np.asarray(points, dtype=float)[..., None, :] - stations
    step = np.asarray(displacement, dtype=float)[..., None, :]
    total = np.linalg.norm(arm, axis=-1) + np.linalg.norm(arm + step, axis=-1)
    return np.sum((2.0 * arm + step) * step, axis=-1) / total


def allowed_directions(
    points: int, *, allowed: np.ndarray | None = None, forbidden: np.ndarray | None = None
) -> np.ndarray:
    """Basis (3n, q) of movements of n points along allowed or across forbidden directions.

    points      n
    allowed     (k, 3) directions, the same for all points, or
    forbidden   (k, 3) directions in which no point moves, such as the vertical of a bearing weldment

    >>> allowed_directions(1, forbidden=np.array([[0.0, 0.0, 1.0]])).shape  # moves in the plane
    (3, 2)
    """
    if (allowed is None) == (forbidden is None):
        raise EstimationError("give either the allowed or the forbidden directions")
    rows = np.atleast_2d(np.asarray(forbidden if allowed is None else allowed, dtype=float))
    if rows.shape[-1] != 3 or not np.isfinite(rows).all() or not rows.any():
        raise EstimationError(f"directions have shape {rows.shape}, expected (k, 3), finite and not zero")
    _, s, vt = np.linalg.svd(rows)
    rank = int(np.sum(s > 1e-9 * s[0]))
    directions = vt[rank:] if allowed is None else vt[:rank]
    return np.kron(np.eye(points), directions.T)


def rigid_group(points: np.ndarray, motions: Sequence[int] = range(6), pivot: np.ndarray | None = None) -> np.ndarray:
    """Basis (3n, q) of rigid movements of points (n, 3) m: translation and rotation (rad), or a selection.

    For small rotations: second order, arm rotation^2 / 2, is neglected. The pivot (3,) m defaults to the centroid.
    """
    points = np.asarray(points, dtype=float)
    centre = points.mean(axis=0) if pivot is None else np.asarray(pivot, dtype=float)
    return motion_columns(points, centre)[:, list(motions)]


def constrained(  # noqa: PLR0913 - places, changes, and what is known of each
    approximate_stations: np.ndarray,
    approximate_points: np.ndarray,
    range_changes: np.ndarray,
    *,
    sigma: np.ndarray | float,
    basis: np.ndarray,
    u_stations: np.ndarray | float = 0.0,
    u_points: np.ndarray | float = 0.0,
    u_violation: float = 0.0,
    common: np.ndarray | None = None,
) -> GroupMovements:
    """Movements of a group of points restricted to a linear subspace.

    approximate_stations   (s, 3) m
    approximate_points     (..., n, 3) m, before the movement
    range_changes          (..., n, s) m, after less before; nan where missing
    sigma                  broadcasts to (..., n, s), m; inf or nan leaves a channel out
    basis                  (3n, q), from `allowed_directions`, `rigid_group` or other
    u_stations, u_points   m, standard uncertainty of approximate coordinates: one value, (s,) and (n,), or with 3
    u_violation            m, standard uncertainty of movement in each excluded direction: an unknown bias in the
                           budget, not in the weights
    common                 broadcasts to (..., n, s, c), m: effect on each channel of one standard uncertainty of c
                           errors that channels share, such as the air's; estimated, each with a prior of one

    The gain by the constraint shows in the covariance compared with that of free points, `basis` the unit matrix; the
    error if it is violated, in `bias`. Raises EstimationError for wrong shapes, a basis with linearly dependent
    columns, or a point that coincides with a station.

    Source: [PARKER04] 3.2.4 and 3.2.5, exact differences and error budget ours; [FOERSTNER16] chapter 4 (Gauss-Markov
    model with constraints, here by elimination).
    """
    stations, points, changes, weight, basis = _checked(
        approximate_stations, approximate_points, range_changes, sigma, basis
    )
    batch, (n, s), q = changes.shape[:-2], changes.shape[-2:], basis.shape[1]
    available = weight > 0.0
    shared = np.zeros((*batch, n, s, 0)) if common is None else np.asarray(common, dtype=float)
    shared = np.where(available[..., None], np.broadcast_to(shared, (*batch, n, s, shared.shape[-1])), 0.0)
    c = shared.shape[-1]
    prior = np.diag(np.concatenate([np.zeros(q), np.ones(c)]))
    theta, size = np.zeros((*batch, q + c)), np.full(batch, np.inf)
    limit = STEP * float(np.linalg.norm(points[..., None, :] - stations, axis=-1).mean())
    for _ in range(ITERATIONS):
        moved = (theta[..., :q] @ basis.T).reshape(*batch, n, 3)
        offset = np.einsum("...nsc,...c->...ns", shared, theta[..., q:])
        residual = np.where(available, changes - change_of_range(stations, points, moved) - offset, 0.0)
        unit, turned = _directions(stations, points, moved)
        along = np.einsum("...nsi,niq->...nsq", unit, basis.reshape(n, 3, q))
        design = np.concatenate([along, shared], axis=-1).reshape(*batch, n * s, q + c)
        inverse, rank = _inverse(np.swapaxes(design, -1, -2) @ (weight.reshape(*batch, n * s, 1) * design) + prior)
        gain = inverse @ np.swapaxes(design * weight.reshape(*batch, n * s, 1), -1, -2)
        step = (gain @ residual.reshape(*batch, n * s, 1))[..., 0] - (inverse @ (prior @ theta[..., None]))[..., 0]
        size = np.abs(step[..., :q] @ basis.T).max(axis=-1, initial=0.0)
        if np.all((size < limit) | (rank < q + c)):
            break
        theta = theta + np.where((rank == q + c)[..., None], step, 0.0)
    rank = np.maximum(rank - c, 0)
    displacement_gain = basis @ gain[..., :q, :]  # changes -> displacement
    approximation, by_points, by_stations = _from_places(displacement_gain, turned, u_stations, u_points)
    resolution = _onto_points(displacement_gain, unit)
    outside = (resolution - np.eye(3 * n)) @ _complement(basis)
    noise = basis @ inverse[..., :q, :q] @ basis.T
    violation = u_violation**2 * outside @ np.swapaxes(outside, -1, -2)
    good = (rank == q) & (size < limit)
    channels = available.sum(axis=(-1, -2))
    results = [np.where(good[..., None, None], a, np.nan) for a in (
        moved, noise + approximation + violation, noise, approximation, violation, inverse[..., :q, :q], by_points,
        by_stations, resolution, np.where(available, residual, np.nan), inverse[..., q:, q:],
    )]  # fmt: skip
    return GroupMovements(
        displacement=results[0],
        covariance=results[1],
        noise=results[2],
        approximation=results[3],
        violation=results[4],
        parameters=np.where(good[..., None], theta[..., :q], np.nan),
        parameters_covariance=results[5],
        basis=basis,
        sensitivity_points=results[6],
        sensitivity_stations=results[7],
        resolution=results[8],
        common=np.where(good[..., None], theta[..., q:], np.nan),
        common_covariance=results[10],
        residual=results[9],
        pvv=np.where(good, np.sum(weight * residual**2, axis=(-1, -2)) + np.sum(theta[..., q:] ** 2, axis=-1), np.nan),
        degrees_of_freedom=np.where(good, channels - q, 0),
        rank=rank,
        status=_statuses(good, rank, channels, q),
    )


def _statuses(good: np.ndarray, rank: np.ndarray, channels: np.ndarray, count: int) -> np.ndarray:
    """Status of each group: determined, or the reason why not."""
    status = np.full(good.shape, DETERMINED, dtype=object)
    for i in np.argwhere(~good):
        short = UNDETERMINED.format(rank=rank[tuple(i)], count=count, channels=channels[tuple(i)])
        status[tuple(i)] = short if rank[tuple(i)] < count else NOT_CONVERGED
    return status


def _checked(
    stations: np.ndarray, points: np.ndarray, changes: np.ndarray, sigma: np.ndarray | float, basis: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Validated float arrays, broadcast.

    Weights are zero where a change or its sigma is missing.
    """
    stations, points, changes, basis = (np.asarray(a, dtype=float) for a in (stations, points, changes, basis))
    s, n = len(stations), points.shape[-2] if points.ndim > 1 else 0
    if stations.shape != (s, 3) or points.shape[-1:] != (3,) or changes.shape[-2:] != (n, s):
        raise EstimationError(
            f"stations {stations.shape}, points {points.shape}, changes {changes.shape}: "
            "expected (s, 3), (..., n, 3) and (..., n, s)"
        )
    if not (np.isfinite(stations).all() and np.isfinite(points).all()):
        raise EstimationError("an approximate coordinate is not a number")
    if basis.ndim != 2 or basis.shape[0] != 3 * n or not np.isfinite(basis).all():
        raise EstimationError(f"the basis has shape {basis.shape}, expected ({3 * n}, q), finite")
    length = np.linalg.norm(basis, axis=0)
    if not length.all() or np.linalg.matrix_rank(basis / length) < basis.shape[1]:
        raise EstimationError(f"the {basis.shape[1]} columns of the basis are linearly dependent, or one is zero")
    sigma = np.asarray(sigma, dtype=float)
    if np.any(sigma <= 0.0):
        raise EstimationError(f"a range change has standard uncertainty {np.nanmin(sigma):.3g} m: it must be positive")
    batch = np.broadcast_shapes(points.shape[:-2], changes.shape[:-2], np.broadcast_shapes(sigma.shape, (n, s))[:-2])
    changes = np.broadcast_to(changes, (*batch, n, s))
    sigma = np.broadcast_to(sigma, (*batch, n, s))
    if np.min(np.linalg.norm(points[..., None, :] - stations, axis=-1)) == 0.0:
        raise EstimationError("a point coincides with a station: its range has no direction")
    available = np.isfinite(changes) & np.isfinite(sigma)
    weight = np.where(available, 1.0 / np.where(available, sigma, 1.0) ** 2, 0.0)
    return stations, np.broadcast_to(points, (*batch, n, 3)), np.where(available, changes, 0.0), weight, basis


def _directions(stations: np.ndarray, points: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (..., n, s, 3) after the movement, and their changes, free of cancellation."""
    before = points[..., None, :] - stations
    after = before + moved[..., None, :]
    old, new = (np.linalg.norm(a, axis=-1)[..., None] for a in (before, after))
    unit = after / new
    change = change_of_range(stations, points, moved)[..., None]
    return unit, (moved[..., None, :] - unit * change) / old


def _inverse(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse and rank of each normal matrix; pseudo-inverse if singular."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(normal, axis1=-2, axis2=-1), 1e-300))
    values, vectors = np.linalg.eigh(normal * scale[..., :, None] * scale[..., None, :])
    significant = values > RANK * np.maximum(values[..., -1:], 1e-300)
    significant &= values > 1e-12
    root = (
        vectors
        * np.sqrt(np.where(significant, 1.0 / np.where(significant, values, 1.0), 0.0))[..., None, :]
        * scale[..., :, None]
    )
    return root @ np.swapaxes(root, -1, -2), significant.sum(axis=-1)


def _onto_points(displacement_gain: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Derivatives (..., 3n, 3n) by the points' coordinates: gain times channel derivatives."""
    *batch, n, s, _ = vectors.shape
    gain = displacement_gain.reshape(*batch, 3 * n, n, s)
    return np.einsum("...ins,...nsj->...inj", gain, vectors).reshape(*batch, 3 * n, 3 * n)


def _from_places(
    displacement_gain: np.ndarray, turned: np.ndarray, u_stations: np.ndarray | float, u_points: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance from the approximate coordinates, and d displacement / d points, / d stations.

    A prediction at the true positions is (u' - u).(e_point - e_station) more than at the approximate ones, so the
    result is off by the gain times that; d / d approximate position, whose error is minus e, has the opposite sign.
    """
    *batch, n, s, _ = turned.shape
    gain = displacement_gain.reshape(*batch, 3 * n, n, s)
    to_points = -_onto_points(displacement_gain, turned)
    to_stations = np.einsum("...ins,...nsj->...isj", gain, turned).reshape(*batch, 3 * n, 3 * s)
    q = sum(
        (slope * _variances(u, count, name)) @ np.swapaxes(slope, -1, -2)
        for slope, u, count, name in ((to_points, u_points, n, "u_points"), (to_stations, u_stations, s, "u_stations"))
    )
    return np.asarray(q), to_points, to_stations


def _variances(u: np.ndarray | float, count: int, name: str) -> np.ndarray:
    u = np.asarray(u, dtype=float)
    if u.shape not in ((), (count,), (count, 3)) and not (count == 1 and u.shape == (3,)):
        raise EstimationError(f"{name} has shape {u.shape}, expected (), ({count},) or ({count}, 3)")
    if not (np.isfinite(u).all() and np.all(u >= 0.0)):
        raise EstimationError(f"{name} must be finite and not negative")
    return np.broadcast_to(u[:, None] if u.shape == (count,) else u, (count, 3)).ravel() ** 2


def _complement(basis: np.ndarray) -> np.ndarray:
    """Orthonormal base of the orthogonal complement of the columns."""
    u, _, _ = np.linalg.svd(basis)
    return u[:, basis.shape[1] :]
