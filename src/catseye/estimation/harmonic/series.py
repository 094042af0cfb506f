"""Points of a body in many epochs: rigid motion and point shifts, linear in functions of the epoch.

The displacement of point p in epoch t is

    y_tp = R_p C b_t + A_p o_t + U_tp z_t + e_tp,      R_p = (1, -[arm_p] x),

C (6, K) shifts and turns of the body for each of its K functions b_t, A_p (3, m) shifts of the point's own for each of
its m functions o_t, e_tp noise with a covariance (3, 3) of each point, and U_tp z_t effects shared by the points of an
epoch (z_t standard normal, r of them: a common refractivity, an unmodelled body motion). Small rotations: arms of 100 m
rotated by 1e-4 rad are off by half a micrometre.

With a full covariance of each epoch all unknowns are solved at once (up to some thousand). With covariances of points
and shared effects, the points' own unknowns are eliminated one by one, and the remaining C and all z are solved:
thousands of points in thousands of epochs are a few matrix products.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import EstimationError, ValidityError
from catseye.estimation.harmonic.body import moved, rigid_design, rigid_part
from catseye.estimation.harmonic.dense import solved_together
from catseye.estimation.harmonic.eliminated import solved_by_elimination
from catseye.estimation.harmonic.labels import NUMBERED, HarmonicLabels

TOGETHER = 3000  # unknowns: limit with a full covariance


@dataclass(frozen=True, eq=False)
class Spread:
    """Covariance of an epoch's points: `full`, or `points` and shared effects.

    full     (T or 1, 3n, 3n) m^2
    points   (T or 1, n, 3, 3) m^2
    shared   (T or 1, n, 3, r) m: factor U of the shared effects
    """

    full: Array | None = None
    points: Array | None = None
    shared: Array | None = None


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """Harmonic fit of a body and its points.

    rigid              (6, K) m and rad per unit of the body's functions
    own                (n, 3, m) m per unit of the points' functions
    own_covariance     (n, 3 m, 3 m), function by function
    cross              (n, 3 m, 6 K) between a point's own and the body's, function by function
    rigid_covariance   (6 K, 6 K), function by function
    six                (6, m) rigid part of the points' own shifts, unweighted; NaN if undetermined
    six_covariance     (6 (K + m), 6 (K + m)) of the body's functions, then of `six`
    shared             (T, r) estimated z
    residual           (T, n, 3) m, observed less R C b + A o, shared effects included; NaN if not measured
    pvv, degrees_of_freedom
    whole              covariance of all unknowns, the body's then the points', if solved jointly
    """

    rigid: Array
    own: Array
    own_covariance: Array
    cross: Array
    rigid_covariance: Array
    six: Array
    six_covariance: Array
    shared: Array
    residual: Array
    pvv: float
    degrees_of_freedom: int
    whole: Array | None = None

    @property
    def variance_factor(self) -> float:
        """Variance factor [pvv] / degrees of freedom, expectation 1.

        It is NaN without any.
        """
        return self.pvv / self.degrees_of_freedom if self.degrees_of_freedom > 0 else float("nan")

    def displacement(self, body: Array, own: Array, arms: Array) -> Array:
        """Displacement (P, n, 3), m, in P epochs.

        body, own   (P, K), (P, m) functions of the epochs
        arms        (n, 3) m, points from the pivot
        """
        return moved(body @ self.rigid.T, arms) + np.einsum("pm,nim->pni", own, self.own)

    def covariance(self, body: Array, own: Array, arms: Array) -> Array:
        """Covariance (P, n, 3, 3), m^2, of `displacement`, per point.

        Arguments as for `displacement`.
        """
        n, m = len(self.own), self.own.shape[2]
        r = rigid_design(arms)
        k = body.shape[1]
        six = np.einsum("pk,kjlh,pl->pjh", body, self.rigid_covariance.reshape(k, 6, k, 6), body)
        rigid = np.einsum("nij,pjh,nlh->pnil", r, six, r)
        mixed = np.einsum("pf,nfikj,pk->pnij", own, self.cross.reshape(n, m, 3, k, 6), body)
        mixed = np.einsum("pnij,nlj->pnil", mixed, r)
        blocks = self.own_covariance.reshape(n, m, 3, m, 3)
        return (
            rigid + mixed + np.swapaxes(mixed, -1, -2) + np.einsum("pf,nfigl,pg->pnil", own, blocks, own, optimize=True)
        )

    def whole_covariance(self, body: Array, own: Array, arms: Array) -> Array:
        """Joint covariance (P, 3n, 3n), m^2, of `displacement` of all points, if solved jointly.

        Raises ValidityError if points were eliminated: covariances between them are not stored.
        """
        if self.whole is None:
            raise ValidityError("points were eliminated one by one: covariances between them are not stored")
        n = len(self.own)
        rows = np.concatenate(
            [
                np.einsum("nij,pk->pnikj", rigid_design(arms), body).reshape(len(body), 3 * n, -1),
                np.einsum("nq,il,pf->pniqfl", np.eye(n), np.eye(3), own).reshape(len(own), 3 * n, -1),
            ],
            axis=2,
        )
        return rows @ self.whole @ np.swapaxes(rows, -1, -2)


def fit_harmonics(
    displacement: Array,
    arms: Array,
    *,
    body: Array,
    own: Array,
    spread: Spread,
    labels: HarmonicLabels = NUMBERED,
) -> HarmonicFit:
    """Motion of a body and of its points from many epochs.

    displacement   (T, n, 3) m; NaN if a point was not measured (any coordinate: all three)
    arms           (n, 3) m, points from the pivot of the rotations
    body           (T, K) functions of the body's shift and turn; K may be 0
    own            (T, m) functions of the points; m may be 0; linearly independent of the body's
    spread         covariance of the displacements
    labels         names of points and functions, for messages

    Raises ValidityError for inconsistent shapes or invalid covariances, EstimationError for undetermined unknowns.

    Source: [RAO73] section 4a: least squares with a full covariance; the z are unknowns with their prior.

    >>> t = np.linspace(0.0, 1.0, 5)[:, None]
    >>> arms = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> measured = np.einsum("tk,i->tki", t, [1.0, 0.0, 2.0]) + np.zeros((5, 3, 3))
    >>> none = np.zeros((5, 0))
    >>> fit = fit_harmonics(measured, arms, body=t, own=none, spread=Spread(points=np.eye(3)[None, None]))
    >>> fit.rigid[:3, 0].round(9).astype(int).tolist()
    [1, 0, 2]
    """
    y = np.array(displacement, dtype=float)
    _refuse_shapes(y, arms, body, own, labels)
    measured = np.isfinite(y).all(axis=2)
    y[~measured] = 0.0
    r = rigid_design(np.asarray(arms, dtype=float))
    if spread.full is not None:
        if 6 * body.shape[1] + 3 * len(arms) * own.shape[1] > TOGETHER:
            raise ValidityError(
                f"{len(arms)} points with a full covariance are too many unknowns (expected at most {TOGETHER}): give "
                "covariances of points and shared effects"
            )
        solved = solved_together(y, measured, r, body=body, local=own, full=spread.full, labels=labels)
    elif spread.points is not None:
        solved = solved_by_elimination(
            y, measured, r, body=body, local=own, points=spread.points, shared=spread.shared, labels=labels
        )
    else:
        raise ValidityError("a spread has neither a full covariance nor those of points (expected one)")
    six, six_covariance = _rigid_parts(
        solved.own, np.asarray(arms, dtype=float), solved.six_link, solved.rigid_covariance
    )
    residual = y - moved(body @ solved.rigid.T, arms) - np.einsum("tm,nim->tni", own, solved.own)
    residual[~measured] = np.nan
    unknown = 6 * body.shape[1] + 3 * len(arms) * own.shape[1]
    return HarmonicFit(
        rigid=solved.rigid,
        own=solved.own,
        own_covariance=solved.own_covariance,
        cross=solved.cross,
        rigid_covariance=solved.rigid_covariance,
        six=six,
        six_covariance=six_covariance,
        shared=solved.shared,
        residual=residual,
        pvv=solved.pvv,
        degrees_of_freedom=3 * int(measured.sum()) - unknown,
        whole=solved.full_covariance,
    )


def _rigid_parts(own: Array, arms: Array, link: Array | None, rigid_covariance: Array) -> tuple[Array, Array]:
    """Rigid part (6, m) of the points' shifts, and its joint covariance with the body's functions."""
    m = own.shape[2]
    if link is None:
        size = len(rigid_covariance) + 6 * m
        covariance = np.full((size, size), np.nan)
        covariance[: len(rigid_covariance), : len(rigid_covariance)] = rigid_covariance
        return np.full((6, m), np.nan), covariance
    part = rigid_part(arms)
    assert part is not None  # link says so
    return np.einsum("jni,nim->jm", part, own), link


def _refuse_shapes(y: Array, arms: Array, body: Array, own: Array, labels: HarmonicLabels) -> None:
    if y.ndim != 3 or y.shape[2] != 3 or np.shape(arms) != y.shape[1:]:
        raise ValidityError(f"displacements {y.shape}, arms {np.shape(arms)}: expected (T, n, 3) and (n, 3)")
    for name, rows in (("body", body), ("own", own)):
        if rows.ndim != 2 or len(rows) != len(y) or not np.isfinite(rows).all():
            raise ValidityError(f"functions {name} have shape {rows.shape} (expected ({len(y)}, k), finite)")
    if not body.shape[1] and not own.shape[1]:
        raise ValidityError("no function of the body or of the points")
    never = np.flatnonzero(~np.isfinite(y).all(axis=2).any(axis=0))
    if len(never):
        raise EstimationError(f"{labels.point(int(never[0]))} was measured in no epoch: leave it out")
