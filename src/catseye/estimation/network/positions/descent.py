"""Plain numpy least squares of the positions: safeguarded descent, and status of its end."""

from dataclasses import dataclass, fields

import numpy as np

from catseye.estimation.network.positions.start import SIGNIFICANT, Starts
from catseye.estimation.network.positions.status import PositionStatus

ENOUGH = 1e-4  # sigmas: limit of the predicted next step; 1 nm for a sigma of 10 um
SINGULAR = 1e-15  # determinant over cubed trace of a numerically singular normal matrix
BENT = 0.25  # change of the ranges, in sigmas, by curvature over one sigma of the position: above it no ellipsoid
CONTRADICTION = 10.0  # root mean square residual in sigmas, per degree of freedom, beyond noise
MISSED = 5.0  # the same, per range, if the target's height is undetermined
ROUNDING, NEGLIGIBLE = 1.0 + 1e-12, 1e-6  # of a sum of squares: a smaller increase is accepted
OFF = 1e-3  # of the ranges: minimum height of a start, as the plane itself gives no direction
CAP, CAP_UNDAMPED = 100, 8  # evaluations; from the closed form one or two are usual


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of k targets: stations (s, 3) m, d (k, s) m, u (1 or k, s) m, count (k,).

    A missing range has d 0 and infinite u; count is the number of ranges present.
    """

    stations: np.ndarray
    d: np.ndarray
    u: np.ndarray
    count: np.ndarray

    def of(self, lanes: np.ndarray) -> "Ranges":
        """Ranges of selected targets."""
        u = self.u[lanes] if len(self.u) > 1 else self.u
        return Ranges(self.stations, self.d[lanes], u, self.count[lanes])


@dataclass(frozen=True, eq=False)
class Descent:
    """Ends of descents.

    `bend` is compared with BENT, `settled` is False if an undamped step would not settle.
    """

    x: np.ndarray
    covariance: np.ndarray
    pvv: np.ndarray
    iterations: np.ndarray
    bend: np.ndarray
    settled: np.ndarray

    def where(self, first: np.ndarray, alternative: "Descent") -> "Descent":
        """Lanes of this one if `first`, else of the other."""
        pairs = {f.name: (getattr(self, f.name), getattr(alternative, f.name)) for f in fields(Descent)}
        return Descent(
            **{name: np.where(first.reshape(-1, *[1] * (a.ndim - 1)), a, b) for name, (a, b) in pairs.items()}
        )

    def replace_lanes(self, lanes: np.ndarray, source: "Descent") -> None:
        """Replace some lanes by another descent's ends."""
        for f in fields(Descent):
            getattr(self, f.name)[lanes] = getattr(source, f.name)


def least_squares_positions(r: Ranges, start: Starts) -> tuple[Descent, np.ndarray]:
    """Ends (k) and status (k,) of targets with three or more ranges.

    Undamped steps are tried first: they pass narrow valleys in which damped ones are slow. If they fail, damped steps
    start from both mirror images.
    """
    descent = descend(r, start.foot + (start.sign * start.height)[:, None] * start.normal, damped=False)
    good = descent.settled & (descent.bend < BENT) & (descent.pvv <= np.where(r.count > 3, _most(r.count), 1.0))
    good &= start.sign * start.height * _over(descent, start) > 0.0  # not on the other image's side
    difficult = np.flatnonzero(~good)
    status = np.full(len(r.d), PositionStatus.FOUND, dtype=np.int8)
    if len(difficult):
        best, status[difficult] = _better_image(r.of(difficult), start.of(difficult))
        descent.replace_lanes(difficult, best)
    return descent, status


def _over(descent: Descent, start: Starts) -> np.ndarray:
    """Heights (k,) of the ends over the stations' plane."""
    return np.sum((descent.x - start.foot) * start.normal, axis=1)


def _most(count: np.ndarray) -> np.ndarray:
    """Limit of pvv for contradicting ranges."""
    return CONTRADICTION**2 * (count - 3.0)


def _better_image(r: Ranges, start: Starts) -> tuple[Descent, np.ndarray]:
    """Damped descents from both images.

    Returns the better one by ranges or side, and its status.
    """
    up = np.maximum(start.height, OFF * np.sqrt(np.sum(r.d * r.d, axis=1) / r.count))[:, None] * start.normal
    one, two = descend(r, start.foot + up), descend(r, start.foot - up)
    gap = two.pvv - one.pvv
    decided = np.abs(gap) > SIGNIFICANT**2  # a difference of pvv is the square of sigmas
    spread = np.sqrt(np.maximum(np.trace(one.covariance, axis1=1, axis2=2), 0.0))
    coincident = np.linalg.norm(one.x - two.x, axis=1) <= 1e-3 * spread
    upper = _over(one, start) >= _over(two, start)  # a descent may change sides
    first = np.where(decided, gap > 0.0, upper == (start.side >= 0.0))
    best, alternative = one.where(first, two), two.where(first, one)
    status, second = _verdict(r, best), _verdict(r, alternative)
    open_ = ~decided & ~coincident & (start.side == 0.0) & (status <= PositionStatus.CONTRADICTING)
    status = np.where(open_, np.where(second <= PositionStatus.CONTRADICTING, PositionStatus.AMBIGUOUS, second), status)
    return best, status


