"""Joint stochastic model of two epochs: allowed datum differences and joint covariance.

Independent epochs: a minimally constrained datum is a convention, and only the part that no datum motion explains is
tested. A second epoch that fixes points at the first epoch's result inherits its errors: its coordinates follow the
fixed ones by J = -(A_f' P A_f)^-1 A_f' P A_d, and the difference has the covariance
Q_1 + J Q_dd J' + Q_0 - J Q_d0 - Q_0d J', Q_0 of the first epoch, Q_1 of the second with its datum taken as exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.common_points import listed
from catseye.estimation.deformation.congruence import DATUMS, FIXED_TOLERANCE, UNSEEN, Epochs
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.network.datum import Floating, floating_motions, to_datum, transformed
from catseye.estimation.network.model import NetworkSolution
from catseye.estimation.observations.kinds import Linear

CHUNK = 600  # columns of a covariance per batch
CHECKED = 60  # coordinates whose covariance is checked against the observations
AGREES = 1e-3  # of a variance: a covariance that differs by more was computed with other weights
EXCHANGED = "the first epoch fixes {names} at the second's result; give the epochs in the order of their adjustment"
FOREIGN = (
    "the {which} epoch fixes {names} at coordinates that are not those of the other epoch (up to {apart:.3g} m off); "
    "adjust it free (datum 'free'), or give the allowed datum differences (datum=)"
)
STRANGE = (
    "the {which} epoch fixes {names}, missing in the other epoch{alike}; adjust it free (datum 'free'), or "
    "give the allowed datum differences (datum=)"
)
PARTLY = "{names} are fixed in the second epoch {apart:.3g} m from the first's result, others at it; fix all at it"
REWEIGHTED = (
    "the second epoch depends on the first's result, but its covariance does not match its observations' sigmas "
    "(robust weights?); adjust it with these sigmas, or free"
)


def _rows(solution: NetworkSolution) -> tuple[list[ActiveRows], np.ndarray]:
    """Observations and priors of a solution as used, and the full parameter vector."""
    parameters, offset = solution.network.parameters, solution.x.size
    rows = [ActiveRows.of(g, fit.active) for g, fit in zip(solution.network.groups, solution.fits, strict=True)]
    sigma = np.array([p.sigma for p in parameters])
    priors = np.flatnonzero((sigma > 0.0) & np.isfinite(sigma))
    if len(priors):
        start = np.array([parameters[k].start for k in priors])
        rows.append(ActiveRows.of(Linear("priors", start, sigma[priors] ** 2, offset + priors, np.eye(len(priors)))))
    return rows, solution.state


def _floating(solution: NetworkSolution) -> Floating:
    """Null space of the observations alone, without fixed coordinates."""
    rows, x = _rows(solution)
    fixed = np.array([p.sigma == 0.0 for p in solution.network.parameters], dtype=bool)
    absent = solution.network.points.absent
    free = np.concatenate([~absent.ravel(), ~fixed])
    return floating_motions(rows, x, _coordinates(solution), free=free, absent=absent)


@dataclass(frozen=True, eq=False)
class DatumConnection:
    """Connection of the two datums.

    datum                 allowed differences
    common_fixed          names of points with coordinates fixed in both epochs, more than the datum needs
    carried_coordinates   (name, axis) of coordinates fixed in the second epoch at the first's result, likewise
    departure             m, largest difference from it
    u                     m, standard uncertainty of that
    released              null space of each epoch with a minimally constrained datum; None for the others
    """

    datum: str
    common_fixed: tuple[str, ...]
    carried_coordinates: tuple[tuple[str, int], ...]
    departure: float
    u: float
    released: tuple[Floating | None, Floating | None]

    @classmethod
    def of(
        cls, first: NetworkSolution, second: NetworkSolution, datum: str | None, rounding: float
    ) -> "DatumConnection":
        """Connection of two adjusted epochs; arguments as of `compare`."""
        if datum is not None and datum not in DATUMS:
            raise EstimationError(f"unknown datum {datum!r} (expected one of {', '.join(DATUMS)})")
        floats = [_floating(s) for s in (first, second)]
        fixed = [s.network.points.fixed for s in (first, second)]
        loose = [_minimal(floating, f) for floating, f in zip(floats, fixed, strict=True)]
        fixed_values = [{} if free else _fixed(s) for s, free in zip((first, second), loose, strict=True)]
        carried_offsets: dict[tuple[str, int], float] = {}
        foreign: list[dict[tuple[str, int], float]] = [{}, {}]
        for local, opposite, unmatched, other_epoch, of_second in (
            (fixed_values[0], fixed_values[1], foreign[0], second, False),
            (fixed_values[1], fixed_values[0], foreign[1], first, True),
        ):
            for (name, axis), value in local.items():
                in_other = name in other_epoch.index
                if (name, axis) in opposite or (
                    in_other and other_epoch.network.points.absent[other_epoch.index[name], axis]
                ):
                    continue
                position = other_epoch.x[other_epoch.index[name], axis] if in_other else np.inf
                by = abs(value - position)
                (carried_offsets if of_second and by <= max(rounding, FIXED_TOLERANCE) else unmatched)[name, axis] = by
        if datum is None:
            names = [s.network.points.names for s in (first, second)]
            _refuse_foreign(foreign, carried_offsets, max(rounding, FIXED_TOLERANCE), names=names)
            datum = _least_datum(np.concatenate([f.kinds for f in floats], axis=1))
        departure = max(carried_offsets.values(), default=0.0)
        common_names = dict.fromkeys(name for name, axis in fixed_values[1] if (name, axis) in fixed_values[0])
        return cls(
            datum=datum,
            common_fixed=tuple(common_names),
            carried_coordinates=tuple(carried_offsets),
            departure=departure,
            u=rounding / 12**0.5 if departure > FIXED_TOLERANCE else 0.0,
            released=tuple(f if free and x.any() else None for f, free, x in zip(floats, loose, fixed, strict=True)),  # type: ignore[arg-type]
        )


def _coordinates(solution: NetworkSolution) -> np.ndarray:
    """(n, 3) m, finite: 0 where a point has no such coordinate."""
    return solution.state[: solution.x.size].reshape(-1, 3)


def _fixed(solution: NetworkSolution) -> dict[tuple[str, int], float]:
    points = solution.network.points
    return {(points.names[i], int(a)): float(points.xyz[i, a]) for i, a in np.argwhere(points.fixed)}


def _minimal(floating: Floating, fixed: np.ndarray) -> bool:
    """True if fixed coordinates only choose the datum: none of them is redundant."""
    fixed_motions = floating.motions[: fixed.size][fixed.ravel()]
    return len(fixed_motions) == 0 or (
        len(fixed_motions) <= fixed_motions.shape[1]
        and bool(np.linalg.matrix_rank(fixed_motions, tol=1e-6) == len(fixed_motions))
    )


def _refuse_foreign(
    foreign: list[dict[tuple[str, int], float]],
    carried: dict[tuple[str, int], float],
    tolerance: float,
    *,
    names: Sequence[Sequence[str]],
) -> None:
    """Refuse coordinates fixed in one epoch only.

    `names` are the point names of both epochs.
    """
    if foreign[0] and max(foreign[0].values()) <= tolerance:
        raise EstimationError(EXCHANGED.format(names=listed([name for name, _ in foreign[0]])))
    for which, unmatched in zip(("first", "second"), foreign, strict=True):
        if unmatched:
            distances = [by for by in unmatched.values() if np.isfinite(by)]
            fixed_names = listed([name for name, _ in unmatched])
            if not distances:
                folded = {name.casefold(): name for name in names[which == "first"]}
                pairs = {name: folded[name.casefold()] for name, _ in unmatched if name.casefold() in folded}
                pairs_text = listed([f"{name} and {partner}" for name, partner in pairs.items()])
                alike = f" (differing only in case: {pairs_text})" if pairs else ""
                raise EstimationError(STRANGE.format(which=which, names=fixed_names, alike=alike))
            text = PARTLY if which == "second" and carried else FOREIGN
            raise EstimationError(text.format(which=which, names=fixed_names, apart=max(distances)))


def _least_datum(kinds: np.ndarray) -> str:
    """Datum with the fewest motions that includes all of these (7, d)."""
    part = np.linalg.norm(kinds, axis=1)
    needed = set(np.flatnonzero(part > 1e-6 * part.max(initial=0.0)).tolist()) if kinds.size else set()
    return next(name for name, motions in DATUMS.items() if needed <= set(motions))


@dataclass(frozen=True, eq=False)
class EpochModel:
    """Joint stochastic model of n common points in both epochs.

    Coordinates are numbered 0 to 3n - 1.

    x, y                 (n, 3) m, first and second; carried coordinates of the second are the first's
    q                    covariances of the epochs, and
    columns              (3n,) indices of the coordinates in them
    compared             (3n,) bool: in both epochs; elsewhere x or y is 0
    follow               (3n, k) derivatives of the second epoch's coordinates by the k carried ones; unit rows for
                         these
    carried_indices      (k,) of the carried coordinates
    rounded              (3n, k) follow where it is not a unit row, times the standard uncertainty of rounding
    carried_covariance   (3n, k) m^2, covariance of the first epoch's coordinates with the carried ones
    """

    names: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    q: tuple[Covariance, Covariance]
    columns: tuple[np.ndarray, np.ndarray]
    compared: np.ndarray
    follow: np.ndarray
    carried_indices: np.ndarray
    rounded: np.ndarray
    carried_covariance: np.ndarray

    @classmethod
    def of(
        cls, first: NetworkSolution, second: NetworkSolution, names: tuple[str, ...], connection: DatumConnection
    ) -> "EpochModel":
        """Model of the named points, including those that define the datum."""
        columns = [
            (3 * np.array([s.index[name] for name in names])[:, None] + np.arange(3)).ravel() for s in (first, second)
        ]
        compared = np.logical_and(
            *(s.network.points.existing.ravel()[at] for s, at in zip((first, second), columns, strict=True))
        )
        place = {name: i for i, name in enumerate(names)}
        carried_indices = np.array([3 * place[name] + axis for name, axis in connection.carried_coordinates], dtype=int)
        q = [
            s.q if floating is None else _released(s.q, floating, at[compared])
            for s, floating, at in zip((first, second), connection.released, columns, strict=True)
        ]
        follow, carried_covariance = (np.zeros((3 * len(names), len(carried_indices))) for _ in range(2))
        if len(carried_indices):
            follow = _follow(second, columns[1], columns[1][carried_indices])
            carried_covariance = q[0].across(columns[0][carried_indices])[columns[0]]
        rounded = connection.u * follow
        follow[carried_indices] = np.eye(len(carried_indices))
        x, y = (s.state[at] for s, at in zip((first, second), columns, strict=True))
        y = np.where(np.isin(np.arange(len(y)), carried_indices), x, y)
        return cls(
            names=names,
            x=x.reshape(-1, 3),
            y=y.reshape(-1, 3),
            q=(q[0], q[1]),
            columns=(columns[0], columns[1]),
            compared=compared,
            follow=follow,
            carried_indices=carried_indices,
            rounded=rounded,
            carried_covariance=carried_covariance,
        )

    def parts(self, rows: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Covariances of coordinates `rows` with `chosen`: first epoch, second epoch, and two cross blocks.

        The third is of the first epoch's rows with the second's chosen ones, the fourth the other way round.
        """
        blocks = []
        for q, at in zip(self.q, self.columns, strict=True):
            blocks.append(q.within(at[rows]) if rows is chosen else q.across(at[chosen])[at[rows]])
        f, g = self.follow[rows], self.follow[chosen]
        second = (
            blocks[1]
            + f @ self.carried_covariance[self.carried_indices] @ g.T
            + self.rounded[rows] @ self.rounded[chosen].T
        )
        return blocks[0], second, self.carried_covariance[rows] @ g.T, f @ self.carried_covariance[chosen].T

    def epochs(self, points: np.ndarray) -> Epochs:
        """Epochs of selected points (with those that define the datum), with full covariances."""
        at = (3 * points[:, None] + np.arange(3)).ravel()
        q1, q2, cross, _ = self.parts(at, at)
        names = tuple(self.names[i] for i in points)
        compared = self.compared.reshape(-1, 3)[points]
        return Epochs(
            names=names,
            first=self.x[points],
            second=self.y[points],
            covariance_first=q1,
            covariance_second=q2,
            cross=cross,
            compared=compared,
        )

    def of_points(self, points: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """Covariance (m, 3, 3) m^2 of single points' differences, the second epoch rotated (3, 3)."""
        at = 3 * points[:, None] + np.arange(3)
        (q1, q2), (c1, c2) = self.q, self.columns
        f, r = turned @ self.follow[at], turned @ self.rounded[at]
        cross = self.carried_covariance[at] @ f.transpose(0, 2, 1)
        second = turned @ q2.blocks(c2[at[:, 0]]) @ turned.T + r @ r.transpose(0, 2, 1)
        second = second + f @ self.carried_covariance[self.carried_indices] @ f.transpose(0, 2, 1)
        return q1.blocks(c1[at[:, 0]]) + second - cross - cross.transpose(0, 2, 1)


def _released(q: Covariance, floating: Floating, columns: np.ndarray) -> Covariance:
    """Covariance without fixed coordinates: in the datum of inner constraints on some columns.

    A motion that is not observable in these columns stays fixed as it was: it does not change them.
    """
    _, s, vt = np.linalg.svd(floating.motions[columns], full_matrices=False)
    motions = floating.motions @ vt[: int(np.sum(s > UNSEEN * s.max(initial=1e-300)))].T
    if not motions.shape[1]:
        return q
    conditions = np.zeros(motions.T.shape)
    conditions[:, columns] = motions[columns].T
    zero = np.zeros(len(motions))
    return transformed(q, to_datum(zero, zero, motions, conditions=conditions)[1], conditions)


def _follow(solution: NetworkSolution, columns: np.ndarray, fixed_columns: np.ndarray) -> np.ndarray:
    """Derivatives (n, k) of coordinates (n,) by fixed ones (k,): -(A_f' P A_f)^-1 A_f' P A_d."""
    from scipy.sparse import csr_array, vstack

    rows, x = _rows(solution)
    parts = []
    for r in rows:
        at, jacobian = r.row_columns(), r.linear(x)[1]
        i = np.broadcast_to(np.arange(len(at))[:, None], at.shape)
        parts.append(csr_array((jacobian[at >= 0], (i[at >= 0], at[at >= 0])), shape=(len(at), len(x))))
    a = csr_array(vstack(parts))
    image = a @ solution.q.across(columns[:CHECKED])
    claimed = solution.q.within(columns[:CHECKED])
    if np.abs(image.T @ image - claimed).max() > AGREES * np.abs(claimed).max():
        raise EstimationError(REWEIGHTED)
    pull = (a.T @ a[:, fixed_columns]).toarray()
    chunks = np.split(columns, np.arange(CHUNK, len(columns), CHUNK))
    return -np.concatenate([solution.q.across(chunk).T @ pull for chunk in chunks])
