"""How two epochs hang together: what their datums may differ by, and the joint covariance of their coordinates.

Independent epochs: what either holds no more than it must is a convention, and only what no motion of the datum
explains is tested. A second epoch that holds points at the first epoch's result takes the errors of that result over:
its coordinates follow the held ones by J = -(A_f' P A_f)^-1 A_f' P A_d, and the difference has the covariance
Q_1 + J Q_dd J' + Q_0 - J Q_d0 - Q_0d J', Q_0 of the first epoch, Q_1 of the second with its datum taken as exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.common_points import listed
from catseye.estimation.deformation.congruence import DATUMS, HELD_APART, UNSEEN, Epochs
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.network.datum import Floating, floating_motions, to_datum, transformed
from catseye.estimation.network.model import NetworkSolution
from catseye.estimation.observations.kinds import Linear

CHUNK = 600  # columns of a covariance asked for at once
CHECKED = 60  # coordinates whose covariance is compared with the observations'
AGREES = 1e-3  # of a variance: a covariance that differs by more does not come from these weights
EXCHANGED = "the first epoch holds {names} at the second's result; give the epochs in the order of their adjustment"
FOREIGN = (
    "the {which} epoch holds {names} at coordinates that do not come from the other epoch (up to {apart:.3g} m off); "
    "adjust it free (datum 'free'), or say what the datums may differ by (datum=)"
)
STRANGE = (
    "the {which} epoch holds {names}, which the other epoch does not have{alike}; adjust it free (datum 'free'), or "
    "say what the datums may differ by (datum=)"
)
PARTLY = "{names} are held in the second epoch {apart:.3g} m from the first's result, others at it; hold all at it"
REWEIGHTED = (
    "the second epoch hangs on the first's result, but its covariance is not that of its observations' sigmas "
    "(robust weights?); adjust it with these, or free"
)


def _rows(solution: NetworkSolution) -> tuple[list[ActiveRows], np.ndarray]:
    """All observations of a solution, priors among them, as they were used, and the whole parameter vector."""
    parameters, offset = solution.network.parameters, solution.x.size
    rows = [ActiveRows.of(g, fit.active) for g, fit in zip(solution.network.groups, solution.fits, strict=True)]
    sigma = np.array([p.sigma for p in parameters])
    known = np.flatnonzero((sigma > 0.0) & np.isfinite(sigma))
    if len(known):
        start = np.array([parameters[k].start for k in known])
        rows.append(ActiveRows.of(Linear("priors", start, sigma[known] ** 2, offset + known, np.eye(len(known)))))
    return rows, solution.state


def _floating(solution: NetworkSolution) -> Floating:
    """What the observations alone leave floating, whatever coordinates are held."""
    rows, x = _rows(solution)
    held = np.array([p.sigma == 0.0 for p in solution.network.parameters], dtype=bool)
    absent = solution.network.points.absent
    free = np.concatenate([~absent.ravel(), ~held])
    return floating_motions(rows, x, _coordinates(solution), free=free, absent=absent)


@dataclass(frozen=True, eq=False)
class DatumConnection:
    """Connection of the two datums.

    datum       what they may differ by
    same        names of points with coordinates held in both epochs, more of them than the datum needs
    carried     (name, axis) of coordinates held in the second epoch at the first's result, likewise
    departure   m, the largest by which they differ from it
    u           m, standard uncertainty of that
    released    what floats in each epoch whose held coordinates are a mere convention; None for the others
    """

    datum: str
    same: tuple[str, ...]
    carried: tuple[tuple[str, int], ...]
    departure: float
    u: float
    released: tuple[Floating | None, Floating | None]

    @classmethod
    def of(
        cls, first: NetworkSolution, second: NetworkSolution, datum: str | None, rounding: float
    ) -> "DatumConnection":
        """Of two adjusted epochs; arguments as of `compare`."""
        if datum is not None and datum not in DATUMS:
            raise EstimationError(f"datum {datum!r} is none of {', '.join(DATUMS)}")
        floats = [_floating(s) for s in (first, second)]
        fixed = [s.network.points.fixed for s in (first, second)]
        loose = [_minimal(floating, f) for floating, f in zip(floats, fixed, strict=True)]
        owns = [{} if free else _held(s) for s, free in zip((first, second), loose, strict=True)]
        carried: dict[tuple[str, int], float] = {}
        foreign: list[dict[tuple[str, int], float]] = [{}, {}]
        for own, other, strange, at, of_second in (
            (owns[0], owns[1], foreign[0], second, False),
            (owns[1], owns[0], foreign[1], first, True),
        ):
            for (name, axis), value in own.items():
                known = name in at.index
                if (name, axis) in other or (known and at.network.points.absent[at.index[name], axis]):
                    continue
                there = at.x[at.index[name], axis] if known else np.inf
                by = abs(value - there)
                (carried if of_second and by <= max(rounding, HELD_APART) else strange)[name, axis] = by
        if datum is None:
            names = [s.network.points.names for s in (first, second)]
            _refuse_foreign(foreign, carried, max(rounding, HELD_APART), names=names)
            datum = _least_datum(np.concatenate([f.kinds for f in floats], axis=1))
        departure = max(carried.values(), default=0.0)
        same = dict.fromkeys(name for name, axis in owns[1] if (name, axis) in owns[0])
        return cls(
            datum=datum,
            same=tuple(same),
            carried=tuple(carried),
            departure=departure,
            u=rounding / 12**0.5 if departure > HELD_APART else 0.0,
            released=tuple(f if free and x.any() else None for f, free, x in zip(floats, loose, fixed, strict=True)),  # type: ignore[arg-type]
        )


def _coordinates(solution: NetworkSolution) -> np.ndarray:
    """(n, 3) m, finite: 0 where a point has no such coordinate."""
    return solution.state[: solution.x.size].reshape(-1, 3)


def _held(solution: NetworkSolution) -> dict[tuple[str, int], float]:
    points = solution.network.points
    return {(points.names[i], int(a)): float(points.xyz[i, a]) for i, a in np.argwhere(points.fixed)}


def _minimal(floating: Floating, fixed: np.ndarray) -> bool:
    """True if held coordinates only choose among datums: every one holds a motion that nothing else holds."""
    held = floating.motions[: fixed.size][fixed.ravel()]
    return len(held) == 0 or (len(held) <= held.shape[1] and bool(np.linalg.matrix_rank(held, tol=1e-6) == len(held)))


def _refuse_foreign(
    foreign: list[dict[tuple[str, int], float]],
    carried: dict[tuple[str, int], float],
    tolerance: float,
    *,
    names: Sequence[Sequence[str]],
) -> None:
    """Refuse coordinates held in one epoch alone; names are those of both epochs' points."""
    if foreign[0] and max(foreign[0].values()) <= tolerance:
        raise EstimationError(EXCHANGED.format(names=listed([name for name, _ in foreign[0]])))
    for which, strange in zip(("first", "second"), foreign, strict=True):
        if strange:
            known = [by for by in strange.values() if np.isfinite(by)]
            held = listed([name for name, _ in strange])
            if not known:
                folded = {name.casefold(): name for name in names[which == "first"]}
                pairs = {name: folded[name.casefold()] for name, _ in strange if name.casefold() in folded}
                said = listed([f"{name} and {other}" for name, other in pairs.items()])
                alike = f" (by another case: {said})" if pairs else ""
                raise EstimationError(STRANGE.format(which=which, names=held, alike=alike))
            text = PARTLY if which == "second" and carried else FOREIGN
            raise EstimationError(text.format(which=which, names=held, apart=max(known)))