def _verdict(r: Ranges, descent: Descent) -> np.ndarray:
    """Status of each descent's end, taken by itself."""
    apart = np.linalg.norm(descent.x[:, None, :] - r.stations, axis=2)
    at_station = (apart < 4.0 * np.where(r.u < np.inf, r.u, 0.0)).any(axis=1)
    flat = ~(descent.bend < BENT)
    return np.select(
        [
            flat & at_station,
            flat & (descent.pvv > MISSED**2 * r.count),
            flat,
            ~descent.settled,
            (r.count > 3) & (descent.pvv > _most(r.count)),
        ],
        [
            PositionStatus.AT_STATION,
            PositionStatus.DISJOINT,
            PositionStatus.NOT_HELD,
            PositionStatus.NOT_CONVERGED,
            PositionStatus.CONTRADICTING,
        ],
        PositionStatus.FOUND,
    )


def _normal(s: np.ndarray, d: np.ndarray, root: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Normal matrix (0:6), right-hand side (6:9), cost (9), squared curvature (10): (11, k).

    The matrix is given by its upper rows.

    s (m, 3); d (m, k); root (m, k) or (m, 1), reciprocal sigmas; x (3, k)
    """
    delta = [x[c] - s[:, c : c + 1] for c in range(3)]
    f = delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2
    np.sqrt(f, out=f)
    np.maximum(f, 1e-150, out=f)  # on a station: zero direction, infinite curvature
    v = (d - f) * root
    np.divide(root, f, out=f)
    a = [v_ * f for v_ in delta]
    pairs = [(a[0], a[0]), (a[0], a[1]), (a[0], a[2]), (a[1], a[1]), (a[1], a[2]), (a[2], a[2])]
    pairs += [(a[0], v), (a[1], v), (a[2], v), (v, v), (f, f)]
    return np.stack([np.einsum("mk,mk->k", p, q) for p, q in pairs])


def _inverse(n: np.ndarray, damping: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (6, k) of damped normal matrices (upper rows), and mask of regular ones."""
    n0, n3, n5 = n[0] + damping, n[3] + damping, n[5] + damping
    n1, n2, n4 = n[1], n[2], n[4]
    q = np.stack(
        [n3 * n5 - n4**2, n2 * n4 - n1 * n5, n1 * n4 - n2 * n3, n0 * n5 - n2**2, n1 * n2 - n0 * n4, n0 * n3 - n1**2]
    )
    determinant = n0 * q[0] + n1 * q[1] + n2 * q[2]
    regular = determinant > SINGULAR * (n0 + n3 + n5) ** 3
    return q / np.where(regular, determinant, np.nan), regular


SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # positions of the six upper entries


def _step(a: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Step (3, k) of the normal equations, its gain, and the squared predicted next step.

    The prediction uses the curvature: (p + q)^2 <= 2 p^2 + 2 q^2 with p of the step and q of the residuals.
    """
    step = np.stack([np.sum(q[row] * a[6:9], axis=0) for row in SQUARE])
    square = np.sum(step * step, axis=0)
    foreseen = a[10] * square * (square / 2 + 2.0 * a[9] * (q[0] + q[3] + q[5]))
    return step, np.sum(step * a[6:9], axis=0), foreseen


def descend(r: Ranges, start: np.ndarray, *, damped: bool = True) -> Descent:
    """Gauss-Newton from start (k, 3), with Levenberg-Marquardt damping if `damped`."""
    k, s = len(r.d), r.stations
    out = Descent(
        x=start.copy(),
        covariance=np.empty((k, 3, 3)),
        pvv=np.empty(k),
        iterations=np.zeros(k, int),
        bend=np.empty(k),
        settled=np.zeros(k, bool),
    )
    lanes, x, damping = np.arange(k), np.ascontiguousarray(start.T), np.zeros(k)
    d, root = np.ascontiguousarray(r.d.T), np.ascontiguousarray(1.0 / r.u.T)
    a = _normal(s, d, root, x)
    cap = CAP if damped else CAP_UNDAMPED
    for iteration in range(1, cap + 1):
        q, regular = _inverse(a, damping)
        step, gain, foreseen = _step(a, q)
        finished = regular & np.where(damping == 0.0, foreseen < ENOUGH**2, gain < NEGLIGIBLE**2)
        leaving = finished | (iteration == cap) | ~(regular | damped)
        if leaving.any():
            _leave(out, lanes[leaving], a[:, leaving], x[:, leaving], iteration)
            stay = ~leaving
            lanes, damping, regular = lanes[stay], damping[stay], regular[stay]
            x, step, a, d = x[:, stay], step[:, stay], a[:, stay], d[:, stay]
            root = root[:, stay] if root.shape[1] > 1 else root
            if not len(lanes):
                break
        trial = np.where(regular, x + step, x)
        b = _normal(s, d, root, trial)
        better = regular & ((b[9] <= a[9] * ROUNDING + NEGLIGIBLE) | (not damped))
        trace = a[0] + a[3] + a[5]
        damping = np.where(better, np.where(damping > 1e-8 * trace, damping / 10, 0.0), damping * 10)
        damping = np.where(better, damping, np.maximum(damping, 1e-4 * trace))
        x, a = np.where(better, trial, x), np.where(better, b, a)
    return out


def _leave(out: Descent, lanes: np.ndarray, a: np.ndarray, x: np.ndarray, iteration: int) -> None:
    """Store lanes at the end of their descent.

    A last undamped step is included if it settles.
    """
    q, regular = _inverse(a)
    step, gain, foreseen = _step(a, q)
    settled = regular & (foreseen < ENOUGH**2)
    out.x[lanes], out.covariance[lanes] = np.where(settled, x + step, x).T, q[SQUARE].transpose(2, 0, 1)
    out.pvv[lanes], out.iterations[lanes] = np.maximum(a[9] - np.where(settled, gain, 0.0), 0.0), iteration
    out.bend[lanes] = np.where(regular, np.sqrt(a[10]) * (q[0] + q[3] + q[5]) / 2, np.inf)
    out.settled[lanes] = settled
