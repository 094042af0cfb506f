"""The plain numpy form of the positions' least squares: a safeguarded descent, and the judgement of where it ended."""

from dataclasses import dataclass, fields

import numpy as np

from catseye.estimation.network.positions.start import SIGNIFICANT, Starts
from catseye.estimation.network.positions.status import PositionStatus

ENOUGH = 1e-4  # sigmas: the next step foreseen is smaller, so the answer stands; 1 nm where 10 um are claimed
SINGULAR = 1e-15  # determinant over cubed trace of a normal matrix that holds no digit
BENT = 0.25  # sigmas that the ranges' curvature moves them over one sigma of the position: above, no ellipsoid
CONTRADICTION = 10.0  # root mean square residual in sigmas, per degree of freedom, that no honest noise makes
MISSED = 5.0  # the same, per range, where the target's height is not held
ROUNDING, NOTHING = 1.0 + 1e-12, 1e-6  # of a sum of squares: a growth below these is no step uphill
OFF = 1e-3  # of the ranges: a start at least so high, for in the plane itself nothing says which way is up
CAP, CAP_UNDAMPED = 100, 8  # evaluations; from the closed form one or two are usual


@dataclass(frozen=True, eq=False)
class Ranges:
    """What k targets are found from: stations (s, 3) m; d (k, s) m, 0 where missing; u (1 or k, s) m, infinite there;
    count (k,) of the ranges that are there."""

    stations: np.ndarray
    d: np.ndarray
    u: np.ndarray
    count: np.ndarray

    def of(self, lanes: np.ndarray) -> "Ranges":
        """Those of some of the targets."""
        u = self.u[lanes] if len(self.u) > 1 else self.u
        return Ranges(self.stations, self.d[lanes], u, self.count[lanes])


@dataclass(frozen=True, eq=False)
class Descent:
    """Ends of descents; `bend` is what BENT limits, `ended` False where a step undamped would not settle."""

    x: np.ndarray
    covariance: np.ndarray
    pvv: np.ndarray
    iterations: np.ndarray
    bend: np.ndarray
    ended: np.ndarray

    def where(self, first: np.ndarray, other: "Descent") -> "Descent":
        """This one's lanes where `first`, else the other's."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(Descent))
        return Descent(*(np.where(first.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in pairs))

    def put(self, lanes: np.ndarray, other: "Descent") -> None:
        """Another's ends in place of those of some lanes."""
        for f in fields(Descent):
            getattr(self, f.name)[lanes] = getattr(other, f.name)


def least_squares_positions(r: Ranges, start: Starts) -> tuple[Descent, np.ndarray]:
    """Ends (k) and status (k,) of targets that three ranges or more may hold.

    Undamped steps come first: uphill and down again they pass narrow valleys where damped ones creep. Where they do not
    go smoothly, damped ones go from both mirror images.
    """
    descent = descend(r, start.foot + (start.sign * start.height)[:, None] * start.normal, damped=False)
    good = descent.ended & (descent.bend < BENT) & (descent.pvv <= np.where(r.count > 3, _most(r.count), 1.0))
    good &= start.sign * start.height * _over(descent, start) > 0.0  # not over to the other image
    rest = np.flatnonzero(~good)
    status = np.full(len(r.d), PositionStatus.FOUND, dtype=np.int8)
    if len(rest):
        best, status[rest] = _better_image(r.of(rest), start.of(rest))
        descent.put(rest, best)
    return descent, status


def _over(descent: Descent, start: Starts) -> np.ndarray:
    """Heights (k,) of the ends over the stations' plane."""
    return np.sum((descent.x - start.foot) * start.normal, axis=1)


def _most(count: np.ndarray) -> np.ndarray:
    """The pvv above which ranges contradict each other."""
    return CONTRADICTION**2 * (count - 3.0)


def _better_image(r: Ranges, start: Starts) -> tuple[Descent, np.ndarray]:
    """Damped descents from both images; of them the one that the ranges, or else the side, tell, and its status."""
    up = np.maximum(start.height, OFF * np.sqrt(np.sum(r.d * r.d, axis=1) / r.count))[:, None] * start.normal
    one, two = descend(r, start.foot + up), descend(r, start.foot - up)
    gap = two.pvv - one.pvv
    decided = np.abs(gap) > SIGNIFICANT**2  # a difference of pvv is the square of sigmas
    spread = np.sqrt(np.maximum(np.trace(one.covariance, axis1=1, axis2=2), 0.0))
    same = np.linalg.norm(one.x - two.x, axis=1) <= 1e-3 * spread
    upper = _over(one, start) >= _over(two, start)  # a descent may pass over to the other side
    first = np.where(decided, gap > 0.0, upper == (start.side >= 0.0))
    best, other = one.where(first, two), two.where(first, one)
    status, second = _verdict(r, best), _verdict(r, other)
    open_ = ~decided & ~same & (start.side == 0.0) & (status <= PositionStatus.CONTRADICTING)
    status = np.where(open_, np.where(second <= PositionStatus.CONTRADICTING, PositionStatus.AMBIGUOUS, second), status)
    return best, status