def _least_datum(kinds: np.ndarray) -> str:
    """The datum with the fewest motions that has all of these (7, d)."""
    part = np.linalg.norm(kinds, axis=1)
    needed = set(np.flatnonzero(part > 1e-6 * part.max(initial=0.0)).tolist()) if kinds.size else set()
    return next(name for name, motions in DATUMS.items() if needed <= set(motions))


@dataclass(frozen=True, eq=False)
class EpochModel:
    """Joint stochastic model of n common points in both epochs; coordinates are numbered 0 to 3n - 1.

    x, y             (n, 3) m, first and second; carried coordinates of the second are the first's
    q                covariances of the epochs, and
    columns          (3n,) where the coordinates stand in them
    compared         (3n,) bool: in both epochs; elsewhere x or y is 0
    follow           (3n, k) of the second epoch's coordinates by the k carried ones; unit rows for these themselves
    carried          (k,) which coordinates these are
    rounded          (3n, k) follow where it is not a unit row, times the standard uncertainty of rounding
    of_carried       (3n, k) m^2, covariance of the first epoch's coordinates with the carried ones
    """

    names: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    q: tuple[Covariance, Covariance]
    columns: tuple[np.ndarray, np.ndarray]
    compared: np.ndarray
    follow: np.ndarray
    carried: np.ndarray
    rounded: np.ndarray
    of_carried: np.ndarray

    @classmethod
    def of(
        cls, first: NetworkSolution, second: NetworkSolution, names: tuple[str, ...], held: DatumConnection
    ) -> "EpochModel":
        """Of the points named, those that carry the datum among them."""
        columns = [
            (3 * np.array([s.index[name] for name in names])[:, None] + np.arange(3)).ravel() for s in (first, second)
        ]
        compared = np.logical_and(
            *(s.network.points.existing.ravel()[at] for s, at in zip((first, second), columns, strict=True))
        )
        place = {name: i for i, name in enumerate(names)}
        carried = np.array([3 * place[name] + axis for name, axis in held.carried], dtype=int)
        q = [
            s.q if floating is None else _released(s.q, floating, at[compared])
            for s, floating, at in zip((first, second), held.released, columns, strict=True)
        ]
        follow, of_carried = (np.zeros((3 * len(names), len(carried))) for _ in range(2))
        if len(carried):
            follow = _follow(second, columns[1], columns[1][carried])
            of_carried = q[0].across(columns[0][carried])[columns[0]]
        rounded = held.u * follow
        follow[carried] = np.eye(len(carried))
        x, y = (s.state[at] for s, at in zip((first, second), columns, strict=True))
        y = np.where(np.isin(np.arange(len(y)), carried), x, y)
        return cls(
            names=names,
            x=x.reshape(-1, 3),
            y=y.reshape(-1, 3),
            q=(q[0], q[1]),
            columns=(columns[0], columns[1]),
            compared=compared,
            follow=follow,
            carried=carried,
            rounded=rounded,
            of_carried=of_carried,
        )

    def parts(self, rows: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Covariances of coordinates `rows` with `chosen`: in the first, in the second epoch, and both across.

        The third is of the first epoch's rows with the second's chosen ones, the fourth the other way round.
        """
        own = []
        for q, at in zip(self.q, self.columns, strict=True):
            own.append(q.within(at[rows]) if rows is chosen else q.across(at[chosen])[at[rows]])
        f, g = self.follow[rows], self.follow[chosen]
        second = own[1] + f @ self.of_carried[self.carried] @ g.T + self.rounded[rows] @ self.rounded[chosen].T
        return own[0], second, self.of_carried[rows] @ g.T, f @ self.of_carried[chosen].T

    def epochs(self, points: np.ndarray) -> Epochs:
        """Some of the points, those that carry the datum among them, with all their covariances."""
        at = (3 * points[:, None] + np.arange(3)).ravel()
        q1, q2, cross, _ = self.parts(at, at)
        names = tuple(self.names[i] for i in points)
        seen = self.compared.reshape(-1, 3)[points]
        return Epochs(names, self.x[points], self.y[points], q1, q2, cross=cross, compared=seen)

    def of_points(self, points: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """(m, 3, 3) m^2, covariance of each point's difference by itself, the second epoch turned (3, 3)."""
        at = 3 * points[:, None] + np.arange(3)
        (q1, q2), (c1, c2) = self.q, self.columns
        f, r = turned @ self.follow[at], turned @ self.rounded[at]
        cross = self.of_carried[at] @ f.transpose(0, 2, 1)
        second = turned @ q2.blocks(c2[at[:, 0]]) @ turned.T + r @ r.transpose(0, 2, 1)
        second = second + f @ self.of_carried[self.carried] @ f.transpose(0, 2, 1)
        return q1.blocks(c1[at[:, 0]]) + second - cross - cross.transpose(0, 2, 1)


def _released(q: Covariance, floating: Floating, columns: np.ndarray) -> Covariance:
    """A covariance without its held coordinates: in the datum of inner constraints on some columns.

    A motion that does not show in these stays as it was held: it does not change them.
    """
    _, s, vt = np.linalg.svd(floating.motions[columns], full_matrices=False)
    motions = floating.motions @ vt[: int(np.sum(s > UNSEEN * s.max(initial=1e-300)))].T
    if not motions.shape[1]:
        return q
    conditions = np.zeros(motions.T.shape)
    conditions[:, columns] = motions[columns].T
    zero = np.zeros(len(motions))
    return transformed(q, to_datum(zero, zero, motions, conditions=conditions)[1], conditions)


def _follow(solution: NetworkSolution, columns: np.ndarray, held: np.ndarray) -> np.ndarray:
    """How coordinates (n,) follow held ones (k,): -(A_f' P A_f)^-1 A_f' P A_d, (n, k)."""
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
    pull = (a.T @ a[:, held]).toarray()
    chunks = np.split(columns, np.arange(CHUNK, len(columns), CHUNK))
    return -np.concatenate([solution.q.across(chunk).T @ pull for chunk in chunks])