def _verdict(r: Ranges, descent: Descent) -> np.ndarray:
    """Status of each descent's end, as if it had been the only one."""
    apart = np.linalg.norm(descent.x[:, None, :] - r.stations, axis=2)
    at_station = (apart < 4.0 * np.where(r.u < np.inf, r.u, 0.0)).any(axis=1)
    flat = ~(descent.bend < BENT)
    return np.select(
        [
            flat & at_station,
            flat & (descent.pvv > MISSED**2 * r.count),
            flat,
            ~descent.ended,
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
    """Normal matrix (0:6, upper rows), right side (6:9), cost (9), squared curvature (10) of lanes: (11, k).

    s (m, 3); d (m, k); root (m, k) or (m, 1), reciprocal sigmas; x (3, k)
    """
    delta = [x[c] - s[:, c : c + 1] for c in range(3)]
    f = delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2
    np.sqrt(f, out=f)
    np.maximum(f, 1e-150, out=f)  # on a station: a direction of zero length, an endless curvature
    v = (d - f) * root
    np.divide(root, f, out=f)
    a = [v_ * f for v_ in delta]
    pairs = [(a[0], a[0]), (a[0], a[1]), (a[0], a[2]), (a[1], a[1]), (a[1], a[2]), (a[2], a[2])]
    pairs += [(a[0], v), (a[1], v), (a[2], v), (v, v), (f, f)]
    return np.stack([np.einsum("mk,mk->k", p, q) for p, q in pairs])


def _inverse(n: np.ndarray, damping: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (6, k) of normal matrices (upper rows) with damping on the diagonal, and whether they are regular."""
    n0, n3, n5 = n[0] + damping, n[3] + damping, n[5] + damping
    n1, n2, n4 = n[1], n[2], n[4]
    q = np.stack(
        [n3 * n5 - n4**2, n2 * n4 - n1 * n5, n1 * n4 - n2 * n3, n0 * n5 - n2**2, n1 * n2 - n0 * n4, n0 * n3 - n1**2]
    )
    determinant = n0 * q[0] + n1 * q[1] + n2 * q[2]
    regular = determinant > SINGULAR * (n0 + n3 + n5) ** 3
    return q / np.where(regular, determinant, np.nan), regular


SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # where the six upper entries go


def _step(a: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The step (3, k) from normal equations and their inverses, what it gains, and the square of the step after it.

    That is foreseen from the curvature: (p + q)^2 <= 2 p^2 + 2 q^2 with p of the step and q of the residuals.
    """
    step = np.stack([np.sum(q[row] * a[6:9], axis=0) for row in SQUARE])
    square = np.sum(step * step, axis=0)
    foreseen = a[10] * square * (square / 2 + 2.0 * a[9] * (q[0] + q[3] + q[5]))
    return step, np.sum(step * a[6:9], axis=0), foreseen


def descend(r: Ranges, start: np.ndarray, *, damped: bool = True) -> Descent:
    """Gauss-Newton from start (k, 3), damped (or not) after Levenberg and Marquardt where a step would go uphill."""
    k, s = len(r.d), r.stations
    out = Descent(start.copy(), np.empty((k, 3, 3)), np.empty(k), np.zeros(k, int), np.empty(k), np.zeros(k, bool))
    lanes, x, damping = np.arange(k), np.ascontiguousarray(start.T), np.zeros(k)
    d, root = np.ascontiguousarray(r.d.T), np.ascontiguousarray(1.0 / r.u.T)
    a = _normal(s, d, root, x)
    cap = CAP if damped else CAP_UNDAMPED
    for taken in range(1, cap + 1):
        q, regular = _inverse(a, damping)
        step, gain, foreseen = _step(a, q)
        done = regular & np.where(damping == 0.0, foreseen < ENOUGH**2, gain < NOTHING**2)
        leaving = done | (taken == cap) | ~(regular | damped)
        if leaving.any():
            _leave(out, lanes[leaving], a[:, leaving], x[:, leaving], taken)
            stay = ~leaving
            lanes, damping, regular = lanes[stay], damping[stay], regular[stay]
            x, step, a, d = x[:, stay], step[:, stay], a[:, stay], d[:, stay]
            root = root[:, stay] if root.shape[1] > 1 else root
            if not len(lanes):
                break
        trial = np.where(regular, x + step, x)
        b = _normal(s, d, root, trial)
        better = regular & ((b[9] <= a[9] * ROUNDING + NOTHING) | (not damped))
        trace = a[0] + a[3] + a[5]
        damping = np.where(better, np.where(damping > 1e-8 * trace, damping / 10, 0.0), damping * 10)
        damping = np.where(better, damping, np.maximum(damping, 1e-4 * trace))
        x, a = np.where(better, trial, x), np.where(better, b, a)
    return out


def _leave(out: Descent, lanes: np.ndarray, a: np.ndarray, x: np.ndarray, taken: int) -> None:
    """What is known of lanes at the end of their descent; the last step is never damped, if it is worth taking."""
    q, regular = _inverse(a)
    step, gain, foreseen = _step(a, q)
    ended = regular & (foreseen < ENOUGH**2)
    out.x[lanes], out.covariance[lanes] = np.where(ended, x + step, x).T, q[SQUARE].transpose(2, 0, 1)
    out.pvv[lanes], out.iterations[lanes] = np.maximum(a[9] - np.where(ended, gain, 0.0), 0.0), taken
    out.bend[lanes] = np.where(regular, np.sqrt(a[10]) * (q[0] + q[3] + q[5]) / 2, np.inf)
    out.ended[lanes] = ended
